"""Clearance: exact rows, kept on the real meshes, and no dearer than need be."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import read_archive, write_archive
from selfmotion.planning.result.archive import file_digest
from selfmotion.problem.constraints import NO_OVERLAP, with_own_distances
from selfmotion.problem.problem.digest import conditions_digest
from support.arms import PANDA_HOME, short_line

Circle = Callable[..., sm.Problem]


LIMITS = (sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits())


def test_obstacles_are_avoided_on_the_real_meshes(panda: sm.RobotModel) -> None:
    """A box in the elbow's way: without the constraint the plan collides, with it it does not."""
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.1, 4.0, normal=(1.0, 0.0, 0.0))
    plain = sm.plan(sm.Problem(panda, path, start=PANDA_HOME))
    box = sm.obstacles.Box("box", np.array([0.0, -0.18, 0.62]), [0.1, 0.1, 0.1])
    model = sm.obstacles.CollisionModel(panda, (box,))
    assert model.worst(plain.trajectory.q).value < -0.005
    clearance = sm.constraints.Clearance((box,), 0.005)
    problem = sm.Problem(
        panda,
        path,
        start=PANDA_HOME,
        constraints=LIMITS,
        clearance=clearance,
    )
    plan = sm.plan(problem)
    assert plan.certificate.verified, plan.certificate.verdict
    assert plan.certificate.clearance is not None
    assert plan.certificate.clearance.value >= clearance.distance
    assert model.worst(plan.trajectory(np.linspace(0, 4, 301))).value >= clearance.distance


def test_clearance_of_an_arm_without_geometry_is_refused(planar: sm.RobotModel) -> None:
    start = planar.inverse_kinematics(planar.pose([0.3, 0.8, 0.5]), "planar")
    path = short_line(planar, start)
    with pytest.raises(
        sm.errors.ProblemError, match="planar_3r: a clearance is asked for, but its URDF"
    ):
        sm.Problem(
            planar, path, "planar", start, constraints=[], clearance=sm.constraints.Clearance()
        )


def test_a_table_under_the_base_is_no_obstacle_to_it(panda_circle: Circle) -> None:
    table = sm.obstacles.Box("table", [0.0, 0.0, -0.05], [0.6, 0.6, 0.1])
    problem = panda_circle(constraints=[], clearance=sm.constraints.Clearance([table], 1e-3))
    assert sm.plan(problem).certificate.verified


def test_passing_closer_than_capsules_allow_costs_nothing(panda_circle: Circle) -> None:
    """A box a centimetre from the hulls on the best motion, well inside the capsules."""
    free = sm.plan(panda_circle())
    model = sm.obstacles.CollisionModel(free.robot)
    box = None
    for side in np.linspace(0.12, 0.4, 29):
        box = sm.obstacles.Box("near", [0.45, side, 0.75], [0.1, 0.1, 0.1])
        model = sm.obstacles.CollisionModel(free.robot, [box])
        if model.worst(free.trajectory.q).value > 0.01:
            break
    plan = sm.plan(panda_circle(constraints=[], clearance=sm.constraints.Clearance([box], 5e-3)))
    assert plan.certificate.verified
    assert plan.report.cost == pytest.approx(free.report.cost, rel=1e-3)


def ball_beside(panda: sm.RobotModel) -> sm.obstacles.Obstacle:
    """A ball beside the elbow, which the best motion meets."""
    elbow = panda.chain_to("panda_link4").place(PANDA_HOME).translation
    return sm.obstacles.Sphere("ball", elbow + np.array([0.0, -0.16, 0.05]), 0.05)


def formerly(problem: Callable[..., sm.Problem], **given: Any) -> sm.Problem:
    """Return a problem that has a clearance among its constraints, which warns what to write."""
    with pytest.warns(sm.errors.FormerUseWarning, match=r"write \w+\(…, clearance=Clear"):
        return problem(**given)


def test_a_clearance_among_the_constraints_is_moved_and_plans_the_same(
    panda: sm.RobotModel, panda_circle: Circle
) -> None:
    clear, plain = sm.constraints.Clearance([ball_beside(panda)], 5e-3), NO_OVERLAP
    own = sm.constraints.Clearance((), 0.0)
    for given, now in ((plain, clear), (None, clear), (own, (clear, own))):
        former = formerly(panda_circle, constraints=(LIMITS[0], clear, LIMITS[1]), clearance=given)
        asked = panda_circle(constraints=LIMITS, clearance=now)
        assert former.constraints == LIMITS
        assert former.clearance == now
        assert former.digest == asked.digest
    one, other = (sm.plan(each).require() for each in (former, asked))
    assert one.report.cost == other.report.cost
    assert one.certificate == other.certificate
    moved = formerly(sm.move, robot=panda, first=PANDA_HOME, last=PANDA_HOME, constraints=[clear])
    assert moved.constraints == (clear,)


def test_all_of_several_clearances_are_kept(panda: sm.RobotModel, panda_circle: Circle) -> None:
    near, far = (sm.constraints.Clearance([ball_beside(panda)], d) for d in (1e-3, 7e-3))
    plan = sm.plan(panda_circle(constraints=LIMITS, clearance=[near, far])).require()
    model = sm.obstacles.CollisionModel(panda, far.obstacles)
    assert model.worst(plan.trajectory(np.linspace(0, 4, 301))).value >= far.distance
    for wrong in (5, [near, 5], [[near]], "near"):
        with pytest.raises(sm.errors.ProblemError, match=r"clearance is .*, expected a Clearance"):
            panda_circle(clearance=wrong)


@pytest.mark.parametrize("place", [0, 1, 2])
def test_files_with_a_clearance_among_the_constraints_are_read(
    panda: sm.RobotModel, panda_circle: Circle, tmp_path: Path, place: int
) -> None:
    """Of former versions: plans verified as they are, problem files with a note."""
    clear = sm.constraints.Clearance([ball_beside(panda)], 5e-3)
    plan = sm.plan(panda_circle(constraints=LIMITS, clearance=clear)).require()
    plan.save(tmp_path / "now.npz")
    description, arrays = read_archive(tmp_path / "now.npz")
    del description["digest"]
    document = description["problem"]
    document["constraints"].insert(place, document.pop("collision"))
    order = [*LIMITS[:place], clear, *LIMITS[place:]]
    description["certificate"]["problem"] = conditions_digest(plan.problem, order)
    description["digest"] = file_digest(description, arrays)
    write_archive(tmp_path / "former.npz", description, arrays)
    again = sm.load_plan(tmp_path / "former.npz")
    assert again.certificate == plan.certificate
    assert again.check() == plan.certificate
    again.save(tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == (tmp_path / "now.npz").read_bytes()
    sm.files.write_problem(plan.problem, tmp_path / "now.json")
    table = json.loads((tmp_path / "now.json").read_text())
    table["constraints"].insert(place, {"kind": "Clearance", **table.pop("clearance")})
    (tmp_path / "former.json").write_text(json.dumps(table))
    job = sm.files.read_job(tmp_path / "former.json")
    assert any("give the table [clearance]" in note for note in job.notes)
    assert job.problem.digest == plan.problem.digest


@pytest.mark.parametrize("form", ["toml", "json"])
def test_several_clearances_are_written_and_read(
    panda: sm.RobotModel, panda_circle: Circle, tmp_path: Path, form: str
) -> None:
    several = [sm.constraints.Clearance([ball_beside(panda)], 5e-3), NO_OVERLAP]
    problem, file = panda_circle(clearance=several), tmp_path / f"cell.{form}"
    sm.files.write_problem(problem, file)
    assert sm.read_problem(file).digest == problem.digest
    wrong = file.read_text().replace("radius", "radios")
    file.write_text(wrong)
    with pytest.raises(
        sm.errors.FileFormatError,
        match=r"clearance\[0\]\.obstacles\[0\]\.radios.*clearance\[0\]\.obstacles\[0\]\.radius: is",
    ):
        sm.read_problem(file)


def test_only_pairs_of_the_named_obstacles_are_kept_apart(panda: sm.RobotModel) -> None:
    """More than its own links can be from each other, and no other pair is measured."""
    beside = panda.pose(PANDA_HOME).translation + np.array([0.0, 0.25, 0.0])
    boxes = [
        sm.obstacles.Box("clamp", beside, [0.05, 0.05, 0.2]),
        sm.obstacles.Box("roof", [0.3, 0.0, 1.6], [1.0, 1.0, 0.02]),
        sm.obstacles.Box("torch", [0.0, 0.0, 0.05], [0.02, 0.02, 0.1], frame="panda_hand"),
    ]
    every = sm.constraints.Clearance(boxes, 0.05)
    clearance = sm.constraints.Clearance(boxes, 0.05, only=("clamp",))
    pairs = clearance.model(panda).pairs
    assert pairs == tuple(pair for pair in every.model(panda).pairs if "clamp" in pair)
    assert any("torch" in pair for pair in pairs)
    assert every.keeps_as_far(clearance)
    assert not clearance.keeps_as_far(every)
    described = clearance.to_dict()
    del described["kind"]
    assert sm.constraints.Clearance.from_dict(described).only == ("clamp",)
    path = short_line(panda, PANDA_HOME)
    plan = sm.plan(sm.Problem(panda, path, start=PANDA_HOME, clearance=clearance))
    assert plan.certificate.verified, plan.certificate.verdict
    assert plan.approaches["clamp"].value >= 0.05
    with pytest.raises(sm.errors.ProblemError, match="only has 'door', which is none of its obst"):
        sm.constraints.Clearance(boxes, only=("door",))
    with pytest.raises(sm.errors.ProblemError, match="expected names of obstacles"):
        sm.constraints.Clearance(boxes, only="clamp")  # type: ignore[arg-type]


def test_obstacles_with_a_distance_of_their_own_have_a_clearance_of_their_own() -> None:
    """Each pair of bodies that may meet is in one of them, at the distance of its obstacle."""
    boxes = [
        sm.obstacles.Box("clamp", [0.5, 0.2, 0.2], [0.1, 0.1, 0.1]),
        sm.obstacles.Box("post", [0.5, -0.4, 0.2], [0.1, 0.1, 0.1]),
        sm.obstacles.Box("torch", [0.0, 0.0, 0.1], [0.1, 0.1, 0.1], frame="panda_hand"),
    ]
    disabled = (("clamp", "torch"), ("post", "panda_link1"), ("panda_link5", "panda_link7"))
    given = sm.constraints.Clearance(boxes, 0.005, disabled=disabled)
    rest, apart = with_own_distances(given, {"clamp": 0.02})
    assert [item.name for item in rest.obstacles] == ["post", "torch"]
    assert (rest.distance, rest.disabled, rest.only) == (0.005, disabled[1:], ())
    # What stands does not come near to what stands.
    assert [item.name for item in apart.obstacles] == ["clamp", "torch"]
    assert (apart.distance, apart.disabled, apart.only) == (0.02, disabled[:1], ("clamp",))
    assert with_own_distances(given, {"door": 0.02}) == (given,)
    with pytest.raises(sm.errors.ProblemError, match="is only of post, and obstacle 'clamp' has a"):
        with_own_distances(replace(given, only=("post",)), {"clamp": 0.02})
