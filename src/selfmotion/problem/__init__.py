"""What to plan, and every check of whether arm, path and task fit."""

from selfmotion.problem.paper_problem import sample_problem
from selfmotion.problem.problem import NO_OVERLAP, Problem, check_problem
from selfmotion.problem.rest import rest_orders
from selfmotion.problem.saved_problem import problem_from_dict, problem_to_dict

__all__ = [
    "NO_OVERLAP",
    "Problem",
    "check_problem",
    "problem_from_dict",
    "problem_to_dict",
    "rest_orders",
    "sample_problem",
]
