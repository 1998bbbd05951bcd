"""What happens on the way to an optimum: iterations, the best motion so far, and when to stop."""

from selfmotion.planning.nodes import NodeMotion, Step
from selfmotion.planning.optimise import Iteration, Status
from selfmotion.planning.planner.effort import Effort
from selfmotion.planning.planner.outcomes import NodeOutcome, is_kept, on_the_way


class Recorder:
    """Notes iterations, and keeps the best motion of those that satisfy all conditions.

    Parameters
    ----------
    effort : Effort

    Attributes
    ----------
    history : list of Iteration
    latest : NodeOutcome or None
        The best motion on the way that satisfies the conditions: what an interruption leaves.
    ended : Status or None
        What ended the optimisation from outside.
    """

    def __init__(self, effort: Effort) -> None:
        self._effort, self._first = effort, effort.counts.evaluations
        self.history: list[Iteration] = []
        self.latest: NodeOutcome | None = None
        self.ended: Status | None = None

    def report(self, step: Step) -> bool:
        """Note an iteration, and the motion if it satisfies all; return whether to stop."""
        if is_kept(step.motion) and self._is_better(step.motion):
            self.latest = on_the_way(step.motion)
        return self.note(step)

    def _is_better(self, motion: NodeMotion) -> bool:
        """Whether a motion costs less than the last one, or is known at more nodes."""
        if self.latest is None:
            return True
        last = self.latest.motion
        return len(motion.grid.t) > len(last.grid.t) or motion.objective < last.objective

    def note(self, step: Step) -> bool:
        """Note an iteration; return whether to stop."""
        effort, motion = self._effort, step.motion
        iteration = Iteration(
            x=motion.nu.ravel(),
            cost=motion.cost,
            gradient_norm=step.slope,
            update="newton",
            step=step.length,
            evaluations=effort.counts.evaluations,
        )
        self.history.append(iteration)
        # The callback that has stopped it is not called again.
        callback = effort.callback if self.ended is None else None
        if callback is not None and callback(iteration):
            self.ended = Status.STOPPED
        most = effort.max_evaluations
        if most is not None and effort.counts.evaluations >= self._first + most:
            self.ended = Status.MAX_EVALUATIONS
        return self.ended is not None
