"""What a job asks for, which its program is held against."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from selfmotion.basics import Array, Saved, SelfmotionError, restore
from selfmotion.collision import Obstacle, obstacle_from_dict
from selfmotion.constraints import Clearance, Constraint
from selfmotion.costs import cost_from_dict
from selfmotion.job.seam import JOB_END, JOB_START, Seam, one_way
from selfmotion.job.step import Step
from selfmotion.path import Path
from selfmotion.result import Plan
from selfmotion.robot import RobotModel
from selfmotion.task import Relaxation, Task

# Two paths are one where they are as near at these shares of their time, which no rhythm of a path
# has [m, and as a rotation matrix]; times are the same up to rounding [s].
_SHARES = np.modf(0.5 * (np.sqrt(5.0) - 1.0) * np.arange(1, 14))[0]
_SAME, _ROUNDING = 1e-9, 1e-9
# The program begins and ends so near to where it was asked to [rad or m].
_JOINT = 1e-9


@dataclass(frozen=True, eq=False)
class Specification:
    """What a job asks for.

    Attributes
    ----------
    seams : tuple of Seam
    in_order : bool
        Whether in the order of `seams`.
    start, end : (n,) or None
        Where the program begins and ends; None for anywhere.
    constraints : tuple of Constraint
        What all seams and moves have to keep.
    clearance : Clearance or None
    """

    seams: tuple[Seam, ...]
    in_order: bool = False
    start: Array | None = None
    end: Array | None = None
    constraints: tuple[Constraint, ...] = ()
    clearance: Clearance | None = None

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """What stands there from the beginning."""
        return () if self.clearance is None else self.clearance.obstacles

    def failures(
        self, robot: RobotModel, steps: Sequence[Step], missing: Mapping[str, str]
    ) -> Iterator[str]:
        """Yield what of it steps do not keep, but for seams that are said to be missing."""
        seams = {seam.name: seam for seam in self.seams}
        made = [step.name for step in steps if step.is_seam]
        for name in dict.fromkeys(made):
            if name not in seams:
                yield f"nobody asked for seam '{name}'"
            elif made.count(name) > 1:
                yield f"seam '{name}' is made {made.count(name)} times"
        if not seams.keys() >= set(made):
            return
        for name in seams:
            if name not in made and name not in missing:
                yield f"seam '{name}' was asked for, and is neither made nor said to be missing"
        yield from self._order(made, seams)
        yield from self._ends(steps)
        yield from _moves(steps, seams)
        for number, step in enumerate(steps):
            if isinstance(step.made, Plan):
                yield from _seam(step, step.made, seams[step.name])
                following = steps[number + 1] if number + 1 < len(steps) else None
                yield from _wait(step, following, seams[step.name].wait)
        yield from self._kept(robot, steps)

    def _order(self, made: Sequence[str], seams: Mapping[str, Seam]) -> Iterator[str]:
        if self.in_order and made != [name for name in seams if name in made]:
            yield "the seams are not in the order that was asked for"
        for number, name in enumerate(made):
            before, seam = set(made[:number]), seams[name]
            late = [other for other in seam.after if other not in before]
            if late:
                yield f"seam '{name}' is made before '{late[0]}', after which it has to come"
            if seam.after_any and before.isdisjoint(seam.after_any):
                yield f"seam '{name}' is made before any of those on which it stands"

    def _ends(self, steps: Sequence[Step]) -> Iterator[str]:
        """Yield where it begins or ends elsewhere; moves that were not found are told elsewhere."""
        for q, at, where in ((self.start, 0, "begin"), (self.end, -1, "end")):
            if q is None or not steps or steps[at].is_missing:
                continue
            gap = float(np.abs(steps[at].motion.q[at] - q).max())
            if not gap <= _JOINT:
                yield f"it does not {where} where it was asked to: {gap:.2e}"

    def _kept(self, robot: RobotModel, steps: Sequence[Step]) -> Iterator[str]:
        """Yield steps that are judged by less than what all of them have to keep."""
        known: dict[int, str] = {}
        wanted = [item for item in self.constraints if item.applies(robot) and not one_way(item)]
        apart = self.clearance if robot.urdf.has_collisions or self.obstacles else None
        for step in steps:
            kept = step.constraints
            described = {_described(item, known) for item in kept}
            for item in wanted:
                if _described(item, known) not in described:
                    yield f"'{step.name}' is not judged by {type(item).__name__}, which was asked"
            if apart is not None and not any(_as_far(item, apart) for item in kept):
                yield f"'{step.name}' is not judged by the clearance that was asked for"

    def to_dict(self) -> dict[str, Any]:
        """Return it as JSON-safe values; FileFormatError for what no file can carry."""
        return {
            "seams": [_seam_to_dict(seam) for seam in self.seams],
            "in_order": self.in_order,
            "start": None if self.start is None else self.start.tolist(),
            "end": None if self.end is None else self.end.tolist(),
            "constraints": [item.to_dict() for item in self.constraints],
            "clearance": None if self.clearance is None else self.clearance.to_dict(),
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any], robot: RobotModel) -> "Specification":
        """Return what `to_dict` described."""
        ends = (values[end] for end in ("start", "end"))
        start, end = (None if q is None else robot.configuration(q) for q in ends)
        apart = values["clearance"]
        return cls(
            tuple(_seam_from_dict(item, robot) for item in values["seams"]),
            bool(values["in_order"]),
            start,
            end,
            tuple(restore(Constraint, item) for item in values["constraints"]),
            None if apart is None else restore(Constraint, apart),
        )


def _seam(step: Step, plan: Plan, seam: Seam) -> Iterator[str]:
    """Yield where a seam's step is not what was asked for."""
    if step.turned and not seam.either_way:
        yield f"seam '{seam.name}' is made from its end to its start"
    problem, what = plan.problem, ""
    known: dict[int, str] = {}
    described = {_described(item, known) for item in problem.constraints}
    if problem.task is not Task.of(seam.task):
        what = f"its task is '{problem.task.value}', not '{Task.of(seam.task).value}'"
    elif not _same_path(problem.path, seam.path, step.turned):
        what = "it is along another path"
    elif not _same_bands(problem.relaxations, seam, step.turned):
        what = "other rows are relaxed"
    elif any(_described(item, known) not in described for item in seam.constraints):
        what = "it is not judged by all constraints of the seam"
    elif tuple(step.events) != tuple(seam.events):
        what = "its events are others"
    elif [item.to_dict() for item in step.leaves] != [item.to_dict() for item in seam.leaves]:
        what = "it leaves something else"
    elif not set(step.may_meet) <= set(seam.may_meet):
        what = "it may meet more"
    if what:
        yield f"seam '{seam.name}' is not what was asked for: {what}"


def _moves(steps: Sequence[Step], seams: Mapping[str, Seam]) -> Iterator[str]:
    """Yield moves and waits between seams that have other names, or may meet more, than these."""
    before = JOB_START
    for number, step in enumerate(steps):
        if step.is_seam:
            before = step.name
            continue
        after = next((each.name for each in steps[number:] if each.is_seam), JOB_END)
        if step.name not in (f"{before} → {after}", f"{before}, wait"):
            yield f"'{step.name}' is between '{before}' and '{after}'"
        if number and step.name == steps[number - 1].name:
            yield f"'{step.name}' is there twice"
        may = {name for side in (before, after) if side in seams for name in seams[side].may_meet}
        if not set(step.may_meet) <= may:
            yield f"'{step.name}' may meet more than the seams beside it"


def _wait(step: Step, following: Step | None, seconds: float) -> Iterator[str]:
    """Yield that the arm does not rest as long after a seam as asked for."""
    rests = 0.0
    if following is not None and not following.is_seam and not following.is_missing:
        motion = following.motion
        is_still = np.array_equal(motion.q, np.broadcast_to(motion.q[0], motion.q.shape))
        rests = motion.duration if is_still and not np.any(motion.extremes(1)[1]) else 0.0
    if rests < seconds - _ROUNDING:
        yield f"after seam '{step.name}' the arm rests {rests:.6g} s, not {seconds:.6g} s"


def _same_path(made: Path, asked: Path, turned: bool) -> bool:
    """Whether a path is another one, the other way round where it is turned."""
    if not abs(made.duration - asked.duration) <= _ROUNDING:
        return False
    t = _SHARES * asked.duration
    for time in t.tolist():
        one = made.pose(time).homogeneous
        other = asked.pose(asked.duration - time if turned else time).homogeneous
        if not np.abs(one - other).max() <= _SAME:
            return False
    return True


def _same_bands(made: Sequence[Relaxation], seam: Seam, turned: bool) -> bool:
    """Whether the rows of a seam are relaxed as asked, the other way round where it is turned."""
    if len(made) != len(seam.relaxations):
        return False
    for one, other in zip(made, seam.relaxations, strict=True):
        values, wanted = one.to_dict(), other.to_dict()
        during, asked = values.pop("during"), wanted.pop("during")
        if values != wanted or (during is None) != (asked is None):
            return False
        if asked is not None:
            last = seam.path.duration
            asked = [last - asked[1], last - asked[0]] if turned else asked
            if not np.allclose(during, asked, rtol=0.0, atol=_ROUNDING):
                return False
    return True


def _as_far(item: Constraint, apart: Clearance) -> bool:
    """Whether a constraint keeps all that another clearance does, of the same obstacles."""
    return (
        isinstance(item, Clearance)
        and item.distance >= apart.distance
        and set(item.disabled) <= set(apart.disabled)
    )


def _described(item: Saved, known: dict[int, str]) -> str:
    """Return what tells constraints apart: their description, or which one it is without any."""
    if id(item) not in known:
        try:
            known[id(item)] = json.dumps(item.to_dict(), sort_keys=True)
        except (SelfmotionError, TypeError):
            known[id(item)] = f"{id(item)}"
    return known[id(item)]


def _seam_to_dict(seam: Seam) -> dict[str, Any]:
    return {
        "name": seam.name,
        "path": seam.path.to_dict(),
        "task": Task.of(seam.task).value,
        "relaxations": [
            {key: value for key, value in item.to_dict().items() if value != float("inf")}
            for item in seam.relaxations
        ],
        "costs": None if seam.costs is None else [cost.to_dict() for cost in seam.costs],
        "constraints": [item.to_dict() for item in seam.constraints],
        "either_way": seam.either_way,
        "after": list(seam.after),
        "after_any": list(seam.after_any),
        "wait": seam.wait,
        "events": [list(event) for event in seam.events],
        "leaves": [item.to_dict() for item in seam.leaves],
        "may_meet": list(seam.may_meet),
    }


def _seam_from_dict(values: Mapping[str, Any], robot: RobotModel) -> Seam:
    plain = {field.name: values[field.name] for field in fields(Seam)}
    costs = plain["costs"]
    made = {
        "path": restore(Path, values["path"]),
        "relaxations": [Relaxation(**item) for item in values["relaxations"]],
        "costs": None if costs is None else [cost_from_dict(item, robot) for item in costs],
        "constraints": [restore(Constraint, item) for item in values["constraints"]],
        "leaves": [obstacle_from_dict(item) for item in values["leaves"]],
    }
    return Seam(**{**plain, **made})
