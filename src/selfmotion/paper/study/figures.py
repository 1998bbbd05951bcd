"""Figures of the study by matplotlib, as SVG for the page and PNG for a folder."""

import io
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from selfmotion.basics import RenderError
from selfmotion.paper.study.results import Plot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Colour of text and axes, near-black; in the page it becomes the text colour, for dark mode.
_INK = "#010203"

# Legible on white and on dark grey (Tol's "bright", without its yellow).
_COLOURS = ("#4477AA", "#EE6677", "#228833", "#AA3377", "#CC9911", "#44AACC", "#999999")

# Any: matplotlib's stubs list every key as a literal.
_STYLE: Any = {
    "font.size": 9.0,
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "text.color": _INK,
    "axes.edgecolor": _INK,
    "axes.labelcolor": _INK,
    "axes.titlecolor": _INK,
    "xtick.color": _INK,
    "ytick.color": _INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.25,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "axes.titlesize": 9.5,
}


def require_matplotlib() -> None:
    """Raise RenderError where matplotlib is not installed."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        raise RenderError("figures need matplotlib: pip install 'selfmotion[plots]'") from None


def draw(plot: Plot) -> "Figure":
    """Return a plot as a matplotlib figure, unknown to pyplot.

    Raises
    ------
    RenderError
        matplotlib is not installed.
    """
    require_matplotlib()
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context(_STYLE):
        figure = Figure(figsize=(4.8, 4.2 if plot.equal else 3.2), layout="constrained")
        axes = figure.subplots()
        (_bars if plot.bars else _lines)(axes, plot)
        axes.set(xlabel=plot.x_label, ylabel=plot.y_label, title=plot.title)
        axes.set(xscale=plot.x_scale, yscale=plot.y_scale)
        if plot.equal:
            axes.set_aspect("equal")
        if any(curve.label for curve in plot.curves):
            axes.legend()
    return figure


def to_svg(plot: Plot) -> str:
    """Return a plot as an SVG element to put into a page."""
    figure = draw(plot)
    import matplotlib

    stream = io.StringIO()
    # The salt separates the ids of several figures in one page, and makes files reproducible.
    with matplotlib.rc_context({**_STYLE, "svg.hashsalt": plot.name}):
        figure.savefig(stream, format="svg", transparent=True, metadata={"Date": None})
    text = stream.getvalue()
    text = text[text.index("<svg") :].replace(_INK, "currentColor")
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    head, rest = text.split(">", 1)
    head = re.sub(r' (width|height)="[^"]*"', "", head)
    return f'{head} role="img" aria-label="{plot.title}">{rest}'


def write_png(plot: Plot, folder: Path) -> Path:
    """Write a plot as a PNG into `folder`, and return the file."""
    import matplotlib

    file = folder / f"{plot.name}.png"
    figure = draw(plot)
    with matplotlib.rc_context(_STYLE):
        figure.savefig(file, dpi=160, facecolor="white", metadata={"Software": None})
    return file


def _lines(axes: "Axes", plot: Plot) -> None:
    for k, curve in enumerate(plot.curves):
        faint: dict[str, Any] = {"alpha": 0.35, "linewidth": 0.8} if curve.faint else {}
        colour = "#888888" if curve.faint else _COLOURS[k % len(_COLOURS)]
        label = curve.label or None
        style = "none" if curve.marker == "." else "-"
        axes.plot(
            curve.x,
            curve.y,
            color=colour,
            label=label,
            marker=curve.marker or None,
            markersize=4.0,
            linestyle=style,
            **faint,
        )


def _bars(axes: "Axes", plot: Plot) -> None:
    for k, curve in enumerate(plot.curves):
        width = 0.9 * (curve.x[1] - curve.x[0]) if len(curve.x) > 1 else 0.8
        axes.bar(curve.x, curve.y, width=width, color=_COLOURS[k], label=curve.label or None)
