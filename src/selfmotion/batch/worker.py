"""What runs in another process: a problem's description in, a plan's file out."""

import importlib
import os
import signal
import tempfile
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from selfmotion.basics import InverseKinematicsError, NoSequenceError, SelfmotionError
from selfmotion.formats import Job
from selfmotion.problem import problem_from_dict
from selfmotion.result import Plan

# Arms and bodies of problems planned before; forgotten when there are many.
_known: dict[str, Any] = {}
_MANY = 64
# What errors come to in a few words.
_REASONS = ((InverseKinematicsError, "out of reach"), (NoSequenceError, "no way through"))


def plan_task(task: Mapping[str, Any]) -> tuple[dict[str, Any], bytes]:
    """Plan what `Item.task` describes.

    Returns
    -------
    row : dict
        How it ended: the keys of `Row` from ``verified`` on. What goes wrong is in its ``error``.
    archive : bytes
        The plan's file; empty where there is none.
    """
    began = time.perf_counter()
    try:
        for name in task["modules"]:
            importlib.import_module(name)
        if len(_known) > _MANY:
            _known.clear()
        found = Job(problem_from_dict(task["problem"], _known), **task["options"]).plan()
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder, "plan.npz")
            found.save(file)
            archive = file.read_bytes()
    except SelfmotionError as error:
        reason = next((text for kind, text in _REASONS if isinstance(error, kind)), "no plan")
        seconds = time.perf_counter() - began
        return {"error": str(error), "reason": reason, "seconds": seconds}, b""
    # A fault of ours, or of the user's own code, must not stop the other problems.
    except Exception as error:
        what = f"{type(error).__name__}: {error}"
        return {"error": what, "fault": True, "seconds": time.perf_counter() - began}, b""
    report, certificate, duration = found.report, found.certificate, found.trajectory.duration
    nearest = {certificate.limit_margin.name} & set(found.robot.joint_names)
    is_part = bool(report.ending)
    aim = duration if task["options"]["goal"] == "fastest" else report.cost
    row = {
        "verified": certificate.verified,
        "verdict": certificate.verdict,
        "reason": _reason(found),
        "margin": certificate.limit_margin.value,
        "margin_unit": found.robot.unit_of(*nearest),
        "clearance": None if certificate.clearance is None else certificate.clearance.value,
        "cost": report.cost,
        "initial_cost": report.initial_cost,
        "duration": duration,
        "evaluations": report.evaluations,
        # What is only a part of the path is not compared with the whole.
        "aim": float("inf") if is_part else aim,
        "ends": duration if is_part else None,
        "seconds": time.perf_counter() - began,
    }
    return row, archive


def _reason(plan: Plan) -> str:
    """Say in a few words why a plan is not verified; "" where it is."""
    certificate = plan.certificate
    if certificate.verified:
        return ""
    if plan.report.ending:
        return "ends on the way"
    broken = [item.requirement for item in certificate.findings if not item.kept]
    return broken[0] if broken else "off the path"


def begin_process() -> None:
    """Leave Ctrl-C to the process that started this one; end when that does, however it ends."""
    from multiprocessing import parent_process

    # A plan that is interrupted is the best so far, which must not count as finished.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()
    if parent is None:
        return

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
