"""Problems, and checks that arm, path and task fit."""

from selfmotion.problem.problem.calibrated import (
    calibrated as calibrated,
    off_nominal as off_nominal,
    start_on_path as start_on_path,
)
from selfmotion.problem.problem.defaults import (
    KEPT as KEPT,
    OF_MAKER as OF_MAKER,
    USUAL_COSTS as USUAL_COSTS,
)
from selfmotion.problem.problem.digest import conditions_digest as conditions_digest
from selfmotion.problem.problem.end_checks import START_TOLERANCE as START_TOLERANCE
from selfmotion.problem.problem.end_constraints import (
    at_all_times as at_all_times,
    check_all_times as check_all_times,
    constraints_of_part as constraints_of_part,
    prescribed_end as prescribed_end,
)
from selfmotion.problem.problem.envelopes import (
    envelope_of as envelope_of,
    envelope_of_problem as envelope_of_problem,
    envelope_without_arm as envelope_without_arm,
)
from selfmotion.problem.problem.feed_checks import check_feeds as check_feeds
from selfmotion.problem.problem.knots import smooth_knots as smooth_knots
from selfmotion.problem.problem.paper_problem import sample_problem as sample_problem
from selfmotion.problem.problem.problem import (
    Problem as Problem,
    along_other_paths as along_other_paths,
    check_feeds_of as check_feeds_of,
    check_problem as check_problem,
)
from selfmotion.problem.problem.rest import (
    arm_rest_orders as arm_rest_orders,
    rest_orders as rest_orders,
)
from selfmotion.problem.problem.saved_problem import (
    arm_and_constraints as arm_and_constraints,
    describe_arm as describe_arm,
    problem_from_dict as problem_from_dict,
    problem_to_dict as problem_to_dict,
)
from selfmotion.problem.problem.windows import times_along as times_along
