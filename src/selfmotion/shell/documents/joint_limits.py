"""Limits of joints as MoveIt's configuration packages state them: ``joint_limits.yaml``.

Its keys: https://moveit.picknik.ai/main/doc/examples/robot_model_and_robot_state and the tutorial
on time parameterisation there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

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

_JOINTS = "joint_limits"
# What float64 can count with.
_MOST = 1e100
# has_NAME_limits → the keys that it announces.
_KINDS: Mapping[str, tuple[str, ...]] = {
    "position": ("min_position", "max_position"),
    "velocity": ("max_velocity",),
    "acceleration": ("max_acceleration",),
    "jerk": ("max_jerk",),
    "deceleration": ("max_deceleration",),
}
# What such files may say besides, and plans do not ask.
_OTHERS = (
    *("has_effort_limits", "max_effort"),
    *("angle_wraparound", "has_soft_limits", "k_position", "k_velocity"),
    *("soft_lower_limit", "soft_upper_limit"),
)
_SCALINGS: Mapping[str, str] = {
    "velocity": "default_velocity_scaling_factor",
    "acceleration": "default_acceleration_scaling_factor",
}
_RATES: Mapping[str, Callable[[Array], Constraint]] = {
    "velocity": JointVelocityLimits,
    "acceleration": JointAccelerationLimits,
    "jerk": JointJerkLimits,
}


def read_joint_limits(
    file: str | Path, robot: RobotModel, *, scaled: bool = True
) -> tuple[Constraint, ...]:
    """Read limits of positions, velocities, accelerations and jerks; the arm's own count as well.

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
        The file cannot be read, knows none of the arm's joints, announces a limit that it does not
        give, gives one that it does not announce, or one that is no positive number; the joint
        and the key are named.
    """
    path = as_path(file)
    if not isinstance(robot, RobotModel):
        raise ProblemError(f"robot is {shown(robot)}, expected a RobotModel (load_robot)")
    document = _document(path)
    table = document[_JOINTS]
    if not set(table) & set(robot.joint_names):
        raise FileFormatError(
            f"{path}: knows none of the joints of {robot.name}: {', '.join(robot.joint_names)}"
        )
    factors = {kind: _factor(path, document, key, scaled) for kind, key in _SCALINGS.items()}
    joints = {name: _joint(path, name, values) for name, values in table.items()}
    found: list[Constraint] = []
    lower = _each(robot, joints, "min_position", -np.inf)
    upper = _each(robot, joints, "max_position", np.inf)
    if np.isfinite(lower).any() or np.isfinite(upper).any():
        found.append(JointPositionLimits(lower, upper))
    for kind, constraint in _RATES.items():
        limit = _each(robot, joints, f"max_{kind}", np.inf)
        if kind == "acceleration":
            # Accelerations are limited alike in both directions: the arm brakes by as much.
            limit = np.minimum(limit, _each(robot, joints, "max_deceleration", np.inf))
        limit = limit * factors.get(kind, 1.0)
        if np.isfinite(limit).any():
            found.append(constraint(limit))
    return tuple(found)


def joint_limit_notes(file: str | Path, robot: RobotModel) -> tuple[str, ...]:
    """Return notes of what `read_joint_limits` takes for granted or passes over of a file."""
    path = as_path(file)
    document = _document(path)
    notes = ["limits are taken for rad and s (m of joints that slide), as MoveIt's are"]
    notes += [
        f"{key} {document[key]:g} is applied, as MoveIt does where a request says none"
        for key in _SCALINGS.values()
        if document.get(key, 1.0) != 1.0
    ]
    others = [name for name in document[_JOINTS] if name not in robot.joint_names]
    if others:
        notes.append(f"left out, as the arm does not have them: {', '.join(map(str, others))}")
    keys = {key for values in document[_JOINTS].values() for key in values} & set(_OTHERS)
    if keys:
        notes.append(f"passed over: {', '.join(sorted(keys))}")
    return tuple(f"{path}: {note}" for note in notes)


def _document(path: Path) -> Mapping[str, Any]:
    """Return the table of a file that has the joints' one in it."""
    document: Any = read_document(path)
    # As a parameter file of a node, it lies in tables of nothing else.
    while len(document) == 1 and _JOINTS not in document:
        (document,) = document.values()
        if not isinstance(document, Mapping):
            break
    if not (isinstance(document, Mapping) and isinstance(document.get(_JOINTS), Mapping)):
        raise FileFormatError(f"{path}: has no table '{_JOINTS}', expected one of MoveIt's")
    unknown = [key for key in document if key not in (_JOINTS, *_SCALINGS.values())]
    if unknown:
        _refuse(path, str(unknown[0]), (_JOINTS, *_SCALINGS.values()))
    return document


def _each(
    robot: RobotModel, joints: Mapping[str, Mapping[str, float]], key: str, none: float
) -> Array:
    return np.array([joints.get(name, {}).get(key, none) for name in robot.joint_names])


def _factor(file: Path, document: Mapping[str, Any], key: str, scaled: bool) -> float:
    value = _number(file, key, document.get(key, 1.0))
    if not 0.0 < value <= 1.0:
        raise FileFormatError(f"{file}: {key} is {value:g}, expected a number above 0, at most 1")
    return value if scaled else 1.0


def _joint(file: Path, joint: str, values: Any) -> dict[str, float]:
    """Return the limits of a joint, by key."""
    where = f"{_JOINTS}.{joint}"
    if not isinstance(values, Mapping):
        raise FileFormatError(f"{file}: {where} is {values!r}, expected a table of limits")
    known = {*_OTHERS, *(key for keys in _KINDS.values() for key in keys)}
    known |= {f"has_{kind}_limits" for kind in _KINDS}
    unknown = [key for key in values if key not in known]
    if unknown:
        _refuse(file, f"{where}.{unknown[0]}", sorted(known))
    found = {}
    for kind, keys in _KINDS.items():
        flag = f"has_{kind}_limits"
        has = values.get(flag, False)
        if not isinstance(has, bool):
            raise FileFormatError(f"{file}: {where}.{flag} is {has!r}, expected true or false")
        if has:
            missing = [key for key in keys if key not in values]
            if missing:
                raise FileFormatError(
                    f"{file}: {where}: {flag} is true, but {missing[0]} is missing"
                )
            found.update({key: _number(file, f"{where}.{key}", values[key]) for key in keys})
            if kind == "deceleration":
                # Pilz's planner writes them as negative accelerations.
                found["max_deceleration"] = abs(found["max_deceleration"])
        elif flag not in values and any(key in values for key in keys):
            raise FileFormatError(
                f"{file}: {where}.{keys[-1]} has no effect without {flag}; say true or false"
            )
    for key, value in found.items():
        if key not in _KINDS["position"] and value <= 0.0:
            raise FileFormatError(f"{file}: {where}.{key} is {value:g}, expected a number above 0")
    if found.get("min_position", -np.inf) >= found.get("max_position", np.inf):
        raise FileFormatError(
            f"{file}: {where}: min_position {found['min_position']:g} is not below max_position "
            f"{found['max_position']:g}"
        )
    return found


def _number(file: Path, where: str, value: Any) -> float:
    if not (is_number(value) and abs(value) <= _MOST):
        raise FileFormatError(f"{file}: {where} is {value!r}, expected a finite number")
    return float(value)


def _refuse(file: Path, key: str, known: Any) -> None:
    name = key.rpartition(".")[2]
    raise FileFormatError(f"{file}: {key}: unknown key{nearest(name, known)}")
