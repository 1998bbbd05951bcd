"""What a feed allows at nodes: the narrowest place within a window."""

import numpy as np
import pytest

from selfmotion.model.path.feed_nodes import least_within


@pytest.mark.parametrize("count", [1, 2, 3, 7, 64, 1000])
def test_the_least_of_each_range_is_that_of_looking_at_all(count: int) -> None:
    rng = np.random.default_rng(count)
    # Few values, so that many are equal: the first of them counts.
    values = rng.integers(0, 5, count).astype(float)
    first = rng.integers(0, count, count)
    after = np.minimum(first + rng.integers(1, count + 1, count), count)
    each = zip(first, after, strict=True)
    np.testing.assert_array_equal(
        least_within(values, first, after), [k + values[k:m].argmin() for k, m in each]
    )
