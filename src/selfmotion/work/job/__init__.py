"""Many seams, one program."""

from selfmotion.work.job.highest_feed import (
    FASTEST_FEED as FASTEST_FEED,
    FeedFound as FeedFound,
    highest_feed as highest_feed,
)
from selfmotion.work.job.program import Program as Program, write_timetable as write_timetable
from selfmotion.work.job.program_loading import load_program as load_program
from selfmotion.work.job.run import plan_job as plan_job
from selfmotion.work.job.seam import (
    Seam as Seam,
    are_opposite as are_opposite,
    backwards as backwards,
)
from selfmotion.work.job.specification import Specification as Specification
from selfmotion.work.job.step import Step as Step
from selfmotion.work.job.work import problem_of_seam as problem_of_seam

__all__ = ["FeedFound", "Specification", "Step", "highest_feed"]
