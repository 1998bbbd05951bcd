"""Which starts lead to the best motions: rough ones, optimised a little, and the better ones more.

Successive halving (K. Jamieson, A. Talwalkar, "Non-stochastic best arm identification and
hyperparameter optimization", AISTATS 2016): the cost at x = 0 says little about that of the
optimum, and optimising from every start would take seconds.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from selfmotion.basics import Array, BreakdownError, Progress
from selfmotion.optimise import Status
from selfmotion.planning.apart import apart_of
from selfmotion.planning.beginning import Beginning
from selfmotion.planning.effort import Effort
from selfmotion.planning.promise import most_promising
from selfmotion.planning.rough import RoughMotion, rough_grid
from selfmotion.planning.session import Session
from selfmotion.planning.settings import HEATS, HOPELESS, ONE_VALLEY, SAME_OPTIMUM
from selfmotion.problem import Problem


class Heats:
    """Ranks starts by what becomes of them.

    Parameters
    ----------
    problem : Problem
    effort : Effort
    progress : Progress
    """

    def __init__(self, problem: Problem, effort: Effort, progress: Progress) -> None:
        self._problem, self._progress = problem, progress
        self._effort = replace(effort, callback=None, max_evaluations=None)
        self._apart = apart_of(problem.robot)
        self._merits: list[tuple[float, Session]] = []

    @property
    def ranked(self) -> list[RoughMotion]:
        """See `Ranking`."""
        motions = (session.rolled for _, session in self._merits)
        return [RoughMotion(one.evaluation().trajectory) for one in motions]

    def run(self, starts: Sequence[Array], finalists: int) -> bool:
        """See `Ranking`."""
        grid = rough_grid(self._problem)
        problem = self._problem.changed(null_motion=self._problem.null_motion.rough)
        first_heat = max(HEATS[0][0], finalists)
        promising = most_promising(problem, starts, grid, self._apart)[:first_heat]
        for number, start in enumerate(promising, 1):
            self._progress("start", number, len(promising))
            try:
                begun = Beginning.of(
                    problem, self._effort, start, free=True, grid=grid, is_rough=True
                )
            except BreakdownError:
                continue
            self._note(Session(begun))
        for heat, (most, evaluations) in enumerate(HEATS, 1):
            self._merits = self._foremost(max(most, finalists))
            running = [session for _, session in self._merits]
            optima: list[Array] = []
            for number, session in enumerate(running, 1):
                self._progress(f"heat {heat}", number, len(running))
                # What lies where another one has arrived would arrive there, too.
                here, first = session.rolled.nodes, heat == 1
                if first and optima and self._apart(here, np.array(optima)).min() <= ONE_VALLEY:
                    self._forget(session)
                    continue
                session.minimize(evaluations)
                if session.status is Status.INTERRUPTED:
                    raise KeyboardInterrupt
                optima.append(session.rolled.nodes)
                self._forget(session)
                self._note(session)
            self._drop()
        self._merits = self._foremost(finalists)
        return bool(self._merits)

    def _forget(self, session: Session) -> None:
        self._merits = [pair for pair in self._merits if pair[1] is not session]

    def _note(self, session: Session) -> None:
        # Known from now on, whatever interrupts.
        self._merits.append((np.inf, session))
        merit = session.merit()
        self._merits.pop()
        if np.isfinite(merit):
            self._merits.append((merit, session))
            self._merits.sort(key=lambda pair: pair[0])

    def _foremost(self, count: int) -> list[tuple[float, Session]]:
        """Return the best ones; those that take the arm into itself only where others are few."""
        if len(self._merits) <= count:
            return self._merits
        clear: list[tuple[float, Session]] = []
        met: list[tuple[float, Session]] = []
        for pair in self._merits:
            if len(clear) == count:
                break
            (clear if pair[1].rolled.keeps_off_itself else met).append(pair)
        return [*clear, *met][:count]

    def _drop(self) -> None:
        """Drop what became the same as a better one, and what costs much more than the best."""
        kept: list[tuple[float, Session]] = []
        motions: list[Array] = []
        ranked = (merit for merit, session in self._merits if session.rolled.keeps_off_itself)
        # Of what will be refused, the cost says nothing of what is wanted.
        best = next(ranked, self._merits[0][0] if self._merits else np.inf)
        for merit, session in self._merits:
            if merit > best + (HOPELESS - 1.0) * abs(best):
                break
            motion = session.rolled.nodes
            if not motions or self._apart(motion, np.array(motions)).min() > SAME_OPTIMUM:
                kept.append((merit, session))
                motions.append(motion)
        self._merits = kept
