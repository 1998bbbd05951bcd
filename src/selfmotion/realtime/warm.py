"""Small tasks that call every kernel, to compile them in advance, in another process if need be."""

import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice
from typing import Any

import numpy as np
from numba.core import event

import selfmotion as sm
from selfmotion.basics import FIRST_WORKS, Counts, compile_alone, read_only
from selfmotion.model.collision.kernels import winding_number
from selfmotion.model.task import SE3
from selfmotion.planning.formulation import BoundConditions, Formulation
from selfmotion.planning.nodes import NodeGrid, NodeMotion
from selfmotion.planning.nodes.local_model import LocalModel
from selfmotion.realtime.loop import warm_up
from selfmotion.realtime.replanner import Replanner
from selfmotion.work.job.order import improved
from selfmotion.work.job.stops import Stops


class CompilationCounter(event.Listener):  # type: ignore[misc]  # numba ships no types
    """Listener that counts compilations of numba."""

    def __init__(self) -> None:
        self.count = 0

    def on_start(self, event: object) -> None:
        """Ignore the start of a compilation; see numba."""

    def on_end(self, event: object) -> None:
        """Count a compilation at its end; see numba."""
        self.count += 1


def main(which: str) -> None:
    """Compile the kernels of a first plan, or all, the last one first; print their number."""
    compile_alone()
    counter = CompilationCounter()
    with event.install_listener("numba:compile", counter):
        works = small_works()
        for _, work in islice(works, 2) if which == FIRST_WORKS else reversed(list(works)):
            work()
    sys.stdout.write(str(counter.count))


def small_works() -> Iterator[tuple[str, Callable[[], object]]]:
    """Yield small pieces of work that together call every kernel as it is called at all."""
    arm = sm.load_robot("panda")
    home = np.array(sm.NAMED_ARMS["panda"].home)
    place, size = np.array([0.5, 0.4, 0.3]), np.array([0.1, 0.1, 0.6])
    circle = sm.paths.Circle.around(arm.pose(home), 0.05, 4.0)
    box = sm.constraints.Clearance((sm.obstacles.Box("post", place, size),), 0.01)
    alone = sm.Problem(arm, circle, "position", home, clearance=None)

    def plan(problem: sm.Problem, **options: Any) -> Callable[[], object]:
        return lambda: sm.plan(problem, **options)

    # The slowest compilation first: another process starts with the earlier ones of a plan.
    t, at_rest = np.linspace(0.0, 4.0, 5), np.zeros((5, 7))
    formulation = Formulation.of(alone)
    nodes = NodeGrid(formulation, t, BoundConditions(), free=False, counts=Counts())
    yield "nodes", lambda: _build_local_model(nodes.near(np.tile(home, (5, 1)), at_rest, at_rest))
    # Of waypoints: they have kernels of their own.
    yield "a given start", plan(replace(alone, path=_waypoints_on(circle)))
    from_home = sm.Problem(arm, circle, "position", home)
    free = replace(from_home, start=None)
    yield "inverse kinematics", lambda: arm.inverse_kinematics(arm.pose(home), seed=home)
    yield "self-collision", plan(from_home)
    yield "a free start", plan(free)
    yield "the paper's arm", plan(sm.sample_problem())
    yield "bodies", plan(replace(from_home, constraints=(), clearance=box))
    torque = sm.constraints.JointTorqueLimits()
    yield "meshes", lambda: winding_number(np.zeros((1, 3, 3)), np.zeros(3))
    model = sm.obstacles.CollisionModel(arm, box.obstacles)
    yield "distances", lambda: model.worst(read_only(np.stack([home, home + 0.1])))
    yield "torques", plan(replace(from_home, constraints=[*from_home.constraints, torque]))
    tool = sm.constraints.ToolLimits(speed=0.2, acceleration=5.0)
    yield "the tool", plan(replace(from_home, constraints=[*from_home.constraints, tool]))
    yield "singular poses", plan(replace(from_home, costs=[sm.costs.InverseManipulability(0.01)]))
    yield "redundancy maps", lambda: sm.plan(from_home).redundancy_map("panda_joint7", shape=(3, 5))
    yield "paces", lambda: sm.retime(sm.plan(from_home))
    yield "accelerations", plan(replace(from_home, costs=[sm.costs.JointAcceleration()]))
    coupled = sm.costs.JointVelocity(np.eye(7) + 0.1)
    yield "weights of several joints", plan(replace(from_home, costs=[coupled]))
    yield (
        "relaxed rows",
        plan(replace(from_home, task="pose", relaxations=[sm.Relaxation(("rx", "ry"), 0.1)])),
    )
    tilted = replace(free, task="pose", relaxations=[sm.Relaxation(("rx", "ry"), 0.1)])
    yield "relaxed rows from anywhere", plan(tilted)
    away = sm.paths.Line(arm.pose(home), _out_of_reach(arm.pose(home)), 2.0)
    yield "what is out of reach", lambda: _plan_or_error(replace(tilted, path=away))
    yield "damping", plan(replace(from_home, damping=sm.Damping()))
    yield "a global search", plan(free, search=sm.Search(mode="global"))
    yield "self-motion curves", plan(replace(free, task="pose"), search=sm.Search(mode="global"))
    yield "several tips and moving frames", plan(_two_arms_with_a_bar())
    yield "limits on the way", lambda: nodes.motion_towards(home, home, 1.0)
    yield "orders of many seams", lambda: improved(_two_stops())
    yield "moves", lambda: sm.move(arm, home, home + 0.3, clearance=box)
    yield "a replanner", lambda: warm_up(Replanner(arm, "position"))


def _waypoints_on(path: sm.paths.Path) -> sm.paths.Waypoints:
    """Return a path of waypoints on another one."""
    t = np.linspace(0.0, path.duration, 5)
    return sm.paths.Waypoints.from_poses(t, path.pose(t))


def _build_local_model(motion: NodeMotion | None) -> None:
    if motion is not None:
        scale, force = motion.grid.scale, np.zeros((5, 3, 7))
        LocalModel.of(motion.charts, motion.nu, motion.alpha, motion.place, force, scale)


def _plan_or_error(problem: sm.Problem) -> str:
    try:
        return sm.plan(problem).certificate.verdict
    except sm.SelfmotionError as error:
        return str(error)


def _out_of_reach(pose: SE3) -> SE3:
    """Return a pose that no Panda reaches."""
    return SE3(pose.rotation, pose.translation + np.array([1.5, 0.0, 0.0]))


def _two_stops() -> Stops:
    """Return two seams, each with one direction, in any order."""
    no_precedence, never_late = [frozenset[int]()] * 2, np.zeros((2, 2), dtype=bool)
    return Stops(
        after=no_precedence,
        after_any=no_precedence,
        of=np.arange(2),
        own=np.ones(2),
        between=np.ones((2, 2)),
        first=np.ones(2),
        last=np.ones(2),
        too_late=never_late,
    )


def _two_arms_with_a_bar() -> sm.Problem:
    """Return two arms that carry a bar along a line."""
    left, right = "left/panda_hand_tcp", "right/panda_hand_tcp"
    right_base = np.eye(4)
    right_base[1, 3] = -0.9
    cell = sm.load_robot(
        {"left": "panda", "right": "panda"}, base={"right": right_base}, tool=(left, right)
    )
    first, grasp = np.diag([1.0, -1.0, -1.0, 1.0]), np.eye(4)
    first[:3, 3], grasp[1, 3] = (0.45, -0.25, 0.3), 0.4
    last = first.copy()
    last[0, 3] += 0.05
    follows: Any = [
        sm.Follow(sm.paths.Line(first, last, 2.0), tool=left),
        sm.Follow(grasp, tool=right, reference=left),
    ]
    return sm.Problem(cell, follows)


if __name__ == "__main__":
    main(sys.argv[1])
