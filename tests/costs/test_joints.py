"""What a metre of a rail counts against a radian: by default as limits of speed say, and told."""

from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.problem.costs import metres_of
from support.industrial import industrial_urdf
from support.shell import invoke

# The rail's limit of speed [m/s]; all joints of the arm have that of the URDF [rad/s].
SLOW, JOINTS = 0.5, 4.0


@pytest.fixture(scope="module")
def on_rail(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The URDF of an arm on a rail that is slower than its joints."""
    file = tmp_path_factory.mktemp("rail") / "arm.urdf"
    urdf = industrial_urdf("kuka", rail=True)
    file.write_text(urdf.replace(f'velocity="{JOINTS:g}"', f'velocity="{SLOW:g}"', 1))
    return file


def test_a_metre_counts_what_joints_turn_in_its_time(on_rail: Path) -> None:
    robot = sm.load_robot(on_rail, tool="torch")
    usual = sm.costs.JointVelocity.usual(robot)
    expected = JOINTS / SLOW
    np.testing.assert_allclose(usual.weight, [expected**2, *[1.0] * 6])
    assert metres_of([usual], robot) == pytest.approx({"rail": expected})
    # What is given is what counts; weights of an arm of one kind say nothing of metres.
    assert metres_of([sm.costs.JointVelocity()], robot) == {"rail": 1.0}
    heavy = sm.costs.JointAcceleration([36.0, *[4.0] * 6])
    assert metres_of([sm.costs.InverseManipulability(), heavy], robot) == {"rail": 3.0}
    assert metres_of([usual], sm.load_robot("ur5")) == {}
    # A rail whose limit is not known counts by the arm's lever.
    text = on_rail.read_text().replace(f'velocity="{SLOW:g}"', 'velocity="0"')
    unknown = on_rail.with_name("unknown.urdf")
    unknown.write_text(text)
    other = sm.load_robot(unknown, tool="torch")
    np.testing.assert_allclose(other.speed_weights, other.joint_weights)
    # A crawling one counts ten times at most.
    unknown.write_text(on_rail.read_text().replace(f'velocity="{SLOW:g}"', 'velocity="0.001"'))
    crawling = sm.load_robot(unknown, tool="torch")
    np.testing.assert_array_equal(crawling.speed_weights, [10.0, *[1.0] * 6])


def test_files_without_a_weight_have_it_and_the_shell_tells(on_rail: Path, tmp_path: Path) -> None:
    cell = tmp_path / "cell.toml"
    start = np.append(0.3, np.radians([10.0, -80.0, 100.0, 20.0, 60.0, 15.0])).round(4).tolist()
    text = f"""
    task = "pose"
    start = {start}
    collision = false
    [robot]
    file = "{on_rail}"
    tool = "torch"
    [path]
    kind = "line"
    by = [0.02, 0.1, 0.0]
    duration = 2
    [[costs]]
    kind = "JointVelocity"
    """
    cell.write_text(text)
    (cost,) = sm.files.read_job(cell).problem.costs
    np.testing.assert_allclose(cost.weight, [(JOINTS / SLOW) ** 2, *[1.0] * 6])
    code, said = invoke("plan", cell, "--out", tmp_path / "plan.npz")
    assert code == 0, said
    assert "the cost counts 1 m of 'rail' as 8 rad" in said
    assert "weight = [64, 1, 1, 1, 1, 1, 1] (squares, joint by joint)" in said
    assert sm.load_plan(tmp_path / "plan.npz").metres == pytest.approx({"rail": 8.0})
    cell.write_text(text + "weight = [4, 1, 1, 1, 1, 1, 1]\n")
    (cost,) = sm.files.read_job(cell).problem.costs
    np.testing.assert_allclose(cost.weight, [4.0, *[1.0] * 6])
    # What it is called says nothing of its weight.
    cell.write_text(text + 'name = "speed"\n')
    (cost,) = sm.files.read_job(cell).problem.costs
    assert cost.name == "speed"
    np.testing.assert_allclose(cost.weight, [(JOINTS / SLOW) ** 2, *[1.0] * 6])
