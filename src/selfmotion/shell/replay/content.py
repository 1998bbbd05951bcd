"""The JSON content of a replay page, from plans; arrays go into a `Payload`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from selfmotion.planning.result import Plan
from selfmotion.shell.facts import plan_facts
from selfmotion.shell.replay import links, scene, three
from selfmotion.shell.replay.facts import cells, table
from selfmotion.shell.replay.meshes import Json, Payload
from selfmotion.shell.replay.motion import (
    ClearanceCurve,
    Curves,
    KeyFrames,
    SelfMotion,
    key_frames,
    torque_limits,
)
from selfmotion.shell.replay.redundancy import SeamMaps, packed_maps, tree
from selfmotion.shell.replay.replayed import Replayed, ToolTip

# What can be shown and hidden: with its key, and whether it is shown at first.
_LAYERS = [
    {"name": "ghost", "label": "minimum-norm motion", "key": "g", "on": False},
    {"name": "trace", "label": "tool path", "key": "t", "on": True},
    {"name": "triads", "label": "tool axes", "key": "a", "on": True},
    {"name": "ellipsoid", "label": "velocity ellipsoid", "key": "e", "on": False},
    {"name": "frames", "label": "joint frames", "key": "f", "on": False},
    {"name": "names", "label": "names", "key": "n", "on": False},
]
_BODIES_LAYER = {"name": "bodies", "label": "collision bodies", "key": "b", "on": False}
_PAIR_LAYER = {"name": "pair", "label": "closest pair", "key": "c", "on": True}

# Sizes of what is drawn, relative to half the diagonal of the scene.
_TRACE_RADIUS = 0.005
_TRIAD_LENGTH = 0.09
_ELLIPSOID_LENGTH = 0.3
_FRAME_LENGTH = 0.12
# Obstacles larger than this multiple of the scene, such as floors, do not enlarge the first view.
_MAX_OBSTACLE_SIZE = 2.0


class _Motion:
    """What is replayed, sampled: the motion itself and the minimum-norm motion."""

    def __init__(
        self, replayed: Replayed, *, brief: bool = False, maps: Sequence[SeamMaps] = ()
    ) -> None:
        plan = replayed.plan
        self.replayed, self.plan, self.maps = replayed, plan, maps
        self.frames = key_frames(plan.robot, plan.trajectory)
        is_minimum_norm = plan.initial_trajectory is plan.trajectory
        self.ghost = (
            self.frames if is_minimum_norm else key_frames(plan.robot, plan.initial_trajectory)
        )
        points = replayed.points(brief=brief)
        self.tips = [ToolTip(plan, item, points) for item in plan.problem.follows.items]
        self.shown, self.start = self.tips[0].shown, self.tips[0].start
        self.clearance = None if brief else replayed.clearance()
        self.self_motion = None if brief else replayed.self_motion()


def page_content(
    replayed: Sequence[Replayed],
    names: list[str],
    payload: Payload,
    *,
    triads: int | npt.ArrayLike,
    with_map: bool = True,
) -> Json:
    """Return the JSON of a page; its arrays go into `payload`. Parameters as in `replay_html`.

    Maps, which take seconds, may be left out.
    """
    robot = replayed[0].plan.robot
    arm = links.bake(robot, payload)
    motions = [_Motion(item, maps=item.maps() if with_map else ()) for item in replayed]
    hull = scene.outline(
        arm,
        [frames for motion in motions for frames in (motion.frames, motion.ghost)],
        [points for motion in motions for tip in motion.tips for points in tip.outline],
    )
    box = scene.Extent(hull.min(axis=0), hull.max(axis=0))
    # Parts are in the first view, floors are not.
    around = [
        corners
        for motion in motions
        for corners in scene.outlines(motion.replayed.obstacles, _MAX_OBSTACLE_SIZE * box.radius)
    ]
    scale = _scale(motions)
    longest = max(float(np.linalg.norm(m.shown.ellipsoid, axis=(1, 2)).max()) for m in motions)
    return {
        "radius": box.radius,
        "ground": float(box.low[2]),
        "camera": scene.camera(np.concatenate([hull, *around]), motions[0].shown.tool_in_world),
        "commands": [
            *scene.stage_commands(box),
            *links.arm_commands(robot, arm),
            *links.ghost_commands(robot, arm),
            scene.ellipsoid_command(),
            *scene.body_commands(robot, payload),
        ],
        "meshes": arm.meshes,
        "joints": _joints(replayed[0].plan),
        "tree": tree(robot, payload),
        # What is drawn moves with the model's joints: those that mimic others are among them.
        "movers": [links.joint_name(robot, k) for k in range(robot.model.nv)],
        "layers": _layers(motions),
        "scale": {**scale, "colors": three.COLOR_SCALE},
        "ellipsoidSize": _ELLIPSOID_LENGTH * box.radius / longest,
        "frameSize": _FRAME_LENGTH * box.radius,
        "links": {visual.link: links.link_node(robot, visual) for visual in arm.visuals},
        "plans": [
            _plan(motion, name, f"/selfmotion/plan{k}", payload, scale, triads, box.radius)
            for k, (motion, name) in enumerate(zip(motions, names, strict=True))
        ],
        "table": [*_missing(arm, len(replayed)), *table([item.facts for item in replayed])],
    }


def plan_content(
    replayed: Replayed,
    name: str,
    payload: Payload,
    *,
    radius: float,
    brief: bool = False,
    maps: Sequence[SeamMaps] = (),
    beside: Plan | None = None,
) -> Json:
    """Return what of a page is another with another plan, in a scene of that radius [m].

    With the redundancy maps that are given; a `brief` one without distances and self-motions. The
    ghost is the plan `beside` where there is one, and the table has both.
    """
    motion = _Motion(replayed, brief=brief, maps=maps)
    if beside is not None:
        motion.ghost = key_frames(beside.robot, beside.trajectory)
    scale = _scale([motion])
    root = "/selfmotion/plan0"
    longest = float(np.linalg.norm(motion.shown.ellipsoid, axis=(1, 2)).max())
    return {
        "scale": {**scale, "colors": three.COLOR_SCALE},
        "ellipsoidSize": _ELLIPSOID_LENGTH * radius / longest,
        "joints": _joints(replayed.plan),
        "plans": [_plan(motion, name, root, payload, scale, replayed.triads, radius)],
        "table": table([replayed.facts]) if beside is None else _compared(replayed.plan, beside),
    }


def _layers(motions: list[_Motion]) -> list[Json]:
    """Return what can be shown and hidden."""
    has_ghost = motions[0].replayed.has_minimum_norm_motion
    kept = [item for item in _LAYERS if item["name"] != "ghost" or has_ghost]
    has_bodies = motions[0].plan.robot.urdf.has_collisions
    bodies = [_BODIES_LAYER] if has_bodies else []
    pair = [_PAIR_LAYER] if any(motion.clearance for motion in motions) else []
    return [*kept, *bodies, *pair]


def _compared(plan: Plan, beside: Plan) -> list[Json]:
    """Return the rows of two plans, both with the cost that the first one has to have least of."""
    rows = table([cells(plan_facts(each)) for each in (plan, beside)])
    cost = sum(beside.evaluate(item) for item in plan.problem.costs)
    for row in rows:
        if row["label"] == "cost":
            row["cells"] = [row["cells"][0], (f"{cost:.6g}", "by the costs of this one")]
    return rows


def _missing(arm: links.Arm, plans: int) -> list[Json]:
    """Return the row of the table that says what of the arm is not drawn, where there is some."""
    cells = [("; ".join(arm.missing), ""), *[("", "")] * (plans - 1)]
    return [{"label": "not drawn", "cells": cells}] if arm.missing else []


def _scale(motions: list[_Motion]) -> Json:
    """Return the ends of the colour scale, the same for all plans, so that colours compare."""
    values = np.concatenate(
        [each.manipulability for motion in motions for each in (motion.shown, motion.start)]
    )
    low, high = float(values.min()), float(values.max())
    if high - low < 1e-9 * high:
        low, high = 0.9 * low, 1.1 * high or 1.0
    return {"low": low, "high": high}


def _plan(
    motion: _Motion,
    name: str,
    root: str,
    payload: Payload,
    scale: Json,
    triads: int | npt.ArrayLike,
    size: float,
) -> Json:
    """Return what a page needs of one plan, its traces below the node `root`."""
    shown, replayed = motion.shown, motion.replayed
    obstacles = replayed.obstacles
    return {
        "label": name,
        "description": replayed.description,
        "steps": replayed.steps(),
        "events": replayed.events(),
        "root": root,
        "tips": [
            *(
                {"root": f"{root}/tip{f}", "carrier": tip.carrier}
                for f, tip in enumerate(motion.tips)
            ),
            *({"root": node, "carrier": -1} for node in replayed.nodes_in_world(root)),
        ],
        "duration": motion.plan.trajectory.duration,
        "verdict": replayed.verdict,
        "verified": bool(replayed.verified),
        "frames": _packed(motion.frames, payload),
        "ghost": _packed(motion.ghost, payload),
        "selfMotion": _self_motion(motion.self_motion, payload),
        "redundancy": packed_maps(motion.maps, payload),
        "curves": _curves(motion.plan, shown, payload),
        "start": _curves(motion.plan, motion.start, payload),
        "ellipsoid": {
            "t": payload.array(shown.t),
            "matrix": payload.array(shown.ellipsoid),
            "tool": payload.array(shown.tool_in_world),
        },
        "clearance": None if motion.clearance is None else _clearance(motion.clearance, payload),
        "obstacles": {item.name: scene.obstacle_node(root, item) for item in obstacles},
        "riders": scene.riders(root, motion.plan.robot, obstacles),
        "commands": [
            *scene.obstacle_commands(root, motion.plan.robot, obstacles, payload),
            *_tip_commands(motion, root, payload, scale, triads, size),
        ],
    }


def _tip_commands(
    motion: _Motion,
    root: str,
    payload: Payload,
    scale: Json,
    triads: int | npt.ArrayLike,
    size: float,
) -> Iterator[Json]:
    """Yield the commands that draw the trace and the triads of each tip."""
    shown = motion.shown
    times = (
        np.linspace(0.0, shown.t[-1], triads)
        if isinstance(triads, int)
        else np.atleast_1d(np.asarray(triads, dtype=float))
    )
    for f, tip in enumerate(motion.tips):
        node, radius = f"{root}/tip{f}", _TRACE_RADIUS * size
        yield from motion.replayed.trace_commands(node, payload, tip, scale, radius)
        yield scene.triad_command(node, payload, tip.shown, times, _TRIAD_LENGTH * size)


def _packed(frames: KeyFrames, payload: Payload) -> Json:
    return {
        "t": payload.array(frames.t, "f8"),
        "position": payload.array(frames.position),
        "quaternion": payload.array(frames.quaternion),
    }


def _self_motion(found: SelfMotion | None, payload: Payload) -> Json | None:
    if found is None:
        return None
    return {
        "joint": found.joint,
        "t": payload.array(found.frames[0].t),
        "position": payload.array(np.stack([one.position for one in found.frames])),
        "quaternion": payload.array(np.stack([one.quaternion for one in found.frames])),
        "steps": len(found.frames),
    }


def _curves(plan: Plan, sampled: Curves, payload: Payload) -> Json:
    drawn: Json = {
        "t": payload.array(sampled.t),
        "q": payload.array(sampled.q),
        "qd": payload.array(sampled.qd),
        "qdd": payload.array(sampled.qdd),
        "manipulability": payload.array(sampled.manipulability),
    }
    if sampled.torque is not None:
        drawn["torque"] = payload.array(sampled.torque)
    if np.any(plan.task.rows < 3):
        drawn["position"] = payload.array(sampled.position_error)
    if np.any(plan.task.rows >= 3):
        drawn["rotation"] = payload.array(sampled.rotation_error)
    # What is allowed is no error, and a page says so.
    drawn["relaxed"] = bool(plan.problem.relaxations)
    return drawn


def _clearance(curve: ClearanceCurve, payload: Payload) -> Json:
    return {
        "t": payload.array(curve.t),
        "value": payload.array(curve.value),
        "pairs": curve.pairs,
        "points": payload.array(curve.points),
        "required": payload.array(curve.required),
    }


def _joints(plan: Plan) -> list[Json]:
    robot, asked = plan.robot, torque_limits(plan)
    # Further ones are of joints that mimic others.
    effort = robot.effort_limit if asked is None else asked.bounds[: robot.dof]
    return [
        {
            "name": name,
            "unit": "m" if robot.is_prismatic(name) else "rad",
            "lower": _finite(robot.lower[k]),
            "upper": _finite(robot.upper[k]),
            "speed": _finite(robot.velocity_limit[k]),
            "acceleration": _finite(robot.acceleration_limit[k]),
            "effort": _finite(effort[k]),
        }
        for k, name in enumerate(robot.joint_names)
    ]


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
