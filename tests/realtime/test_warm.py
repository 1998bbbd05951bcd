"""After warming up nothing is compiled and no memory grows."""

import gc
import sys
import tracemalloc

import numpy as np
from numba.core import event

import selfmotion as sm
from selfmotion import realtime
from selfmotion.realtime import Replanner
from selfmotion.warm import Compiled
from support.arms import PANDA_HOME
from support.loops import closed_loop

# Around the loop.


def test_after_warming_up_nothing_is_compiled_and_no_memory_grows(
    panda: sm.RobotModel, slow_circle: sm.paths.Circle
) -> None:
    replanner = Replanner(panda, "position")
    realtime.warm_up(replanner)
    listener = Compiled()
    with event.install_listener("numba:compile", listener):
        segments, _ = closed_loop(replanner, slow_circle, PANDA_HOME, 0.3)
        del segments
        tracemalloc.start()
        try:
            t, q, sizes = 0.3, PANDA_HOME, []
            for k in range(400):
                segment = replanner.step(t, q, np.zeros(7), slow_circle)
                t += replanner.period
                q = segment.q[segment.index(t)]
                if k % 100 == 99:
                    gc.collect()
                    sizes.append(tracemalloc.get_traced_memory()[0])
        finally:
            tracemalloc.stop()
    assert listener.count == 0
    # Less is left behind than the smallest of a step's arrays would be; before, free lists fill.
    assert sizes[-1] - sizes[1] < 200 * sys.getsizeof(np.zeros(7))
