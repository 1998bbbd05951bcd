"""Segments end at rest and keep clear of bodies: proved before they are issued."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.model.collision import ClearanceModel
from selfmotion.realtime import Flag
from selfmotion.realtime.distance_proof import DistanceProof
from selfmotion.realtime.moving_clearance import MovingClearance
from selfmotion.realtime.settings import NEARER
from support.arms import PANDA_HOME, robot_named
from support.realtime_bodies import (
    FAR,
    PER_CYCLE,
    ROUNDED,
    SAME,
    ball_at,
    between_cycles,
    changed_rests,
    is_rest,
    judged,
    limits_exceeded,
    looped,
    run,
)


@pytest.mark.parametrize("seed", range(4))
def test_what_is_issued_keeps_its_distance_to_its_rest(seed: int) -> None:
    replanner = looped()
    found = run(replanner, seed)
    assert max(judged(found)) <= 0.0
    assert limits_exceeded(replanner, found) <= ROUNDED
    # What is not proved is the rest of the one before: the same commands, a period later.
    assert changed_rests(found) <= SAME
    assert all(item.flag is Flag.STOPPING for item, _ in found if is_rest(item))


def test_the_judges_of_segments_reject_what_is_broken() -> None:
    replanner = looped()
    found = run(replanner, 0)
    segment, place = max(found, key=lambda each: np.ptp(each[0].q, axis=0).max())
    faster = replace(segment, qd=50.0 * segment.qd)
    assert limits_exceeded(replanner, [(faster, place)]) > 1.0
    # A ball right ahead of where the tool comes to rest.
    begins, ends = (robot_named("panda").pose(segment.q[k]).translation for k in (0, -1))
    ahead = ends + 0.05 * (ends - begins) / np.linalg.norm(ends - begins)
    assert max(judged([(segment, ahead)])) > 0.0
    stale = replace(segment, q=segment.q + 1e-3, reasons=("not proved",))
    assert changed_rests([(segment, place), (stale, place)]) > SAME


@pytest.mark.site
@pytest.mark.parametrize("is_proved", [True, False])
def test_the_proof_alone_stops_the_arm(monkeypatch: pytest.MonkeyPatch, *, is_proved: bool) -> None:
    """Plans that see no body: with the proof no segment comes too near, without it some do."""

    def none(self: MovingClearance, samples: object, by_q: Array) -> tuple[Array, Array]:
        self.blocked = False
        return np.zeros((0, by_q.shape[2])), np.zeros(0)

    monkeypatch.setattr(MovingClearance, "rows", none)
    if not is_proved:
        monkeypatch.setattr(MovingClearance, "proof_failure", lambda *_: "")
    worst = max(max(judged(run(looped(), seed, 100))) for seed in range(4))
    assert worst <= 0.0 if is_proved else worst > 0.0


def test_of_several_clearances_each_has_its_own_distance(panda: sm.RobotModel) -> None:
    """And each pair of links is looked at once, with the largest."""
    far, beside = (sm.obstacles.Sphere(name, np.zeros(3), 0.05) for name in ("far", "beside"))
    models = [sm.obstacles.CollisionModel(panda, [ball]) for ball in (far, beside)]
    around = MovingClearance(panda, [(models[0], 0.1), (models[1], 0.02)])
    pairs = [(set(pair), proof.min_distance) for proof in around._proofs for pair in proof.pairs]
    assert {distance for pair, distance in pairs if "far" in pair} == {0.1}
    assert {distance for pair, distance in pairs if "beside" in pair} == {0.02}
    links = [(frozenset(pair), d) for pair, d in pairs if not pair & {"far", "beside"}]
    assert links
    assert {distance for _, distance in links} == {0.1}
    # Of a link with several bodies a pair of names appears repeatedly, in one model alone.
    assert len(links) == sum(not {"far", "beside"} & set(pair) for pair in models[0].pairs)


def test_path_lengths_are_bounds() -> None:
    segment = run(looped(), 1, 12)[-1][0]
    dense = between_cycles(segment)
    lengths = np.cumsum(np.abs(np.diff(dense, axis=0)), axis=0)[PER_CYCLE - 1 :: PER_CYCLE]
    bounds = segment.travelled[1 : len(lengths) + 1]
    assert np.all(lengths <= bounds + 1e-12)
    assert np.all(bounds[-1] <= 1.2 * lengths[-1] + 1e-3)


def test_a_motion_through_a_body_between_cycles_is_not_proved(panda: sm.RobotModel) -> None:
    """At the first and the last configuration all is far; only the bound between them tells."""
    turns = np.stack([PANDA_HOME] * 3)
    turns[:, 0] += [0.0, 0.6, 1.2]
    ball = ball_at(panda.pose(turns[1]).translation, 0.02)
    model = sm.obstacles.CollisionModel(panda, [ball])
    around = MovingClearance(panda, [(model, FAR)])
    q, times = turns[[0, 2]], np.array([0.0, 1e-3])
    assert min(model.distance(each).value for each in q) > FAR
    travelled = np.stack([np.zeros(7), np.abs(q[1] - q[0])])
    assert "not proved" in around.proof_failure(q, travelled, times)
    assert around.proof_failure(q[[0, 0]], np.zeros((2, 7)), times) == ""
    # A path length that is no number proves nothing.
    assert "not proved" in around.proof_failure(q[[0, 0]], np.full((2, 7), np.nan), times)


def test_pairs_whose_hulls_always_overlap_are_proved_by_their_meshes() -> None:
    """Plans leave them out: without the proof nothing would keep them apart."""
    robot = robot_named("ur5")
    exact = sm.obstacles.CollisionModel(robot, ())
    meshes = ClearanceModel(exact).of_left_out()
    assert meshes.pairs
    drawn = np.random.default_rng(0).uniform(-np.pi, np.pi, (60, 6))
    each = np.array([meshes.distance(q).value for q in drawn])
    away, near = drawn[int(np.argmax(each))], drawn[int(np.argmin(each))]
    others = [pair for pair in exact.pairs if pair not in meshes.pairs]
    alone = sm.obstacles.CollisionModel(robot, (), others)
    around = MovingClearance(robot, [(alone, 0.5 * float(each.max() + each.min()))])
    times = np.array([0.0, 1.0])
    assert around.proof_failure(np.stack([away, away]), np.zeros((2, 6)), times) == ""
    travelled = np.stack([np.zeros(6), np.abs(near - away)])
    assert "not proved" in around.proof_failure(np.stack([away, near]), travelled, times)


def test_a_body_on_a_link_that_moves_there_lengthens_levers(panda: sm.RobotModel) -> None:
    frame = "panda_hand_tcp"
    torch = sm.obstacles.Cylinder("torch", np.zeros(3), 0.01, 0.2, frame=frame)
    model = ClearanceModel(sm.obstacles.CollisionModel(panda, [torch]), 0.02)
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (500, 3)) * [0.01, 0.01, 0.1]
    turn = pin.exp3(np.array([0.4, -0.2, 0.9]))
    moved = pin.SE3(turn, np.array([0.02, 0.0, -0.05]))
    most = max(float(np.linalg.norm(moved.act(point) - point)) for point in points)
    assert most <= model.displacement("torch", moved) <= 3.0 * most


def next_required(proof: DistanceProof, distances: Array) -> Array:
    """Return what pairs keep during a segment that begins at these distances."""
    proof.raise_floor(distances)
    return proof.required(distances)


def test_what_one_segment_may_give_away_is_not_given_away_again() -> None:
    """Segment after segment, each to where it may go: however many, no nearer than by that once."""
    pairs = ("link", "ball"), ("link", "post")
    proof = DistanceProof(lambda q, selected: q, pairs, FAR, np.ones((2, 1)), 4, reuses=False)
    now = np.array([FAR + 0.5 * NEARER, 0.4 * FAR])
    for _ in range(200):
        now = next_required(proof, now)
    np.testing.assert_allclose(now, [FAR - NEARER, 0.4 * FAR - NEARER], rtol=0.0, atol=1e-12)
    # What has got away has to stay away.
    assert next_required(proof, np.array([FAR, 0.8 * FAR]))[1] == pytest.approx(0.8 * FAR - NEARER)
    # Of an arm that was pushed nearer, or a body that was told to be: nearer no more, or anew.
    pushed = next_required(proof, np.array([FAR - 1.5 * NEARER, 0.1 * FAR]))
    np.testing.assert_allclose(pushed, [FAR - 1.5 * NEARER, 0.1 * FAR - NEARER])
    # By what a body comes nearer, or leaves, the arm neither loses nor gains room.
    floor = next_required(proof, pushed)
    proof.shift_floor(np.array([-2e-4, 0.0]))
    np.testing.assert_allclose(next_required(proof, floor - [2e-4, 0.0]), floor - [2e-4, 0.0])
    proof.forget()
    assert next_required(proof, np.array([0.5 * FAR, FAR]))[0] == pytest.approx(0.5 * FAR - NEARER)


@pytest.mark.parametrize("jitter", [0.0, 1e-5, 3e-4, 2e-3])
def test_bodies_that_jitter_give_nothing_away(panda: sm.RobotModel, jitter: float) -> None:
    """As poses of a camera do at each step: the arm, as near as it may, comes nearer only once."""
    far, most = 0.02, 5e-3
    place = panda.pose(PANDA_HOME).act(np.array([0.0, 0.0, 0.04]))
    model = sm.obstacles.CollisionModel(panda, [ball_at(place, 0.03)])
    around = MovingClearance(panda, [(model, far)])
    (proof,) = around._proofs
    near = proof.distances(PANDA_HOME) < far - most
    assert near.any()
    rng = np.random.default_rng(0)
    came = np.zeros(len(proof.pairs))
    for _ in range(100):
        off = rng.normal(0.0, jitter, 3)
        off *= min(1.0, most / max(float(np.linalg.norm(off)), most))
        around.move({"ball": pin.SE3(np.eye(3), place + off)}, PANDA_HOME)
        there = proof.distances(PANDA_HOME)
        came = there - next_required(proof, there - came)
        assert came[near].max() <= NEARER + ROUNDED
    assert came[near].max() == pytest.approx(NEARER)
