"""HTML replay page of plans of a robot, of a program, of parts or of a move."""

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
    shown,
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
Replayable = Plan | Sequence[Plan] | Program | Parts | Move
# Largest number of drawn tool frames.
_MAX_TRIADS = 1000
# three.js, as `make three` builds it.
_THREE = "three/three.min.js"
# Scripts of a page that a server changes; they run before the last of the others.
_LIVE = ("handles.js", "live.js")
# Scripts of the page, in the order in which they run.
_SCRIPTS = (
    "payload.js",
    "viewer.js",
    "stage.js",
    "plots.js",
    "map.js",
    "why.js",
    "tools.js",
    "page.js",
)


def replay_html(
    plans: Replayable,
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
    drawn_triads = first.triads if triads is None else _checked_triads(triads)
    content = page_content(replayed, names, payload, triads=drawn_triads)
    if description is not None:
        described = [{**plan, "description": description} for plan in content["plans"]]
        content = {**content, "plans": described}
    sentences = [item.description for item in replayed]
    if len(replayed) > 1:
        sentences = [f"{name}: {text}." for name, text in zip(names, sentences, strict=True)]
    subject = f"{first.plan.task.value} task"
    if isinstance(plans, Program | Parts | Move):
        subject = type(plans).__name__.lower()
    return _assemble(
        title or f"{first.plan.robot.name}, {subject}",
        description or " ".join(sentences),
        payload.pack(content),
        _still_of(first, content["camera"]),
    )


def live_html(replayed: Replayed, *, title: str, live: Json) -> tuple[str, float]:
    """Return the page of a plan that `shell.view` edits, and the radius of the scene [m].

    It has the page of `replay_html` and scripts that query the server; `live` is their initial
    state.
    """
    payload = Payload()
    content = page_content([replayed], ["plan"], payload, triads=replayed.triads, with_map=False)
    packed = payload.pack({**content, "live": live})
    still_image = _still_of(replayed, content["camera"])
    page = _assemble(title, replayed.description, packed, still_image, live=True)
    return page, float(content["radius"])


def _still_of(replayed: Replayed, camera: Json) -> str:
    """Return the image that the page shows until its scripts run."""
    plan = replayed.plan
    return still(plan.robot, plan.trajectory, replayed.obstacles, camera, replayed.seams())


def write_replay(plans: Replayable, file: str | os.PathLike[str], **options: Any) -> Path:
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
    plan_list = list(plans) if isinstance(plans, Sequence) else [plans]
    if not plan_list:
        raise ProblemError("a replay needs at least one plan")
    for plan in plan_list:
        if not isinstance(plan, Plan):
            raise ProblemError(
                f"a replay is of {shown(plan)}, expected plans, or one Program, Parts or Move"
            )
    first = plan_list[0].robot
    for plan in plan_list[1:]:
        is_same_file = plan.robot.urdf.sha256 == first.urdf.sha256
        if not is_same_file or plan.robot.joint_names != first.joint_names:
            raise ProblemError(
                f"plans of different robots ('{first.name}' and '{plan.robot.name}') cannot share "
                f"a replay; write one for each"
            )
    return plan_list


def _labels(count: int, labels: Sequence[str] | None) -> list[str]:
    if labels is None:
        return ["plan"] if count == 1 else [f"Plan {chr(65 + k)}" for k in range(count)]
    if len(labels) != count:
        raise ProblemError(f"{len(labels)} labels for {count} plans; give one for each")
    for label in labels:
        if not isinstance(label, str):
            raise ProblemError(f"labels: {shown(label)}, expected a text for each plan")
    return list(labels)


def _checked_triads(triads: int | npt.ArrayLike) -> int | Array:
    """Return the number of drawn tool frames, or their times [s]."""
    if isinstance(triads, int):
        return as_whole(triads, "triads", 0, _MAX_TRIADS)
    return np.atleast_1d(as_numbers(triads, "triads", "how many, or times [s]"))


def _assemble(
    title: str, description: str, payload: str, still_image: str, *, live: bool = False
) -> str:
    """Return the page; a `live` one has the scripts that query its server."""
    scripts = (*_SCRIPTS[:-1], *_LIVE, _SCRIPTS[-1]) if live else _SCRIPTS
    code, script = asset(_THREE), concatenated(scripts)
    return Template(asset("page.html")).substitute(
        policy=content_security_policy(script, code, live=live),
        title=html.escape(title),
        description=html.escape(description),
        style=asset("style.css"),
        viewer=compressed(code),
        payload=payload,
        still=still_image,
        script=script,
    )


def concatenated(names: Sequence[str]) -> str:
    """Return the scripts, concatenated."""
    return "\n" + "\n".join(asset(name) for name in names)


def content_security_policy(*scripts: str, live: bool = False) -> str:
    """Return the Content-Security-Policy that allows only these scripts.

    A `live` page may connect to its server.
    """
    return "; ".join(
        [
            "default-src 'none'",
            f"script-src {' '.join(map(_hash, scripts))}",
            # Scripts position elements by inline styles.
            "style-src 'unsafe-inline'",
            "img-src data: blob:",
            *(["connect-src 'self'"] if live else []),
            "base-uri 'none'",
            "form-action 'none'",
        ]
    )


def compressed(code: str) -> str:
    """Return a script, gzipped and in base64."""
    packed = base64.b64encode(gzip.compress(code.encode(), compresslevel=9, mtime=0))
    return packed.decode("ascii")


def asset(name: str) -> str:
    """Return the text of a file of ``web/``."""
    file = resources.files("selfmotion.shell.replay").joinpath("web", *name.split("/"))
    return file.read_text(encoding="utf-8")


def _hash(script: str) -> str:
    digest = hashlib.sha256(script.encode()).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"
