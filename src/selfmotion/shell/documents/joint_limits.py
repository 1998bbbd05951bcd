"""Reader of MoveIt's ``joint_limits.yaml``.

Its keys: https://moveit.picknik.ai/main/doc/examples/robot_model_and_robot_state and the tutorial
on time parameterisation there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from selfmotion.basics import (
    Array,
    FileFormatError,
    ProblemError,
    as_path,
    is_number,
    nearest,
    read_document,
    shown,
)
from selfmotion.model.robot import RobotModel
from selfmotion.problem.constraints import (
    Constraint,
    JointAccelerationLimits,
    JointJerkLimits,
    JointPositionLimits,
    JointVelocityLimits,
)

# Name of the table of joints.
_TABLE = "joint_limits"
# Largest limit: squares of it stay finite in float64.
_MAX_VALUE = 1e100
# Keys that the flag ``has_KIND_limits`` declares, by kind of limit.
_KINDS: Mapping[str, tuple[str, ...]] = {
    "position": ("min_position", "max_position"),
    "velocity": ("max_velocity",),
    "acceleration": ("max_acceleration",),
    "jerk": ("max_jerk",),
    "deceleration": ("max_deceleration",),
}
# Known keys that plans ignore.
_IGNORED_KEYS = (
    *("has_effort_limits", "max_effort"),
    *("angle_wraparound", "has_soft_limits", "k_position", "k_velocity"),
    *("soft_lower_limit", "soft_upper_limit"),
)
# Keys of default scaling factors, by kind of limit.
_SCALINGS: Mapping[str, str] = {
    "velocity": "default_velocity_scaling_factor",
    "acceleration": "default_acceleration_scaling_factor",
}
# Constraints, by kind of limit.
_RATES: Mapping[str, Callable[[Array], Constraint]] = {
    "velocity": JointVelocityLimits,
    "acceleration": JointAccelerationLimits,
    "jerk": JointJerkLimits,
}


def read_joint_limits(
    file: str | Path, robot: RobotModel, *, scaled: bool = True
) -> tuple[Constraint, ...]:
    """Read limits of position, velocity, acceleration and jerk.

    They apply in addition to the arm's own.

    Parameters
    ----------
    file : path
        A ``joint_limits.yaml``. Joints that the arm does not have are left out.
    robot : RobotModel
    scaled : bool
        Whether the file's default scaling factors of velocity and acceleration are applied, as
        MoveIt does where a request names none.

    Returns
    -------
    tuple of Constraint
        One for each kind of which the file limits a joint of the arm.

    Raises
    ------
    FileFormatError
        The file cannot be read, has none of the arm's joints, declares a limit that is missing, has
        one that is not declared, or one that is not a positive number. The message names joint and
        key.
    """
    path = as_path(file)
    if not isinstance(robot, RobotModel):
        raise ProblemError(f"robot is {shown(robot)}, expected a RobotModel (load_robot)")
    document = _document(path)
    table = document[_TABLE]
    if not set(table) & set(robot.joint_names):
        raise FileFormatError(
            f"{path}: has none of the joints of {robot.name}: {', '.join(robot.joint_names)}"
        )
    factors = {kind: _factor(path, document, key, scaled) for kind, key in _SCALINGS.items()}
    joints = {name: _joint(path, name, values) for name, values in table.items()}
    constraints: list[Constraint] = []
    lower = _values(robot, joints, "min_position", -np.inf)
    upper = _values(robot, joints, "max_position", np.inf)
    if np.isfinite(lower).any() or np.isfinite(upper).any():
        constraints.append(JointPositionLimits(lower, upper))
    for kind, constraint in _RATES.items():
        limit = _values(robot, joints, f"max_{kind}", np.inf)
        if kind == "acceleration":
            # Accelerations are limited alike in both directions: the arm brakes by as much.
            limit = np.minimum(limit, _values(robot, joints, "max_deceleration", np.inf))
        limit = limit * factors.get(kind, 1.0)
        if np.isfinite(limit).any():
            constraints.append(constraint(limit))
    return tuple(constraints)


def joint_limit_notes(file: str | Path, robot: RobotModel) -> tuple[str, ...]:
    """Return notes on what `read_joint_limits` assumes and ignores in a file."""
    path = as_path(file)
    document = _document(path)
    notes = ["limits are read in rad and s (m for prismatic joints), as MoveIt's are"]
    notes += [
        f"{key} {document[key]:g} is applied, as MoveIt does where a request says none"
        for key in _SCALINGS.values()
        if document.get(key, 1.0) != 1.0
    ]
    others = [name for name in document[_TABLE] if name not in robot.joint_names]
    if others:
        notes.append(f"left out, as the arm does not have them: {', '.join(map(str, others))}")
    keys = {key for values in document[_TABLE].values() for key in values} & set(_IGNORED_KEYS)
    if keys:
        notes.append(f"ignored: {', '.join(sorted(keys))}")
    return tuple(f"{path}: {note}" for note in notes)


def _document(path: Path) -> Mapping[str, Any]:
    """Return the document that holds the table of joints."""
    document: Any = read_document(path)
    # Parameter files of a ROS node nest it in tables of one entry.
    while len(document) == 1 and _TABLE not in document:
        (document,) = document.values()
        if not isinstance(document, Mapping):
            break
    if not (isinstance(document, Mapping) and isinstance(document.get(_TABLE), Mapping)):
        raise FileFormatError(f"{path}: has no table '{_TABLE}', expected one of MoveIt's")
    unknown = [key for key in document if key not in (_TABLE, *_SCALINGS.values())]
    if unknown:
        _raise_unknown_key(path, str(unknown[0]), (_TABLE, *_SCALINGS.values()))
    return document


def _values(
    robot: RobotModel, joints: Mapping[str, Mapping[str, float]], key: str, default: float
) -> Array:
    """Return the value of a key for each joint of the arm, `default` where it has none."""
    return np.array([joints.get(name, {}).get(key, default) for name in robot.joint_names])


def _factor(file: Path, document: Mapping[str, Any], key: str, scaled: bool) -> float:
    value = _number(file, key, document.get(key, 1.0))
    if not 0.0 < value <= 1.0:
        raise FileFormatError(f"{file}: {key} is {value:g}, expected a number above 0, at most 1")
    return value if scaled else 1.0


def _joint(file: Path, joint: str, values: Any) -> dict[str, float]:
    """Return the limits of a joint, by key."""
    where = f"{_TABLE}.{joint}"
    if not isinstance(values, Mapping):
        raise FileFormatError(f"{file}: {where} is {values!r}, expected a table of limits")
    _check_keys(file, where, values)
    limits: dict[str, float] = {}
    for kind, keys in _KINDS.items():
        limits |= _limits_of_kind(file, where, values, kind, keys)
    _check_values(file, where, limits)
    return limits


def _check_keys(file: Path, where: str, values: Mapping[str, Any]) -> None:
    known = {*_IGNORED_KEYS, *(key for keys in _KINDS.values() for key in keys)}
    known |= {f"has_{kind}_limits" for kind in _KINDS}
    unknown = [key for key in values if key not in known]
    if unknown:
        _raise_unknown_key(file, f"{where}.{unknown[0]}", sorted(known))


def _limits_of_kind(
    file: Path, where: str, values: Mapping[str, Any], kind: str, keys: Sequence[str]
) -> dict[str, float]:
    """Return the limits of one kind, by key; none if they are not declared."""
    flag = f"has_{kind}_limits"
    is_declared = values.get(flag, False)
    if not isinstance(is_declared, bool):
        raise FileFormatError(f"{file}: {where}.{flag} is {is_declared!r}, expected true or false")
    if not is_declared:
        if flag not in values and any(key in values for key in keys):
            raise FileFormatError(
                f"{file}: {where}.{keys[-1]} has no effect without {flag}; say true or false"
            )
        return {}
    missing = [key for key in keys if key not in values]
    if missing:
        raise FileFormatError(f"{file}: {where}: {flag} is true, but {missing[0]} is missing")
    limits = {key: _number(file, f"{where}.{key}", values[key]) for key in keys}
    if kind == "deceleration":
        # Pilz's planner writes them as negative accelerations.
        limits["max_deceleration"] = abs(limits["max_deceleration"])
    return limits


def _check_values(file: Path, where: str, limits: Mapping[str, float]) -> None:
    """Raise FileFormatError for a rate that is not positive, or positions out of order."""
    for key, value in limits.items():
        if key not in _KINDS["position"] and value <= 0.0:
            raise FileFormatError(f"{file}: {where}.{key} is {value:g}, expected a number above 0")
    if limits.get("min_position", -np.inf) >= limits.get("max_position", np.inf):
        raise FileFormatError(
            f"{file}: {where}: min_position {limits['min_position']:g} is not below max_position "
            f"{limits['max_position']:g}"
        )


def _number(file: Path, where: str, value: Any) -> float:
    if not (is_number(value) and abs(value) <= _MAX_VALUE):
        raise FileFormatError(f"{file}: {where} is {value!r}, expected a finite number")
    return float(value)


def _raise_unknown_key(file: Path, key: str, known: Any) -> NoReturn:
    name = key.rpartition(".")[2]
    raise FileFormatError(f"{file}: {key}: unknown key{nearest(name, known)}")
