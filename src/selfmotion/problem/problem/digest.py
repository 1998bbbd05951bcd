"""Identifier of what a certificate judges: a kept one is not taken for another problem's."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING

from selfmotion.basics import description_of, digest_of, digest_of_file
from selfmotion.model.robot import mesh_digests
from selfmotion.problem.constraints import Constraint
from selfmotion.problem.problem.envelopes import envelope_without_arm

if TYPE_CHECKING:
    from selfmotion.problem.problem.problem import Problem


def conditions_digest(problem: "Problem", former: Sequence[Constraint] | None = None) -> str:
    """Return an identifier of what the certificate of a problem judges.

    A digest of the arm, task frames, tolerances, start and constraints; costs and the null
    motion are left out, since no certificate judges them. Plans of former versions had clearances
    among their constraints, in `former` order.
    """
    robot = problem.robot
    arm = (robot.urdf.sha256, robot.joint_names, robot.tools, robot.reference)
    own = sorted(robot.urdf.continuous()), robot.locked, robot.touching
    damping = None if problem.damping is None else asdict(problem.damping)
    followed = [
        (item.path.duration, item.task.value, item.chain.tip_name, item.chain.base)
        for item in problem.follows.items
    ]
    every = problem.all_constraints if former is None else former
    judged = (*(item.path for item in problem.follows.items), *every)
    return digest_of(
        arm,
        own,
        robot.lower,
        robot.upper,
        robot.velocity_limit,
        # Limits of the arm that constraints use by default.
        robot.acceleration_limit,
        robot.jerk_limit,
        robot.effort_limit,
        damping,
        followed,
        [item.to_dict() for item in problem.relaxations],
        [description_of(item) for item in judged],
        problem.given_start,
        _mesh_digests(problem),
        problem.rest,
    )


def _mesh_digests(problem: "Problem") -> dict[str, str]:
    """Return digests of the mesh files of all collision bodies: names may stay the same."""
    if not envelope_without_arm(problem.robot, problem.all_constraints).bodies:
        return {}
    bodies = (body for item in problem.requirements for body in item.obstacles)
    files = {str(file): digest_of_file(file) for body in bodies for file in body.files}
    return {**mesh_digests(problem.robot.urdf, "collision"), **files}
