"""Motions of a cell in a file for each part, in step."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from selfmotion.basics import (
    FileFormatError,
    ProblemError,
    as_flag,
    as_path,
    shown,
)
from selfmotion.model.motion import Trajectory
from selfmotion.planning.result import Plan
from selfmotion.shop.controllers.controller_arms import check_joints
from selfmotion.shop.controllers.motions import (
    STREAM,
    WRITERS,
    check_verified,
    form_of,
    read_motion,
)
from selfmotion.shop.controllers.samples import (
    MotionSamples,
    check_ends,
    within_limits_at,
)


def write_parts(
    plan: Plan,
    file: str | Path,
    *,
    rate: float | None = None,
    format: str | None = None,
    force: bool = False,
) -> dict[str, Path]:
    """Write the motion of a cell in a file for each part: part → file.

    Of ``motion.yaml`` they are called ``motion.PART.yaml``. All have the same times, and each the
    names that its joints have in the part's own robot. Parameters as in `write_motion`, which
    writes all joints into one file.

    Raises
    ------
    FileFormatError
        The format is unknown, or a file cannot be written.
    ProblemError
        The robot has no parts, the rate gives no samples, or a part has what the format cannot say.
    """
    if not isinstance(plan, Plan):
        raise ProblemError(f"plan is {shown(plan)}, expected a Plan")
    names = plan.robot.joint_names
    alone = [name for name in names if "/" not in name]
    if alone:
        raise ProblemError(
            f"{plan.robot.name}: joint '{alone[0]}' is of no part; only a cell of several robots "
            f"is written part by part"
        )
    path = as_path(file)
    name = form_of(path, format)
    if name not in WRITERS:
        raise FileFormatError(f"{path}: a program moves all joints of a cell; it has no parts")
    check_verified(plan, path, as_flag(force, "force"))
    check_ends(plan, path, force)
    write = WRITERS[name]
    plan = within_limits_at(plan, rate)
    rate = STREAM if name == "urscript" and rate is None else rate
    samples, written = MotionSamples.of(plan.trajectory, rate), {}
    parts = list(dict.fromkeys(name.partition("/")[0] for name in names))
    if name == "urscript":
        # Before the first file is written.
        for part in parts:
            check_joints(plan.robot, samples.of_part(part).robot_joints, f"part '{part}'")
    for part in parts:
        written[part] = path.with_name(f"{path.stem}.{part}{path.suffix}")
        write(written[part], samples.of_part(part), plan.robot, rate)
    return written


def read_parts(files: Mapping[str, str | Path]) -> Trajectory:
    """Read the motion of a cell from a file for each part, as `write_parts` returns them.

    Raises
    ------
    FileFormatError
        A file cannot be read, is no motion, or has other times than the first.
    """
    motions = {part: read_motion(file) for part, file in files.items()}
    if not motions:
        raise FileFormatError("there is no file of a part, expected part → file")
    first_part, first = next(iter(motions.items()))
    for part, motion in motions.items():
        if not np.array_equal(motion.t, first.t):
            raise FileFormatError(
                f"{files[part]}: has {len(motion.t)} samples over {motion.duration:.6g} s, at "
                f"other times than {files[first_part]} with {len(first.t)} over "
                f"{first.duration:.6g} s: parts that move together are written together"
            )
    several = list(motions.values())
    accelerations = [motion.qdd for motion in several if motion.qdd is not None]
    return Trajectory(
        first.t,
        np.hstack([motion.q for motion in several]),
        np.hstack([motion.qd for motion in several]),
        tuple(f"{part}/{name}" for part, motion in motions.items() for name in motion.joint_names),
        np.hstack(accelerations) if len(accelerations) == len(several) else None,
    )
