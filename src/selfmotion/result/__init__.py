"""What came of a problem: plans, how they were found, their files, and other paces."""

from selfmotion.result.limits_used import LimitsUsed as LimitsUsed
from selfmotion.result.parts import Move as Move, Parts as Parts
from selfmotion.result.plan import Plan as Plan, Views as Views, load_plan as load_plan
from selfmotion.result.report import Gap as Gap, Report as Report
from selfmotion.result.retiming import (
    rate_limits as rate_limits,
    retime as retime,
    slowdown as slowdown,
)
