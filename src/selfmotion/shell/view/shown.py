"""What the page is told: plans as it draws them, with handles, sliders, and what stops them."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.robot import RobotModel
from selfmotion.planning.result import Plan
from selfmotion.shell.replay import links, scene, three
from selfmotion.shell.replay.content import plan_content
from selfmotion.shell.replay.meshes import Json, Payload
from selfmotion.shell.replay.redundancy import tree
from selfmotion.shell.view.handles import PLAN, handles_of
from selfmotion.shell.view.planning import Found

# The node below which what stops a plan is drawn, in red, where its path is; tubes and balls are
# relative to the scene.
STOPPED = f"{PLAN}/tip0/stopped"
_RED = (0.80, 0.10, 0.08)
_TUBE, _BALL, _POINTS = 0.007, 0.02, 201
_TRIADS = 7


class Shown:
    """Makes the messages of a page; what the page has already is not said again.

    Parameters
    ----------
    radius : float
        Half the size of the scene, as the page was made [m].
    robot : RobotModel
        The arm as the page was made.
    """

    def __init__(self, radius: float, robot: RobotModel) -> None:
        self._radius, self._robot = radius, robot
        self._has_changed = False

    def message(self, found: Found, state: Json) -> bytes:
        """Return what was found, and the state of the document, as the page reads them."""
        payload = Payload()
        content: Json = {
            "number": found.request.number,
            "kind": found.kind,
            "words": found.words,
            "brief": found.is_brief,
            **state,
        }
        if found.plan is not None:
            content |= self._plan(
                found.plan, payload, brief=found.is_brief, is_coarse=found.kind == "coarse"
            )
            content |= {"handles": handles_json(found.request.document, found.plan)}
        return payload.data(content)

    def _plan(self, plan: Plan, payload: Payload, *, brief: bool, is_coarse: bool) -> Json:
        content = plan_content(
            plan, "plan", payload, radius=self._radius, triads=_TRIADS, brief=brief
        )
        if not (is_coarse or plan.certificate.verified):
            content["stopped"] = list(stopping(plan, payload, self._radius))
        # A page may miss a message when the next one is there: all that come later say it, too.
        self._has_changed |= plan.robot is not self._robot
        if self._has_changed:
            # Meshes are those that the page has: they have the same numbers again.
            arm = links.bake(plan.robot, Payload())
            content["tree"] = tree(plan.robot, payload)
            content["arm"] = links.arm_commands(plan.robot, arm)
        return content


def handles_json(document: Mapping[str, Any], plan: Plan) -> list[Json]:
    """Return the handles of a document as the page has them."""
    handles = handles_of(document, plan.problem)
    return [handle.json(plan.robot) for handle in handles.values()]


def stopping(plan: Plan, payload: Payload, radius: float) -> Iterator[Json]:
    """Return the commands that draw in red what stops a plan.

    What of the path no motion reaches, and where the tool is when a requirement is not kept.
    """
    look = three.material(_RED, roughness=0.9)
    path, follow = plan.problem.path, plan.problem.follows.items[0]
    base = follow.chain.base_placement
    stands = np.ptp(plan.trajectory.q, axis=0).max() == 0.0
    reached = 0.0 if stands else min(plan.trajectory.duration, path.duration)
    if reached < path.duration:
        points = _in_frame(base, path.samples(np.linspace(reached, path.duration, _POINTS)))
        kept = three.distinct(points, 0.5 * _TUBE * radius)
        if len(kept) > 1:
            tube = three.tube(points[kept], _TUBE * radius)
            yield three.set_object(f"{STOPPED}/path", scene.triangles(payload, *tube), look)
        beads = three.beads(points[:1], _BALL * radius)
        yield three.set_object(f"{STOPPED}/end", scene.triangles(payload, *beads), look)
    times = [f.time for f in plan.certificate.findings if not f.satisfied and f.time <= reached]
    if times:
        points = _in_frame(base, path.samples(np.clip(times, 0.0, path.duration)))
        beads = three.beads(points, _BALL * radius)
        yield three.set_object(f"{STOPPED}/places", scene.triangles(payload, *beads), look)


def _in_frame(base: Any, samples: Any) -> Array:
    return np.asarray(samples.translation @ base.rotation.T + base.translation)
