"""A redundancy map as a picture: its colours, and a figure by matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from selfmotion.basics import Array, Flags, RenderError
from selfmotion.planning.redundancy.judging import Reason

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from selfmotion.planning.redundancy.map import RedundancyMap

# What stops the arm, in words of a legend, and in colours that differ in lightness as well: they
# can be told apart without seeing red or green.
LEGEND: dict[Reason, tuple[str, str]] = {
    Reason.LIMIT: ("joint limit", "#d9b36c"),
    Reason.CONSTRAINT: ("other constraint", "#9a8bc0"),
    Reason.OBSTACLE: ("obstacle", "#7d3a4c"),
    Reason.ITSELF: ("self-collision", "#cd8591"),
    Reason.SINGULAR: ("near singular", "#4c4f55"),
    Reason.SPEED: ("joint speed", "#efe08a"),
    Reason.NO_CONFIGURATION: ("no configuration", "#e6e5e1"),
}
# Colours of what is allowed, from the lowest cost density to the highest.
COST_COLORS = ("#f3f8fb", "#a9cbe0", "#4f8db8", "#235a86")
# Share of pixels by whose cost density the scale ends, times a factor, if not at the largest: near
# singular poses it has no bound.
_MOST, _FACTOR = 0.95, 3.0
# Size of a figure [inches].
_SIZE = (7.2, 4.8)


def excess_cost(cost: Array, allowed: Flags) -> tuple[Array, float]:
    """Return how far cost densities (N, M) are above the least allowed at their time, and a scale.

    (N, M), NaN where nothing is allowed, and the end of the scale. What all configurations of a
    time cost alike the self-motion cannot choose.
    """
    known = np.where(allowed & np.isfinite(cost), cost, np.inf)
    least = known.min(axis=1, keepdims=True)
    excess = np.where(np.isfinite(known), known - np.where(np.isfinite(least), least, 0.0), np.nan)
    some = excess[np.isfinite(excess)]
    if not len(some):
        return excess, 1.0
    high = min(float(some.max()), _FACTOR * float(np.quantile(some, _MOST)))
    # Of costs that are the same everywhere there is nothing to tell apart.
    return excess, high if high > 0.0 else 1.0


def shown_scale(unit: str) -> tuple[float, str]:
    """Return the factor and the unit in which people read a coordinate: ° or mm."""
    return (180.0 / np.pi, "°") if unit == "rad" else (1e3, "mm")


def drawn(shown: RedundancyMap) -> Figure:
    """Return the map as a figure; see `RedundancyMap.figure`."""
    try:
        from matplotlib.colors import LinearSegmentedColormap, ListedColormap
        from matplotlib.figure import Figure
    except ImportError:
        raise RenderError("figures need matplotlib: pip install 'selfmotion[plots]'") from None

    figure = Figure(figsize=_SIZE, layout="constrained")
    axes = figure.subplots()
    scale, unit = shown_scale(shown.unit)
    up = scale * shown.coordinate
    present = [reason for reason in LEGEND if (shown.state == reason).any()]
    for reason in present:
        here = np.where(shown.state == reason, 1.0, np.nan)
        colors = ListedColormap([LEGEND[reason][1]])
        axes.pcolormesh(shown.times, up, here.T, cmap=colors, shading="nearest", rasterized=True)
    excess, high = excess_cost(shown.cost, shown.allowed)
    blues = LinearSegmentedColormap.from_list("cost", COST_COLORS)
    mesh = axes.pcolormesh(
        shown.times,
        up,
        excess.T,
        cmap=blues,
        vmin=0.0,
        vmax=high,
        shading="nearest",
        rasterized=True,
    )
    label = "cost density above the least at that time"
    figure.colorbar(mesh, label=label, extend="max", pad=0.02)
    _draw_lines(axes, shown, scale)
    axes.set(xlabel="time [s]", ylabel=f"{shown.label} [{unit}]")
    axes.set(xlim=(shown.times[0], shown.times[-1]), ylim=(up[0], up[-1]))
    _draw_legend(figure, axes, present)
    return figure


def _draw_lines(axes: Axes, shown: RedundancyMap, scale: float) -> None:
    from matplotlib.patheffects import Normal, withStroke

    # A white rim: on dark colours as on light ones.
    rim = [withStroke(linewidth=4.0, foreground="white"), Normal()]
    given: dict[str, Any] = {"color": "black", "path_effects": rim}
    axes.plot(shown.times, scale * shown.plan_line, label="plan", linewidth=2.0, **given)
    axes.plot(
        shown.times,
        scale * shown.minimum_norm_line,
        label="minimum-norm motion",
        linewidth=1.4,
        linestyle=(0, (4, 2)),
        **given,
    )


def _draw_legend(figure: Figure, axes: Axes, present: list[Reason]) -> None:
    from matplotlib.patches import Patch

    lines, labels = axes.get_legend_handles_labels()
    patches = [Patch(facecolor=LEGEND[reason][1], label=LEGEND[reason][0]) for reason in present]
    texts = [*labels, *(LEGEND[reason][0] for reason in present)]
    figure.legend(
        [*lines, *patches], texts, loc="outside lower center", ncols=4, frameon=False, fontsize=9
    )
