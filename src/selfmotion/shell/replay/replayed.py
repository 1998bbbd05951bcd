"""What a page replays: a plan, or a sequence of steps (see `sequence`)."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.collision import Obstacle
from selfmotion.model.follow import BoundTaskFrame
from selfmotion.planning.redundancy import PIXELS
from selfmotion.planning.result import Plan
from selfmotion.problem.problem import envelope_of_problem
from selfmotion.shell.facts import plan_facts
from selfmotion.shell.replay import scene
from selfmotion.shell.replay.facts import Cell, cells, describe
from selfmotion.shell.replay.meshes import Json, Payload
from selfmotion.shell.replay.motion import (
    CURVE_POINTS,
    ClearanceCurve,
    SelfMotion,
    clearance_curve,
    curves,
    self_motion,
)
from selfmotion.shell.replay.redundancy import SeamMaps, slices

# Points of the curves of a brief page.
_BRIEF_POINTS = 101
# Number of triads along a plan.
_TRIADS = 7


class ToolTip:
    """The motion of one tool tip, sampled: actual and prescribed positions, and the carrier.

    Parameters
    ----------
    plan : Plan
    follow : BoundTaskFrame
        What of the plan's tips follows which path.
    points : int
        How many samples.
    """

    def __init__(self, plan: Plan, follow: BoundTaskFrame, points: int) -> None:
        self.carrier = follow.chain.carrier
        self.shown = curves(plan, plan.trajectory, follow, points)
        self.start = self.shown
        if plan.initial_trajectory is not plan.trajectory:
            self.start = curves(plan, plan.initial_trajectory, follow, points)
        # The whole path, also where the motion ends before it.
        times = np.linspace(0.0, follow.path.duration, points)
        base = follow.chain.base_placement
        prescribed = follow.path.samples(times).translation
        self.target: Array = prescribed @ base.rotation.T + base.translation

    @property
    def outline(self) -> list[Array]:
        """Points of it in world axes; a path that is carried moves with the tool."""
        fixed = [self.target] if self.carrier < 0 else []
        return [self.shown.tool_in_world, *fixed]


class Replayed(Protocol):
    """What a page replays."""

    @property
    def plan(self) -> Plan:
        """Its motion; of a sequence a plan that stands for it, along the path of the tool."""

    @property
    def obstacles(self) -> Sequence[Obstacle]:
        """All that stands there in the end."""

    @property
    def verdict(self) -> str:
        """Whether it is verified, in words."""

    @property
    def verified(self) -> bool:
        """Whether it is."""

    @property
    def description(self) -> str:
        """One sentence that tells a stranger what the page shows."""

    @property
    def facts(self) -> dict[str, Cell]:
        """What a reader wants to know of it: label → number and remark."""

    @property
    def plans(self) -> Sequence[tuple[float, str, Plan]]:
        """When each of its plans begins [s], its name ("" for a plan alone), and the plan."""

    @property
    def has_minimum_norm_motion(self) -> bool:
        """Whether there is one to compare with."""

    @property
    def triads(self) -> int:
        """How many axes of the tool are drawn along it, unless a user says."""

    def points(self, *, brief: bool) -> int:
        """Return how many points its curves have; on a `brief` page they may be fewer."""

    def clearance(self) -> ClearanceCurve | None:
        """Return its distances of bodies, where one curve tells them."""

    def self_motion(self) -> SelfMotion | None:
        """Return its self-motion, where the tool's motion is prescribed."""

    def maps(self) -> list[SeamMaps]:
        """Return redundancy maps of as many pixels as take about a second."""

    def steps(self) -> list[Json]:
        """Return the steps for the page's table of jumps."""

    def seams(self) -> list[tuple[float, float, str]]:
        """Return when each seam begins and ends [s], and its colour."""

    def events(self) -> list[Json]:
        """Return the events for the page, in the order of time."""

    def nodes_in_world(self, root: str) -> list[str]:
        """Return the nodes below `root`, beside those of tool tips, that nothing carries."""

    def trace_commands(
        self, root: str, payload: Payload, tip: ToolTip, scale: Json, radius: float
    ) -> list[Json]:
        """Return the commands for the traces of a tool tip, below the node `root` of its carrier.

        `scale` has the ends of the colour scale; `radius` is that of a plan's trace [m].
        """


@dataclass(frozen=True, eq=False)
class PlanReplay:
    """One plan, as a page replays it: a `Replayed`."""

    plan: Plan
    has_minimum_norm_motion: bool = True
    triads: int = _TRIADS

    @property
    def obstacles(self) -> Sequence[Obstacle]:
        """Those of the plan."""
        return self.plan.obstacles

    @property
    def verdict(self) -> str:
        """That of its certificate."""
        return self.plan.certificate.verdict

    @property
    def verified(self) -> bool:
        """Whether its certificate says so."""
        return self.plan.certificate.verified

    @cached_property
    def description(self) -> str:
        """See `describe`."""
        return describe(self.plan)

    @property
    def facts(self) -> dict[str, Cell]:
        """Its report and certificate."""
        return cells(plan_facts(self.plan))

    @property
    def plans(self) -> Sequence[tuple[float, str, Plan]]:
        """The plan alone."""
        return ((0.0, "", self.plan),)

    def points(self, *, brief: bool) -> int:
        """See `Replayed.points`."""
        return _BRIEF_POINTS if brief else CURVE_POINTS

    def clearance(self) -> ClearanceCurve | None:
        """See `Replayed.clearance`."""
        return clearance_of(self.plan)

    def self_motion(self) -> SelfMotion | None:
        """See `Replayed.self_motion`."""
        return self_motion(self.plan.problem, self.plan.trajectory)

    def maps(self) -> list[SeamMaps]:
        """See `Replayed.maps`."""
        return [SeamMaps(0.0, "", slices(self.plan, PIXELS))]

    def steps(self) -> list[Json]:
        """Return none: a plan is one step."""
        return []

    def seams(self) -> list[tuple[float, float, str]]:
        """Return none: a plan has one colour."""
        return []

    def events(self) -> list[Json]:
        """Return none: only steps of programs have events."""
        return []

    def nodes_in_world(self, root: str) -> list[str]:
        """Return none: all is drawn where it is carried."""
        del root
        return []

    def trace_commands(
        self, root: str, payload: Payload, tip: ToolTip, scale: Json, radius: float
    ) -> list[Json]:
        """See `scene.trace_commands`."""
        traces = (tip.shown, tip.start, tip.target)
        return scene.trace_commands(root, payload, *traces, scale, radius)


def clearance_of(plan: Plan) -> ClearanceCurve | None:
    """Return the distances of a plan's bodies over time; None where there are none."""
    return clearance_curve(plan.trajectory, envelope_of_problem(plan.problem).bodies)
