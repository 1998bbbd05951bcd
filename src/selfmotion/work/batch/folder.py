"""A batch on disk: per problem a plan and a row; ranked tables of all of them."""

import csv
import dataclasses
import hashlib
import html
import io
import json
import urllib.parse
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from selfmotion.basics import SelfmotionError, digest_of_file, write_bytes, write_text
from selfmotion.certificate import USUAL
from selfmotion.model.path import Path as ToolPath, Retimed
from selfmotion.planning.planner import PlanRequest
from selfmotion.planning.result import (
    MotionSpecification,
    Plan,
    load_plan,
    read_kept,
    views,
    write_kept,
)
from selfmotion.problem.problem import Problem, along_other_paths
from selfmotion.work.batch.items import Item
from selfmotion.work.batch.maps import labels, maps
from selfmotion.work.batch.rows import DEADLINE_REASON, Row, row_values


def answers(plan: Plan, job: PlanRequest) -> bool:
    """Whether a plan is of the problem of a request, judged with its tolerance.

    A fastest motion may have any pace along the same path.
    """
    asked, own = job.problem, plan.problem
    tolerance = job.tolerance or USUAL
    if job.goal == "best":
        return own.digest == asked.digest and plan.tolerance == tolerance
    wanted = _at_its_own_pace(asked, asked)
    # The certificate is of another problem then, but has the same requirements.
    same_path = replace(plan, problem=_at_its_own_pace(own, asked))
    held = MotionSpecification(
        wanted.robot,
        wanted.path,
        wanted.task,
        wanted.relaxations,
        wanted.all_constraints,
        tolerance=tolerance,
        also=wanted.also,
        rest=wanted.rest and wanted.damping is None,
    )
    rows = [(item.rows, item.band, item.axes) for item in asked.relaxations]
    same = rows == [(item.rows, item.band, item.axes) for item in own.relaxations]
    return same and not list(held.failures(same_path))


def _at_its_own_pace(problem: Problem, asked: Problem) -> Problem:
    """Return a problem along its paths before retiming, with the windows of the request."""
    return replace(
        problem, **along_other_paths(problem, _original), relaxations=tuple(asked.relaxations)
    )


def _original(path: ToolPath) -> ToolPath:
    while isinstance(path, Retimed):
        path = path.original
    return path


class Folder:
    """The folder of a batch.

    Parameters
    ----------
    path : Path
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        # Arms and bodies of plans that were read before.
        self._known: dict[str, Any] = {}

    def plan_file(self, name: str) -> Path:
        """Return the file of a problem's plan."""
        return self.path / "plans" / f"{name}.npz"

    def finished(self, item: Item) -> Row | None:
        """Return the row of a problem that an earlier run finished; None if it has to be run.

        Its plan is certified again. Where the file is not the one that was written with the row, or
        is of another problem, the problem is planned again.
        """
        name = item.name
        values = read_kept(self._row_file(name))
        if values is None:
            return None
        try:
            row = Row(file=self.plan_file(name), **values)
            if row.key != item.key or row.fault or row.reason == DEADLINE_REASON:
                return None
            if row.error:
                return replace(row, settings=dict(item.settings))
            if digest_of_file(row.file) != row.digest:
                return None
            plan, job = load_plan(row.file, known=self._known), item.make()
            if plan.altered or not answers(plan, job):
                return None
            row = replace(row, settings=dict(item.settings), goal=job.goal)
            return replace(row, **row_values(plan, job.goal))
        except (OSError, ValueError, TypeError, OverflowError, SelfmotionError):
            return None  # not written by a batch, or by another version: planned again

    def record(self, row: Row, archive: bytes) -> Row:
        """Write plan and row, in this order: a row says that all is there."""
        if archive:
            write_bytes(row.file, archive)
            row = replace(row, digest=hashlib.sha256(archive).hexdigest())
        values = {k: v for k, v in dataclasses.asdict(row).items() if k != "file"}
        write_kept(self._row_file(row.name), values)
        return row

    def write_tables(self, rows: Sequence[Row], replays: int) -> None:
        """Write ``table.csv`` and ``index.html``, the best first, with replays of the best ones."""
        ranked = sorted(rows, key=lambda row: row.rank)
        planned = [row for row in ranked if not row.error]
        links = {row.name: self._replay(row, k < replays) for k, row in enumerate(planned)}
        keys = list(dict.fromkeys(key for row in rows for key in row.settings))
        columns = ["verified", "reason", "cost", "minimum-norm motion", "margin", "clearance"]
        columns += ["duration", "seconds", "plan", "replay", "verdict"]
        lines = [self._cells(k, row, keys, links) for k, row in enumerate(ranked, 1)]
        write_text(self.path / "table.csv", _csv([["rank", "name", *keys, *columns], *lines]))
        page = _page(["rank", "name", *labels(keys), *columns], lines, maps(rows, links))
        write_text(self.path / "index.html", page)

    def _cells(
        self, rank: int, row: Row, keys: Sequence[str], links: Mapping[str, str]
    ) -> list[str]:
        numbers = ["", "", "", "", ""]
        if not row.error:
            costs = [f"{v:.8g}" for v in (row.cost, row.initial_cost)]
            margins = ["" if v is None else f"{v:.4g}" for v in (row.margin, row.clearance)]
            costs = costs if row.ends is None else [row.outcome, ""]
            numbers = [*costs, *margins, f"{row.duration:.8g}"]
        settings = [json.dumps(row.settings[key]) if key in row.settings else "" for key in keys]
        file = "" if row.error else row.file.relative_to(self.path).as_posix()
        state = "no plan" if row.error else "yes" if row.verified else "no"
        timing = f"{row.seconds:.3f}"
        verdict = row.error or row.verdict
        start = [str(rank), row.name, *settings, state, row.reason, *numbers, timing]
        return [*start, file, links.get(row.name, ""), verdict]

    def _replay(self, row: Row, wanted: bool) -> str:
        """Return the address of a plan's replay, made once and only where wanted."""
        file = self.path / "replays" / f"{row.name}.html"
        # A plan that was planned again is newer than its replay.
        sound = file.is_file() and file.stat().st_mtime >= row.file.stat().st_mtime
        if not sound and wanted:
            views().write_replay(row.plan(), file)
            sound = True
        return file.relative_to(self.path).as_posix() if sound else ""

    def _row_file(self, name: str) -> Path:
        return self.path / "rows" / f"{name}.json"


def _csv(lines: Sequence[Sequence[str]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(lines)
    return text.getvalue()


_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>selfmotion batch</title>
<meta name="viewport" content="width=device-width,initial-scale=1">
<style>body{{font:14px/1.4 system-ui,sans-serif;margin:1.5em}}table{{border-collapse:collapse}}
th,td{{padding:.25em .6em;border-bottom:1px solid #ddd;text-align:left;vertical-align:top}}
td{{overflow-wrap:break-word}}td.whole{{white-space:nowrap}}td:last-child{{min-width:16em}}
@media(max-width:1000px){{td{{overflow-wrap:anywhere}}td.whole{{white-space:normal}}
body{{margin:1em}}thead{{display:none}}tr{{display:block;padding:.6em 0}}
td{{display:flex;gap:1em;padding:.1em 0;border:0}}td:empty{{display:none}}
td::before{{content:attr(data-name);flex:0 0 8em;color:#666}}tr{{border-bottom:1px solid #ddd}}}}
.maps{{display:flex;flex-wrap:wrap;gap:1em 2em;margin-bottom:1em}}svg{{max-width:100%}}
a:hover rect{{opacity:.85}}
</style></head><body><h1>{title}</h1>
{maps}<table><thead><tr>{head}</tr></thead><tbody>
{body}
</tbody></table></body></html>
"""


# Columns whose cells are one word or number each.
_WHOLE = {
    "rank",
    "minimum-norm motion",
    "margin",
    "clearance",
    "duration",
    "seconds",
    "plan",
    "replay",
}
# Titles of the columns of numbers.
_HEADS = {
    "margin": "joint margin, rad or m",
    "clearance": "clearance, m",
    "duration": "duration, s",
    "seconds": "planned in, s",
}


def _page(header: Sequence[str], lines: Sequence[Sequence[str]], pictures: Sequence[str]) -> str:
    linked = {header.index("plan"), header.index("replay")}
    state, reason = header.index("verified"), header.index("reason")
    shown = [k for k in range(len(header)) if k != reason]
    # In few words; the last column has all of them.
    lines = [[*line[:state], line[reason] or line[state], *line[state + 1 :]] for line in lines]

    def cell(k: int, text: str) -> str:
        safe = html.escape(text)
        address = urllib.parse.quote(text)
        content = f'<a href="{address}">{header[k]}</a>' if k in linked and text else safe
        name = html.escape(_HEADS.get(header[k], header[k]))
        whole = ' class="whole"' if header[k] in _WHOLE else ""
        return f'<td{whole} data-name="{name}">{content}</td>'

    rows = ("".join(cell(k, line[k]) for k in shown) for line in lines)
    return _PAGE.format(
        title=f"{len(lines)} problems, best first",
        maps=f'<div class="maps">{"".join(pictures)}</div>\n' if pictures else "",
        head="".join(f"<th>{html.escape(_HEADS.get(header[k], header[k]))}</th>" for k in shown),
        body="\n".join(f"<tr>{row}</tr>" for row in rows),
    )
