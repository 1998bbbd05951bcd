"""The map of places as a picture: costs, contours, what is out of reach, the part to scale."""

from __future__ import annotations

import html
import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from selfmotion.basics import Array

if TYPE_CHECKING:
    from selfmotion.work.placement.results import PlaceMap

# Sizes in the picture, which is as wide as its page: on a phone letters are two thirds as large.
_WIDE, _LEFT, _RIGHT, _TOP, _BOTTOM = 560.0, 52.0, 14.0, 12.0, 46.0
# Height of a map whose axes are not two lengths, as a share of its width; and at most.
_HIGH, _HIGHEST = 0.7, 1.6
# Colours of the cheapest and the dearest cell; of what fails.
_BEST, _WORST = (0, 105, 92), (255, 243, 205)
_NO_PLAN, _OUT_OF_REACH = "#f2cfcb", "#e4e7ec"
# Contours are this much above the least cost.
_CONTOURS = (0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0)
# Of more cells to a side none has its number written in it, and not each its label.
_WRITTEN = 9
# Numbers as near as this, to the side and up, are over each other.
_NUMBER = (48.0, 14.0)
LENGTHS = ("x", "y", "z")


def picture_of(places: PlaceMap) -> str:
    """Return the SVG of a map."""
    drawn = _Drawing(places)
    parts = [
        *drawn.cells(),
        *drawn.contours(),
        *drawn.outline(),
        *drawn.best(),
        *drawn.axes(),
    ]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDE:g} {drawn.height:g}" '
        f'role="img" aria-label="The cost of places" font-family="system-ui,sans-serif" '
        f'font-size="14">{"".join(parts)}</svg>'
    )


def legend_of(places: PlaceMap) -> str:
    """Return what the colours and lines of the map say, as HTML."""
    known = places.costs[np.isfinite(places.costs)]
    said = []
    if len(known):
        colours = ",".join(f"rgb({','.join(map(str, c))})" for c in (_BEST, _WORST))
        said.append(
            f'<i style="background:linear-gradient(to right,{colours});width:4em"></i>cost '
            f"{known.min():.3g} to {known.max():.3g}"
        )
    failed = [reason for row in places.reasons for reason in row if reason]
    reached = [reason for reason in failed if not _is_far(reason)]
    if reached:
        said.append(f'<i style="background:{_NO_PLAN}"></i>in reach, but no plan')
    if len(reached) < len(failed):
        said.append(f'<i style="background:{_OUT_OF_REACH}"></i>out of reach')
    if len(known) > 1:
        said.append('<i style="border-top:2px solid #222;height:0"></i>as much dearer')
    if len(places.outline):
        said.append('<i style="border-top:2px dashed #1d3f8f;height:0"></i>the part, to scale')
    return "".join(f"<span>{text}</span>" for text in said)


def in_unit(name: str, value: float) -> str:
    """Return a displacement in mm, or a turn in degrees: three digits, with its sign and unit."""
    if name in LENGTHS:
        return f"{_three(1e3 * value)} mm"
    return f"{_three(math.degrees(value))}°"


def _three(value: float) -> str:
    text = f"{value:+.3g}" if abs(value) >= 0.1 else f"{value:+.1f}"
    return "0" if float(text) == 0.0 else f"{float(text):+g}".replace("-", "\N{MINUS SIGN}")


def _is_far(reason: str) -> bool:
    return "out of reach" in reason


class _Drawing:
    """Draws the parts of a map."""

    def __init__(self, places: PlaceMap) -> None:
        self._places = places
        self._across, self._up = places.across, places.up
        step = [axis[1] - axis[0] for axis in (self._across, self._up)]
        self._step = step
        wide = _WIDE - _LEFT - _RIGHT
        share = _HIGH
        if set(places.names) <= set(LENGTHS):
            share = step[1] * len(self._up) / (step[0] * len(self._across))
        self._wide = min(wide, wide * _HIGHEST / share)
        self._high = self._wide * share
        self.height = _TOP + self._high + _BOTTOM

    def _x(self, value: float) -> float:
        first = self._across[0] - 0.5 * self._step[0]
        return float(_LEFT + (value - first) / (self._step[0] * len(self._across)) * self._wide)

    def _y(self, value: float) -> float:
        first = self._up[0] - 0.5 * self._step[1]
        share = (value - first) / (self._step[1] * len(self._up))
        return float(_TOP + (1.0 - share) * self._high)

    def cells(self) -> Iterator[str]:
        """Yield a rectangle for each place, with its cost, or why it fails."""
        costs, count = self._places.costs, max(self._places.costs.shape)
        wide, high = self._wide / len(self._across), self._high / len(self._up)
        least, most = np.nanmin(costs, initial=np.inf), np.nanmax(costs, initial=0.0)
        for i, up in enumerate(self._up.tolist()):
            for j, across in enumerate(self._across.tolist()):
                reason, cost = self._places.reasons[i][j], float(costs[i, j])
                fill = _OUT_OF_REACH if _is_far(reason) else _NO_PLAN
                said, share = reason, 1.0
                if not reason:
                    share = _share(cost, float(least), float(most))
                    mixed = (round(a + share * (b - a)) for a, b in zip(_BEST, _WORST, strict=True))
                    fill, said = f"rgb({','.join(map(str, mixed))})", f"cost {cost:.3g}"
                first, second = self._places.names
                where = f"{first} {in_unit(first, across)}, {second} {in_unit(second, up)}"
                left, top = self._x(across) - 0.5 * wide, self._y(up) - 0.5 * high
                yield (
                    f'<g><title>{html.escape(f"{where}: {said}")}</title><rect x="{left:.1f}" '
                    f'y="{top:.1f}" width="{wide:.1f}" height="{high:.1f}" fill="{fill}" '
                    f'stroke="#fff"/>'
                )
                if not reason and count <= _WRITTEN:
                    ink = "#222" if share > 0.4 else "#fff"
                    place = self._place_of_cost(across, up)
                    yield _text(*place, f"{cost:.3g}", fill=ink, size=12)
                yield "</g>"

    def _place_of_cost(self, across: float, up: float) -> tuple[float, float]:
        """Return where the cost of a place is written."""
        return self._x(across), self._y(up) + 0.5 * self._high / len(self._up) - 5.0

    def _is_free(self, x: float, y: float) -> bool:
        """Whether a number there is over no cost."""
        costs = (self._place_of_cost(across, up) for across in self._across for up in self._up)
        return all(abs(x - i) > _NUMBER[0] or abs(y - j) > _NUMBER[1] for i, j in costs)

    def contours(self) -> Iterator[str]:
        """Yield lines of equal cost, each with how much dearer it is."""
        costs = self._places.costs
        least = float(np.nanmin(costs, initial=np.inf))
        known = _CONTOURS if np.isfinite(least) and least > 0.0 else ()
        for number, more in enumerate(known, 1):
            level = (1.0 + more) * least
            lines = list(_crossings(costs, level))
            if not lines:
                continue
            way = "".join(f"M{self._at(*one)}L{self._at(*other)}" for one, other in lines)
            yield f'<path d="{way}" fill="none" stroke="#222" stroke-width="1.2"/>'
            # Each elsewhere along its line, so that no number is over another one.
            wanted = number * len(lines) // (len(known) + 1)
            points = [tuple(map(float, self._at(*one).split(","))) for one, _ in lines]
            order = sorted(range(len(points)), key=lambda k: abs(k - wanted))
            x, y = points[next((k for k in order if self._is_free(*points[k])), wanted)]
            # White below, so that it can be read on its line.
            halo = ' stroke="#fff" stroke-width="3" paint-order="stroke"'
            yield _text(x, y + 4.0, f"+{more:.0%}", size=11, more=halo)

    def _at(self, i: float, j: float) -> str:
        """Return where a place between cells is, by its numbers up and across."""
        across = self._across[0] + j * self._step[0]
        return f"{self._x(across):.1f},{self._y(self._up[0] + i * self._step[1]):.1f}"

    def outline(self) -> Iterator[str]:
        """Yield the outline of the part at the best place."""
        if not len(self._places.outline):
            return
        points = " ".join(f"{self._x(x):.1f},{self._y(y):.1f}" for x, y in self._places.outline)
        box = f'x="{_LEFT:g}" y="{_TOP:g}" width="{self._wide:.1f}" height="{self._high:.1f}"'
        yield f'<clipPath id="plot"><rect {box}/></clipPath>'
        yield (
            f'<polygon points="{points}" fill="none" stroke="#1d3f8f" stroke-width="2" '
            f'stroke-dasharray="6 4" clip-path="url(#plot)"/>'
        )

    def best(self) -> Iterator[str]:
        """Yield the places to choose from, by their numbers in the table."""
        for number, (x, y) in reversed(list(enumerate(self._places.best, 1))):
            place = f'cx="{self._x(x):.1f}" cy="{self._y(y):.1f}"'
            yield f'<circle {place} r="9" fill="#d84315" stroke="#fff" stroke-width="1.5"/>'
            yield _text(self._x(x), self._y(y) + 4.5, str(number), fill="#fff", size=13)

    def axes(self) -> Iterator[str]:
        """Yield the numbers along both axes, and their names."""
        floor = _TOP + self._high
        for k in range(0, len(self._across), 1 + len(self._across) // (_WRITTEN + 1)):
            name, value = self._places.names[0], float(self._across[k])
            yield _text(self._x(value), floor + 18.0, _bare(name, value), size=13)
        for k in range(0, len(self._up), 1 + len(self._up) // 2 // _WRITTEN):
            name, value = self._places.names[1], float(self._up[k])
            yield _text(_LEFT - 6.0, self._y(value) + 5.0, _bare(name, value), "end", size=13)
        first, second = (f"{name} [{unit_of(name)}]" for name in self._places.names)
        yield _text(_LEFT + 0.5 * self._wide, floor + 38.0, first)
        middle = _TOP + 0.5 * self._high
        yield f'<g transform="rotate(-90 12 {middle:.1f})">{_text(12.0, middle + 4.0, second)}</g>'


def unit_of(name: str) -> str:
    """Return the unit in which a coordinate is shown."""
    return "mm" if name in LENGTHS else "°"


def _bare(name: str, value: float) -> str:
    return in_unit(name, value).removesuffix("°").removesuffix(" mm").removeprefix("+")


def _share(cost: float, least: float, most: float) -> float:
    """Return where a cost is between two others: by ratios, so that others than one differ."""
    if most <= least:
        return 0.0
    if least <= 0.0:
        return (cost - least) / (most - least)
    return math.log(cost / least) / math.log(most / least)


def _crossings(values: Array, level: float) -> Iterator[tuple[Sequence[float], Sequence[float]]]:
    """Yield the pieces of a line of equal values, by numbers of rows and columns.

    Marching squares: between neighbours values are linear. Where one is unknown there is no line.
    """
    rows, columns = values.shape
    for i in range(rows - 1):
        for j in range(columns - 1):
            corners = [(i, j), (i, j + 1), (i + 1, j + 1), (i + 1, j)]
            known = [float(values[corner]) for corner in corners]
            if not all(map(math.isfinite, known)):
                continue
            ends = []
            for k in range(4):
                one, other = known[k], known[(k + 1) % 4]
                if (one < level) != (other < level):
                    share = (level - one) / (other - one)
                    (a, b), (c, d) = corners[k], corners[(k + 1) % 4]
                    ends.append((a + share * (c - a), b + share * (d - b)))
            for k in range(0, len(ends) - 1, 2):
                yield ends[k], ends[k + 1]


def _text(
    x: float,
    y: float,
    text: str,
    anchor: str = "middle",
    *,
    fill: str = "#222",
    size: int = 14,
    more: str = "",
) -> str:
    place = f'x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" font-size="{size}" fill="{fill}"'
    return f'<text {place}{more} pointer-events="none">{html.escape(text)}</text>'
