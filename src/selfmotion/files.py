"""Files of problems, jobs, tool motions and joint motions: readers and writers."""

from selfmotion.formats import (
    Job,
    ProgramSettings,
    SeamJob,
    read_job,
    read_joint_limits,
    read_motion,
    read_parts,
    read_path,
    read_program_settings,
    read_seam_job,
    write_motion,
    write_parts,
    write_problem,
)
from selfmotion.result import (
    load_move,
    load_parts,
)

__all__ = [
    "Job",
    "ProgramSettings",
    "SeamJob",
    "load_move",
    "load_parts",
    "read_job",
    "read_joint_limits",
    "read_motion",
    "read_parts",
    "read_path",
    "read_program_settings",
    "read_seam_job",
    "write_motion",
    "write_parts",
    "write_problem",
]
