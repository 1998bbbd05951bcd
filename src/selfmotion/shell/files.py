"""Files of problems, jobs, tool motions and joint motions: readers and writers.

What can be loaded again, without loss, has `save`: plans, moves, parts and programs. Everything
else is written by a function ``write_…(thing, file)``; replays by `selfmotion.replay.write_replay`.
"""

from selfmotion.planning.planner import PlanRequest
from selfmotion.planning.result import (
    load_move,
    load_parts,
)
from selfmotion.shell.documents import (
    SeamJob,
    read_job,
    read_joint_limits,
    read_seam_job,
    write_problem,
)
from selfmotion.shell.sheet import write_sheet
from selfmotion.shop.cam import read_path
from selfmotion.shop.controllers import (
    ProgramSettings,
    read_motion,
    read_parts,
    read_program_settings,
    write_motion,
    write_parts,
)
from selfmotion.work.job import write_timetable
from selfmotion.work.placement import write_placement

# What `PlanRequest` was called before; it goes with the next version.
Job = PlanRequest

__all__ = [
    "PlanRequest",
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
    "write_placement",
    "write_problem",
    "write_sheet",
    "write_timetable",
]
