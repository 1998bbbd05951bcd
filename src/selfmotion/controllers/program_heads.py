"""What programs say around their motion: their heads, and the comments before a stretch."""

from collections.abc import Iterator, Sequence

import numpy as np

from selfmotion.controllers.controller_program import ControllerProgram, Draft
from selfmotion.controllers.feed_stretches import FeedStretch
from selfmotion.controllers.pose_stretches import PoseStretch
from selfmotion.controllers.program_texts import (
    BECAUSE,
    KEPT,
    PLANNED,
    folded,
    pin_values,
    plain,
    rounded_up,
    stated,
)
from selfmotion.controllers.stretches import NO_MISS, Stretch
from selfmotion.controllers.thinning import TIME_DIGITS


def with_begins(stretches: Sequence[Stretch]) -> Iterator[tuple[Stretch, Stretch | None]]:
    """Yield each stretch, and one to whose begin the arm has to go slowly before; else None.

    That is where targets of the other kind follow, poses after joints or joints after poses, rests
    in between included: where the work object was shifted, the arm is elsewhere by the other ones.
    A program begins by joints.
    """
    by_poses = False
    for k, stretch in enumerate(stretches):
        moving = next((item for item in stretches[k:] if not item.is_rest), None)
        begun = None
        if moving is not None and by_poses != isinstance(moving, PoseStretch):
            by_poses, begun = not by_poses, moving
        yield stretch, begun


def head(draft: Draft) -> list[str]:
    """Return the comments at the head of a program, without what marks them as such."""
    program = draft.program
    axes = ", ".join(
        f"{axis.name} = {axis.joint} [{'mm' if axis.slides else 'deg'}]" for axis in program.axes
    )
    moves = program.miss.moves
    targets = "target" if program.targets == 1 else "targets"
    return [
        plain(f"selfmotion: {draft.robot.name}, {program.targets} {targets}"),
        *folded(plain(draft.verdict)),
        *folded(plain(f"axes: {axes}")),
        *_of_speeds(program),
        f"deviation: {stated(program.miss.path)}",
        *([] if moves == NO_MISS else [f"deviation of moves: {stated(moves)}"]),
        f"(of the tool from the plan, straight {_lines(draft)}, rounded corners or a spline",
        "through the targets, at the times of the plan; of seams at speeds where the tool has gone",
        "as far)",
        *([f"{BECAUSE}{program.remark}"] if program.remark else []),
        *_of_poses(draft),
        "Angles are those of the URDF: compare zeros and signs with the controller's.",
    ]


def speeds_of(program: ControllerProgram) -> list[float]:
    """Return the speeds of its seams, each once [m/s]."""
    at_speeds = (item for item in program.stretches if isinstance(item, FeedStretch))
    return sorted({float(speed) for item in at_speeds for speed in item.speeds})


def goes_round(program: ControllerProgram) -> bool:
    """Whether it has circular motions."""
    at_speeds = (item for item in program.stretches if isinstance(item, FeedStretch))
    return any(bool(np.isfinite(item.vias).any()) for item in at_speeds)


def before(stretch: Stretch) -> list[str]:
    """Return the comments before a stretch, without what marks them as such."""
    planned = isinstance(stretch, FeedStretch)
    return [
        *([plain(stretch.remark)] if stretch.remark else []),
        *([f"{PLANNED}{stretch.duration:.{TIME_DIGITS}f} s"] if planned else []),
    ]


def _of_speeds(program: ControllerProgram) -> list[str]:
    """Return what the head says of seams at speeds."""
    within = program.within
    if within is None:
        return []
    return [
        f"{KEPT}{rounded_up(1e3 * within.position, 6)} mm, {rounded_up(within.rotation, 9)} rad",
        "(seams are at their feeds, and keep that of what is prescribed; where the tool may turn,",
        "and the arm's self-motion, are off the plan by what follows. Run-up and run-down, and so",
        "when the tool is where, are the controller's)",
    ]


def _lines(draft: Draft) -> str:
    return "joint lines" if draft.frames is None else "lines of the tool"


def _of_poses(draft: Draft) -> list[str]:
    """Return what the head says of the frames of poses; the reader takes it from there."""
    frames = draft.frames
    if frames is None:
        return []
    place = ", ".join(f"{value:.9f}" for value in pin_values(frames.work))
    flange = draft.settings.flange or "-"
    return [
        f"poses: work object {frames.name} of {frames.carrier}, flange {flange}",
        f"planned work object: {place}",
        "(m, and quaternion x, y, z, w, in that frame; shift the work object to shift the motion)",
        "Poses are reached in the arm's configuration at the begin, by axes.",
    ]
