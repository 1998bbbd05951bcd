"""Draw README's picture, the same seam by two motions: ``python docs/two_motions.py``.

On the left the arm follows the seam by the pseudo-inverse of its Jacobian, as a Cartesian tracker
does; on the right is the plan, from the same start. Needs a Chromium browser.
"""

import io
import tempfile
from pathlib import Path
from typing import Any

import matplotlib.image as images
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.shell.replay import render_png

FILE = Path(__file__).parent / "two_motions.png"
DURATION = 6.0
# When the arm is shown [s]: as the joints of the left motion go fastest, and faintly later.
TIMES, _FAINT = (2.06, 4.0), 0.25
_RED, _GREEN, _GREY = "#b3261e", "#1b7f3b", "#5f6670"
# A picture of the scene [pixels], and what is left of it without legend and verdict.
_SIZE = (900, 860)
_CUT = (slice(110, 780), slice(60, 840))


def seam() -> sm.Problem:
    """Return a straight seam of 0.7 m in front of a Panda, the tool leaning by 30 degrees."""
    panda = sm.load_robot("panda")
    c, s = np.cos(np.deg2rad(30.0)), np.sin(np.deg2rad(30.0))
    first = np.array([[0, 1, 0, 0.46], [c, 0, -s, 0.35], [-s, 0, -c, 0.54], [0, 0, 0, 1.0]])
    last = first.copy()
    last[1, 3] = -0.35
    near = [-1.712, -0.645, 1.987, -0.935, 0.099, 1.053, -0.433]
    start = panda.inverse_kinematics(first, "pose", seed=near)
    return sm.Problem(panda, sm.paths.Line(first, last, DURATION), start=start)


def main() -> None:
    """Plan both, and draw them side by side."""
    problem = seam()
    motions = (sm.plan_by(problem, sm.baselines.PseudoInverse()), sm.plan(problem).require())
    figure = Figure(figsize=(10.0, 8.2), dpi=100, facecolor="white")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(
        2, 2, height_ratios=(1.45, 1.0), left=0.095, right=0.985, top=0.87, bottom=0.1,
        hspace=0.06, wspace=0.06,
    )  # fmt: skip
    names, colours = ("pseudo-inverse", "selfmotion"), (_RED, _GREEN)
    highest = 100.0 * max(shares(plan).max() for plan in motions)
    for column, (plan, name, colour) in enumerate(zip(motions, names, colours, strict=True)):
        share = 100.0 * shares(plan)
        scene, speeds = (figure.add_subplot(grid[row, column]) for row in (0, 1))
        scene.imshow(_scene(plan))
        scene.set_axis_off()
        scene.set_title(name, fontsize=25, fontweight="bold", color=colour, pad=40)
        told = f"peak joint speed: {share.max():.0f} % of limit"
        scene.text(
            0.5, 1.03, told, fontsize=19.5, color=colour, ha="center", va="bottom",
            transform=scene.transAxes,
        )  # fmt: skip
        times = np.linspace(0.0, DURATION, len(share))
        speeds.plot(times, share, color=colour, linewidth=2.4)
        speeds.axhspan(100.0, 2.0 * highest, color=_RED, alpha=0.12, linewidth=0)
        speeds.axhline(100.0, color=_RED, linewidth=1.6)
        right: dict[str, Any] = {"ha": "right", "fontsize": 20}
        speeds.text(DURATION, 104.0, "joint speed limit", color=_RED, va="bottom", **right)
        told = f"cost {plan.report.cost:.2f}"
        speeds.text(DURATION, highest, told, color=colour, va="top", **right)
        speeds.set(xlim=(0.0, DURATION), ylim=(0.0, 1.08 * highest), xticks=(0, 2, 4, 6))
        speeds.set_yticks((0, 100, 200), labels=("0", "100 %", "200 %") if not column else ())
        speeds.tick_params(labelsize=18, colors=_GREY)
        speeds.set_xlabel("joint speeds over time [s]", fontsize=19, color=_GREY)
        for side in ("top", "right"):
            speeds.spines[side].set_visible(False)
    _write(figure)


def shares(plan: sm.Plan) -> Array:
    """Return speeds (N, n) as shares of their limits."""
    times = np.linspace(0.0, DURATION, 1201)
    return np.abs(plan.trajectory(times, order=1)) / plan.robot.velocity_limit


def _scene(plan: sm.Plan) -> Array:
    """Return the arm at both times, in one picture."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scene.png"
        taken = [
            images.imread(render_png(plan, file, t=t, size=_SIZE, layers=("trace",)))[..., :3]
            for t in TIMES
        ]
    first, later = (each[_CUT] for each in taken)
    return (1.0 - _FAINT) * first + _FAINT * later


def _write(figure: Figure) -> None:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    few = Image.open(buffer).convert("RGB").quantize(192, dither=Image.Dither.NONE)
    few.save(FILE, optimize=True)


if __name__ == "__main__":
    main()
