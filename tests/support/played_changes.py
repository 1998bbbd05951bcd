"""Programs of controllers, played as their makers say that controllers run them.

Nothing of it is code of the package. A program is read by patterns into steps, and played: straight
in joints, straight and slerp in space, circles, splines, corners cut up to the middle of both
sides, at the times or the speeds that are in force. `Player.beyond` says what of it is not what a
plan or a job says, beyond what the file stated when it was written. Kinematics are those of
`support.own_kinematics`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, Slerp

import selfmotion as sm
from selfmotion.basics import Array
from support.own_kinematics import Arm

# Rounding of poses and joints in files [m, rad], and of times [s].
ROUNDED, LATE = 5e-8, 1.5e-3
# Points of a step between two targets, and of a path that curves are held against.
_POINTS, _OF_PATH = 12, 4000
# Corners of seams at speeds are cut within this [m].
_ZONE = 3e-4
_NUMBER = r"-?\d+\.?\d*(?:[Ee][-+]?\d+)?"


@dataclass
class Step:
    """One line of a program: a motion, a wait, or an output.

    Attributes
    ----------
    kind : str
        "joints", "pose", "arc", "wait" or "output".
    target : Array
        Joints [rad], or a pose (4, 4).
    via : Array or None
        Through where an arc goes (3,) [m].
    seconds, speed : float
        Of timed motions and waits; of motions at a speed [m/s]. NaN where there is none.
    stops : bool
    slow : bool
        Whether it goes to where the program goes on.
    output : tuple
        What is switched, and to what.
    """

    kind: str
    target: Array = field(default_factory=lambda: np.zeros(0))
    via: Array | None = None
    seconds: float = np.nan
    speed: float = np.nan
    stops: bool = True
    slow: bool = False
    output: tuple[str, bool] = ("", False)


@dataclass
class Read:
    """A program as it is read: steps, tool, work object, planned times, and what holds it back."""

    steps: list[Step]
    tool: Array
    work: Array
    planned: list[float]
    complaints: list[str] = field(default_factory=list)


def _numbers(text: str) -> list[float]:
    return [float(value) for value in re.findall(_NUMBER, text)]


def _pose(place: Array, turn: Rotation) -> Array:
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = turn.as_matrix(), place
    return found


def _code(text: str, mark: str) -> Iterator[str]:
    for line in text.splitlines():
        stripped = line.strip()
        if stripped.startswith(mark) and "planned time: " not in stripped:
            continue
        if stripped:
            yield stripped


# KUKA.


def _krl_values(text: str) -> dict[str, float]:
    return {name: float(x) for name, x in re.findall(rf"([A-Z]\d?) ({_NUMBER})", text)}


def _krl_pose(text: str) -> Array:
    v = _krl_values(text)
    turn = Rotation.from_euler("ZYX", [v["A"], v["B"], v["C"]], degrees=True)
    return _pose(1e-3 * np.array([v["X"], v["Y"], v["Z"]]), turn)


def _krl_axes(text: str) -> Array:
    v = _krl_values(text)
    return np.radians([v[f"A{k}"] for k in range(1, 7)])


def _krl(text: str) -> Read:
    read = Read([], np.eye(4), np.eye(4), [])
    percent, speed, turning = {"VEL": 0.0, "ACC": 0.0}, 0.0, {"ORI1": 0.0, "ORI2": 0.0}
    block: list[Step] = []
    triggers: list[tuple[int, tuple[str, bool]]] = []
    inside, parts = "", list[float]()
    at: Array | None = None
    for line in _code(text, ";"):
        if found := re.match(r"; planned time: ([\d.]+) s", line):
            read.planned.append(float(found[1]))
        elif line.startswith("$TOOL"):
            read.tool = _krl_pose(line)
        elif line.startswith("$BASE"):
            read.work = _krl_pose(line)
        elif found := re.match(r"BAS\(#(VEL|ACC)_PTP, ?([\d.]+)\)", line):
            percent[found[1]] = float(found[2])
        elif found := re.match(rf"\$VEL\.CP ?= ?({_NUMBER})", line):
            speed = float(found[1])
        elif found := re.match(rf"\$VEL\.(ORI[12]) ?= ?({_NUMBER})", line):
            turning[found[1]] = float(found[2])
        elif found := re.match(r"(?:TRIGGER .*DO )?\$OUT\[(\d+)\] ?= ?(TRUE|FALSE)", line):
            output = found[1], found[2] == "TRUE"
            if line.startswith("TRIGGER"):
                triggers.append((len(block), output))
            else:
                read.steps.append(Step("output", output=output))
        elif line.startswith("PTP {"):
            read.steps.append(Step("joints", _krl_axes(line), slow=True))
        elif line.startswith("LIN {"):
            at = _krl_pose(line)
            read.steps.append(Step("pose", at, slow=True))
        elif line in ("PTP_SPLINE", "SPLINE"):
            inside, block, parts, triggers = line, [], [], []
        elif line.startswith("SPTP {"):
            block.append(Step("joints", _krl_axes(line), stops=False))
        elif re.match(r"(SPL|SLIN|SCIRC) ?\{", line):
            poses = re.findall(r"\{[^}]*\}", line)
            own = re.search(rf"\$VEL\.CP ?= ?({_NUMBER})", line)
            step = Step("pose", _krl_pose(poses[-1]), stops=False)
            step.speed = float(own[1]) if own else speed
            if line.startswith("SCIRC"):
                step.kind, step.via = "arc", _krl_pose(poses[0])[:3, 3]
            if inside:
                block.append(step)
            else:
                step.stops = True
                read.steps.append(step)
                at = step.target
        elif found := re.match(r"TIME_BLOCK PART ?= ?([\d.]+)", line):
            parts.append(float(found[1]))
        elif found := re.match(r"TIME_BLOCK END ?= ?([\d.]+)", line):
            share = float(found[1]) / sum(parts)
            share = 1.0 if abs(share - 1.0) * sum(parts) < 1e-4 else share
            for step, part in zip(block, parts, strict=True):
                step.seconds, step.speed = share * part, np.nan
            if inside == "PTP_SPLINE" and min(percent.values()) < 100.0:
                read.complaints.append("axes are held back")
            if inside == "SPLINE" and at is not None:
                every = [at, *(step.target for step in block)]
                for (one, other), step in zip(pairwise(every), block, strict=True):
                    far = np.linalg.norm(other[:3, 3] - one[:3, 3]) / step.seconds
                    turn = Rotation.from_matrix(one[:3, :3].T @ other[:3, :3]).magnitude()
                    if far > speed or np.degrees(turn) / step.seconds > min(turning.values()):
                        read.complaints.append("the tool is held back")
        elif line == "ENDSPLINE":
            block[-1].stops = True
            for k, step in enumerate(block):
                read.steps.append(step)
                read.steps += [
                    Step("output", output=output) for number, output in triggers if number == k
                ]
            at = block[-1].target if block[-1].kind != "joints" else at
            inside = ""
        elif found := re.match(r"WAIT SEC ([\d.]+)", line):
            read.steps.append(Step("wait", seconds=float(found[1])))
    return read


# ABB.


def _rapid_pose(place: str, turn: str) -> Array:
    w, x, y, z = _numbers(turn)
    return _pose(1e-3 * np.array(_numbers(place)), Rotation.from_quat([x, y, z, w]))


def _rapid(text: str) -> Read:
    read, speeds = Read([], np.eye(4), np.eye(4), []), dict[str, float]()
    for line in _code(text, "!"):
        lists = re.findall(r"\[([^\[\]]*)\]", line)
        if found := re.match(r"! planned time: ([\d.]+) s", line):
            read.planned.append(float(found[1]))
        elif "tooldata" in line:
            read.tool = _rapid_pose(lists[0], lists[1])
        elif "wobjdata" in line:
            read.work = _rapid_pose(lists[0], lists[1]) @ _rapid_pose(lists[2], lists[3])
        elif found := re.match(r"CONST speeddata (\w+)", line):
            values = _numbers(lists[0])
            speeds[found[1]] = 1e-3 * values[0]
            if not found[1].endswith("_v") and values[1] < 500.0:
                read.complaints.append("the tool turns slower")
        elif line.startswith("SetDO"):
            name, value = re.match(r"SetDO (\w+), ?(\d)", line).groups()  # type: ignore[union-attr]
            read.steps.append(Step("output", output=(name, value == "1")))
        elif line.startswith("WaitTime"):
            read.steps.append(Step("wait", seconds=_numbers(line)[0]))
        elif line.startswith("Move"):
            rest = line.rpartition("]")[2]
            step = Step("joints", stops="fine" in rest)
            if line.startswith("MoveAbsJ"):
                step.target = np.radians(_numbers(lists[0]))
            else:
                step.kind, step.target = "pose", _rapid_pose(*lists[-4:-2])
            if line.startswith("MoveC"):
                step.kind, step.via = "arc", 1e-3 * np.array(_numbers(lists[0]))
            timed = re.search(r"\\T:=([\d.]+)", rest)
            named = re.search(r", ?(\w+_[vf]\d*),", rest)
            if timed:
                step.seconds = float(timed[1])
            elif named and not named[1].endswith("_v"):
                step.speed = speeds[named[1]]
            else:
                step.slow = True
            read.steps.append(step)
    return read


# Universal Robots.


def _ur_pose(text: str) -> Array:
    values = np.array(_numbers(text))
    return _pose(values[:3], Rotation.from_rotvec(values[3:]))


def _urscript(text: str) -> Read:
    read = Read([], np.eye(4), np.eye(4), [])
    for line in _code(text, "#"):
        lists = re.findall(r"\[([^\[\]]*)\]", line)
        rest = line.rpartition("]")[2]
        given = {name: float(x) for name, x in re.findall(rf"([atvr])=({_NUMBER})", rest)}
        if found := re.match(r"# planned time: ([\d.]+) s", line):
            read.planned.append(float(found[1]))
        elif line.startswith("set_tcp"):
            read.tool = _ur_pose(lists[0])
        elif line.startswith("feature"):
            read.work = _ur_pose(lists[0])
        elif found := re.match(r"set_standard_digital_out\((\d), ?(True|False)\)", line):
            read.steps.append(Step("output", output=(found[1], found[2] == "True")))
        elif line.startswith("sleep"):
            read.steps.append(Step("wait", seconds=_numbers(line)[0]))
        elif re.match(r"move[jlc]\(", line):
            step = Step("joints", stops=given.get("r", 0.0) == 0.0, slow="r" not in given)
            if line.startswith("movej"):
                step.target = np.array(_numbers(lists[0]))
            else:
                step.kind, step.target = "pose", _ur_pose(lists[-1])
            if line.startswith("movec"):
                step.kind, step.via = "arc", np.array(_numbers(lists[0])[:3])
            step.seconds = given.get("t", np.nan)
            step.speed = given.get("v", np.nan) if "t" not in given else np.nan
            read.steps.append(step)
    return read


def read_program(file: Path) -> Read:
    """Read a program by patterns of our own."""
    return {".src": _krl, ".mod": _rapid, ".script": _urscript}[file.suffix](file.read_text())


def stated(text: str) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Return what a file states of seams and of moves: [m], [rad], joints."""
    found = [
        tuple(np.array([1e-3, 1.0, 1.0]) * np.array(_numbers(line.partition(": ")[2])))
        for line in text.splitlines()
        if re.match(r"\W*(deviation|deviation of moves): ", line.strip())
    ]
    return found[0], found[-1]  # type: ignore[return-value]


def kept(text: str) -> tuple[float, float] | None:
    """Return what seams at speeds keep, as a file states it [m, rad]."""
    found = re.search(rf"kept of what is prescribed: ({_NUMBER}) mm, ({_NUMBER}) rad", text)
    return (1e-3 * float(found[1]), float(found[2])) if found else None


@dataclass
class Asked:
    """A step of what was planned: a seam along a path, or a move, or a rest.

    Attributes
    ----------
    duration : float
    path : Path or None
        None of a move.
    motion : Trajectory
    pointing : bool
        Whether turning about the tool's axis is free.
    """

    duration: float
    path: sm.paths.Path | None
    motion: sm.Trajectory
    pointing: bool


def asked_of(made: sm.Plan | sm.Program) -> list[Asked]:
    """Return the steps of a plan or a job."""
    parts = [made] if isinstance(made, sm.Plan) else [step.made for step in made.steps]
    return [
        Asked(item.trajectory.duration, item.problem.path, item.trajectory, True)
        if isinstance(item, sm.Plan)
        else Asked(item.motion.duration, None, item.motion, False)
        for item in parts
    ]


class Player:
    """Plays changed programs, and says what of them is not what was asked for."""

    def __init__(self, made: sm.Plan | sm.Program, written: Path, carrier: str, tool: str) -> None:
        self._arm, self._asked = Arm(made.robot), asked_of(made)
        self._pointing = True
        text = written.read_text()
        self._first = read_program(written)
        self._stated, self._kept = stated(text), kept(text)
        turn, place = self._arm.place(carrier, made.robot.lower[None])
        self._base = _pose(place[0], Rotation.from_matrix(turn[0]))
        self._tool = tool

    def beyond(self, file: Path) -> list[str]:
        """Return what of a changed program is beyond what was stated; empty for nothing."""
        read = read_program(file)
        found = list(read.complaints)
        outputs = [step.output for step in read.steps if step.kind == "output"]
        if outputs != [step.output for step in self._first.steps if step.kind == "output"]:
            found.append("outputs are others")
        if not np.allclose(read.tool, self._first.tool, atol=1e-9):
            # Of axis targets the tool moves nothing.
            found += ["the tool is another one"] if self._has_poses(read) else []
        shift = self._base @ read.work @ np.linalg.inv(self._base @ self._first.work)
        return found + list(self._motions(read, shift))

    def _has_poses(self, read: Read) -> bool:
        return any(step.kind in ("pose", "arc") for step in read.steps)

    def _motions(self, read: Read, shift: Array) -> Iterator[str]:
        number, gone, here = 0, 0.0, None
        group: list[Step] = []
        planned, clock = list(read.planned), list[float]()
        for step in read.steps:
            if step.kind == "output":
                before = sum(item.duration for item in self._asked[:number])
                within = sum(item.seconds for item in group)
                clock.append(before + gone + within)
                continue
            if step.slow:
                here = step.target
                continue
            if number >= len(self._asked):
                yield "it goes on when all is done"
                return
            if step.kind == "wait":
                seconds = step.seconds
            else:
                group.append(step)
                if not step.stops:
                    continue
                if here is None:
                    yield "it begins nowhere"
                    return
                if np.isfinite(step.speed):
                    seconds = planned.pop(0) if planned else np.nan
                    yield from self._at_speeds(here, group, shift, number)
                else:
                    seconds = sum(item.seconds for item in group)
                    yield from self._timed(here, group, shift, number, gone)
                here, group = step.target, []
            gone += seconds
            if gone > self._asked[number].duration + LATE:
                yield f"step {number} takes {gone:.4g} s, not {self._asked[number].duration:.4g}"
                return
            if gone > self._asked[number].duration - LATE:
                number, gone = number + 1, 0.0
        if number < len(self._asked):
            yield "it ends early"
        first = [at for at in self._clock_of_first() if np.isfinite(at)]
        now = [at for at in clock if np.isfinite(at)]
        late = len(first) == len(now) and np.abs(np.subtract(first, now)).max(initial=0.0) > LATE
        if late:
            yield "outputs are switched at other times"

    def _clock_of_first(self) -> list[float]:
        """Return when outputs are switched as written; NaN within seams at a speed [s]."""
        found, at, planned = list[float](), 0.0, list(self._first.planned)
        for step in self._first.steps:
            if step.slow:
                continue
            if step.kind == "output":
                found.append(at)
            elif np.isfinite(step.seconds):
                at += step.seconds
            elif np.isfinite(step.speed):
                # Times within are the controller's.
                at = at + planned.pop(0) if step.stops else np.nan
        return found

    def _timed(
        self, here: Array, group: list[Step], shift: Array, number: int, gone: float
    ) -> Iterator[str]:
        t = np.append(0.0, np.cumsum([step.seconds for step in group]))
        times = np.unique(np.concatenate([np.linspace(a, b, _POINTS) for a, b in pairwise(t)]))
        by_joints = group[0].kind == "joints"
        targets = [here, *(step.target for step in group)]
        for item in targets:
            if item.shape != targets[-1].shape:
                yield "joints and poses are mixed"
                return
        asked = self._asked[number]
        for way in _ways(t, targets, times, by_joints=by_joints):
            # Axis targets know no work object.
            tool = self._placed(way) if by_joints else shift @ self._base @ self._first.work @ way
            moved = np.eye(4) if by_joints else shift
            yield from self._off(tool, way if by_joints else None, times + gone, asked, moved)

    def _placed(self, q: Array) -> Array:
        turn, place = self._arm.place(self._tool, q)
        found = np.tile(np.eye(4), (len(q), 1, 1))
        found[:, :3, :3], found[:, :3, 3] = turn, place
        return found

    def _off(
        self, tool: Array, q: Array | None, times: Array, asked: Asked, shift: Array
    ) -> Iterator[str]:
        position, rotation, joint = self._stated[0 if asked.path is not None else 1]
        times = np.clip(times, 0.0, asked.duration)
        if asked.path is not None:
            samples = [asked.path.pose(float(t)) for t in np.clip(times, 0.0, asked.path.duration)]
            wanted = np.array([shift @ pose.homogeneous for pose in samples])
        else:
            motion = asked.motion(times + asked.motion.t[0])
            wanted = shift @ self._placed(motion)
            if q is not None and np.abs(q - motion).max() > joint + ROUNDED:
                yield f"joints are {np.abs(q - motion).max():.4g} off a move, stated {joint:.4g}"
        far = np.linalg.norm(tool[:, :3, 3] - wanted[:, :3, 3], axis=1).max()
        if far > position + ROUNDED:
            yield f"the tool is {1e3 * far:.4g} mm off, stated are {1e3 * position:.4g}"
        if asked.path is not None and asked.pointing:
            leaned = np.linalg.norm(np.cross(tool[:, :3, 2], wanted[:, :3, 2]), axis=1).max()
        else:
            turned = np.einsum("kji,kjl->kil", tool[:, :3, :3], wanted[:, :3, :3])
            leaned = Rotation.from_matrix(turned).magnitude().max()
        if leaned > rotation + ROUNDED:
            yield f"the tool is turned by {leaned:.4g} rad, stated are {rotation:.4g}"

    def _at_speeds(
        self, here: Array, group: list[Step], shift: Array, number: int
    ) -> Iterator[str]:
        asked = self._asked[number]
        if asked.path is None or self._kept is None or here.shape != (4, 4):
            yield "a speed where none was asked for"
            return
        feeds = [feed.asked for feed in asked.path.feeds]
        for step in group:
            if feeds and min(abs(step.speed - feed) / feed for feed in feeds) > 2e-4:
                yield f"at {1e3 * step.speed:.5g} mm/s, asked are {[1e3 * f for f in feeds]}"
        every = [here, *(step.target for step in group)]
        base = shift @ self._base @ self._first.work
        curves = []
        for (one, other), step in zip(pairwise(every), group, strict=True):
            share = np.linspace(0.0, 1.0, 8 * _POINTS)
            if step.via is None:
                curve = one[:3, 3] + share[:, None] * (other[:3, 3] - one[:3, 3])
            else:
                curve = _arc(one[:3, 3], step.via, other[:3, 3], share)
            curves.append(curve @ base[:3, :3].T + base[:3, 3])
        t = np.linspace(0.0, asked.path.duration, _OF_PATH)
        path = asked.path.samples(t).translation @ shift[:3, :3].T + shift[:3, 3]
        curve = np.concatenate(curves)
        far = max(_from_curve(curve, path), _from_curve(path, curve) if len(group) else 0.0)
        # Corners are cut, and the path is seen at so many places.
        coarse = np.linalg.norm(np.diff(path, axis=0), axis=1).max() ** 2
        if far > self._kept[0] + ROUNDED + coarse:
            yield f"the tool is {1e3 * far:.4g} mm off its path, kept are {1e3 * self._kept[0]:.4g}"
        for pose in every:
            axis = (base @ pose)[:3, 2]
            near = int(np.linalg.norm(path - (base @ pose)[:3, 3], axis=1).argmin())
            wanted = shift[:3, :3] @ asked.path.pose(float(t[near])).rotation[:, 2]
            if np.linalg.norm(np.cross(axis, wanted)) > self._kept[1] + 1e-3:
                yield "the tool leans"


def _ways(t: Array, targets: list[Array], times: Array, *, by_joints: bool) -> Iterator[Array]:
    """Yield the ways in which controllers join targets: straight, corners cut, smooth."""
    knots = np.concatenate([t[:1], 0.5 * (t[1:] + t[:-1]), t[-1:]])
    if by_joints:
        q = np.array(targets)

        def straight(at: Array, own: Array, rows: Array) -> Array:
            return np.stack([np.interp(at, own, column) for column in rows.T], axis=1)

        yield straight(times, t, q)
        if len(t) > 2:
            yield straight(times, knots, straight(knots, t, q))
            yield CubicSpline(t, q, bc_type="clamped")(times)
        return
    poses = np.array(targets)

    def between(at: Array, own: Array, rows: Array) -> Array:
        found = np.tile(np.eye(4), (len(at), 1, 1))
        found[:, :3, 3] = np.stack([np.interp(at, own, rows[:, k, 3]) for k in range(3)], axis=1)
        found[:, :3, :3] = Slerp(own, Rotation.from_matrix(rows[:, :3, :3]))(at).as_matrix()
        return found

    yield between(times, t, poses)
    if len(t) > 2:
        yield between(times, knots, between(knots, t, poses))
        smooth = np.tile(np.eye(4), (len(times), 1, 1))
        smooth[:, :3, 3] = CubicSpline(t, poses[:, :3, 3], bc_type="clamped")(times)
        turns = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
        for k in range(1, len(turns)):
            turns[k] *= 1.0 if turns[k] @ turns[k - 1] >= 0.0 else -1.0
        rows = CubicSpline(t, turns, bc_type="clamped")(times)
        smooth[:, :3, :3] = Rotation.from_quat(rows).as_matrix()
        yield smooth


def _arc(a: Array, via: Array, b: Array, share: Array) -> Array:
    """Return points of the circle through three points."""
    normal = np.cross(via - a, b - a)
    normal = normal / np.linalg.norm(normal)
    rows = np.array([via - a, b - a, normal])
    sides = np.array([0.5 * (via @ via - a @ a), 0.5 * (b @ b - a @ a), normal @ a])
    center = np.linalg.solve(rows, sides)
    arm, last = a - center, b - center
    angle = np.arctan2(np.cross(arm, last) @ normal, arm @ last) % (2.0 * np.pi)
    across = np.cross(normal, arm)
    turned = (angle * share)[:, None]
    return center + np.cos(turned) * arm + np.sin(turned) * across


def _from_curve(points: Array, curve: Array) -> float:
    """Return how far points (K, 3) are from a polygon (N, 3) at most."""
    a, b = curve[:-1], curve[1:]
    side = b - a
    length = np.maximum((side**2).sum(axis=1), 1e-30)
    worst = 0.0
    for chunk in np.array_split(points, max(1, len(points) // 64)):
        share = np.einsum("kpc,pc->kp", chunk[:, None] - a, side) / length
        nearest = a + np.clip(share, 0.0, 1.0)[..., None] * side
        off = np.linalg.norm(chunk[:, None] - nearest, axis=2).min(axis=1)
        worst = max(worst, float(off.max()))
    return worst
