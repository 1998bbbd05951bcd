"""Costs of one's own: a function for a first try, a class with its exact gradient to keep."""

from dataclasses import dataclass

import numpy as np

import selfmotion as sm
from selfmotion.testing import check_cost


def elbow_down(qd, q, t):
    """Return G = 5 (1 - cos q3): large when joint 3 swings the elbow down."""
    return 5.0 * (1.0 - np.cos(q[:, 2]))


@dataclass(frozen=True)
class ElbowDown(sm.costs.Cost):
    """G = μ (1 - cos q3), with its gradient: faster, and saved with a plan."""

    mu: float = 5.0
    name: str = "elbow"

    def value(self, samples):
        return self.mu * (1.0 - np.cos(samples.q[:, 2]))

    def gradient(self, samples):
        by_q = np.zeros_like(samples.q)
        by_q[:, 2] = self.mu * np.sin(samples.q[:, 2])
        return sm.costs.Partials(q=by_q)


check_cost(ElbowDown())
panda = sm.load_robot("panda")
start = panda.dexterous_configuration()
line_end = panda.pose(start)
line_end.translation = line_end.translation + np.array([0.0, 0.1, -0.05])
line = sm.paths.Line(panda.pose(start), line_end, 3.0)
for cost in (sm.costs.FunctionCost(elbow_down, name="elbow"), ElbowDown()):
    problem = sm.Problem(panda, line, start=start, costs=[sm.costs.JointVelocity(), cost])
    plan = sm.plan(problem).require()
    for name, before in plan.report.initial_terms.items():
        print(f"{name}: {before:.4f} → {plan.report.terms[name]:.4f}")
    print(plan.certificate.verdict)
