"""Two Pandas carry a bar round a circle: one hand on the path, the other on the bar."""

import numpy as np
import pinocchio as pin

import selfmotion as sm


def stand(y: float) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array([0.0, y, 0.0]))


LEFT, RIGHT = "left/panda_hand_tcp", "right/panda_hand_tcp"
cell = sm.load_robot(
    {"left": "panda", "right": "panda"},
    base={"left": stand(0.45), "right": stand(-0.45)},
    tool=(LEFT, RIGHT),
)
# The bar is 0.4 m long; both hands hold it from above.
first = pin.SE3(np.diag([1.0, -1.0, -1.0]), np.array([0.45, 0.2, 0.3]))
grasp = pin.SE3(np.eye(3), np.array([0.0, 0.4, 0.0]))
circle = sm.paths.Circle.around(first, radius=0.15, duration=6.0, normal=(0, 1, 0))
problem = sm.Problem(
    cell,
    [sm.Follow(circle, tool=LEFT), sm.Follow(grasp, tool=RIGHT, reference=LEFT)],
)
plan = sm.plan(problem).require()
print(f"{cell.dof} joints, {problem.follows.dimension} rows")
print(f"cost {plan.report.initial_cost:.4f} → {plan.report.cost:.4f}")
print(plan.certificate.verdict)
