"""Costs of saved plans, and what stands for those whose code is not saved with them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from selfmotion.basics import Array, ProblemError, is_known, restore
from selfmotion.model.robot import RobotModel
from selfmotion.problem.costs.base import Cost, Partials
from selfmotion.problem.costs.samples import Samples


def cost_from_dict(description: Mapping[str, Any], robot: RobotModel) -> Cost:
    """Return the cost that `Cost.to_dict` described; a `LostCost` where the code is not here."""
    if not is_known(Cost, description):
        kind = str(description.get("kind"))
        return LostCost(str(description.get("name", kind)), kind)
    cost: Cost = restore(Cost, description, robot=robot)
    return cost


@dataclass(frozen=True)
class LostCost(Cost):
    """A cost of a saved plan that was a function, or a class that is not imported here.

    A plan file carries no code. The motion can be checked and shown without it; planning again
    needs the cost itself.

    Parameters
    ----------
    name : str
    was : str
        Kind of the cost that was saved.
    """

    name: str
    was: str

    def value(self, samples: Samples) -> Array:
        """Raise ProblemError: the function of the cost is not saved."""
        raise ProblemError(
            f"cost '{self.name}' was a {self.was}, which the plan's file does not carry; give it "
            f"again: dataclasses.replace(problem, costs=[…])"
        )

    def gradient(self, samples: Samples) -> Partials:
        """Raise ProblemError, as `value` does."""
        raise ProblemError(f"cost '{self.name}' was a {self.was}, which is not known here")
