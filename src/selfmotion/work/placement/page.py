"""Where the part or the arm is best put, as a page."""

from __future__ import annotations

import html
import math
from pathlib import Path

from selfmotion.basics import ProblemError, as_path, shown, write_text
from selfmotion.work.placement.picture import in_unit, legend_of
from selfmotion.work.placement.results import PlaceMap, Placement

# Characters of a reason on the page, and how many of them.
_LONGEST, _MOST_REASONS = 120, 8

_STYLE = """
body { font-family: system-ui, sans-serif; color: #222 }
body { margin: 1em auto; padding: 0 1em; max-width: 76em }
h1 { font-size: 1.4em; margin: 0 0 .3em } h2 { font-size: 1.05em; margin: 1em 0 .3em }
p { margin: .3em 0 } svg { display: block; width: 100%; height: auto; max-height: 92vh }
table { border-collapse: collapse } summary { cursor: pointer; margin: .6em 0 }
td, th { padding: .25em .8em .25em 0; text-align: right; white-space: nowrap;
  border-bottom: 1px solid #ddd }
.key { display: flex; flex-wrap: wrap; gap: .2em 1.2em; margin: .4em 0; font-size: .9em }
.key i { display: inline-block; width: 1.4em; height: .9em }
.key i { margin-right: .4em; vertical-align: -1px }
li { margin: .2em 0; overflow-wrap: anywhere }
@media (min-width: 60em) {
  main { display: grid; grid-template-columns: minmax(0, 1fr) 22em; gap: 0 2em; align-items: start }
}
"""


def write_placement(placement: Placement, file: str | Path, places: PlaceMap | None = None) -> Path:
    """Write a page with the place, what limits it, and a map if one is given; atomically.

    Parameters
    ----------
    placement : Placement
        As `place` returns it.
    file : path
    places : PlaceMap, optional
        As `Placement.map` returns it.

    Raises
    ------
    ProblemError
        It is no placement.
    FileFormatError
        The file cannot be written.
    """
    if not isinstance(placement, Placement):
        raise ProblemError(f"placement is {shown(placement)}, expected a Placement")
    path = as_path(file)
    title = f"Where to put the {placement.of}"
    lines = "".join(f"<p>{html.escape(line)}</p>" for line in _lines(placement))
    drawn = ""
    if places is not None:
        drawn = (
            f'<section>{places.svg()}<div class="key">{legend_of(places)}</div>'
            f"{_reasons(places)}</section>"
        )
    write_text(
        path,
        f'<!doctype html><html lang="en"><meta charset="utf-8">'
        f'<meta name="viewport" content="width=device-width,initial-scale=1"><title>{title}</title>'
        f"<style>{_STYLE}</style><h1>{title}</h1><main>{drawn}<section>{lines}"
        f"{_choice(placement)}</section></main></html>\n",
    )
    return path


def _lines(placement: Placement) -> list[str]:
    """Return what was found, in words: three digits, and units."""
    by = ", ".join(f"{name} {in_unit(name, value)}" for name, value in placement.place.items())
    _, _, *rest = str(placement).splitlines()
    count = len(placement.plans)
    verified = "verified" if placement.verified else "NOT verified"
    motions = f"{count} motion{'s' if count > 1 else ''}, {verified}"
    before = "; there is no verified motion at the present place"
    if math.isnan(placement.cost_before):
        before = ""
    elif math.isfinite(placement.cost_before):
        before = f", {placement.cost_before:.3g} at the present place"
    return [
        f"Move the {placement.of} by {by}.",
        f"Cost {placement.cost:.3g}{before}; {motions}.",
        *rest,
    ]


def _reasons(places: PlaceMap) -> str:
    """Return why places fail, once for all that fail alike: a phone has nothing to hover with."""
    first, second = places.names
    found: dict[str, list[str]] = {}
    for up, row in zip(places.up.tolist(), places.reasons, strict=True):
        for across, reason in zip(places.across.tolist(), row, strict=True):
            if reason:
                where = f"{first} {in_unit(first, across)}, {second} {in_unit(second, up)}"
                found.setdefault(reason.split(":", 1)[0][:_LONGEST], []).append(where)
    if not found:
        return ""
    items = "".join(
        f"<li>{html.escape(reason)}: {html.escape(told[0])}"
        f"{f' and {len(told) - 1} more' if len(told) > 1 else ''}</li>"
        for reason, told in sorted(found.items(), key=lambda item: -len(item[1]))[:_MOST_REASONS]
    )
    return f"<details><summary>Why there is no plan elsewhere</summary><ul>{items}</ul></details>"


def _choice(placement: Placement) -> str:
    """Return a table of the best places, with how much more each of them costs."""
    names = list(placement.place)
    head = "".join(f"<th>{name}</th>" for name in names)
    rows = []
    for number, item in enumerate(placement.best(), 1):
        values = "".join(
            f"<td>{in_unit(name, float(value))}</td>"
            for name, value in zip(names, item.place, strict=True)
        )
        more = item.cost / placement.cost - 1.0 if placement.cost else 0.0
        rows.append(
            f"<tr><td>{number}</td>{values}<td>{item.cost:.3g}</td><td>{more:+.1%}</td></tr>"
        )
    return (
        f"<h2>Places to choose from</h2><table><tr><th></th>{head}<th>cost</th><th>more</th></tr>"
        f"{''.join(rows)}</table>"
    )
