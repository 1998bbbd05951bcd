"""A batch on disk: per problem a plan and a row; ranked tables of all of them."""

import csv
import dataclasses
import html
import io
import json
import urllib.parse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from selfmotion.basics import FileFormatError, write_bytes, write_text
from selfmotion.result import Plan, load_plan


@dataclass(frozen=True)
class Row:
    """What became of one problem.

    Attributes
    ----------
    name : str
    key : str
        Digest of the problem and its options.
    settings : dict
        Its values of the grid.
    file : Path
        The plan's archive; not there where `error` says why.
    error : str
        "" where there is a plan.
    fault : bool
        Whether the error is a fault of a program rather than of the problem; such are tried again.
    verified, verdict, cost, initial_cost, duration, evaluations
        Of the plan.
    aim : float
        What it is ranked by, the smaller the better: the duration of what was to be the fastest
        motion, else the cost.
    ends : float or None
        When the motion ends where that is before the path does [s].
    seconds : float
        Its worker's time.
    """

    name: str
    key: str
    file: Path
    settings: Mapping[str, Any] = field(default_factory=dict)
    error: str = ""
    fault: bool = False
    verified: bool = False
    verdict: str = ""
    cost: float = float("inf")
    initial_cost: float = float("inf")
    duration: float = 0.0
    evaluations: int = 0
    aim: float = float("inf")
    ends: float | None = None
    seconds: float = 0.0

    @property
    def rank(self) -> tuple[bool, bool, float]:
        """Its place among others, the smaller the better: what has a plan, and a verified one."""
        return bool(self.error), not self.verified, self.aim

    @property
    def outcome(self) -> str:
        """Its cost; of what is only a part of the path when it ends."""
        return f"{self.cost:.6g}" if self.ends is None else f"ends at t = {self.ends:.4g} s"

    def plan(self) -> Plan:
        """Read the plan; FileFormatError where there is none."""
        if self.error:
            raise FileFormatError(f"{self.name}: has no plan: {self.error}")
        return load_plan(self.file)


class Folder:
    """The folder of a batch.

    Parameters
    ----------
    path : Path
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def plan_file(self, name: str) -> Path:
        """Return where a problem's plan is."""
        return self.path / "plans" / f"{name}.npz"

    def finished(self, name: str, key: str) -> Row | None:
        """Return the row of a problem that an earlier run finished; None where it has to be run."""
        file = self._row_file(name)
        if not file.is_file():
            return None
        try:
            values = json.loads(file.read_text(encoding="utf-8"))
            row = Row(file=self.plan_file(name), **values)
        except (OSError, ValueError, TypeError):
            return None  # not one of ours, or of another version: it is written anew
        sound = row.key == key and not row.fault and (bool(row.error) or row.file.is_file())
        return row if sound else None

    def record(self, row: Row, archive: bytes) -> Row:
        """Write plan and row, in this order: a row says that all is there."""
        if archive:
            write_bytes(row.file, archive)
        values = {k: v for k, v in dataclasses.asdict(row).items() if k != "file"}
        write_text(self._row_file(row.name), json.dumps(values) + "\n")
        return row

    def write_tables(self, rows: Sequence[Row], replays: int) -> None:
        """Write ``table.csv`` and ``index.html``, the best first, with replays of the best ones."""
        ranked = sorted(rows, key=lambda row: row.rank)
        planned = [row for row in ranked if not row.error]
        links = {row.name: self._replay(row, k < replays) for k, row in enumerate(planned)}
        keys = list(dict.fromkeys(key for row in rows for key in row.settings))
        header = ["rank", "name", *keys, "verified", "cost", "without self-motion", "duration"]
        header += ["seconds", "plan", "replay", "verdict"]
        lines = [self._cells(k, row, keys, links) for k, row in enumerate(ranked, 1)]
        write_text(self.path / "table.csv", _csv([header, *lines]))
        write_text(self.path / "index.html", _page(header, lines))

    def _cells(
        self, rank: int, row: Row, keys: Sequence[str], links: Mapping[str, str]
    ) -> list[str]:
        numbers = ["", "", ""]
        if not row.error:
            costs = [f"{v:.8g}" for v in (row.cost, row.initial_cost)]
            numbers = [*(costs if row.ends is None else [row.outcome, ""]), f"{row.duration:.8g}"]
        settings = [json.dumps(row.settings[key]) if key in row.settings else "" for key in keys]
        file = "" if row.error else row.file.relative_to(self.path).as_posix()
        state = "no plan" if row.error else "yes" if row.verified else "no"
        timing = f"{row.seconds:.3f}"
        said = row.error or row.verdict
        start = [str(rank), row.name, *settings, state, *numbers, timing]
        return [*start, file, links.get(row.name, ""), said]

    def _replay(self, row: Row, wanted: bool) -> str:
        """Return the address of a plan's replay, made once and only where wanted."""
        file = self.path / "replays" / f"{row.name}.html"
        # A plan that was made anew is newer than its replay.
        sound = file.is_file() and file.stat().st_mtime >= row.file.stat().st_mtime
        if not sound and wanted:
            from selfmotion.replay import write_replay

            write_replay(row.plan(), file)
        return file.relative_to(self.path).as_posix() if sound or wanted else ""

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
th,td{{padding:.25em .7em;border-bottom:1px solid #ddd;text-align:left;vertical-align:top}}
td{{overflow-wrap:break-word}}td.whole{{white-space:nowrap}}td:last-child{{min-width:16em}}
@media(max-width:1000px){{td{{overflow-wrap:anywhere}}td.whole{{white-space:normal}}
body{{margin:1em}}thead{{display:none}}tr{{display:block;padding:.6em 0}}
td{{display:flex;gap:1em;padding:.1em 0;border:0}}td:empty{{display:none}}
td::before{{content:attr(data-name);flex:0 0 8em;color:#666}}tr{{border-bottom:1px solid #ddd}}}}
</style></head><body><h1>{title}</h1>
<table><thead><tr>{head}</tr></thead><tbody>
{body}
</tbody></table></body></html>
"""


# Columns whose cells are one word or number each.
_WHOLE = {
    "rank",
    "verified",
    "cost",
    "without self-motion",
    "duration",
    "seconds",
    "plan",
    "replay",
}
# What the columns of numbers are of, for people.
_HEADS = {"duration": "duration, s", "seconds": "planned in, s"}


def _page(header: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    linked = {header.index("plan"), header.index("replay")}

    def cell(k: int, text: str) -> str:
        safe = html.escape(text)
        address = urllib.parse.quote(text)
        shown = f'<a href="{address}">{header[k]}</a>' if k in linked and text else safe
        name = html.escape(_HEADS.get(header[k], header[k]))
        whole = ' class="whole"' if header[k] in _WHOLE else ""
        return f'<td{whole} data-name="{name}">{shown}</td>'

    rows = ("".join(cell(k, text) for k, text in enumerate(line)) for line in lines)
    return _PAGE.format(
        title=f"{len(lines)} problems, best first",
        head="".join(f"<th>{html.escape(_HEADS.get(name, name))}</th>" for name in header),
        body="\n".join(f"<tr>{row}</tr>" for row in rows),
    )
