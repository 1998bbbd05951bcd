"""The loop reads until there is no state."""

import gc
import sys
import tracemalloc

import numpy as np
import pytest
from numba.core import event

import selfmotion as sm
from selfmotion import realtime
from selfmotion.realtime import Replanner, Segment, SimulatedArm, State
from selfmotion.realtime.warm import CompilationCounter
from support import realtime_scenarios as scenarios
from support.arms import PANDA_HOME
from support.loops import closed_loop
from support.realtime_quantities import KINDS, looped


def test_the_loop_reads_until_there_is_no_state(
    panda: sm.RobotModel, slow_circle: sm.paths.Circle
) -> None:
    replanner = Replanner(panda)
    arm, written = SimulatedArm(PANDA_HOME, replanner.cycle), []

    def read() -> State | None:
        return State(arm.t, *arm.measure(), slow_circle) if len(written) < 5 else None

    def write(segment: Segment) -> None:
        written.append(segment)
        arm.write(segment)
        arm.run(replanner.period)

    assert realtime.follow(replanner, read, write) == 5
    assert [item.t[0] for item in written] == pytest.approx([0.0, 0.01, 0.02, 0.03, 0.04])
    with pytest.raises(sm.errors.ProblemError, match="expected State or None"):
        realtime.follow(replanner, lambda: 1, write)  # type: ignore[arg-type, return-value]


# Closed loops with a simulated arm keep all laws.


@pytest.mark.parametrize("seed", range(12))
def test_random_scenarios_keep_all_laws(panda: sm.RobotModel, seed: int) -> None:
    task = ("pose", "position", "pointing")[seed % 3]
    outcome = scenarios.run(seed, task, panda, Replanner(panda, task))
    assert outcome.faults == []


def test_the_judge_of_scenarios_rejects_a_jump_and_a_broken_limit(
    panda: sm.RobotModel, slow_circle: sm.paths.Circle
) -> None:
    replanner = Replanner(panda)
    arm = SimulatedArm(PANDA_HOME, replanner.cycle)
    arm.write(replanner.step(0.0, PANDA_HOME, np.zeros(7), slow_circle))
    arm.run(0.02)
    assert scenarios.limits_broken(replanner, arm) == []
    good = list(arm.commanded)
    q, qd, qdd = good[5]
    arm.commanded[5] = (q + 1e-6, qd, qdd)
    assert "a jump" in scenarios.limits_broken(replanner, arm)[0]
    arm.commanded[5] = (q, qd, 1.01 * replanner.limits[3])
    assert "acceleration beyond its limit" in scenarios.limits_broken(replanner, arm)
    arm.commanded[5] = (q, qd, qdd + 1.01 * replanner.jerk_limit * replanner.cycle)
    assert "jerk beyond its limit" in scenarios.limits_broken(replanner, arm)
    arm.commanded[5] = (np.full(7, np.nan), qd, qdd)
    assert scenarios.limits_broken(replanner, arm) == ["not finite"]


def test_a_simulated_arm_wants_a_segment() -> None:
    with pytest.raises(sm.errors.ProblemError, match="no segment"):
        SimulatedArm(PANDA_HOME, 1e-3).run(0.1)


# After warming up nothing is compiled and no memory grows.

# Around the loop.


@pytest.mark.parametrize("kinds", [(), tuple(KINDS)])
def test_after_warming_up_nothing_is_compiled_and_no_memory_grows(
    kinds: tuple[str, ...], slow_circle: sm.paths.Circle
) -> None:
    replanner = looped(*kinds)
    realtime.warm_up(replanner)
    listener = CompilationCounter()
    with event.install_listener("numba:compile", listener):
        segments, _ = closed_loop(replanner, slow_circle, PANDA_HOME, 0.3)
        del segments
        tracemalloc.start()
        try:
            t, q, sizes = 0.3, PANDA_HOME, []
            for k in range(160):
                segment = replanner.step(t, q, np.zeros(7), slow_circle)
                t += replanner.period
                q = segment.q[segment.index(t)]
                if k % 40 == 39:
                    gc.collect()
                    sizes.append(tracemalloc.get_traced_memory()[0])
        finally:
            tracemalloc.stop()
    assert listener.count == 0
    # Less is left behind than the smallest of a step's arrays would be; before, free lists fill.
    assert sizes[-1] - sizes[1] < 200 * sys.getsizeof(np.zeros(7))
