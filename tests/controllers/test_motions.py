"""Motions out: each format is read by the definition that its users go by."""

import ast
import csv
import dataclasses
import json
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest
import yaml

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.shop.controllers import ros
from selfmotion.shop.controllers.samples import MotionSamples
from support.arms import robot_named
from support.shell import complaint, invoke

# A setpoint's time is a whole nanosecond.
NANO = 1e-9
# A motion put together from its parts, and as a whole [rad, rad/s, rad/s²].
ROUNDING = 1e-12


# MuJoCo's frames from the same URDF [m]; it keeps the text's own digits.
PLACE = 1e-6


@pytest.fixture(scope="module")
def ur_plan() -> sm.Plan:
    ur5 = robot_named("ur5")
    start = ur5.dexterous_configuration("pointing")
    return sm.plan(
        sm.Problem(ur5, sm.paths.Circle.around(ur5.pose(start), 0.05, 1.01), "pointing", start)
    )


@pytest.fixture
def saved(plan: sm.Plan, tmp_path: Path) -> Path:
    plan.save(tmp_path / "plan.npz")
    return tmp_path / "plan.npz"


def load(text: str) -> Any:
    """Return what YAML says; libyaml is ten times as fast as its Python twin."""
    return yaml.load(text, Loader=yaml.CSafeLoader)


Table = tuple[list[str], Array, Array, Array, Array]


def read_csv(file: Path) -> Table:
    rows = list(csv.reader(file.read_text().splitlines()))
    names = [name for name in rows[0][1:] if not name.endswith(("_velocity", "_acceleration"))]
    table = {name: [float(row[k]) for row in rows[1:]] for k, name in enumerate(rows[0])}
    parts = (
        np.array([table[name + suffix] for name in names]).T
        for suffix in ("", "_velocity", "_acceleration")
    )
    return names, np.array(table["t"]), *parts  # type: ignore[return-value]


def read_arrays(file: Path) -> Table:
    found = json.loads(file.read_text()) if file.suffix == ".json" else np.load(file)
    values = (np.array(found[name]) for name in ("t", "q", "qd", "qdd"))
    return list(map(str, found["joint_names"])), *values  # type: ignore[return-value]


def read_joint_trajectory(message: object) -> Table:
    """By trajectory_msgs/msg/JointTrajectory and JointTrajectoryPoint, every field of them."""
    assert isinstance(message, dict)
    assert set(message) == {"header", "joint_names", "points"}
    assert message["header"] == {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    points = message["points"]
    fields = {"positions", "velocities", "accelerations", "effort", "time_from_start"}
    assert all(set(point) == fields for point in points)
    since = [point["time_from_start"] for point in points]
    assert all(type(s["sec"]) is int and 0 <= s["nanosec"] < 10**9 for s in since)
    t = np.array([s["sec"] + 1e-9 * s["nanosec"] for s in since])
    parts = (np.array([p[k] for p in points]) for k in ("positions", "velocities", "accelerations"))
    return message["joint_names"], t, *parts  # type: ignore[return-value]


def read_ros(file: Path) -> Table:
    return read_joint_trajectory(load(file.read_text()))


def read_moveit(file: Path) -> Table:
    """By moveit_msgs/msg/RobotTrajectory."""
    message = load(file.read_text())
    assert set(message) == {"joint_trajectory", "multi_dof_joint_trajectory"}
    assert message["multi_dof_joint_trajectory"]["points"] == []
    return read_joint_trajectory(message["joint_trajectory"])


READERS = {
    "csv": (".csv", read_csv),
    "npz": (".npz", read_arrays),
    "json": (".json", read_arrays),
    "ros": (".yaml", read_ros),
    "moveit": (".yaml", read_moveit),
}


@pytest.mark.parametrize("rate", [None, 77.0])
@pytest.mark.parametrize("form", READERS)
def test_what_is_written_is_the_motion(
    plan: sm.Plan, tmp_path: Path, form: str, rate: float | None
) -> None:
    suffix, read = READERS[form]
    file = tmp_path / f"motion{suffix}"
    sm.files.write_motion(plan, file, rate=rate, format=form)
    names, t, q, qd, qdd = read(file)
    assert tuple(names) == plan.trajectory.joint_names
    assert t[0] == 0.0
    assert t[-1] == pytest.approx(3.0, abs=NANO)
    if rate is not None:
        np.testing.assert_allclose(t[:-1], np.arange(len(t) - 1) / rate, atol=NANO)
        assert len(t) == int(3 * rate) + 1
    # The samples of the motion are where its acceleration jumps; elsewhere all orders agree.
    inside = np.abs(t[:, None] - plan.trajectory.t).min(axis=1) > 2 * NANO
    for order, values in enumerate((q, qd, qdd)):
        rows = inside if order == 2 else slice(None)
        np.testing.assert_allclose(
            values[rows], plan.trajectory(np.minimum(t, 3.0)[rows], order), atol=1e-6
        )
    # Read back, it is still the motion that was certified.
    again = sm.files.read_motion(file)
    assert plan.problem.certify(again, plan.tolerance).verified
    np.testing.assert_array_equal(again.q, q)


@pytest.mark.parametrize("form", ["ros", "moveit"])
def test_messages_are_yaml_as_others_read_it(plan: sm.Plan, form: str) -> None:
    """Small numbers, too, which Python writes without a point, and names that are no text."""
    samples = MotionSamples.of(plan.trajectory, 50.0)
    q = samples.q.copy()
    q[1], q[2] = 1e-5, -3e-300
    q[3] = np.pi * 1e20
    names = ("on", "1e5", 'a "b": c', *samples.joint_names[3:])
    samples = replace(samples, q=q, joint_names=names)
    text, message = {
        "ros": (ros.trajectory_yaml(samples), ros.joint_trajectory(samples)),
        "moveit": (ros.robot_yaml(samples), ros.robot_trajectory(samples)),
    }[form]
    assert yaml.safe_load(text) == message
    # What a plain list of Python says is text for others.
    assert yaml.safe_load("[1e-05]") == ["1e-05"]


def test_a_broken_file_is_no_longer_verified(plan: sm.Plan, tmp_path: Path) -> None:
    file = tmp_path / "motion.yaml"
    sm.files.write_motion(plan, file)
    message = load(file.read_text())
    message["points"][20]["positions"][2] += 1e-3
    file.write_text(yaml.dump(message))
    assert not plan.problem.certify(sm.files.read_motion(file), plan.tolerance).verified
    for change, said in (
        (lambda m: m["points"][3].pop("velocities"), r"points\[3\]: velocities are given for some"),
        (
            lambda m: m["points"][3].pop("accelerations"),
            r"points\[3\]: accelerations are given for some",
        ),
        (lambda m: m["points"][3]["accelerations"].pop(), r"points\[3\]: .* and 6 accelerations"),
        (lambda m: m["points"][3]["positions"].pop(), r"points\[3\]: 6 positions"),
        (
            lambda m: m.update(multi_dof_joint_trajectory={"points": [{"transforms": []}]}),
            "moves joints of several coordinates as well",
        ),
        (lambda m: m.pop("joint_names"), "has no joint_names and points"),
    ):
        broken = load(yaml.dump(message))
        change(broken)
        file.write_text(yaml.dump(broken))
        with pytest.raises(sm.errors.FileFormatError, match=said):
            sm.files.read_motion(file)


@pytest.mark.parametrize("suffix", ["json", "npz"])
def test_a_table_that_says_what_is_not_read_is_refused(suffix: str, tmp_path: Path) -> None:
    """An acceleration that is called otherwise would be one that is not there."""
    table = {"t": [0, 1], "q": [[0], [1]], "qd": [[0], [0]], "joint_names": ["a"]}
    table["qddd"] = [[1], [1]]
    file = tmp_path / f"a.{suffix}"
    if suffix == "json":
        file.write_text(json.dumps(table))
    else:
        np.savez(file, **table)
    with pytest.raises(sm.errors.FileFormatError, match="'qddd' is not read; nearest: 'qdd'"):
        sm.files.read_motion(file)


def test_a_motion_that_begins_or_ends_moving_is_written_nowhere_unforced(tmp_path: Path) -> None:
    robot = robot_named("panda")
    q = robot.dexterous_configuration()
    first = robot.pose(q)
    goal = pin.SE3(first.rotation, first.translation + np.array([0.0, 0.05, 0.0]))
    moving = sm.paths.Line(first, goal, 2.0, time_law="constant")
    problem = sm.Problem(robot, moving, "position", q)
    plan = sm.plan(problem, max_evaluations=2)
    assert plan.certificate.verified, plan.certificate.verdict
    plan.save(tmp_path / "plan.npz")
    for name in ("a.yaml", "a.csv", "a.json", "a.npz", "a.xml", "a.src", "a.script"):
        with pytest.raises(
            sm.errors.PlanError, match=r"joint '\w+' begins at .* rad/s at t = 0 s.*path.ramp=0.5"
        ):
            sm.files.write_motion(plan, tmp_path / name)
        assert not (tmp_path / name).exists()
        code, text = invoke("export", tmp_path / "plan.npz", "--out", tmp_path / name)
        assert code == 1
        assert text.startswith("nothing is written: joint '")
    sm.files.write_motion(plan, tmp_path / "a.yaml", force=True)
    # Not where the problem asks for it, nor at rest.
    ends = [
        sm.constraints.StartVelocity(plan.trajectory.qd[0]),
        sm.constraints.EndVelocity(plan.trajectory.qd[-1]),
    ]
    for asked in ({"rest": False}, {"constraints": ends}):
        other = replace(plan, problem=replace(problem, **asked))
        sm.files.write_motion(replace(other, certificate=other.check()), tmp_path / "b.yaml")
    resting = sm.plan(replace(problem, path=sm.paths.section_at_rest(moving)), max_evaluations=2)
    sm.files.write_motion(resting, tmp_path / "c.yaml")
    for point in (load((tmp_path / "c.yaml").read_text())["points"][k] for k in (0, -1)):
        assert set(point["velocities"]) == {0.0}


def simulated(robot: sm.RobotModel, keys: Path) -> mujoco.MjModel:
    """Return MuJoCo's own model of the URDF, bodies without shapes, with the keyframes in it."""
    root = ElementTree.fromstring(robot.urdf.text)
    for link in root.findall("link"):
        for part in (*link.findall("visual"), *link.findall("collision")):
            link.remove(part)
    extension = ElementTree.SubElement(root, "mujoco")
    ElementTree.SubElement(
        extension, "compiler", fusestatic="false", boundmass="1e-3", boundinertia="1e-6"
    )
    spec = mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))
    spec.compile()
    # As a user has it: by include. That file has six digits, though; so the keys go over as well.
    included = keys.with_name("model.xml")
    include = f'<include file="{keys.name}"/></mujoco>'
    included.write_text(spec.to_xml().replace("</mujoco>", include))
    for key in mujoco.MjSpec.from_file(str(keys)).keys:
        spec.add_key(name=key.name, time=key.time, qpos=key.qpos, qvel=key.qvel)
    model = spec.compile()
    loaded = mujoco.MjModel.from_xml_path(str(included))
    np.testing.assert_array_equal(loaded.key_qpos, model.key_qpos)
    return model


@pytest.mark.parametrize("name", ["panda", "planar_3r"])
def test_mujoco_puts_the_tool_where_the_plan_says(plan: sm.Plan, tmp_path: Path, name: str) -> None:
    shown = plan if name == "panda" else sm.plan(sm.sample_problem())
    sm.files.write_motion(shown, tmp_path / "keys.xml", rate=20)
    model = simulated(shown.robot, tmp_path / "keys.xml")
    count = int(shown.trajectory.duration * 20) + 1
    assert model.nkey == count
    data = mujoco.MjData(model)
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, shown.robot.tool)
    assert body > 0
    for key in range(count):
        mujoco.mj_resetDataKeyframe(model, data, key)
        mujoco.mj_forward(model, data)
        pose = shown.path.pose(min(data.time, shown.path.duration))
        rows = 2 if name == "planar_3r" else 3
        np.testing.assert_allclose(data.xpos[body][:rows], pose.translation[:rows], atol=PLACE)
        if name == "panda":
            np.testing.assert_allclose(data.xmat[body].reshape(3, 3), pose.rotation, atol=PLACE)
        speeds = shown.trajectory(min(data.time, shown.trajectory.t[-1]), 1)
        joints = [model.joint(joint).dofadr[0] for joint in shown.robot.joint_names]
        np.testing.assert_allclose(data.qvel[joints], speeds, atol=1e-9)


def test_urscript_streams_the_motion(ur_plan: sm.Plan, tmp_path: Path) -> None:
    file = tmp_path / "motion.script"
    sm.files.write_motion(ur_plan, file, rate=200)
    lines = file.read_text().splitlines()
    head = " ".join(line for line in lines if line.startswith("#"))
    assert "200 Hz" in head
    assert "lookahead_time = 0.1 s" in head
    body = [line for line in lines if not line.startswith("#")]
    assert (body[0], body[-1]) == ("def selfmotion():", "end")
    calls = [re.fullmatch(r"  servoj\((\[.*?\]), t=(\S+), lookahead_time=0.1, gain=300\)", line)
             for line in body[3:-2]]  # fmt: skip
    q = np.array([ast.literal_eval(call[1]) for call in calls if call is not None])
    assert len(q) == len(calls) == 203
    assert {float(call[2]) for call in calls if call is not None} == {0.005}
    times = np.minimum(np.arange(203) / 200, 1.01)
    np.testing.assert_allclose(q, ur_plan.trajectory(times), atol=1e-6)
    assert body[1].startswith("  set_tcp(p[")
    assert body[2] == f"  movej([{', '.join(map(repr, q[0].tolist()))}], a=0.14, v=0.314)"
    assert body[-2] == "  stopj(2.0)"


def test_what_a_format_cannot_say_is_refused(plan: sm.Plan, tmp_path: Path) -> None:
    with pytest.raises(sm.errors.ProblemError, match="URScript is for arms of 6 revolute joints"):
        sm.files.write_motion(plan, tmp_path / "motion.script")
    with pytest.raises(
        sm.errors.FileFormatError, match=r"suffix '\.txt' is no format of motions: csv"
    ):
        sm.files.write_motion(plan, tmp_path / "motion.txt")
    with pytest.raises(sm.errors.FileFormatError, match="format 'vtk' is no format"):
        sm.files.write_motion(plan, tmp_path / "motion.txt", format="vtk")
    for rate in (0.0, -1.0, np.nan, 0.1):
        with pytest.raises(sm.errors.ProblemError, match="rate is"):
            sm.files.write_motion(plan, tmp_path / "motion.csv", rate=rate)
    assert list(tmp_path.iterdir()) == []


def test_export_writes_and_checks(saved: Path, tmp_path: Path) -> None:
    files = [tmp_path / name for name in ("a.csv", "a.npz", "a.json", "a.yaml", "a.xml")]
    asked = [part for file in files for part in ("--out", file)]
    code, text = invoke("export", saved, *asked, "--rate", "250")
    assert code == 0
    assert text.count("read back: verified at all times") == 4
    assert all(file.is_file() for file in files)
    code, text = invoke("export", saved, "--out", tmp_path / "b.yaml", "--format", "moveit")
    assert code == 0
    assert "joint_trajectory" in load((tmp_path / "b.yaml").read_text())
    # Four setpoints a second do not hold a micrometre, and the check says so.
    code, text = invoke("export", saved, "--out", tmp_path / "c.csv", "--rate", "4")
    assert code == 1
    assert "not verified" in text
    assert "no format of motions" in complaint("export", saved, "--out", tmp_path / "a.txt")


def test_plans_side_by_side(saved: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.npz"
    sm.plan(sm.sample_problem()).save(other)
    code, text = invoke("compare", saved, other)
    assert code == 0
    for word in ("joint velocity", "inverse manipulability", "no total cost: ", "verified"):
        assert word in text
    assert "\ntotal cost" in invoke("compare", saved, saved)[1].replace("│", "").replace(" t", "t")
    code, text = invoke("compare", saved, other, "--json")
    assert list(json.loads(text)) == [str(saved), str(other)]


@pytest.mark.parametrize("rate", [None, 20.0, 100.0])
def test_what_straight_lines_between_samples_cost(plan: sm.Plan, rate: float | None) -> None:
    from selfmotion.shop.controllers import linear_deviation

    deviation = linear_deviation(plan, rate)
    samples = MotionSamples.of(plan.trajectory, rate)
    worst = 0.0
    for t in np.linspace(0.0, plan.trajectory.duration, 1501):
        line = np.array([np.interp(t, samples.t, column) for column in samples.q.T])
        there = plan.robot.pose(plan.trajectory(t)).translation
        worst = max(worst, float(np.linalg.norm(plan.robot.pose(line).translation - there)))
    assert 0.9 * worst <= deviation.position
    assert deviation.position <= 1.1 * worst
    # At the rate that is named, lines stay within the plan's tolerance, and there the same rate is
    # named again; not at half of it, and hardly at a lower one.
    assert deviation.rate is not None
    limits = (plan.tolerance.position, plan.tolerance.rotation)
    kept = linear_deviation(plan, deviation.rate)
    assert max(np.divide(kept[:2], limits)) <= 1.0
    assert kept.rate == deviation.rate
    assert max(np.divide(linear_deviation(plan, 0.95 * deviation.rate)[:2], limits)) > 1.0
    assert max(np.divide(linear_deviation(plan, 0.5 * deviation.rate)[:2], limits)) > 2.0


def test_no_rate_is_named_where_files_have_no_so_many_samples(plan: sm.Plan) -> None:
    from selfmotion.shop.controllers import linear_deviation

    judged = dataclasses.replace(plan.certificate, tolerance=sm.Tolerance(1e-17, 1e-17))
    strict = dataclasses.replace(plan, certificate=judged)
    assert linear_deviation(strict, 20.0).rate is None


def test_messages_of_ros_have_the_coarsest_rate_that_keeps_the_tolerance(
    plan: sm.Plan, tmp_path: Path
) -> None:
    """Where that is fewer samples than the plan's own; and lower rates do not keep it."""
    from selfmotion.shop.controllers import coarsest_rate, linear_deviation

    assert coarsest_rate(plan) is None
    sm.files.write_motion(plan, tmp_path / "all.yaml")
    assert len(sm.files.read_motion(tmp_path / "all.yaml").t) == len(plan.trajectory.t)
    within = sm.Tolerance(1e-2, 1e-1)
    loose = sm.plan(plan.problem, tolerance=within).require()
    rate = coarsest_rate(loose)
    assert rate is not None
    for asked in (rate, 0.7 * rate):
        deviation = linear_deviation(loose, asked)
        taken = max(deviation.position / within.position, deviation.rotation / within.rotation)
        assert (taken <= 1.0) == (asked == rate)
    sm.files.write_motion(loose, tmp_path / "few.yaml")
    few = sm.files.read_motion(tmp_path / "few.yaml")
    assert len(few.t) == pytest.approx(rate * plan.trajectory.duration, abs=1.5)
    assert len(few.t) < len(loose.trajectory.t)
    assert plan.problem.certify(few, within).verified
    # Of other files nothing changes.
    sm.files.write_motion(loose, tmp_path / "all.csv")
    assert len(sm.files.read_motion(tmp_path / "all.csv").t) == len(loose.trajectory.t)
    loose.save(tmp_path / "loose.npz")
    code, text = invoke("export", tmp_path / "loose.npz", "--out", tmp_path / "again.yaml")
    assert code == 0, text
    assert f"at {rate:g} Hz: the coarsest rate" in text
    assert (tmp_path / "again.yaml").read_text() == (tmp_path / "few.yaml").read_text()


@pytest.fixture(scope="module")
def carried() -> sm.Plan:
    """Two arms that carry a bar for a moment."""
    left, right = "left/panda_hand_tcp", "right/panda_hand_tcp"
    pair = sm.load_robot(
        {"left": "panda", "right": "panda"},
        base={
            "left": pin.SE3(np.eye(3), np.array([0.0, 0.45, 0.0])),
            "right": pin.SE3(np.eye(3), np.array([0.0, -0.45, 0.0])),
        },
        tool=(left, right),
    )
    first = pin.SE3(np.diag([1.0, -1.0, -1.0]), np.array([0.45, 0.2, 0.3]))
    grasp = pin.SE3(np.eye(3), np.array([0.0, 0.4, 0.0]))
    circle = sm.paths.Circle.around(first, radius=0.05, duration=3.0, normal=(0, 1, 0))
    follows = [sm.Follow(circle, tool=left), sm.Follow(grasp, tool=right, reference=left)]
    return sm.plan(sm.Problem(pair, follows, clearance=None)).require()


@pytest.mark.parametrize("name", ["m.csv", "m.npz", "m.json", "m.yaml"])
def test_parts_are_written_in_step(carried: sm.Plan, tmp_path: Path, name: str) -> None:
    files = sm.files.write_parts(carried, tmp_path / name, rate=200.0)
    stem, suffix = name.split(".")
    assert [file.name for file in files.values()] == [
        f"{stem}.left.{suffix}",
        f"{stem}.right.{suffix}",
    ]
    alone = robot_named("panda").joint_names
    assert all(sm.files.read_motion(file).joint_names == alone for file in files.values())
    together = sm.files.read_parts(files)
    sm.files.write_motion(carried, tmp_path / name, rate=200.0)
    whole = sm.files.read_motion(tmp_path / name)
    assert together.joint_names == whole.joint_names
    for order in (0, 1, 2):
        found, expected = together(whole.t, order), whole(whole.t, order)
        np.testing.assert_allclose(found, expected, rtol=0, atol=ROUNDING)
    found = carried.problem.certify(together, carried.tolerance)
    assert found.verified, found.verdict
    # The hand that holds on, as the other one sees it.
    assert found.others[0][0].value < carried.tolerance.position


def test_parts_out_of_step_are_found(carried: sm.Plan, tmp_path: Path) -> None:
    files = sm.files.write_parts(carried, tmp_path / "m.npz", rate=200.0)
    slower = sm.files.write_parts(carried, tmp_path / "slower.npz", rate=150.0)
    with pytest.raises(
        sm.errors.FileFormatError, match=r"m\.right\.npz: has 601 samples .* at other times"
    ):
        sm.files.read_parts({"left": slower["left"], "right": files["right"]})
    # Two motions of the same times that do not belong together: the grasp slips.
    late = sm.files.read_motion(files["right"])
    moved = sm.Trajectory(late.t, np.roll(late.q, 1, axis=0), late.qd, late.joint_names, late.qdd)
    arrays = {"t": moved.t, "q": moved.q, "qd": moved.qd, "qdd": moved.qdd}
    np.savez(files["right"], joint_names=np.array(moved.joint_names), **arrays)
    found = carried.problem.certify(sm.files.read_parts(files), carried.tolerance)
    assert not found.verified
    assert found.others[0][0].value > 100.0 * carried.tolerance.position


def test_a_robot_of_its_own_has_no_parts(plan: sm.Plan, carried: sm.Plan, tmp_path: Path) -> None:
    with pytest.raises(sm.errors.ProblemError, match="'panda_joint1' is of no part"):
        sm.files.write_parts(plan, tmp_path / "m.csv")
    with pytest.raises(sm.errors.ProblemError, match="keyframes are of all joints"):
        sm.files.write_parts(carried, tmp_path / "m.xml")
    with pytest.raises(sm.errors.ProblemError, match="of 6 revolute joints, this one has 7"):
        sm.files.write_parts(carried, tmp_path / "m.script")
    with pytest.raises(sm.errors.FileFormatError, match="no file of a part"):
        sm.files.read_parts({})


def test_export_writes_parts_and_judges_them_together(carried: sm.Plan, tmp_path: Path) -> None:
    carried.save(tmp_path / "plan.npz")
    out = tmp_path / "m.yaml"
    options = ("--rate", 200, "--parts", "--json")
    code, text = invoke("export", tmp_path / "plan.npz", "--out", out, *options)
    assert code == 0
    written = json.loads(text)["written"]
    parts = ", ".join(str(tmp_path / f"m.{part}.yaml") for part in ("left", "right"))
    assert list(written) == [str(out), parts]
    assert all(verdict.startswith("read back: verified") for verdict in written.values())


def test_programs_have_no_parts_and_other_files_beside_them_do(
    carried: sm.Plan, tmp_path: Path
) -> None:
    carried.save(tmp_path / "plan.npz")
    program, motion = tmp_path / "m.src", tmp_path / "m.yaml"
    asked = ("export", tmp_path / "plan.npz", "--parts", "--out")
    with pytest.raises(sm.errors.ProblemError, match="--parts has no effect on programs"):
        invoke(*asked, program)
    with pytest.raises(sm.errors.ProblemError, match="part 'left': URScript is for arms of 6"):
        sm.files.write_parts(carried, tmp_path / "m.script")
    assert not (tmp_path / "m.left.script").exists()
    assert invoke(*asked, motion, "--out", tmp_path / "m.csv")[0] == 0
    assert (tmp_path / "m.left.yaml").exists()
    assert (tmp_path / "m.right.csv").exists()
    # Two arms of six joints or more are no program of one controller: all the rest is there.
    if carried.robot.dof <= 12:
        assert invoke(*asked, program, "--out", motion)[0] == 0
        assert program.exists()
        assert not (tmp_path / "m.left.src").exists()


def test_straight_lines_are_judged_at_every_hand(carried: sm.Plan) -> None:
    """The hand that only holds on is off as well, and may be the one that is off most."""
    from selfmotion.shop.controllers import linear_deviation

    samples = MotionSamples.of(carried.trajectory, 10.0)
    middles = 0.5 * (samples.t[1:] + samples.t[:-1])
    lines = 0.5 * (samples.q[1:] + samples.q[:-1])
    worst = [
        max(
            np.linalg.norm(chain.place(line).translation - chain.place(exact).translation)
            for line, exact in zip(lines, carried.trajectory(middles), strict=True)
        )
        for chain in (item.chain for item in carried.problem.follows.items)
    ]
    rounding = 1e-12
    assert linear_deviation(carried, 10.0).position >= max(worst) - rounding
