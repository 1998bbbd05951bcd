"""Where the joints of a motion change their direction."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from selfmotion.basics import Array, read_only
from selfmotion.motion import Trajectory

# A joint that goes back by less than this [rad or m] did not turn round.
LEAST = 1e-3
# Times that are looked at for each sample of the motion, and halvings to find when one turns round.
_PER_SAMPLE, _HALVINGS = 4, 40


@dataclass(frozen=True, eq=False)
class Reversals:
    """When the joints of a motion turn round, each by more than 1 mrad or 1 mm.

    Attributes
    ----------
    times : mapping
        Joint → times [s], (K,).
    """

    times: Mapping[str, Array]

    @classmethod
    def of(cls, motion: Trajectory) -> "Reversals":
        """Return those of a motion."""
        shares = np.arange(_PER_SAMPLE) / _PER_SAMPLE
        steps = np.diff(motion.t)[:, None] * shares
        t = np.append((motion.t[:-1, None] + steps).ravel(), motion.t[-1])
        speeds = motion(t, 1)
        turns = {
            name: read_only(_turns(motion, number, t, speeds[:, number]))
            for number, name in enumerate(motion.joint_names)
        }
        return cls(MappingProxyType(turns))

    @property
    def count(self) -> int:
        """How many there are, of all joints together."""
        return sum(map(len, self.times.values()))

    def __str__(self) -> str:
        """Return how many times, and which joints do, those first that do most often."""
        order = sorted(self.times, key=lambda name: -len(self.times[name]))
        turning = [f"{name} {len(self.times[name])}" for name in order if len(self.times[name])]
        return f"{self.count} ({', '.join(turning)})" if turning else "0"


def _turns(motion: Trajectory, number: int, t: Array, speed: Array) -> Array:
    """Return when one joint turns round."""
    moving = np.flatnonzero(speed)
    change = np.flatnonzero(np.diff(np.sign(speed[moving])))
    early, late, sign = t[moving[change]], t[moving[change + 1]], np.sign(speed[moving[change]])
    for _ in range(_HALVINGS):
        middle = 0.5 * (early + late)
        before = motion(middle, 1)[:, number] * sign > 0.0 if len(middle) else sign > 0.0
        early, late = np.where(before, middle, early), np.where(before, late, middle)
    places = motion(np.concatenate([t[:1], late, t[-1:]]))[:, number]
    # Of turns with less than LEAST in between both go, the nearest first.
    kept = list(range(len(places)))
    while len(kept) > 2:
        ways = np.abs(np.diff(places[kept]))
        least = int(np.argmin(ways))
        if ways[least] > LEAST:
            break
        if least == 0:
            del kept[1]
        elif least == len(ways) - 1:
            del kept[-2]
        else:
            del kept[least : least + 2]
    return np.asarray(late[np.array(kept[1:-1], dtype=int) - 1])
