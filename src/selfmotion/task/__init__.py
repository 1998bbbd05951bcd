"""What of the tool's motion is prescribed: rows, bands around them, damping near singular poses."""

from selfmotion.task.damping import Damping, DampingLaw
from selfmotion.task.feedback import feedback_rate
from selfmotion.task.poses import as_pose
from selfmotion.task.relaxation import POSITION_ROWS, ROW_NAMES, Relaxation
from selfmotion.task.rows import Task

__all__ = [
    "POSITION_ROWS",
    "ROW_NAMES",
    "Damping",
    "DampingLaw",
    "Relaxation",
    "Task",
    "as_pose",
    "feedback_rate",
]
