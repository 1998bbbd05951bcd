"""Many seams, one program."""

from selfmotion.job.files import load_program as load_program
from selfmotion.job.program import Program as Program, Step as Step
from selfmotion.job.run import plan_job as plan_job
from selfmotion.job.seam import Seam as Seam
