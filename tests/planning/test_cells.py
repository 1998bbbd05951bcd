"""Cells: paths in frames that move, several tips at once, as planned, saved and written."""

import dataclasses
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.certificate import FinishedMotion
from selfmotion.model.collision import CollisionModel
from selfmotion.shell.facts import plan_facts
from selfmotion.shell.replay.facts import cells, describe
from support.cones import downhand
from support.own_kinematics import Arm, along
from support.random_cells import LEFT, RIGHT, random_cell, random_follows

# What a verified motion may be off its path [m, rad].
TOLERANCE = 1e-6
HANDS = "left/panda_hand_tcp", "right/panda_hand_tcp"
# Each of the starts of two arms takes long where rows are relaxed.
FEW = sm.Search(starts=6)


def stand(y: float) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array([0.0, y, 0.0]))


def bar(x: float) -> sm.Problem:
    """Two Pandas that carry a bar round a circle so far before them [m]."""
    cell = sm.load_robot(
        {"left": "panda", "right": "panda"},
        base={"left": stand(0.45), "right": stand(-0.45)},
        tool=HANDS,
    )
    first = pin.SE3(np.diag([1.0, -1.0, -1.0]), np.array([x, 0.2, 0.3]))
    circle = sm.paths.Circle.around(first, radius=0.15, duration=6.0, normal=(0, 1, 0))
    grasp = sm.Follow(stand(0.4), tool=HANDS[1], reference=HANDS[0])
    return sm.Problem(cell, [sm.Follow(circle, tool=HANDS[0]), grasp])


@pytest.fixture(scope="module")
def carried() -> sm.Plan:
    return sm.plan(bar(0.45))


def apart(plan: sm.Plan) -> tuple[np.ndarray, np.ndarray]:
    """Return where the right hand is in the left one at many times, by yourdfpy's tree."""
    arm, motion = Arm(plan.robot), plan.trajectory
    q = along(motion, np.linspace(motion.t[0], motion.t[-1], 5001), 0)
    (base, origin), (turn, at) = (arm.place(hand, q) for hand in HANDS)
    return np.einsum("kji,kj->ki", base, at - origin), np.einsum("kji,kjl->kil", base, turn)


def test_a_plan_of_two_arms_begins_another_one_near_by(carried: sm.Plan) -> None:
    """From its start put onto both paths, so that no other starts are looked for."""
    again = sm.plan(bar(0.48), warm_start=carried).require()
    assert again.report.evaluations < 0.25 * carried.report.evaluations
    place, _ = apart(again)
    assert np.abs(place - [0.0, 0.4, 0.0]).max() < TOLERANCE


def test_both_hands_hold_the_bar_at_all_times(carried: sm.Plan) -> None:
    place, turn = apart(carried.require())
    assert np.abs(place - [0.0, 0.4, 0.0]).max() < TOLERANCE
    assert np.abs(turn - np.eye(3)).max() < TOLERANCE
    assert f"'{HANDS[1]}'" in carried.certificate.verdict
    assert "self-collision" in carried.certificate.covers
    assert carried.report.cost < carried.report.initial_cost


def test_a_hand_that_lets_go_is_not_verified(carried: sm.Plan) -> None:
    """The right arm's last joint turns by a tenth of a degree, which the left path does not see."""
    motion = carried.trajectory
    q = motion.q.copy()
    q[:, -1] += 2e-3
    wrong = sm.Trajectory(motion.t, q, motion.qd, motion.joint_names, motion.qdd)
    found = carried.problem.certify(wrong)
    assert not found.verified
    assert f"'{HANDS[1]}' is 2 mrad off the path" in found.verdict
    assert found.position_error.value < TOLERANCE


def test_a_table_of_facts_has_the_rows_of_every_hand(carried: sm.Plan) -> None:
    rows = cells(plan_facts(carried))
    assert rows["task"][0] == "pose and pose"
    assert rows["task"][1].startswith("12 rows, 14 joints")
    assert f"position error of {HANDS[1]}" in rows
    assert f"rotation error of {HANDS[1]}" in rows
    assert "2 tool motions" in describe(carried)


def test_plans_of_cells_are_saved_and_their_problems_written(
    carried: sm.Plan, tmp_path: Path
) -> None:
    carried.save(tmp_path / "plan.npz")
    loaded = sm.load_plan(tmp_path / "plan.npz")
    assert loaded.certificate == carried.certificate
    sm.files.write_problem(carried.problem, tmp_path / "cell.toml")
    again = sm.read_problem(tmp_path / "cell.toml")
    assert sm.problem.problem_to_dict(again) == sm.problem.problem_to_dict(carried.problem)


@pytest.mark.parametrize("seed", range(6))
def test_what_is_verified_is_on_its_paths(seed: int, tmp_path: Path) -> None:
    """Cells made at random, against the tree as it stands."""
    rng = np.random.default_rng(1000 + seed)
    robot = sm.load_robot(random_cell(rng, tmp_path), tool=(LEFT, RIGHT))
    items, follows, start = random_follows(rng, robot)
    plan = sm.plan(sm.Problem(robot, items, start=start)).require()
    arm, motion = Arm(robot), plan.trajectory
    t = np.linspace(0.0, 2.0, 2001)
    q = along(motion, t, 0)
    for item in follows.items:
        target = item.path.samples(t)
        _, at = arm.place(item.chain.tip_name, q)
        if item.chain.base:
            base, origin = arm.place(robot.model.frames[item.chain.base].name, q)
            at = np.einsum("kji,kj->ki", base, at - origin)
        assert np.abs(at - target.translation).max() < TOLERANCE


def test_torques_are_those_of_the_tree(tmp_path: Path) -> None:
    """Whatever the reference is: gravity knows the world."""
    rng = np.random.default_rng(3)
    file = random_cell(rng, tmp_path)
    world = sm.load_robot(file, tool=(LEFT, RIGHT))
    seen = sm.load_robot(file, tool=LEFT, reference=RIGHT, lock=None)
    q, qd, qdd = rng.normal(size=(3, 5, seen.dof)) * 0.3
    columns = [world.joint_names.index(name) for name in seen.joint_names]

    def torques(robot: sm.RobotModel, parts: list[np.ndarray]) -> np.ndarray:
        return sm.constraints.JointTorqueLimits().quantity(robot).values(*parts)

    full = [np.zeros((5, world.dof)) for _ in range(3)]
    for table, part in zip(full, (q, qd, qdd), strict=True):
        table[:, columns] = part
    expected = torques(world, full)[:, columns]
    np.testing.assert_allclose(torques(seen, [q, qd, qdd]), expected, atol=1e-9)


BAD = {
    "no part 'tabel'": lambda: sm.load_robot({"arm": "panda"}, base={"tabel": np.eye(4)}),
    "stands on 'rail/x', which is no link": lambda: sm.load_robot(
        {"arm": "panda"}, on={"arm": "rail/x"}
    ),
    "a part is called 'a b'": lambda: sm.load_robot({"a b": "panda"}),
    "there is no part": lambda: sm.load_robot({}),
    "base is a dict of parts, but there is one robot": lambda: sm.load_robot(
        "panda", base={"arm": np.eye(4)}
    ),
    "no link 'plate'": lambda: sm.load_robot("panda", reference="plate"),
    "no joint moves the tool 'panda_hand_tcp' relative to 'panda_hand'": lambda: sm.load_robot(
        "panda", reference="panda_hand"
    ),
}


@pytest.mark.parametrize("message", BAD)
def test_cells_that_make_no_sense_are_refused_by_name(message: str) -> None:
    with pytest.raises(
        sm.errors.RobotError, match=message.replace("no part 'tabel'", "part 'tabel'")
    ):
        BAD[message]()


def test_follows_that_do_not_fit_are_refused(carried: sm.Plan) -> None:
    robot, path = carried.robot, carried.problem.path
    left = sm.Follow(path, tool=HANDS[0])
    longer = sm.paths.Line(path.pose(0.0), path.pose(1.0), 7.0)
    with pytest.raises(sm.errors.ProblemError, match="lasts 7 s, expected 6 s"):
        sm.Problem(robot, [left, sm.Follow(longer, tool=HANDS[1])])
    with pytest.raises(sm.errors.ProblemError, match="cannot move them freely"):
        sm.Problem(robot, [left, sm.Follow(path, tool=HANDS[0])])
    with pytest.raises(
        sm.errors.ProblemError, match="'planar_pose' is for frames that move in the x-y"
    ):
        sm.Problem(robot, [left, sm.Follow(path, "planar_pose", tool=HANDS[1])])
    with pytest.raises(sm.errors.ProblemError, match="does not tell how long the motion lasts"):
        sm.Problem(robot, [sm.Follow(stand(0.4), tool=HANDS[1]), left])
    with pytest.raises(sm.errors.ProblemError, match="also: 3, expected a Follow"):
        sm.certify(robot, path, "pose", carried.trajectory, also=[3])  # type: ignore[list-item]
    with pytest.raises(sm.errors.ProblemError, match="path is an empty list"):
        sm.Problem(robot, [])


def test_a_bar_that_may_lean_costs_less_and_is_held_as_tight(carried: sm.Plan) -> None:
    """What is relaxed is the first path; the other hand stays where it is on the bar."""
    bands = [sm.Relaxation(("rx", "ry"), 0.3), sm.Relaxation("z", 0.01)]
    problem = dataclasses.replace(carried.problem, relaxations=bands)
    relaxed = sm.plan(problem, search=FEW).require()
    assert relaxed.report.cost < 0.8 * carried.report.cost
    place, turn = apart(relaxed)
    assert np.abs(place - [0.0, 0.4, 0.0]).max() < TOLERANCE
    assert np.abs(turn - np.eye(3)).max() < TOLERANCE
    left = relaxed.robot.chain_to(HANDS[0])
    motion = relaxed.trajectory
    t = np.linspace(motion.t[0], motion.t[-1], 500)
    poses = [left.place(q) for q in motion(t)]
    wanted = relaxed.path.samples(t)
    leaning = [
        pin.log3(there.T @ pose.rotation)
        for pose, there in zip(poses, wanted.rotation, strict=True)
    ]
    off = np.array([pose.translation for pose in poses]) - wanted.translation
    assert 0.1 < np.linalg.norm(np.array(leaning)[:, :2], axis=1).max() <= 0.3 + TOLERANCE
    assert np.abs(off[:, :2]).max() < TOLERANCE
    assert np.abs(off[:, 2]).max() <= 0.01 + TOLERANCE
    # Judged without the bands it is off its path.
    strict = dataclasses.replace(relaxed.problem, relaxations=())
    assert not strict.certify(motion).verified


def test_two_arms_of_six_joints_carry_a_bar_that_may_lean() -> None:
    """Twelve joints, twelve rows: no self-motion but what is relaxed."""
    hands = "left/tool0", "right/tool0"
    pair = sm.load_robot(
        {"left": "ur5", "right": "ur5"},
        base={"left": stand(0.45), "right": stand(-0.45)},
        tool=hands,
    )
    first = pin.SE3(np.diag([1.0, -1.0, -1.0]), np.array([0.45, 0.2, 0.3]))
    circle = sm.paths.Circle.around(first, radius=0.1, duration=6.0, normal=(0, 1, 0))
    follows = [
        sm.Follow(circle, tool=hands[0]),
        sm.Follow(stand(0.4), tool=hands[1], reference=hands[0]),
    ]
    with pytest.raises(sm.errors.RedundancyError, match="relax some of the first"):
        sm.Problem(pair, follows)
    problem = sm.Problem(pair, follows, relaxations=[sm.Relaxation(("rx", "ry", "rz"), 0.4)])
    plan = sm.plan(problem, search=FEW).require()
    (position, rotation) = plan.certificate.others[0]
    assert max(position.value, rotation.value) < TOLERANCE
    # Out of reach, it goes as far as both hands do, without a null motion to refine.
    end = pin.SE3(first.rotation, first.translation + np.array([1.5, 0.0, 0.0]))
    away = sm.Follow(sm.paths.Line(first, end, 6.0), tool=hands[0])
    far = sm.plan(dataclasses.replace(problem, path=away.path, also=problem.also), search=FEW)
    assert not far.certificate.verified
    assert "out of reach" in far.certificate.verdict
    assert 1.0 < far.trajectory.duration < 6.0


def test_part_weights_are_by_part_and_by_joint(carried: sm.Plan) -> None:
    robot = carried.robot
    found = robot.part_weights({"right": 0.5, "left/panda_joint2": 3.0})
    np.testing.assert_array_equal(found, [1, 3, 1, 1, 1, 1, 1, *[0.5] * 7])
    with pytest.raises(sm.errors.RobotError, match="no part or joint 'middle'"):
        robot.part_weights({"middle": 1.0})


def test_follows_of_other_frames_than_the_arm_was_loaded_for_are_saved(tmp_path: Path) -> None:
    """The joints stay those that were loaded, though the reference now hides some of them."""
    file = random_cell(np.random.default_rng(0), tmp_path)
    robot = sm.load_robot(file, tool=(LEFT, RIGHT))
    first = robot.chain_to(LEFT, RIGHT).place(robot.generic_configurations()[0])
    circle = sm.paths.Circle.around(first, 0.05, 3.0, normal=(0, 0, 1))
    left = sm.Follow(circle, "position", tool=LEFT, reference=RIGHT)
    problem = sm.Problem(robot, [left], clearance=None)
    loaded = sm.problem.problem_from_dict(sm.problem.problem_to_dict(problem))
    assert loaded.robot.joint_names == robot.joint_names
    assert len(sm.load_robot(file, tool=LEFT, reference=RIGHT).joint_names) < robot.dof
    with pytest.raises(sm.errors.ProblemError, match="was loaded for other frames"):
        sm.files.write_problem(problem, tmp_path / "cell.toml")


def positioned(**options: object) -> sm.RobotModel:
    """Return a Panda beside a table, its tool seen from the plate."""
    base = {"table": pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.0]))}
    where = {"base": base, "tool": "arm/panda_hand_tcp", "reference": "table/plate", **options}
    return sm.load_robot({"arm": "panda", "table": "positioner"}, **where)


RING = sm.paths.Circle.around(
    pin.SE3(np.diag([1.0, -1.0, -1.0]), np.array([0.1, 0.0, 0.03])), 0.05, 4.0, normal=(0, 0, 1)
)


def test_what_the_arm_of_a_cell_holds_is_written(tmp_path: Path) -> None:
    robot = positioned(tool_offset=pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.1])))
    sm.files.write_problem(sm.Problem(robot, RING, "pointing"), tmp_path / "cell.toml")
    again = sm.read_problem(tmp_path / "cell.toml").robot
    assert again.tools == robot.tools
    q = np.full(robot.dof, 0.3)
    np.testing.assert_allclose(again.pose(q).homogeneous, robot.pose(q).homogeneous, atol=1e-12)


def test_the_arms_own_tool_by_its_name_is_seen_from_the_arms_reference() -> None:
    robot = positioned()
    named = sm.Follow(RING, "pointing", tool="arm/panda_hand_tcp")
    for item in (named, sm.Follow(RING, "pointing")):
        problem = sm.Problem(robot, [item], clearance=None)
        assert problem.robot.reference == "table/plate"
        assert item.on(robot, RING.duration).chain.base == problem.robot.chain.base


@pytest.mark.parametrize("at", [0.1, 0.5])
def test_parts_that_stand_in_each_other_are_not_verified(at: float) -> None:
    """No joint changes their distance, so only the places of the parts can be wrong."""
    robot = positioned(base={"table": pin.SE3(np.eye(3), np.array([at, 0.0, 0.0]))})
    at_rest = sm.Trajectory(
        np.array([0.0, 1.0]), np.zeros((2, robot.dof)), np.zeros((2, robot.dof)), robot.joint_names
    )
    finding = (
        sm.constraints.Clearance(distance=0.0)
        .requirement(robot)
        .judge(FinishedMotion(robot, at_rest))
    )
    stands = {"arm/panda_link0 - table/stand", "table/stand - arm/panda_link0"}
    assert (finding.subject in stands and "into each other" in finding.text) is (at < 0.2)


def test_parts_on_parts_may_touch_what_carries_them() -> None:
    robot = positioned(base={"arm": stand(0.0)}, on={"arm": "table/stand"})
    assert CollisionModel(robot).stuck is None


def test_every_feed_of_a_cell_is_judged(carried: sm.Plan) -> None:
    """Also that of a frame that is not the first."""
    robot, first = carried.robot, carried.problem.path.pose(0.0)
    away = first * pin.SE3(np.eye(3), np.array([0.05, 0.0, 0.0]))
    held = sm.paths.Feed(sm.paths.Line(first, away, 1.0), 0.01, within=0.1)
    slower = sm.paths.Dwell(first, held.duration)
    items = [sm.Follow(slower, tool=HANDS[0]), sm.Follow(held, tool=HANDS[1])]
    q = np.zeros((2, robot.dof))
    motion = sm.Trajectory(np.array([0.0, held.duration]), q, q, robot.joint_names)
    found = sm.certify(robot, items[0].path, "pose", motion, also=[items[1]])
    assert "feed" in [finding.requirement for finding in found.findings]


def test_several_paths_are_retimed_together(carried: sm.Plan) -> None:
    """A path of the second hand's own, too."""
    robot, circle = carried.robot, carried.problem.path
    grasp = stand(0.4)
    second = sm.paths.Dwell(grasp, circle.duration)
    items = [sm.Follow(circle, tool=HANDS[0]), sm.Follow(second, "pose", HANDS[1], HANDS[0])]
    problem = sm.Problem(robot, items, start=carried.trajectory.q[0])
    again = dataclasses.replace(carried, problem=problem)
    retimed = sm.retime(again, acceleration=2.0).require()
    assert retimed.problem.follows.items[1].path.duration == retimed.path.duration


REFUSED = {
    "part 'arm' is 3, expected a name": lambda: sm.load_robot({"arm": 3}),
    r"stands on '\['x'\]', which is no link": lambda: positioned(on={"arm": ["x"]}),
    "lock names joint '3'": lambda: positioned(lock={3: 0.1}),
    r"weights are \['table'\], expected a dict": lambda: positioned().part_weights(["table"]),
}


@pytest.mark.parametrize("message", REFUSED)
def test_bad_arguments_of_cells_are_refused_by_name(message: str) -> None:
    with pytest.raises(sm.errors.RobotError, match=message):
        REFUSED[message]()


def test_what_cannot_follow_several_paths_says_so(carried: sm.Plan) -> None:
    with pytest.raises(sm.errors.ProblemError, match="the moves between parts would not keep"):
        sm.plan_in_parts(carried.problem)
    with pytest.raises(sm.errors.ProblemError, match="other works' methods follow one path"):
        sm.plan_by(carried.problem, sm.baselines.PseudoInverse())


def test_links_of_parts_that_always_overlap_are_judged() -> None:
    """Within an arm they are made so; of two arms in one place they are placed so."""
    pair = sm.load_robot({"left": "panda", "right": "panda"}, tool=HANDS)
    judged = {frozenset(names) for names in CollisionModel(pair).pairs}
    links = [f"panda_link{k}" for k in range(8)]
    for k, one in enumerate(links):
        for other in links[max(k, 1) :]:
            assert frozenset((f"left/{one}", f"right/{other}")) in judged
    assert CollisionModel(pair).stuck is not None


def test_each_part_has_its_own_meshes(tmp_path: Path) -> None:
    """Also where two have packages of one name."""
    text = """<robot name="block"><link name="floor"/><link name="body"><collision><geometry>
        <mesh filename="package://block/body.obj"/></geometry></collision></link>
        <joint name="turn" type="revolute"><parent link="floor"/><child link="body"/>
        <axis xyz="0 0 1"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>"""
    for name, size in (("one", 1.0), ("other", 2.0)):
        folder = tmp_path / name / "block"
        folder.mkdir(parents=True)
        (folder / "block.urdf").write_text(text)
        corners = size * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
        lines = [f"v {x} {y} {z}" for x, y, z in corners]
        faces = ["f 1 3 2", "f 1 2 4", "f 1 4 3", "f 2 3 4"]
        (folder / "body.obj").write_text("\n".join([*lines, *faces]))
    files = {name: tmp_path / name / "block" / "block.urdf" for name in ("one", "other")}
    cell = sm.load_robot(files, tool=("one/body", "other/body"))
    pieces = cell.geometry(pin.GeometryType.COLLISION).geometryObjects
    sizes = [float(np.max(piece.geometry.vertices())) for piece in pieces]
    assert sizes == [1.0, 2.0]


def test_a_table_turns_once_round_where_the_torch_has_to_stay_upright() -> None:
    """The arm may stand still then: no plan costs more than a table that turns alone does."""
    problem = downhand(0.5)
    plan = sm.plan(problem, search=sm.Search(starts=12, finalists=1)).require()
    turn = problem.robot.joint_names.index("table/turn")
    assert np.ptp(plan.trajectory.q[:, turn]) > 1.8 * np.pi
    alone = 0.5 * (2.0 * np.pi) ** 2 / problem.path.duration
    assert plan.report.cost < alone
    assert "conditions as rows" in [item.name for item in plan.report.attempts]
    # What a narrow cone bends by is known: from there it is at its optimum in a few steps.
    again = sm.plan(problem, warm_start=plan).require()
    assert again.report.cost == pytest.approx(plan.report.cost, rel=1e-5)
    assert len(again.report.history) < 40
