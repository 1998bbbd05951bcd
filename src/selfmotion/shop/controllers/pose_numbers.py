"""Tool poses in the numbers of each controller language, and the decimals of programs."""

from collections.abc import Callable, Mapping

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.task import Quaternion, exp3, log3, rpy

# - KRL: X, Y, Z [mm], and A, B, C [deg] with R = R_z(A) R_y(B) R_x(C).
# - RAPID: position [mm], and the quaternion q1 to q4, the real part first.
# - URScript: position [m], and the rotation vector [rad].

# Positions (K, 3) [m] and quaternions (K, 4) as they are when a file is read again.
Rounding = Callable[[Array, Array], tuple[Array, Array]]
# Decimals of times in programs [s].
TIME_DIGITS = 5
# Largest rounding of a duration that is a sum of times in a program [s].
TIME_TOLERANCE = 1e-4
# Largest rounding of a joint position in a program [rad or m].
JOINT_ROUNDING = 1e-6
# Decimals of lengths in programs [mm].
LENGTH_DIGITS = 4
# Decimals of angles in programs [°].
ANGLE_DIGITS = 5
# Decimals of parts of quaternions.
_PARTS = 8
# Decimals of lengths in m and angles in rad.
_SI = 9


def krl_numbers(position: Array, quaternion: Array) -> list[float]:
    """Return X, Y, Z [mm], A, B, C [deg] of a pose."""
    c, b, a = np.degrees(rpy.matrixToRpy(_matrix(quaternion))).tolist()
    return [*_rounded(1e3 * position, LENGTH_DIGITS), *_rounded([a, b, c], ANGLE_DIGITS)]


def krl_pose(numbers: Array) -> tuple[Array, Array]:
    """Return the pose of such numbers: position [m], quaternion x, y, z, w."""
    a, b, c = np.radians(numbers[3:6]).tolist()
    return 1e-3 * numbers[:3], _quaternion(rpy.rpyToMatrix(c, b, a))


def rapid_numbers(position: Array, quaternion: Array) -> list[float]:
    """Return x, y, z [mm], q1, q2, q3, q4 of a pose."""
    x, y, z, w = (quaternion if quaternion[3] >= 0.0 else -quaternion).tolist()
    return [*_rounded(1e3 * position, LENGTH_DIGITS), *_rounded([w, x, y, z], _PARTS)]


def rapid_pose(numbers: Array) -> tuple[Array, Array]:
    """Return the pose of such numbers, whose quaternion need not be of length 1 exactly."""
    w, x, y, z = (numbers[3:7] / np.linalg.norm(numbers[3:7])).tolist()
    return 1e-3 * numbers[:3], np.array([x, y, z, w])


def urscript_numbers(position: Array, quaternion: Array) -> list[float]:
    """Return x, y, z [m], rx, ry, rz [rad] of a pose."""
    return [*_rounded(position, _SI), *_rounded(log3(_matrix(quaternion)), _SI)]


def urscript_pose(numbers: Array) -> tuple[Array, Array]:
    """Return the pose of such numbers."""
    return np.array(numbers[:3]), _quaternion(exp3(numbers[3:6]))


_KINDS = {
    "krl": (krl_numbers, krl_pose),
    "rapid": (rapid_numbers, rapid_pose),
    "urscript": (urscript_numbers, urscript_pose),
}


def _rounding(form: str) -> Rounding:
    numbers_of, pose_of = _KINDS[form]

    def rounded(positions: Array, quaternions: Array) -> tuple[Array, Array]:
        poses = [
            pose_of(np.array(numbers_of(position, quaternion)))
            for position, quaternion in zip(positions, quaternions, strict=True)
        ]
        return np.array([position for position, _ in poses]), np.array(
            [quaternion for _, quaternion in poses]
        )

    return rounded


ROUNDINGS: Mapping[str, Rounding] = {form: _rounding(form) for form in _KINDS}


def _matrix(quaternion: Array) -> Array:
    x, y, z, w = (quaternion / np.linalg.norm(quaternion)).tolist()
    return np.asarray(Quaternion(w, x, y, z).toRotationMatrix())


def _quaternion(rotation: Array) -> Array:
    return np.array(Quaternion(np.asarray(rotation)).coeffs())


def _rounded(values: Array | list[float], digits: int) -> list[float]:
    return [float(value) + 0.0 for value in np.round(np.asarray(values), digits).tolist()]
