"""Why F 'surges' in the paper: the same cost, in its coefficients and in ours."""

from pathlib import Path

from matplotlib.figure import Figure

import selfmotion as sm
from selfmotion.paper.study.context import optimum
from selfmotion.paper.study.published import published_null_motion

searches = {
    "the paper's 12 coefficients, H0 = I": (published_null_motion(), False),
    "4 orthonormal ones in the null space": (sm.PolynomialNullMotion(), True),
}
figure = Figure(figsize=(6, 4), layout="constrained")
axes = figure.subplots()
for label, (motion, scaled) in searches.items():
    _, found = optimum(sm.sample_problem(null_motion=motion), metric=scaled, sigma=0.1)
    above = [step.cost / found.cost - 1.0 for step in found.history[:-1]]
    axes.semilogy(above, marker="o", label=label)
    print(f"{label}: F = {found.cost:.5f} after {len(above)} iterations")
axes.set(xlabel="iteration", ylabel="F / F(end) - 1")
axes.legend()
Path("out").mkdir(exist_ok=True)
figure.savefig("out/study_surging.png")
