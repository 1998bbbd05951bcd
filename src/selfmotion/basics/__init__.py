"""What every part of the package stands on: errors, arrays, progress, files, compilation."""

from selfmotion.basics.arrays import Array, per_joint, read_only
from selfmotion.basics.errors import (
    BreakdownError,
    CollisionError,
    FileFormatError,
    InverseKinematicsError,
    NoSequenceError,
    PathError,
    PlanError,
    ProblemError,
    RedundancyError,
    RenderError,
    RobotError,
    SelfmotionError,
    StartError,
)
from selfmotion.basics.files import (
    read_archive,
    read_rows,
    read_table,
    write_archive,
    write_atomically,
    write_csv,
)
from selfmotion.basics.jit import inlined, kernel
from selfmotion.basics.progress import Progress, silent
from selfmotion.basics.saved import Saved, is_known, restore
from selfmotion.basics.threads import one_blas_thread

__all__ = [
    "Array",
    "BreakdownError",
    "CollisionError",
    "FileFormatError",
    "InverseKinematicsError",
    "NoSequenceError",
    "PathError",
    "PlanError",
    "ProblemError",
    "Progress",
    "RedundancyError",
    "RenderError",
    "RobotError",
    "Saved",
    "SelfmotionError",
    "StartError",
    "inlined",
    "is_known",
    "kernel",
    "one_blas_thread",
    "per_joint",
    "read_archive",
    "read_only",
    "read_rows",
    "read_table",
    "restore",
    "silent",
    "write_archive",
    "write_atomically",
    "write_csv",
]
