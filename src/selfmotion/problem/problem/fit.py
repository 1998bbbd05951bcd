"""The fit of a problem's path and task to its arm, whatever the joint motion."""

from collections.abc import Sequence
from typing import Any

from selfmotion.model.follow import Follows
from selfmotion.model.path import check_oriented
from selfmotion.model.task import Relaxation
from selfmotion.problem.problem.redundancy_checks import check_redundancy
from selfmotion.problem.problem.relaxation_checks import check_relaxations
from selfmotion.problem.problem.unit_checks import check_distance, check_speed


def check_fit(follows: Follows, relaxations: Sequence[Relaxation], start: Any = None) -> None:
    """Refuse a path that an arm cannot follow in a task's rows, whatever the joint motion.

    Parameters
    ----------
    follows : Follows
        Arm, paths and tasks.
    relaxations : sequence of Relaxation
        Of the first path.
    start : (n,) or str, optional
        Where the search for a sufficient tolerance begins; an error recommends that tolerance.

    Raises
    ------
    PathError
        The task prescribes orientations that the path does not have.
    ProblemError
        The arm cannot move the tool in all rows, a relaxation does not fit, or the path can only be
        meant in other units.
    RedundancyError
        There are as many rows as joints, and none is relaxed.
    """
    first = follows.items[0]
    for item in follows.items:
        check_oriented(item.path, item.task)
    check_relaxations(relaxations, first.path, first.task)
    check_redundancy(follows, relaxations, start)
    for item in follows.items:
        reach = follows.robot.reach_of(item.chain)
        check_distance(follows.robot, item.path, reach)
        check_speed(follows.robot, item.path, reach)
