"""What of the tool's motion is prescribed: rows, bands around them, damping near singular poses."""

from selfmotion.task.damping import Damping as Damping, DampingLaw as DampingLaw
from selfmotion.task.feedback import feedback_rate as feedback_rate
from selfmotion.task.poses import as_pose as as_pose
from selfmotion.task.relaxation import (
    POSITION_ROWS as POSITION_ROWS,
    ROW_NAMES as ROW_NAMES,
    Relaxation as Relaxation,
)
from selfmotion.task.rows import Task as Task
from selfmotion.task.se3 import (
    SE3 as SE3,
    Jexp3 as Jexp3,
    Quaternion as Quaternion,
    exp3 as exp3,
    log3 as log3,
    rpy as rpy,
    skew as skew,
)
from selfmotion.task.turns import (
    SMALL_TURN as SMALL_TURN,
    left_derivative as left_derivative,
    left_matrices as left_matrices,
    skews as skews,
    turn as turn,
    turning as turning,
)
