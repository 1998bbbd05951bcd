"""Comments that a writer puts at the head of a program and before its segments."""

from selfmotion.shop.controllers.controller_program import ControllerProgram
from selfmotion.shop.controllers.deviations import NO_DEVIATION, Deviation
from selfmotion.shop.controllers.feed_segments import FeedSegment
from selfmotion.shop.controllers.program_comments import COMMENTS
from selfmotion.shop.controllers.program_draft import Draft
from selfmotion.shop.controllers.program_facts import with_checksum
from selfmotion.shop.controllers.program_texts import as_word, folded, plain, pose_values
from selfmotion.shop.controllers.segments import Segment


def head_comments(draft: Draft) -> list[str]:
    """Return the comments at the head of a program, without what marks them as such."""
    program = draft.program
    axes = ", ".join(
        f"{axis.name} = {as_word(axis.joint)} [{'mm' if axis.slides else 'deg'}]"
        for axis in program.axes
    )
    moves = program.deviation.moves
    targets = "target" if program.targets == 1 else "targets"
    lines = "joint lines" if draft.frames is None else "lines of the tool"
    notes = [
        plain(f"selfmotion: {draft.robot.name}, {program.targets} {targets}"),
        plain(draft.verdict),
        plain(COMMENTS.text("axes", text=axes)),
        *draft.facts.notes,
        *_feed_comments(program),
        _deviation_comment("deviation", program.deviation.path),
        *([] if moves == NO_DEVIATION else [_deviation_comment("deviation of moves", moves)]),
        f"(of the tool from the plan, whether the controller goes along {lines}, rounds corners",
        "or follows a spline through the targets, at the times of the plan; of seams at feeds,",
        "where the tool has gone as far)",
        *([COMMENTS.text("joint targets", text=program.remark)] if program.remark else []),
        *_pose_comments(draft),
        "Angles are those of the URDF: compare zeros and signs with the controller's.",
    ]
    return [line for note in with_checksum(notes) for line in folded(note)]


def comments_before(segment: Segment) -> list[str]:
    """Return the comments before a segment, without what marks them as such."""
    planned = isinstance(segment, FeedSegment)
    return [
        *([plain(segment.remark)] if segment.remark else []),
        *([COMMENTS.text("planned", seconds=segment.duration)] if planned else []),
    ]


def _feed_comments(program: ControllerProgram) -> list[str]:
    """Return the comments of the head about seams at feeds."""
    within = program.feed_tolerance
    if within is None:
        return []
    return [
        COMMENTS.text("tolerance", length=1e3 * within.position, angle=within.rotation),
        "(seams are at their feeds, and keep that of what is prescribed; where the tool may turn,",
        "and the arm's self-motion, are off the plan by what follows. Run-up and run-down, and so",
        "when the tool is where, are the controller's)",
    ]


def _deviation_comment(kind: str, deviation: Deviation) -> str:
    """Return the comment that states a deviation."""
    return COMMENTS.text(
        kind, length=1e3 * deviation.position, angle=deviation.rotation, joint=deviation.joint
    )


def _pose_comments(draft: Draft) -> list[str]:
    """Return the comments of the head about the frames of poses, which the reader needs."""
    frames = draft.frames
    if frames is None:
        return []
    names = {"work": frames.name, "carrier": frames.carrier}
    return [
        COMMENTS.text("poses", **names, flange=draft.settings.flange or "-"),
        COMMENTS.text("planned work object", pose=pose_values(frames.work)),
        "(m, and quaternion x, y, z, w, in that frame; shift the work object to shift the motion)",
        "Poses are reached in the arm's configuration at the begin, by axes.",
    ]
