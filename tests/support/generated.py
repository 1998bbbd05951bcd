"""What becomes of a generated problem: a plan whose verdict is judged anew, or a typed error."""

import signal
import tempfile
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import selfmotion as sm
from support.oracle import Judge
from support.strategies import Generated, build


class Hang(BaseException):
    """Raised by the alarm; no handler of errors may swallow it."""


@dataclass(frozen=True)
class End:
    """How a problem ended.

    Attributes
    ----------
    kind : str
        ``"verified"``, ``"not verified"``, ``"refused"``; or what must not be: ``"FALSE"``,
        ``"UNTYPED"``, ``"HANG"``.
    text : str
        The verdict or message.
    strict : bool
        Whether the judge would have accepted, with 1 % to spare, what is not verified.
    seconds : float
    """

    kind: str
    text: str
    strict: bool
    seconds: float

    @property
    def is_wrong(self) -> bool:
        """Whether this must not be."""
        return self.kind in ("FALSE", "UNTYPED", "HANG")


@contextmanager
def alarm(seconds: int) -> Iterator[None]:
    """Raise `Hang` after some seconds of this process's own time."""

    def ring(*_: Any) -> None:
        raise Hang

    before = signal.signal(signal.SIGPROF, ring)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def end_of(
    words: Generated, *, max_evaluations: int = 60, per_interval: int = 100, patience: int = 60
) -> End:
    """Plan a generated problem, and judge."""
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        try:
            with alarm(patience):
                plan = _planned(words, Path(folder), max_evaluations)
        except sm.SelfmotionError as error:
            text = f"{type(error).__name__}: {error}"
            return End("refused", text, False, time.perf_counter() - began)
        except Hang:
            where = traceback.format_exc()[-1500:]
            return End("HANG", f"no end after {patience} s: {where}", False, patience)
        except Exception:
            text = traceback.format_exc()
            return End("UNTYPED", text[-1500:], False, time.perf_counter() - began)
        seconds = time.perf_counter() - began
        found = Judge.of(plan, per_interval).judge(plan.trajectory)
    verdict = plan.certificate.verdict
    if plan.certificate.verified and found.refutes:
        return End("FALSE", f"{verdict} | {'; '.join(found.refutes)}", False, seconds)
    kind = "verified" if plan.certificate.verified else "not verified"
    strict = kind == "not verified" and found.valid()
    return End(kind, verdict, strict, seconds)


def _planned(words: Generated, folder: Path, max_evaluations: int) -> sm.Plan:
    problem = build(words, folder)
    search = None
    if problem.given_start is None:
        search = sm.Search(starts=4, finalists=1, mode="local")
    return sm.plan(problem, search=search, max_evaluations=max_evaluations)
