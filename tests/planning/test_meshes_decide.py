"""Bodies that hulls forbid and meshes do not: such a motion is proved before others are sought."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

import selfmotion as sm
from support.arms import PANDA_HOME

CLEARANCE = 1e-3


def fork(folder: Path, gap: float) -> sm.obstacles.Mesh:
    """Return a fork ahead of the flange, two prongs with a gap [m], in one mesh."""
    prongs = [
        trimesh.creation.box([0.01, 0.01, 0.06], trimesh.transformations.translation_matrix(at))
        for at in ([0.5 * gap + 0.005, 0.0, 0.25], [-0.5 * gap - 0.005, 0.0, 0.25])
    ]
    bridge = trimesh.creation.box(
        [gap + 0.02, 0.01, 0.01], trimesh.transformations.translation_matrix([0.0, 0.0, 0.22])
    )
    file = folder / "fork.stl"
    trimesh.boolean.union([*prongs, bridge], engine="manifold").export(file)
    return sm.obstacles.Mesh("fork", np.eye(4), file)


@pytest.mark.parametrize(("gap", "verified"), [(0.04, True), (0.012, False)])
def test_a_rod_between_the_prongs_of_a_fork(tmp_path: Path, gap: float, verified: bool) -> None:
    """The hull of the fork is full; of a rod of 10 mm within 12 mm not enough is free."""
    offset = np.eye(4)
    offset[2, 3] = 0.27
    panda = sm.load_robot("panda", "panda_hand", tool_offset=offset, bodies=[fork(tmp_path, gap)])
    home = panda.pose(PANDA_HOME)
    end = home.copy()
    end.translation = home.translation + home.rotation @ np.array([0.0, 0.05, 0.0])
    line = sm.paths.Line(home, end, 2.0)
    # Along the way, so that it stays in the middle of the gap.
    along = np.eye(4)
    along[:3, :3] = home.rotation @ np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
    along[:3, 3] = home.translation
    rod = sm.obstacles.Cylinder("rod", along, 0.005, 0.3)
    limits, apart = [sm.constraints.JointPositionLimits()], 1.5 * CLEARANCE
    clearance = sm.constraints.Clearance([rod], apart)
    plan = sm.plan(
        sm.Problem(panda, line, "pose", PANDA_HOME, constraints=limits, clearance=clearance)
    )
    names = [item.name for item in plan.report.attempts]
    assert plan.certificate.verified == verified
    assert ("proof on meshes" in names) == verified
    if verified:
        assert names[-1] == "proof on meshes"
        assert "violated by the optimiser's bounds, kept by the motion" in plan.report.message


def test_a_rod_beside_a_prong_is_left_room_by_a_tolerance(tmp_path: Path) -> None:
    """What hulls forbid all along, and meshes at first, is found with the fork in pieces."""
    offset = np.eye(4)
    offset[2, 3] = 0.27
    panda = sm.load_robot("panda", "panda_hand", tool_offset=offset, bodies=[fork(tmp_path, 0.04)])
    home = panda.pose(PANDA_HOME)
    end = home.copy()
    end.translation = home.translation + home.rotation @ np.array([0.0, 0.05, 0.0])
    along = np.eye(4)
    along[:3, :3] = home.rotation @ np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
    # From the middle of the way on; 1 mm is left between them where the tool is on its path.
    along[:3, 3] = home.translation + home.rotation @ np.array([0.014, 0.18, 0.0])
    rod = sm.obstacles.Cylinder("rod", along, 0.005, 0.3)
    limits = [sm.constraints.JointPositionLimits()]
    aside = sm.Relaxation("x", 5e-3, axes="tool")
    plan = sm.plan(
        sm.Problem(
            panda,
            sm.paths.Line(home, end, 2.0),
            "pose",
            PANDA_HOME,
            constraints=limits,
            clearance=sm.constraints.Clearance([rod], 2e-3),
            relaxations=[aside],
        )
    )
    assert plan.certificate.verified, plan.certificate.verdict
    assert "links in pieces" in [item.name for item in plan.report.attempts]
    assert np.abs(plan.deviation(2.0)[0]) >= 1e-3 - 1e-6
