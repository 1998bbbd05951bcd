"""The sample trajectory of section 3.1: figures 1 to 3, and the table of variants."""

import numpy as np

from selfmotion.basics import Array
from selfmotion.paper.study.context import Context, Result, finely, optimum
from selfmotion.paper.study.results import Chapter, Claim, Plot, PlottedCurve, Table, Verdict
from selfmotion.problem.costs import Cost, InverseManipulability, JointVelocity, Manipulability

# Lengths of the links [m].
_LINKS = np.array([2.0, 2.0, 1.0])

# Without a velocity term the search need not end: the table has the result after these iterations.
_MAX_ITERATIONS = 60

_COLUMNS = (
    "variant",
    "F at x = 0",
    "F",
    "velocity term",
    "manipulability term",
    "smallest w",
    "iterations",
    "evaluations of F",
)


def chapter(context: Context) -> Chapter:
    """Return figures 1 to 3, the arm on its path, the table, and the claims about μ."""
    minimum_norm, best, run = context.minimum_norm, context.best, context.published()
    ratio = np.abs(best.qd).max() / np.abs(minimum_norm.qd).max()
    return Chapter(
        "sample",
        "The sample trajectory",
        (
            f"Links 2, 2, 1 m; the tool runs from (3, 2) through the origin to (-3, -2) in 1 s. "
            f"Without self-motion F = {minimum_norm.cost:.4f}, at the optimum of the paper's "
            f"twelve coefficients {best.cost:.5f}; the peak joint speed falls to "
            f"{100 * ratio:.0f} % ({np.abs(minimum_norm.qd).max():.2f} to "
            f"{np.abs(best.qd).max():.2f} rad/s).",
            f"The published scheme, started at x = 0, ends after {run.iterations} iterations and "
            f"{run.evaluations} evaluations of F at a motion of cost "
            f"{finely(context.problem, run.minimum.x).cost:.4f}; our default takes "
            f"{context.plan.report.evaluations} evaluations for {context.plan.report.cost:.4f} "
            f"with four coefficients.",
        ),
        tables=(_table(context),),
        plots=(
            _speeds("figure1", "Figure 1: joint speeds at x = 0", minimum_norm),
            _speeds("figure2", "Figure 2: joint speeds at x*", best),
            *_figure3(context),
            _arm("arm_still", "The arm at x = 0", minimum_norm),
            _arm("arm_best", "The arm at x*", best),
        ),
        claims=(_half_percent(context), _mu(context), _well_away(context)),
    )


def _speeds(name: str, title: str, motion: Result) -> Plot:
    curves = tuple(PlottedCurve.of(f"joint {k + 1}", motion.t, motion.qd[:, k]) for k in range(3))
    return Plot(name, title, "t [s]", "q̇ [rad/s]", curves)


def _figure3(context: Context) -> tuple[Plot, Plot]:
    history = context.published().minimum.history
    steps = np.arange(len(history))
    x = np.array([iteration.x for iteration in history])
    entries = tuple(PlottedCurve.of("", steps, x[:, k], faint=True) for k in range(x.shape[1]))
    norm = PlottedCurve.of("|x|", steps, np.linalg.norm(x, axis=1), marker="o")
    cost = PlottedCurve.of("F", steps, [iteration.cost for iteration in history], marker="o")
    return (
        Plot("figure3", "Figure 3: x against iterations", "iteration", "x", (norm, *entries)),
        Plot("figure3_cost", "F against iterations", "iteration", "F", (cost,)),
    )


def _arm(name: str, title: str, motion: Result) -> Plot:
    frames = np.linspace(0, len(motion.t) - 1, 13).astype(int)
    curves = [PlottedCurve.of("", *_joints(motion.q[k]).T, faint=True) for k in frames]
    tool = np.array([_joints(q)[-1] for q in motion.q])
    ends = [PlottedCurve.of("start", *_joints(motion.q[0]).T, marker="o")]
    ends += [PlottedCurve.of("end", *_joints(motion.q[-1]).T, marker="o")]
    path = PlottedCurve.of("tool's path", *tool.T)
    return Plot(name, title, "x [m]", "y [m]", (*ends, path, *curves), equal=True)


def _joints(q: Array) -> Array:
    angles = np.cumsum(q)
    steps = _LINKS[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])


def _variants() -> list[tuple[str, list[Cost], float]]:
    velocity = JointVelocity()
    variants: list[tuple[str, list[Cost], float]] = []
    for duration in (1.0, 2.0):
        for mu in (1.0, 50.0, 1000.0):
            name = f"eq. 12, μ = {mu:g}, T = {duration:g}"
            variants.append((name, [velocity, InverseManipulability(mu)], duration))
    for weight in ([4.0, 2.0, 1.0], [1.0, 2.0, 4.0]):
        name = f"eq. 12, W = diag({', '.join(f'{w:g}' for w in weight)})"
        variants.append((name, [JointVelocity(weight), InverseManipulability(1.0)], 1.0))
    for mu in (1.0, 50.0, 1000.0):
        variants.append((f"eq. 11, μ = {mu:g}", [velocity, Manipulability(mu)], 1.0))
    variants.append(("eq. 10: no velocity term", [Manipulability(1.0)], 1.0))
    return variants


def _table(context: Context) -> Table:
    rows: list[tuple[str | float | int, ...]] = []
    for name, costs, duration in _variants():
        problem = context.with_costs(costs, duration)
        _, found = optimum(problem, tolerance=1e-10, max_iterations=_MAX_ITERATIONS)
        work = (len(found.history) - 1, found.history[-1].evaluations)
        rows.append((name, *_row(context, costs, duration, found.x), *work))
    for mu in context.scale.published_mu:
        run = context.published(mu)
        costs = [JointVelocity(), InverseManipulability(mu)]
        row = _row(context, costs, 1.0, run.minimum.x)
        rows.append((f"as published, μ = {mu:g}", *row, run.iterations, run.evaluations))
    note = (
        "The paper's twelve coefficients from x = 0; exact gradients except where it says "
        "'as published'. T = 2 goes there and back. F on a grid of 256 steps. Evaluations as "
        f"published include those of differences. At most {_MAX_ITERATIONS} iterations."
    )
    return Table("Variants of the sample trajectory", _COLUMNS, tuple(rows), note)


def _row(
    context: Context, costs: list[Cost], duration: float, x: Array
) -> tuple[float, float, float, float, float]:
    problem = context.with_costs(costs, duration)
    before, after = finely(problem, np.zeros_like(x)), finely(problem, x)
    velocity = after.terms.get("joint velocity", np.nan)
    pose = after.cost - (velocity if np.isfinite(velocity) else 0.0)
    return before.cost, after.cost, velocity, pose, after.smallest_w


def _half_percent(context: Context) -> Claim:
    run = context.published()
    reached = finely(context.problem, run.minimum.x).cost
    excess = reached / context.lagrangian.report.cost - 1.0
    return Claim(
        "useful",
        "The algorithm produces useful results, though not likely globally optimal ones.",
        Verdict.CONFIRMED if excess < 5e-3 else Verdict.QUALIFIED,
        f"{100 * excess:.2f} % above the optimum over all joint motions",
        f"From x = 0 the published scheme reaches {reached:.4f}, integrated finely; the Lagrangian "
        f"boundary-value problem has {context.lagrangian.report.cost:.5f}. It is better than the "
        f"paper hopes: its cubic in joint space can come "
        f"within {100 * (context.best.cost / context.lagrangian.report.cost - 1):.4f} % of it.",
    )


def _mu(context: Context) -> Claim:
    pose = {}
    for mu in (1.0, 50.0, 1000.0):
        problem = context.with_costs((JointVelocity(), InverseManipulability(mu)))
        motion = finely(problem, optimum(problem, tolerance=1e-10)[1].x)
        pose[mu] = motion.terms["inverse manipulability"] / mu, motion
    change = pose[50.0][0] / pose[1.0][0] - 1.0
    change_more = pose[1000.0][0] / pose[1.0][0] - 1.0
    speeds = [pose[mu][1].terms["joint velocity"] for mu in (1.0, 50.0, 1000.0)]
    little = abs(change) < 0.1 and abs(change_more) < 0.1
    return Claim(
        "mu",
        "μ = 50 has very little effect on the manipulability term; 1000 only raises speeds.",
        Verdict.CONFIRMED if little else Verdict.QUALIFIED,
        f"∫ 1/det changes by {100 * change:+.1f} % and {100 * change_more:+.1f} %",
        f"At the optima for μ = 1, 50, 1000 the velocity term is {speeds[0]:.3f}, {speeds[1]:.3f}, "
        f"{speeds[2]:.3f}; the smallest w {pose[1.0][1].smallest_w:.3f}, "
        f"{pose[50.0][1].smallest_w:.3f}, {pose[1000.0][1].smallest_w:.3f} m².",
    )


def _well_away(context: Context) -> Claim:
    smallest = context.minimum_norm.smallest_w
    largest = _largest_w()
    share = smallest / largest
    return Claim(
        "well_away",
        "Even the particular solution (x = 0) is well away from singular configurations.",
        Verdict.CONFIRMED if share > 0.2 else Verdict.QUALIFIED,
        f"smallest w at x = 0: {smallest:.3f} m², {100 * share:.0f} % of the arm's largest",
        f"The largest w over all poses is {largest:.3f} m² (det JJᵀ = {largest**2:.1f}); the "
        f"paper's estimate of an upper bound, 2500, is far above it.",
    )


def _largest_w() -> float:
    """Return the largest w of the arm, over a grid of the two angles that it depends on."""
    second, third = np.meshgrid(*[np.linspace(-np.pi, np.pi, 361)] * 2)
    both = np.sin(second + third)
    minors = (
        4.0 * np.sin(second) + 2.0 * both,
        2.0 * both + 2.0 * np.sin(third),
        2.0 * np.sin(third),
    )
    return float(np.linalg.norm(minors, axis=0).max())
