"""The tool's Jacobian and pose by Pinocchio: the one place with that sequence of calls."""

from typing import Any

import pinocchio as pin

from selfmotion.basics import Array

_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class ToolKinematics:
    """Asks Pinocchio for the tool's Jacobian and pose, with data of its own.

    Two of them may be used by two threads at once; one may not.

    Parameters
    ----------
    model : pinocchio.Model
    tool_id : int
        Index of the tool frame.

    Attributes
    ----------
    rotation, translation : (3, 3), (3,)
        The tool's pose at the last configuration, world axes: views of Pinocchio's own memory, that
        each call of `at` refreshes.
    """

    __slots__ = ("_data", "_model", "_tool_id", "rotation", "translation")

    def __init__(self, model: Any, tool_id: int) -> None:
        self._model, self._tool_id = model, tool_id
        self._data = model.createData()
        pose = self._data.oMf[tool_id]
        self.rotation: Array = pose.rotation
        self.translation: Array = pose.translation

    def at(self, q: Array) -> Array:
        """Return the Jacobian [v, ω] at `q` (n,), world axes, (6, n); place the tool."""
        pin.computeJointJacobians(self._model, self._data, q)
        pin.updateFramePlacement(self._model, self._data, self._tool_id)
        jacobian: Array = pin.getFrameJacobian(self._model, self._data, self._tool_id, _AXES)
        # Of a single joint it comes as a vector.
        return jacobian.reshape(6, -1)

    def place(self, q: Array) -> pin.SE3:
        """Return the tool's pose at `q` (n,), a copy; cheaper than with its Jacobian."""
        pin.forwardKinematics(self._model, self._data, q)
        return pin.SE3(pin.updateFramePlacement(self._model, self._data, self._tool_id))
