"""Bodies that take long, or whose files look like other units, are told before planning."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

import selfmotion as sm
from selfmotion.problem.problem import remarks
from support.arms import PANDA_HOME, robot_named
from support.files_of_people import arm


def test_a_mesh_of_very_many_triangles_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(remarks, "_MANY_TRIANGLES", 300)
    ball, box = tmp_path / "ball.stl", tmp_path / "box.stl"
    trimesh.creation.icosphere(subdivisions=2, radius=0.05).export(ball)
    trimesh.creation.box((0.1, 0.1, 0.1)).export(box)
    panda = robot_named("panda")
    circle = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.05, 3.0)

    def told(file: Path) -> list[str]:
        part = sm.obstacles.Mesh("part", [0.8, 0.5, 0.3], file)
        clearance = sm.constraints.Clearance([part], 0.005)
        problem = sm.Problem(panda, circle, "position", PANDA_HOME, clearance=clearance)
        return [remark for remark in problem.remarks if "triangles" in remark]

    assert not told(box)
    (remark,) = told(ball)
    assert "'part' has 320 triangles" in remark
    assert "export it with 300 or fewer" in remark


def test_a_link_far_larger_than_its_arm_is_told(tmp_path: Path) -> None:
    body = '<collision><geometry><box size="{0} 0.02 0.02"/></geometry></collision>'
    for size, is_told in (("0.1", False), ("40", True)):
        (tmp_path / "arm.urdf").write_text(arm(in_fourth=body.format(size)))
        robot = sm.load_robot(tmp_path / "arm.urdf")
        start = np.array([0.1, 0.6, 0.2, -0.9, 0.3, 0.7, 0.1])
        circle = sm.paths.Circle.around(robot.pose(start), 0.02, 2.0)
        found = sm.Problem(robot, circle, "position", start).remarks
        assert any("link 'l4' has a body 40 m long" in remark for remark in found) == is_told
