"""Linear programs, read by patterns of our own and played as their makers say controllers do.

Position linear in time between two targets, orientation by SciPy's slerp, external axes linear;
corners cut from the middle of one side to that of the next, or a spline of SciPy's through all.
Where the tool is, and the arm's joints by Newton's method with differences, comes from yourdfpy's
tree (`support.own_kinematics`).
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, Slerp

import selfmotion as sm
from selfmotion.basics import Array
from support.own_kinematics import Arm

# Newton's steps at most, differences [rad], and when it has arrived [m, parts of a turn].
_STEPS, _DIFFERENCE, _ARRIVED = 30, 1e-6, 1e-9


@dataclass
class Played:
    """The poses of a stretch: when [s], positions [m], rotations, external axes [rad or m].

    Attributes
    ----------
    name : str
        Of the seam or move.
    by_poses : bool
        Of axis targets no positions are kept.
    """

    name: str
    by_poses: bool
    t: Array
    places: Array
    turns: Rotation
    others: Array


@dataclass
class Read:
    """A program: its work object and tool (4, 4), and its stretches."""

    work: Array
    tool: Array
    stretches: list[Played]

    @property
    def targets(self) -> int:
        return sum(len(item.t) - 1 for item in self.stretches)


def read_poses(file: Path, slides: dict[str, bool]) -> Read:
    """Read a program of poses; which external axes slide."""
    return {".mod": _rapid, ".src": _krl, ".script": _urscript}[file.suffix](
        file.read_text(), slides
    )


def _numbers(text: str) -> list[float]:
    return [float(value) for value in re.findall(r"-?[\d.]+(?:[Ee][-+]?\d+)?", text)]


def _scaled(values: dict[str, float], slides: dict[str, bool]) -> list[float]:
    return [
        value * (1e-3 if slides[name] else np.pi / 180.0) for name, value in sorted(values.items())
    ]


def _frame(place: Array, turn: Rotation) -> Array:
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = turn.as_matrix(), place
    return found


def _stretch(name: str, rows: list, seconds: list[float]) -> Played:
    t = np.append(0.0, np.cumsum(seconds))
    places, turns, others = zip(*rows, strict=True)
    return Played(
        name, True, t, np.array(places), Rotation.concatenate(list(turns)), np.array(others)
    )


def _rapid(text: str, slides: dict[str, bool]) -> Read:
    def turned(values: list[float]) -> Rotation:
        w, x, y, z = values
        return Rotation.from_quat([x, y, z, w])

    (tool,) = re.findall(r"tooldata \w+ := \[TRUE, \[\[(.*?)\], \[(.*?)\]\]", text)
    ((fixed, user, turn, inner, rest),) = re.findall(
        r"wobjdata \w+ := \[FALSE, (TRUE|FALSE), \"\w*\", "
        r"\[\[(.*?)\], \[(.*?)\]\], \[\[(.*?)\], \[(.*?)\]\]\]",
        text,
    )
    work = _frame(1e-3 * np.array(_numbers(inner)), turned(_numbers(rest)))
    if fixed == "TRUE":
        work = _frame(1e-3 * np.array(_numbers(user)), turned(_numbers(turn))) @ work
    frame = _frame(1e-3 * np.array(_numbers(tool[0])), turned(_numbers(tool[1])))
    found, rows, seconds, name = [], [], [], ""
    for line in text.splitlines():
        step = re.match(r"\s*! step: (.*)", line)
        name = step[1] if step else name
        move = re.match(
            r"\s*MoveL \[\[(.*?)\], \[(.*?)\], \[.*?\], \[(.*?)\]\], \w+(?:\\T:=([\d.]+))?, (\w+)",
            line,
        )
        by_axes = re.match(r"\s*MoveAbsJ .*?\\T:=([\d.]+), (\w+)", line)
        wait = re.match(r"\s*WaitTime ([\d.]+)", line)
        if wait or by_axes:
            span = float((wait or by_axes)[1])
            found.append(Played(name, False, np.array([0.0, span]), *_nothing()))
        if not move:
            continue
        outer = dict(zip((f"E{k}" for k in range(1, 7)), _numbers(move[3]), strict=True))
        outer = {axis: value for axis, value in outer.items() if value < 8.9e9}
        row = 1e-3 * np.array(_numbers(move[1])), turned(_numbers(move[2])), _scaled(outer, slides)
        if move[4] is None:
            rows, seconds = [row], []
            continue
        rows.append(row)
        seconds.append(float(move[4]))
        if move[5] == "fine":
            found.append(_stretch(name, rows, seconds))
            rows, seconds = [row], []
    return Read(work, frame, found)


def _krl(text: str, slides: dict[str, bool]) -> Read:
    def pose(aggregate: str) -> tuple[Array, Rotation, list[float]]:
        values = {
            name: float(value) for name, value in re.findall(r"([A-Z]\d?) (\S+?)[,}]", aggregate)
        }
        turn = Rotation.from_euler("ZYX", [values[x] for x in "ABC"], degrees=True)
        outer = {name: value for name, value in values.items() if name.startswith("E")}
        return 1e-3 * np.array([values[x] for x in "XYZ"]), turn, _scaled(outer, slides)

    (base,) = re.findall(r"\$BASE = .*?(\{.*\})", text)
    (tool,) = re.findall(r"\$TOOL = (\{.*\})", text)
    found, rows, parts, name = [], [], [], ""
    by_axes = False
    for line in text.splitlines():
        step = re.match(r"\s*; step: (.*)", line)
        name = step[1] if step else name
        slow = re.match(r"\s*LIN (\{.*\})", line)
        if slow:
            rows = [pose(slow[1])]
        wait = re.match(r"\s*WAIT SEC ([\d.]+)", line)
        if wait:
            found.append(Played(name, False, np.array([0.0, float(wait[1])]), *_nothing()))
        if re.match(r"\s*(PTP_)?SPLINE", line):
            parts, by_axes = [], "PTP_" in line
        target = re.match(r"\s*(?:SPL|SLIN) (\{.*\})", line)
        if target:
            rows.append(pose(target[1]))
        part = re.match(r"\s*TIME_BLOCK PART = ([\d.]+)", line)
        if part:
            parts.append(float(part[1]))
        end = re.match(r"\s*TIME_BLOCK END = ([\d.]+)", line)
        if end and by_axes:
            found.append(Played(name, False, np.array([0.0, float(end[1])]), *_nothing()))
        elif end:
            times = [part * float(end[1]) / sum(parts) for part in parts]
            found.append(_stretch(name, rows, times))
            rows = rows[-1:]
    return Read(_frame(*pose(base)[:2]), _frame(*pose(tool)[:2]), found)


def _urscript(text: str, slides: dict[str, bool]) -> Read:
    def pose(numbers: str) -> tuple[Array, Rotation, list[float]]:
        values = _numbers(numbers)
        return np.array(values[:3]), Rotation.from_rotvec(values[3:]), []

    (feature,) = re.findall(r"feature = p\[(.*?)\]", text)
    (tool,) = re.findall(r"set_tcp\(p\[(.*?)\]\)", text)
    found, rows, seconds, name = [], [], [], ""
    for line in text.splitlines():
        step = re.match(r"\s*# step: (.*)", line)
        name = step[1] if step else name
        wait = re.match(r"\s*sleep\(([\d.]+)\)", line)
        if wait:
            found.append(Played(name, False, np.array([0.0, float(wait[1])]), *_nothing()))
        move = re.match(
            r"\s*movel\(pose_trans\(feature, p\[(.*?)\]\), "
            r"(?:a=\S+, v=\S+|t=([\d.]+), r=([\d.]+))\)",
            line,
        )
        if not move:
            continue
        if move[2] is None:
            rows, seconds = [pose(move[1])], []
            continue
        rows.append(pose(move[1]))
        seconds.append(float(move[2]))
        if float(move[3]) == 0.0:
            found.append(_stretch(name, rows, seconds))
            rows, seconds = rows[-1:], []
    return Read(_frame(*pose(feature)[:2]), _frame(*pose(tool)[:2]), found)


def _nothing() -> tuple[Array, Rotation, Array]:
    return np.zeros((2, 3)), Rotation.identity(2), np.zeros((2, 0))


def ways(stretch: Played, times: Array) -> list[tuple[Array, Rotation, Array]]:
    """Return poses and external axes at times, by each way in which controllers join poses."""
    t = stretch.t
    found = [_lines(t, stretch, times)]
    if len(t) > 2:
        knots = np.concatenate([t[:1], 0.5 * (t[:-1] + t[1:]), t[-1:]])
        cut = Played(stretch.name, True, knots, *_lines(t, stretch, knots))
        found.append(_lines(knots, cut, times))
        turns = stretch.turns.as_quat()
        for k in range(1, len(turns)):
            turns[k] *= np.sign(turns[k] @ turns[k - 1]) or 1.0
        smooth = [
            CubicSpline(t, x, bc_type="clamped")(times)
            for x in (stretch.places, turns, stretch.others)
        ]
        found.append((smooth[0], Rotation.from_quat(smooth[1]), smooth[2]))
    return found


def _lines(t: Array, stretch: Played, times: Array) -> tuple[Array, Rotation, Array]:
    places, others = (
        np.stack([np.interp(times, t, x) for x in values.T], axis=1)
        if values.shape[1]
        else np.zeros((len(times), 0))
        for values in (stretch.places, stretch.others)
    )
    return places, Slerp(t, stretch.turns)(times), others


@dataclass
class Off:
    """How far what is played is off a motion: the tool [m, rad], a joint [rad or m]."""

    position: float
    rotation: float
    joint: float


def off(
    robot: sm.RobotModel,
    read: Read,
    motion: sm.Trajectory,
    carrier: str | None,
    flange: str,
    axes: dict[str, str],
    moves: tuple[str, ...] = (),
    looks: int = 150,
) -> Off:
    """Return how far a program is off a motion, at many times; of seams, not of `moves`."""
    arm = Arm(robot)
    own = [robot.joint_names.index(joint) for joint, axis in axes.items() if axis[0] == "A"]
    outer = sorted((axis, joint) for joint, axis in axes.items() if axis[0] == "E")
    external = [robot.joint_names.index(joint) for _, joint in outer]
    worst, begin = Off(0.0, 0.0, 0.0), float(motion.t[0])
    for stretch in read.stretches:
        if stretch.by_poses and stretch.name not in moves:
            times = np.linspace(0.0, stretch.t[-1], looks)
            exact = motion(np.minimum(begin + times, motion.t[-1]))
            for way in ways(stretch, times):
                found = _off(arm, read, way, exact, (carrier, flange), own, external)
                worst = Off(*(max(a, b) for a, b in zip(vars(worst).values(), found, strict=True)))
        begin += float(stretch.t[-1])
    return worst


def _off(
    arm: Arm,
    read: Read,
    way: tuple[Array, Rotation, Array],
    exact: Array,
    links: tuple[str | None, str],
    own: list[int],
    external: list[int],
) -> tuple[float, float, float]:
    places, turns, others = way
    q = np.array(exact)
    q[:, external] = others
    goal = read.work @ np.concatenate(
        [
            np.concatenate([turns.as_matrix(), places[:, :, None]], axis=2),
            np.broadcast_to([[[0.0, 0.0, 0.0, 1.0]]], (len(q), 1, 4)),
        ],
        axis=1,
    )
    wanted = goal @ np.linalg.inv(read.tool)
    for _ in range(_STEPS):
        error = _error(arm, q, wanted, links)
        if np.abs(error).max() < _ARRIVED:
            break
        jacobian = np.empty((len(q), 6, 6))
        for column, joint in enumerate(own):
            more = np.array(q)
            more[:, joint] += _DIFFERENCE
            jacobian[:, :, column] = (_error(arm, more, wanted, links) - error) / _DIFFERENCE
        q[:, own] -= np.linalg.solve(jacobian, error[:, :, None])[:, :, 0]
    assert np.abs(_error(arm, q, wanted, links)).max() < _ARRIVED
    here, there = (placed(arm, x, *links) @ read.tool for x in (q, exact))
    apart = np.linalg.norm(here[:, :3, 3] - there[:, :3, 3], axis=1).max()
    turn = Rotation.from_matrix(here[:, :3, :3].transpose(0, 2, 1) @ there[:, :3, :3])
    return float(apart), float(turn.magnitude().max()), float(np.abs(q - exact).max())


def _error(arm: Arm, q: Array, wanted: Array, links: tuple[str | None, str]) -> Array:
    here = placed(arm, q, *links)
    turn = Rotation.from_matrix(here[:, :3, :3] @ wanted[:, :3, :3].transpose(0, 2, 1))
    return np.hstack([here[:, :3, 3] - wanted[:, :3, 3], turn.as_rotvec()])


def placed(arm: Arm, q: Array, carrier: str | None, link: str) -> Array:
    """Return a link in another one, (K, 4, 4)."""
    known: dict = {}
    found = np.tile(np.eye(4), (len(q), 1, 1))
    found[:, :3, :3], found[:, :3, 3] = arm.place(link, q, known)
    if carrier is not None:
        base = np.tile(np.eye(4), (len(q), 1, 1))
        base[:, :3, :3], base[:, :3, 3] = arm.place(carrier, q, known)
        found = np.linalg.inv(base) @ found
    return found
