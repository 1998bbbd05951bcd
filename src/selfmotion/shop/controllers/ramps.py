"""An even run-up and an even run-down, which stand for those of a controller."""

from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array


class Ramps(NamedTuple):
    """Run-up and run-down of a motion at programmed speeds, each at an even acceleration.

    Without ramps, targets are reached at nominal times. With them, nominal time passes evenly in
    the middle, and as a parabola of time in both ramps.

    Attributes
    ----------
    nominal : float
        Duration without ramps [s].
    duration : float
        Duration with ramps [s].
    """

    nominal: float
    duration: float

    @property
    def each(self) -> float:
        """Duration of each of the two ramps [s]."""
        return min(self.duration - self.nominal, 0.5 * self.duration)

    def nominal_times(self, times: Array) -> Array:
        """Return the nominal times that are reached at times (K,) [s]."""
        ramp, rate = self.each, self._rate
        up, down = np.clip(times, 0.0, ramp), np.clip(self.duration - times, 0.0, ramp)
        nominal = rate * (times - 0.5 * ramp)
        nominal = np.where(times < ramp, 0.5 * rate * up**2 / ramp, nominal)
        in_run_down = self.nominal - 0.5 * rate * down**2 / ramp
        return np.asarray(np.where(times > self.duration - ramp, in_run_down, nominal))

    def times(self, nominal: Array) -> Array:
        """Return the times at which nominal times (K,) are reached [s]."""
        ramp, rate = self.each, self._rate
        from_ends = nominal, self.nominal - nominal
        up, down = (np.sqrt(2.0 * ramp * np.maximum(x, 0.0) / rate) for x in from_ends)
        times = np.where(up < ramp, up, nominal / rate + 0.5 * ramp)
        return np.asarray(np.where(down < ramp, self.duration - down, times))

    @property
    def _rate(self) -> float:
        """Nominal time per time between the ramps."""
        return self.nominal / (self.duration - self.each)
