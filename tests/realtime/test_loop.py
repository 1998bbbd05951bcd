"""The loop reads until there is no state."""

import pytest

import selfmotion as sm
from selfmotion import realtime
from selfmotion.realtime import Replanner, Segment, SimulatedArm, State
from support.arms import PANDA_HOME


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
