"""Which pairs of bodies are checked: all that can meet, but for what touches as it is made."""

from collections.abc import Sequence
from dataclasses import dataclass

from selfmotion.collision.bodies import Body
from selfmotion.collision.found import Overlap
from selfmotion.collision.overlaps import SAMPLES, counts_of, links_of
from selfmotion.collision.pairs import are_neighbours, are_placed_apart, candidate_pairs
from selfmotion.robot import RobotModel

# The share of sampled configurations from which on an overlap of links is worth telling.
_OFTEN = 0.5


@dataclass(frozen=True, eq=False)
class Checked:
    """The pairs of bodies that are checked, and what is known of all.

    Attributes
    ----------
    pairs : tuple of (int, int)
        Indices of bodies.
    counts : dict
        See `Links.counts`, with what rides on links.
    overlapping, disabled
        See `CollisionModel`.
    """

    pairs: tuple[tuple[int, int], ...]
    counts: dict[tuple[int, int], tuple[int, int]]
    overlapping: tuple[Overlap, ...]
    disabled: tuple[tuple[str, str], ...]


def checked_pairs(
    robot: RobotModel, bodies: Sequence[Body], disabled: Sequence[tuple[str, str]]
) -> Checked:
    """Return which pairs of bodies are checked, the robot's own links first among these.

    Raises
    ------
    CollisionError
        See `candidate_pairs`.
    """
    candidates = candidate_pairs(bodies, robot.urdf, disabled)
    known = links_of(robot).counts
    riding = [(i, j) for i, j in candidates if (i, j) not in known and not bodies[j].is_obstacle]
    counts = {**known, **counts_of(robot, bodies, riding)}
    # What overlaps in each configuration, and was not placed there, is made to.
    always = {
        (i, j)
        for (i, j), (met, _) in counts.items()
        if met == SAMPLES and not are_placed_apart(bodies[i].link, bodies[j].link, robot.urdf)
    }
    # Next to a joint, all pieces of two links of which some are.
    as_made = {frozenset(pair) for pair in robot.touching} | {
        frozenset((bodies[i].name, bodies[j].name))
        for i, j in always
        if are_neighbours(bodies[i].link, bodies[j].link, robot.urdf)
    }
    pairs: list[tuple[int, int]] = []
    often: dict[tuple[str, str, bool], int] = {}
    for pair in candidates:
        met, _ = counts.get(pair, (0, 0))
        names = bodies[pair[0]].name, bodies[pair[1]].name
        is_checked = pair not in always and frozenset(names) not in as_made
        if is_checked:
            pairs.append(pair)
        if met >= _OFTEN * SAMPLES or (met and not is_checked):
            key = *names, is_checked
            often[key] = max(met, often.get(key, 0))
    overlapping = tuple(
        Overlap(first, second, met / SAMPLES, is_checked)
        for (first, second, is_checked), met in often.items()
    )
    kept = {(bodies[i].name, bodies[j].name) for i, j in candidates}
    every = candidate_pairs(bodies, robot.urdf) if disabled else candidates
    named = dict.fromkeys((bodies[i].name, bodies[j].name) for i, j in every)
    left_out = tuple(pair for pair in named if pair not in kept)
    return Checked(tuple(pairs), counts, overlapping, left_out)
