"""Joint motions for controllers and simulators, written, read back and judged."""

from selfmotion.shop.controllers.controller_arms import (
    check_arm as check_arm,
    check_controller as check_controller,
)
from selfmotion.shop.controllers.controller_program import ControllerProgram as ControllerProgram
from selfmotion.shop.controllers.mimic_joints import (
    mimic_joints as mimic_joints,
    without_mimic_joints as without_mimic_joints,
)
from selfmotion.shop.controllers.motions import (
    FORMS as FORMS,
    MESSAGES as MESSAGES,
    READABLE as READABLE,
    SUFFIXES as SUFFIXES,
    motion_notes as motion_notes,
    motion_of_program as motion_of_program,
    read_motion as read_motion,
    write_motion as write_motion,
)
from selfmotion.shop.controllers.part_motions import (
    read_parts as read_parts,
    write_parts as write_parts,
)
from selfmotion.shop.controllers.program_draft import check_signals as check_signals
from selfmotion.shop.controllers.program_facts import held_in_words as held_in_words
from selfmotion.shop.controllers.program_files import (
    PROGRAMS as PROGRAMS,
    READ_PROGRAMS as READ_PROGRAMS,
    keeps_stated as keeps_stated,
    program_deviation as program_deviation,
    read_program as read_program,
)
from selfmotion.shop.controllers.program_judging import (
    header_faults as header_faults,
    judge_motion as judge_motion,
    judge_program as judge_program,
    judged_by_plan as judged_by_plan,
    stated_tolerance as stated_tolerance,
    unjudged_note as unjudged_note,
)
from selfmotion.shop.controllers.program_settings import (
    ProgramSettings as ProgramSettings,
    program_settings_of as program_settings_of,
    read_program_settings as read_program_settings,
)
from selfmotion.shop.controllers.program_steps import step_motions as step_motions
from selfmotion.shop.controllers.samples import (
    LinearDeviation as LinearDeviation,
    coarsest_rate as coarsest_rate,
    linear_deviation as linear_deviation,
    moving_ends as moving_ends,
    slowed_as as slowed_as,
    within_limits_at as within_limits_at,
)
from selfmotion.shop.controllers.shifted_work_objects import (
    as_shifted as as_shifted,
    is_nearer as is_nearer,
    shift_note as shift_note,
)
from selfmotion.shop.controllers.step_judging import worst_certificate as worst_certificate
from selfmotion.shop.controllers.switching_faults import switching_faults as switching_faults
from selfmotion.shop.controllers.target_constraints import (
    problem_of_targets as problem_of_targets,
)
from selfmotion.shop.controllers.work_objects import base_rotation_note as base_rotation_note
