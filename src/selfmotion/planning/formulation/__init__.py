"""The problem as planners see it: coordinates z = (q, δ), cost terms, conditions, ends."""

from selfmotion.planning.formulation.finite import (
    require_finite as require_finite,
    require_finite_gradients as require_finite_gradients,
    require_finite_values as require_finite_values,
)
from selfmotion.planning.formulation.formulation import (
    BoundConditions as BoundConditions,
    Formulation as Formulation,
    arm_motion as arm_motion,
    bound_conditions as bound_conditions,
    certified as certified,
    cost_of_motion as cost_of_motion,
    deferred_clearance as deferred_clearance,
    keeps_off_itself as keeps_off_itself,
    motion_of_all as motion_of_all,
    on_path as on_path,
    path_errors as path_errors,
    sampled as sampled,
    sampled_along as sampled_along,
    with_springs as with_springs,
    with_windows_shut as with_windows_shut,
    without_tolerances as without_tolerances,
)
from selfmotion.planning.formulation.sampled import (
    CurveSamples as CurveSamples,
    SampledMotion as SampledMotion,
)
