"""Places among increasing numbers, compiled."""

from selfmotion.basics.arrays import Array
from selfmotion.basics.jit import inlined


@inlined
def interval_of(knots: Array, t: float) -> int:
    """Return the interval between knots (N,) that a number is in, 0 to N - 2.

    The first and the last one go on beyond.
    """
    low, high = 0, len(knots) - 1
    while high - low > 1:
        middle = (low + high) // 2
        if t >= knots[middle]:
            low = middle
        else:
            high = middle
    return low
