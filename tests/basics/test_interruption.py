"""Ctrl-C is obeyed between two steps of the work, wherever it came, and nothing is lost."""

import os
import signal
import threading
from collections.abc import Iterator

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import held_interruption, obey_interruption, was_interrupted

# When it comes, after the beginning [s]: within compiled code, within Python, and when all is done.
MOMENTS = (0.01, 0.1, 0.4, 1.0)


@pytest.fixture(autouse=True)
def in_the_foreground() -> Iterator[None]:
    """Shells let what they run in the background ignore Ctrl-C, this run of tests as well."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def press() -> None:
    os.kill(os.getpid(), signal.SIGINT)


def test_it_is_obeyed_where_it_is_asked_for_and_once() -> None:
    with held_interruption():
        press()
        # Python calls the handler between two instructions, at the latest here.
        assert sum(range(1000))
        with pytest.raises(KeyboardInterrupt):
            obey_interruption()
        obey_interruption()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def pressed(times: int, error: Exception | None = None) -> list[str]:
    """Return how far it comes that presses Ctrl-C so often, and then raises an error."""
    told = []
    try:
        with held_interruption():
            for _ in range(times):
                press()
                told.append("went on")
            if error is not None:
                raise error
    except (KeyboardInterrupt, sm.errors.ProblemError) as ended:
        told.append(type(ended).__name__)
    return told


def test_what_was_not_obeyed_is_so_at_the_end() -> None:
    assert pressed(1) == ["went on", "KeyboardInterrupt"]


def test_the_second_time_it_is_obeyed_at_once() -> None:
    assert pressed(2) == ["went on", "KeyboardInterrupt"]


def test_an_error_goes_before_it() -> None:
    assert pressed(1, sm.errors.ProblemError("first")) == ["went on", "ProblemError"]
    assert not was_interrupted()


def test_other_handlers_and_other_threads_are_left_alone() -> None:
    told: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, frame: told.append(number))
    try:
        with held_interruption():
            press()
        assert told == [signal.SIGINT]
    finally:
        signal.signal(signal.SIGINT, before)

    def elsewhere() -> None:
        with held_interruption():
            told.append(0)

    thread = threading.Thread(target=elsewhere)
    thread.start()
    thread.join()
    assert told == [signal.SIGINT, 0]


@pytest.mark.parametrize("moment", MOMENTS)
def test_a_search_for_the_fastest_ends_with_the_best_so_far(
    planar: sm.RobotModel, moment: float
) -> None:
    """Or without any, as an interruption does: never as a fault of a compiled call."""
    start = np.array([0.3, 0.8, 0.6])
    circle = sm.paths.Circle.around(planar.pose(start), 0.4, 2.0)
    limits = [
        sm.constraints.JointVelocityLimits(np.full(3, 2.0)),
        sm.constraints.JointAccelerationLimits(np.full(3, 8.0)),
    ]
    problem = sm.Problem(planar, circle, "planar", start, constraints=limits)
    timer = threading.Timer(moment, press)
    found = None
    try:
        timer.start()
        found = sm.fastest(problem)
        timer.cancel()
        timer.join()
    except KeyboardInterrupt:
        # Before there was anything, or after the end.
        timer.join()
    if found is not None:
        assert found.plan.certificate.verified
        assert found.status.value in ("interrupted", "converged")
        # The plan says itself that it was cut short, wherever it goes.
        assert found.plan.report.status.is_cut_short == (found.status.value == "interrupted")
