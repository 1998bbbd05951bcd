"""A cost that counts more, or less."""

from dataclasses import dataclass, field

from selfmotion.basics import Array
from selfmotion.costs.base import Cost, Partials
from selfmotion.costs.samples import Samples
from selfmotion.follow import Follows


@dataclass(frozen=True, eq=False)
class Scaled(Cost):
    """Another cost, G times a factor.

    Parameters
    ----------
    cost : Cost
        The other cost.
    factor : float
        What it is multiplied by.
    """

    cost: Cost
    factor: float
    name: str = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", self.cost.name)

    def value(self, samples: Samples) -> Array:
        """See `Cost.value`."""
        return self.factor * self.cost.value(samples)

    def gradient(self, samples: Samples) -> Partials:
        """See `Cost.gradient`."""
        found = self.cost.gradient(samples)
        parts = (found.q, found.qd, found.qdd, found.qddd, found.error)
        return Partials(*(None if part is None else self.factor * part for part in parts))

    def curvature(self, dof: int) -> dict[int, Array]:
        """See `Cost.curvature`."""
        own = self.cost.curvature(dof)
        return {order: self.factor * matrix for order, matrix in own.items()}

    def check(self, follows: Follows) -> None:
        """See `Cost.check`."""
        self.cost.check(follows)
