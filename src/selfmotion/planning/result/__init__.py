"""Results: plans, reports, their files, and time scaling."""

from selfmotion.planning.redundancy import (
    Reason as Reason,
    RedundancyMap as RedundancyMap,
)
from selfmotion.planning.result.archive import (
    ArmCache as ArmCache,
    files_of as files_of,
    identity_of as identity_of,
    key_of as key_of,
    own_modules as own_modules,
    read_kept as read_kept,
    write_kept as write_kept,
)
from selfmotion.planning.result.bundles import (
    read_bundle as read_bundle,
    write_bundle as write_bundle,
)
from selfmotion.planning.result.comparison import Comparison as Comparison, compare as compare
from selfmotion.planning.result.continuity import (
    CheckedMotion as CheckedMotion,
    continuity_faults as continuity_faults,
    end_position_faults as end_position_faults,
    rest_faults as rest_faults,
)
from selfmotion.planning.result.equality import (
    arm_differences as arm_differences,
    arm_digest as arm_digest,
)
from selfmotion.planning.result.measured import (
    LimitsUsed as LimitsUsed,
    NullSpaceVelocity as NullSpaceVelocity,
    quantities_of_pace as quantities_of_pace,
)
from selfmotion.planning.result.move import Move as Move, is_move as is_move, load_move as load_move
from selfmotion.planning.result.pace_rows import PaceLimits as PaceLimits
from selfmotion.planning.result.pacing import (
    Ends as Ends,
    along as along,
    fastest_pace as fastest_pace,
)
from selfmotion.planning.result.parts import Parts as Parts, load_parts as load_parts
from selfmotion.planning.result.plan import (
    Plan as Plan,
    Views as Views,
    load_plan as load_plan,
    reached_text as reached_text,
    views as views,
)
from selfmotion.planning.result.report import Attempt as Attempt, Gap as Gap, Report as Report
from selfmotion.planning.result.retiming import (
    at_rate as at_rate,
    check_no_feed as check_no_feed,
    is_retimed as is_retimed,
    rate_limits as rate_limits,
    retime as retime,
    slowdown as slowdown,
)
from selfmotion.planning.result.reversals import Reversals as Reversals
from selfmotion.planning.result.specification import (
    MotionSpecification as MotionSpecification,
    missing_constraints as missing_constraints,
)

__all__ = [
    "Attempt",
    "Comparison",
    "Gap",
    "LimitsUsed",
    "NullSpaceVelocity",
    "Reason",
    "RedundancyMap",
]
