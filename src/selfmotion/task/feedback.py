"""How fast the tool is brought back to its path where integration or damping let it off."""

# The pose feedback removes an error e at the rate K e; this is K times the motion's duration.
_FEEDBACK = 20.0


def feedback_rate(duration: float) -> float:
    """Return the rate K [1/s] of the pose feedback in a motion of that duration [s]."""
    return _FEEDBACK / duration
