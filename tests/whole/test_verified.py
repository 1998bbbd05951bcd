"""'verified' means at all times: judged by `oracle`, which shares no code with the certificate.

The judge's own tests come first, then motions that are made to deceive it, then certificates that
are broken on purpose.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.certificate import bounding, check as check_module
from support.arms import PANDA_HOME, robot_named
from support.oracle import Judge
from support.own_kinematics import Arm, along
from support.scenes import Scene, among_plates, carrying, coarse, near_limits, seams

# Two programs that multiply a dozen rotations differ by this [m, rad].
ROUNDING = 1e-12


# Motions of each kind; `make bench NAME=fuzz-certificate` looks at hundreds.
FEW = range(12)


# --- the judge itself


@pytest.mark.parametrize("name", ["panda", "xarm7", "tiago", "kinova", "planar_3r", "baxter"])
def test_the_judges_kinematics_are_pinocchios(name: str) -> None:
    robot = robot_named(name)
    lower, upper = robot.finite_limits()
    q = np.random.default_rng(3).uniform(lower, upper, (20, robot.dof))
    turn, at = Arm(robot).place(robot.tool, q)
    for k, configuration in enumerate(q):
        pose = robot.pose(configuration)
        np.testing.assert_allclose(at[k], pose.translation, atol=ROUNDING)
        np.testing.assert_allclose(turn[k], pose.rotation, atol=ROUNDING)


@pytest.mark.parametrize("order", [0, 1, 2])
def test_the_judges_cubics_are_the_trajectorys(order: int) -> None:
    motion = coarse(np.random.default_rng(1), 4, 1.0)
    t = np.sort(np.random.default_rng(2).uniform(0.0, motion.t[-1], 500))
    np.testing.assert_allclose(along(motion, t, order), motion(t, order), atol=1e-11)


# Balls are solids whose distances both know exactly; GJK ends at a relative 1e-6.
@pytest.mark.parametrize("number", [2, 3, 5, 6, 7, 9, 10, 11])
def test_the_judges_distances_are_coals(number: int, tmp_path: Path) -> None:
    scene = among_plates(number, tmp_path)
    (obstacles, pairs, wanted) = scene.judge.bodies[0]
    t = np.linspace(0.0, scene.motion.duration, 300)
    q = along(scene.motion, t, 0)
    known = scene.requirements[0].model.worst(q).value
    share = scene.judge._apart(q, {}, obstacles, pairs, wanted).shares["apart"]
    found = wanted - (share - 1.0) * max(wanted, 1e-3)
    clear = wanted + 0.05 * max(wanted, 1e-3)
    assert found == pytest.approx(min(known, clear), abs=2e-6)


# --- motions that are made to deceive


def assert_confirmed(scene: Scene) -> tuple[bool, bool]:
    """Return whether a motion is verified, and valid with 1 % to spare; a false verdict fails."""
    certificate, found = scene.certify(), scene.judge.judge(scene.motion)
    assert not (certificate.verified and found.refutes), (certificate.verdict, found.refutes)
    return certificate.verified, found.valid()


def test_limits_between_samples(tmp_path: Path) -> None:
    outcomes = [assert_confirmed(near_limits(number, tmp_path)) for number in range(60)]
    assert {verified for verified, _ in outcomes} == {True, False}
    assert all(verified for verified, valid in outcomes if valid)


@pytest.fixture(scope="module")
def along_seams() -> list[Scene]:
    panda = robot_named("panda")
    return [scene for number in (1, 2) for scene in seams(number, panda, PANDA_HOME)]


def test_noisy_seams(along_seams: list[Scene]) -> None:
    """Errors near the tolerance that peak between the times that anything looks at."""
    outcomes = [assert_confirmed(scene) for scene in along_seams]
    assert len(outcomes) == 6
    assert all(verified for verified, valid in outcomes if valid)


def test_thin_plates_between_samples(tmp_path: Path) -> None:
    outcomes = []
    for number in FEW:
        (tmp_path / str(number)).mkdir()
        outcomes.append(assert_confirmed(among_plates(number, tmp_path / str(number))))
    assert {verified for verified, _ in outcomes} == {True, False}
    assert all(verified for verified, valid in outcomes if valid)


def carrying_scenes(folder: Path, count: int) -> list[Scene]:
    scenes = []
    for number in range(count):
        (folder / str(number)).mkdir()
        scenes.append(carrying(number, folder / str(number)))
    return scenes


def test_what_rides_between_samples(tmp_path: Path) -> None:
    outcomes = [assert_confirmed(scene) for scene in carrying_scenes(tmp_path, 30)]
    assert {verified for verified, _ in outcomes} == {True, False}
    assert all(verified for verified, valid in outcomes if valid)


# --- certificates that are broken on purpose: the judge refutes them


def refuted(scenes: list[Scene]) -> list[tuple[str, ...]]:
    """Return what the judge says against motions that are called verified."""
    found = [(scene.certify(), scene.judge.judge(scene.motion)) for scene in scenes]
    return [item.refutes for certificate, item in found if certificate.verified and item.refutes]


def test_a_certificate_that_looks_at_the_samples_alone_is_refuted(
    panda: sm.RobotModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    def at_ends(function: Any, segments: Any, count: int, rest: Array) -> tuple[Array, ...]:
        """Bounds of what is measured at both ends of each interval, and no more."""
        values = function.sizes(function.values(segments, np.array([-1.0, 1.0])), segments)
        largest = values.max(axis=1)
        return largest, segments.intervals[:, :1] + 0.0 * largest, largest

    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.1, 4.0)
    motion = sm.plan(sm.Problem(panda, path, start=PANDA_HOME), max_evaluations=3).trajectory
    # Farther apart the samples are on the path, and what lies between them is not.
    keep = np.unique(np.append(np.arange(0, len(motion.t), 3), len(motion.t) - 1))
    motion = sm.Trajectory(motion.t[keep], motion.q[keep], motion.qd[keep], motion.joint_names)
    scene = Scene(Judge(panda, path), motion)
    assert not refuted([scene])
    monkeypatch.setattr(bounding, "_interpolated", at_ends)
    assert "position" in refuted([scene])[0][0]


@dataclass(frozen=True)
class Blind(sm.certificate.Requirement):
    """A requirement that everything keeps."""

    name: str = "blind"

    def judge(self, motion: sm.certificate.FinishedMotion) -> sm.certificate.Finding:
        return sm.certificate.Finding(self.name, "", 0.0, 0.0, 0.0, True, "")


def test_a_requirement_that_everything_keeps_is_refuted(tmp_path: Path) -> None:
    scenes = []
    for number in range(24):
        (tmp_path / str(number)).mkdir()
        maker = near_limits if number % 3 == 2 else among_plates
        scene = maker(number, tmp_path / str(number))
        scenes.append(replace(scene, requirements=[Blind()]))
    found = " ".join(text for item in refuted(scenes) for text in item)
    assert "order 2" in found
    assert "apart" in found


def test_a_certificate_that_leaves_what_rides_in_the_world_is_refuted(tmp_path: Path) -> None:
    scenes = []
    for scene in carrying_scenes(tmp_path, 30):
        (bodies, _, distance) = scene.judge.bodies[0]
        standing = [bodies[0], *(replace(plate, frame=None) for plate in bodies[1:])]
        wanted = sm.constraints.Clearance(standing, distance).requirement(scene.judge.robot)
        scenes.append(replace(scene, requirements=[wanted]))
    assert "apart" in " ".join(text for item in refuted(scenes) for text in item)


def test_a_certificate_without_the_arms_limits_is_refuted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenes = []
    for number in range(15):
        (tmp_path / str(number)).mkdir()
        scenes.append(near_limits(number, tmp_path / str(number)))
    monkeypatch.setattr(check_module, "arm_limits", lambda *_: ())
    found = " ".join(text for item in refuted(scenes) for text in item)
    assert "limits" in found
    assert "order 1" in found
