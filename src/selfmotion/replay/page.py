"""One HTML file from one or several plans of a robot."""

import base64
import contextlib
import gzip
import hashlib
import html
import importlib.metadata
import os
import tempfile
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
import numpy.typing as npt

from selfmotion.arrays import Array
from selfmotion.errors import ProblemError
from selfmotion.replay import links, scene, shapes
from selfmotion.replay.facts import describe, table
from selfmotion.replay.motion import Curves, KeyFrames, curves, key_frames
from selfmotion.replay.payload import Json, Payload
from selfmotion.replay.plan_like import Plan

# All arms in example-robot-data stay below this; beyond it a page would take seconds to open.
TRIANGLE_BUDGET = 600_000
_TRIADS = 7
_VIEWER = "meshcat/viewer/dist/main.min.js"
_SCRIPTS = ("payload.js", "stage.js", "plots.js", "page.js")
_LAYERS = [
    {"name": "ghost", "label": "x = 0 motion", "key": "g"},
    {"name": "trace", "label": "tool path", "key": "t"},
    {"name": "triads", "label": "tool axes", "key": "a"},
    {"name": "ellipsoid", "label": "velocity ellipsoid", "key": "e"},
]


def replay_html(
    plans: Plan | Sequence[Plan],
    *,
    title: str | None = None,
    labels: Sequence[str] | None = None,
    triads: int | npt.ArrayLike = _TRIADS,
    triangle_budget: int = TRIANGLE_BUDGET,
) -> str:
    """Return a page that replays plans: complete, offline, the same bytes for the same plans.

    Parameters
    ----------
    plans : Plan or sequence of Plan
        What to show; several plans of one robot share a page with a switch.
    title : str, optional
        Heading of the page. Default: the robot's name and the task.
    labels : sequence of str, optional
        Names of the plans on the switch. Default: A, B, C, …
    triads : int or array of float
        Where the tool's axes are drawn: how many, evenly spaced in time, or at which times [s].
    triangle_budget : int
        Meshes are simplified only when the arm has more triangles than this.

    Raises
    ------
    ProblemError
        No plan, plans of different robots, or not one label per plan.
    RobotError
        A visual of the robot cannot be read.
    """
    shown = _as_list(plans)
    names = _labels(shown, labels)
    payload = Payload()
    content = _content(shown, names, payload, triads, triangle_budget)
    heading = title or f"{shown[0].robot.name}, {shown[0].task.value} task"
    return _assemble(heading, " ".join(describe(plan) for plan in shown), payload.pack(content))


def write_replay(
    plans: Plan | Sequence[Plan], file: str | os.PathLike[str], **options: Any
) -> Path:
    """Write `replay_html` to `file`, whole or not at all; options are those of `replay_html`.

    Returns
    -------
    Path
        The file.
    """
    path = Path(file)
    text = replay_html(plans, **options)
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as stream:
            stream.write(text)
        os.chmod(name, 0o644)
        os.replace(name, path)
    except BaseException:
        with contextlib.suppress(FileNotFoundError):
            os.unlink(name)
        raise
    return path


def notebook_html(plan: Plan, height: int = 900) -> str:
    """Return the replay as an inline frame, for ``Plan._repr_html_`` in a notebook."""
    page = html.escape(replay_html(plan), quote=True)
    return (
        f'<iframe srcdoc="{page}" sandbox="allow-scripts" title="selfmotion replay" '
        f'style="width:100%;height:{height}px;border:0"></iframe>'
    )


def _as_list(plans: Any) -> list[Plan]:
    shown = list(plans) if isinstance(plans, Sequence) else [plans]
    if not shown:
        raise ProblemError("a replay needs at least one plan")
    first = shown[0].robot
    for plan in shown[1:]:
        same = plan.robot.urdf.sha256 == first.urdf.sha256
        if not same or plan.robot.joint_names != first.joint_names:
            raise ProblemError(
                f"plans of different robots ('{first.name}' and '{plan.robot.name}') cannot share "
                f"a replay; write one for each"
            )
    return shown


def _labels(plans: list[Plan], labels: Sequence[str] | None) -> list[str]:
    if labels is None:
        return ["plan"] if len(plans) == 1 else [f"Plan {chr(65 + k)}" for k in range(len(plans))]
    if len(labels) != len(plans):
        raise ProblemError(f"{len(labels)} labels for {len(plans)} plans; give one for each")
    return list(labels)


def _content(
    plans: list[Plan],
    names: list[str],
    payload: Payload,
    triads: int | npt.ArrayLike,
    triangle_budget: int,
) -> Json:
    robot = plans[0].robot
    arm = links.bake(robot, payload, triangle_budget)
    motions = [_Motion(plan) for plan in plans]
    hull = scene.outline(
        arm,
        [frames for motion in motions for frames in motion.frames],
        [points for motion in motions for points in (motion.shown.tool, motion.target)],
    )
    box = scene.Bounds(hull.min(axis=0), hull.max(axis=0))
    manipulability = np.concatenate(
        [both.manipulability for motion in motions for both in motion.curves]
    )
    low, high = float(manipulability.min()), float(manipulability.max())
    if high - low < 1e-9 * high:
        low, high = 0.9 * low, 1.1 * high or 1.0
    scale = {"low": low, "high": high, "radius": 0.005 * box.radius}
    longest = max(float(np.linalg.norm(m.shown.ellipsoid, axis=(1, 2)).max()) for m in motions)
    return {
        "camera": scene.camera(hull, motions[0].shown.tool),
        "commands": [
            *scene.stage_commands(box),
            *links.arm_commands(robot, arm),
            *links.ghost_commands(robot, arm),
            *scene.obstacle_commands(getattr(plans[0], "obstacles", ()), payload),
            scene.ellipsoid_command(),
        ],
        "meshes": arm.meshes,
        "joints": _joints(plans[0]),
        "layers": _LAYERS,
        "scale": {**scale, "colors": shapes.COLOR_SCALE},
        "ellipsoidSize": 0.3 * box.radius / longest,
        "plans": [
            motion.content(f"/selfmotion/plan{k}", name, payload, scale, triads, 0.09 * box.radius)
            for k, (motion, name) in enumerate(zip(motions, names, strict=True))
        ],
        "table": table(plans),
    }


class _Motion:
    """A plan, sampled."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        trajectories = [plan.trajectory]
        if plan.initial_trajectory is not None:
            trajectories.append(plan.initial_trajectory)
        self.frames: list[KeyFrames] = [key_frames(plan.robot, each) for each in trajectories]
        self.curves: list[Curves] = [curves(plan, each) for each in trajectories]
        self.shown = self.curves[0]
        self.start = self.curves[1] if len(self.curves) > 1 else None
        self.target: Array = plan.path.samples(self.shown.t + plan.trajectory.t[0]).translation

    def content(
        self,
        root: str,
        name: str,
        payload: Payload,
        scale: Json,
        triads: int | npt.ArrayLike,
        triad_length: float,
    ) -> Json:
        """Return what the page needs of this plan."""
        times = (
            np.linspace(0.0, self.shown.t[-1], triads)
            if isinstance(triads, int)
            else np.atleast_1d(np.asarray(triads, dtype=float))
        )
        return {
            "label": name,
            "root": root,
            "duration": self.plan.trajectory.duration,
            "verdict": self.plan.certificate.verdict,
            "verified": bool(self.plan.certificate.verified),
            "frames": _packed(self.frames[0], payload),
            "ghost": _packed(self.frames[1], payload) if self.start is not None else None,
            "curves": self._curves(self.shown, payload),
            "start": self._curves(self.start, payload) if self.start is not None else None,
            "ellipsoid": {
                "t": payload.array(self.shown.t),
                "matrix": payload.array(self.shown.ellipsoid),
                "tool": payload.array(self.shown.tool),
            },
            "commands": [
                *scene.trace_commands(root, payload, self.shown, self.start, self.target, scale),
                scene.triad_command(root, payload, self.shown, times, triad_length),
            ],
        }

    def _curves(self, sampled: Curves, payload: Payload) -> Json:
        drawn = {
            "t": payload.array(sampled.t),
            "q": payload.array(sampled.q),
            "qd": payload.array(sampled.qd),
            "manipulability": payload.array(sampled.manipulability),
        }
        rows = self.plan.task.rows
        if np.any(rows < 3):
            drawn["position"] = payload.array(sampled.position_error)
        if np.any(rows >= 3):
            drawn["rotation"] = payload.array(sampled.rotation_error)
        return drawn


def _packed(frames: KeyFrames, payload: Payload) -> Json:
    return {
        "t": payload.array(frames.t, "f8"),
        "position": payload.array(frames.position),
        "quaternion": payload.array(frames.quaternion),
    }


def _joints(plan: Plan) -> list[Json]:
    robot = plan.robot
    kinds = [robot.urdf.joints[name].kind for name in robot.joint_names]
    return [
        {
            "name": name,
            "node": links.node("", robot.joint_names, k)[1:],
            "unit": "m" if kinds[k] == "prismatic" else "rad",
            "lower": _finite(robot.lower[k]),
            "upper": _finite(robot.upper[k]),
            "speed": _finite(robot.velocity_limit[k]),
        }
        for k, name in enumerate(robot.joint_names)
    ]


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _assemble(title: str, description: str, payload: str) -> str:
    viewer = _viewer_code()
    script = "\n" + "\n".join(_web(name) for name in _SCRIPTS)
    policy = "; ".join(
        [
            "default-src 'none'",
            f"script-src {_hash(script)} {_hash(viewer)}",
            # meshcat and its control panel put style sheets of their own into the page.
            "style-src 'unsafe-inline'",
            "img-src data: blob:",
            "base-uri 'none'",
            "form-action 'none'",
        ]
    )
    packed = base64.b64encode(gzip.compress(viewer.encode(), compresslevel=9, mtime=0))
    return Template(_web("page.html")).substitute(
        policy=policy,
        title=html.escape(title),
        description=html.escape(description),
        style=_web("style.css"),
        viewer=packed.decode("ascii"),
        payload=payload,
        script=script,
    )


def _viewer_code() -> str:
    """Return meshcat's viewer. `import meshcat` would bring ZeroMQ; this only reads its file."""
    file = importlib.metadata.distribution("meshcat").locate_file(_VIEWER)
    return Path(str(file)).read_text(encoding="utf-8")


def _web(name: str) -> str:
    return resources.files("selfmotion.replay").joinpath("web", name).read_text(encoding="utf-8")


def _hash(script: str) -> str:
    digest = hashlib.sha256(script.encode()).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"
