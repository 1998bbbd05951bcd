"""What of the tool's motion is prescribed: rows, bands around them, damping near singular poses."""

from selfmotion.task.damping import PATH_ERROR, Damping, DampingLaw
from selfmotion.task.relaxation import POSITION_ROWS, ROW_NAMES, Relaxation, deviation_size, excess
from selfmotion.task.rows import Task

__all__ = [
    "PATH_ERROR",
    "POSITION_ROWS",
    "ROW_NAMES",
    "Damping",
    "DampingLaw",
    "Relaxation",
    "Task",
    "deviation_size",
    "excess",
]
