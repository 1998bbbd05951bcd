"""The pictures of the method, drawn from plans while the site is built; the same each time."""

import io
import re
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from matplotlib.figure import Figure

import selfmotion as sm
from selfmotion.batch import grid_items, plan_items
from selfmotion.study.engine import optimum
from selfmotion.study.published import published_null_motion

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_STYLE = {"svg.fonttype": "none", "svg.hashsalt": "selfmotion", "font.size": 9.0}
_SIZE = (6.4, 3.0)
_PLACES = Path(__file__).parent / "pages" / "howto" / "places.md"


def draw_all() -> dict[str, str]:
    """Return name → SVG."""
    plan = sm.plan(sm.sample_problem())
    return {
        "self_motion": self_motion(),
        "speeds": speeds(plan),
        "convergence": convergence(),
        "path_error": path_error(plan),
        "places": places(),
    }


def self_motion() -> str:
    """Draw one tool position of the planar arm with several configurations."""
    # The joints are where the next link begins.
    ends = [sm.load_robot("planar_3r", tool=link) for link in ("link2", "link3", "tool")]
    arm = ends[-1]
    pose = arm.pose(arm.dexterous_configuration("planar"))
    figure, axes = _axes()
    for seed in range(12):
        guess = np.random.default_rng(seed).uniform(-np.pi, np.pi, arm.dof)
        q = arm.inverse_kinematics(pose, "planar", seed=guess)
        joints = [each.pose(q[: each.dof]).translation[:2] for each in ends]
        axes.plot(*np.array([np.zeros(2), *joints]).T, marker="o", markersize=3, linewidth=1)
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    return _svg(figure)


def speeds(plan: sm.Plan) -> str:
    """Draw the joint speeds of the paper's example, without and with self-motion."""
    figure = Figure(figsize=_SIZE, layout="constrained")
    motions = {"x = 0": plan.initial_trajectory, "optimised": plan.trajectory}
    for axes, (name, motion) in zip(
        figure.subplots(1, 2, sharey=True), motions.items(), strict=True
    ):
        axes.plot(motion.t, motion.qd, label=motion.joint_names)
        axes.set(title=name, xlabel="t [s]")
        axes.legend(frameon=False)
    figure.axes[0].set_ylabel("joint speed [rad/s]")
    return _svg(figure)


def convergence() -> str:
    """Draw the cost over the iterations, in the paper's coefficients and in ours."""
    figure, axes = _axes()
    searches = {
        "12 coefficients of the joints, H = I": (published_null_motion(), False),
        "4 in the transported basis, H from the metric": (sm.PolynomialNullMotion(), True),
    }
    for label, (motion, scaled) in searches.items():
        _, found = optimum(sm.sample_problem(null_motion=motion), metric=scaled, sigma=0.1)
        above = [step.cost / found.cost - 1.0 for step in found.history[:-1]]
        axes.semilogy(above, marker="o", markersize=3, label=label)
    axes.set(xlabel="iteration", ylabel="cost above the optimum, as a share")
    axes.legend(frameon=False)
    return _svg(figure)


def path_error(plan: sm.Plan) -> str:
    """Draw how far the tool is off the path between two samples of the motion."""
    figure, axes = _axes()
    for every in (1, 2, 4):
        motion = plan.trajectory
        coarse = sm.Trajectory(
            motion.t[::every], motion.q[::every], motion.qd[::every], motion.joint_names,
            None if motion.qdd is None else motion.qdd[::every],
        )  # fmt: skip
        times = np.linspace(0.0, plan.path.duration, 2000)
        misses = [
            np.linalg.norm(plan.robot.pose(coarse(t)).translation - plan.path.pose(t).translation)
            for t in times
        ]
        axes.semilogy(times, np.maximum(misses, 1e-16), linewidth=0.8, label=f"{len(coarse.t) - 1}")
    axes.set(xlabel="t [s]", ylabel="distance from the path [m]")
    axes.legend(title="samples", frameon=False)
    return _svg(figure)


def places() -> str:
    """Return the map of what the places of the page about them cost."""
    block = re.search(r'```toml title="places.toml"\n(.*?)```', _PLACES.read_text(), re.DOTALL)
    if block is None:
        raise ValueError(f"{_PLACES}: has no block 'places.toml'")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "places.toml").write_text(block.group(1))
        plan_items(grid_items(folder / "places.toml"), out=folder, workers=1)
        shown = re.search(r"<svg.*?</svg>", (folder / "index.html").read_text(), re.DOTALL)
    if shown is None:
        raise ValueError(f"{_PLACES}: its grid has no map")
    return shown.group()


def _axes() -> tuple[Figure, "Axes"]:
    figure = Figure(figsize=_SIZE, layout="constrained")
    return figure, figure.subplots()


def _svg(figure: Figure) -> str:
    stream = io.StringIO()
    with matplotlib.rc_context(_STYLE):
        figure.savefig(stream, format="svg", metadata={"Date": None})
    return re.sub(r"<metadata>.*?</metadata>", "", stream.getvalue(), flags=re.DOTALL)
