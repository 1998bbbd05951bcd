"""Files that people write and robots read: problems, tool motions, joint motions."""

from typing import Any

from selfmotion.formats.controller_program import (
    check_controller as check_controller,
    check_signals as check_signals,
)
from selfmotion.formats.documents import (
    in_si as in_si,
    read_document as read_document,
    read_values as read_values,
    write_document as write_document,
)
from selfmotion.formats.example import example_text as example_text, example_texts as example_texts
from selfmotion.formats.followers import (
    followers as followers,
    without_followers as without_followers,
)
from selfmotion.formats.job import Job as Job
from selfmotion.formats.joint_limits import read_joint_limits as read_joint_limits
from selfmotion.formats.judged_programs import (
    as_shifted as as_shifted,
    judged_motion as judged_motion,
    judged_program as judged_program,
    misswitched as misswitched,
    of_the_controller as of_the_controller,
    part_of as part_of,
    shift_told as shift_told,
    stated_deviation as stated_deviation,
)
from selfmotion.formats.motion_parts import read_parts as read_parts, write_parts as write_parts
from selfmotion.formats.motions import (
    FORMS as FORMS,
    MESSAGES as MESSAGES,
    READABLE as READABLE,
    SUFFIXES as SUFFIXES,
    read_motion as read_motion,
    write_motion as write_motion,
)
from selfmotion.formats.moving_ends import moving_ends as moving_ends
from selfmotion.formats.overrides import (
    grid_documents as grid_documents,
    parse_setting as parse_setting,
    set_key as set_key,
    write_combination as write_combination,
)
from selfmotion.formats.path_files import (
    PATH_SUFFIXES as PATH_SUFFIXES,
    events_of as events_of,
    has_normals as has_normals,
    read_path as read_path,
)
from selfmotion.formats.pieces import by_targets as by_targets
from selfmotion.formats.poses import pose_of as pose_of
from selfmotion.formats.problem_file import (
    job_of as job_of,
    read_job as read_job,
    read_problem as read_problem,
)
from selfmotion.formats.problem_parts import obstacle as obstacle, path_of as path_of
from selfmotion.formats.problem_writing import (
    write_problem as write_problem,
)
from selfmotion.formats.program_files import (
    PROGRAMS as PROGRAMS,
    READ_PROGRAMS as READ_PROGRAMS,
    program_miss as program_miss,
    read_program as read_program,
)
from selfmotion.formats.program_settings import (
    ProgramSettings as ProgramSettings,
    read_program_settings as read_program_settings,
)
from selfmotion.formats.samples import (
    LinearMiss as LinearMiss,
    coarsest_rate as coarsest_rate,
    linear_miss as linear_miss,
)
from selfmotion.formats.seam_job import (
    SeamJob as SeamJob,
    read_seam_job as read_seam_job,
    seam_job_of as seam_job_of,
)


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of problem and job files, for editors."""
    from selfmotion.formats import schema

    return schema.json_schema()
