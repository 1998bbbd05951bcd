"""Work in another process: the description of a problem in, the file of a plan out."""

import importlib
import os
import signal
import tempfile
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from selfmotion.basics import (
    DeadlineError,
    InverseKinematicsError,
    NoSequenceError,
    SelfmotionError,
)
from selfmotion.planning.planner import PlanRequest
from selfmotion.planning.result import ArmCache
from selfmotion.problem.problem import problem_from_dict
from selfmotion.work.batch.rows import DEADLINE_REASON, row_values

# Arms and bodies of problems planned before.
_arms = ArmCache()
# Short forms of errors.
_REASONS = (
    (InverseKinematicsError, "out of reach"),
    (NoSequenceError, "no way through"),
    (DeadlineError, DEADLINE_REASON),
)


def plan_described(description: Mapping[str, Any]) -> tuple[dict[str, Any], bytes]:
    """Plan an item by its description, with a deadline.

    Parameters
    ----------
    description : dict
        `Item.description`, and the ``deadline`` [s].

    Returns
    -------
    row : dict
        How it ended: the keys of `Row` from ``verified`` on. What goes wrong is in its ``error``.
    archive : bytes
        The plan's file; empty where there is none.
    """
    began = time.perf_counter()
    try:
        for name in description["modules"]:
            importlib.import_module(name)
        problem = problem_from_dict(description["problem"], _arms.of(description["files"]))
        deadline = description["deadline"]
        limit = {} if deadline is None else {"deadline": deadline}
        plan = PlanRequest(problem, **description["options"]).plan(**limit)
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder, "plan.npz")
            plan.save(file)
            archive = file.read_bytes()
    except SelfmotionError as error:
        reason = next((text for kind, text in _REASONS if isinstance(error, kind)), "no plan")
        seconds = time.perf_counter() - began
        return {"error": str(error), "reason": reason, "seconds": seconds}, b""
    # A fault of ours, or of the user's own code, must not stop the other problems.
    except Exception as error:
        what = f"{type(error).__name__}: {error}"
        return {"error": what, "fault": True, "seconds": time.perf_counter() - began}, b""
    values = row_values(plan, description["options"]["goal"])
    return {**values, "seconds": time.perf_counter() - began}, archive


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
