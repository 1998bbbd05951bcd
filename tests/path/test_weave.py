"""A woven seam swings evenly to both sides, and is the seam at its ends."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.model.task import SE3
from support.arms import robot_named

AMPLITUDE, PITCH = 4e-3, 0.02
LENGTH = 0.3
# Interpolation of the length along the seam, as a share of a swing.
COUNTED = 1e-6
# What a place may be off the published formula [m].
MICROMETRE = 1e-6
# A pose and a twist by two classes [m, m/s, rad/s].
ROUNDING = 1e-14


def seam(turned: bool = False) -> sm.paths.Path:
    rotation = np.diag([1.0, -1.0, -1.0]) if turned else np.eye(3)
    first = SE3(rotation, np.array([0.1, 0.2, 0.3]))
    last = SE3(rotation, np.array([0.1 + LENGTH, 0.2, 0.3]))
    return sm.paths.Line(first, last, 5.0)


def offsets(woven: sm.paths.Path, plain: sm.paths.Path, t: Array) -> Array:
    """Return how far the tool is from the seam, in its own frame, (K, 3)."""
    one, other = woven.samples(t), plain.samples(t)
    away = one.translation - other.translation
    return np.einsum("kba,kb->ka", other.rotation, away)


@pytest.mark.parametrize("dwell", [0.0, 0.2])
def test_it_swings_evenly_whatever_the_feed(dwell: float) -> None:
    plain = sm.paths.Feed(seam(turned=True), 0.03)
    woven = sm.paths.Weave(plain, AMPLITUDE, PITCH, dwell=dwell)
    assert woven.swings == round(LENGTH / PITCH)
    t = np.linspace(0.0, woven.duration, 20001)
    away = offsets(woven, plain, t)
    np.testing.assert_allclose(away[:, [0, 2]], 0.0, atol=1e-15)
    assert np.abs(away[:, 1]).max() == pytest.approx(AMPLITUDE, rel=1e-6)
    # Crossed every half pitch of the way; the feed starts and ends at rest.
    way = np.linalg.norm(plain.samples(t).translation - plain.pose(0.0).translation, axis=1)
    inner = away[:-1, 1] * away[1:, 1] < 0.0
    crossings = way[:-1][inner] / (LENGTH / woven.swings)
    expected = np.arange(0.5, woven.swings - 0.25, 0.5)
    np.testing.assert_allclose(crossings, expected, atol=COUNTED + np.diff(way).max() / PITCH)
    at_edges = np.abs(away[:, 1]) > (1.0 - 1e-9) * AMPLITUDE
    middle = (way > 2.0 * PITCH) & (way < LENGTH - 2.0 * PITCH)
    assert at_edges[middle].mean() == pytest.approx(2.0 * dwell, abs=0.01)


def test_a_sine_is_a_sine() -> None:
    plain = seam()
    woven = sm.paths.Weave(plain, AMPLITUDE, PITCH, axis=(0.0, 0.0, 2.0))
    t = np.linspace(0.0, plain.duration, 501)
    x = (plain.samples(t).translation[:, 0] - 0.1) / LENGTH * woven.swings
    inner = (x > 1.0) & (x < woven.swings - 1.0)
    expected = AMPLITUDE * np.sin(2.0 * np.pi * x)
    away = offsets(woven, plain, t)[:, 2]
    allowed = 2.0 * np.pi * COUNTED * AMPLITUDE
    np.testing.assert_allclose(away[inner], expected[inner], atol=allowed)
    for end in (0.0, plain.duration):
        np.testing.assert_allclose(woven.twist(end), plain.twist(end), rtol=0, atol=ROUNDING)
        here, there = (path.pose(end).homogeneous for path in (woven, plain))
        np.testing.assert_allclose(here, there, rtol=0, atol=ROUNDING)


def carrier(name: str) -> sm.paths.Path:
    """Return a seam to be woven along: straight, round or with rounded corners."""
    tilted = Rotation.from_euler("xyz", [2.5, 0.3, -0.4]).as_matrix()
    first = SE3(tilted, np.array([0.4, -0.2, 0.3]))
    if name == "line":
        further = Rotation.from_euler("xyz", [2.1, 0.1, 0.5]).as_matrix()
        return sm.paths.Feed(
            sm.paths.Line(first, SE3(further, np.array([0.6, 0.1, 0.35])), 1.0), 0.05
        )
    if name == "circle":
        return sm.paths.Circle.around(first, 0.1, 6.0, normal=(0.2, 0.1, 1.0))
    legs = [[0.4, -0.2, 0.3], [0.55, -0.2, 0.3], [0.55, 0.0, 0.35], [0.7, 0.1, 0.35]]
    return sm.paths.Feed(sm.paths.Polyline(legs, tolerance=2e-3), 0.04)


def published_swing(count: Array, swings: int, dwell: float) -> Array:
    """Return the offset, as a share of the amplitude, after so many swings, as `Weave` says.

    From the middle up to one edge, there for `dwell`, across to the other edge, there as long, and
    back; the first swing grows from nothing and the last one vanishes, each as 10x³ - 15x⁴ + 6x⁵.
    """

    def rise(x: Array) -> Array:
        x = np.clip(x, 0.0, 1.0)
        return 10.0 * x**3 - 15.0 * x**4 + 6.0 * x**5

    grown = rise(count) * rise(swings - count)
    if not dwell:
        return grown * np.sin(2.0 * np.pi * count)
    across, inside = 0.5 - dwell, np.mod(count, 1.0)
    # Up from the edge below, which the swing before left half a crossing ago; down; and up again.
    up = 2.0 * rise((inside + 0.5 * across) / across) - 1.0
    down = 2.0 * rise((inside - 0.5 * across - dwell) / across)
    again = 2.0 * rise((inside - 1.0 + 0.5 * across) / across)
    return grown * (up - down + again)


@pytest.mark.parametrize("name", ["line", "circle", "corners"])
@pytest.mark.parametrize("dwell", [0.0, 0.15])
def test_the_tool_is_where_the_formula_says_within_a_micrometre(name: str, dwell: float) -> None:
    plain, axis = carrier(name), np.array([0.0, 0.6, 0.8])
    woven = sm.paths.Weave(plain, AMPLITUDE, PITCH, axis=axis, dwell=dwell)
    # The length of the seam by its chords: of places alone, without any derivative.
    t = np.linspace(0.0, plain.duration, 50_001)
    places = plain.samples(t)
    chords = np.linalg.norm(np.diff(places.translation, axis=0), axis=1)
    way = np.append(0.0, np.cumsum(chords))
    swings = round(way[-1] / PITCH)
    away = AMPLITUDE * published_swing(way / way[-1] * swings, swings, dwell)
    expected = places.translation + (places.rotation @ axis) * away[:, None]
    found = woven.samples(t)
    assert np.abs(away).max() > 0.99 * AMPLITUDE
    np.testing.assert_allclose(found.translation, expected, rtol=0.0, atol=MICROMETRE)
    np.testing.assert_array_equal(found.rotation, places.rotation)
    # Another dwell, or a swing more, is seen.
    for other in (
        published_swing(way / way[-1] * swings, swings, dwell + 0.01),
        published_swing(way / way[-1] * (swings + 1), swings + 1, dwell),
    ):
        assert np.abs(AMPLITUDE * other - away).max() > 10.0 * MICROMETRE


def test_a_woven_seam_is_planned_and_verified() -> None:
    panda = sm.load_robot("panda")
    pose = panda.pose(sm.NAMED_ARMS["panda"].home)
    last = SE3(pose.rotation, pose.translation + np.array([0.0, 0.08, 0.0]))
    woven = sm.paths.Weave(
        sm.paths.Feed(sm.paths.Line(pose, last, 1.0), 0.02), 2e-3, 0.02, axis=(1.0, 0.0, 0.0)
    )
    plan = sm.plan(sm.Problem(panda, woven, start=sm.NAMED_ARMS["panda"].home))
    assert plan.certificate.verified, plan.certificate.verdict
    assert not plan.certificate.notes
    plain = sm.paths.Section(
        sm.paths.Feed(sm.paths.Line(pose, last, 1.0), 0.02), 0.0, woven.duration
    )
    assert not sm.certify(panda, plain, "pose", plan.trajectory).verified


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ({"amplitude": 0.0}, "amplitude"),
        ({"amplitude": 4.0}, "amplitude"),
        ({"pitch": -1.0}, "pitch"),
        ({"pitch": 0.2}, "two swings"),
        ({"dwell": 0.5}, "dwell"),
        ({"axis": (0.0, 0.0, 0.0)}, "axis"),
    ],
)
def test_what_is_no_swing_is_refused(given: dict, named: str) -> None:
    with pytest.raises(sm.errors.PathError, match=named):
        sm.paths.Weave(seam(), **{"amplitude": AMPLITUDE, "pitch": PITCH, **given})


def test_a_weave_that_never_ends_is_refused_at_once() -> None:
    """A pitch a hundred times too small: by its swings, or by how it accelerates."""
    with pytest.raises(sm.errors.PathError, match=r"makes 1e\+05 swings, expected 20,000 at most"):
        sm.paths.Weave(seam(), 2e-3, float(length_of(seam())) / 1e5)
    panda = robot_named("panda")
    start = panda.dexterous_configuration()
    here = panda.pose(start)
    there = here.copy()
    there.translation = here.translation + np.array([0.0, 0.07, 0.0])
    line = sm.paths.Feed(sm.paths.Line(here, there, 4.0), 0.02)
    woven = sm.paths.Weave(line, 2e-3, 5e-5)
    with pytest.raises(
        sm.errors.ProblemError, match=r"accelerates at 1\.\d*e\+04 m/s².*times gravity"
    ):
        sm.Problem(panda, woven, task="position", start=start)
    # As it was meant it is planned.
    sm.Problem(panda, sm.paths.Weave(line, 2e-3, 5e-3), task="position", start=start)


def length_of(path: sm.paths.Path) -> float:
    places = path.samples(np.linspace(0.0, path.duration, 2001)).translation
    return float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
