"""The study as one self-contained HTML page, its figures as PNG, its numbers as JSON."""

import dataclasses
import json
import math
from enum import Enum
from html import escape
from importlib import resources
from pathlib import Path
from typing import Any

from selfmotion.paper.study.figures import to_svg, write_png
from selfmotion.paper.study.results import Chapter, Claim, Study, Table


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
    """Return dataclasses, enums and numbers as JSON values; null for NaN and infinity."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: _plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
