"""Random plans as linear programs, judged by kinematics of our own.

`make bench NAME=fuzz-programs`.

Arms of six axes alone, on a rail, and with a plate that tilts and turns; lines, arcs and corners.
Each is written for KUKA, ABB and Universal Robots, read by patterns that share nothing with the
package (`tests/support/played_programs.py`), and played: position linear in time, orientation by
slerp, external axes linear, as lines, with rounded corners, and as a spline. What that is off the
plan must be no more than the file states; and the work object shifted must shift the tool as far.
Half of the plans have a feed: their programs have speeds and circular motions, and are held to the
plan where the tool has gone as far; what the task prescribes must be within the deviation, and the
speeds must be the feed.
"""

from __future__ import annotations

import re
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import selfmotion as sm
from selfmotion.model.task import SE3, exp3
from selfmotion.shop.controllers import PROGRAMS, program_deviation, read_program
from support.industrial import industrial_arm
from support.played_programs import Read, off, read_poses

# Newton's method of the judge, and digits, leave this [m, rad].
ROUNDED = 2e-8
WITHIN = sm.Tolerance(1e-4, 1e-3)
# At how many times of a stretch a program is looked at.
LOOKS = 400
# How far work objects are shifted along x [m].
SHIFT = 0.005
FORMS = (".mod", ".src", ".script")
# The joints' share of their ranges that starts are drawn from; and tries for a plan.
MIDDLE, TRIES = 0.5, 20


class Case(NamedTuple):
    """An arm, its plan, and in which links its poses are counted.

    Attributes
    ----------
    kind : str
    plan : Plan
    carrier : str or None
    flange : str
    unit : bool
        Whether a positioner carries the work object.
    """

    kind: str
    plan: sm.Plan
    carrier: str | None
    flange: str
    unit: bool


class Row(NamedTuple):
    """What was found of a program."""

    kind: str
    form: str
    at_feed: bool
    targets: int
    timed: int
    joints: int
    stated: float
    measured: float
    wrong: str


def arms(folder: Path) -> dict[str, tuple[sm.RobotModel, str, str | None, str, bool]]:
    """Return the arms: robot, task, carrier and flange of poses, whether a positioner carries."""
    there = np.eye(4)
    there[:3, 3] = -0.6, -0.3, 0.0
    parts = {"arm": "ur5", "table": "positioner"}
    cell = sm.load_robot(parts, base={"table": there}, tool="arm/tool0", reference="table/plate")
    return {
        "ABB's, alone": (industrial_arm(folder, "abb"), "pointing", None, "flange", False),
        "KUKA's, alone": (industrial_arm(folder, "kuka"), "pointing", None, "flange", False),
        "KUKA's, on a rail": (
            *(industrial_arm(folder, "kuka", rail=True), "pose", None, "flange", False),
        ),
        "UR10, alone": (sm.load_robot("ur10"), "pointing", "base", "tool0", False),
        "UR5 and a positioner": (cell, "pose", "table/plate", "arm/tool0", True),
    }


def path_from(first: SE3, rng: np.random.Generator, *, at_feed: bool) -> sm.paths.Path:
    """Return a line, an arc or a corner that begins at a pose, at a feed or not."""
    shape = _shape_from(first, rng, at_feed=at_feed)
    return sm.paths.Feed(shape, float(rng.uniform(0.01, 0.1))) if at_feed else shape


def _shape_from(first: SE3, rng: np.random.Generator, *, at_feed: bool) -> sm.paths.Path:
    kind = int(rng.integers(3))
    side = rng.normal(size=3)
    side /= np.linalg.norm(side)
    seconds = float(rng.uniform(1.5, 4.0))
    if kind == 0:
        last = SE3(first.rotation, first.translation + float(rng.uniform(0.05, 0.2)) * side)
        return sm.paths.Line(first, last, seconds)
    if kind == 1:
        radius, turns = float(rng.uniform(0.02, 0.08)), float(rng.uniform(0.3, 1.0))
        more = {"turns": turns, "turn_tool": bool(rng.integers(2))} if at_feed else {}
        return sm.paths.Circle.around(first, radius, seconds, normal=side, **more)
    turned = SE3(first.rotation @ exp3(0.3 * rng.normal(size=3)), first.translation + 0.08 * side)
    across = np.cross(side, rng.normal(size=3))
    last = SE3(turned.rotation, turned.translation + 0.08 * across / np.linalg.norm(across))
    if at_feed:
        return sm.paths.Polyline.from_poses([first, turned, last])
    return sm.paths.Joined(
        [sm.paths.Line(first, turned, seconds), sm.paths.Line(turned, last, seconds)]
    )


def cases(number: int, folder: Path) -> Iterator[tuple[int, Case]]:
    """Yield so many plans that are verified."""
    known = arms(folder)
    kinds = list(known)
    for seed in range(number):
        rng = np.random.default_rng(seed)
        kind = kinds[seed % len(kinds)]
        robot, task, carrier, flange, unit = known[kind]
        low, high = robot.finite_limits()
        middle, half = 0.5 * (low + high), 0.5 * MIDDLE * (high - low)
        for _ in range(TRIES):
            start = middle + half * rng.uniform(-1.0, 1.0, robot.dof)
            try:
                path = path_from(
                    robot.chain.place(start), rng, at_feed=bool(seed // len(kinds) % 2)
                )
                problem = sm.Problem(robot, path, task, start, clearance=None)
                plan = sm.plan(problem, max_evaluations=40)
            except sm.SelfmotionError:
                continue
            if plan.certificate.verified:
                yield seed, Case(kind, plan, carrier, flange, unit)
                break


def judged(case: Case, form: str, file: Path, rng: np.random.Generator) -> Row | None:
    """Return what a program is like; None where joints are written, as poses do not keep it."""
    work = None
    if not case.unit:
        work = SE3(exp3(rng.normal(size=3)), rng.uniform(-0.5, 0.5, 3))
    unit: str | int | None = {".mod": "STN1", ".src": 2}.get(form) if case.unit else None
    asked = sm.files.ProgramSettings(
        WITHIN, mass=2.0, targets="poses", work_object=work, positioner=unit
    )
    sm.files.write_motion(case.plan, file, settings=asked)
    program = read_program(file, case.plan.robot)
    if program.remark:
        return None
    axes = {axis.joint: axis.name for axis in program.axes}
    slides = {axis.name: axis.slides for axis in program.axes}
    read = read_poses(file, slides)
    found = off(
        case.plan.robot, read, case.plan.trajectory, case.carrier, case.flange, axes, (), LOOKS
    )
    stated = program.miss.path
    wrong = [
        f"{name} {one:.6g} > {other:.6g}"
        for name, other in stated._asdict().items()
        if (one := getattr(found, name)) > other + ROUNDED
    ]
    at_feed = bool(case.plan.problem.path.feeds)
    if at_feed:
        turned = found.rotation if case.plan.problem.task.value == "pose" else found.axis
        wrong += [f"turned by {turned:.3g} rad"] if turned > WITHIN.rotation + ROUNDED else []
        wrong += _not_at_feed(case.plan.problem.path, read)
    if found.position > WITHIN.position:
        wrong.append(f"{1e3 * found.position:.4g} mm off")
    targets = read.targets
    wrong += _not_shifted(case, file)
    sm.files.write_motion(case.plan, file, settings=replace(asked, targets="timed-poses"))
    timed = program_deviation(case.plan, file)[0]
    joints = 0
    if form in PROGRAMS:
        sm.files.write_motion(case.plan, file, settings=sm.files.ProgramSettings(WITHIN, mass=2.0))
        joints = program_deviation(case.plan, file)[0]
    return Row(
        *(case.kind, form, at_feed, targets, timed, joints),
        *(stated.position, found.position, "; ".join(wrong)),
    )


def _not_at_feed(path: sm.paths.Path, read: Read) -> list[str]:
    """Return which speeds are none of the feed; stretches with times have none."""
    asked = path.feeds[0].asked
    return [
        f"at {speed:.6g} m/s, the feed is {asked:.6g}"
        for stretch in read.stretches
        for speed in stretch.speeds
        if abs(speed - asked) > 1e-5 * asked
    ]


def _not_shifted(case: Case, file: Path) -> list[str]:
    """Return where the motion that is read is not shifted as the work object is."""
    names = case.plan.robot.joint_names
    before = sm.files.read_motion(file, robot=case.plan.robot).of_joints(names)
    # The work object's first coordinate: of a wobjdata on a unit it is in the second frame.
    frame = r"(\[\[)(-?[\d.]+)(, [^\[\]]*\], \[[^\[\]]*\]\]"
    pattern, scale = {
        ".mod": (frame + (r"\];)" if case.unit else r", \[\[0, 0, 0\].*)"), 1e3),
        ".src": (r"(\$BASE = .*?\{X )(-?[\d.]+)(,)", 1e3),
        ".script": (r"(feature = p\[)(-?[\d.]+)(,)", 1.0),
    }[file.suffix]
    lines = file.read_text().splitlines()
    mark = {".mod": "wobjdata", ".src": "$BASE", ".script": "feature = "}[file.suffix]
    k = next(k for k, line in enumerate(lines) if mark in line)
    lines[k] = re.sub(
        pattern, lambda m: f"{m[1]}{float(m[2]) + SHIFT * scale:.9f}{m[3]}", lines[k], count=1
    )
    file.write_text("\n".join([*lines, ""]))
    try:
        after = sm.files.read_motion(file, robot=case.plan.robot).of_joints(names)
    except sm.errors.FileFormatError as error:
        # At the edge of the workspace, or of a singular pose.
        return [] if "does not follow" in str(error) else [str(error)]
    chain = case.plan.robot.chain_to(case.plan.robot.tool, case.carrier)
    t = np.linspace(0.0, before.duration, 60)
    moved = chain.along(after(t))[2] - chain.along(before(t))[2]
    # Cubics through joints that were found are as near as this.
    off_by = float(np.abs(moved - [SHIFT, 0.0, 0.0]).max())
    return [] if off_by < 2e-6 else [f"shifted by 5 mm it is off by {1e3 * off_by:.4g} mm"]


def main(number: Annotated[int, typer.Option(help="How many plans.")] = 100) -> None:
    """Judge random programs, and print a table; exit 1 where one is not as it states."""
    console, rows, by_joints, begin = Console(width=130), list[Row](), 0, time.perf_counter()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for seed, case in cases(number, folder):
            forms = FORMS if case.kind.endswith("alone") else FORMS[:2]
            for form in forms:
                rng = np.random.default_rng(seed)
                row = judged(case, form, folder / f"random{form}", rng)
                by_joints += row is None
                if row is not None:
                    rows.append(row)
                    if row.wrong:
                        console.print(f"seed {seed}, {case.kind}, {form}: {row.wrong}")
    names = ("arm", "form", "at", "programs", "targets", "with times", "joints")
    table = Table(*names, "stated", "measured", "wrong")
    for kind, form, at_feed in sorted({(row.kind, row.form, row.at_feed) for row in rows}):
        own = [row for row in rows if (row.kind, row.form, row.at_feed) == (kind, form, at_feed)]
        counts = ([row.targets for row in own], [row.timed for row in own])
        joints = [row.joints for row in own if row.joints]
        table.add_row(
            *(kind, form, "a feed" if at_feed else "times", str(len(own))),
            *(f"{np.median(each):.0f}" for each in counts),
            f"{np.median(joints):.0f}" if joints else "",
            f"{1e3 * max(row.stated for row in own):.4f} mm",
            f"{1e3 * max(row.measured for row in own):.4f} mm",
            str(sum(bool(row.wrong) for row in own)),
        )
    console.print(table)
    wrong = sum(bool(row.wrong) for row in rows)
    paced = [row for row in rows if row.at_feed]
    left = sum(row.targets >= row.timed for row in paced)
    console.print(
        f"{len(paced)} programs of seams at a feed: {sum(row.targets for row in paced)} targets, "
        f"{sum(row.timed for row in paced)} with times; {left} have times all the same"
    )
    console.print(
        f"{len(rows)} programs of poses, {by_joints} of joints as poses do not keep the motion; "
        f"{wrong} wrong; {time.perf_counter() - begin:.0f} s"
    )
    raise SystemExit(1 if wrong or not rows else 0)


if __name__ == "__main__":
    typer.run(main)
