"""The path that was given last: what is followed for a while where a new one fails."""

from selfmotion.basics import Array
from selfmotion.path import Path, PathSamples
from selfmotion.realtime.reference import resting


class LastPath:
    """Looks at a path, or at the last one that could be looked at.

    Parameters
    ----------
    patience : float
        For how long that will do [s].
    """

    def __init__(self, patience: float) -> None:
        self._patience = patience
        self._path: Path | None = None
        self._without = 0.0

    def samples(
        self, path: Path | None, t: Array, waited: float, reasons: list[str]
    ) -> PathSamples | None:
        """Return the path at times (K,); the last one where it fails, and add the reason.

        The last one, too, where none is given: targets come at their own rate. None after too long,
        of which `waited` [s] have passed since it was asked last.
        """
        if path is not None:
            try:
                found = resting(path, t)
                self._path, self._without = path, 0.0
                return found
            # A path is the user's code: whatever it raises must not leave the arm without a
            # command.
            except Exception as error:
                reasons.append(f"the path failed: {type(error).__name__}: {error}")
        self._without += waited
        if self._path is not None and self._without <= self._patience:
            return resting(self._path, t)
        if path is None:
            told = f"for {self._without:.3g} s (patience: {self._patience:.3g} s)"
            reasons.append(f"there was no target {told if self._path else 'yet'}")
        return None
