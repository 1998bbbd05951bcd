"""Maps of the costs of a grid of problems: two axes each, one map for each further value."""

import html
import json
import math
import urllib.parse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from selfmotion.basics import is_number
from selfmotion.work.batch.rows import Row

# Of poses, what their numbers are called.
_OF_POSES = {
    "position": ("x [m]", "y [m]", "z [m]"),
    "position_mm": ("x [mm]", "y [mm]", "z [mm]"),
    "rpy": ("roll [rad]", "pitch [rad]", "yaw [rad]"),
    "rpy_deg": ("roll [°]", "pitch [°]", "yaw [°]"),
}
# Colour of the best cell (red, green, blue).
_BEST = (0, 105, 92)
# Colour of the worst cell.
_WORST = (255, 243, 205)
# Width of a cell: a reason in two words [px].
_WIDE = 74
# Height of a cell [px].
_HIGH = 46
# Frame around all cells [px].
_LEFT = 76
_TOP = 30
_RIGHT = 12
_BOTTOM = 64
# Letters on one line of a cell.
_LINE = 9


def labels(keys: Sequence[str]) -> list[str]:
    """Return short names of the keys of a grid: their last words, if these differ."""
    words = []
    for key in keys:
        *parents, last = key.split(".")
        names = _OF_POSES.get(parents[-1]) if parents else None
        if names and last in ("0", "1", "2"):
            words.append(names[int(last)])
        else:
            words.append(f"{parents[-1]}.{last}" if parents and last.isdigit() else last)
    return words if len(set(words)) == len(words) else list(keys)


def maps(rows: Sequence[Row], links: Mapping[str, str]) -> list[str]:
    """Return SVG pictures of rows over the first two numbers of their grid that vary.

    Parameters
    ----------
    rows : sequence of Row
        Of a batch; those of each file have maps of their own, one for each combination of what
        else varies.
    links : mapping
        Name → address of a replay, "" for none.

    Returns
    -------
    list of str
        Empty where fewer than two numbers vary.
    """
    files: dict[str, list[Row]] = {}
    for row in rows:
        if row.settings:
            files.setdefault(row.name.rpartition("-")[0], []).append(row)
    found = []
    for stem, of_file in files.items():
        found += _of_file(of_file, links, f"{stem}: " if len(files) > 1 else "")
    return found


def _of_file(rows: Sequence[Row], links: Mapping[str, str], title: str) -> list[str]:
    flat = [_flat(row.settings) for row in rows]
    varying = [key for key in flat[0] if len({json.dumps(item.get(key)) for item in flat}) > 1]
    axes = [key for key in varying if all(is_number(item.get(key)) for item in flat)][:2]
    if len(axes) < 2:
        return []
    others = [key for key in varying if key not in axes]
    names = dict(zip(varying, labels(varying), strict=True))
    panels: dict[str, list[tuple[float, float, Row]]] = {}
    for item, row in zip(flat, rows, strict=True):
        rest = ", ".join(f"{names[key]} = {_text(item.get(key))}" for key in others)
        panels.setdefault(rest, []).append((item[axes[0]], item[axes[1]], row))
    scale = _Scale.of(rows)
    across, up = (sorted({item[key] for item in flat}) for key in axes)
    heads = names[axes[0]], names[axes[1]]
    return [
        _picture(f"{title}{rest}", heads, across, up, cells, scale, links)
        for rest, cells in panels.items()
    ]


def _flat(value: Any, key: str = "") -> dict[str, Any]:
    """Return the numbers and words of settings, each by its own key."""
    if isinstance(value, Mapping):
        items = [(str(name), item) for name, item in value.items()]
    elif isinstance(value, list):
        items = [(str(k), item) for k, item in enumerate(value)]
    else:
        return {key: value}
    found: dict[str, Any] = {}
    for name, item in items:
        found |= _flat(item, f"{key}.{name}" if key else name)
    return found


def _text(value: Any) -> str:
    return f"{value:g}" if is_number(value) else str(value)


@dataclass(frozen=True)
class _Scale:
    """From what rows are ranked by to colours."""

    least: float
    most: float
    best: Row | None
    name: str

    @classmethod
    def of(cls, rows: Sequence[Row]) -> "_Scale":
        sound = [row for row in rows if row.verified]
        aims = [row.aim for row in sound] or [0.0]
        is_cost = all(row.aim == row.cost for row in sound)
        best = min(sound, key=lambda row: row.rank, default=None)
        return cls(min(aims), max(aims), best, "cost" if is_cost else "duration [s]")

    def colours(self, aim: float) -> tuple[str, str]:
        """Return the colour of a cell, and of what is written in it."""
        share = 0.0
        if self.most > self.least > 0.0:
            # Colours follow ratios: beside a place at ten times the cost others still differ.
            share = math.log(aim / self.least) / math.log(self.most / self.least)
        elif self.most > self.least:
            share = (aim - self.least) / (self.most - self.least)
        mixed = [round(a + share * (b - a)) for a, b in zip(_BEST, _WORST, strict=True)]
        return f"rgb({','.join(map(str, mixed))})", "#222" if share > 0.4 else "#fff"


def _picture(
    title: str,
    heads: tuple[str, str],
    across: Sequence[float],
    up: Sequence[float],
    cells: Sequence[tuple[float, float, Row]],
    scale: _Scale,
    links: Mapping[str, str],
) -> str:
    """Return one map: the first number to the right, the second one up."""
    width, height = _LEFT + _WIDE * len(across) + _RIGHT, _TOP + _HIGH * len(up) + _BOTTOM
    floor = _TOP + _HIGH * len(up)
    parts = [_text_at(_LEFT, _TOP - 10, title, "start", "bold")] if title else []
    for k, value in enumerate(across):
        parts.append(_text_at(_LEFT + _WIDE * (k + 0.5), floor + 15, f"{value:.4g}"))
    for k, value in enumerate(up):
        parts.append(_text_at(_LEFT - 6, floor - _HIGH * (k + 0.5) + 4, f"{value:.4g}", "end"))
    parts.append(_text_at(_LEFT + 0.5 * _WIDE * len(across), floor + 31, heads[0]))
    middle = _TOP + 0.5 * _HIGH * len(up)
    parts.append(f'<g transform="rotate(-90 12 {middle:g})">{_text_at(12, middle, heads[1])}</g>')
    for x, y, row in cells:
        left = _LEFT + _WIDE * across.index(x)
        parts.append(_cell(left, floor - _HIGH * (up.index(y) + 1), row, scale, links))
    parts.append(_text_at(_LEFT, floor + 52, _legend(scale), "start"))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" '
        f'style="background:#fff" font-family="system-ui,sans-serif" font-size="12">'
        f"{''.join(parts)}</svg>"
    )


def _legend(scale: _Scale) -> str:
    if scale.best is None:
        return "none is verified"
    return f"{scale.name}: {scale.least:.3g} (framed) to {scale.most:.3g}"


def _cell(left: float, top: float, row: Row, scale: _Scale, links: Mapping[str, str]) -> str:
    fill, ink = scale.colours(row.aim) if row.verified else ("#eee", "#a33")
    lines = [f"{row.aim:.3g}"] if row.verified else _lines(row.reason)
    edge = 'stroke="#fff"'
    if row is scale.best:
        edge = 'stroke="#d84315" stroke-width="3"'
    inner = f'<rect x="{left + 1.5:g}" y="{top + 1.5:g}" width="{_WIDE - 3}" height="{_HIGH - 3}" '
    inner += f'fill="{fill}" {edge}/>'
    for k, line in enumerate(lines):
        height = top + 0.5 * _HIGH + 4 + 14 * (k - 0.5 * (len(lines) - 1))
        inner += _text_at(left + 0.5 * _WIDE, height, line, colour=ink)
    inner += f"<title>{html.escape(f'{row.name}: {row.error or row.verdict}')}</title>"
    address = links.get(row.name, "")
    linked = f'<a href="{urllib.parse.quote(address)}">{inner}</a>' if address else inner
    return f"<g>{linked}</g>"


def _lines(reason: str) -> list[str]:
    """Return a reason in at most two lines."""
    first, rest = "", reason.split()
    while rest and len(f"{first} {rest[0]}") <= _LINE:
        first = f"{first} {rest.pop(0)}".strip()
    return [line[:_LINE] for line in (first, " ".join(rest)) if line]


def _text_at(
    x: float, y: float, text: str, anchor: str = "middle", weight: str = "", colour: str = "#222"
) -> str:
    bold = f' font-weight="{weight}"' if weight else ""
    place = f'x="{x:g}" y="{y:g}" text-anchor="{anchor}" fill="{colour}"'
    return f"<text {place}{bold}>{html.escape(text)}</text>"
