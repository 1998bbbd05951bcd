"""The page of `selfmotion view`: from the release of a handle or slider to the verdict.

`make bench NAME=view`. Each handle of each document is dragged, and each slider moved, ten times,
as a hand does it: 30 times a second, then released. What is timed is what the page waits for: its
first motion while it is dragged, and the message that says verified (or what stops it) after the
release, over the connection that the browser uses. Of each document the plan that is shown last is
held against `plan()` of the file as it was saved.
"""

from __future__ import annotations

import json
import shutil
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.table import Table
from websockets.sync.client import ClientConnection, connect

import selfmotion as sm

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from known import RAIL

from support.views import CIRCLE, TOKEN, served, told

UR10_ON_A_RAIL = """
task = "pose"
[robot]
tool = "arm/tool0"
[robot.parts.rail]
file = "rail.urdf"
[robot.parts.arm]
name = "ur10"
on = "rail/carriage"
[path]
kind = "line"
by = [0.0, 0.8, 0.0]
duration = 6.0
start = { position = [0.7, -0.4, 0.5], rpy_deg = [180, 0, 0] }
[[costs]]
kind = "JointVelocity"
weight = 1.0
"""
# Four sides of a frame, from home and back; where and how fast they are is what changes.
FRAME = Path(__file__).parents[1] / "examples" / "frame.toml"
DOCUMENTS = {
    "Panda, circle": CIRCLE,
    "UR10 on a rail, line": UR10_ON_A_RAIL,
    "Panda, job of four seams": FRAME.read_text(),
}
# What is a verdict: of a job first that of the program in the order before.
VERDICTS, LAST = ("early", "whole", "none"), ("whole", "none")
# A drag sends so many places before the last one, so far apart [s].
PLACES, EVERY = 5, 1.0 / 30.0
# How far it goes [m], and a slider, in shares of its range.
FAR, SLID = 0.02, 0.02


@dataclass
class Times:
    """Seconds of one document.

    Attributes
    ----------
    first, verdict, last : list of float
        Until a first motion, from a change; until the verdict, from the release; until the last
        word on it, which of a job is the best order.
    verified : int
        Of how many releases the plan was verified.
    """

    first: list[float] = field(default_factory=list)
    verdict: list[float] = field(default_factory=list)
    last: list[float] = field(default_factory=list)
    verified: int = 0


class Page:
    """The browser's end of the connection."""

    def __init__(self, connection: ClientConnection) -> None:
        self._connection, self._mark = connection, 0
        self.last = told(connection.recv(300))

    def ask(self, **asked: Any) -> int:
        self._mark += 1
        self._connection.send(json.dumps({**asked, "mark": self._mark}))
        return self._mark

    def until(self, mark: int, kinds: tuple[str, ...]) -> dict[str, Any]:
        while True:
            found = self._connection.recv(300)
            if isinstance(found, str):
                raise SystemExit(f"the page was refused: {found}")
            self.last = told(found)
            if self.last["answers"] == mark and self.last["kind"] in kinds:
                return self.last


def moved(page: Page, changes: list[dict[str, Any]], times: Times) -> None:
    """Change something step by step, then release it."""
    for change in changes:
        began = time.perf_counter()
        mark = page.ask(**change, final=False)
        page.until(mark, ("coarse", *VERDICTS))
        times.first.append(time.perf_counter() - began)
        time.sleep(max(0.0, EVERY - (time.perf_counter() - began)))
    began = time.perf_counter()
    mark = page.ask(**changes[-1], final=True)
    found = page.until(mark, VERDICTS)
    times.verdict.append(time.perf_counter() - began)
    if found["kind"] not in LAST:
        found = page.until(mark, LAST)
    times.last.append(time.perf_counter() - began)
    times.verified += found["kind"] == "whole" and found["plans"][0]["verified"]


def drags(page: Page, name: str, way: float) -> list[dict[str, Any]]:
    handle = next(one for one in page.last["handles"] if one["name"] == name)
    found = []
    for share in np.linspace(1.0 / PLACES, 1.0, PLACES):
        matrix = list(handle["matrix"])
        matrix[12] += share * way * FAR
        found.append({"do": "drag", "name": name, "matrix": matrix})
    return found


def slides(page: Page, name: str, way: float) -> list[dict[str, Any]]:
    slider = next(one for one in page.last["sliders"] if one["name"] == name)
    low, high, value = slider["low"], slider["high"], slider["value"]
    to = value + SLID * (high - low) if way > 0.0 else max(value - SLID * (high - low), low)
    return [
        {"do": "slide", "name": name, "value": float(each)}
        for each in np.linspace(value, np.clip(to, low, high), PLACES)
    ]


def written(text: str, folder: Path) -> Path:
    """Return the file of a document, with what it names beside it."""
    (folder / "rail.urdf").write_text(RAIL)
    shutil.copy(FRAME.with_name("seams.csv"), folder)
    file = folder / "problem.toml"
    file.write_text(text)
    return file


def measured(text: str, repeats: int) -> tuple[Times, bool]:
    """Return the times of a document, and whether what is shown last is the plan of the file."""
    times = Times()
    with TemporaryDirectory() as folder:
        file = written(text, Path(folder))
        with (
            served(file) as server,
            connect(
                f"ws://127.0.0.1:{server.port}/live?token={TOKEN}", max_size=None, proxy=None
            ) as connection,
        ):
            page = Page(connection)
            handles = [one["name"] for one in page.last["handles"] if one["moves"]]
            sliders = [one["name"] for one in page.last["sliders"]]
            for k in range(repeats):
                way = 1.0 if k % 2 == 0 else -0.5
                for name in handles:
                    moved(page, drags(page, name, way), times)
                for name in sliders:
                    moved(page, slides(page, name, way), times)
            server.session.answer({"do": "save"})
            return times, is_that_of_the_file(server.session.found, file)


def is_that_of_the_file(found: Any, file: Path) -> bool:
    """Return whether what is shown is what is planned of a file, bit for bit."""
    if found.made is not None:
        again = sm.files.read_seam_job(file).plan()
        return bool(np.array_equal(found.made.trajectory.q, again.trajectory.q))
    job = sm.files.read_job(file)
    plan = sm.plan(job.problem, **job.settings)
    return bool(np.array_equal(found.plan.trajectory.q, plan.trajectory.q))


def main(
    repeats: Annotated[int, typer.Option(help="Drags of each handle and slider.")] = 10,
    only: Annotated[str, typer.Option(help="Begin of a document's name; default: all.")] = "",
) -> None:
    heads = ("first motion, p50", "p95", "verdict, p50", "p95", "last word, p50", "p95")
    table = Table("", *heads, "verified", "plan()")
    sound = True
    for name, text in DOCUMENTS.items():
        if not name.startswith(only):
            continue
        times, same = measured(text, repeats)
        sound &= same
        row = [
            f"{1e3 * np.percentile(each, share):.0f} ms"
            for each in (times.first, times.verdict, times.last)
            for share in (50, 95)
        ]
        count = f"{times.verified} of {len(times.verdict)}"
        table.add_row(name, *row, count, "the same" if same else "ANOTHER")
    Console(width=120).print(table)
    raise SystemExit(0 if sound else 1)


if __name__ == "__main__":
    typer.run(main)
