"""Where to begin: start configurations, self-motion curves, chains over them, reach."""

from selfmotion.search.chains import Sequence as Sequence
from selfmotion.search.curves import (
    SPACING as SPACING,
    SelfMotion as SelfMotion,
)
from selfmotion.search.guides import (
    BESIDE as BESIDE,
    LAST_SMOOTHINGS as LAST_SMOOTHINGS,
    asks_length as asks_length,
    guides as guides,
    has_curves as has_curves,
    shortest_along as shortest_along,
)
from selfmotion.search.manifold import Manifold as Manifold
from selfmotion.search.obstruction import (
    Obstruction as Obstruction,
    Reach as Reach,
    obstruction as obstruction,
    reachable as reachable,
)
from selfmotion.search.stacked import Stacked as Stacked, metrics as metrics
from selfmotion.search.starts import (
    carried as carried,
    spread as spread,
    start_candidates as start_candidates,
)
from selfmotion.search.stretches import (
    Stretch as Stretch,
    Stretches as Stretches,
    turned_towards as turned_towards,
)
