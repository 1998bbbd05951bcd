"""What came of a problem: plans, how they were found, their files, and other paces."""

from selfmotion.result.parts import Move, Parts
from selfmotion.result.plan import Plan, Views, load_plan
from selfmotion.result.report import Gap, Report
from selfmotion.result.retiming import OF_PACE, retime, slowdown

__all__ = [
    "OF_PACE",
    "Gap",
    "Move",
    "Parts",
    "Plan",
    "Report",
    "Views",
    "load_plan",
    "retime",
    "slowdown",
]
