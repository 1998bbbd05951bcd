"""Bounds of paths' derivatives hold: no interpolation misses by more than they say."""

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.model.path import Section, path_series, section_at_rest

# Interpolation of rounding, and for orientations that were integrated of what that leaves.
ROUNDING = 1e-13
INTEGRATED = 1e-10


def pose(rng: np.random.Generator) -> pin.SE3:
    return pin.SE3(pin.exp3(rng.normal(0.0, 1.0, 3)), rng.normal(0.0, 0.5, 3))


def turns(rng: np.random.Generator, count: int) -> Array:
    found = [rng.normal(size=4)]
    for _ in range(count - 1):
        found.append(found[-1] / np.linalg.norm(found[-1]) + 0.4 * rng.normal(size=4))
    return np.array(found)


def waypoints(rng: np.random.Generator, corners: str = "blend") -> sm.paths.Path:
    t = np.cumsum(rng.uniform(0.2, 1.0, 8))
    return sm.paths.Waypoints(t, rng.normal(0.0, 0.3, (8, 3)), turns(rng, 8), corners=corners)


def polyline(rng: np.random.Generator) -> sm.paths.Path:
    return sm.paths.Polyline(rng.normal(0.0, 0.3, (5, 3)), turns(rng, 5), tolerance=5e-3)


def twist(t: float) -> Array:
    return np.array([np.cos(3.0 * t), np.sin(t), 0.1, np.sin(5.0 * t), 1.0, 0.0])


PATHS: dict[str, Callable[[np.random.Generator], sm.paths.Path]] = {
    "line": lambda rng: sm.paths.Line(pose(rng), pose(rng), 2.0),
    "steady line": lambda rng: sm.paths.Line(pose(rng), pose(rng), 2.0, "constant"),
    "circle": lambda rng: sm.paths.Circle.around(pose(rng), 0.2, 3.0, turn_tool=True, turns=1.5),
    "spiral": lambda rng: sm.paths.Spiral(pose(rng), [0, 0, 0], [0, 1, 1], 3.0, 1.0, 0.3, rise=0.1),
    "spiral from its middle": lambda rng: sm.paths.Spiral(
        pose(rng), [0, 0, 0], [0, 0, 1], 3.0, -1.0, 0.0, turn_tool=True
    ),
    "waypoints": waypoints,
    "stops": lambda rng: waypoints(rng, "stop"),
    "polyline": polyline,
    "feed": lambda rng: sm.paths.Feed(polyline(rng), 0.05),
    "feed in bends": lambda rng: sm.paths.Feed(waypoints(rng), 0.05),
    "twist": lambda rng: sm.paths.TwistPath(pose(rng), twist, 2.0),
    "leads": lambda rng: sm.paths.with_leads(sm.paths.Line(pose(rng), pose(rng), 2.0), 0.1, 1.0),
    "placed": lambda rng: sm.paths.Placed(waypoints(rng), pose(rng)),
    "section": lambda rng: Section(waypoints(rng), 0.3, 1.7),
    "section at rest": lambda rng: section_at_rest(waypoints(rng), 0.3, 1.7, 0.4, (True, True)),
    "backwards": lambda rng: sm.paths.Reversed(sm.paths.Feed(waypoints(rng), 0.05)),
    "woven": lambda rng: sm.paths.Weave(
        sm.paths.Feed(waypoints(rng), 0.05), 0.01, 0.05, axis=(1.0, 2.0, 0.0)
    ),
    "woven with dwells": lambda rng: sm.paths.Weave(
        sm.paths.Line(pose(rng), pose(rng), 2.0), 0.01, 0.05, dwell=0.2
    ),
    "dwell": lambda rng: sm.paths.Dwell(pose(rng), 1.0),
}


@pytest.mark.parametrize("name", PATHS)
def test_no_interpolation_misses_by_more_than_the_bound(name: str) -> None:
    rng = np.random.default_rng(sum(map(ord, name)))
    path = PATHS[name](rng)
    marks, overestimates = path.marks, []
    for _ in range(60):
        k = rng.integers(len(marks) - 1)
        half = 0.5 * (marks[k + 1] - marks[k]) * rng.uniform(0.02, 1.0)
        middle = rng.uniform(marks[k] + half, max(marks[k + 1] - half, marks[k] + half))
        known = path_series(path, np.array([middle]), np.array([half]))
        assert known is not None
        for count in (3, 5, 8):
            nodes = np.polynomial.chebyshev.chebpts1(count)
            places = np.linspace(-1.0, 1.0, 101)
            basis = np.polynomial.chebyshev.chebvander(nodes, count - 1)
            between = np.polynomial.chebyshev.chebvander(places, count - 1) @ np.linalg.inv(basis)
            at_nodes = path.samples(middle + half * nodes)
            truth = path.samples(np.clip(middle + half * places, 0.0, path.duration))
            missed = np.linalg.norm(truth.translation - between @ at_nodes.translation, axis=1)
            turned = (truth.rotation - np.einsum("pk,kab->pab", between, at_nodes.rotation)).copy()
            for size, bounds, slack in (
                (missed.max(), known.translation, ROUNDING),
                (
                    np.linalg.norm(turned, 2, axis=(1, 2)).max(),
                    known.rotation,
                    INTEGRATED if name == "twist" else ROUNDING,
                ),
            ):
                bound = bounds[count, 0] / 2.0 ** (count - 1)
                assert size <= bound + slack
                if size > 100.0 * slack:
                    overestimates.append(bound / size)
    assert not overestimates or np.median(overestimates) <= 300.0


def test_a_class_of_ones_own_that_moves_otherwise_has_no_bound() -> None:
    """It inherits our series, but they are not its own."""

    class Wobbling(sm.paths.Circle, kind="wobbling"):
        def evaluate(self, t: Array) -> sm.paths.PathSamples:
            found = super().evaluate(t)
            swing = 1e-3 * np.sin(40.0 * t)[:, None]
            return sm.paths.PathSamples(t, found.translation + swing, found.rotation, found.twist)

    class Named(sm.paths.Circle, kind="named"):
        """Moves as ours does."""

    place, half = np.array([1.0]), np.array([0.1])
    start = pin.SE3.Identity()
    assert path_series(Named.around(start, 0.1, 2.0), place, half) is not None
    wobbling = Wobbling.around(start, 0.1, 2.0)
    assert path_series(wobbling, place, half) is None
    assert path_series(sm.paths.Placed(wobbling, start), place, half) is None
    line = sm.paths.Line(wobbling.pose(2.0), start, 1.0)
    both = sm.paths.Dwell(start, 1.0) + sm.paths.Dwell(start, 1.0)
    assert path_series(both, place, half) is not None
    assert path_series(line, place / 2.0, half) is not None


def test_what_gives_no_bound_is_judged_as_measured_and_the_verdict_says_so() -> None:
    panda = sm.load_robot("panda")
    start = panda.dexterous_configuration()

    class Own(sm.paths.Path, kind="own, without a bound"):
        duration = 1.0

        def evaluate(self, t: Array) -> sm.paths.PathSamples:
            return sm.paths.Dwell(panda.pose(start), 1.0).evaluate(t)

    rest = sm.Trajectory([0.0, 1.0], [start, start], np.zeros((2, 7)), panda.joint_names)
    words = "checked at samples only"
    for path, said in ((Own(), True), (sm.paths.Dwell(panda.pose(start), 1.0), False)):
        certificate = sm.certify(panda, path, "pose", rest)
        assert certificate.verified
        assert (words in certificate.verdict) is said
