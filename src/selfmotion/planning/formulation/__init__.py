"""The problem as planners see it: coordinates z = (q, δ), cost terms, conditions, ends."""

from selfmotion.planning.formulation.finite import (
    require_finite as require_finite,
    require_finite_gradients as require_finite_gradients,
    require_finite_values as require_finite_values,
)
from selfmotion.planning.formulation.formulation import (
    BoundConditions as BoundConditions,
    Formulation as Formulation,
)
from selfmotion.planning.formulation.sampled import (
    CurveSamples as CurveSamples,
    SampledMotion as SampledMotion,
)
