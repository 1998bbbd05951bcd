"""Plans side by side: costs, durations, the worst that their checks found, and verdicts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from selfmotion.basics import ProblemError, shown
from selfmotion.result.plan import Plan

_TOTAL, _VERIFIED = "total cost", "verified"
# Rows of a table, and the part of a certificate that each is the worst of.
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
        What the P plans are called.
    costs : dict
        What each cost contributes, and "total cost": (P,) each. None where a plan has no such cost,
        and for the total of one that ends before its path does: nothing compares with it.
    figures : dict
        Duration [s], joint path Σ|Δq| [rad or m], and the worst of the certificate, (P,) each; None
        where it was not looked at.
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
        total = next(row for row in rows if row[0] == _TOTAL)
        for column, end in enumerate(self.ends, start=1):
            if end is not None:
                total[column] = f"ends at t = {end:.4g} s"
        return [*rows, [_VERIFIED, *("yes" if each else "no" for each in self.verified)]]

    def refusals(self) -> list[str]:
        """Return a line for each plan that is not verified: its name, and why."""
        every = zip(self.names, self.verdicts, self.verified, strict=True)
        return [f"{name}: {verdict}" for name, verdict, verified in every if not verified]

    def __str__(self) -> str:
        """Return the table, then why plans are not verified."""
        rows = [["", *self.names], *self.cells()]
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        lines = [
            "  ".join(
                cell.rjust(width) if column else cell.ljust(width)
                for column, (cell, width) in enumerate(zip(row, widths, strict=True))
            ).rstrip()
            for row in rows
        ]
        return "\n".join([*lines, *self.refusals()])


def compare(plans: Sequence[Plan] | Mapping[str, Plan]) -> Comparison:
    """Compare plans: costs, durations, margins and verdicts, side by side.

    Costs are those that each plan was made for; `Plan.evaluate` gives another's.

    Parameters
    ----------
    plans : sequence of Plan, or dict
        By name, or called "plan 1", "plan 2", …

    Returns
    -------
    Comparison

    Raises
    ------
    ProblemError
        There is none, or one is no plan.
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
    terms = dict.fromkeys(term for plan in every for term in plan.report.terms)
    costs = {term: tuple(plan.report.terms.get(term) for plan in every) for term in terms}
    costs[_TOTAL] = tuple(None if plan.report.ending else plan.report.cost for plan in every)
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
        costs,
        figures,
        tuple(plan.certificate.verdict for plan in every),
        tuple(plan.certificate.verified for plan in every),
        tuple(float(plan.trajectory.t[-1]) if plan.report.ending else None for plan in every),
    )


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.5g}"
