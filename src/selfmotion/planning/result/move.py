"""A joint motion from one configuration to another, and its file."""

import dataclasses
from collections.abc import MutableMapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path as FilePath
from typing import Any

from selfmotion.basics import (
    FileFormatError,
    PlanError,
    SelfmotionError,
    as_path,
    read_archive,
    write_archive,
)
from selfmotion.certificate import (
    AtRest,
    Finding,
    FinishedMotion,
    Requirement,
    arm_limits,
    covered_by,
)
from selfmotion.model.collision import Obstacle
from selfmotion.model.motion import Trajectory
from selfmotion.model.robot import RobotModel
from selfmotion.planning.result.archive import (
    arrays_of,
    check_version,
    file_digest,
    in_order_of,
    trajectory_of,
)
from selfmotion.problem.constraints import Constraint
from selfmotion.problem.problem import arm_and_constraints, describe_arm

# Version of the format: raised with every change that older versions cannot read.
_FORMAT = 1


@dataclass(frozen=True, eq=False)
class Move:
    """A joint motion from rest to rest.

    Attributes
    ----------
    robot : RobotModel
        The arm.
    constraints : tuple of Constraint
        Conditions at all times.
    trajectory : Trajectory or None
        None where none was found.
    reason : str
        Cause of its absence, or a further objection: a file that was changed.
    """

    robot: RobotModel
    constraints: tuple[Constraint, ...]
    trajectory: Trajectory | None
    reason: str = ""

    def __post_init__(self) -> None:
        if self.trajectory is not None:
            motion = in_order_of(self.robot, self.trajectory)
            object.__setattr__(self, "trajectory", motion)

    def __repr__(self) -> str:
        """Return two lines: how long it takes, and the verdict."""
        found = "none found" if self.trajectory is None else f"{self.trajectory.duration:.6g} s"
        return f"Move({self.robot.name}, {found})\n  {self.verdict}"

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """Finding of each requirement, at all times. Computed on first use."""
        if self.trajectory is None:
            return ()
        finished = FinishedMotion(self.robot, self.trajectory)
        return tuple(item.judge(finished) for item in self.requirements)

    @property
    def trouble(self) -> str:
        """Its first violation, or the cause of its absence; "" for none."""
        broken = [item.text for item in self.findings if not item.satisfied]
        return "; ".join(filter(None, (self.reason, *broken)))

    @property
    def verified(self) -> bool:
        """Whether there is a motion that satisfies all requirements."""
        return self.trajectory is not None and not self.trouble

    @property
    def verdict(self) -> str:
        """One line: verified, with the checks at all times, or the violation."""
        if not self.verified:
            return f"not verified: {self.trouble}"
        return f"verified at all times ({', '.join(covered_by(self.requirements))})"

    @property
    def requirements(self) -> tuple[Requirement, ...]:
        """Requirements that it is judged by."""
        own = tuple(item.requirement(self.robot) for item in self.constraints)
        return (AtRest(True, True, (True, True)), *arm_limits(self.robot, own), *own)

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """The obstacles that the requirements are about."""
        return tuple(body for item in self.requirements for body in item.obstacles)

    @property
    def motion(self) -> Trajectory:
        """The trajectory; PlanError where none was found."""
        if self.trajectory is None:
            raise PlanError(f"{self.robot.name}: {self.trouble}")
        return self.trajectory

    def require(self) -> "Move":
        """Return the move itself if it is verified.

        Raises
        ------
        PlanError
            It is not; the message is the verdict.
        """
        if not self.verified:
            raise PlanError(f"{self.robot.name}: {self.verdict}")
        return self

    def save(self, file: str | FilePath) -> None:
        """Write the move, without loss, to a ``.npz`` file that `load_move` reads; atomically.

        Raises
        ------
        PlanError
            None was found.
        """
        motion = self.motion
        description: dict[str, Any] = {
            "move": _FORMAT,
            **describe_arm(self.robot, self.constraints),
            "joint_names": list(motion.joint_names),
            "findings": [dataclasses.asdict(item) for item in self.findings],
        }
        if self.reason:
            # Writing an altered move to a new file does not make it verified.
            description["reason"] = self.reason
        arrays = arrays_of(motion)
        description["digest"] = file_digest(description, arrays)
        write_archive(as_path(file), description, arrays)


def is_move(file: str | FilePath) -> bool:
    """Whether a ``.npz`` file is one that `Move.save` wrote.

    Raises
    ------
    FileFormatError
        The file is missing, or neither a move nor a plan.
    """
    return "move" in read_archive(as_path(file))[0]


def load_move(file: str | FilePath, *, known: MutableMapping[str, Any] | None = None) -> Move:
    """Read a move that `Move.save` wrote, and judge it anew.

    A file that was changed is never verified. `known` is that of `load_plan`.

    Raises
    ------
    FileFormatError
        The file is missing, is no move, lacks something, or was written by another version.
    """
    path = as_path(file)
    description, arrays = read_archive(path)
    if "move" not in description and "format" in description:
        raise FileFormatError(f"{path}: is a plan, not a move: load_plan reads it")
    check_version(path, "move", description.get("move"), _FORMAT)
    written = description.pop("digest", None)
    altered = written != file_digest(description, arrays)
    try:
        robot, constraints = arm_and_constraints(description, {} if known is None else known)
        motion = trajectory_of(arrays, tuple(description["joint_names"]))
        reason = str(description.get("reason", ""))
        if altered:
            reason = f"{path.name} was changed after the move was written: its digest differs"
        move = Move(robot, constraints, motion, reason)
        # Judged here, where an error is one of the file.
        _ = move.findings
    except SelfmotionError as error:
        raise FileFormatError(f"{path}: is a damaged move: {error}") from error
    # Any number or key of a damaged file may be any other, and fail anywhere.
    except Exception as error:
        raise FileFormatError(f"{path}: is no move, or a damaged one: {error!r}") from error
    return move
