"""Pinocchio on robots/planar_3r.urdf against closed-form planar kinematics."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.model import kernels
from support.arms import central_difference
from support.followed import standing

LINKS = np.array([2.0, 2.0, 1.0])


EXACT = 1e-12  # a few roundings of numbers of order 5


def position(q: Array) -> Array:
    angles = np.cumsum(q)
    return np.array([LINKS @ np.cos(angles), LINKS @ np.sin(angles)])


def jacobian(q: Array) -> Array:
    angles = np.cumsum(q)
    return np.array(
        [
            [-(LINKS * np.sin(angles))[k:].sum() for k in range(3)],
            [(LINKS * np.cos(angles))[k:].sum() for k in range(3)],
        ]
    )


def determinant(q: Array) -> float:
    """Return det JJᵀ as the sum of the squared 2 × 2 minors (Cauchy-Binet), in sines of angles."""
    s2, s3, s23 = np.sin(q[1]), np.sin(q[2]), np.sin(q[1] + q[2])
    first = 4.0 * s2 + 2.0 * s23
    second = 2.0 * s23 + 2.0 * s3
    return float(first**2 + second**2 + (2.0 * s3) ** 2)


def determinant_gradient(q: Array) -> Array:
    s2, s3, s23 = np.sin(q[1]), np.sin(q[2]), np.sin(q[1] + q[2])
    c2, c3, c23 = np.cos(q[1]), np.cos(q[2]), np.cos(q[1] + q[2])
    first, second, third = 4.0 * s2 + 2.0 * s23, 2.0 * s23 + 2.0 * s3, 2.0 * s3
    by_q2 = 2.0 * first * (4.0 * c2 + 2.0 * c23) + 2.0 * second * 2.0 * c23
    by_q3 = 2.0 * first * 2.0 * c23 + 2.0 * second * (2.0 * c23 + 2.0 * c3) + 2.0 * third * 2.0 * c3
    return np.array([0.0, by_q2, by_q3])


@pytest.fixture(params=range(20))
def q(request: pytest.FixtureRequest) -> Array:
    return np.random.default_rng(request.param).uniform(-np.pi, np.pi, 3)


def test_position(planar: sm.RobotModel, q: Array) -> None:
    np.testing.assert_allclose(planar.pose(q).translation[:2], position(q), rtol=0, atol=EXACT)


def test_jacobian(planar: sm.RobotModel, q: Array) -> None:
    np.testing.assert_allclose(planar.jacobian(q)[:2], jacobian(q), rtol=0, atol=EXACT)


def test_manipulability(planar: sm.RobotModel, q: Array) -> None:
    rows = planar.task_jacobian(q, sm.Task.PLANAR)
    found = np.linalg.det(rows @ rows.T)
    np.testing.assert_allclose(found, determinant(q), rtol=EXACT, atol=EXACT)


def test_manipulability_gradient(planar: sm.RobotModel, q: Array) -> None:
    rows = planar.task_jacobian(q, sm.Task.PLANAR)
    gram = rows @ rows.T
    weights = 2.0 * np.linalg.det(gram) * np.linalg.solve(gram, rows)
    found = kernels.contract_task(
        planar.jacobian(q)[None],
        planar.pose(q).rotation[None],
        weights[None],
        standing(planar, "planar").layout,
        0,
    )[0]
    np.testing.assert_allclose(found, determinant_gradient(q), rtol=EXACT, atol=100 * EXACT)


def test_the_oracle_itself(q: Array) -> None:
    """The closed forms agree with differences, so that a slip in them would show."""
    np.testing.assert_allclose(
        determinant_gradient(q), central_difference(determinant, q), rtol=1e-7, atol=1e-7
    )
    for row in range(2):
        np.testing.assert_allclose(
            jacobian(q)[row],
            central_difference(lambda x, row=row: float(position(x)[row]), q),
            rtol=1e-8,
            atol=1e-8,
        )


@pytest.mark.parametrize("radius", [5.0, 3.0, 1.0])
def test_every_collinear_pose_is_singular(planar: sm.RobotModel, radius: float) -> None:
    """Not only the edge of the workspace, as the paper has it: radius 3 and 1 as well."""
    pose = {5.0: [0.3, 0.0, 0.0], 3.0: [0.3, 0.0, np.pi], 1.0: [0.3, np.pi, 0.0]}[radius]
    assert np.linalg.norm(position(np.array(pose))) == pytest.approx(radius)
    assert determinant(np.array(pose)) == pytest.approx(0.0, abs=EXACT)
    rows = planar.task_jacobian(pose, sm.Task.PLANAR)
    assert np.linalg.svd(rows, compute_uv=False)[-1] < EXACT
