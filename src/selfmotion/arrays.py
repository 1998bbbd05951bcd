"""The array type of the package, and arrays that cannot be written to."""

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def read_only(values: npt.ArrayLike) -> Array:
    """Return a float64 copy of `values` that refuses to be modified."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array
