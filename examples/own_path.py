"""A tool path of one's own: a helix. As a dataclass it is saved with a plan, and loaded again."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

import selfmotion as sm
from selfmotion.testing import check_path


@dataclass(frozen=True, eq=False)
class Helix(sm.paths.Path, kind="helix"):
    """A helix about a vertical axis, from rest to rest, the tool's orientation kept."""

    start: np.ndarray  # pose of the tool at t = 0, (4, 4)
    radius: float  # [m]
    rise: float  # [m]
    turns: float
    duration: float  # [s]

    def evaluate(self, t):
        tau = t / self.duration
        share = tau**3 * (10.0 + tau * (6.0 * tau - 15.0))
        rate = 30.0 * (tau * (1.0 - tau)) ** 2 / self.duration
        pose, angle = np.asarray(self.start, dtype=float), 2.0 * np.pi * self.turns
        phase = angle * share
        shape = [np.cos(phase) - 1.0, np.sin(phase), np.zeros_like(t)]
        offset = self.radius * np.stack(shape, axis=1)
        offset[:, 2] = self.rise * share
        slope = [-angle * np.sin(phase), angle * np.cos(phase), np.zeros_like(t)]
        velocity = self.radius * np.stack(slope, axis=1)
        velocity[:, 2] = self.rise
        return sm.paths.PathSamples(
            t,
            translation=pose[:3, 3] + offset,
            rotation=np.tile(pose[:3, :3], (len(t), 1, 1)),
            twist=np.hstack([velocity * rate[:, None], np.zeros((len(t), 3))]),
        )


panda = sm.load_robot("panda")
home = np.array(sm.NAMED_ARMS["panda"].home)
helix = Helix(panda.pose(home).homogeneous, radius=0.06, rise=-0.15, turns=2.0, duration=6.0)
check_path(helix)
plan = sm.plan(sm.Problem(panda, helix, start=home)).require()
file = Path("out") / "helix.npz"
plan.save(file)
again = sm.load_plan(file)
print(f"{type(again.path).__name__} with radius {again.path.radius} m: {again.check().verdict}")
