"""Joints that are held, in Pinocchio's terms."""

from collections.abc import Mapping
from typing import Any

import pinocchio as pin

from selfmotion.basics import Array


def locked_configuration(model: Any, locked: Mapping[str, float]) -> tuple[Array, list[int]]:
    """Return a full configuration with the locked joints set, and the indices of those joints."""
    reference: Array = pin.neutral(model)
    ids = []
    for index in range(1, model.njoints):
        name, joint = model.names[index], model.joints[index]
        if name in locked:
            reference[joint.idx_q] = locked[name]
            ids.append(index)
        elif joint.nq != 1:
            ids.append(index)
    return reference, ids
