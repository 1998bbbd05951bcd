"""Where the part or the arm is best put, as a page."""

from __future__ import annotations

import html
from pathlib import Path

from selfmotion.basics import ProblemError, as_path, shown, write_text
from selfmotion.work.placement.found import PlaceMap, Placement

_STYLE = "body{font-family:system-ui,sans-serif;margin:2em;max-width:60em}td,th{padding:2px 1em}"


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
        told = f"What it costs elsewhere, moved by {first} and {second}; all else as above."
        drawn = f"<p>{told}</p>{places.svg()}"
    write_text(
        path,
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{title}</title>'
        f"<style>{_STYLE}</style><h1>{title}</h1>{lines}{drawn}</html>\n",
    )
    return path
