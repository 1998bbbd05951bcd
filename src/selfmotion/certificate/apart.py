"""Distance of the arm from obstacles and from itself."""

from dataclasses import dataclass

from selfmotion.certificate.findings import Finding
from selfmotion.certificate.requirement import FinishedMotion, Requirement
from selfmotion.collision import CollisionModel, Obstacle


@dataclass(frozen=True, eq=False)
class KeepsApart(Requirement):
    """Bodies keep a distance from each other.

    Attributes
    ----------
    model : CollisionModel
        The bodies, and which pairs of them count.
    distance : float
        Smallest distance [m].
    """

    model: CollisionModel
    distance: float
    name: str = "clearance"

    def judge(self, motion: FinishedMotion) -> Finding:
        """See `Requirement.judge`: the closest pair."""
        closest = self.model.worst(motion.q)
        names = f"{closest.first} - {closest.second}" if closest.first else "nothing"
        time = float(motion.t[closest.index])
        text = (
            f"{names} are {closest.value * 1e3:.2f} mm apart at t = {time:.3f} s (wanted: "
            f"{self.distance * 1e3:.2f} mm)"
        )
        kept = bool(closest.value >= self.distance)
        return Finding(self.name, names, time, closest.value, self.distance, kept, text)

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """See `Requirement.obstacles`."""
        return self.model.obstacles
