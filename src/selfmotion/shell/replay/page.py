"""One HTML file from one or several plans of a robot."""

from __future__ import annotations

import base64
import gzip
import hashlib
import html
import os
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
import numpy.typing as npt

from selfmotion.basics import (
    Array,
    ProblemError,
    as_numbers,
    as_path,
    as_whole,
    shown as told,
    write_text,
)
from selfmotion.planning.result import Move, Parts, Plan
from selfmotion.shell.replay.content import page_content
from selfmotion.shell.replay.meshes import Json, Payload
from selfmotion.shell.replay.replayed import PlanReplay, Replayed
from selfmotion.shell.replay.sequence import SequenceReplay
from selfmotion.shell.replay.still import still
from selfmotion.work.job import Program

# What a page can show.
Shown = Plan | Sequence[Plan] | Program | Parts | Move
_MOST_TRIADS = 1000
# three.js, as `make three` takes it from its own package; the page's own scripts.
_THREE = "three/three.min.js"
_LIVE = ("handles.js", "live.js")
_SCRIPTS = ("payload.js", "viewer.js", "stage.js", "plots.js", "map.js", "tools.js", "page.js")


def replay_html(
    plans: Shown,
    *,
    title: str | None = None,
    labels: Sequence[str] | None = None,
    description: str | None = None,
    triads: int | npt.ArrayLike | None = None,
) -> str:
    """Return a page that replays plans: complete, offline, the same bytes for the same plans.

    For plans that keep a clearance, obstacles and the closest pair of bodies are shown too.

    Parameters
    ----------
    plans : Plan or sequence of Plan, Program, Parts or Move
        What to show; several plans of one robot share a page with a switch. Of a program and of
        parts the seams have colours, and a table to jump to each.
    title : str, optional
        Heading of the page. Default: the robot's name and the task.
    labels : sequence of str, optional
        Names of the plans on the switch. Default: A, B, C, …
    description : str, optional
        What the page shows, in words. Default: arm, task, cost and verdict.
    triads : int or array of float
        Where the tool's axes are drawn: how many, evenly spaced in time, or at which times [s].
        Default: 7 of each plan, none of what has several steps.

    Raises
    ------
    ProblemError
        No plan, plans of different robots, or an argument that is not what it should be.
    RobotError
        A visual of the robot cannot be read.
    """
    replayed: list[Replayed] = (
        [SequenceReplay.of(plans)]
        if isinstance(plans, Program | Parts | Move)
        else [PlanReplay(plan) for plan in _as_list(plans)]
    )
    first, names = replayed[0], _labels(len(replayed), labels)
    payload = Payload()
    axes = first.triads if triads is None else _checked(triads)
    content = page_content(replayed, names, payload, triads=axes)
    if description is not None:
        for shown_plan in content["plans"]:
            shown_plan["description"] = description
    sentences = [item.description for item in replayed]
    if len(replayed) > 1:
        sentences = [f"{name}: {said}." for name, said in zip(names, sentences, strict=True)]
    what = f"{first.plan.task.value} task"
    if isinstance(plans, Program | Parts | Move):
        what = type(plans).__name__.lower()
    heading = title or f"{first.plan.robot.name}, {what}"
    picture = _still_of(first, content["camera"])
    return _assemble(heading, description or " ".join(sentences), payload.pack(content), picture)


def live_html(replayed: Replayed, *, title: str, live: Json) -> tuple[str, float]:
    """Return the page of a plan that is changed while it is shown, and the scene's radius [m].

    It is that of `replay_html` with the modules that a server is asked by: see `shell.view`, which
    says in `live` what they have to know.
    """
    payload = Payload()
    content = page_content([replayed], ["plan"], payload, triads=replayed.triads, with_map=False)
    packed = payload.pack({**content, "live": live})
    scripts = (*_SCRIPTS[:-1], *_LIVE, _SCRIPTS[-1])
    picture = _still_of(replayed, content["camera"])
    page = _assemble(title, replayed.description, packed, picture, scripts)
    return page, float(content["radius"])


def _still_of(replayed: Replayed, camera: Json) -> str:
    plan = replayed.plan
    return still(plan.robot, plan.trajectory, replayed.obstacles, camera, replayed.seams())


def write_replay(plans: Shown, file: str | os.PathLike[str], **options: Any) -> Path:
    """Write `replay_html` to `file`, whole or not at all; options are those of `replay_html`.

    Returns
    -------
    Path
        The file.
    """
    path = as_path(file)
    write_text(path, replay_html(plans, **options))
    return path


def notebook_html(plan: Plan, height: int = 900) -> str:
    """Return the replay as an inline frame, for ``Plan._repr_html_`` in a notebook."""
    page = html.escape(replay_html(plan), quote=True)
    return (
        f'<iframe srcdoc="{page}" sandbox="allow-scripts allow-downloads" '
        f'title="selfmotion replay" style="width:100%;height:{height}px;border:0"></iframe>'
    )


def _as_list(plans: Any) -> list[Plan]:
    shown = list(plans) if isinstance(plans, Sequence) else [plans]
    if not shown:
        raise ProblemError("a replay needs at least one plan")
    for plan in shown:
        if not isinstance(plan, Plan):
            raise ProblemError(
                f"a replay is of {told(plan)}, expected plans, or one Program, Parts or Move"
            )
    first = shown[0].robot
    for plan in shown[1:]:
        same = plan.robot.urdf.sha256 == first.urdf.sha256
        if not same or plan.robot.joint_names != first.joint_names:
            raise ProblemError(
                f"plans of different robots ('{first.name}' and '{plan.robot.name}') cannot share "
                f"a replay; write one for each"
            )
    return shown


def _labels(count: int, labels: Sequence[str] | None) -> list[str]:
    if labels is None:
        return ["plan"] if count == 1 else [f"Plan {chr(65 + k)}" for k in range(count)]
    if len(labels) != count:
        raise ProblemError(f"{len(labels)} labels for {count} plans; give one for each")
    for label in labels:
        if not isinstance(label, str):
            raise ProblemError(f"labels: {told(label)}, expected a text for each plan")
    return list(labels)


def _checked(triads: int | npt.ArrayLike) -> int | Array:
    """Return a number of triads, or their times [s]."""
    if isinstance(triads, int):
        return as_whole(triads, "triads", 0, _MOST_TRIADS)
    return np.atleast_1d(as_numbers(triads, "triads", "how many, or times [s]"))


def _assemble(
    title: str,
    description: str,
    payload: str,
    picture: str,
    scripts: Sequence[str] = _SCRIPTS,
) -> str:
    code, script = web(_THREE), joined(scripts)
    live = scripts is not _SCRIPTS
    return Template(web("page.html")).substitute(
        policy=policy(script, code, live=live),
        title=html.escape(title),
        description=html.escape(description),
        style=web("style.css"),
        viewer=squeezed(code),
        payload=payload,
        still=picture,
        script=script,
    )


def joined(names: Sequence[str]) -> str:
    """Return scripts of the page as one."""
    return "\n" + "\n".join(web(name) for name in names)


def policy(*scripts: str, live: bool = False) -> str:
    """Return what a page may load and run: these scripts, and nothing from outside.

    One that is `live` may ask the server that it came from.
    """
    return "; ".join(
        [
            "default-src 'none'",
            f"script-src {' '.join(map(_hash, scripts))}",
            # What moves is placed by its own style.
            "style-src 'unsafe-inline'",
            "img-src data: blob:",
            *(["connect-src 'self'"] if live else []),
            "base-uri 'none'",
            "form-action 'none'",
        ]
    )


def squeezed(code: str) -> str:
    """Return a script as the page holds it, until it is run."""
    packed = base64.b64encode(gzip.compress(code.encode(), compresslevel=9, mtime=0))
    return packed.decode("ascii")


def web(name: str) -> str:
    """Return a file of the page by its name."""
    file = resources.files("selfmotion.shell.replay").joinpath("web", *name.split("/"))
    return file.read_text(encoding="utf-8")


def _hash(script: str) -> str:
    digest = hashlib.sha256(script.encode()).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"
