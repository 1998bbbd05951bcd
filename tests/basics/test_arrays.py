"""Arrays as compiled kernels take them."""

from typing import Any

import numpy as np
import pytest

from selfmotion.basics import plain, plain_numbers, scaled
from selfmotion.model.path import pose_of


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


@pytest.mark.parametrize(
    "values", [True, [True, 0.0, 0.0], [[1.0, 2.0], [3.0, False]], (1, np.bool_(True)), ["1.5", 0]]
)
def test_texts_and_flags_are_no_numbers_wherever_they_stand(values: Any) -> None:
    """NumPy takes a flag among numbers for one, and a text of digits as well."""
    assert plain_numbers(values) is None
    assert plain_numbers([1, 2.5, 3]) is not None


@pytest.mark.parametrize("values", [["1.5", 0.0, 0.0], [True, 0.0, 0.0], [{"a": 1.0}, 0.0, 0.0]])
def test_no_pose_is_read_of_what_is_no_numbers(values: Any) -> None:
    with pytest.raises(ValueError, match=r"position is .*, expected 3 numbers"):
        pose_of({"position": values})
    with pytest.raises(ValueError, match="expected numbers"):
        scaled([{"a": 1.0}, *values], 1e-3)
