"""The array type of the package, arrays that cannot be written to, and numbers per joint."""

import numpy as np
import numpy.typing as npt

from selfmotion.basics.errors import ProblemError

Array = npt.NDArray[np.float64]


def read_only(values: npt.ArrayLike) -> Array:
    """Return a float64 copy of `values` that refuses to be modified."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


def per_joint(values: npt.ArrayLike, dof: int, what: str, *, positive: bool = False) -> Array:
    """Return one number for all joints, or one for each, as a read-only array (n,).

    Raises
    ------
    ProblemError
        There is another number of them, one is NaN, or not positive where that is asked for.
    """
    try:
        array = read_only(np.broadcast_to(np.asarray(values, dtype=np.float64), (dof,)))
    except (TypeError, ValueError):
        raise ProblemError(
            f"{what}: {values!r}, expected one number, or one for each of the {dof} joints"
        ) from None
    if np.any(np.isnan(array)) or (positive and not np.all(array > 0.0)):
        kind = "numbers > 0" if positive else "numbers"
        raise ProblemError(f"{what}: {np.asarray(values).tolist()}, expected {kind}")
    return array
