"""Joint torques at all times."""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, read_only
from selfmotion.certificate.findings import Finding
from selfmotion.certificate.requirement import FinishedMotion, Requirement
from selfmotion.certificate.shares import largest_share, too_far
from selfmotion.robot import Dynamics


@dataclass(frozen=True, eq=False)
class JointTorques(Requirement):
    """|τ| stays below the limit of each joint, at all times.

    Attributes
    ----------
    dynamics : Dynamics
    limit : (n,)
        [Nm, or N]; inf where there is none.
    """

    dynamics: Dynamics
    limit: Array
    name: str = "joint torque limits"

    def __post_init__(self) -> None:
        object.__setattr__(self, "limit", read_only(self.limit))

    @property
    def covers(self) -> tuple[str, ...]:
        """See `Requirement.covers`."""
        return ("torques",)

    def judge(self, motion: FinishedMotion) -> Finding:
        """See `Requirement.judge`: the largest share of a limit."""
        worst = largest_share(motion.trajectory, self._shares)
        if worst is None:
            return too_far(self.name, motion)
        share, time, joint = worst
        name = motion.robot.joint_names[joint]
        torque = share * self.limit[joint] if share > 0.0 else 0.0  # 0 may have no limit
        text = (
            f"joint '{name}' needs {torque:.4g} Nm or N at t = {time:.3f} s, "
            f"{share:.5g} times its limit of {self.limit[joint]:.4g}"
        )
        return Finding(self.name, name, time, share, 1.0, bool(share <= 1.0), text)

    def _shares(self, q: Array, qd: Array, qdd: Array) -> Array:
        return np.asarray(self.dynamics.torques(q, qd, qdd) / self.limit)
