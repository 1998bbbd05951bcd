"""Where to put the arm: one plan for each place of its base, and a map of what the motion costs."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import selfmotion as sm

OUT = Path("out") / "placement"
X, Y = np.linspace(-0.15, 0.15, 3), np.linspace(-0.2, 0.2, 3)


def problem_at(x: float, y: float) -> sm.Problem:
    """Return the seam, planned for an arm that stands at (x, y)."""
    panda = sm.load_robot("panda", base=[[1, 0, 0, x], [0, 1, 0, y], [0, 0, 1, 0], [0, 0, 0, 1]])
    home = sm.load_robot("panda").pose(sm.NAMED_ARMS["panda"].home)
    seam = sm.paths.Circle.around(home, radius=0.12, duration=4.0)
    start = panda.inverse_kinematics(home, "pose", seed=sm.NAMED_ARMS["panda"].home)
    return sm.Problem(panda, seam, "pose", start)


if __name__ == "__main__":  # the processes that plan import this file
    places = [(x, y) for y in Y for x in X]
    batch = sm.plan_many([problem_at(*place) for place in places], out=OUT, workers=2)
    cost = np.array([row.cost if row.verified else np.nan for row in batch.rows]).reshape(3, 3)
    print(f"{np.isfinite(cost).sum()} of {cost.size} places have a verified plan")
    for line in cost[::-1]:
        print("  ".join("  -   " if np.isnan(value) else f"{value:.4f}" for value in line))
    best = places[int(np.nanargmin(cost))]
    print(f"the best: x = {best[0]:.2f} m, y = {best[1]:.2f} m, cost {np.nanmin(cost):.4f}")
    figure = Figure(figsize=(4.5, 4), layout="constrained")
    axes = figure.subplots()
    shown = axes.pcolormesh(X, Y, cost, shading="nearest")
    figure.colorbar(shown, label="cost")
    axes.set(xlabel="x of the base [m]", ylabel="y [m]", aspect="equal")
    figure.savefig(OUT / "map.png")
