"""The loop, closed with an arm that follows at once."""

import numpy as np

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.realtime import Replanner, Segment


def closed_loop(
    replanner: Replanner, path: sm.paths.Path, start: Array, seconds: float
) -> tuple[list[Segment], Array]:
    """Let the arm do exactly what is commanded; return the segments and q at each step."""
    t, q, qd = 0.0, start, np.zeros(len(start))
    segments, places = [], []
    for _ in range(round(seconds / replanner.period)):
        segment = replanner.step(t, q, qd, path)
        segments.append(segment)
        t += replanner.period
        here = segment.index(t)
        q, qd = segment.q[here], segment.qd[here]
        places.append(q)
    return segments, np.array(places)
