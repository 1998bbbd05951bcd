"""A motion of nodes: what is let go of is the same when it is asked for again."""

import numpy as np

import selfmotion as sm
from support.arms import Case
from support.nodes import nodes_of, problem_of


def test_what_is_forgotten_is_the_same_again(case: Case) -> None:
    limits = (sm.JointPositionLimits(-9.0, 9.0), sm.JointAccelerationLimits(50.0))
    motion = nodes_of(problem_of(case, constraints=limits))

    def known() -> list[np.ndarray]:
        return [
            motion.h,
            motion.samples.checked.qdd,
            motion.samples.qddd,
            motion.exact.q,
            np.array([motion.exact_cost, motion.cost, motion.aim]),
            motion.broken(),
        ]

    before = known()
    motion.forget()
    kept = {*motion.__dict__, *motion.samples.__dict__}
    assert not kept & {"exact", "h", "partials", "checked", "qdd", "qddd"}
    for again, once in zip(known(), before, strict=True):
        np.testing.assert_array_equal(again, once)
