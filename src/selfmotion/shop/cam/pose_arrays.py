"""Reader of arrays of poses (NPY): matrices, or tables of numbers."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path as FilePath

from selfmotion.basics import LEFT_OUT, FileFormatError, read_arrays
from selfmotion.shop.cam.pose_columns import rows_of_table
from selfmotion.shop.cam.pose_rows import PoseRows, Reading

# Columns of an array, by their number, unless options name them.
_DEFAULT_COLUMNS = {3: ("x", "y", "z"), 4: ("t", "x", "y", "z")}
# Note on 4 x 4 matrices, which say no unit.
MATRIX_NOTE = "matrices say no unit: their last columns are taken for metres"


def read_array(file: FilePath, reading: Reading) -> PoseRows:
    """Return the rows of an array (N, 4, 4) of poses, or of a table (N, C) of numbers.

    Raises
    ------
    FileFormatError
        It has another shape, or does not say what its columns are.
    """
    (array,) = read_arrays(file).values()
    if array.dtype.kind not in "iuf":
        raise FileFormatError(f"{file}: holds no array of numbers")
    labels = [f"row {k}" for k in range(1, 1 + (len(array) if array.ndim else 0))]
    if array.ndim == 3 and array.shape[1:] == (4, 4):
        rotations = array[:, :3, :3] * 1.0
        rows = PoseRows(labels, array[:, :3, 3] * 1.0, "rotation", rotations, None)
        return replace(rows, notes=(MATRIX_NOTE,))
    if array.ndim != 2:
        raise FileFormatError(
            f"{file}: has shape {array.shape}, expected (N, 4, 4) poses, or a table (N, C)"
        )
    columns = _columns_of(file, array.shape, reading)
    used = [k for k, name in enumerate(columns) if name != LEFT_OUT]
    numbers = array[:, used] * 1.0
    return rows_of_table(file, [columns[k] for k in used], numbers, labels, {})


def _columns_of(file: FilePath, shape: tuple[int, ...], reading: Reading) -> Sequence[str]:
    """Return the names of the columns of a table; FileFormatError where they are not known."""
    columns = reading.columns or _DEFAULT_COLUMNS.get(shape[1])
    if columns is None and shape[1] in (7, 8):
        before = "t," * (shape[1] == 8)
        raise FileFormatError(
            f"{file}: has shape {shape}, which does not say in which order quaternions are; "
            f"give columns ('{before}x,y,z,qw,qx,qy,qz' or '{before}x,y,z,qx,qy,qz,qw')"
        )
    if columns is None or len(columns) != shape[1]:
        count = "no columns" if columns is None else f"{len(columns)} columns"
        raise FileFormatError(
            f"{file}: has shape {shape} and {count} are named, expected (N, 4, 4) poses, "
            f"(N, 3) x,y,z, (N, 4) t,x,y,z, or a name in columns for each"
        )
    return columns
