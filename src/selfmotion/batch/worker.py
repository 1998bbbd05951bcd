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
from selfmotion.batch.row import measured
from selfmotion.documents import Job
from selfmotion.problem import problem_from_dict
from selfmotion.result import Made

# Arms and bodies of problems planned before.
_made = Made()
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
        problem = problem_from_dict(task["problem"], _made.of(task["files"]))
        found = Job(problem, **task["options"]).plan()
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
    told = measured(found, task["options"]["goal"])
    return {**told, "seconds": time.perf_counter() - began}, archive


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
