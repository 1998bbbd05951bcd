"""One step of a program: a seam, a move or a wait."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from selfmotion.model.collision import Obstacle
from selfmotion.model.motion import Trajectory
from selfmotion.planning.result import Move, Plan
from selfmotion.problem.constraints import Clearance, Constraint, clearances_among


@dataclass(frozen=True, eq=False)
class Step:
    """One seam of a program, a move, or a wait.

    Attributes
    ----------
    name : str
        That of the seam; of a move ``"A → B"``.
    made : Plan or Move
    turned : bool
        Whether the seam is made from its end to its start.
    events : tuple of (str, float)
        What happens how long after its begin [s].
    leaves : tuple of Obstacle
        What stands there from its end on.
    may_meet : tuple of str
        Names of what stands there that it may meet.
    """

    name: str
    made: Plan | Move
    turned: bool = False
    events: tuple[tuple[str, float], ...] = ()
    leaves: tuple[Obstacle, ...] = ()
    may_meet: tuple[str, ...] = ()

    @property
    def is_seam(self) -> bool:
        """Whether it is a seam."""
        return isinstance(self.made, Plan)

    @property
    def is_missing(self) -> bool:
        """Whether it is a move that was not found."""
        return isinstance(self.made, Move) and self.made.trajectory is None

    @property
    def motion(self) -> Trajectory:
        """Its motion; PlanError for a move that was not found."""
        return self.made.motion if isinstance(self.made, Move) else self.made.trajectory

    @property
    def duration(self) -> float:
        """How long it takes [s]; 0 for a move that was not found."""
        return 0.0 if self.is_missing else self.motion.duration

    @property
    def happenings(self) -> list[tuple[str, float]]:
        """The events by their time; those at one time in the order in which they were given."""
        return sorted(self.events, key=lambda item: item[1])

    @property
    def constraints(self) -> tuple[Constraint, ...]:
        """The constraints of its plan or move."""
        made = self.made
        return made.constraints if isinstance(made, Move) else made.problem.all_constraints

    @property
    def trouble(self) -> str:
        """The fault, "" for none."""
        if isinstance(self.made, Move):
            return "" if self.made.verified else f"move '{self.name}': {self.made.trouble}"
        check = self.made.certificate
        return "" if check.verified else f"seam '{self.name}': {check.verdict}"

    def unchecked(
        self, obstacles: Mapping[str, Obstacle], clearance: Clearance | None = None
    ) -> list[str]:
        """Return the names of obstacles that it is not checked against.

        With `clearance`, not at its distance or more: another constraint may be about the same
        bodies.
        """
        bodies = self.made.obstacles if clearance is None else self._bodies_kept_clear_of(clearance)
        known = {item.name: item for item in bodies}
        return [
            name
            for name, item in obstacles.items()
            if name not in self.may_meet and not same_body(known.get(name), item)
        ]

    def _bodies_kept_clear_of(self, clearance: Clearance) -> tuple[Obstacle, ...]:
        """Return the bodies from which it keeps the distance of a clearance, or more."""
        far = (item for item in clearances_among(self.constraints) if item.keeps_as_far(clearance))
        return tuple(body for item in far for body in item.obstacles)


def same_body(one: Obstacle | None, other: Obstacle) -> bool:
    """Whether two bodies are one, and in the same place."""
    return one is other or (one is not None and one.to_dict() == other.to_dict())
