"""One step of a program: a seam, a move or a wait."""

from collections.abc import Mapping
from dataclasses import dataclass

from selfmotion.collision import Obstacle
from selfmotion.constraints import Clearance, Constraint
from selfmotion.motion import Trajectory
from selfmotion.result import Move, Plan, keeps_as_far


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
        """What it is judged by."""
        made = self.made
        return made.constraints if isinstance(made, Move) else made.problem.all_constraints

    @property
    def trouble(self) -> str:
        """What is wrong with it, "" for nothing."""
        if isinstance(self.made, Move):
            return "" if self.made.verified else f"move '{self.name}': {self.made.trouble}"
        check = self.made.certificate
        return "" if check.verified else f"seam '{self.name}': {check.verdict}"

    def meets(self, standing: Mapping[str, Obstacle], apart: Clearance | None = None) -> list[str]:
        """Return the names of what it is not checked against, though it stands there.

        With `apart`, at its distance or more: another requirement may be about the same bodies.
        """
        bodies = self.made.obstacles if apart is None else self._kept_from(apart)
        known = {item.name: item for item in bodies}
        return [
            name
            for name, item in standing.items()
            if name not in self.may_meet and not _same(known.get(name), item)
        ]

    def _kept_from(self, apart: Clearance) -> tuple[Obstacle, ...]:
        """Return the bodies from which it keeps as far as a clearance asks, or farther."""
        far = (item for item in self.constraints if keeps_as_far(item, apart))
        return tuple(body for item in far if isinstance(item, Clearance) for body in item.obstacles)


def _same(one: Obstacle | None, other: Obstacle) -> bool:
    """Whether two bodies are one, and in the same place."""
    return one is other or (one is not None and one.to_dict() == other.to_dict())
