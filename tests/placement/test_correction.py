"""Corrections: what is claimed was replanned, and no more."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial import ConvexHull

import selfmotion as sm
from selfmotion.work.placement import Tried, correction_range
from selfmotion.work.placement.places import Places
from support.arms import robot_named
from support.shell import invoke

LIMITS = [sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits()]


def plan_to(reach: float) -> sm.Plan:
    """A straight seam of a planar arm, from its start to a distance from its root [m]."""
    robot = robot_named("planar_3r")
    start = np.array([0.4, 0.9, 0.6])
    pose = robot.pose(start)
    away = np.array([np.cos(0.9), np.sin(0.9), 0.0])
    end = pin.SE3(pose.rotation, reach * away)
    problem = sm.Problem(robot, sm.paths.Line(pose, end, 2.0), "planar", start, constraints=LIMITS)
    return sm.plan(problem).require()


@pytest.fixture(scope="module")
def plan() -> sm.Plan:
    return plan_to(2.0)


def direction_of(name: str) -> np.ndarray:
    """The unit vector (3,) of a corner's name."""
    signs = [float(f"{before}1") for before in name if before in "+-"]
    axes = [axis for axis in name if axis not in "+-"]
    found = np.zeros(3)
    found[["xyz".index(axis) for axis in axes]] = signs
    return found / np.linalg.norm(found)


def test_what_is_claimed_is_within_the_corners(plan: sm.Plan) -> None:
    found = sm.correction(plan, farthest=0.02, most_turned=0.02).translation
    corners = np.array([each.size * direction_of(each.name) for each in found.corners])
    # Distances of the faces of their hull from the middle.
    hull = ConvexHull(corners)
    assert found.size == pytest.approx(np.min(-hull.equations[:, -1]), rel=1e-12)


def test_each_corner_is_a_verified_motion_by_its_own(plan: sm.Plan) -> None:
    found = sm.correction(plan, farthest=0.05, most_turned=0.05)
    away = np.array([corner.size for corner in found.translation.corners])
    assert (away == 0.05).all()
    assert len({corner.name for corner in found.translation.corners}) == 14
    assert not any(corner.reason for corner in found.translation.corners)
    for corner in found.translation.corners:
        # The arm is planar: it does not see z.
        frame = pin.SE3(np.eye(3), corner.size * direction_of(corner.name) * [1.0, 1.0, 0.0])
        there = plan.problem.changed(path=sm.paths.Placed(plan.path, frame), start="free")
        assert sm.plan(there).certificate.verified
    assert "confirmed at 28 corners" in str(found)


def test_the_room_of_joints_is_the_least_along_the_motion(plan: sm.Plan) -> None:
    """Of displacements of the part, and of the base the other way."""
    problem, h = plan.problem, 1e-7
    for way in (np.array([1.0, 0.0]), np.array([0.6, -0.8])):
        part, base = (
            Places((problem,), of, frozenset(), np.zeros(3), ("x", "y")) for of in ("part", "base")
        )
        room = correction_range._first_order_range(part, plan, way)
        assert correction_range._first_order_range(base, plan, -way) == pytest.approx(
            room, rel=1e-4
        )
        least = np.inf
        for q in plan.trajectory(np.linspace(0.0, 2.0, 41)):
            jacobian = problem.robot.jacobian(q)[:2]
            step = np.linalg.pinv(jacobian) @ way
            ends = np.where(step > 0.0, problem.robot.upper - q, q - problem.robot.lower)
            least = min(least, float((ends / np.maximum(np.abs(step), h)).min()))
        assert room == pytest.approx(least, rel=0.05)


def test_no_more_than_the_reach_is_claimed() -> None:
    """The seam ends 4 cm before the arm is stretched; a corner takes it nearer by its share."""
    robot = robot_named("planar_3r")
    plan = plan_to(robot.reach - 0.04)
    found = sm.correction(plan, farthest=0.2, most_turned=1e-3)
    # Towards y, where the seam ends nearly.
    most = 0.04 / np.sin(0.9)
    corner = found.translation.corners[0].size
    assert 0.3 * most < corner <= most * 1.02
    assert found.translation.stops


def test_a_corner_that_fails_is_not_claimed(plan: sm.Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = Places.corrected

    def failing(self: Places, place: np.ndarray, near: object) -> Tried:
        if place[1] < -0.01:
            return Tried(place, np.inf, "no motion that way")
        return whole(self, place, near)  # type: ignore[arg-type]

    monkeypatch.setattr(Places, "corrected", failing)
    found = sm.correction(plan, farthest=0.05, most_turned=0.01)
    # Those towards -y and into the octants there.
    assert 0.009 < found.translation.corners[0].size <= 0.01
    assert "-y" in found.translation.stops.split(" by ")[0]
    monkeypatch.setattr(correction_range, "_MAX_JOINT_CHANGE", 1e-9)
    none = sm.correction(plan, farthest=0.05, most_turned=0.01)
    assert none.translation.size == 0.0
    assert not none.translation.corners
    assert "from the plan" in none.translation.stops


def test_corrections_from_the_shell(plan: sm.Plan, tmp_path) -> None:  # type: ignore[no-untyped-def]
    file = tmp_path / "plan.npz"
    plan.save(file)
    code, told = invoke(
        "margin", file, "--tolerance", "1e-3", "--turn", "0.1", "--corrected", "--json"
    )
    assert code == 0
    assert '"corrected"' in told


@pytest.mark.site
def test_where_the_base_carries_the_path_the_part_is_corrected(tmp_path) -> None:  # type: ignore[no-untyped-def]
    arm = sm.load_robot("panda", reference="panda_link0")
    pose = arm.pose(sm.NAMED_ARMS["panda"].home)
    circle = sm.paths.Circle.around(pose, 0.02, 2.0, normal=(0, 0, 1))
    file = tmp_path / "plan.npz"
    sm.plan(sm.Problem(arm, circle, "position", constraints=LIMITS)).save(file)
    code, told = invoke("margin", file, "--tolerance", "1e-3", "--turn", "0.1", "--corrected")
    assert code == 0, told
    assert "if replanned, the part may be" in told
    assert "not planned again for another place of the base: " in told
    assert "which moves along with the base" in told


def test_what_cannot_be_corrected_is_refused(plan: sm.Plan) -> None:
    for given, said in (
        ({"of": "tool"}, "of is 'tool'"),
        ({"farthest": 0}, "farthest"),
        ({"center": [0]}, "center"),
        ({"part": ["plate"]}, "no obstacle 'plate'"),
    ):
        with pytest.raises(sm.errors.ProblemError, match=said):
            sm.correction(plan, **given)  # type: ignore[arg-type]
    with pytest.raises(sm.errors.ProblemError, match="expected a Plan"):
        sm.correction(None)  # type: ignore[arg-type]
