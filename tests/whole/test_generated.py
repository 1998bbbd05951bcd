"""Generated problems end in a plan whose verdict the judge confirms, or in a typed error."""

from dataclasses import replace

import hypothesis
import numpy as np
import pytest

import selfmotion as sm
from selfmotion.planning.optimise import inverse_metric
from support import generated
from support.generated import Generated, end_of
from support.strategies import problems

# `make bench NAME=fuzz-generated` plans 5,000, with more evaluations and looking more closely.
COUNT, EVALUATIONS, PER_INTERVAL = 120, 3, 40


@hypothesis.settings(
    max_examples=COUNT,
    derandomize=True,
    database=None,
    deadline=None,
    phases=[hypothesis.Phase.explicit, hypothesis.Phase.generate],
    suppress_health_check=list(hypothesis.HealthCheck),
)
@pytest.mark.site
@hypothesis.given(problems(most_joints=6))
def test_generated_problems_end_well(words: Generated) -> None:
    end = end_of(words, max_evaluations=EVALUATIONS, per_interval=PER_INTERVAL)
    assert not end.is_wrong, (end.kind, end.text)


SIMPLE = Generated(
    joints=(("revolute", "0 0 1", ""),) * 4,
    gripper=False,
    locked=0,
    path="line",
    task="planar",
    free=False,
    constraints=(),
    obstacles=(),
    costs=(),
    null_motion="polynomial",
    relaxed="",
    damped=False,
    odd="",
    seed=1,
)


def test_what_is_wrong_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """False verdicts, untyped exceptions and hangs each have a name."""
    assert end_of(SIMPLE, max_evaluations=3).kind == "verified"
    plan = sm.plan

    def careless(problem: sm.Problem, **options: object) -> sm.Plan:
        found = plan(problem, **options)
        object.__setattr__(found.trajectory, "q", found.trajectory.q + 1e-3)
        return found

    def broken(*_: object, **__: object) -> sm.Plan:
        raise KeyError("joint")

    def endless(*_: object, **__: object) -> sm.Plan:
        while True:
            pass

    for stand_in, kind in ((careless, "FALSE"), (broken, "UNTYPED"), (endless, "HANG")):
        monkeypatch.setattr(generated.sm, "plan", stand_in)
        end = end_of(SIMPLE, max_evaluations=3, patience=1)
        assert end.kind == kind
        assert end.is_wrong


# What once ended in an exception of another's: a matrix without inverse, numbers beyond all others.
ONCE_UNTYPED = (
    replace(
        SIMPLE,
        joints=(
            ("revolute", "0 0 1", "sphere"),
            ("revolute", "0 0 1", "box"),
            ("prismatic", "0 0 1", "box"),
        ),
        gripper=True,
        path="pause",
        task="",
        free=True,
        constraints=("acceleration", "closed"),
        costs=("acceleration", "posture"),
        seed=1127,
    ),
    replace(
        SIMPLE,
        joints=(
            ("revolute", "0 1 0", "box"),
            ("revolute", "0 1 0", ""),
            ("revolute", "0 0 1", "box"),
            ("revolute", "0 0 1", ""),
        ),
        task="",
        free=True,
        obstacles=("cylinder", "mesh"),
        costs=("limits", "length"),
        null_motion="spline",
        seed=4,
    ),
)


@pytest.mark.parametrize("words", ONCE_UNTYPED)
def test_what_was_once_untyped_ends_well(words: Generated) -> None:
    end = end_of(words)
    assert not end.is_wrong, (end.kind, end.text)


def test_a_metric_beyond_all_numbers_says_nothing() -> None:
    np.testing.assert_array_equal(inverse_metric(np.full((3, 3), np.inf)), np.eye(3))
