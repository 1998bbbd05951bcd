"""The pictures of the method and of pages that run, drawn from plans while the site is built.

Those of a page are of what its own code makes.
"""

import io
import re
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

import selfmotion as sm
from selfmotion.paper.study.context import optimum
from selfmotion.paper.study.published import published_null_motion
from selfmotion.shell.replay.motion import curves

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from shown import Page

_STYLE = {"svg.fonttype": "none", "svg.hashsalt": "selfmotion", "font.size": 9.0}
_SIZE = (6.4, 3.0)
# Of pages: no wider than a telephone's text is, twice.
_NARROW = 5.2
_BLUE, _ORANGE, _GREEN, _GREY = "#4269d0", "#e8871e", "#3ca951", "#b0b7c3"


def draw_all(pages: Mapping[str, "Page"]) -> dict[str, str]:
    """Return name → SVG; the first one of a page has its name."""
    plan = sm.plan(sm.sample_problem())
    return {
        "self_motion": self_motion(),
        "speeds": speeds(plan),
        "convergence": convergence(),
        "path_error": path_error(plan),
        "knot_points": knot_points(),
        "control_points": control_points(),
        **{name: draw(pages[name]) for name, draw in _OF_PAGES.items()},
        "weave": weave(pages["seam"]),
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
    motions = {"minimum-norm": plan.initial_trajectory, "optimised": plan.trajectory}
    for axes, (name, motion) in zip(
        figure.subplots(1, 2, sharey=True), motions.items(), strict=True
    ):
        axes.plot(motion.t, motion.qd, label=motion.joint_names)
        axes.set(title=name, xlabel="t [s]")
        axes.legend(frameon=False)
    figure.axes[0].set_ylabel("joint speed [rad/s]")
    return _svg(figure)


def knot_points() -> str:
    """Draw the self-motion manifolds of a path side by side, and two motions across them."""
    arm, start = sm.load_robot("planar_3r"), [0.2, 1.9, -2.2]
    end = arm.pose(start)
    end.translation = end.translation + np.array([-3.4, -0.4, 0.0])
    line = sm.paths.Line(arm.pose(start), end, 4.0)
    costs = sm.sample_problem().costs
    plan = sm.plan(sm.Problem(arm, line, "planar", start, costs=costs, constraints=[])).require()
    t, angles = np.linspace(0.0, line.duration, 121), np.linspace(-np.pi, np.pi, 121)
    places = line.samples(t).translation[:, :2]
    first, second, third = 2.0, 2.0, 1.0
    wrist = places[:, None] - third * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    far = np.linalg.norm(wrist, axis=-1)
    # The elbow angle by the law of cosines, on the side on which the motion begins.
    cosine = (far**2 - first**2 - second**2) / (2.0 * first * second)
    elbow = np.arccos(np.where(np.abs(cosine) <= 1.0, cosine, np.nan))
    away = np.arctan2(wrist[..., 1], wrist[..., 0])
    q1 = away - np.arctan2(second * np.sin(elbow), first + second * np.cos(elbow))
    q = np.stack([q1, elbow, angles - q1 - elbow], axis=-1)
    shown = ~np.isnan(elbow)
    measure = np.full(elbow.shape, np.nan)
    rows = np.array([arm.task_jacobian(each, "planar") for each in q[shown]])
    measure[shown] = np.sqrt(np.linalg.det(rows @ np.swapaxes(rows, 1, 2)))
    figure, axes = _axes()
    figure.set_size_inches(6.4, 3.6)
    mesh = axes.pcolormesh(t, angles, measure.T, cmap="Greys_r", rasterized=True, alpha=0.6)
    figure.colorbar(mesh, ax=axes, label="manipulability")
    for motion, ink, name in (
        (plan.initial_trajectory, _ORANGE, "minimum norm"),
        (plan.trajectory, _BLUE, "optimised"),
    ):
        axes.plot(t, motion(t).sum(axis=1), color=ink, linewidth=2, label=name)
    knots = plan.trajectory.t
    axes.plot(knots, plan.trajectory(knots).sum(axis=1), "o", color=_BLUE, markersize=3)
    axes.set(xlabel="t [s]", ylabel="direction of the last link [rad]", ylim=angles[[0, -1]])
    axes.legend(frameon=False, loc="upper left")
    return _svg(figure)


def control_points() -> str:
    """Draw the speed of a joint at its limit, with its control points."""
    panda = sm.load_robot("panda")
    start = panda.dexterous_configuration()
    circle = sm.paths.Circle.around(panda.pose(start), 0.15, 4.0, normal=(1, 0, 0))
    free = sm.plan(sm.Problem(panda, circle, task="position", start=start))
    busy = int(np.abs(free.trajectory.qd).max(axis=0).argmax())
    limit = 0.8 * float(np.abs(free.trajectory.qd[:, busy]).max())
    asked = [sm.constraints.JointVelocityLimits(limit)]
    asked_of = sm.Problem(panda, circle, task="position", start=start, constraints=asked)
    motion = sm.plan(asked_of).require().trajectory
    figure, axes = _axes()
    t, h = np.linspace(0.0, circle.duration, 1200), np.diff(motion.t)
    q, qd, qdd = (motion(motion.t, order)[:, busy] for order in range(3))
    ends = (q[:-1], q[1:]), (qd[:-1], qd[1:]), (qdd[:-1], qdd[1:])
    (q0, q1), (v0, v1), (a0, a1) = ends
    # The quintic's Bernstein form, and that of its derivative.
    left = [q0, q0 + h * v0 / 5, q0 + 2 * h * v0 / 5 + h**2 * a0 / 20]
    right = [q1 - 2 * h * v1 / 5 + h**2 * a1 / 20, q1 - h * v1 / 5, q1]
    speeds = 5.0 * np.diff(np.stack(left + right), axis=0) / h
    for k in range(len(h)):
        where = motion.t[k] + h[k] * np.linspace(0.0, 1.0, 5)
        name = "control points" if k == 0 else ""
        axes.plot(where, speeds[:, k], ".-", color=_ORANGE, linewidth=1.0, markersize=7, label=name)
    name = f"speed of joint {busy + 1}"
    axes.plot(t, motion(t, 1)[:, busy], color=_BLUE, linewidth=1.5, label=name)
    for side in (-limit, limit):
        axes.axhline(side, color="black", linestyle="dashed", linewidth=1)
    near = motion.t[int((np.abs(motion.qd[:, busy]) > 0.98 * limit).argmax())]
    axes.set(xlabel="t [s]", ylabel="speed [rad/s]", xlim=(near - 0.12, near + 0.08))
    axes.set(ylim=(0.85 * limit, 1.01 * limit))
    axes.legend(frameon=False, loc="lower right")
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


def seam(page: "Page") -> str:
    """Draw how the tool comes to the seam and goes, and its speed."""
    lead, feed = 1.0, 0.03
    path = page.names["whole"]
    plan = sm.plan(sm.Problem(page.names["panda"], path, task="pointing")).require()
    t, places, turns = _tool(plan)
    here = (t >= lead) & (t <= path.duration - lead)
    figure = Figure(figsize=(_NARROW, 4.2), layout="constrained")
    side, pace = figure.subplots(2, 1, height_ratios=(1, 1.5))
    for part, ink, name in ((~here, _ORANGE, "lead"), (here, _BLUE, "seam")):
        shown = np.where(part[:, None], 1e3 * places, np.nan)
        side.plot(shown[:, 1], shown[:, 2], color=ink, linewidth=2.5, label=name)
    for k in np.linspace(np.flatnonzero(here)[0], np.flatnonzero(here)[-1], 6).astype(int):
        tip, back = 1e3 * places[k], -12.0 * turns[k][:, 2]
        side.plot(*np.array([tip, tip + back])[:, 1:].T, color=_GREY, linewidth=1.5, zorder=0)
    side.plot([], [], color=_GREY, label="tool")
    side.set(aspect="equal", xlabel="y [mm]", ylabel="z [mm]", title="seen from the side")
    side.legend(frameon=False, loc="upper center", ncols=3)
    speed = 1e3 * np.linalg.norm(np.gradient(places, t, axis=0), axis=1)
    pace.plot(t, speed, color=_BLUE)
    pace.axhline(1e3 * feed, color=_GREY, linestyle="dashed")
    middle = (0.5 * path.duration, 1e3 * feed)
    pace.annotate("the feed", middle, (0, 3), textcoords="offset points", ha="center")
    for begin in (0.0, path.duration - lead):
        pace.axvspan(begin, begin + lead, color=_ORANGE, alpha=0.15, linewidth=0)
    pace.set(xlabel="t [s]", ylabel="speed of the tool [mm/s]", ylim=(0, None))
    return _svg(figure)


def weave(page: "Page") -> str:
    """Draw how the tool begins to swing along a woven seam."""
    seam, swung = 1e3 * np.array(page.names["points"]), page.names["plan"]
    t = np.linspace(0.0, swung.trajectory.duration, 6001)
    _, _, places = swung.robot.chain.along(swung.trajectory(t))
    figure = Figure(figsize=(_NARROW, 1.8), layout="constrained")
    axes = figure.subplots()
    axes.plot(seam[:, 1], seam[:, 0], color=_GREY, linestyle="dashed", label="seam")
    axes.plot(*1e3 * places[:, 1::-1].T, color=_BLUE, linewidth=1.2, label="the tool's way")
    axes.set(aspect="equal", xlabel="y [mm]", ylabel="x [mm]", xlim=(-103, -47), ylim=(494, 506))
    figure.legend(frameon=False, ncols=2, loc="outside upper center")
    return _svg(figure)


def relaxations(page: "Page") -> str:
    """Draw what is allowed around the path, and what the plan uses of it."""
    plan = page.names["plan"]
    cone, stick, free = plan.problem.relaxations
    t, places, turns = _tool(plan)
    target = plan.path.samples(t)
    between = np.einsum("kji,kjl->kil", target.rotation, turns)
    angles = np.degrees(Rotation.from_matrix(between).as_rotvec())
    off = 1e3 * np.einsum("kji,kj->ki", target.rotation, places - target.translation)
    figure = Figure(figsize=(_NARROW, 5.6), layout="constrained")
    grid = figure.add_gridspec(3, 2, height_ratios=(2.4, 1, 1))
    _cones(figure.add_subplot(grid[0, 0]), cone.band, target, places, turns)
    axes = figure.add_subplot(grid[0, 1])
    along, about = (figure.add_subplot(grid[k, :]) for k in (1, 2))
    around, band = np.linspace(0.0, 2.0 * np.pi, 200), float(np.degrees(cone.band))
    edge = band * np.array([np.cos(around), np.sin(around)])
    axes.fill(*edge, color=_GREEN, alpha=0.25, linewidth=0)
    axes.plot(angles[:, 0], angles[:, 1], color=_BLUE, linewidth=2)
    axes.plot(0, 0, "+", color="black")
    axes.set(aspect="equal", xlabel="rx [°]", ylabel="ry [°]", title=f"in the cone of {band:.0f}°")
    half = 1e3 * stick.band
    along.axhspan(-half, half, color=_GREEN, alpha=0.25, linewidth=0)
    along.plot(t, off[:, 2], color=_BLUE)
    along.set(ylabel="z [mm]", title="stick-out", xlim=(0, t[-1]), ylim=(-1.2 * half, 1.2 * half))
    about.axvspan(*free.window(t[-1]), color=_GREEN, alpha=0.25, linewidth=0)
    about.plot(t, angles[:, 2], color=_BLUE)
    about.set(xlabel="t [s]", ylabel="rz [°]", title="turn about the axis", xlim=(0, t[-1]))
    return _svg(figure)


def _cones(
    axes: "Axes", band: float, target: sm.paths.PathSamples, places: np.ndarray, turns: np.ndarray
) -> None:
    """Draw the cones of allowed axes along a path in the plane of y and z, and the tool's axes."""
    length, steps = 0.09, np.linalg.norm(np.diff(target.translation, axis=0), axis=1)
    way = np.append(0.0, np.cumsum(steps))
    chosen = np.searchsorted(way, np.linspace(0.0, way[-1], 12, endpoint=False))
    axes.plot(*1e3 * target.translation[:, 1:].T, color=_GREY, linewidth=2, label="path")
    for number, k in enumerate(chosen):
        tip, axis = places[k], -length * target.rotation[k][:, 2]
        sides = [Rotation.from_rotvec([side * band, 0.0, 0.0]).apply(axis) for side in (-1, 1)]
        corners = 1e3 * np.array([tip, *(tip + side for side in sides)])[:, 1:]
        axes.fill(
            *corners.T, color=_GREEN, alpha=0.3, linewidth=0, label="" if number else "allowed"
        )
        used = 1e3 * np.array([tip, tip - length * turns[k][:, 2]])[:, 1:]
        axes.plot(*used.T, color=_BLUE, linewidth=1.5, label="" if number else "used")
    axes.set(aspect="equal", xlabel="y [mm]", ylabel="z [mm]", title="the tool's axis")
    axes.legend(frameon=False, fontsize=8, loc="center")


def limits(page: "Page") -> str:
    """Draw how near each joint of a plan comes to each of its limits."""
    plan = page.names["plan"]
    robot, motion = plan.robot, curves(plan, plan.trajectory)
    asked = {type(item): item for item in plan.problem.constraints}
    used = {
        "speed": (motion.qd, asked[sm.constraints.JointVelocityLimits], _BLUE),
        "acceleration": (motion.qdd, asked[sm.constraints.JointAccelerationLimits], _ORANGE),
        "torque": (motion.torque, asked[sm.constraints.JointTorqueLimits], _GREEN),
    }
    figure = Figure(figsize=(_NARROW, 4.2), layout="constrained")
    axes, rows = figure.subplots(), np.arange(robot.dof)
    for k, (name, (values, limit, ink)) in enumerate(used.items()):
        share = 100.0 * np.abs(values).max(axis=0) / limit.of(robot)
        bars = axes.barh(rows + 0.26 * (k - 1), share, 0.24, color=ink, label=name)
        nearest = int(share.argmax())
        axes.annotate(
            f"{share[nearest]:.0f} %", (share[nearest], bars[nearest].get_y() + 0.12), (3, 0),
            textcoords="offset points", va="center", fontsize=9,
        )  # fmt: skip
    axes.axvline(100.0, color="black", linestyle="dashed", linewidth=1)
    axes.set(xlabel="largest share of the limit [%]", xlim=(0, 108))
    axes.set_yticks(rows, robot.joint_names)
    axes.invert_yaxis()
    axes.legend(frameon=False, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return _svg(figure)


def retiming(page: "Page") -> str:
    """Draw the joint accelerations of a plan, and of the same joint path at its fastest pace."""
    figure = Figure(figsize=(_NARROW, 4.8), layout="constrained")
    plans = {"plan": page.names["plan"], "retimed": page.names["fast"]}
    last = plans["plan"].trajectory.duration
    for axes, (name, plan) in zip(figure.subplots(2, 1), plans.items(), strict=True):
        motion = curves(plan, plan.trajectory)
        axes.plot(motion.t, motion.qdd, linewidth=1.2)
        for limit in (-5.0, 5.0):
            axes.axhline(limit, color="black", linestyle="dashed", linewidth=1)
        axes.set(title=f"{name}: {motion.t[-1]:.2f} s", ylabel="acceleration [rad/s²]")
        axes.set(xlim=(0, last), ylim=(-6, 6))
    figure.axes[1].set_xlabel("t [s]")
    names = plans["plan"].robot.joint_names
    figure.legend(names, frameon=False, ncols=4, fontsize=8, loc="outside lower center")
    return _svg(figure)


def cam(page: "Page") -> str:
    """Draw a drawing as it is, and the tool's way along it."""
    plan = sm.load_plan(page.folder / "bracket.npz")
    rows = sm.files.read_path(page.folder / "bracket.dxf", feed=0.03, seam="weld", tolerance=1e-6)
    drawn = rows.samples(np.linspace(0.0, rows.duration, 600)).translation
    _, places, _ = _tool(plan)
    shown = places - np.array([0.45, -0.1, 0.3])
    figure = Figure(figsize=(_NARROW, 3.6), layout="constrained")
    axes = figure.subplots()
    axes.plot(*1e3 * drawn[:, :2].T, color=_GREY, linewidth=6, label="drawn: line, arc, line")
    axes.plot(*1e3 * shown[:, :2].T, color=_BLUE, linewidth=1.5, label="the tool's way")
    axes.plot(*1e3 * shown[0, :2], "o", color=_BLUE, markersize=5, label="begin")
    axes.set(aspect="equal", xlabel="x [mm]", ylabel="y [mm]", title="layer weld")
    axes.legend(frameon=False, loc="upper left")
    return _svg(figure)


def controllers(page: "Page") -> str:
    """Draw the targets of a program along the plan, and how far off it lines between them are."""
    plan = sm.load_plan(page.folder / "seam.npz")
    program = sm.files.read_motion(page.folder / "seam.src")
    t, places, _ = _tool(plan)
    lines = np.stack([np.interp(t, program.t, each) for each in program.q.T], axis=1)
    _, _, joined = plan.robot.chain.along(lines)
    figure = Figure(figsize=(_NARROW, 4.6), layout="constrained")
    joints, off = figure.subplots(2, 1, sharex=True, height_ratios=(1.6, 1))
    for k in range(plan.robot.dof):
        start = plan.trajectory.q[0, k]
        (line,) = joints.plot(t, np.degrees(plan.trajectory(t)[:, k] - start), linewidth=1)
        angles = np.degrees(program.q[:, k] - start)
        joints.plot(program.t, angles, ".", color=line.get_color(), markersize=3.5)
    joints.set(ylabel="joints from the start [°]", title=f"{len(program.t) - 1} targets")
    off.plot(t, 1e3 * np.linalg.norm(joined - places, axis=1), color=_BLUE, linewidth=1)
    off.axhline(0.1, color="black", linestyle="dashed", linewidth=1)
    off.set(xlabel="t [s]", ylabel="off the plan [mm]", title="the tool, on lines between targets")
    return _svg(figure)


def check(page: "Page") -> str:
    """Draw how far off a path the tool is, at the samples of a motion and between them."""
    motion, panda, circle = (page.names[name] for name in ("motion", "panda", "circle"))

    def off(t: np.ndarray) -> np.ndarray:
        places = panda.chain.along(motion(t))[2]
        return np.linalg.norm(places - circle.samples(t).translation, axis=1)

    figure, axes = _axes()
    figure.set_size_inches(_NARROW, 3.2)
    t, floor = np.linspace(0.0, circle.duration, 1601), 1e-13
    there = off(motion.t)
    axes.semilogy(t, np.maximum(off(t), floor), color=_BLUE, linewidth=1, label="between samples")
    axes.semilogy(motion.t, np.maximum(there, floor), ".", color=_ORANGE,
                  label=f"at samples ({there.max():.0e} at most)")  # fmt: skip
    axes.axhline(1e-4, color="black", linestyle="dashed", linewidth=1, label="allowed")
    axes.set(xlabel="t [s]", ylabel="distance from the path [m]", ylim=(5e-14, 1e-3))
    figure.legend(frameon=False, ncols=3, fontsize=8, loc="outside upper center")
    return _svg(figure)


def realtime(page: "Page") -> str:
    """Draw the speeds that one step tells an arm."""
    segment, period = page.names["segment"], 1e3 * page.names["replanner"].period
    t = 1e3 * (segment.t - segment.t[0])
    figure, axes = _axes()
    figure.set_size_inches(_NARROW, 3.2)
    axes.axvspan(0.0, period, color=_GREEN, alpha=0.25, linewidth=0)
    axes.plot(t, segment.qd, linewidth=1.5)
    axes.annotate("obeyed", (0.5 * period, 1.0), xycoords=("data", "axes fraction"), ha="center",
                  va="top", xytext=(0, -4), textcoords="offset points")  # fmt: skip
    axes.annotate("for when the next step is late", (0.5 * (period + t[-1]), 1.0), ha="center",
                  xycoords=("data", "axes fraction"), va="top", xytext=(0, -4),
                  textcoords="offset points")  # fmt: skip
    axes.margins(y=0.2)
    axes.set(xlabel="time from now [ms]", ylabel="joint speed [rad/s]", xlim=(0, t[-1]))
    names = page.names["panda"].joint_names
    figure.legend(axes.lines, names, frameon=False, ncols=4, fontsize=8, loc="outside lower center")
    return _svg(figure)


def from_other_tools(page: "Page") -> str:
    """Draw where joints are in their ranges: each instant planned alone, and all at once."""
    motions = {
        "pseudo-inverse, instant by instant": page.names["tracked"],
        "selfmotion, the whole path": page.names["plan"],
    }
    figure = Figure(figsize=(_NARROW, 5.0), layout="constrained")
    for axes, (title, plan) in zip(figure.subplots(2, 1), motions.items(), strict=True):
        robot, motion = plan.robot, plan.trajectory
        t = np.linspace(0.0, motion.duration, 401)
        share = 100.0 * (motion(t) - robot.lower) / (robot.upper - robot.lower)
        beyond = ((share < 0.0) | (share > 100.0)).any(axis=0)
        for k in range(robot.dof):
            axes.plot(t, share[:, k], linewidth=2.5 if beyond[k] else 1.2)
        for limit in (0.0, 100.0):
            axes.axhline(limit, color="black", linestyle="dashed", linewidth=1)
        axes.set(title=title, ylabel="joint, in its range [%]", xlim=(0, t[-1]), ylim=(-12, 112))
    figure.axes[1].set_xlabel("t [s]")
    names = page.names["panda"].joint_names
    figure.legend(axes.lines[: len(names)], names, frameon=False, ncols=4, fontsize=8,
                  loc="outside lower center")  # fmt: skip
    return _svg(figure)


def follow(page: "Page") -> str:
    """Draw some segments that came back to a controller, and what it did of each."""
    joints = len(page.names["home"])
    figure, axes = _axes()
    figure.set_size_inches(_NARROW, 3.0)
    segments = [np.array(each) for each in page.names["segments"]]
    fastest = int(np.abs(segments[20][:, 1 + joints : 1 + 2 * joints]).max(axis=0).argmax())
    shown = segments[20:24]
    for now, after in zip(shown, segments[21:25], strict=True):
        t, speed = 1e3 * now[:, 0], now[:, 1 + joints + fastest]
        done = t <= 1e3 * after[0, 0] + 1e-9
        label = now is shown[0]
        axes.plot(t, speed, color=_ORANGE, linewidth=1, label="a segment" if label else "")
        axes.plot(t[done], speed[done], color=_BLUE, linewidth=3, label="done" if label else "")
        axes.plot(t[:1], speed[:1], "o", color=_BLUE, label="it comes" if label else "")
    axes.set(xlabel="t [ms]", ylabel=f"speed of joint {fastest + 1} [rad/s]")
    axes.legend(frameon=False)
    return _svg(figure)


def redundancy(page: "Page") -> str:
    """Draw the redundancy map of the page."""
    figure: Figure = page.names["shown"].figure()
    return _svg(figure)


def places(page: "Page") -> str:
    """Return the map of what the places of the page about them cost."""
    written = page.folder / "out" / "places" / "index.html"
    shown = re.search(r"<svg.*?</svg>", written.read_text(), re.DOTALL)
    if shown is None:
        raise ValueError(f"{written}: has no map")
    return shown.group()


_OF_PAGES: Mapping[str, Callable[["Page"], str]] = {
    "seam": seam,
    "relaxations": relaxations,
    "limits": limits,
    "retiming": retiming,
    "cam": cam,
    "controllers": controllers,
    "check": check,
    "follow": follow,
    "from_other_tools": from_other_tools,
    "realtime": realtime,
    "places": places,
    "redundancy": redundancy,
}


def _tool(plan: sm.Plan) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times (K,) [s], and where the tool is then: (K, 3) [m] and (K, 3, 3)."""
    t = np.linspace(0.0, plan.trajectory.duration, 801)
    _, turns, places = plan.robot.chain.along(plan.trajectory(t))
    return t, places, turns


def _axes() -> tuple[Figure, "Axes"]:
    figure = Figure(figsize=_SIZE, layout="constrained")
    return figure, figure.subplots()


def _svg(figure: Figure) -> str:
    stream = io.StringIO()
    with matplotlib.rc_context(_STYLE):
        figure.savefig(stream, format="svg", metadata={"Date": None})
    return re.sub(r"<metadata>.*?</metadata>", "", stream.getvalue(), flags=re.DOTALL)
