"""Tasks: prescribed rows of the tool's motion, relaxations, and damping near singular poses."""

from selfmotion.model.task.damping import (
    Damping as Damping,
    DampingLaw as DampingLaw,
    feedback_rate as feedback_rate,
)
from selfmotion.model.task.poses import (
    SE3 as SE3,
    Jexp3 as Jexp3,
    Quaternion as Quaternion,
    as_pose as as_pose,
    exp3 as exp3,
    log3 as log3,
    rpy as rpy,
    skew as skew,
)
from selfmotion.model.task.relaxation import (
    POSITION_ROWS as POSITION_ROWS,
    ROW_NAMES as ROW_NAMES,
    Relaxation as Relaxation,
)
from selfmotion.model.task.rotation_vectors import (
    exponential_coefficients as exponential_coefficients,
    exponentials as exponentials,
    products as products,
    rotation_vectors as rotation_vectors,
    skews as skews,
)
from selfmotion.model.task.rows import Task as Task
