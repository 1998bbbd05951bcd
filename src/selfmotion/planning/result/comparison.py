"""Plans side by side: costs, durations, the worst that their checks found, and verdicts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from selfmotion.basics import FileFormatError, ProblemError, as_several, shown
from selfmotion.planning.result.plan import Plan
from selfmotion.problem.costs import Cost, FunctionCost

# Name of a row.
_TOTAL = "total cost"
# Name of a row.
_VERIFIED = "verified"
# Rows of a table, and the part of a certificate that has their value.
_WORST = {
    "position error, m": "position_error",
    "rotation error, rad": "rotation_error",
    "margin to joint limits, rad or m": "limit_margin",
    "speed, share of its limit": "velocity_ratio",
    "acceleration, share of its limit": "acceleration_ratio",
    "smallest singular value": "smallest_singular_value",
    "clearance, m": "clearance",
}


@dataclass(frozen=True)
class Comparison:
    """Plans side by side; `str` is a table with a column for each.

    Attributes
    ----------
    names : tuple of str
        Names of the P plans.
    costs : dict
        Contribution of each cost, and "total cost": (P,) each. None for a plan without such a cost,
        and for the total of one that ends before its path does. Without a total if plans have
        different costs; different costs of one name are marked.
    figures : dict
        Duration [s], joint path Σ|Δq| [rad or m], and the worst of the certificate, (P,) each; None
        if it was not checked.
    verdicts : tuple of str
    verified : tuple of bool
    ends : tuple of (float or None)
        When plans end that end before their path does [s].
    """

    names: tuple[str, ...]
    costs: Mapping[str, tuple[float | None, ...]]
    figures: Mapping[str, tuple[float | None, ...]]
    verdicts: tuple[str, ...]
    verified: tuple[bool, ...]
    ends: tuple[float | None, ...]

    def cells(self) -> list[list[str]]:
        """Return the rows of the table as texts, a label and P values each, without the head."""
        rows = [
            [name, *map(_number, values)] for name, values in {**self.costs, **self.figures}.items()
        ]
        ends = [None if end is None else f"ends at t = {end:.4g} s" for end in self.ends]
        if _TOTAL in self.costs:
            total = rows[list(self.costs).index(_TOTAL)]
            total[1:] = [end or cell for end, cell in zip(ends, total[1:], strict=True)]
        elif any(ends):
            rows.append(["path", *(end or "whole" for end in ends)])
        return [*rows, [_VERIFIED, *("yes" if each else "no" for each in self.verified)]]

    def refusals(self) -> list[str]:
        """Return a line for each plan that is not verified: its name, and why."""
        every = zip(self.names, self.verdicts, self.verified, strict=True)
        return [f"{name}: {verdict}" for name, verdict, verified in every if not verified]

    @property
    def remark(self) -> str:
        """Cause of a missing total; "" if there is one."""
        return (
            "" if _TOTAL in self.costs else "no total cost: the plans were made for different ones"
        )

    def __str__(self) -> str:
        """Return the table, the cause of a missing total, and failures of plans."""
        rows = [["", *self.names], *self.cells()]
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        lines = [
            "  ".join(
                cell.rjust(width) if column else cell.ljust(width)
                for column, (cell, width) in enumerate(zip(row, widths, strict=True))
            ).rstrip()
            for row in rows
        ]
        return "\n".join([*lines, *filter(None, [self.remark]), *self.refusals()])


def compare(
    plans: Sequence[Plan] | Mapping[str, Plan], *, costs: Sequence[Cost] | None = None
) -> Comparison:
    """Compare plans: costs, durations, margins and verdicts, side by side.

    Parameters
    ----------
    plans : sequence of Plan, or dict
        By name, or numbered "plan 1", "plan 2", …
    costs : sequence of Cost, optional
        Costs for all, as `Plan.evaluate` does. By default each plan's own; totals of different
        costs are left out.

    Returns
    -------
    Comparison

    Raises
    ------
    ProblemError
        There is none, or one is no plan; a cost is none, or does not fit one of the arms.
    """
    if isinstance(plans, Mapping):
        named = dict(plans)
    elif isinstance(plans, Sequence) and not isinstance(plans, str):
        named = {f"plan {number}": plan for number, plan in enumerate(plans, start=1)}
    else:
        named = {}
    if not named:
        raise ProblemError(f"plans is {shown(plans)}, expected plans, or a dict of them by name")
    for name, plan in named.items():
        if not isinstance(plan, Plan):
            raise ProblemError(
                f"plans: '{name}' is {shown(plan)}, expected a plan, as sm.plan or sm.load_plan "
                f"returns it"
            )
    every = list(named.values())
    rows = _own_costs(every) if costs is None else _common_costs(every, costs)
    figures: dict[str, tuple[float | None, ...]] = {
        "duration, s": tuple(plan.trajectory.duration for plan in every),
        "joint path, rad or m": tuple(
            float(np.abs(np.diff(plan.trajectory.q, axis=0)).sum()) for plan in every
        ),
    }
    for label, part in _WORST.items():
        worst = [getattr(plan.certificate, part) for plan in every]
        if any(worst):
            figures[label] = tuple(None if item is None else item.value for item in worst)
    return Comparison(
        tuple(map(str, named)),
        rows,
        figures,
        tuple(plan.certificate.verdict for plan in every),
        tuple(plan.certificate.verified for plan in every),
        tuple(float(plan.trajectory.t[-1]) if plan.report.ending else None for plan in every),
    )


def _common_costs(
    plans: Sequence[Plan], costs: Sequence[Cost]
) -> dict[str, tuple[float | None, ...]]:
    """Return the values of given costs for all plans, and their sums."""
    listed = as_several(costs, "costs", Cost)  # type: ignore[type-abstract]
    names = [cost.name for cost in listed]
    if not listed or len(set(names)) < len(names):
        raise ProblemError(f"costs are {shown(names)}, expected one or more, each with its name=")
    found = {cost.name: tuple(plan.evaluate(cost) for plan in plans) for cost in listed}
    sums = map(sum, zip(*found.values(), strict=True))
    totals = (None if plan.report.ending else each for plan, each in zip(plans, sums, strict=True))
    return {**found, _TOTAL: tuple(totals)}


def _own_costs(plans: Sequence[Plan]) -> dict[str, tuple[float | None, ...]]:
    """Return the values of each plan's own costs, and the sums if these are the same."""
    by_plan = [{cost.name: cost for cost in plan.problem.costs} for plan in plans]
    found: dict[str, tuple[float | None, ...]] = {}
    for term in dict.fromkeys(term for plan in plans for term in plan.report.terms):
        given = [costs[term] for costs in by_plan if term in costs]
        alike = all(_is_same(given[0], other) for other in given[1:])
        label = term if alike else f"{term} (each plan's own)"
        found[label] = tuple(plan.report.terms.get(term) for plan in plans)
    first = by_plan[0]
    if all(
        costs.keys() == first.keys() and all(_is_same(first[name], costs[name]) for name in first)
        for costs in by_plan[1:]
    ):
        found[_TOTAL] = tuple(None if plan.report.ending else plan.report.cost for plan in plans)
    return found


def _is_same(one: Cost, other: Cost) -> bool:
    """Whether two costs have the same integrand, as far as descriptions say."""
    if FunctionCost in (type(one), type(other)):
        return one == other
    try:
        return one.to_dict() == other.to_dict()
    except FileFormatError:
        return one is other


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.5g}"
