"""What the planner of the page is asked for, and what it finds."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from selfmotion.model.path import Path
from selfmotion.planning.result import Parts, Plan
from selfmotion.shell.replay import Replayed, SeamMaps
from selfmotion.shell.view.placement_map import PlacementMap
from selfmotion.work.job import Program


@dataclass(frozen=True, eq=False)
class Request:
    """A document to plan.

    Attributes
    ----------
    number : int
        Requests are counted; the last one counts.
    document : dict
    drag : (int, str) or None
        Of a handle that is chosen: the how manieth drag it is, and the handle's name.
    is_held : bool
        Whether a handle is being dragged, or a slider moved.
    """

    number: int
    document: Mapping[str, Any]
    drag: tuple[int, str] | None = None
    is_held: bool = False


@dataclass(frozen=True, eq=False)
class Outcome:
    """What came of a request.

    Attributes
    ----------
    request : Request
    kind : {"coarse", "early", "whole", "none"}
        A first motion; of a job a program in the order before; what is planned; no motion at all.
    words : str
        The verdict, or what stops it.
    replayed : Replayed or None
        A plan, or the steps of several seams; None where the document describes no problem.
        Without a motion, the arm standing in its place, along with what it has to follow.
    made : Program, Parts or None
        What the steps are of: a job's program, or a motion in parts.
    unmade : tuple of Path
        Of a job the paths of the seams that are not made.
    maps : tuple of SeamMaps
        Redundancy maps, when they are made.
    placements : PlacementMap or None
        Of a handle that is chosen: where it could be as well.
    is_brief : bool
        Whether there is more to tell of it, which takes longer: distances, the redundancy map.
    """

    request: Request
    kind: str
    words: str
    replayed: Replayed | None
    made: Program | Parts | None = None
    unmade: tuple[Path, ...] = ()
    maps: tuple[SeamMaps, ...] = ()
    placements: PlacementMap | None = None
    is_brief: bool = True

    @property
    def verified(self) -> bool:
        """Whether it is a motion that is verified."""
        return self.replayed is not None and self.replayed.verified

    @property
    def plan(self) -> Plan | None:
        """Its motion; of several seams a plan that stands for them."""
        return None if self.replayed is None else self.replayed.plan


class NewerRequest(BaseException):
    """Leaves a plan that nobody waits for any more; no error, so that nothing catches it."""
