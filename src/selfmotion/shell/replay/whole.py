"""Facts of plans as a page shows them: of one, of programs, parts and moves."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from typing_extensions import override

from selfmotion.basics import Array, ProblemError
from selfmotion.certificate import Certificate, Extreme, Tolerance
from selfmotion.model.collision import Obstacle
from selfmotion.model.motion import Trajectory
from selfmotion.model.path import Path, PathSamples
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import Task
from selfmotion.planning.optimise import Status
from selfmotion.planning.result import Move, Parts, Plan, Report
from selfmotion.problem.constraints import NO_OVERLAP, Constraint, clearances_among
from selfmotion.problem.problem import Problem
from selfmotion.shell.replay import scene, three
from selfmotion.shell.replay.meshes import Json, Payload
from selfmotion.shell.replay.motion import Curves
from selfmotion.work.job import Program

# A plan's report and certificate as the rows of a table.

# A number and a remark, shown smaller after it.
Cell = tuple[str, str]

# Costs that differ by less than this share are shown alike.
_ALIKE = 5e-4


def facts(plan: Plan) -> dict[str, Cell]:
    """Return what a reader wants to know of a plan: label → number and remark."""
    report, certificate = plan.report, plan.certificate
    if not certificate.findings:
        # An arm that stands, for a page without a motion.
        return {"verdict": (certificate.verdict, "")}
    rows: dict[str, Cell] = {"verdict": (certificate.verdict, "")}
    rows["cost"] = _compared(report.cost, report.initial_cost)
    if report.remaining is not None and certificate.verified:
        rows["further saving possible, estimate"] = (f"{report.remaining:.2g}", _share(report))
    for name, value in report.terms.items():
        rows[f"cost term: {name}"] = _compared(value, report.initial_terms.get(name))
    rows["position error, worst"] = _extreme(certificate.position_error, "m")
    rows["rotation error, worst"] = _extreme(certificate.rotation_error, "rad")
    follows = plan.problem.follows
    for bound, (position, rotation) in zip(follows.items[1:], certificate.others, strict=True):
        tip = bound.chain.tip_name
        rows[f"position error of {tip}, worst"] = _extreme(position, "m")
        rows[f"rotation error of {tip}, worst"] = _extreme(rotation, "rad")
    for worst in certificate.deviations:
        unit = "rad" if "r" in worst.name else "m"
        rows[f"off the path, as relaxed {worst.name}"] = (
            f"{worst.value:.3g} {unit}",
            f"at {worst.time:.3g} s",
        )
    nearest, robot = certificate.limit_margin, plan.robot
    unit = robot.unit_of(*({nearest.name} & set(robot.joint_names)))
    rows["margin to a joint limit, least"] = _extreme(nearest, unit)
    fastest = certificate.velocity_ratio
    rows["speed, most"] = _extreme(replace(fastest, value=100.0 * fastest.value), "% of its limit")
    used, *which = str(plan.limits_used).split(": ", 1)
    rows["limits used fully"] = (used, "".join(which))
    turns, *which = str(plan.reversals).split(" ", 1)
    rows["joint reversals"] = (turns, "".join(which).strip("()"))
    for name, near in plan.approaches.items():
        rows[f"closest to {name}"] = _extreme(replace(near, value=1e3 * near.value), "mm")
    rows["smallest singular value"] = _extreme(certificate.smallest_singular_value, "")
    rows["joint distance, end to start"] = (f"{certificate.closure:.3g} {robot.unit_of()}", "")
    rows["checked at"] = (f"{certificate.samples} times", "by forward kinematics")
    rows["duration"] = (f"{plan.trajectory.duration:.4g} s", "")
    tasks = " and ".join(item.task.value for item in follows.items)
    rows["task"] = (tasks, f"{follows.dimension} rows, {plan.robot.dof} joints")
    rows["outcome"] = (str(report.status.value), report.message)
    rows["iterations"] = (str(report.iterations), f"in {report.seconds:.3g} s")
    rows["evaluations"] = (
        f"{report.evaluations} of F, {report.gradient_evaluations} of ∇F",
        f"{report.jacobian_evaluations} Jacobians, {report.steps} steps",
    )
    return rows


def table(plans: list[Plan]) -> list[dict[str, Any]]:
    """Return the rows for several plans side by side; a plan without a row gets an empty cell."""
    columns = [facts(plan) for plan in plans]
    labels = list(dict.fromkeys(label for column in columns for label in column))
    return [
        {"label": label, "cells": [column.get(label, ("", "")) for column in columns]}
        for label in labels
    ]


def describe(plan: Plan) -> str:
    """Return one sentence that tells a stranger what the page shows."""
    report = plan.report
    if not plan.certificate.findings:
        # There is no motion to describe.
        return plan.certificate.verdict
    saved = ""
    if report.initial_cost:
        change = report.cost / report.initial_cost - 1.0
        saved = ", that of the minimum-norm motion"
        if abs(change) >= _ALIKE:
            side = "below" if change <= 0 else "above"
            saved = f", {abs(100 * change):.1f} % {side} that of the minimum-norm motion"
        if change > 5e-4 and plan.problem.all_constraints:
            saved += ", which ignores the constraints"
    items = plan.problem.follows.items
    what = "a tool motion" if len(items) == 1 else f"{len(items)} tool motions"
    tasks = " and ".join(f"'{item.task.value}'" for item in items)
    return (
        f"{plan.robot.name}: {plan.robot.dof} joints follow {what} of "
        f"{plan.trajectory.duration:.3g} s (task {tasks}) at cost {report.cost:.4g}"
        f"{saved}. {plan.certificate.verdict}"
    )


def _share(report: Report) -> str:
    left = report.remaining
    if not left or not report.cost:
        return ""
    return f"{100 * left / abs(report.cost):.2g} % with any null motion"


def _compared(value: float, start: float | None) -> Cell:
    return f"{value:.6g}", "" if start is None else f"minimum-norm: {start:.6g}"


def _extreme(extreme: Extreme, unit: str) -> Cell:
    number = f"{extreme.value:.3g} {unit}".strip()
    where = f"{extreme.name}, " if extreme.name else ""
    return number, f"{where}at {extreme.time:.3g} s"


# What is more than one plan, as a page shows it: programs, parts, moves.

# Points of curves for each step that is not brief [s], at least, and in all; more nobody sees.
_POINTS, _BRIEF, _MOST_POINTS = 25, 0.5, 6001
# Colours of seams, by turns: those of the page's plots.
_COLORS = ((66, 105, 208), (232, 135, 30), (60, 169, 81), (224, 80, 140), (164, 99, 242))
_MOVE = (138, 145, 156)


def seam_color(number: int) -> str:
    """Return the colour of a seam by its place in the order, for CSS and SVG."""
    return "rgb({}, {}, {})".format(*_COLORS[number % len(_COLORS)])


# Steps that are told to take longest.
_LONGEST = 3


# Of what happens on the way: the same in the scene, the plots and the list of steps.
_EVENT = (194, 24, 91)


@dataclass(frozen=True)
class Mark:
    """A step of a whole: when it begins and ends [s], what it is called, and if it is a seam."""

    begin: float
    end: float
    name: str
    is_seam: bool


@dataclass(frozen=True, eq=False)
class Whole:
    """A motion of several steps.

    Attributes
    ----------
    plan : Plan
        Stands for it: its motion, along the path that the tool goes.
    marks : tuple of Mark
    verdict : str
    verified : bool
    events : tuple of (float, str)
        What happens on the way, and when [s].
    obstacles : tuple of Obstacle
        All that stands there in the end.
    grows : bool
        Whether some of it stands there only later, so that one distance tells nothing.
    plans : tuple of (float, str, Plan)
        When each seam begins [s], its name and its plan; empty where these are not shown.
    """

    plan: Plan
    marks: tuple[Mark, ...]
    verdict: str
    verified: bool
    events: tuple[tuple[float, str], ...]
    obstacles: tuple[Obstacle, ...]
    grows: bool
    plans: tuple[tuple[float, str, Plan], ...] = ()

    @classmethod
    def of(cls, planned: Program | Parts | Move) -> "Whole":
        """Return what a page shows of several steps; PlanError where a move is missing."""
        motion = planned.motion if isinstance(planned, Move) else planned.trajectory
        marks = tuple(_marks(planned))
        events: tuple[tuple[float, str], ...] = ()
        grows = False
        if isinstance(planned, Program):
            events = tuple((at, f"{name}: {event}") for at, name, event in planned.events)
            grows = any(step.leaves for step in planned.steps)
            first = planned.steps[0].made
            constraints = tuple(first.constraints) if isinstance(first, Move) else ()
            known = list(planned.obstacles)
        elif isinstance(planned, Parts):
            constraints, known = planned.problem.all_constraints, list(planned.plans[0].obstacles)
        else:
            constraints, known = planned.constraints, list(planned.obstacles)
        unique = {item.name: item for item in known}
        plan = stand_in(planned.robot, motion, constraints)
        standing = tuple(unique.values())
        plans = tuple(_plans(planned))
        return cls(plan, marks, planned.verdict, planned.verified, events, standing, grows, plans)

    @property
    def points(self) -> int:
        """How many points its curves need."""
        shortest = max(min(mark.end - mark.begin for mark in self.marks), _BRIEF)
        wanted = int(_POINTS * self.marks[-1].end / shortest)
        return min(max(401, wanted), _MOST_POINTS)

    @property
    def description(self) -> str:
        """One sentence that tells a stranger what the page shows."""
        seams = sum(mark.is_seam for mark in self.marks)
        return (
            f"{self.plan.robot.name}: {seams} seams and {len(self.marks) - seams} moves in "
            f"{self.marks[-1].end:.4g} s. {self.verdict}"
        )

    @property
    def facts(self) -> dict[str, Cell]:
        """What a reader wants to know of it: label → number and remark."""
        between = [mark for mark in self.marks if not mark.is_seam]
        longest = sorted(between, key=lambda mark: mark.begin - mark.end)[:_LONGEST]
        told = ", ".join(f"{mark.name} {mark.end - mark.begin:.2f} s" for mark in longest)
        moved = sum(mark.end - mark.begin for mark in between)
        return {
            "verdict": (self.verdict, ""),
            "duration": (f"{self.marks[-1].end:.4g} s", ""),
            "seams": (str(len(self.marks) - len(between)), ""),
            "moves": (f"{moved:.4g} s", f"longest: {told}" if told else ""),
        }

    def commands(
        self,
        root: str,
        moves: str,
        payload: Payload,
        shown: Curves,
        radii: tuple[float, float],
    ) -> list[Json]:
        """Return the commands that draw each seam in a colour of its own, and moves thinly.

        Seams are below the node `root` of what carries them; moves, which nothing does, in the
        world, below another one.
        """
        radius, thin = radii
        found, seams, in_world = list[Json](), 0, shown.tool_in_world
        for number, mark in enumerate(self.marks):
            within = (shown.t >= mark.begin) & (shown.t <= mark.end)
            points = (shown.tool if mark.is_seam else in_world)[within]
            kept = three.distinct(points, 0.5 * radius)
            if len(kept) > 1:
                wide = 1.5 * radius if mark.is_seam else thin
                drawn = scene.triangles(payload, *three.tube(points[kept], wide))
                node = f"{root}/trace/seam{seams}" if mark.is_seam else f"{moves}/trace/{number}"
                color = _COLORS[seams % len(_COLORS)] if mark.is_seam else _MOVE
                look = three.material([part / 255.0 for part in color], roughness=0.8)
                found.append(three.set_object(node, drawn, look))
            seams += mark.is_seam
        return [*found, *self._beads(root, payload, shown, radius)]

    def _beads(self, root: str, payload: Payload, shown: Curves, radius: float) -> list[Json]:
        """Return the commands for a bead where the tool is at each event."""
        look = three.material([part / 255.0 for part in _EVENT], roughness=0.8)
        found = []
        for number, (at, _) in enumerate(self.events):
            place = np.array([[np.interp(at, shown.t, axis) for axis in shown.tool.T]])
            drawn = scene.triangles(payload, *three.beads(place, 3.0 * radius))
            found.append(three.set_object(f"{root}/trace/event{number}", drawn, look))
        return found

    def seams(self) -> list[tuple[float, float, str]]:
        """Return when each seam begins and ends [s], and its colour."""
        return [(s["begin"], s["end"], s["color"]) for s in self.steps() if s["color"]]

    def happenings(self) -> list[Json]:
        """Return the events for the page, in the order of time."""
        color = "rgb({}, {}, {})".format(*_EVENT)
        return [{"t": at, "name": name, "color": color} for at, name in sorted(self.events)]

    def steps(self) -> list[Json]:
        """Return the steps for the page's table of jumps."""
        found, number = list[Json](), 0
        for mark in self.marks:
            color = ""
            if mark.is_seam:
                color = seam_color(number)
                number += 1
            found.append({"begin": mark.begin, "end": mark.end, "name": mark.name, "color": color})
        return found


class _Performed(Path, kind="_performed"):
    """Where the tool is along a motion."""

    def __init__(self, robot: RobotModel, motion: Trajectory) -> None:
        self._robot, self._motion = robot, motion
        self.duration = motion.duration

    @override
    def evaluate(self, t: Array) -> PathSamples:
        times = np.minimum(self._motion.t[0] + t, self._motion.t[-1])
        chain = self._robot.chain
        placed = [chain.at(q) for q in self._motion(times)]
        twists = np.array(
            [at[0] @ qd for at, qd in zip(placed, self._motion(times, 1), strict=True)]
        )
        places, turns = (np.array([at[k] for at in placed]) for k in (2, 1))
        return PathSamples(t, places, turns, twists)


def stand_in(robot: RobotModel, motion: Trajectory, asked: tuple[Constraint, ...]) -> Plan:
    """Return a plan with a motion, for what pages do with plans."""
    tasks = [task for task in (Task.POSITION, Task.PLANAR) if robot.can_follow(task)]
    free = [task for task in tasks if robot.redundancy(task) > 0]
    if not free:
        raise ProblemError(f"{robot.name}: has no redundancy in position, which a replay shows")
    path = _Performed(robot, motion)
    apart = clearances_among(asked) or NO_OVERLAP
    problem = Problem(robot, path, free[0], constraints=(), clearance=apart, rest=False)
    return unproved(problem, motion)


def unproved(problem: Problem, motion: Trajectory, words: str = "") -> Plan:
    """Return a plan of a motion of which nothing is proved; its certificate says why in `words`."""
    nothing = Extreme(0.0, 0.0, "")
    certificate = Certificate(
        nothing,
        nothing,
        nothing,
        0.0,
        0,
        Tolerance(),
        (),
        (words,) if words else (),
        motion=motion.digest,
        problem=problem.digest,
    )
    status = Status.INFEASIBLE if words else Status.CONVERGED
    report = Report(0.0, 0.0, {}, {}, 0, 0, 0, 0, 0, (), status, words, 0.0)
    return Plan(problem, motion, motion, np.zeros(0), report, certificate)


def _plans(planned: Program | Parts | Move) -> Iterator[tuple[float, str, Plan]]:
    if isinstance(planned, Program):
        for begin, step in zip(planned.begins, planned.steps, strict=True):
            if isinstance(step.made, Plan):
                yield begin, step.name, step.made
    elif isinstance(planned, Parts):
        for number, (begin, plan) in enumerate(zip(planned.begins, planned.plans, strict=True), 1):
            yield begin, f"part {number}", plan


def _marks(planned: Program | Parts | Move) -> Iterator[Mark]:
    if isinstance(planned, Move):
        yield Mark(0.0, planned.motion.duration, "move", False)
        return
    if isinstance(planned, Program):
        for begin, step in zip(planned.begins, planned.steps, strict=True):
            yield Mark(begin, begin + step.motion.duration, step.name, step.is_seam)
        return
    for number, (begin, plan) in enumerate(zip(planned.begins, planned.plans, strict=True), 1):
        end = begin + plan.trajectory.duration
        yield Mark(begin, end, f"part {number}", True)
        if number <= len(planned.moves):
            yield Mark(
                end, end + planned.moves[number - 1].motion.duration, f"move {number}", False
            )
