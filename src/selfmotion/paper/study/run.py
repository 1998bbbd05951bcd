"""Runs the study, part by part, and writes it as one self-contained page."""

import dataclasses
import io
import json
import math
import re
import time
from collections.abc import Callable
from enum import Enum
from html import escape
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from selfmotion.basics import RenderError
from selfmotion.paper.study import claims, expense, questions, trajectory
from selfmotion.paper.study.context import Context, Scale
from selfmotion.paper.study.results import Chapter, Claim, Plot, Study, Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Runs the study, part by part.

_PARTS: dict[str, Callable[[Context], Chapter]] = {
    "sample trajectory": trajectory.chapter,
    "claims": claims.chapter,
    "surging": questions.surging,
    "cost of the method": expense.chapter,
    "open questions": questions.chapter,
    "other works": claims.other_works,
}

# Part names in order, for a progress bar.
PARTS = tuple(_PARTS)


def run(scale: Scale | None = None, progress: Callable[[str], None] | None = None) -> Study:
    """Run the study.

    Parameters
    ----------
    scale : Scale, optional
        ``Scale.full()`` by default: minutes.
    progress : callable, optional
        Called with the name of each part (see `PARTS`) as it begins.

    Returns
    -------
    Study
    """
    began = time.perf_counter()
    scale = scale or Scale.full()
    context = Context(scale)
    chapters = []
    for name, part in _PARTS.items():
        if progress is not None:
            progress(name)
        chapters.append(part(context))
    return Study(tuple(chapters), time.perf_counter() - began, scale.name)


# The study as one self-contained page, its plots as PNG, its numbers as JSON.

# Draws the study's plots by matplotlib, as SVG for the page and PNG for a folder.

# Text and axes are drawn in this near-black; in the page it becomes the colour of the text there,
# so that figures follow dark mode.
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
    # The salt keeps the ids of several figures in one page apart, and the file the same each time.
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


# The study as one self-contained page, its plots as PNG, its numbers as JSON.


def write(study: Study, folder: Path) -> list[Path]:
    """Write ``study.html``, ``study.json`` and a PNG per plot; return the files."""
    folder.mkdir(parents=True, exist_ok=True)
    page, numbers = folder / "study.html", folder / "study.json"
    page.write_text(html(study), encoding="utf-8")
    numbers.write_text(json.dumps(_plain(study), indent=1, allow_nan=False), encoding="utf-8")
    return [page, numbers, *(write_png(plot, folder) for plot in study.plots)]


def html(study: Study) -> str:
    """Return the page: no script, no network, dark mode by the reader's preference."""
    style = resources.files(__package__).joinpath("page.css").read_text(encoding="utf-8")
    links = "".join(f'<a href="#{s.key}">{escape(s.title)}</a>' for s in study.chapters)
    claims = study.claims
    counts = ", ".join(
        f"{sum(claim.verdict is verdict for claim in claims)} {verdict.value}"
        for verdict in type(claims[0].verdict)
    )
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        "<title>The paper, re-run</title>"
        f"<style>{style}</style></head><body><header><h1>The paper, re-run</h1>"
        "<p>“Path planning for redundant manipulators using iterative optimization technique”: "
        "its figures, tables and claims, each from one run of "
        f"<code>selfmotion study</code> ({study.scale}, {study.seconds:.0f} s). "
        f"{len(claims)} claims tested: {counts}.</p>"
        f'<nav><a href="#claims">Claims and verdicts</a>{links}</nav></header><main>'
        f"{_overview(claims)}{''.join(map(_chapter, study.chapters))}</main></body></html>"
    )


def number(value: str | float | int) -> str:
    """Return a table entry as text: five digits, as short as they allow."""
    if isinstance(value, str):
        return value
    if isinstance(value, int):
        return f"{value:,}".replace(",", "\u202f")
    if not math.isfinite(value):
        return "—"
    if value and not 1e-3 <= abs(value) < 1e5:
        return f"{value:.2e}"
    return f"{value:.5g}" if abs(value) < 10 else f"{value:.7g}"


def _overview(claims: tuple[Claim, ...]) -> str:
    rows = "".join(
        f'<tr><td><a href="#{claim.key}">{escape(claim.statement)}</a></td>'
        f"<td>{_badge(claim)}</td><td>{escape(claim.number)}</td></tr>"
        for claim in claims
    )
    head = "<tr><th>the paper says</th><th>verdict</th><th>the number that decides</th></tr>"
    return (
        '<section id="claims"><h2>Claims and verdicts</h2><div class="scroll">'
        f'<table class="words"><thead>{head}</thead><tbody>{rows}</tbody></table></div></section>'
    )


def _chapter(chapter: Chapter) -> str:
    paragraphs = "".join(f"<p>{escape(text)}</p>" for text in chapter.paragraphs)
    plots = "".join(f"<figure>{to_svg(plot)}</figure>" for plot in chapter.plots)
    return (
        f'<section id="{chapter.key}"><h2>{escape(chapter.title)}</h2>{paragraphs}'
        f'<div class="plots">{plots}</div>{"".join(map(_table, chapter.tables))}'
        f"{''.join(map(_claim, chapter.claims))}</section>"
    )


def _table(table: Table) -> str:
    head = "".join(f"<th>{escape(column)}</th>" for column in table.columns)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(number(entry))}</td>" for entry in row) + "</tr>"
        for row in table.rows
    )
    note = f"<p class=note>{escape(table.note)}</p>" if table.note else ""
    return (
        f'<h3>{escape(table.title)}</h3><div class="scroll"><table><thead><tr>{head}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>{note}"
    )


def _claim(claim: Claim) -> str:
    return (
        f'<article id="{claim.key}"><h3>{_badge(claim)} {escape(claim.statement)}</h3>'
        f"<p><strong>{escape(claim.number)}</strong></p><p>{escape(claim.reason)}</p></article>"
    )


def _badge(claim: Claim) -> str:
    return f'<span class="{claim.verdict.value}">{claim.verdict.value}</span>'


def _plain(value: Any) -> Any:
    """Return dataclasses, enums and numbers as JSON knows them; what is not finite as null."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: _plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
