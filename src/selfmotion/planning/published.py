"""The published method from one start: minimised, and on grids that are fine enough."""

from dataclasses import replace

import numpy as np

from selfmotion.optimise import Iteration
from selfmotion.planning.settings import COST_AGREEMENT
from selfmotion.planning.standing import PaperMotion


def minimised(found: PaperMotion, history: list[Iteration]) -> PaperMotion:
    effort, before = found.beginning.effort, found.minimum
    most = effort.max_evaluations
    minimum = effort.optimizer.minimize(
        found.objective,
        found.x,
        None if before is None else before.inverse_hessian,
        max_evaluations=None if most is None else effort.counts.evaluations + most,
        callback=effort.callback,
    )
    history += minimum.history
    return replace(found, minimum=minimum, x=np.array(minimum.x))


def settled(found: PaperMotion, history: list[Iteration]) -> PaperMotion:
    while found.steps < found.beginning.most_steps:
        before = found.cost
        found = minimised(found.refined(), history)
        if abs(found.cost - before) <= COST_AGREEMENT * abs(before):
            break
    return found
