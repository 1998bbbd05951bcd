"""From a decision vector to the motion, its cost, and the gradient."""

from selfmotion.basics import Counts as Counts
from selfmotion.engine.conditions import (
    Conditions as Conditions,
    Priced as Priced,
    active_of as active_of,
)
from selfmotion.engine.frame import carried_bases as carried_bases, transport as transport
from selfmotion.engine.objective import Objective as Objective
from selfmotion.engine.remaining import Remaining as Remaining, finest as finest
from selfmotion.engine.rollout import Rollout as Rollout
from selfmotion.engine.start import FixedStart as FixedStart, FreeStart as FreeStart
from selfmotion.engine.still import (
    MOST_HALVINGS as MOST_HALVINGS,
    Guide as Guide,
    StillMotion as StillMotion,
    rough_still_motion as rough_still_motion,
    settled_still_motion as settled_still_motion,
)
from selfmotion.motion import Evaluation as Evaluation
