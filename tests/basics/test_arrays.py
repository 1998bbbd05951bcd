"""Arrays as compiled kernels take them."""

import numpy as np
import pytest

from selfmotion.basics import plain


@pytest.mark.parametrize(
    "kind",
    [
        "C",
        "F",
        "read-only",
        "read-only F",
        "transposed",
        "strided",
        "broadcast",
        "whole numbers",
        "short",
        "swapped",
    ],
)
def test_kernels_get_one_kind_of_array(kind: str) -> None:
    """In C order, writeable, of native doubles, whatever is given: for others they compile anew."""
    values = np.arange(12.0).reshape(3, 4)
    given = {
        "C": values,
        "F": np.asfortranarray(values),
        "read-only": values.copy(),
        "read-only F": np.asfortranarray(values),
        "transposed": values.T,
        "strided": values[:, ::2],
        "broadcast": np.broadcast_to(values[0], (3, 4)),
        "whole numbers": values.astype(np.int64),
        "short": values.astype(np.float32),
        "swapped": values.astype(">f8"),
    }[kind]
    if "read-only" in kind:
        given.flags.writeable = False
    found = plain(given)
    assert found.flags.c_contiguous
    assert found.flags.writeable
    assert found.dtype == np.dtype(np.float64)
    assert found.dtype.isnative
    np.testing.assert_array_equal(found, given)
    assert (found is values) is (kind == "C")
