"""The specification of a job, by which its program is judged."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np

from selfmotion.basics import Array, restore
from selfmotion.certificate import USUAL, Tolerance
from selfmotion.model.collision import Obstacle, obstacle_from_dict
from selfmotion.model.path import Path, Reversed
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import Relaxation, Task
from selfmotion.planning.result import (
    CheckedMotion,
    MotionSpecification,
    Plan,
    arm_digest,
    end_position_faults,
    missing_constraints,
)
from selfmotion.problem.constraints import Clearance, Constraint, as_clearances
from selfmotion.problem.costs import cost_from_dict
from selfmotion.work.job.seam import JOB_END, JOB_START, Seam, one_way, reversing
from selfmotion.work.job.step import Step

# Times are the same up to rounding [s].
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Specification:
    """The specification of a job.

    Attributes
    ----------
    seams : tuple of Seam
    in_order : bool
        Whether in the order of `seams`.
    start, end : (n,) or None
        Where the program begins and ends; None for anywhere.
    constraints : tuple of Constraint
        Of all seams and moves.
    clearances : tuple of Clearance
        What seams leave behind is kept clear of as the first one says.
    tolerance : Tolerance
        Largest deviation of each seam from its path.
    arm : str
        Digest of the arm with its tool, reference and limits (`arm_digest`); "" for any arm.
    """

    seams: tuple[Seam, ...]
    in_order: bool = False
    start: Array | None = None
    end: Array | None = None
    constraints: tuple[Constraint, ...] = ()
    clearances: tuple[Clearance, ...] = ()
    tolerance: Tolerance = USUAL
    arm: str = ""

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """The obstacles that are there from the start."""
        bodies = {body.name: body for item in self.clearances for body in item.obstacles}
        return tuple(bodies.values())

    def failures(
        self, robot: RobotModel, steps: Sequence[Step], missing: Mapping[str, str]
    ) -> Iterator[str]:
        """Yield where steps differ from it, except for seams that are known to be missing."""
        if self.arm and self.arm != arm_digest(robot):
            yield (
                f"arm '{robot.name}' with tool '{robot.tool}' is not what was asked for, or has "
                f"another reference, other limits or locked joints"
            )
        seams = {seam.name: seam for seam in self.seams}
        made = [step.name for step in steps if step.is_seam]
        for name in dict.fromkeys(made):
            if name not in seams:
                yield f"there is an extra seam '{name}'"
            elif made.count(name) > 1:
                yield f"seam '{name}' is made {made.count(name)} times"
        if not seams.keys() >= set(made):
            return
        for name in seams:
            if name not in made and name not in missing:
                yield f"seam '{name}' was asked for, and is neither made nor said to be missing"
        yield from self._order(made, seams)
        yield from self._ends(robot, steps)
        yield from _moves(steps, seams)
        for number, step in enumerate(steps):
            if isinstance(step.made, Plan):
                yield from self._seam(robot, step, step.made)
                following = steps[number + 1] if number + 1 < len(steps) else None
                yield from _wait(step, following, seams[step.name].wait)
        yield from self._constraints(robot, steps)

    def _order(self, made: Sequence[str], seams: Mapping[str, Seam]) -> Iterator[str]:
        if self.in_order and made != [name for name in seams if name in made]:
            yield "the seams are not in the order that was asked for"
        for number, name in enumerate(made):
            before, seam = set(made[:number]), seams[name]
            late = [other for other in seam.after if other not in before]
            if late:
                yield f"seam '{name}' is made before '{late[0]}', after which it has to come"
            if seam.after_any and before.isdisjoint(seam.after_any):
                yield f"seam '{name}' is made before any of those that support it"

    def _ends(self, robot: RobotModel, steps: Sequence[Step]) -> Iterator[str]:
        """Yield faults of the start and the end, without those of moves that were not found."""
        for q, at in ((self.start, 0), (self.end, -1)):
            motion = CheckedMotion.of("it", steps[at].made) if steps and q is not None else None
            if motion is not None and q is not None:
                yield from end_position_faults(robot, motion, at, q)

    def _seam(self, robot: RobotModel, step: Step, plan: Plan) -> Iterator[str]:
        """Yield where a seam's step is not what was asked for."""
        seam = next(item for item in self.seams if item.name == step.name)
        if step.turned and not seam.either_way:
            yield f"seam '{seam.name}' is made from its end to its start"
        constraints = [item for item in seam.constraints if item.applies(robot)]
        turned = (item.moved(reversing(seam.path.duration)) for item in seam.relaxations)
        specification = MotionSpecification(
            robot,
            Reversed(seam.path) if step.turned else seam.path,
            Task.of(seam.task),
            [item for item in turned if item] if step.turned else seam.relaxations,
            constraints,
            tolerance=self.tolerance,
        )
        others = [
            (tuple(step.events) == tuple(seam.events), "its events are others"),
            (_bodies(step.leaves) == _bodies(seam.leaves), "it leaves something else"),
            (set(step.may_meet) <= set(seam.may_meet), "it may meet more"),
        ]
        for text in (*specification.failures(plan), *(text for same, text in others if not same)):
            yield f"seam '{seam.name}' is not what was asked for: {text}"

    def _constraints(self, robot: RobotModel, steps: Sequence[Step]) -> Iterator[str]:
        """Yield steps that are not judged by all constraints of the job."""
        wanted = [item for item in self.constraints if item.applies(robot) and not one_way(item)]
        has_bodies = robot.urdf.has_collisions or bool(self.obstacles)
        clearances = self.clearances if has_bodies else ()
        for step in steps:
            for text in missing_constraints(step.constraints, wanted, clearances):
                yield f"'{step.name}': {text}"

    def to_dict(self) -> dict[str, Any]:
        """Return JSON-safe values; FileFormatError for values that no file can carry."""
        clear = [item.to_dict() for item in self.clearances]
        return {
            "seams": [_seam_to_dict(seam) for seam in self.seams],
            "in_order": self.in_order,
            "start": None if self.start is None else self.start.tolist(),
            "end": None if self.end is None else self.end.tolist(),
            "constraints": [item.to_dict() for item in self.constraints],
            "clearance": clear if len(clear) > 1 else (*clear, None)[0],
            "tolerance": asdict(self.tolerance),
            "arm": self.arm,
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any], robot: RobotModel) -> Specification:
        """Return the specification that `to_dict` described."""
        ends = (values[end] for end in ("start", "end"))
        start, end = (None if q is None else robot.configuration(q) for q in ends)
        # One alone is a table, none is null.
        given = values["clearance"]
        clear = given if isinstance(given, list) else [] if given is None else [given]
        return cls(
            tuple(_seam_from_dict(item, robot) for item in values["seams"]),
            bool(values["in_order"]),
            start,
            end,
            tuple(restore(Constraint, item) for item in values["constraints"]),
            as_clearances([restore(Constraint, item) for item in clear]),
            # Files of earlier versions have none: then it is the usual one.
            Tolerance(**values.get("tolerance", {})),
            str(values.get("arm", "")),
        )


def _bodies(several: Sequence[Obstacle]) -> list[dict[str, Any]]:
    return [item.to_dict() for item in several]


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
        added = [*(event for event, _ in step.events), *(item.name for item in step.leaves)]
        if added:
            yield f"'{step.name}' has '{added[0]}', which was not asked of a move or a wait"
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
    # A move may begin and end in one place; a wait is as long as asked for, or not there.
    is_wait = following is not None and following.name == f"{step.name}, wait"
    if rests < seconds - _ROUNDING or (is_wait and not 0.0 < rests <= seconds + _ROUNDING):
        yield f"after seam '{step.name}' the arm rests {rests:.6g} s, not {seconds:.6g} s"


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
