"""What the page receives: plans as it draws them, with handles, sliders, and what stops them."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.path import Path
from selfmotion.model.robot import RobotModel
from selfmotion.planning.result import Parts, Plan
from selfmotion.shell.replay import (
    Json,
    Payload,
    PlanReplay,
    links,
    plan_content,
    scene,
    three,
    tree,
)
from selfmotion.shell.view.handles import PLAN, handles_of
from selfmotion.shell.view.requests import Outcome

# The node below which what stops a plan is drawn, in red, where its path is; tubes and balls are
# relative to the scene.
STOPPED = f"{PLAN}/tip0/stopped"
_RED = (0.80, 0.10, 0.08)
_TUBE, _BALL, _POINTS = 0.007, 0.02, 201


class Shown:
    """Makes the messages of a page; what the page has already is not said again."""

    def __init__(self) -> None:
        self._radius = 1.0
        self._robot: RobotModel | None = None
        self._has_changed = False

    def begin(self, radius: float, robot: RobotModel) -> None:
        """Note half the size of the scene [m], and the arm, as the page is made with them."""
        self._radius, self._robot = radius, robot

    def message(
        self, outcome: Outcome, state: Json, beside: tuple[str, Plan] | None = None
    ) -> bytes:
        """Return what was found, and the state of the document, as the page reads them.

        With the plan that is shown `beside`, by its name.
        """
        payload = Payload()
        content: Json = {
            "number": outcome.request.number,
            "kind": outcome.kind,
            "words": outcome.words,
            "brief": outcome.is_brief,
            "beside": "" if beside is None else beside[0],
            **state,
        }
        if outcome.replayed is not None:
            plan = outcome.replayed.plan
            content |= plan_content(
                outcome.replayed,
                "plan",
                payload,
                radius=self._radius,
                brief=outcome.is_brief,
                maps=outcome.maps,
                beside=None if beside is None else beside[1],
            )
            if outcome.kind != "coarse" and not outcome.verified:
                content["stopped"] = list(stopping(outcome, payload, self._radius))
            content |= self._arm(plan, payload)
            if outcome.placements is not None:
                content["floor"] = outcome.placements.json(payload)
            content["handles"] = handles_json(outcome.request.document, plan)
        return payload.data(content)

    def _arm(self, plan: Plan, payload: Payload) -> Json:
        """Return the arm, where it is another one than the page was made with."""
        # A page may miss a message when the next one is there: all that come later say it, too.
        self._has_changed |= plan.robot is not self._robot
        if not self._has_changed:
            return {}
        # Meshes are those that the page has: they have the same numbers again.
        arm = links.bake(plan.robot, Payload())
        return {
            "tree": tree(plan.robot, payload),
            "arm": links.arm_commands(plan.robot, arm),
        }


def handles_json(document: Mapping[str, Any], plan: Plan) -> list[Json]:
    """Return the handles of a document as the page has them."""
    handles = handles_of(document, plan.problem)
    return [handle.json(plan.robot) for handle in handles.values()]


def stopping(outcome: Outcome, payload: Payload, radius: float) -> Iterator[Json]:
    """Return the commands that draw in red what stops a motion.

    What of the paths no motion reaches, and where the tool is when a requirement is not kept.
    """
    if outcome.plan is None:
        return
    base = outcome.plan.problem.follows.items[0].chain.base_placement
    ends, places = list[Array](), list[Array]()
    for number, (path, reached, times) in enumerate(_stopped(outcome)):
        if reached < path.duration:
            points = _in_frame(base, path.samples(np.linspace(reached, path.duration, _POINTS)))
            kept = three.distinct(points, 0.5 * _TUBE * radius)
            if len(kept) > 1:
                tube = three.tube(points[kept], _TUBE * radius)
                yield _red(f"path{number}", payload, tube)
            ends.append(points[0])
        if times:
            within = np.clip(times, 0.0, path.duration)
            places += list(_in_frame(base, path.samples(within)))
    for name, some in (("end", ends), ("places", places)):
        if some:
            yield _red(name, payload, three.beads(np.array(some), _BALL * radius))


def _stopped(outcome: Outcome) -> Iterator[tuple[Path, float, list[float]]]:
    """Return paths, until when they are followed, and when something is not kept [s]."""
    for path in outcome.unmade:
        yield path, 0.0, []
    made = outcome.made
    if made is not None:
        plans = made.plans if isinstance(made, Parts) else made.plans.values()
        for plan in plans:
            yield plan.path, plan.path.duration, _not_kept(plan)
    elif isinstance(outcome.replayed, PlanReplay):
        plan = outcome.replayed.plan
        stands = np.ptp(plan.trajectory.q, axis=0).max() == 0.0
        reached = 0.0 if stands else min(plan.trajectory.duration, plan.path.duration)
        yield plan.path, reached, [time for time in _not_kept(plan) if time <= reached]


def _not_kept(plan: Plan) -> list[float]:
    return [item.time for item in plan.certificate.findings if not item.satisfied]


def _red(name: str, payload: Payload, surface: Any) -> Json:
    look = three.material(_RED, roughness=0.9)
    return three.set_object(f"{STOPPED}/{name}", scene.triangles(payload, *surface), look)


def _in_frame(base: Any, samples: Any) -> Array:
    return np.asarray(samples.translation @ base.rotation.T + base.translation)
