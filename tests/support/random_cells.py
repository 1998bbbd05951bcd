"""Cells made at random: two chains on one body, each of a few joints, and what they follow."""

from pathlib import Path

import numpy as np
import pinocchio as pin

import selfmotion as sm
from selfmotion.basics import Array

LEFT, RIGHT = "left_tip", "right_tip"
# Fewest and most joints of a chain, of the stem that carries both, and how often one slides.
JOINTS, STEM, SLIDES = (2, 7), (0, 2), 0.15
# Shares of poses, positions and pointing among what is followed.
TASKS = ("pose", "position", "pointing")


def random_cell(rng: np.random.Generator, folder: Path) -> Path:
    """Write a URDF with two chains on a stem; return its file."""
    parts: list[str] = ['<robot name="cell">', _link("world", rng)]
    stem = _chain("stem", "world", int(rng.integers(*STEM, endpoint=True)), rng, parts)
    for side in ("left", "right"):
        last = _chain(side, stem, int(rng.integers(*JOINTS, endpoint=True)), rng, parts)
        parts.append(f'<link name="{side}_tip"/>')
        parts.append(_joint(f"{side}_held", "fixed", last, f"{side}_tip", rng))
    file = folder / "cell.urdf"
    file.write_text("\n".join([*parts, "</robot>"]))
    return file


def _chain(name: str, carrier: str, count: int, rng: np.random.Generator, parts: list[str]) -> str:
    """Add joints and links one after the other; return the last link."""
    for k in range(count):
        link = f"{name}_{k}"
        kind = "prismatic" if rng.random() < SLIDES else "revolute"
        parts += [_link(link, rng), _joint(f"{name}_joint{k}", kind, carrier, link, rng)]
        carrier = link
    return carrier


def _link(name: str, rng: np.random.Generator) -> str:
    moments = rng.uniform(0.01, 0.02, 3)
    place = " ".join(f"{x:.6f}" for x in rng.normal(scale=0.05, size=3))
    mass = f'<mass value="{rng.uniform(0.5, 2):.6f}"/>'
    return (
        f'<link name="{name}"><inertial><origin xyz="{place}"/>{mass}<inertia ixx="{moments[0]}" '
        f'iyy="{moments[1]}" izz="{moments[2]}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )


def _joint(name: str, kind: str, parent: str, child: str, rng: np.random.Generator) -> str:
    place = " ".join(f"{x:.6f}" for x in rng.normal(scale=0.2, size=3))
    turn = " ".join(f"{x:.6f}" for x in rng.uniform(-3.0, 3.0, 3))
    axis = rng.normal(size=3)
    axis = " ".join(f"{x:.9f}" for x in axis / np.linalg.norm(axis))
    low, high = (-0.5, 0.5) if kind == "prismatic" else (-2.9, 2.9)
    limit = f'<limit lower="{low}" upper="{high}" velocity="3" effort="100"/>'
    return (
        f'<joint name="{name}" type="{kind}"><origin xyz="{place}" rpy="{turn}"/>'
        f'<parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>{limit}</joint>'
    )


def random_follows(
    rng: np.random.Generator, robot: sm.RobotModel
) -> tuple[list[sm.Follow], sm.Follows, Array]:
    """Return what tips of a cell follow where that leaves self-motion, and a start on it.

    The left one a line in the world, or one in the frame of the right one; or both, the right one
    in the frame of the left.
    """
    for _ in range(50):
        start = np.array(rng.uniform(0.6 * robot.lower, 0.6 * robot.upper))
        tasks = [str(rng.choice(TASKS)) for _ in range(2)]
        reference = RIGHT if rng.random() < 0.5 else None
        both = rng.random() < 0.5
        items = [_follow(rng, robot, start, LEFT, None if both else reference, tasks[0])]
        if both:
            items.append(_follow(rng, robot, start, RIGHT, LEFT, tasks[1]))
        follows = sm.Follows(robot, tuple(item.on(robot, 2.0) for item in items))
        jacobian = follows.jacobian(start)
        smallest = np.linalg.svd(jacobian, compute_uv=False)[-1]
        if follows.dimension < robot.dof and smallest > 0.05:
            return items, follows, start
    return random_follows(rng, robot)


def _follow(
    rng: np.random.Generator,
    robot: sm.RobotModel,
    start: Array,
    tool: str,
    reference: str | None,
    task: str,
) -> sm.Follow:
    first = robot.chain_to(tool, reference).place(start)
    turn = pin.exp3(0.1 * rng.normal(size=3))
    last = pin.SE3(first.rotation @ turn, first.translation + 0.05 * rng.normal(size=3))
    path = sm.paths.Line(first, last, 2.0, time_law="minimum_jerk")
    return sm.Follow(path, task, tool=tool, reference=reference)
