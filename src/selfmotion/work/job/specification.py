"""The specification of a job, by which its program is judged."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from selfmotion.basics import Array, restore
from selfmotion.certificate import USUAL, Tolerance
from selfmotion.model.collision import Obstacle
from selfmotion.model.path import Reversed
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import Task
from selfmotion.planning.result import (
    CheckedMotion,
    MotionSpecification,
    Plan,
    arm_digest,
    end_position_faults,
    missing_constraints,
)
from selfmotion.problem.constraints import Clearance, Constraint, as_clearances
from selfmotion.work.job.saved_seams import seam_from_dict, seam_to_dict
from selfmotion.work.job.seam import JOB_END, JOB_START, Seam, one_way, reversing
from selfmotion.work.job.step import Step

# Times are the same up to rounding [s].
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Specification:
    """The specification of a job: what is asked for, whatever its program became.

    Attributes
    ----------
    seams : tuple of Seam
    in_order : bool
        Whether the program has the seams in this order.
    start, end : (n,) or None
        Where the program begins and ends; None for anywhere.
    constraints : tuple of Constraint
        Of all seams and moves.
    clearances : tuple of Clearance
        Of all seams and moves; obstacles that seams leave behind are avoided as by the first one.
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
        names = [step.name for step in steps if step.is_seam]
        for name in dict.fromkeys(names):
            if name not in seams:
                yield f"there is an extra seam '{name}'"
            elif names.count(name) > 1:
                yield f"seam '{name}' is made {names.count(name)} times"
        if not seams.keys() >= set(names):
            return
        for name in seams:
            if name not in names and name not in missing:
                yield f"seam '{name}' was asked for, and is neither made nor said to be missing"
        yield from self._order_failures(names, seams)
        yield from self._end_failures(robot, steps)
        yield from _move_failures(steps, seams)
        for number, step in enumerate(steps):
            if isinstance(step.made, Plan):
                yield from self._seam_failures(robot, step, step.made, seams[step.name])
                following = steps[number + 1] if number + 1 < len(steps) else None
                yield from _wait_failures(step, following, seams[step.name].wait)
        yield from self._constraint_failures(robot, steps)

    def to_dict(self) -> dict[str, Any]:
        """Return JSON-safe values; FileFormatError for values that no file can carry."""
        clearances = [item.to_dict() for item in self.clearances]
        return {
            "seams": [seam_to_dict(seam) for seam in self.seams],
            "in_order": self.in_order,
            "start": None if self.start is None else self.start.tolist(),
            "end": None if self.end is None else self.end.tolist(),
            "constraints": [item.to_dict() for item in self.constraints],
            "clearance": clearances if len(clearances) > 1 else (*clearances, None)[0],
            "tolerance": asdict(self.tolerance),
            "arm": self.arm,
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any], robot: RobotModel) -> Specification:
        """Return the specification that `to_dict` described."""
        ends = (values[end] for end in ("start", "end"))
        start, end = (None if q is None else robot.configuration(q) for q in ends)
        # A single clearance is written as a table, none as null.
        written = values["clearance"]
        clearances = written if isinstance(written, list) else [] if written is None else [written]
        return cls(
            tuple(seam_from_dict(item, robot) for item in values["seams"]),
            bool(values["in_order"]),
            start,
            end,
            tuple(restore(Constraint, item) for item in values["constraints"]),
            as_clearances([restore(Constraint, item) for item in clearances]),
            # Without one in the file it is the usual one.
            Tolerance(**values.get("tolerance", {})),
            str(values.get("arm", "")),
        )

    def _order_failures(self, names: Sequence[str], seams: Mapping[str, Seam]) -> Iterator[str]:
        """Yield where the seams of a program, by their names, come in another order."""
        if self.in_order and names != [name for name in seams if name in names]:
            yield "the seams are not in the order that was asked for"
        for number, name in enumerate(names):
            before, seam = set(names[:number]), seams[name]
            late = [other for other in seam.after if other not in before]
            if late:
                yield f"seam '{name}' is made before '{late[0]}', after which it has to come"
            if seam.after_any and before.isdisjoint(seam.after_any):
                yield f"seam '{name}' is made before any of those that support it"

    def _end_failures(self, robot: RobotModel, steps: Sequence[Step]) -> Iterator[str]:
        """Yield where the program does not begin or end as asked for, if such motions are found."""
        for q, index in ((self.start, 0), (self.end, -1)):
            if q is None or not steps:
                continue
            motion = CheckedMotion.of("it", steps[index].made)
            if motion is not None:
                yield from end_position_faults(robot, motion, index, q)

    def _seam_failures(
        self, robot: RobotModel, step: Step, plan: Plan, seam: Seam
    ) -> Iterator[str]:
        """Yield where the step of a seam is not what was asked for."""
        if step.turned and not seam.either_way:
            yield f"seam '{seam.name}' is made from its end to its start"
        constraints = [item for item in seam.constraints if item.applies(robot)]
        reversed_relaxations = (
            item.moved(reversing(seam.path.duration)) for item in seam.relaxations
        )
        specification = MotionSpecification(
            robot,
            Reversed(seam.path) if step.turned else seam.path,
            Task.of(seam.task),
            [item for item in reversed_relaxations if item] if step.turned else seam.relaxations,
            constraints,
            tolerance=self.tolerance,
        )
        has_same_leaves = _descriptions(step.leaves) == _descriptions(seam.leaves)
        comparisons = [
            (tuple(step.events) == tuple(seam.events), "its events are others"),
            (has_same_leaves, "it leaves something else"),
            (set(step.may_meet) <= set(seam.may_meet), "it may meet more"),
        ]
        differences = (text for is_same, text in comparisons if not is_same)
        for text in (*specification.failures(plan), *differences):
            yield f"seam '{seam.name}' is not what was asked for: {text}"

    def _constraint_failures(self, robot: RobotModel, steps: Sequence[Step]) -> Iterator[str]:
        """Yield steps that are not judged by all constraints of the job."""
        wanted = [item for item in self.constraints if item.applies(robot) and not one_way(item)]
        has_bodies = robot.urdf.has_collisions or bool(self.obstacles)
        clearances = self.clearances if has_bodies else ()
        for step in steps:
            for text in missing_constraints(step.constraints, wanted, clearances):
                yield f"'{step.name}': {text}"


def _move_failures(steps: Sequence[Step], seams: Mapping[str, Seam]) -> Iterator[str]:
    """Yield moves and waits that are not named by the seams beside them, or may meet more."""
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
        additions = [*(event for event, _ in step.events), *(item.name for item in step.leaves)]
        if additions:
            yield f"'{step.name}' has '{additions[0]}', which was not asked of a move or a wait"
        neighbours = [seams[name] for name in (before, after) if name in seams]
        if not set(step.may_meet) <= {name for seam in neighbours for name in seam.may_meet}:
            yield f"'{step.name}' may meet more than the seams beside it"


def _wait_failures(step: Step, following: Step | None, wait: float) -> Iterator[str]:
    """Yield that the arm does not rest as long after a seam as asked for [s]."""
    rest = 0.0
    if following is not None and not following.is_seam and not following.is_missing:
        motion = following.motion
        is_still = np.array_equal(motion.q, np.broadcast_to(motion.q[0], motion.q.shape))
        rest = motion.duration if is_still and not np.any(motion.extremes(1)[1]) else 0.0
    # A move may begin and end in one place; a wait is as long as asked for, or not there.
    is_wait = following is not None and following.name == f"{step.name}, wait"
    if rest < wait - _ROUNDING or (is_wait and not 0.0 < rest <= wait + _ROUNDING):
        yield f"after seam '{step.name}' the arm rests {rest:.6g} s, not {wait:.6g} s"


def _descriptions(obstacles: Sequence[Obstacle]) -> list[dict[str, Any]]:
    """Return the JSON-safe values of obstacles, by which they are compared."""
    return [item.to_dict() for item in obstacles]
