"""What belongs to a part, as it is seen from above."""

from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial import ConvexHull

import selfmotion as sm
from selfmotion.model.robot import with_moved_base
from selfmotion.work.placement import places as module
from selfmotion.work.placement.places import _check_reach, footprint, places_of

# Half of the sizes of a block, and where it stands [m].
HALF, AT = np.array([0.1, 0.05, 0.02]), np.array([0.2, -0.3, 0.1])
# The base of the arm is moved by that, and turned about z by a quarter.
MOVED = np.array([0.5, 0.25, 0.0])
ROUNDING = 1e-9


def seam(*, is_carried: bool, length: float = 0.2) -> sm.Problem:
    """Return a straight seam beside a block, in the world or in the frame of a base elsewhere."""
    arm = sm.load_robot("panda", reference="panda_link0" if is_carried else None)
    pose = arm.pose(sm.NAMED_ARMS["panda"].home)
    end = pin.SE3(pose.rotation, pose.translation + np.array([0.0, length, 0.0]))
    if is_carried:
        quarter = pin.rpy.rpyToMatrix(0.0, 0.0, 0.5 * np.pi)
        arm = with_moved_base(arm, pin.SE3(quarter, MOVED))
    block = sm.obstacles.Box("block", AT, 2.0 * HALF)
    clear = sm.constraints.Clearance([block], 5e-3)
    return sm.Problem(arm, sm.paths.Line(pose, end, 2.0), constraints=(), clearance=clear)


@pytest.mark.parametrize("is_carried", [False, True])
def test_a_part_is_seen_where_its_path_and_its_bodies_are_in_the_world(is_carried: bool) -> None:
    problem = seam(is_carried=is_carried)
    ends = np.array([problem.path.pose(t).translation[:2] for t in (0.0, 2.0)])
    if is_carried:
        ends = ends @ np.array([[0.0, 1.0], [-1.0, 0.0]]) + MOVED[:2]
    corners = AT[:2] + HALF[:2] * np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
    for bodies, points in (((), ends), (("block",), np.concatenate([ends, corners]))):
        found = footprint([problem], frozenset(bodies))
        for point in points if not bodies else points[ConvexHull(points).vertices]:
            assert np.linalg.norm(found - point, axis=1).min() <= ROUNDING
        assert (found.min(axis=0) >= points.min(axis=0) - ROUNDING).all()
        assert (found.max(axis=0) <= points.max(axis=0) + ROUNDING).all()


def test_a_part_is_turned_about_the_middle_of_its_path() -> None:
    problem = seam(is_carried=False)
    places = places_of([problem], "part", ["block"], None, ("yaw",))
    ends = [problem.path.pose(t).translation for t in (0.0, 2.0)]
    np.testing.assert_allclose(places.center, np.mean(ends, axis=0), atol=ROUNDING)


def test_quick_looks_are_quicker_the_more_is_known() -> None:
    """Beside known motions with fewer starts and less time; no more are ended than begun."""
    near, quick = module._NEAR, module._QUICK
    for search in (near, quick):
        assert 1 <= search.finalists <= search.starts
    assert near.starts < quick.starts < sm.Search().starts
    assert module._PATIENCE_NEAR < module._PATIENCE < module._PATIENCE_SURE


def test_a_quick_look_says_what_is_out_of_reach_where_nothing_is_relaxed() -> None:
    near = seam(is_carried=False)
    _check_reach(near)
    far = seam(is_carried=False, length=3.0)
    with pytest.raises(sm.errors.InverseKinematicsError, match="out of reach at t = "):
        _check_reach(far)
    # Planning itself has to tell.
    _check_reach(far.changed(relaxations=[sm.Relaxation("y", 3.0)]))
    _check_reach(seam(is_carried=True, length=3.0))
    # As of what other frames follow.
    items = near.follows.items[0], far.follows.items[0]
    _check_reach(
        SimpleNamespace(
            robot=near.robot,
            task=near.task,
            path=near.path,
            relaxations=(),
            follows=SimpleNamespace(items=items),
        )
    )
