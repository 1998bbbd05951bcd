"""What to plan, and every check of whether arm, path and task fit."""

from selfmotion.problem.fit import rest_orders as rest_orders
from selfmotion.problem.paper_problem import sample_problem as sample_problem
from selfmotion.problem.problem import (
    KEPT as KEPT,
    NO_OVERLAP as NO_OVERLAP,
    Problem as Problem,
    check_problem as check_problem,
    envelope_of as envelope_of,
)
from selfmotion.problem.saved_problem import (
    arm_and_constraints as arm_and_constraints,
    describe_arm as describe_arm,
    problem_from_dict as problem_from_dict,
    problem_to_dict as problem_to_dict,
)
