"""Sequences of steps as a page replays them: programs, motions in parts, and moves."""

from collections.abc import Iterator
from dataclasses import dataclass

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
from selfmotion.shell.facts import program_facts
from selfmotion.shell.replay import scene, three
from selfmotion.shell.replay.facts import Cell, cells
from selfmotion.shell.replay.meshes import Json, Payload
from selfmotion.shell.replay.motion import CURVE_POINTS, ClearanceCurve, Curves, SelfMotion
from selfmotion.shell.replay.redundancy import FEWER_PIXELS, MAX_SEAMS, SeamMaps, slices
from selfmotion.shell.replay.replayed import ToolTip, clearance_of
from selfmotion.work.job import Program

# Points of curves for each step that is not brief [s], at least, and in all; more nobody sees.
_POINTS, _BRIEF, _MOST_POINTS = 25, 0.5, 6001
# Colours of seams, by turns: those of the page's plots.
_COLORS = ((66, 105, 208), (232, 135, 30), (60, 169, 81), (224, 80, 140), (164, 99, 242))
_MOVE_COLOR = (138, 145, 156)
# Of events: the same in the scene, the plots and the list of steps.
_EVENT_COLOR = (194, 24, 91)
# Thickness of moves relative to seams.
_THIN = 0.4


def seam_color(number: int) -> str:
    """Return the colour of a seam by its place in the order, for CSS and SVG."""
    return "rgb({}, {}, {})".format(*_COLORS[number % len(_COLORS)])


@dataclass(frozen=True)
class Mark:
    """A step on the time axis: when it begins and ends [s], its name, and whether it is a seam."""

    begin: float
    end: float
    name: str
    is_seam: bool


@dataclass(frozen=True, eq=False)
class SequenceReplay:
    """A motion of several steps, as a page replays it: a `Replayed`.

    Attributes
    ----------
    plan : Plan
        Stands for it: its motion, along the path that the tool goes.
    marks : tuple of Mark
        Its steps.
    verdict : str
    verified : bool
    timed_events : tuple of (float, str)
        When each event is [s], and its name.
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
    timed_events: tuple[tuple[float, str], ...]
    obstacles: tuple[Obstacle, ...]
    grows: bool
    plans: tuple[tuple[float, str, Plan], ...] = ()
    # The path of its plan is where the tool goes, so that nothing is compared along it.
    has_minimum_norm_motion: bool = False
    triads: int = 0

    @classmethod
    def of(cls, planned: Program | Parts | Move) -> "SequenceReplay":
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
            bodies = list(planned.obstacles)
        elif isinstance(planned, Parts):
            constraints, bodies = planned.problem.all_constraints, list(planned.plans[0].obstacles)
        else:
            constraints, bodies = planned.constraints, list(planned.obstacles)
        obstacles = tuple({item.name: item for item in bodies}.values())
        plan = stand_in(planned.robot, motion, constraints)
        plans = tuple(_plans(planned))
        return cls(plan, marks, planned.verdict, planned.verified, events, obstacles, grows, plans)

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
        moves = [(mark.name, mark.end - mark.begin) for mark in self.marks if not mark.is_seam]
        seams = len(self.marks) - len(moves)
        return cells(program_facts(self.verdict, self.marks[-1].end, seams, moves))

    def points(self, *, brief: bool = False) -> int:
        """See `Replayed.points`; a brief page needs as many."""
        del brief
        shortest = max(min(mark.end - mark.begin for mark in self.marks), _BRIEF)
        wanted = int(_POINTS * self.marks[-1].end / shortest)
        return min(max(CURVE_POINTS, wanted), _MOST_POINTS)

    def clearance(self) -> ClearanceCurve | None:
        """See `Replayed.clearance`."""
        return None if self.grows else clearance_of(self.plan)

    def self_motion(self) -> SelfMotion | None:
        """Return none: what the tool does in moves is not prescribed."""
        return None

    def maps(self) -> list[SeamMaps]:
        """See `Replayed.maps`; a job of many seams has none."""
        if len(self.plans) > MAX_SEAMS:
            return []
        return [
            SeamMaps(begin, name, slices(plan, FEWER_PIXELS)) for begin, name, plan in self.plans
        ]

    def steps(self) -> list[Json]:
        """See `Replayed.steps`."""
        rows, number = list[Json](), 0
        for mark in self.marks:
            color = ""
            if mark.is_seam:
                color = seam_color(number)
                number += 1
            rows.append({"begin": mark.begin, "end": mark.end, "name": mark.name, "color": color})
        return rows

    def seams(self) -> list[tuple[float, float, str]]:
        """See `Replayed.seams`."""
        return [(s["begin"], s["end"], s["color"]) for s in self.steps() if s["color"]]

    def events(self) -> list[Json]:
        """See `Replayed.events`."""
        color = "rgb({}, {}, {})".format(*_EVENT_COLOR)
        return [{"t": at, "name": name, "color": color} for at, name in sorted(self.timed_events)]

    def nodes_in_world(self, root: str) -> list[str]:
        """See `Replayed.nodes_in_world`: moves are drawn there."""
        return [f"{root}/moves"]

    def trace_commands(
        self, root: str, payload: Payload, tip: ToolTip, scale: Json, radius: float
    ) -> list[Json]:
        """Return the commands that draw each seam in a colour of its own, and moves thinly.

        Seams are below the node `root` of what carries them; moves, which nothing carries, are in
        the world.
        """
        del scale
        (moves,) = self.nodes_in_world(root.rsplit("/", 1)[0])
        shown, commands, seams = tip.shown, list[Json](), 0
        for number, mark in enumerate(self.marks):
            within = (shown.t >= mark.begin) & (shown.t <= mark.end)
            points = (shown.tool if mark.is_seam else shown.tool_in_world)[within]
            kept = three.distinct(points, 0.5 * radius)
            if len(kept) > 1:
                width = (1.5 if mark.is_seam else _THIN) * radius
                drawn = scene.triangles(payload, *three.tube(points[kept], width))
                node = f"{root}/trace/seam{seams}" if mark.is_seam else f"{moves}/trace/{number}"
                color = _COLORS[seams % len(_COLORS)] if mark.is_seam else _MOVE_COLOR
                look = three.material([part / 255.0 for part in color], roughness=0.8)
                commands.append(three.set_object(node, drawn, look))
            seams += mark.is_seam
        return [*commands, *self._beads(root, payload, shown, radius)]

    def _beads(self, root: str, payload: Payload, shown: Curves, radius: float) -> list[Json]:
        """Return the commands for a bead where the tool is at each event."""
        look = three.material([part / 255.0 for part in _EVENT_COLOR], roughness=0.8)
        commands = []
        for number, (at, _) in enumerate(self.timed_events):
            place = np.array([[np.interp(at, shown.t, axis) for axis in shown.tool.T]])
            drawn = scene.triangles(payload, *three.beads(place, 3.0 * radius))
            commands.append(three.set_object(f"{root}/trace/event{number}", drawn, look))
        return commands


class _ToolPath(Path, kind="_performed"):
    """Where the tool is along a motion."""

    def __init__(self, robot: RobotModel, motion: Trajectory) -> None:
        self._robot, self._motion = robot, motion
        self.duration = motion.duration

    @override
    def evaluate(self, t: Array) -> PathSamples:
        times = np.minimum(self._motion.t[0] + t, self._motion.t[-1])
        jacobians, turns, places = self._robot.chain.along(self._motion(times))
        twists = np.einsum("kcn,kn->kc", jacobians, self._motion(times, 1))
        return PathSamples(t, places, turns, twists)


def stand_in(robot: RobotModel, motion: Trajectory, constraints: tuple[Constraint, ...]) -> Plan:
    """Return a plan with a motion, for what pages do with plans."""
    tasks = [task for task in (Task.POSITION, Task.PLANAR) if robot.can_follow(task)]
    free = [task for task in tasks if robot.redundancy(task) > 0]
    if not free:
        raise ProblemError(f"{robot.name}: has no redundancy in position, which a replay shows")
    path = _ToolPath(robot, motion)
    clearance = clearances_among(constraints) or NO_OVERLAP
    problem = Problem(robot, path, free[0], constraints=(), clearance=clearance, rest=False)
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
