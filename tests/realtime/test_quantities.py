"""Quantities within limits while the arm moves: rows of the plan, and a proof of each segment."""

import functools
from dataclasses import replace

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.certificate import Quantity
from selfmotion.realtime import Flag, Replanner
from selfmotion.realtime.quantities import Quantities, _Groups, _Proof
from selfmotion.realtime.settings import QUANTITY_BEYOND, STRIDE
from support.arms import PANDA_HOME, robot_named
from support.loops import closed_loop
from support.realtime_bodies import PER_CYCLE, motion_between_cycles
from support.realtime_quantities import KINDS, exceeded, faults, is_rest, looped, run

# Shares of limits that are used where a limit decides: plans leave 5 % unused.
BINDING = 0.9
# What the tool is off its path by, while a limit holds only the self-motion back [m].
ON_PATH = 2e-4


# Taking seconds each: the elbow's is the slowest quantity.
ALL = pytest.param(tuple(KINDS), marks=pytest.mark.site)
ELBOW = pytest.param("elbow", marks=pytest.mark.site)
QUICK = [kind for kind in KINDS if kind != "elbow"]


@pytest.mark.parametrize("kinds", [*((kind,) for kind in KINDS), ALL])
def test_what_is_issued_keeps_its_quantities_to_its_rest(kinds: tuple[str, ...]) -> None:
    assert faults(0, kinds, looped(*kinds)) == []


@pytest.mark.parametrize("kind", [*QUICK, ELBOW])
def test_the_judges_of_segments_reject_what_is_broken(kind: str) -> None:
    """Without the constraint the same tool motions break it; so the judges see it."""
    assert exceeded(kind, free_segments()) > 0.0


@functools.cache
def free_segments() -> list[sm.realtime.Segment]:
    """Return what a loop without constraints does along three tool motions."""
    free = Replanner(robot_named("panda"), "position")
    return [segment for seed in range(3) for segment in run(free, seed, 100)]


@pytest.mark.parametrize("kind", ["torque", "tilt", ELBOW])
def test_the_proof_alone_stops_the_arm(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Plans that see no quantity: with the proof no segment breaks a limit."""

    def none(
        self: Quantities, samples: object, by_q: Array, by_qd: Array, own: int
    ) -> tuple[Array, Array]:
        return np.zeros((0, by_q.shape[2])), np.zeros(0)

    monkeypatch.setattr(Quantities, "rows", none)
    found = [segment for seed in range(3) for segment in run(looped(kind), seed, 100)]
    assert exceeded(kind, found) <= 0.0
    assert any(is_rest(segment) and segment.flag is Flag.STOPPING for segment in found)


@pytest.fixture(scope="module")
def circle() -> sm.paths.Circle:
    home = robot_named("panda").pose(PANDA_HOME)
    return sm.paths.Circle.around(home, 0.1, 4.0, normal=(1.0, 0.0, 0.0))


@pytest.fixture(scope="module")
def free_along_circle(circle: sm.paths.Circle) -> list[sm.realtime.Segment]:
    """Segments of a closed loop without constraints."""
    free = Replanner(robot_named("panda"), "position")
    return closed_loop(free, circle, PANDA_HOME, 3.0)[0]


@pytest.mark.parametrize(
    ("constraint", "label"),
    [
        (sm.constraints.Tilt("panda_hand_tcp", within=0.2), "tilt"),
        (sm.constraints.Band.of_elbow("up", 0.1), "swivel"),
        (sm.constraints.JointTorqueLimits([20.0, 40.0, 20.0, 24.0, 3.0, 3.0, 3.0]), "torque"),
        (sm.constraints.Band(sm.robot.FrameCoordinate("panda_link4"), 0.61, 0.01), "height"),
    ],
)
def test_the_self_motion_keeps_a_quantity_and_the_tool_stays_on_its_path(
    panda: sm.RobotModel,
    circle: sm.paths.Circle,
    free_along_circle: list[sm.realtime.Segment],
    constraint: sm.constraints.Constraint,
    label: str,
) -> None:
    """Of least joint speed alone it would be exceeded; then it binds, and the path is followed."""
    quantity, worst = constraint.quantity(panda), []
    bound = Replanner(panda, "position", constraints=[constraint])
    for segments in (free_along_circle, closed_loop(bound, circle, PANDA_HOME, 3.0)[0]):
        worst.append(max(largest_share(quantity, segment) for segment in segments))
        assert max(segment.tool_error[0] for segment in segments) < ON_PATH
        assert all(segment.flag is Flag.PLANNED for segment in segments)
    assert BINDING < worst[1] <= 1.0 < worst[0], label


def largest_share(quantity: Quantity, segment: sm.realtime.Segment) -> float:
    return float(shares_between_cycles(quantity, segment).max())


@pytest.mark.parametrize("kind", KINDS)
def test_bounds_between_measurements_are_bounds(kind: str) -> None:
    """Of segments with jumps of the jerk, at four times per cycle."""
    robot = robot_named("panda")
    quantity = KINDS[kind][0]().quantity(robot)
    anywhere = _Groups(robot, 1e-3, np.full((3, 7, 1), 1e3), np.full((3, 1, 7), np.nan))
    proof = _Proof(quantity, anywhere)
    steps = proof._steps[0]
    for segment in run(Replanner(robot, "position"), 1, 60)[::5]:
        groups, shares = _Groups.of_segment(robot, segment, np.zeros(7)), proof._shares
        values = shares.values(groups, np.linspace(-1.0, 1.0, steps + 1))
        bound = shares.sizes(values, groups).max(axis=1) + proof._between(groups) / steps**2
        sizes = shares_between_cycles(quantity, segment)
        each = PER_CYCLE * STRIDE
        for row, most in enumerate(bound):
            assert np.all(sizes[row * each : (row + 1) * each] <= most + 1e-12)


def shares_between_cycles(quantity: Quantity, segment: sm.realtime.Segment) -> Array:
    away = quantity.away(*motion_between_cycles(segment))[:, quantity.limited]
    sizes = np.abs(away) if away.ndim == 2 else np.linalg.norm(away, axis=2)
    return np.asarray(sizes / quantity.bounds[quantity.limited])


def test_what_is_exceeded_at_first_does_not_grow(panda: sm.RobotModel) -> None:
    anywhere = _Groups(panda, 1e-3, np.ones((3, 7, 1)), np.full((3, 1, 7), np.nan))
    band = sm.constraints.Band(sm.robot.JointCoordinate("panda_joint2"), 0.0, 0.1)
    proof = _Proof(band.quantity(panda), anywhere)
    now = np.array([1.3])
    for _ in range(100):
        now = proof.allowed(now)
    np.testing.assert_allclose(now, 1.3 + QUANTITY_BEYOND)
    # What has come back has to stay there; pushed farther, it begins anew.
    assert proof.allowed(np.array([1.1]))[0] == pytest.approx(1.1 + QUANTITY_BEYOND)
    assert proof.allowed(np.array([1.2]))[0] == pytest.approx(1.2 + QUANTITY_BEYOND)
    assert proof.allowed(np.array([0.5]))[0] == pytest.approx(1.0)


def test_an_arm_outside_of_a_band_comes_back(panda: sm.RobotModel) -> None:
    """It holds no segment back that it is exceeded at first."""
    band = sm.constraints.Band(sm.robot.JointCoordinate("panda_joint1"), 0.4, 0.2)
    path = sm.paths.Dwell(panda.pose(PANDA_HOME), 4.0)
    segments, places = closed_loop(
        Replanner(panda, "position", constraints=[band]), path, PANDA_HOME, 3.0
    )
    assert abs(PANDA_HOME[0] - 0.4) > 0.2 >= abs(places[-1][0] - 0.4)
    assert max(segment.tool_error[0] for segment in segments) < ON_PATH


def test_a_quantity_without_bounds_is_measured_at_each_cycle(panda: sm.RobotModel) -> None:
    class Squared(sm.constraints.Constraint):
        def quantity(self, robot: sm.RobotModel) -> Quantity:
            return Quantity.between(
                "q₁²", -0.5, 0.01, lambda q, *_: q[:, 0] ** 2,
                lambda q, *_: (2.0 * q * np.eye(7)[0],),
            )  # fmt: skip

    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    worst = []
    for asked in ([], [Squared()]):
        replanner = Replanner(panda, "position", constraints=asked)
        segments, _ = closed_loop(replanner, path, PANDA_HOME, 3.0)
        worst.append(max(float(np.abs(segment.q[:, 0]).max()) for segment in segments))
    assert worst[1] ** 2 <= 0.01 < worst[0] ** 2


def test_gentler_braking_keeps_torques_that_the_hardest_would_not(panda: sm.RobotModel) -> None:
    limits = np.array([10.0, 25.0, 14.0, 34.0, 1.7, 3.5, 1.0])
    torques = sm.constraints.JointTorqueLimits(limits)
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.1, 2.0, normal=(1.0, 0.0, 0.0))
    quantity, found = torques.quantity(panda), []
    for asked in ([], [torques]):
        replanner = Replanner(panda, "position", constraints=asked)
        segments, _ = closed_loop(replanner, path, PANDA_HOME, 2.0)
        assert all(segment.flag is Flag.PLANNED for segment in segments)
        found.append(segments)
    worst = [max(largest_share(quantity, one) for one in segments) for segments in found]
    assert worst[1] <= 1.0 < worst[0]
    longest = [max(len(segment.t) for segment in segments) for segments in found]
    assert longest[1] > longest[0]


def test_a_segment_that_is_faster_is_not_proved() -> None:
    replanner = looped("torque")
    path = sm.paths.Circle.around(replanner.robot.pose(PANDA_HOME), 0.1, 4.0, normal=(1, 0, 0))
    segment = closed_loop(replanner, path, PANDA_HOME, 1.0)[0][-1]
    assert replanner._quantities is not None
    assert replanner._quantities.unproved(segment, np.zeros(7)) is None
    for broken in (
        replace(segment, qdd=30.0 * segment.qdd),
        replace(segment, qd=np.full_like(segment.qd, np.nan)),
    ):
        found = replanner._quantities.unproved(broken, np.zeros(7))
        assert found is not None
        assert "not proved" in found.reason
