"""A plan in meshcat's own viewer: with its tree of the scene, its controls and its recorder."""

import html
import importlib.metadata
import os
from pathlib import Path
from string import Template

from selfmotion.basics import ProblemError, as_path, shown as told, write_text
from selfmotion.planning.result import Plan
from selfmotion.shell.replay.content import page_content
from selfmotion.shell.replay.meshes import Payload
from selfmotion.shell.replay.page import asset, compressed, concatenated, content_security_policy
from selfmotion.shell.replay.replayed import PlanReplay

_VIEWER = "meshcat/viewer/dist/main.min.js"
_SCRIPTS = ("payload.js", "meshcat.js")


def meshcat_html(plan: Plan, *, title: str | None = None) -> str:
    """Return a page that shows a plan in meshcat's viewer: complete, offline, from one file.

    Parameters
    ----------
    plan : Plan
    title : str, optional
        Of the window. Default: the robot's name and the task.

    Raises
    ------
    ProblemError
        It is no plan.
    RobotError
        A visual of the robot cannot be read.
    """
    if not isinstance(plan, Plan):
        raise ProblemError(f"a page of meshcat is of {told(plan)}, expected a Plan")
    payload = Payload()
    replayed = PlanReplay(plan)
    content = page_content([replayed], ["plan"], payload, triads=replayed.triads)
    code, script = _viewer_code(), concatenated(_SCRIPTS)
    return Template(asset("meshcat.html")).substitute(
        policy=content_security_policy(script, code),
        title=html.escape(title or f"{plan.robot.name}, {plan.task.value} task"),
        viewer=compressed(code),
        payload=payload.pack(content),
        script=script,
    )


def write_meshcat(plan: Plan, file: str | os.PathLike[str], *, title: str | None = None) -> Path:
    """Write `meshcat_html` to `file`, whole or not at all, and return the file."""
    path = as_path(file)
    write_text(path, meshcat_html(plan, title=title))
    return path


def _viewer_code() -> str:
    """Return meshcat's viewer. `import meshcat` would bring ZeroMQ; this only reads its file."""
    file = importlib.metadata.distribution("meshcat").locate_file(_VIEWER)
    return Path(str(file)).read_text(encoding="utf-8")
