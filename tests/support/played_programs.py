"""Linear programs, read by patterns of our own and played as their makers say controllers do.

Position linear in time between two targets, orientation by SciPy's slerp, external axes linear;
corners cut from the middle of one side to that of the next, or a spline of SciPy's through all.
At a speed it is the same in the length of the way, circular motions go along the circle through
three points, and corners are cut 0.3 mm from their targets at most; a motion is where the tool has
gone as far.
Where the tool is, and the arm's joints by Newton's method with differences, comes from yourdfpy's
tree (`support.own_kinematics`).
"""

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, Slerp

import selfmotion as sm
from selfmotion.basics import Array
from support.own_kinematics import Arm

# Newton's steps at most, differences [rad], and when it has arrived [m, parts of a turn].
_STEPS, _DIFFERENCE, _ARRIVED = 30, 1e-6, 1e-9
# Chords that the length of a motion's way is counted by.
_CHORDS = 30_000


@dataclass
class Played:
    """The poses of a stretch: when [s], positions [m], rotations, external axes [rad or m].

    Attributes
    ----------
    name : str
        Of the seam or move.
    by_poses : bool
        Of axis targets no positions are kept.
    speeds : (K,)
        Of one at speeds [m/s]; `t` is then the length of its way [m].
    vias : (K, 3)
        Through where circular motions go; no numbers for others.
    seconds : float
        How long one at speeds was planned to take.
    """

    name: str
    by_poses: bool
    t: Array
    places: Array
    turns: Rotation
    others: Array
    speeds: Array = field(default_factory=lambda: np.zeros(0))
    vias: Array = field(default_factory=lambda: np.zeros((0, 3)))
    seconds: float = 0.0

    @property
    def duration(self) -> float:
        return self.seconds if len(self.speeds) else float(self.t[-1])


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


def _at_speeds(name: str, rows: list, vias: list, speeds: list[float], seconds: float) -> Played:
    places, turns, others = zip(*rows, strict=True)
    places = np.array(places)
    through = np.array([[np.nan] * 3 if via is None else via for via in vias])
    lengths = [
        np.linalg.norm(b - a) if np.isnan(via[0]) else _arc(a, via, b)[3]
        for a, via, b in zip(places[:-1], through, places[1:], strict=True)
    ]
    t = np.append(0.0, np.cumsum(lengths))
    every = Rotation.concatenate(list(turns))
    return Played(
        name, True, t, places, every, np.array(others), np.array(speeds), through, seconds
    )


def _arc(a: Array, via: Array, b: Array) -> tuple[Array, Array, Array, float]:
    """Return centre, two arms of the plane and the length of the arc through three points."""
    # The point of their plane that is as far from all: linear equations in it.
    normal = np.cross(via - a, b - a)
    center = np.linalg.solve(
        np.array([via - a, b - a, normal]),
        [(via @ via - a @ a) / 2.0, (b @ b - a @ a) / 2.0, normal @ a],
    )
    x = a - center
    y = np.cross(normal / np.linalg.norm(normal), x)
    radius = np.linalg.norm(x)
    angle = np.arctan2((b - center) @ y, (b - center) @ x) % (2.0 * np.pi)
    # ABB's points are apart by 0.1 mm and 1°, and arcs below 240°.
    assert np.radians(2.0) < angle < np.radians(240.0)
    assert radius * angle > 5e-4
    middle = np.arctan2((via - center) @ y, (via - center) @ x) % (2.0 * np.pi)
    assert middle < angle
    return center, x, y, float(radius * angle)


def _planned(text: str) -> float | None:
    found = re.match(r"\s*[!;#] planned time: ([\d.]+) s", text)
    return float(found[1]) if found else None


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
    known = {
        key: 1e-3 * float(value)
        for key, value in re.findall(r"CONST speeddata (\w+) := \[([\d.e-]+),", text)
    }
    vias, speeds, planned = [], [], 0.0

    def row_of(place: str, turn: str, others: str) -> tuple:
        outer = dict(zip((f"E{k}" for k in range(1, 7)), _numbers(others), strict=True))
        outer = {axis: value for axis, value in outer.items() if value < 8.9e9}
        return 1e-3 * np.array(_numbers(place)), turned(_numbers(turn)), _scaled(outer, slides)

    for line in text.splitlines():
        step = re.match(r"\s*! step: (.*)", line)
        name = step[1] if step else name
        planned = _planned(line) or planned
        target = r"\[\[(.*?)\], \[(.*?)\], \[.*?\], \[(.*?)\]\]"
        paced = re.match(rf"\s*Move(L|C) (?:{target}, )?{target}, (\w+_f\d+), (\w+)", line)
        if paced:
            kind, *via, place, turn, others, speed, zone = paced.groups()
            assert (kind == "C") == (via[0] is not None)
            assert zone in ("z0", "fine")
            rows.append(row_of(place, turn, others))
            vias.append(None if via[0] is None else row_of(*via)[0])
            speeds.append(known[speed])
            if zone == "fine":
                found.append(_at_speeds(name, rows, vias, speeds, planned))
                rows, vias, speeds = rows[-1:], [], []
            continue
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
        row = row_of(move[1], move[2], move[3])
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
    vias, speeds, planned, speed, inside, timed = [], [], 0.0, 0.0, False, False
    for line in text.splitlines():
        step = re.match(r"\s*; step: (.*)", line)
        name = step[1] if step else name
        planned = _planned(line) or planned
        rate = re.match(r"\s*\$VEL\.CP = ([\d.e-]+)", line)
        speed = float(rate[1]) if rate else speed
        inside = (inside or bool(re.match(r"\s*SPLINE", line))) and "ENDSPLINE" not in line
        timed = timed or "TIME_BLOCK" in line if inside or "ENDSPLINE" in line else False
        paced = re.match(
            r"\s*(SLIN|SPL|SCIRC) (?:(\{[^}]*\}), )?(\{[^}]*\})(?: WITH \$VEL.CP = (\S+))?$", line
        )
        if paced and not timed:
            assert (paced[1] == "SCIRC") == (paced[2] is not None)
            rows.append(pose(paced[3]))
            vias.append(pose(paced[2])[0] if paced[2] else None)
            speeds.append(float(paced[4]) if paced[4] else speed)
        if speeds and not inside:
            found.append(_at_speeds(name, rows, vias, speeds, planned))
            rows, vias, speeds = rows[-1:], [], []
        if (paced and not timed) or "ENDSPLINE" in line:
            continue
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
    vias, speeds, planned = [], [], 0.0
    for line in text.splitlines():
        step = re.match(r"\s*# step: (.*)", line)
        name = step[1] if step else name
        planned = _planned(line) or planned
        target = r"pose_trans\(feature, p\[(.*?)\]\)"
        paced = re.match(
            rf"\s*move(l|c)\((?:{target}, )?{target}, a=\S+, v=(\S+), r=([\d.]+)(, mode=0)?\)",
            line,
        )
        if paced:
            assert (paced[1] == "c") == (paced[2] is not None) == (paced[6] is not None)
            assert float(paced[5]) <= 3e-4
            rows.append(pose(paced[3]))
            vias.append(pose(paced[2])[0] if paced[2] else None)
            speeds.append(float(paced[4]))
            if float(paced[5]) == 0.0:
                found.append(_at_speeds(name, rows, vias, speeds, planned))
                rows, vias, speeds = rows[-1:], [], []
            continue
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
    if len(stretch.speeds):
        return _paced_ways(stretch, times)
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


def _paced_ways(stretch: Played, gone: Array) -> list[tuple[Array, Rotation, Array]]:
    """Return the same of one at speeds, at lengths of its way [m]."""
    t = stretch.t
    found = [_along(stretch, gone)]
    if len(t) > 2:
        places, turns, others = _along(stretch, gone)
        places, quats, others = places.copy(), turns.as_quat(), others.copy()
        for k in range(1, len(t) - 1):
            reach = min(CUT, 0.5 * (t[k] - t[k - 1])), min(CUT, 0.5 * (t[k + 1] - t[k]))
            ends = np.array([t[k] - reach[0], t[k] + reach[1]])
            here = (gone > ends[0]) & (gone < ends[1])
            cut = Played("", True, ends, *_along(stretch, ends))
            if here.any():
                new = _lines(ends, cut, gone[here])
                places[here], quats[here], others[here] = new[0], new[1].as_quat(), new[2]
        found.append((places, Rotation.from_quat(quats), others))
        if np.isnan(stretch.vias).all():
            turns = stretch.turns.as_quat()
            for k in range(1, len(turns)):
                turns[k] *= np.sign(turns[k] @ turns[k - 1]) or 1.0
            # A smooth way is the same at all speeds.
            smooth = [CubicSpline(t, x)(gone) for x in (stretch.places, turns, stretch.others)]
            found.append((smooth[0], Rotation.from_quat(smooth[1]), smooth[2]))
    return found


# How far from a target controllers cut corners, at speeds [m].
CUT = 3e-4


def _along(stretch: Played, gone: Array) -> tuple[Array, Rotation, Array]:
    """Return poses and external axes at lengths of the way, round where it goes round."""
    t = stretch.t
    places, turns, others = _lines(t, stretch, gone)
    step = np.clip(np.searchsorted(t, gone, side="right") - 1, 0, len(t) - 2)
    for k in np.flatnonzero(~np.isnan(stretch.vias[:, 0])):
        center, x, y, length = _arc(stretch.places[k], stretch.vias[k], stretch.places[k + 1])
        angle = (gone - t[k]) / np.linalg.norm(x)
        arc = center + np.cos(angle)[:, None] * x + np.sin(angle)[:, None] * y
        assert abs(length - (t[k + 1] - t[k])) < 1e-12
        places = np.where((step == k)[:, None], arc, places)
    return places, turns, others


@dataclass
class Off:
    """How far what is played is off a motion: the tool [m, rad], a joint [rad or m], its axis z."""

    position: float
    rotation: float
    joint: float
    axis: float = 0.0


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
            when = begin + times
            if len(stretch.speeds):
                share = times / stretch.t[-1]
                when = _when(arm, read, motion, begin, stretch.seconds, share, (carrier, flange))
            exact = motion(np.clip(when, motion.t[0], motion.t[-1]))
            for way in ways(stretch, times):
                found = _off(arm, read, way, exact, (carrier, flange), own, external)
                worst = Off(*(max(a, b) for a, b in zip(vars(worst).values(), found, strict=True)))
        begin += stretch.duration
    return worst


def _when(
    arm: Arm,
    read: Read,
    motion: sm.Trajectory,
    begin: float,
    seconds: float,
    shares: Array,
    links: tuple[str | None, str],
) -> Array:
    """Return when the tool has gone shares of its way between two rests, by many short chords."""
    t = np.unique(
        np.concatenate(
            [
                np.linspace(begin, begin + seconds, _CHORDS),
                motion.t[(motion.t > begin) & (motion.t < begin + seconds)],
            ]
        )
    )
    q = motion(np.clip(t, motion.t[0], motion.t[-1]))
    places = (placed(arm, q, *links) @ read.tool)[:, :3, 3]
    gone = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1)))
    return np.interp(shares * gone[-1], gone, t)


def _off(
    arm: Arm,
    read: Read,
    way: tuple[Array, Rotation, Array],
    exact: Array,
    links: tuple[str | None, str],
    own: list[int],
    external: list[int],
) -> tuple[float, float, float, float]:
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
    leaned = np.linalg.norm(np.cross(here[:, :3, 2], there[:, :3, 2]), axis=1).max()
    joint = float(np.abs(q - exact).max())
    return float(apart), float(turn.magnitude().max()), joint, float(leaned)


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
