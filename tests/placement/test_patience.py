"""A place is given up in time, and Ctrl-C is not taken for that."""

import signal
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.work.placement import places
from support.arms import robot_named

# Without the present place, which is planned at leisure, and with it.
WITHIN, WITH_HERE = {"x": (0.01, 0.1)}, {"x": (-0.1, 0.1)}
_real = places.plan


@pytest.fixture(autouse=True)
def python_handler() -> Iterator[None]:
    """Workers of a parallel test run ignore Ctrl-C; a program has Python's own handler."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def seam() -> sm.Problem:
    robot = robot_named("planar_3r")
    pose = robot.pose(np.array([0.4, 0.9, 0.6]))
    end = pose.copy()
    end.translation = pose.translation + np.array([-0.3, 0.2, 0.0])
    return sm.Problem(robot, sm.paths.Line(pose, end, 2.0), "planar")


def pressed_at(stage: int) -> Any:
    """Return `plan`, in which Ctrl-C is pressed when so many stages have begun."""

    def plan(problem: sm.Problem, *, progress: Any = lambda *_: None, **options: Any) -> sm.Plan:
        count = 0

        def told(*stages: Any) -> None:
            nonlocal count
            count += 1
            if count == stage:
                signal.raise_signal(signal.SIGINT)
            progress(*stages)

        return _real(problem, progress=told, **options)

    return plan


def test_no_time_is_no_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where it is over before there is a motion, as when kernels are compiled."""
    monkeypatch.setattr(places, "_PATIENCE", 0.0)
    with pytest.raises(sm.errors.PlanError, match="by the processor's time"):
        sm.place(seam(), WITHIN)


@pytest.mark.parametrize("within", [WITHIN, WITH_HERE])
@pytest.mark.parametrize(("stage", "patience"), [(1, 0.0), (1, 100.0), (3, 100.0)])
def test_ctrl_c_ends_a_search_for_places(
    monkeypatch: pytest.MonkeyPatch, stage: int, patience: float, within: dict[str, Any]
) -> None:
    """Early, where there is no motion yet, and late, where one is, whether time is over or not."""
    monkeypatch.setattr(places, "_PATIENCE", patience)
    monkeypatch.setattr(places, "plan", pressed_at(stage))
    with pytest.raises(KeyboardInterrupt):
        sm.place(seam(), within)


def test_ctrl_c_ends_a_correction(monkeypatch: pytest.MonkeyPatch) -> None:
    plan = sm.plan(seam())
    monkeypatch.setattr(places, "plan", pressed_at(2))
    with pytest.raises(KeyboardInterrupt):
        sm.correction(plan)
