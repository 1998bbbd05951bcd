"""Where the part or the arm is best put, as a page."""

from __future__ import annotations

import html
import math
from pathlib import Path

from selfmotion.basics import ProblemError, as_path, shown, write_text
from selfmotion.work.placement.found import PlaceMap, Placement

_STYLE = (
    "body{font-family:system-ui,sans-serif;margin:1.5em auto;padding:0 1em;max-width:70em}"
    "svg{width:100%;height:auto}table{border-collapse:collapse}"
    "td,th{padding:.2em .8em;text-align:right;border-bottom:1px solid #ddd}"
    "@media(max-width:30em){td,th{padding:.2em .3em}h1{font-size:1.3em}}"
)


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
    lines = "".join(f"<p>{html.escape(line)}</p>" for line in str(placement).splitlines())
    drawn = ""
    if places is not None:
        first, second = places.names
        told = f"The cost elsewhere, moved by {first} and {second}; all else as above."
        drawn = f"<h2>Map</h2><p>{told}</p>{places.svg()}"
    write_text(
        path,
        f'<!doctype html><html lang="en"><meta charset="utf-8">'
        f'<meta name="viewport" content="width=device-width,initial-scale=1"><title>{title}</title>'
        f"<style>{_STYLE}</style><h1>{title}</h1>{lines}{_choice(placement)}{drawn}</html>\n",
    )
    return path


def _choice(placement: Placement) -> str:
    """Return a table of the best places, with how much more each of them costs."""
    names = list(placement.place)
    head = "".join(f"<th>{_label(name)}</th>" for name in names)
    rows = []
    for item in placement.best():
        values = "".join(
            f"<td>{_in_unit(name, float(value))}</td>"
            for name, value in zip(names, item.place, strict=True)
        )
        more = item.cost / placement.cost - 1.0 if placement.cost else 0.0
        rows.append(f"<tr>{values}<td>{item.cost:.3g}</td><td>{more:+.1%}</td></tr>")
    return (
        f"<h2>Places to choose from</h2><table><tr>{head}<th>cost</th><th>more</th></tr>"
        f"{''.join(rows)}</table>"
    )


def _label(name: str) -> str:
    return f"{name} [{'mm' if name in _LENGTHS else '°'}]"


def _in_unit(name: str, value: float) -> str:
    """Return a displacement in mm, or a turn in degrees, with a sign."""
    return f"{1e3 * value:+.1f}" if name in _LENGTHS else f"{math.degrees(value):+.1f}"


_LENGTHS = ("x", "y", "z")
