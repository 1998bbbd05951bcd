"""Motions given by nodes on their self-motion manifolds, by an interior-point method."""

from selfmotion.planning.nodes.batch import Batch as Batch
from selfmotion.planning.nodes.motion import (
    NodeGrid as NodeGrid,
    NodeMotion as NodeMotion,
    breaks_hard as breaks_hard,
    broken_intervals as broken_intervals,
    centred as centred,
    forget as forget,
    may_be_smoothed as may_be_smoothed,
    null_motion_of as null_motion_of,
    on_grid as on_grid,
    quickness_of as quickness_of,
    subdivisions as subdivisions,
    terms_of as terms_of,
)
from selfmotion.planning.nodes.newton import Optimum as Optimum, Step as Step, minimise as minimise
from selfmotion.planning.nodes.rows import (
    by_kind as by_kind,
    carried as carried,
    conservatism as conservatism,
    kinks as kinks,
    multipliers_of as multipliers_of,
)
from selfmotion.planning.nodes.settings import SETTINGS as SETTINGS
from selfmotion.planning.nodes.smoothness import rest_times as rest_times
