"""Obstacles that ride on links: as if the URDF had them as links of their own."""

import dataclasses
import json
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import trimesh

import selfmotion as sm
from selfmotion.basics import Array, restore
from selfmotion.model.collision import ClearanceModel
from selfmotion.model.robot.mounting import placed
from support.arms import robot_named, short_line, start_of

# Rounding of placements that are multiplied in another order, through GJK's accuracy [m].
SAME = 1e-7
# What distances of unlike shapes are right to [m].
DISTANCE = 1e-6

POSE = pin.SE3(pin.rpy.rpyToMatrix(0.3, -0.2, 0.4), np.array([0.02, 0.05, 0.12]))
WORLD = (
    sm.obstacles.Box("post", [0.5, 0.2, 0.4], [0.1, 0.1, 0.8]),
    sm.obstacles.Sphere("ball", [-0.3, 0.4, 0.7], 0.1),
)
# Arm → the link that its tool is on, and one before it.
FRAMES = {
    "panda": ("panda_hand", "panda_link4"),
    "xarm7": ("link7", "link4"),
    "ur5": ("wrist_3_link", "forearm_link"),
    "baxter": ("left_gripper_base_link", "left_lower_elbow"),
}


def ridden(frame: str, before: str) -> tuple[sm.obstacles.Obstacle, ...]:
    return (
        sm.obstacles.Box("torch", POSE, [0.06, 0.04, 0.3], frame=frame),
        sm.obstacles.Cylinder("nozzle", POSE * POSE, 0.02, 0.25, frame=frame),
        sm.obstacles.Sphere(
            "camera", pin.SE3(np.eye(3), np.array([0.0, 0.13, 0.1])), 0.05, frame=before
        ),
    )


def with_links(robot: sm.RobotModel, bodies: tuple[sm.obstacles.Obstacle, ...], folder: Path):
    """Return the arm whose URDF has the bodies as links."""
    root = ElementTree.fromstring(robot.urdf.text)
    for body in bodies:
        link = ElementTree.SubElement(root, "link", name=body.name)
        shape = ElementTree.SubElement(ElementTree.SubElement(link, "collision"), "geometry")
        sizes = {
            "box": lambda b: {"size": " ".join(map(str, b.size))},
            "sphere": lambda b: {"radius": str(b.radius)},
            "cylinder": lambda b: {"radius": str(b.radius), "length": str(b.length)},
        }[body.shape](body)
        ElementTree.SubElement(shape, body.shape, sizes)
        root.append(placed(f"{body.name}_joint", str(body.frame), body.name, body.pose))
    file = folder / "with.urdf"
    file.write_text(ElementTree.tostring(root, encoding="unicode"))
    built = sm.load_robot(file, robot.tool, robot.locked)
    # A file has neither package folders nor what is known of an arm by name.
    return dataclasses.replace(
        built,
        urdf=dataclasses.replace(built.urdf, package_dirs=robot.urdf.package_dirs),
        touching=robot.touching,
        acceleration_limit=robot.acceleration_limit,
        jerk_limit=robot.jerk_limit,
    )


def configurations(robot: sm.RobotModel, count: int) -> Array:
    lower, upper = robot.finite_limits()
    return np.random.default_rng(5).uniform(lower, upper, (count, robot.dof))


def table(model: sm.obstacles.CollisionModel, values: Array) -> dict[tuple[str, ...], Array]:
    """Return columns by the names of their pairs, those of several pieces at their least."""
    found: dict[tuple[str, ...], Array] = {}
    for pair, column in zip(model.pairs, values.T, strict=True):
        key = tuple(sorted(pair))
        found[key] = np.minimum(found.get(key, np.inf), column)
    return found


def unlike(
    model: sm.obstacles.CollisionModel, other: sm.obstacles.CollisionModel, q: Array
) -> list[str]:
    """Return what two models say differently."""
    first, second = (table(each, each.distances(q)) for each in (model, other))
    said = [] if first.keys() == second.keys() else ["pairs"]
    said += [
        "distances"
        for pair in first.keys() & second.keys()
        if np.abs(first[pair] - second[pair]).max() > SAME
    ]
    first, second = (table(each, each.pair_levers.T) for each in (model, other))
    said += [
        "levers"
        for pair in first.keys() & second.keys()
        if np.abs(first[pair] - second[pair]).max() > SAME
    ]
    first, second = (
        {tuple(sorted(pair)): index for index, pair in enumerate(each.pairs)}
        for each in (ClearanceModel(model), ClearanceModel(other))
    )
    return said if first.keys() == second.keys() else [*said, "smooth pairs"]


@pytest.mark.parametrize("name", FRAMES)
def test_what_rides_is_a_link_of_its_own(name: str, tmp_path: Path) -> None:
    robot = robot_named(name)
    bodies = ridden(*FRAMES[name])
    model = sm.obstacles.CollisionModel(robot, [*WORLD, *bodies])
    other = sm.obstacles.CollisionModel(with_links(robot, bodies, tmp_path), WORLD)
    q = configurations(robot, 12)
    assert unlike(model, other, q) == []
    assert [dataclasses.astuple(x) for x in model.overlapping] == [
        dataclasses.astuple(x) for x in other.overlapping
    ]
    assert (model.checks_links, model.checks_obstacles) == (True, True)
    # The frame dropped, or another one, is seen.
    for frame in (None, FRAMES[name][1]):
        moved = dataclasses.replace(bodies[0], frame=frame)
        assert (
            unlike(sm.obstacles.CollisionModel(robot, [*WORLD, moved, *bodies[1:]]), other, q) != []
        )


@pytest.mark.parametrize("name", FRAMES)
def test_what_rides_goes_into_files_and_back(name: str) -> None:
    robot = robot_named(name)
    clearance = sm.constraints.Clearance([*WORLD, *ridden(*FRAMES[name])], distance=0.002)
    again = restore(sm.constraints.Constraint, json.loads(json.dumps(clearance.to_dict())))
    assert unlike(clearance.model(robot), again.model(robot), configurations(robot, 3)) == []


def test_on_a_link_that_no_joint_moves_it_stands_in_the_world(panda: sm.RobotModel) -> None:
    base = pin.SE3(POSE.rotation, np.array([0.1, 0.0, 0.2]))
    robot = sm.load_robot("panda", base=base)
    on = sm.obstacles.Box("shelf", POSE, [0.3, 0.1, 0.1], frame="panda_link0")
    at = sm.obstacles.Box("shelf", base * POSE, [0.3, 0.1, 0.1])
    model, other = (sm.obstacles.CollisionModel(robot, [each]) for each in (on, at))
    assert model.standing == {"shelf"}
    assert unlike(model, other, configurations(robot, 5)) == []


def test_on_a_link_that_is_held_it_is_where_that_is_held() -> None:
    """A jaw on a finger: as far out as the finger is."""
    robot = sm.load_robot("panda", lock={"panda_finger_joint1": 0.03})
    jaw = sm.obstacles.Box("jaw", [0.0, 0.02, 0.1], [0.02, 0.02, 0.1], frame="panda_leftfinger")
    on_hand = sm.obstacles.Box("jaw", [0.0, 0.05, 0.1584], [0.02, 0.02, 0.1], frame="panda_hand")
    model, other = (sm.obstacles.CollisionModel(robot, [*WORLD, each]) for each in (jaw, on_hand))
    assert unlike(model, other, configurations(robot, 5)) == []


def test_a_part_that_is_held_too_tight_is_told_with_the_remedy() -> None:
    """The fingers, held 4 cm apart, and a part of 42 mm between them."""
    robot = sm.load_robot("panda", lock={"panda_finger_joint1": 0.02})
    part = sm.obstacles.Box("part", [0.0, 0.0, 0.105], [0.02, 0.042, 0.02], frame="panda_hand")
    fingers = ("panda_leftfinger", "panda_rightfinger")
    q = configurations(robot, 1)
    motion = sm.Trajectory([0.0, 1.0], [*q, *q], np.zeros((2, 7)), robot.joint_names)
    judged = sm.certificate.FinishedMotion(robot, motion)
    found = sm.constraints.Clearance([part], 0.0).requirement(robot).judge(judged)
    assert "finger - part 1.02 mm into each other" in found.text
    assert 'finger" link2="part" reason="Default"/>' in found.text
    pairs = [("part", finger) for finger in fingers]
    assert sm.obstacles.CollisionModel(robot, [part], pairs).stuck is None
    free = dataclasses.replace(part, size=np.array([0.02, 0.0395, 0.02]))
    assert sm.obstacles.CollisionModel(robot, [free]).stuck is None


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"frame": "panda_hnad"}, "box 'torch': its frame 'panda_hnad' is no link of panda.*hand"),
        ({"frame": ""}, "frame is '', expected the name of a link"),
        ({"frame": 7}, "frame is 7, expected the name of a link"),
        ({"name": "panda_hand"}, "a link or another obstacle has this name too"),
    ],
)
def test_a_frame_that_is_no_link_is_refused_by_name(
    panda: sm.RobotModel, given: dict[str, Any], message: str
) -> None:
    values = {"name": "torch", "pose": POSE, "size": [0.1, 0.1, 0.1], "frame": "panda_hand"}
    with pytest.raises(sm.errors.CollisionError, match=message):
        sm.obstacles.CollisionModel(panda, [sm.obstacles.Box(**{**values, **given})])


def test_what_touches_as_it_is_mounted_is_left_out_and_told(panda: sm.RobotModel) -> None:
    """A bracket on link 6 that reaches around the joint into what link 7 carries."""
    bracket = sm.obstacles.Sphere("bracket", [0.088, 0.0, 0.0], 0.05, frame="panda_link6")
    flange = sm.obstacles.Sphere("flange", [0.0, 0.0, 0.0], 0.05, frame="panda_link7")
    apart = sm.obstacles.Sphere("flange", [0.0, 0.0, 0.25], 0.05, frame="panda_link7")
    touching = sm.obstacles.CollisionModel(panda, [bracket, flange])
    pair = ("bracket", "flange")
    assert pair not in touching.pairs
    assert pair in [(x.first, x.second) for x in touching.overlapping if not x.is_checked]
    assert pair in sm.obstacles.CollisionModel(panda, [bracket, apart]).pairs
    remarks = sm.constraints.Clearance([bracket, flange]).requirement(panda).remarks
    said = " ".join(remarks)
    assert re.search(r"bracket - flange \(in 100 % of all configurations, by \d+\.\d mm\)", said)


@pytest.mark.parametrize("name", FRAMES)
def test_each_body_has_its_closest_approach(name: str) -> None:
    """Whether it is the arm's own or the job's: the same groups, of the same pairs."""
    robot, bodies = sm.load_robot(name), ridden(*FRAMES[name])
    own = sm.obstacles.CollisionModel(sm.load_robot(name, bodies=bodies), WORLD).groups
    other = sm.obstacles.CollisionModel(robot, [*WORLD, *bodies]).groups
    assert own.keys() == other.keys()
    assert own.keys() == {"the arm itself", *(body.name for body in (*WORLD, *bodies))}
    for group, model in own.items():
        assert {frozenset(x) for x in model.pairs} == {frozenset(x) for x in other[group].pairs}
        assert group == "the arm itself" or all(group in pair for pair in model.pairs)


def test_what_parts_of_a_cell_carry_is_not_made_to_touch() -> None:
    """A ball on the table so large that the arm's shoulder is always in it: told, not left out."""
    base = {"table": pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.0]))}
    parts, tool = {"arm": "panda", "table": "positioner"}, "arm/panda_hand_tcp"
    ball = sm.obstacles.Sphere("ball", [0.0, 0.0, 0.0], 0.6, frame="table/plate")
    ways = (
        sm.obstacles.CollisionModel(
            sm.load_robot(parts, tool, base=base, reference="table/plate"), [ball]
        ),
        sm.obstacles.CollisionModel(
            sm.load_robot(parts, tool, base=base, reference="table/plate", bodies=[ball])
        ),
    )
    for model in ways:
        pair = next(pair for pair in model.pairs if set(pair) == {"arm/panda_link1", "ball"})
        (told,) = [x for x in model.overlapping if {x.first, x.second} == set(pair)]
        assert (told.share, told.is_checked) == (1.0, True)
        assert model.distance(np.zeros(model.robot.dof)).value < 0.0


def test_pairs_of_what_rides_are_left_out_as_asked(panda: sm.RobotModel) -> None:
    bodies = ridden(*FRAMES["panda"])
    every = sm.obstacles.CollisionModel(panda, [*WORLD, *bodies])
    for pair in (("torch", "panda_link4"), ("post", "nozzle"), ("torch", "camera")):
        left = sm.obstacles.CollisionModel(panda, [*WORLD, *bodies], disabled=[pair])
        gone = {frozenset(item) for item in every.pairs} - {frozenset(x) for x in left.pairs}
        assert gone == {frozenset(pair)}
        assert [frozenset(item) for item in left.disabled] == [frozenset(pair)]


def test_an_arm_without_bodies_may_carry_one() -> None:
    robot = robot_named("planar_3r")
    stick = sm.obstacles.Box("stick", [0.1, 0.0, 0.0], [0.2, 0.02, 0.02], frame=robot.tool)
    wall = sm.obstacles.Box("wall", [0.0, 2.0, 0.0], [9.0, 0.1, 1.0])
    model = sm.constraints.Clearance([stick, wall]).model(robot)
    assert model.pairs == (("stick", "wall"),)
    with pytest.raises(sm.errors.ProblemError, match="no collision geometry"):
        sm.constraints.Clearance([wall]).model(robot)


def plate_between_samples(
    panda: sm.RobotModel,
) -> tuple[sm.Trajectory, sm.obstacles.Box, sm.obstacles.Box]:
    """Return a coarse motion of joint 1, a long torch, and a plate its tip passes in between."""
    q = np.array([-0.4, 0.3, 0.0, -1.8, 0.0, 2.0, 0.8])
    ends = np.array([q, q + np.eye(7)[0] * 0.8])
    motion = sm.Trajectory(np.array([0.0, 1.0]), ends, np.zeros((2, 7)), panda.joint_names)
    torch = sm.obstacles.Box("torch", [0.0, 0.0, 0.3], [0.02, 0.02, 0.3], frame="panda_hand")
    joint, place = panda.carrier_of("panda_hand")
    data = panda.model.createData()
    pin.forwardKinematics(panda.model, data, motion(np.array([0.37]))[0])
    tip = (data.oMi[joint] * place).act(np.array([0.0, 0.0, 0.44]))
    turn = pin.rpy.rpyToMatrix(0.0, 0.0, float(np.arctan2(tip[1], tip[0])))
    return motion, torch, sm.obstacles.Box("plate", pin.SE3(turn, tip), [0.02, 0.002, 0.02])


def test_it_meets_an_obstacle_where_the_arm_takes_it_between_samples(
    panda: sm.RobotModel,
) -> None:
    motion, torch, plate = plate_between_samples(panda)
    times = np.linspace(0.0, 1.0, 2001)
    oracle = (
        sm.obstacles.CollisionModel(panda, [torch, plate]).distances(motion(times), 0.0).min(axis=1)
    )
    met = times[oracle <= 0.0]
    assert 0.0 < met[0] < 0.37 < met[-1] < 1.0
    judged = sm.certificate.FinishedMotion(panda, motion)
    found = sm.constraints.Clearance([torch, plate], 0.0).requirement(panda).judge(judged)
    assert not found.satisfied
    assert found.subject == "torch - plate"
    assert met[0] - 1e-3 <= found.time <= met[-1] + 1e-3
    # Without it, and where it stands in the world, the way is free.
    standing = dataclasses.replace(torch, frame=None, pose=np.array([0.0, 0.0, 2.0]))
    for bodies in ([plate], [standing, plate]):
        assert sm.constraints.Clearance(bodies, 0.0).requirement(panda).judge(judged).satisfied


@pytest.mark.parametrize("task", ["position", "pose"])
def test_a_plan_with_what_rides_is_that_of_the_arm_with_the_link(
    panda: sm.RobotModel, task: str, tmp_path: Path
) -> None:
    start = start_of(panda, "pose")
    torch = sm.obstacles.Box("torch", [0.0, 0.0, 0.2], [0.05, 0.05, 0.2], frame="panda_hand")
    pole = panda.pose(start).act(np.array([0.06, 0.0, 0.05]))
    post = sm.obstacles.Sphere("post", pole, 0.02)
    line = short_line(panda, start)
    plans = [
        sm.plan(
            sm.Problem(
                arm,
                line,
                task,
                start,
                constraints=[],
                clearance=sm.constraints.Clearance(bodies, 0.01),
            )
        )
        for arm, bodies in (
            (panda, [post, torch]),
            (with_links(panda, (torch,), tmp_path), [post]),
        )
    ]
    assert plans[0].report.cost == pytest.approx(plans[1].report.cost, rel=1e-9)
    assert plans[0].certificate.verdict == plans[1].certificate.verdict
    assert plans[0].certificate.findings == plans[1].certificate.findings
    plans[0].save(tmp_path / "plan.npz")
    again = sm.load_plan(tmp_path / "plan.npz")
    assert again.certificate.findings == plans[0].certificate.findings
    assert [item.frame for item in again.obstacles] == [None, "panda_hand"]


@pytest.mark.parametrize("name", FRAMES)
def test_bodies_of_an_arm_are_what_rides_on_it(name: str) -> None:
    robot, bodies = sm.load_robot(name), ridden(*FRAMES[name])
    own = sm.obstacles.CollisionModel(sm.load_robot(name, bodies=bodies), WORLD)
    other = sm.obstacles.CollisionModel(robot, [*WORLD, *bodies])
    q = configurations(robot, 8)
    assert unlike(own, other, q) == []
    rest = sm.obstacles.CollisionModel(sm.load_robot(name, bodies=bodies[1:]), WORLD)
    assert unlike(rest, other, q) != []


def test_a_capsule_is_a_cylinder_and_two_spheres_of_an_arm(panda: sm.RobotModel) -> None:
    """As far from all else: of pieces that overlap something, each has a depth of its own."""
    cable = sm.obstacles.Capsule("cable", POSE, 0.02, 0.2, frame="panda_hand")
    arm, q = sm.load_robot("panda", bodies=[cable]), configurations(panda, 8)
    first, second = (
        table(model, model.distances(q))
        for model in (
            sm.obstacles.CollisionModel(arm, WORLD),
            sm.obstacles.CollisionModel(panda, [*WORLD, cable]),
        )
    )
    assert first.keys() == second.keys()
    for pair, values in first.items():
        apart = np.maximum(values, 0.0) - np.maximum(second[pair], 0.0)
        assert np.abs(apart).max() < DISTANCE


def test_bodies_of_an_arm_are_placed_as_its_tool_is(panda: sm.RobotModel) -> None:
    """In the frame of `tool`, the offset to the tool's point left aside."""
    offset = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.5, 0.0), np.array([0.0, 0.0, 0.3]))
    torch = sm.obstacles.Box("torch", POSE, [0.06, 0.04, 0.3])
    arm = sm.load_robot("panda", "panda_hand", tool_offset=offset, bodies=[torch])
    ridden_on = dataclasses.replace(torch, frame="panda_hand")
    model = sm.obstacles.CollisionModel(arm, WORLD)
    other = sm.obstacles.CollisionModel(panda, [*WORLD, ridden_on])
    assert unlike(model, other, configurations(panda, 4)) == []
    assert arm.dof == panda.dof
    q = configurations(arm, 1)[0]
    assert arm.pose(q) == sm.load_robot("panda", "panda_hand", tool_offset=offset).pose(q)


def test_bodies_of_an_arm_go_into_files_and_back(tmp_path: Path) -> None:
    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "part.stl")
    bodies = [
        sm.obstacles.Box("gun", POSE, [0.06, 0.04, 0.1]),
        sm.obstacles.Cylinder("nozzle", POSE, 0.02, 0.1, frame="gun"),
        sm.obstacles.Capsule("cable", POSE, 0.01, 0.1, frame="panda_link5"),
        sm.obstacles.Sphere("lamp", POSE, 0.03, frame="panda_hand"),
        sm.obstacles.Mesh("part", POSE, tmp_path / "part.stl", 0.5),
    ]
    for offset in (None, pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.2]))):
        arm = sm.load_robot("panda", tool_offset=offset, bodies=bodies)
        start = start_of(arm, "pose")
        problem = sm.Problem(arm, short_line(arm, start), start=start)
        file = tmp_path / "torch.toml"
        sm.files.write_problem(problem, file)
        again = sm.read_problem(file).robot
        q = configurations(arm, 4)
        assert (
            unlike(
                sm.obstacles.CollisionModel(arm, WORLD),
                sm.obstacles.CollisionModel(again, WORLD),
                q,
            )
            == []
        )
    plan = sm.plan(problem)
    plan.save(tmp_path / "plan.npz")
    loaded = sm.load_plan(tmp_path / "plan.npz")
    assert loaded.certificate.findings == plan.certificate.findings
    assert loaded.robot.urdf.text == arm.urdf.text


@pytest.mark.parametrize(
    ("bodies", "message"),
    [
        (
            [sm.obstacles.Box("panda_hand", POSE, [1, 1, 1])],
            "has a link 'panda_hand', whose name is needed",
        ),
        (
            [sm.obstacles.Box("a", POSE, [1, 1, 1], frame="hnad")],
            "box 'a': its frame 'hnad' is no link",
        ),
        (["torch"], "bodies has 'torch', expected Box, Sphere"),
        ([sm.obstacles.Box], "expected Box, Sphere"),
        (3, "bodies has 3"),
    ],
)
def test_what_is_no_body_of_an_arm_is_refused(bodies: Any, message: str) -> None:
    with pytest.raises(sm.errors.RobotError, match=message):
        sm.load_robot("panda", bodies=bodies)


def test_a_free_start_keeps_what_rides_clear(panda: sm.RobotModel) -> None:
    """A rod across the hand, and walls beside the path, which only a turned hand passes."""
    start = start_of(panda, "pose")
    pose = panda.pose(start)
    rod = sm.obstacles.Box("rod", [0.0, 0.0, 0.05], [0.02, 0.7, 0.02], frame="panda_hand")
    along = pose.rotation[:, 1]
    walls = [
        sm.obstacles.Sphere(f"wall{k}", pose.translation + sign * 0.3 * along, 0.06)
        for k, sign in enumerate((1.0, -1.0))
    ]
    line = short_line(panda, start)
    kept = sm.constraints.Clearance([rod, *walls], 0.005)
    assert kept.model(panda).distance(start).value < 0.0
    limits = sm.constraints.JointPositionLimits()
    plan = sm.plan(
        sm.Problem(panda, line, "pointing", constraints=[limits], clearance=kept)
    ).require()
    assert {"rod", "wall0", "wall1"} <= plan.approaches.keys()
    assert min(near.value for near in plan.approaches.values()) >= 0.005


def test_a_problem_file_carries_the_frame(panda: sm.RobotModel, tmp_path: Path) -> None:
    start = start_of(panda, "pose")
    torch = sm.obstacles.Box("torch", POSE, [0.05, 0.05, 0.2], frame="panda_hand")
    problem = sm.Problem(
        panda,
        short_line(panda, start),
        start=start,
        constraints=[],
        clearance=sm.constraints.Clearance([torch]),
    )
    sm.files.write_problem(problem, tmp_path / "cell.toml")
    (found,) = sm.read_problem(tmp_path / "cell.toml").requirements[-1].obstacles
    assert found.to_dict() == torch.to_dict()


def test_while_the_arm_moves_what_rides_may_be_moved_in_its_frame(panda: sm.RobotModel) -> None:
    torch = sm.obstacles.Sphere("torch", [0.0, 0.0, 0.3], 0.02, frame="panda_hand")
    ball = sm.obstacles.Sphere("ball", [0.4, 0.0, 0.4], 0.05)
    shifted = dataclasses.replace(torch, pose=np.array([0.1, 0.0, 0.2]))
    q = configurations(panda, 4)
    moved = ClearanceModel(sm.obstacles.CollisionModel(panda, [torch, ball]), 1.0)
    moved.move("torch", shifted.pose)
    anew = ClearanceModel(sm.obstacles.CollisionModel(panda, [shifted, ball]), 1.0)
    pair = ("torch", "ball")
    first, second = (each.clearances(q).values[:, each.pairs.index(pair)] for each in (moved, anew))
    np.testing.assert_allclose(first, second, atol=SAME)
