"""Initial guesses: start configurations, self-motion curves, chains over them, reachability."""

from selfmotion.planning.search.chain_shortening import (
    LAST_SMOOTHINGS as LAST_SMOOTHINGS,
    TIME_SHIFT as TIME_SHIFT,
    shortest_along as shortest_along,
)
from selfmotion.planning.search.chains import Sequence as Sequence
from selfmotion.planning.search.curves import (
    SPACING as SPACING,
    SelfMotion as SelfMotion,
)
from selfmotion.planning.search.guides import guides as guides
from selfmotion.planning.search.manifold import Manifold as Manifold
from selfmotion.planning.search.measures import is_joint_travel as is_joint_travel
from selfmotion.planning.search.obstruction import (
    Obstruction as Obstruction,
    Reach as Reach,
    obstruction as obstruction,
    reachable as reachable,
)
from selfmotion.planning.search.search_times import has_curves as has_curves
from selfmotion.planning.search.segments import (
    ChainSegment as ChainSegment,
    ChainSegments as ChainSegments,
    turned_towards as turned_towards,
)
from selfmotion.planning.search.single_poses import (
    SinglePoses as SinglePoses,
    carried_within as carried_within,
    inside as inside,
    pushed as pushed,
)
from selfmotion.planning.search.stacked import Stacked as Stacked, metrics as metrics
from selfmotion.planning.search.starts import (
    carried as carried,
    spread as spread,
    start_candidates as start_candidates,
)
