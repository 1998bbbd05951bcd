"""Problems at another place: the part, or the arm, stands elsewhere."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
import pinocchio as pin

from selfmotion.basics import (
    Array,
    InverseKinematicsError,
    PlanError,
    ProblemError,
    SelfmotionError,
    nearest,
    presses,
    seconds_of_kernels,
)
from selfmotion.model.collision import Obstacle, Solid
from selfmotion.model.follow import BoundTaskFrame
from selfmotion.model.path import Path, Placed, spread_along
from selfmotion.model.robot import root_place, with_moved_base
from selfmotion.model.task import SE3
from selfmotion.planning.optimise import Iteration, Status
from selfmotion.planning.planner import Search, plan
from selfmotion.planning.result import Plan
from selfmotion.problem.constraints import Clearance
from selfmotion.problem.problem import Problem, problem_from_dict, start_on_path

# Search at a place with a known motion near by.
_NEAR = Search(1, 1, "local")
# Search at other places: among many, a quick 'no' is worth more than the last start.
_QUICK = Search(16, 2, "local")
# Time limit of a place near known motions, most of which take a tenth of it [s of the processor, so
# that a busy machine finds the same].
_PATIENCE_NEAR = 0.3
# Time limit of other places [s of the processor].
_PATIENCE = 0.6
# Time limit before 'no plan' is reported [s of the processor].
_PATIENCE_SURE = 10.0
# Coordinates of a place: a shift [m] and roll, pitch and yaw [rad], as in URDFs.
COORDINATES = ("x", "y", "z", "roll", "pitch", "yaw")
# Poses of each path that have to be reached before a place is planned.
_POSES = 5
# Tries of inverse kinematics for each of them.
_TRIES = 20
# Points of a path in the outline of its part.
_OUTLINED = 41


@dataclass(frozen=True, eq=False)
class Tried:
    """The result at a place.

    Attributes
    ----------
    place : (d,)
        The coordinates that vary [m or rad].
    cost : float
        Of all plans together; inf where one is not verified.
    reason : str
        Why not; "" where all are.
    plans : tuple of Plan
        Empty where it was not planned, or in another process.
    """

    place: Array
    cost: float
    reason: str = ""
    plans: tuple[Plan, ...] = ()


@dataclass(frozen=True, eq=False)
class Places:
    """Problems whose part or base can be displaced.

    Attributes
    ----------
    problems : tuple of Problem
    of : str
        ``"part"`` or ``"base"``.
    bodies : frozenset of str
        The obstacles that belong to the part.
    center : (3,)
        What it is turned about, in world axes [m].
    names : tuple of str
        The coordinates that vary.
    """

    problems: tuple[Problem, ...]
    of: str
    bodies: frozenset[str]
    center: Array
    names: tuple[str, ...]

    def displacement(self, place: Array) -> SE3:
        """Return the rigid motion of part or base that a place (d,) stands for, in world axes."""
        values = dict(zip(self.names, np.asarray(place).tolist(), strict=True))
        shift = np.array([values.get(name, 0.0) for name in COORDINATES[:3]])
        turn = pin.rpy.rpyToMatrix(*(values.get(name, 0.0) for name in COORDINATES[3:]))
        return pin.SE3(turn, self.center + shift - turn @ self.center)

    def at(self, place: Array) -> list[Problem]:
        """Return the problems at a place, the part or the arm's base moved: with free starts.

        Where the base moves, moving all else instead would not do: directions of the world, such as
        that of gravity or of a `Tilt`, stay.
        """
        by = self.displacement(place)
        if self.of == "part":
            return [self._moved(problem, by) for problem in self.problems]
        return [
            problem.changed(robot=with_moved_base(problem.robot, by), start="free")
            for problem in self.problems
        ]

    def tried(self, place: Array, near: Sequence[Plan] = (), thorough: bool = False) -> Tried:
        """Plan at a place; from plans of one `near`, where they are given.

        With a full search if `thorough`; among many places a quick 'no' is enough.
        """

        def planned(k: int, problem: Problem) -> Plan:
            if thorough:
                return _uninterrupted(plan(problem))
            if near:
                return _quickly(problem, near[k], _NEAR, _PATIENCE_NEAR)
            _check_reach(problem)
            return _quickly(problem, None, _QUICK, _PATIENCE)

        return self._each(place, planned)

    def surely(self, place: Array) -> Tried:
        """Plan at a place with all that a plan does, from nothing, for 10 s of the processor each.

        A place that fails here is reported as 'no plan'.
        """

        def planned(_: int, problem: Problem) -> Plan:
            return _quickly(problem, None, Search(), _PATIENCE_SURE)

        return self._each(place, planned)

    def corrected(self, place: Array, near: Sequence[Plan]) -> Tried:
        """Plan at a place from plans near by; a start that is given moves onto the path there."""

        def planned(k: int, problem: Problem) -> Plan:
            start = near[k].problem.given_start
            if start is None:
                return _quickly(problem, near[k], _NEAR, _PATIENCE)
            there = problem.changed(start=start_on_path(problem.follows, start))
            return _quickly(there, near[k], None, _PATIENCE)

        return self._each(place, planned)

    def _each(self, place: Array, planned: Callable[[int, Problem], Plan]) -> Tried:
        """Return the result of all problems at a place, each planned by a function."""
        plans: list[Plan] = []
        for k, problem in enumerate(self.at(place)):
            try:
                plan = planned(k, problem)
            except SelfmotionError as error:
                return Tried(place, np.inf, str(error))
            if not plan.certificate.verified:
                return Tried(place, np.inf, plan.certificate.verdict)
            plans.append(plan)
        return Tried(place, sum(plan.report.cost for plan in plans), "", tuple(plans))

    def _moved(self, problem: Problem, by: SE3) -> Problem:
        items = problem.follows.items
        also = tuple(
            item.along(_placed(bound, by)) if _stands(bound) else item
            for item, bound in zip(problem.also, items[1:], strict=True)
        )
        return problem.changed(
            path=_placed(items[0], by),
            also=also,
            start="free",
            clearance=[_with_bodies(item, self.bodies, by) for item in problem.clearances],
        )


def places_of(
    problems: Sequence[Problem],
    of: str,
    part: Sequence[str] | None,
    center: Array | None,
    names: tuple[str, ...],
) -> Places:
    """Return the bodies of problems that move along.

    Raises
    ------
    ProblemError
        A body does not exist or rides on the arm, it is not said which belong to the part, or a
        path is given in a frame that moves.
    """
    for problem in problems:
        if not _stands(problem.follows.items[0]):
            raise ProblemError(
                f"place: the path of {problem.robot.name} is given in the frame of "
                f"'{problem.robot.reference}', which moves; expected one fixed in the world"
            )
    standing = {
        body.name: body
        for problem in problems
        for item in problem.clearances
        for body in item.obstacles
        if body.frame is None
    }
    if of == "base":
        for problem in problems:
            _check_stays(problem)
    if of == "base" and part is not None:
        raise ProblemError("place: part says what belongs to the part, which stays where it is")
    if of == "part" and part is None and standing:
        raise ProblemError(
            f"place: which obstacles belong to the part and move along? Give part= their names, of "
            f"{', '.join(standing)}, or () for none"
        )
    for name in part or ():
        if name not in standing:
            raise ProblemError(
                f"place: part: no obstacle '{name}' is in the world{nearest(name, standing)}; "
                f"obstacles: {', '.join(standing) or 'none'}"
            )
    if center is None:
        center = root_place(problems[0].robot) if of == "base" else _middle(problems)
    return Places(tuple(problems), of, frozenset(part or ()), center, names)


def _check_stays(problem: Problem) -> None:
    """Raise ProblemError where a path moves along with the base of the arm."""
    moved = with_moved_base(problem.robot, pin.SE3(np.eye(3), np.ones(3)))
    there = problem.changed(robot=moved, start="free").follows.items
    for item, after in zip(problem.follows.items, there, strict=True):
        if _stands(item) and not item.chain.base_placement.isApprox(after.chain.base_placement):
            frame = item.chain.model.frames[item.chain.base].name
            raise ProblemError(
                f"place: a path of {problem.robot.name} is given in the frame of '{frame}', which "
                f"moves along with the base; expected one in the world"
            )


def described(places: Places, problems: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return places as JSON-safe values, given the problems as such; see `restored`."""
    return {
        "problems": list(problems),
        "of": places.of,
        "bodies": sorted(places.bodies),
        "center": places.center.tolist(),
        "names": list(places.names),
    }


def restored(values: Mapping[str, Any], arms: dict[str, Any]) -> Places:
    """Return the places that `described` described."""
    return Places(
        tuple(problem_from_dict(item, arms) for item in values["problems"]),
        values["of"],
        frozenset(values["bodies"]),
        np.array(values["center"]),
        tuple(values["names"]),
    )


def _uninterrupted(plan: Plan) -> Plan:
    """Return a plan; KeyboardInterrupt where Ctrl-C ended it."""
    if plan.report.status is Status.INTERRUPTED:
        raise KeyboardInterrupt
    return plan


def _quickly(problem: Problem, near: Plan | None, search: Search | None, patience: float) -> Plan:
    """Plan, from what is known if anything is, or give up soon.

    Raises
    ------
    PlanError
        Nothing was found in that time, or no motion passes.
    KeyboardInterrupt
        Ctrl-C was pressed, whatever was found by then.
    """
    began, pressed, given_up = time.process_time() - seconds_of_kernels(), presses(), False

    def is_over() -> bool:
        return time.process_time() - seconds_of_kernels() >= began + patience

    def over(_: Iteration) -> bool:
        return is_over()

    def told(stage: str, number: int, count: int) -> None:
        nonlocal given_up
        if not count:
            # No motion passes, and what comes before is not asked.
            raise PlanError(stage)
        if is_over():
            given_up = True
            raise KeyboardInterrupt

    try:
        planned = plan(problem, warm_start=near, search=search, callback=over, progress=told)
    except KeyboardInterrupt:
        if presses() > pressed or not given_up:
            raise
        raise PlanError(f"no motion was found in {patience:g} s, by the processor's time") from None
    return _uninterrupted(planned) if presses() > pressed or not given_up else planned


def _stands(item: BoundTaskFrame) -> bool:
    return item.chain.carrier < 0


def _placed(item: BoundTaskFrame, by: SE3) -> Path:
    """Return a path moved by a rigid motion in world axes."""
    frame = item.chain.base_placement
    return Placed(item.path, frame.inverse() * by * frame)


def _with_bodies(item: Clearance, names: frozenset[str], by: SE3) -> Clearance:
    """Return a clearance whose obstacles stand elsewhere, by name."""

    def moves(body: Obstacle) -> bool:
        return body.frame is None and body.name in names

    if not any(moves(body) for body in item.obstacles):
        # The same one: its bodies are known.
        return item
    bodies = tuple(
        replace(body, pose=by * body.pose) if moves(body) else body for body in item.obstacles
    )
    return replace(item, obstacles=bodies)


def footprint(problems: Sequence[Problem], bodies: frozenset[str]) -> Array:
    """Return the hull from above of paths and of the bodies of these names, (P, 2) [m]."""
    # Takes long to import, and is of the few who draw a map.
    from scipy.spatial import ConvexHull, QhullError

    points = []
    for problem in problems:
        frame = problem.follows.items[0].chain.base_placement
        path = problem.path.samples(spread_along(problem.path, _OUTLINED)).translation
        points.append((path @ frame.rotation.T + frame.translation)[:, :2])
        for body in (item for one in problem.requirements for item in one.obstacles):
            if body.name in bodies:
                solid = Solid(body.geometry(), body.label)
                corners = np.array(list(product(*zip(solid.low, solid.high, strict=True))))
                points.append((corners @ body.pose.rotation.T + body.pose.translation)[:, :2])
    every = np.concatenate(points)
    try:
        return np.asarray(every[ConvexHull(every).vertices])
    except QhullError:
        # A straight seam alone has no width.
        return every


def _middle(problems: Sequence[Problem]) -> Array:
    """Return the middle of the box around all paths (3,), in world axes."""
    middle = []
    for problem in problems:
        frame = problem.follows.items[0].chain.base_placement
        places = problem.path.samples(spread_along(problem.path, 101)).translation
        middle.append(places @ frame.rotation.T + frame.translation)
    points = np.concatenate(middle)
    return np.asarray(0.5 * (points.min(axis=0) + points.max(axis=0)))


def _check_reach(problem: Problem) -> None:
    """Raise InverseKinematicsError where a pose of the path is out of reach by a quick look.

    Where something is relaxed, or follows in other frames, planning itself has to tell.
    """
    robot, item = problem.robot, problem.follows.items[0]
    if problem.relaxations or not robot.chain.is_rooted:
        return
    seed: Array | None = None
    for t in spread_along(problem.path, _POSES).tolist():
        try:
            pose = item.path.pose(t)
            seed = robot.inverse_kinematics(pose, problem.task, seed, attempts=_TRIES)
        except InverseKinematicsError as error:
            raise InverseKinematicsError(
                f"out of reach at t = {t:.4g} s: {error}",
                position_miss=error.position_miss,
                rotation_miss=error.rotation_miss,
            ) from error
