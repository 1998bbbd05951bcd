"""Plans a line with every serial chain that example-robot-data ships: `make arms`.

Each URDF of the installed package, each chain of at least two movable joints from its root to an
end: arms, legs, fingers. The tool goes along a line from where the chain moves it well, in the task
that prescribes most rows and leaves self-motion; the plan is judged, and one replay of each file is
written. What cannot be planned says why in the words of its error. Writes docs/chains.md.
"""

from __future__ import annotations

import sys
import tempfile
import time
import traceback
import xml.etree.ElementTree as ElementTree
from importlib.metadata import files
from itertools import groupby
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import typer

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.shell import replay

PAGE = Path(__file__).parents[1] / "docs" / "chains.md"
_HEAD = """# Every chain of example-robot-data

Written by `make arms`: each URDF of the package (version {version}), each chain of at least two
movable joints from its root to an end (arms, legs, fingers). The tool follows a line of
{length:.0f} cm in {duration:.0f} s from a configuration that moves it well, in the task with the
most rows that leaves self-motion; every plan is checked, and one replay
of each file written. {counts}
"""
_LENGTH, _DURATION = 0.02, 2.0
# Configurations that are tried as a start where the first overlaps.
_TRIES = 100
_TASKS = (sm.Task.POSE, sm.Task.POINTING, sm.Task.POSITION, sm.Task.PLANAR)


class Row(NamedTuple):
    """One chain: of which file, to which link, with how many joints, and how it went."""

    file: str
    tool: str
    joints: int
    task: str
    result: str

    @property
    def is_refused(self) -> bool:
        return not self.result.startswith("verified")

    @property
    def is_wrong(self) -> bool:
        return self.result.startswith("UNTYPED")


def robots() -> Path:
    """Return the folder of the robots that example-robot-data installs."""
    for file in files("example-robot-data") or []:
        if file.name == "panda.urdf":
            return Path(str(file.locate())).resolve().parents[2]
    raise SystemExit("example-robot-data is not installed")


def descriptions() -> list[Path]:
    """Return all URDF files, in one order."""
    return sorted(robots().rglob("*.urdf"))


def tips(file: Path) -> list[str]:
    """Return the ends of a URDF's chains of two joints or more, one for each set of joints.

    Where chains share more than half of their joints, as fingers do, they end where they part: at
    the hand.
    """
    chains = _chains(file)
    ends: dict[tuple[str, ...], str] = {}
    for names, links in chains:
        # What ends on the way, like a sensor on a thigh, does not shorten a chain.
        parting = [other for other, _ in chains if _shared(names, other) < len(other)]
        shared = max((_shared(names, other) for other in parting), default=0)
        if 2 * shared > len(names):
            names, links = names[:shared], links[: shared + 1]
        if len(names) > 1:
            # An end of its own, like a tool's frame, or the last link.
            own = next((at[-1][-1] for other, at in chains if other == names), links[-1][0])
            ends.setdefault(names, own)
    contained = {names for names in ends for other in ends if other[: len(names)] == names != other}
    return [end for names, end in ends.items() if names not in contained]


def _chains(file: Path) -> list[tuple[tuple[str, ...], list[list[str]]]]:
    """Return for each end its movable joints, and the links between them, root first."""
    joints = [x for x in ElementTree.parse(file).getroot().findall("joint") if x.get("type")]
    above = {x.find("child").get("link"): x for x in joints}  # type: ignore[union-attr]
    followed = {x.find("mimic").get("joint") for x in joints if x.find("mimic") is not None}
    parents = {x.find("parent").get("link") for x in joints}  # type: ignore[union-attr]
    found = []
    for link in [x for x in above if x not in parents]:
        names, links = list[str](), [[str(link)]]
        while link in above:
            joint = above[link]
            link = joint.find("parent").get("link")  # type: ignore[union-attr]
            if joint.find("mimic") is not None or joint.get("name") in followed:
                names, links = [], [[str(link)]]  # of a gripper: the chain ends before it
            elif joint.get("type") == "fixed":
                links[0].insert(0, str(link))
            else:
                names.insert(0, str(joint.get("name")))
                links.insert(0, [str(link)])
        found.append((tuple(names), links))
    return found


def _shared(one: tuple[str, ...], other: tuple[str, ...]) -> int:
    same = (a == b for a, b in zip(one, other, strict=False))
    return next((k for k, is_same in enumerate(same) if not is_same), min(len(one), len(other)))


def rows_of(file: Path, folder: Path) -> list[Row]:
    """Plan with each chain of a file."""
    name = file.relative_to(robots()).as_posix()
    ends = tips(file)
    if not ends:
        return [Row(name, "", 0, "", "no chain of two joints")]
    rows: list[Row] = []
    for tool in ends:
        # Pages of one robot differ in its joints' angles: one is enough.
        shown = any(not row.is_refused for row in rows)
        rows.append(_row(name, file, tool, None if shown else folder))
    return rows


def _row(name: str, file: Path, tool: str, folder: Path | None) -> Row:
    joints, task = 0, ""
    try:
        robot = sm.load_robot(file, tool)
        joints = robot.dof
        for choice in _TASKS:
            task = choice.value
            if joints > choice.dimension and robot.can_follow(choice):
                break
        result = _planned(robot, task, folder)
    except sm.SelfmotionError as error:
        result = f"{type(error).__name__}: {error}".replace(f"{file}: ", "")
    except Exception as error:
        traceback.print_exc()
        result = f"UNTYPED {error!r}"
    return Row(name, tool, joints, task, result)


def _planned(robot: sm.RobotModel, task: str, folder: Path | None) -> str:
    apart = sm.constraints.Clearance(distance=0.0, disabled=_disabled(robot))
    start = _start(robot, task, apart)
    begin = robot.pose(start)
    end = begin.copy()
    end.translation = begin.translation + _LENGTH * np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0)
    line = sm.paths.Line(begin, end, _DURATION)
    plan = sm.plan(sm.Problem(robot, line, task, start, clearance=apart))
    if folder is not None:
        replay.write_replay(plan, folder / "replay.html").unlink()
    if not plan.certificate.verified:
        return f"not verified: {'; '.join(plan.certificate.failures)}"
    return "verified"


def _disabled(robot: sm.RobotModel) -> tuple[tuple[str, str], ...]:
    """Return the pairs of links that the SRDF nearest in name leaves out; it may be of a family."""
    urdf = Path(robot.urdf.source)
    found = [x for x in urdf.parents[1].glob("srdf/*.srdf") if "<disable_coll" in x.read_text()]
    named = [x for x in found if urdf.stem.startswith(x.stem) or x.stem.startswith(urdf.stem)]
    if not named:
        return ()
    srdf = min(named, key=lambda x: abs(len(x.stem) - len(urdf.stem)))
    pairs = ElementTree.parse(srdf).getroot().iter("disable_collisions")
    listed = [(str(x.get("link1")), str(x.get("link2"))) for x in pairs]
    return tuple(pair for pair in listed if set(pair) <= set(robot.urdf.links))


def _start(robot: sm.RobotModel, task: str, apart: sm.constraints.Clearance) -> Array:
    """Return the configuration that moves the tool best, or one at random without overlaps."""
    best = robot.dexterous_configuration(task)
    if not robot.urdf.has_collisions:
        return best
    lower, upper = robot.finite_limits()
    shares = np.random.default_rng(0).uniform(0.25, 0.75, (_TRIES, robot.dof))
    tries = [best, *(lower + (upper - lower) * shares)]
    model = apart.model(robot)
    return next((q for q in tries if model.distance(q).value >= 0.0), best)


def page(rows: list[Row]) -> str:
    """Return the page."""
    from importlib.metadata import version

    verified = sum(not row.is_refused for row in rows)
    counts = f"{verified} of {len(rows)} are verified; the others say why not."
    parts = [
        _HEAD.format(
            version=version("example-robot-data"),
            length=100.0 * _LENGTH,
            duration=_DURATION,
            counts=counts,
        )
    ]
    for file, members in groupby(rows, key=lambda row: row.file):
        parts += [
            f"\n## {file}\n",
            "| tool | joints | task | result |",
            "| --- | --- | --- | --- |",
        ]
        for row in members:
            told = row.result.replace("|", "\\|").replace("<", "&lt;")
            parts.append(f"| {row.tool} | {row.joints} | {row.task} | {told} |")
    return "\n".join(parts) + "\n"


def main(
    only: Annotated[str, typer.Option(help="Part of the names of files to look at.")] = "",
    out: Annotated[Path, typer.Option(help="The page.")] = PAGE,
) -> None:
    """Plan with all chains, and write the page."""
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as name:
        for file in descriptions():
            if only in str(file.relative_to(robots())):
                began = time.monotonic()
                found = rows_of(file, Path(name))
                rows += found
                print(f"{time.monotonic() - began:5.1f} s", *found, sep="\n  ", flush=True)
    out.write_text(page(rows), "utf-8")
    sys.exit(1 if any(row.is_wrong for row in rows) else 0)


if __name__ == "__main__":
    typer.run(main)
