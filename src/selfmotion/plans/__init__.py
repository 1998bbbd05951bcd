"""What to plan, and what came of it."""

from selfmotion.plans.paper_problem import sample_problem
from selfmotion.plans.parts import Move, Parts
from selfmotion.plans.plan import Plan, Views, load_plan
from selfmotion.plans.problem import NO_OVERLAP, Problem, check_problem
from selfmotion.plans.report import Binding, Gap, Report
from selfmotion.plans.rest import rest_orders
from selfmotion.plans.retiming import OF_PACE, retime, slowdown
from selfmotion.plans.saved_problem import problem_from_dict, problem_to_dict

__all__ = [
    "NO_OVERLAP",
    "OF_PACE",
    "Binding",
    "Gap",
    "Move",
    "Parts",
    "Plan",
    "Problem",
    "Report",
    "Views",
    "check_problem",
    "load_plan",
    "problem_from_dict",
    "problem_to_dict",
    "rest_orders",
    "retime",
    "sample_problem",
    "slowdown",
]
