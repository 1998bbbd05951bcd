"""What every part of the package stands on: errors, arrays, progress, files, compilation."""

from selfmotion.basics import series
from selfmotion.basics.arrays import Array, Ints, per_joint, plain_numbers, read_only, shown
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
    as_path,
    read_archive,
    read_arrays,
    read_rows,
    read_table,
    write_archive,
    write_atomically,
    write_csv,
)
from selfmotion.basics.inputs import (
    as_choice,
    as_flag,
    as_number,
    as_numbers,
    as_several,
    as_whole,
    random_numbers,
)
from selfmotion.basics.jit import inlined, kernel
from selfmotion.basics.names import nearest
from selfmotion.basics.progress import Progress, silent
from selfmotion.basics.saved import Saved, is_known, restore
from selfmotion.basics.threads import one_blas_thread

__all__ = [
    "Array",
    "BreakdownError",
    "CollisionError",
    "FileFormatError",
    "Ints",
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
    "as_choice",
    "as_flag",
    "as_number",
    "as_numbers",
    "as_path",
    "as_several",
    "as_whole",
    "inlined",
    "is_known",
    "kernel",
    "nearest",
    "one_blas_thread",
    "per_joint",
    "plain_numbers",
    "random_numbers",
    "read_archive",
    "read_arrays",
    "read_only",
    "read_rows",
    "read_table",
    "restore",
    "series",
    "shown",
    "silent",
    "write_archive",
    "write_atomically",
    "write_csv",
]
