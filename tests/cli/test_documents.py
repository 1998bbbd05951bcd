"""Motions that something else made, and plans that somebody changed: judged as they are."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import selfmotion as sm
from selfmotion.basics import write_csv
from selfmotion.shell.cli import app, main as command
from support.arms import PANDA_HOME
from support.shell import complaint, on_circle


@pytest.fixture(scope="module")
def plan() -> sm.Plan:
    panda = sm.load_robot("panda")
    circle = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.1, 4.0, normal=(1.0, 0.0, 0.0))
    t = np.linspace(0.0, 4.0, 41)
    seam = sm.paths.Waypoints.from_poses(t, [circle.pose(float(time)) for time in t])
    return sm.plan(sm.Problem(panda, seam, start=PANDA_HOME))


@pytest.fixture
def seam(plan: sm.Plan, tmp_path: Path) -> Path:
    """The tool's path as a file."""
    description = plan.path.to_dict()
    table = np.column_stack(
        [description["t"], description["positions"], description["quaternions"]]
    )
    write_csv(tmp_path / "seam.csv", ["t", "x", "y", "z", "qw", "qx", "qy", "qz"], table)
    return tmp_path / "seam.csv"


def invoke(*arguments: str | Path) -> tuple[int, str]:
    result = CliRunner().invoke(app, ["check", *map(str, arguments)])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.stdout


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("degrees", [False, True])
def test_a_motion_from_a_table(
    plan: sm.Plan, seam: Path, tmp_path: Path, order: int, degrees: bool
) -> None:
    """Joints in any order, degrees by flag, with velocities and accelerations."""
    motion, scale = plan.trajectory, 180.0 / np.pi if degrees else 1.0
    names, kinds = motion.joint_names[::order], ("", "_velocity", "_acceleration")
    tables = [scale * motion(motion.t, k)[:, ::order] for k in range(3)]
    table = np.column_stack([motion.t, *tables])
    header = ["t", *(name + kind for kind in kinds for name in names)]
    write_csv(tmp_path / "motion.csv", header, table)
    asked = [tmp_path / "motion.csv", "--robot", "panda", "--path", seam]
    code, text = invoke(*asked, *(["--degrees"] if degrees else []), "--json")
    found = json.loads(text)
    assert code == 0, found["verdict"]
    assert found["verified"]
    assert found["position_error"]["value"] == pytest.approx(
        plan.certificate.position_error.value, rel=1e-3
    )
    if degrees:
        assert invoke(*asked)[0] == 1


def test_a_motion_without_velocities_takes_those_of_a_spline(
    plan: sm.Plan, seam: Path, tmp_path: Path
) -> None:
    motion, t = plan.trajectory, np.linspace(0.0, 4.0, 801)
    write_csv(tmp_path / "motion.csv", ["t", *motion.joint_names], np.column_stack([t, motion(t)]))
    loose = ["--tolerance", "1e-5"]
    code, _ = invoke(tmp_path / "motion.csv", "--robot", "panda", "--path", seam, *loose)
    assert code == 0


def test_jumps_of_acceleration_pass_every_limit_of_jerk(plan: sm.Plan) -> None:
    motion, loose = plan.trajectory.sample(200.0), sm.Tolerance(1e-5, 1e-5)
    cubic = sm.Trajectory(motion.t, motion.q, motion.qd, motion.joint_names)
    # So close together that its jumps are nothing that a controller sees.
    assert plan.problem.certify(cubic, loose).verified
    qd = motion.qd.copy()
    qd[100] += 1e-4
    cubic = sm.Trajectory(motion.t, motion.q, qd, motion.joint_names)
    assert cubic.extremes(3)[1].max() < 0.1 * plan.robot.jerk_limit.min()
    certificate = plan.problem.certify(cubic, loose)
    assert not certificate.verified
    assert "which no limited jerk does" in certificate.verdict


def test_limits_and_obstacles_of_a_motion(plan: sm.Plan, seam: Path, tmp_path: Path) -> None:
    sm.files.write_motion(plan, tmp_path / "motion.csv", force=True)
    asked = [tmp_path / "motion.csv", "--robot", "panda", "--path", seam]
    code, text = invoke(*asked, "--set", "constraints.JointAccelerationLimits.limit=0.1")
    assert (code, "accelerates at" in text) == (1, True)
    each = "constraints.JointVelocityLimits.limit=[0.05, 9, 9, 9, 9, 9, 9]"
    code, text = invoke(*asked, "--set", each)
    assert (code, "joint 'panda_joint1' moves at" in text.replace("\n", " ")) == (1, True)
    hand = plan.robot.pose(plan.trajectory(2.0)).translation
    box = sm.obstacles.Box("box", hand, [0.02, 0.02, 0.02])
    (tmp_path / "world.json").write_text(json.dumps([box.to_dict()]))
    code, text = invoke(*asked, "--set", f"clearance.obstacles=@{tmp_path / 'world.json'}")
    assert (code, "box overlap by" in text) == (1, True)
    code, text = invoke(*asked, "--set", "clearance.distance=0.001", "-v")
    assert (code, "self-collision" in text) == (0, True)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("t,panda_joint1\n0,1\n1,2\n", "joint 'panda_joint2' is missing"),
        ("t;a;a\n0;1;1\n", "column 'a' appears twice"),
        ("time,panda_joint1\n0,1\n", "expected t and a column per joint"),
        ("t,a,a_velocity,b\n0,1,1,1\n1,1,1,1\n", "velocities are given for all joints or for none"),
        ("t,a\n0,1\n0,2\n", "does not come after"),
        ("t,a\n0,1\n1,nan\n", "is not finite"),
        ("t,a\n0,1\n1,x\n", "line 3: a: is 'x', expected a number"),
        ("t,a\n0,1\n1,\n", "line 3: a: is empty, expected a number"),
        ("t,a\n0,1\n1,1_0\n", "line 3: a: is '1_0'"),
        ("", "is empty"),
    ],
)
def test_bad_motions_are_named(seam: Path, tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "motion.csv"
    file.write_text("\ufeff" + text, encoding="utf-8")
    with pytest.raises(sm.SelfmotionError, match=message):
        invoke(file, "--robot", "panda", "--path", seam)


def test_a_fault_of_the_program_is_no_verdict(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 3, not 1, which would mean that a motion was judged."""
    monkeypatch.setattr("sys.argv", ["selfmotion", "check", "any.npz"])
    monkeypatch.setattr(sm, "load_plan", lambda file: 1 / 0)
    with pytest.raises(SystemExit) as ended:
        command()
    assert ended.value.code == 3
    assert "fault of the program" in capsys.readouterr().err


def test_a_changed_file_is_never_verified(plan: sm.Plan, tmp_path: Path) -> None:
    """Joints, tolerance or requirements: a digest tells, and the motion is measured anew."""
    file = tmp_path / "plan.npz"
    plan.save(file)
    assert sm.load_plan(file).require().certificate == plan.certificate
    with np.load(file) as stored:
        contents = {name: stored[name] for name in stored.files}
    text = contents["description"].tobytes().decode()
    moved = {**contents, "q": contents["q"] + 0.1}
    looser = text.replace('"position": 1e-06', '"position": 1.0')
    assert looser != text
    cases = {
        "moved": moved,
        "looser": {**contents, "description": np.frombuffer(looser.encode(), np.uint8)},
    }
    for name, changed in cases.items():
        np.savez_compressed(tmp_path / f"{name}.npz", **changed)
        again = sm.load_plan(tmp_path / f"{name}.npz")
        with pytest.raises(sm.errors.PlanError, match="was changed after the plan was written"):
            again.require()
        assert not again.check().verified
        result = CliRunner().invoke(app, ["check", str(tmp_path / f"{name}.npz")])
        assert result.exit_code == 1
    assert sm.load_plan(tmp_path / "moved.npz").certificate.position_error.value > 1e-3


def test_a_robot_file_that_changed_is_said(tmp_path: Path) -> None:
    file = tmp_path / "arm.urdf"
    text = Path(sm.load_robot("planar_3r").urdf.source).read_text()
    file.write_text(text)
    arm = sm.load_robot(file, tool="tool")
    start = np.array([0.0, 1.0, 1.0])
    line = sm.paths.Line(arm.pose(start), arm.pose(start + 0.1), 1.0)
    sm.plan(sm.Problem(arm, line, "planar", start)).save(tmp_path / "plan.npz")
    assert not sm.load_plan(tmp_path / "plan.npz").certificate.notes
    file.write_text(text.replace('xyz="2 0 0"', 'xyz="2.5 0 0"', 1))
    changed = sm.load_plan(tmp_path / "plan.npz")
    assert file.read_text() != text
    assert "has changed since the plan was made" in changed.certificate.verdict
    assert changed.certificate.verified


def test_keys_of_what_a_file_says_are_named_where_they_are_wrong(tmp_path: Path) -> None:
    file = tmp_path / "boxes.json"
    good = {"shape": "box", "name": "a", "size": [0.1] * 3, "position": [2.0, 0.0, 0.0]}
    file.write_text(json.dumps([good, good | {"name": "b", "id": 3}]))
    asked = ("plan", "panda", *on_circle("0.1"))
    said = complaint(*asked, "--set", f"clearance.obstacles=@{file}")
    assert "clearance.obstacles[1].id: unknown key" in said
    said = complaint(*asked, "--start", "0,0,0")
    assert "configuration has shape (3,), expected (7,)" in said
