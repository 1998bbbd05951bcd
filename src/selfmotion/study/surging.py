"""The cause of the 'surging' of F against iterations: local minima or conditioning."""

from dataclasses import dataclass, replace

import numpy as np

from selfmotion.motion import PolynomialNullMotion
from selfmotion.optimise import Minimum
from selfmotion.study.context import Context
from selfmotion.study.engine import bind, optimum
from selfmotion.study.published import published_null_motion
from selfmotion.study.results import Chapter, Claim, Plot, PlottedCurve, Table, Verdict

# A surge: after the first two iterations, a drop more than this many times the one before, and
# above this share of F.
_FACTOR, _VISIBLE = 2.0, 1e-5

# Within this share of the final cost, the search is done for practical purposes.
_DONE = 1e-4


@dataclass(frozen=True)
class _Variant:
    """One way to minimise the same F from x = 0."""

    label: str
    motion: PolynomialNullMotion
    metric: bool
    sigma: float


_VARIANTS = (
    _Variant("paper's 12, H0 = I, σ = 0.1", published_null_motion(), False, 0.1),
    _Variant("paper's 12, H0 = I, σ = 0.01", published_null_motion(), False, 0.01),
    _Variant("paper's 12, H0 = I, σ = 0.9", published_null_motion(), False, 0.9),
    _Variant("paper's 12, scaled H0", published_null_motion(), True, 0.1),
    _Variant("12 Legendre, H0 = I", PolynomialNullMotion(3, "joint", "legendre"), False, 0.1),
    _Variant("4 monomials, H0 = I", PolynomialNullMotion(3, "null", "monomial"), False, 0.1),
    _Variant("4 Legendre, H0 = I", PolynomialNullMotion(), False, 0.1),
    _Variant("4 Legendre, scaled H0", PolynomialNullMotion(), True, 0.1),
)


def chapter(context: Context) -> Chapter:
    """Return the comparison of gradients, bases, H0 and line searches, and the verdict."""
    runs = []
    for variant in _VARIANTS:
        problem = replace(context.problem, null_motion=variant.motion)
        runs.append(optimum(problem, metric=variant.metric, sigma=variant.sigma)[1])
    published = context.published().minimum
    labels = ["as published (differences)", *(variant.label for variant in _VARIANTS)]
    conditions = [_condition(context, variant) for variant in _VARIANTS]
    minima = [published, *runs]
    rows = tuple(
        (label, condition, _surges(m), _until_done(m), len(m.history) - 1, m.cost)
        for label, condition, m in zip(labels, [conditions[0], *conditions], minima, strict=True)
    )
    columns = ("search", "condition number", "surges", "iterations to 10⁻⁴", "iterations", "F")
    note = (
        "Condition number of the Gauss-Newton matrix at x = 0, over the directions that act; after "
        f"scaling H0 it no longer matters. A surge is a drop of F more than {_FACTOR:g} times the "
        f"one before it, and above {_VISIBLE:.0e} of F. Exact gradients but in the first row."
    )
    return Chapter(
        "surging",
        "Surging, and its cause",
        tables=(Table("The same F, searched in nine ways", columns, rows, note),),
        plots=(_plot(minima, labels, (0, 1, 4, 5, 8)),),
        claims=(_claim(context, runs[0], runs[-1], conditions),),
    )


def _plot(minima: list[Minimum], labels: list[str], shown: tuple[int, ...]) -> Plot:
    curves = tuple(
        PlottedCurve.of(
            labels[k],
            np.arange(len(minima[k].history)),
            [max(i.cost / minima[k].cost - 1.0, 1e-9) for i in minima[k].history],
            marker="o",
        )
        for k in shown
    )
    label = "F / F(end) - 1"
    return Plot("surging", "Surging: F above its end", "iteration", label, curves, y_scale="log")


def _claim(context: Context, rough: Minimum, smooth: Minimum, conditions: list[float]) -> Claim:
    """Judge by the flat places of the paper's search: whether the gradient is zero there."""
    drops = _drops(rough)
    objective = bind(context.problem)
    places = [k for k in _surge_indices(rough)]
    slopes = [rough.history[k].gradient_norm for k in places]
    end = rough.history[-1].gradient_norm
    restarted = [
        optimum(context.problem, np.array(rough.history[k].x), sigma=0.1)[1].cost for k in places
    ]
    flat = float(np.min(slopes)) if slopes else np.nan
    worst = max(restarted, default=rough.cost)
    conditioning = bool(places) and flat > 10.0 * end and worst < 1.001 * rough.cost
    falling = bool(np.all(drops > 0.0))
    return Claim(
        "surging_cause",
        "The surging of F suggests a search caught in a succession of local minima.",
        Verdict.REFUTED if conditioning and falling else Verdict.QUALIFIED,
        f"{len(places)} surges at condition {conditions[0]:.0e}; "
        f"{len(_surge_indices(smooth))} at condition {conditions[-2]:.0f}",
        f"The surging is real, and stays with exact gradients and exact line searches. But the "
        f"flat places are no minima: |∇F| there is at least {flat:.1e}, against {end:.0e} at the "
        f"end, and a restart from each with a scaled H0 ends at {worst:.5f} or less. Cause: powers "
        f"of t and unused directions make F a valley of condition {conditions[0]:.0e} "
        f"({objective.size} coefficients); H has to learn each direction in turn. Orthonormal "
        f"polynomials in the null space reach the end in {_until_done(smooth)} iterations.",
    )


def _condition(context: Context, variant: _Variant) -> float:
    """Return the condition number of the Gauss-Newton matrix, without its null directions."""
    objective = bind(replace(context.problem, null_motion=variant.motion))
    values = np.linalg.eigvalsh(objective.metric(np.zeros(objective.size)))
    acting = values[values > 1e-9 * values[-1]]
    return float(acting[-1] / acting[0])


def _drops(found: Minimum) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    return -np.diff([iteration.cost for iteration in found.history])


def _surge_indices(found: Minimum) -> list[int]:
    """Return the iterations before which the search was flat and after which F dropped."""
    drops = _drops(found)
    return [
        k
        for k in range(2, len(drops))
        if drops[k] > _FACTOR * drops[k - 1] and drops[k] > _VISIBLE * abs(found.cost)
    ]


def _surges(found: Minimum) -> int:
    return len(_surge_indices(found))


def _until_done(found: Minimum) -> int:
    bound = found.cost + _DONE * abs(found.cost)
    return next(k for k, i in enumerate(found.history) if i.cost <= bound)
