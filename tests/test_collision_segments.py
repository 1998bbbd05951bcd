"""Distances of segments: coal's for what is apart, a brute force inside, slopes throughout."""

import coal
import numpy as np
import pytest
from scipy.optimize import minimize

from selfmotion.basics.jit import kernel
from selfmotion.collision.segments import segment_box, segment_cylinder, segment_segment

BOX = (0.3, 0.2, 0.1)
RADIUS, HALF = 0.2, 0.3
# What GJK leaves at a tolerance of 1e-12 [m].
EXACT = 1e-9
CASES = range(200)


def random_segment(seed: int, spread: float) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.normal(size=3) * spread, rng.normal(size=3) * rng.choice([0.03, 0.2, 0.6])


def call(shape: str, c: np.ndarray, e: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    if shape == "box":
        d, n, p = segment_box(tuple(c), tuple(e), BOX)
    elif shape == "cylinder":
        d, n, p = segment_cylinder(tuple(c), tuple(e), RADIUS, HALF)
    else:
        d, n, p = segment_segment(tuple(c), tuple(e), (0.1, 0.0, 0.0), (0.2, 0.1, 0.3))
    return d, np.array(n), np.array(p)


def coal_distance(shape: str, c: np.ndarray, e: np.ndarray) -> float:
    length = np.linalg.norm(e)
    capsule = coal.Capsule(0.0, 2.0 * length)
    solid, place = {
        "box": (coal.Box(*(2.0 * np.array(BOX))), coal.Transform3s()),
        "cylinder": (coal.Cylinder(RADIUS, 2.0 * HALF), coal.Transform3s()),
        "segment": (
            coal.Capsule(0.0, 2.0 * np.linalg.norm([0.2, 0.1, 0.3])),
            placed(np.array([0.1, 0.0, 0.0]), np.array([0.2, 0.1, 0.3])),
        ),
    }[shape]
    request = coal.DistanceRequest()
    request.gjk_tolerance = 1e-12
    request.gjk_max_iterations = 1000
    return coal.distance(capsule, placed(c, e), solid, place, request, coal.DistanceResult())


def placed(c: np.ndarray, e: np.ndarray) -> coal.Transform3s:
    z = e / np.linalg.norm(e)
    x = np.cross(z, [0.6, 0.0, 0.8])
    x /= np.linalg.norm(x)
    return coal.Transform3s(np.column_stack([x, np.cross(z, x), z]), c)


@pytest.mark.parametrize("shape", ["box", "segment", "cylinder"])
def test_distance_apart_is_coals(shape: str) -> None:
    checked = 0
    for seed in CASES:
        c, e = random_segment(seed, 0.7)
        d, n, _ = call(shape, c, e)
        if d > 1e-3:
            assert d == pytest.approx(coal_distance(shape, c, e), abs=EXACT)
            assert np.linalg.norm(n) == pytest.approx(1.0)
            checked += 1
    assert checked > len(CASES) / 3


def test_box_depth_is_the_shortest_way_out() -> None:
    """Moving by -d along n separates; no sampled direction does so with a shorter way."""
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(4000, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    h = np.array(BOX)
    checked = 0
    for seed in CASES:
        c, e = random_segment(seed, 0.15)
        d, n, _ = call("box", c, e)
        if d < 0:
            assert call("box", c - (d - 1e-9) * n, e)[0] >= 0
            ways = np.abs(directions) @ h + np.abs(directions @ e) - directions @ c
            assert -d <= ways.min() + 1e-12
            checked += 1
    assert checked > len(CASES) / 3


def test_cylinder_depth_is_that_of_the_deepest_point() -> None:
    for seed in CASES:
        c, e = random_segment(seed, 0.15)
        d, _, _ = call("cylinder", c, e)
        points = c + np.linspace(-1, 1, 4001)[:, None] * e
        inside = np.maximum(
            np.hypot(points[:, 0], points[:, 1]) - RADIUS, np.abs(points[:, 2]) - HALF
        )
        if d < 0:
            assert d == pytest.approx(inside.min(), abs=1e-3 * np.linalg.norm(e))
            assert d <= inside.min() + 1e-12


@pytest.mark.parametrize("shape", ["box", "segment", "cylinder"])
@pytest.mark.parametrize("spread", [0.1, 0.7], ids=["inside", "outside"])
def test_normal_and_point_are_the_slope_of_the_distance(shape: str, spread: float) -> None:
    """Under a small twist about the world's origin, d changes by n · (v + ω × p)."""
    rng = np.random.default_rng(1)
    step, wrong = 1e-6, 0
    for seed in CASES:
        c, e = random_segment(seed, spread)
        v, w = rng.normal(size=(2, 3))
        _, n, p = call(shape, c, e)

        def moved(s: float, c=c, e=e, v=v, w=w) -> float:
            return call(shape, c + s * (v + np.cross(w, c)), e + s * np.cross(w, e))[0]

        slope = (moved(step) - moved(-step)) / (2.0 * step)
        wrong += abs(slope - n @ (v + np.cross(w, p))) > 1e-4
    # The closest points jump between the two ends of the difference in a rare case only.
    assert wrong <= 1


@pytest.mark.parametrize("shape", ["box", "cylinder", "segment"])
def test_distance_is_continuous_through_the_surface(shape: str) -> None:
    """Along a line through the shape, d never changes faster than the segment moves."""
    for seed in range(30):
        c, e = random_segment(seed, 0.1)
        path = np.linspace(-1.0, 1.0, 400)
        direction = np.array([0.6, 0.0, 0.8])
        values = [call(shape, c + s * direction, e)[0] for s in path]
        assert np.abs(np.diff(values)).max() <= path[1] - path[0] + 1e-12


def test_nearly_parallel_segments_stay_accurate() -> None:
    for tilt in (0.0, 1e-12, 1e-9, 1e-7, 1e-5):
        c, e = np.array([0.3, 0.2, 0.0]), np.array([1.0, tilt, 0.0])
        d, _, _ = segment_segment(tuple(c), tuple(e), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
        bounded = minimize(
            lambda x, c=c, e=e: np.sum((c + x[0] * e - [x[1], 0, 0]) ** 2),
            [0.0, 0.0],
            bounds=[(-1, 1), (-1, 1)],
            tol=1e-16,
        )
        assert d <= np.sqrt(bounded.fun) + 1e-12
        assert d == pytest.approx(0.2, abs=2 * tilt + 1e-12)


def test_points_serve_as_segments() -> None:
    zero = (0.0, 0.0, 0.0)
    assert segment_segment((1.0, 0.0, 0.0), zero, zero, zero)[0] == 1.0
    assert segment_box((1.3, 0.0, 0.0), zero, BOX)[0] == pytest.approx(1.0)
    assert segment_box((0.25, 0.0, 0.0), zero, BOX)[0] == pytest.approx(-0.05)
    assert segment_cylinder((0.0, 0.0, 1.0), zero, RADIUS, HALF)[0] == pytest.approx(0.7)


def test_kernels_compile_where_no_cache_folder_can_be_written(monkeypatch) -> None:
    def njit(cache: bool, error_model: str):
        if cache:
            raise RuntimeError("cannot cache function 'f': no locator available for file 'f.py'")
        return lambda function: function

    monkeypatch.setattr("numba.njit", njit)
    assert kernel(abs)(-1.0) == 1.0


def test_other_compiler_errors_are_not_hidden(monkeypatch) -> None:
    def njit(cache: bool, error_model: str):
        raise RuntimeError("something else")

    monkeypatch.setattr("numba.njit", njit)
    with pytest.raises(RuntimeError, match="something else"):
        kernel(abs)
