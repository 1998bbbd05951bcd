"""The paper's figures 1 and 2: joint speeds along the sample trajectory, without and with ε(t)."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import selfmotion as sm

plan = sm.plan(sm.sample_problem())
motions = {"x = 0": plan.initial_trajectory, "x*": plan.trajectory}
figure = Figure(figsize=(9, 3.5), layout="constrained")
for axes, (name, motion) in zip(figure.subplots(1, 2, sharey=True), motions.items(), strict=True):
    axes.plot(motion.t, motion.qd, label=motion.joint_names)
    axes.set(title=name, xlabel="t [s]")
    axes.legend()
    print(f"{name}: at most {np.abs(motion.qd).max():.2f} rad/s")
figure.axes[0].set_ylabel("q̇ [rad/s]")
Path("out").mkdir(exist_ok=True)
figure.savefig("out/study_joint_speeds.png")
