"""Chains moved to where they are shortest: on the path, within all that they kept, at a minimum."""

from collections.abc import Callable

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.model.follow import Follows
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.search import shortest
from selfmotion.planning.search.manifold import OnPath
from selfmotion.planning.search.measures import JointTravel, RunningCost
from selfmotion.planning.search.search_bounds import SearchBounds
from selfmotion.planning.search.shortest import Shortest, improved_by
from support.arms import robot_named
from support.paths import line_of

COUNT = 41
# Newton's method ends at the square of this; what moving aside may still gain of a length at the
# last δ, a tenth of the mean step.
ON_PATH, GAIN = 1e-9, 5e-3


class Chain:
    """A jagged chain of an arm whose tool goes along a line."""

    def __init__(self, name: str, task: str = "position") -> None:
        self.robot = robot = robot_named(name)
        self.path = line_of(robot, task)
        self.t = np.linspace(0.0, self.path.duration, COUNT)
        follows = Follows.of(robot, self.path, task)
        self.waypoints = OnPath(follows, self.t, robot.lower, robot.upper)
        q = np.array(robot.inverse_kinematics(self.path.pose(0.0), task=task))[None]
        rng, found = np.random.default_rng(0), []
        for i in range(COUNT):
            guess = q + rng.normal(scale=0.05, size=q.shape)
            q, arrived = self.waypoints.project(guess, i, far=True)
            assert arrived.all()
            found.append(q[0])
        self.q = np.array(found)

    def kept(self, *bodies: tuple[sm.obstacles.CollisionModel, float]) -> SearchBounds:
        """Return what its configurations have to keep."""
        return SearchBounds(self.robot.lower, self.robot.upper, self.robot.is_revolute, bodies)

    def shortest(self, kept: SearchBounds) -> Array:
        """Return what comes of it."""
        steps = np.full((COUNT - 1, self.robot.dof), 0.5)
        return Shortest(self.waypoints, kept, steps, self.robot.joint_weights).near(self.q)

    def length(self, q: Array) -> float:
        return float((np.abs(np.diff(q, axis=0)) * self.robot.joint_weights).sum())


@pytest.mark.parametrize("name", ["panda", "xarm7", "ur5"])
def test_chains_become_shorter_on_their_path_until_nothing_shortens_them(name: str) -> None:
    chain = Chain(name)
    shorter = chain.shortest(chain.kept())
    assert chain.length(shorter) < 0.7 * chain.length(chain.q)
    for t, q in zip(chain.t, shorter, strict=True):
        pose = chain.path.pose(float(t))
        assert max(sm.Task.POSITION.miss(pose, chain.robot.pose(q))) < ON_PATH
    assert chain.kept().is_admissible(shorter).all()
    # Wherever it is pushed along the self-motion, all of it or a stretch, that is no gain.
    rng, bases = np.random.default_rng(1), chain.waypoints.bases(shorter)
    every = np.arange(COUNT)
    for _ in range(40):
        first, last = np.sort(rng.integers(0, COUNT, 2))
        z = rng.normal(size=bases.shape[2]) * rng.choice([1e-2, 1e-3])
        away = np.zeros_like(shorter)
        away[first : last + 1] = bases[first : last + 1] @ z
        moved, arrived = chain.waypoints.project_each(shorter + away, every)
        assert arrived.all()
        assert chain.length(moved) > (1.0 - GAIN) * chain.length(shorter)


def test_it_goes_round_what_the_chain_kept_clear_of() -> None:
    chain = Chain("panda")
    free = chain.shortest(chain.kept())
    elbow = chain.robot.chain_to("panda_link4", None)
    apart = [elbow.place(q).translation for q in (chain.q[COUNT // 2], free[COUNT // 2])]
    away = (apart[1] - apart[0]) / np.linalg.norm(apart[1] - apart[0])
    model = sm.obstacles.CollisionModel(
        chain.robot, [sm.obstacles.Sphere("ball", apart[1] + 0.13 * away, 0.05)]
    )
    kept = chain.kept((model, 1e-3))
    # A ball that the shortest chain of all meets, and the given one does not.
    assert kept.is_admissible(chain.q).all()
    assert not kept.is_admissible(free).all()
    shorter = chain.shortest(kept)
    assert kept.is_admissible(shorter).all()
    assert chain.length(shorter) < 0.8 * chain.length(chain.q)


def best_of(chain: Chain, measure: JointTravel | RunningCost) -> Callable[[Array, bool], Array]:
    steps = np.full((COUNT - 1, chain.robot.dof), 0.5)
    return improved_by(chain.waypoints, chain.kept(), steps, measure)


@pytest.mark.parametrize(("name", "task"), [("panda", "position"), ("panda", "pose")])
def test_along_curves_samples_lead_on_from_what_moving_aside_finds(name: str, task: str) -> None:
    """With more freedom they are too many: what moves aside is the last word, as it is roughly."""
    chain = Chain(name, task)
    measure = JointTravel(chain.robot.joint_weights)
    better = best_of(chain, measure)
    aside, whole = chain.shortest(chain.kept()), better(chain.q, False)
    if chain.waypoints.redundancy > 1:
        np.testing.assert_array_equal(whole, aside)
    else:
        assert chain.length(whole) < chain.length(aside)
    assert chain.length(whole) <= chain.length(better(chain.q, True)) < chain.length(chain.q)


def test_what_costs_more_than_its_length_becomes_cheaper() -> None:
    chain = Chain("panda", "pose")
    costs = [sm.costs.JointVelocity(), sm.costs.InverseManipulability(1e-3)]
    problem = sm.Problem(chain.robot, chain.path, costs=costs, clearance=None)
    measure = RunningCost.of(Formulation.of(problem), chain.t)
    found = best_of(chain, measure)(chain.q, False)
    assert measure.cost_of(found) < 0.9 * measure.cost_of(chain.q)
    assert chain.kept().is_admissible(found).all()
    # Samples around it hold nothing that is much cheaper: rounds end where they gain no more.
    ring = shortest._ROUGH_RINGS[-1]
    steps = np.full((COUNT - 1, chain.robot.dof), 0.5)
    again = shortest._cheaper(
        chain.waypoints, chain.kept(), steps, measure, found, (ring,), shortest._ROUGH_SIDE
    )
    gain = 1.0 - measure.cost_of(again) / measure.cost_of(found)
    assert 0.0 <= gain <= 2.0 * shortest._GAIN
