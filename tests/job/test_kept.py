"""What a job keeps is measured again, whole and ours, or planned again."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.model.task import SE3
from selfmotion.work.job import Step, backwards
from selfmotion.work.job.result_cache import ResultCache
from selfmotion.work.job.seam import backwards_plan
from support.arms import robot_named

DOWN = np.diag([1.0, -1.0, -1.0])
HOME = np.array(sm.NAMED_ARMS["panda"].home)


def line(first, last, seconds: float = 1.0) -> sm.paths.Path:
    return sm.paths.Line(SE3(DOWN, np.array(first)), SE3(DOWN, np.array(last)), seconds)


SEAMS = [
    sm.Seam("one", line([0.4, -0.1, 0.3], [0.5, -0.1, 0.3]), "pointing", either_way=False),
    sm.Seam("two", line([0.4, 0.1, 0.3], [0.5, 0.1, 0.3]), "pointing", either_way=False),
]
ASKED = {"branches": 1, "start": HOME, "end": HOME}


@pytest.fixture(scope="module")
def kept(tmp_path_factory) -> tuple[Path, sm.Program]:
    """A folder of a job that is finished, and its program."""
    folder = tmp_path_factory.mktemp("kept")
    return folder, sm.plan_job(robot_named("panda"), SEAMS, folder=folder, **ASKED).require()


def again(folder: Path) -> sm.Program:
    return sm.plan_job(robot_named("panda"), SEAMS, folder=folder, **ASKED)


def bent(plan: sm.Plan) -> sm.Plan:
    """Return a plan with a smooth bump of one joint, and a certificate that says otherwise."""
    motion = plan.trajectory
    t = motion.t
    x, w = np.pi * t / t[-1], np.pi / t[-1]
    q, qd, qdd = (np.array(motion(t, order)) for order in range(3))
    q[:, 3] += 0.05 * np.sin(x) ** 6
    qd[:, 3] += 0.3 * w * np.sin(x) ** 5 * np.cos(x)
    qdd[:, 3] += 0.05 * w**2 * (30 * np.sin(x) ** 4 * np.cos(x) ** 2 - 6 * np.sin(x) ** 6)
    other = sm.Trajectory(t, q, qd, motion.joint_names, qdd)
    # Who writes files knows digests as well.
    said = replace(plan.certificate, motion=other.digest)
    return replace(plan, trajectory=other, certificate=said)


def swapped(folder: Path, kind: str) -> None:
    one, other = sorted(folder.glob(f"{kind}*.npz"))[:2]
    data = one.read_bytes()
    one.write_bytes(other.read_bytes())
    other.write_bytes(data)


def truncated(folder: Path) -> None:
    for file in folder.glob("*.npz"):
        file.write_bytes(file.read_bytes()[:-100])


def turned_about(folder: Path) -> None:
    """Put what is known of one seam under the name of another."""
    one, other = sorted(folder.glob("seam*.json"))[:2]
    shutil.copy(one, other)


def touched(folder: Path) -> None:
    for file in folder.glob("*.npz"):
        arrays = dict(np.load(file))
        np.savez(file, **{**arrays, "q": arrays["q"] + 1e-12})


def loosened(folder: Path) -> None:
    """Say of each plan that it may be anywhere, with a digest that fits."""
    for file in folder.glob("seam*.npz"):
        plan = sm.load_plan(file)
        certificate = plan.check(sm.Tolerance(1.0, 1.0))
        bent(replace(plan, certificate=certificate)).save(file)


def given_up(folder: Path) -> None:
    """Say of each move that there is none, as another job did, or of each seam."""
    for file in folder.glob("move*.json"):
        file.write_text(json.dumps(json.loads(file.read_text()) | {"trouble": "not found"}))
    for file in folder.glob("seam*.json"):
        file.write_text(json.dumps(json.loads(file.read_text()) | {"digests": []}))


def lied(folder: Path) -> None:
    for file in folder.glob("seam*.npz"):
        bent(sm.load_plan(file)).save(file)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda folder: swapped(folder, "seam"),
        lambda folder: swapped(folder, "move"),
        truncated,
        turned_about,
        touched,
        loosened,
        given_up,
        lied,
    ],
    ids=["plans", "moves", "truncated", "names", "touched", "loosened", "given-up", "lied"],
)
def test_what_was_spoilt_is_planned_again(kept, tmp_path: Path, spoil) -> None:
    folder, program = kept
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    spoil(tmp_path)
    found = again(tmp_path).require()
    np.testing.assert_array_equal(found.trajectory.q, program.trajectory.q)
    # And kept, so that the next one takes what it finds.
    times = {file.name: file.stat().st_mtime_ns for file in tmp_path.glob("*.npz")}
    assert again(tmp_path).verified
    assert times == {file.name: file.stat().st_mtime_ns for file in tmp_path.glob("*.npz")}


def test_what_does_not_apply_to_an_arm_is_not_missed(tmp_path: Path) -> None:
    """Of an arm without published jerks, moves are kept as those of any other."""
    ur5, ends = robot_named("ur5"), np.array([[0.3, 0.1], [0.4, 0.1], [0.4, -0.1], [0.3, -0.1]])
    places = [(x, y, 0.3) for x, y in ends.tolist()]
    seams = [
        sm.Seam("one", line(*places[:2]), "pointing", either_way=False),
        sm.Seam("two", line(*places[2:]), "pointing", either_way=False),
    ]

    def planned() -> dict[str, int]:
        sm.plan_job(ur5, seams, folder=tmp_path, branches=1).require()
        return {file.name: file.stat().st_mtime_ns for file in tmp_path.glob("move*.npz")}

    first = planned()
    assert first
    assert planned() == first


def test_another_plan_of_the_same_problem_is_not_what_was_kept(kept, tmp_path: Path) -> None:
    """Two that begin elsewhere are both sound: only what was written with them tells them apart."""
    _, program = kept
    plan = program.plans["one"]
    cache = ResultCache(tmp_path, sm.Tolerance(), {})
    files = [tmp_path / f"nearby-one.{key}.json" for key in ("a", "b")]
    for number, file in enumerate(files):
        other = replace(plan, coefficients=np.full(1, float(number)))
        cache.store_plans(file, ([other], ""))
    assert cache.plans(files[0], plan.problem) is not None
    swapped(tmp_path, "nearby")
    assert [cache.plans(file, plan.problem) for file in files] == [None, None]
    # Nor where all of one is put in the place of the other, by its name.
    swapped(tmp_path, "nearby")
    (archive, _), said = sorted(tmp_path.glob("*.npz")), files[1].read_text()
    shutil.copy(archive, archive.with_name(archive.name.replace(".a.", ".b.")))
    assert cache.plans(files[0], plan.problem) is not None
    files[1].write_text(files[0].read_text().replace("nearby-one.a", "nearby-one.b"))
    assert files[1].read_text() != said
    assert cache.plans(files[1], plan.problem) is None


def test_another_version_plans_again(kept, tmp_path: Path, monkeypatch) -> None:
    folder, _ = kept
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    count = len(list(tmp_path.glob("*.json")))
    monkeypatch.setattr("selfmotion.planning.result.archive.version", lambda: "another")
    assert again(tmp_path).verified
    assert len(list(tmp_path.glob("*.json"))) > count


def test_a_program_is_of_the_tool_the_reference_and_the_tolerance_that_were_asked(kept) -> None:
    _, program = kept
    flange = sm.load_robot("panda", tool="panda_link8")
    other = sm.plan_job(flange, SEAMS, **ASKED)
    mixed = replace(program, steps=other.steps)
    assert "its tool is 'panda_link8', not 'panda_hand_tcp'" in mixed.verdict
    # Nor where all of it is of that tool.
    assert "with tool 'panda_link8' is not what was asked" in replace(mixed, robot=flange).verdict
    asked = program.specification
    finer = replace(program, specification=replace(asked, tolerance=sm.Tolerance(1e-9, 1e-9)))
    assert "it is judged within 1e-06 m" in finer.verdict
    looser = replace(program, specification=replace(asked, tolerance=sm.Tolerance(1e-3, 1e-3)))
    assert "(1 mm and 1 mrad are allowed)" in looser.verdict
    assert "rad off the path" in program.verdict


def test_what_happens_on_a_move_was_asked_for_by_nobody(kept) -> None:
    _, program = kept
    far = sm.obstacles.Box("far", [0.0, 0.0, 3.0], [0.1, 0.1, 0.1])
    for changes, said in (({"events": (("arc on", 0.1),)}, "arc on"), ({"leaves": (far,)}, "far")):
        first = replace(program.steps[0], **changes)
        verdict = replace(program, steps=(first, *program.steps[1:])).verdict
        assert f"'{first.name}' has '{said}', which was not asked of a move" in verdict


def test_a_seams_own_clearance_is_kept_besides_that_of_the_job() -> None:
    far = sm.constraints.Clearance(
        [sm.obstacles.Box("far", [0.0, 0.8, 0.6], [0.1, 0.1, 1.2])], 0.01
    )
    post = sm.constraints.Clearance(
        [sm.obstacles.Box("post", [0.0, -0.6, 0.6], [0.1, 0.1, 1.2])], 0.01
    )
    own = replace(SEAMS[0], constraints=[far])
    made = sm.plan_job(robot_named("panda"), [own], clearance=post, **ASKED).require()
    bodies = {item.name for item in made.plans["one"].obstacles}
    assert bodies == {"far", "post"}


def test_all_bodies_are_kept_as_far_as_was_asked_by_one_clearance() -> None:
    """One that keeps as far from nothing, and one that hardly keeps from all, are not enough."""
    post = sm.obstacles.Box("post", [0.0, -0.6, 0.6], [0.1, 0.1, 1.2])
    asked = sm.constraints.Clearance([post], 0.02)

    def step(*judged: sm.constraints.Clearance) -> Step:
        return Step("one", sm.Move(robot_named("panda"), judged, None, "none"))

    assert step(
        sm.constraints.Clearance([], 0.02), sm.constraints.Clearance([post], 0.0)
    ).unchecked({"post": post}, asked)
    assert not step(sm.constraints.Clearance([post], 0.03)).unchecked({"post": post}, asked)


def test_a_job_keeps_each_of_several_clearances(tmp_path: Path) -> None:
    """Every seam and move by its own distance; what is left behind by that of the first."""
    post, clamp, left = (
        sm.obstacles.Box(name, place, [0.1, 0.1, 0.1])
        for name, place in (
            ("post", [0.0, -0.6, 0.6]), ("clamp", [0.0, 0.8, 0.6]), ("left", [0.45, -0.4, 0.05]),
        )
    )  # fmt: skip
    near, far = sm.constraints.Clearance([post], 0.01), sm.constraints.Clearance([clamp], 0.02)
    seams = [replace(SEAMS[0], leaves=[left]), replace(SEAMS[1], after=["one"])]
    robot = robot_named("panda")
    program = sm.plan_job(robot, seams, clearance=[near, far], **ASKED).require()
    asked = {0.01: {"post"}, 0.02: {"clamp"}}
    for number, step in enumerate(program.steps):
        if number and program.steps[number - 1].name == "one":
            asked = {0.01: {"post", "left"}, 0.02: {"clamp"}}
        each = [item for item in step.constraints if isinstance(item, sm.constraints.Clearance)]
        assert {item.distance: {body.name for body in item.obstacles} for item in each} == asked
    program.save(tmp_path / "program.npz")
    again = sm.load_program(tmp_path / "program.npz")
    assert again.verified
    given = {"warm_start": again, **ASKED}
    same = sm.plan_job(robot, seams, clearance=[near, far], **given)
    for name, plan in same.plans.items():
        np.testing.assert_array_equal(plan.trajectory.q, program.plans[name].trajectory.q)
    # Each of them is asked for: a step that is not judged by one of them is told.
    for gone in (near, far):
        first = program.steps[0]
        rest = tuple(
            item for item in first.made.constraints
            if getattr(item, "distance", None) != gone.distance
        )  # fmt: skip
        steps = (replace(first, made=replace(first.made, constraints=rest)), *program.steps[1:])
        name = gone.obstacles[0].name
        assert f"is not checked against '{name}'" in replace(program, steps=steps).verdict
    farther = [near, replace(far, distance=0.021)]
    other = sm.plan_job(robot, seams, clearance=farther, **given)
    assert other.verified
    assert "what the job is kept clear of is another" in str(other.kept)


@pytest.mark.parametrize("pair", [(), (("panda_hand", "panda_link5"),)])
def test_a_clearance_of_a_seam_comes_beside_that_of_the_job(pair: tuple[tuple[str, str]]) -> None:
    """Also where it leaves out a pair: the job's holds for all pairs. Else one judges both."""
    post = sm.obstacles.Box("post", [0.0, -0.6, 0.6], [0.1, 0.1, 0.1])
    own = sm.constraints.Clearance([post], 0.01, disabled=pair)
    seams = [replace(SEAMS[0], constraints=[own]), SEAMS[1]]
    made = sm.plan_job(robot_named("panda"), seams, **ASKED).require()
    assert len(made.plans["one"].problem.clearances) == (2 if pair else 1)
    alone = replace(made.plans["one"].problem, clearance=own)
    steps = [
        replace(step, made=replace(step.made, problem=alone)) if step.name == "one" else step
        for step in made.steps
    ]
    assert replace(made, steps=tuple(steps)).verified == (not pair)


def test_bodies_of_one_name_are_refused_before_anything_is_planned() -> None:
    """Of two clearances in two places; and one that a seam leaves, and a clearance has."""
    post, other = (sm.obstacles.Box("post", [0.0, y, 0.6], [0.1, 0.1, 0.1]) for y in (-0.6, 0.8))
    near, far = sm.constraints.Clearance([post], 0.01), sm.constraints.Clearance([other], 0.02)
    robot = robot_named("panda")
    with pytest.raises(sm.errors.ProblemError, match="two different bodies are called 'post'"):
        sm.plan_job(robot, SEAMS, clearance=[near, far], **ASKED)
    leaving = [replace(SEAMS[0], leaves=[other]), SEAMS[1]]
    with pytest.raises(sm.errors.ProblemError, match="'post' is an obstacle of the clearance"):
        sm.plan_job(robot, leaving, clearance=near, **ASKED)


def test_what_is_left_behind_takes_no_obstacles_place() -> None:
    """A file may say so: the obstacle would be there, and no later step be checked against it."""
    post, other, far = (
        sm.obstacles.Box(name, place, [0.1, 0.1, 0.1])
        for name, place in (
            ("post", [0.0, -0.6, 0.6]), ("other", [0.0, 0.0, 3.0]), ("post", [0.0, 0.0, 3.0]),
        )
    )  # fmt: skip
    leaving = replace(SEAMS[0], leaves=[other])
    clear = sm.constraints.Clearance([post], 0.01)
    made = sm.plan_job(robot_named("panda"), [leaving], clearance=clear, **ASKED).require()
    renamed = replace(leaving, leaves=[far])
    *before, last = (replace(step, leaves=(far,) if step.leaves else ()) for step in made.steps)
    others = [item for item in last.constraints if not isinstance(item, type(clear))]
    elsewhere = (*others, sm.constraints.Clearance([far], 0.01))
    steps = (*before, replace(last, made=replace(last.made, constraints=elsewhere)))
    wanted = replace(made.specification, seams=(renamed,))
    verdict = replace(made, steps=steps, specification=wanted).verdict
    assert "'one' leaves 'post', and another body has this name" in verdict


@pytest.mark.parametrize("limit", [1.2, 1.262, 1.28])
def test_a_seam_whose_limits_bind_rests_at_its_ends(limit: float) -> None:
    """Its first polynomial begins without acceleration, and so the program is verified."""
    path = line([0.3, -0.3, 0.3], [0.6, 0.1, 0.3], 1.3)
    asked = [sm.constraints.JointVelocityLimits(np.full(7, limit))]
    seam = sm.Seam("a", path, task="pointing", constraints=asked, either_way=False)
    program = sm.plan_job(robot_named("panda"), [seam], **ASKED).require()
    motion = program.plans["a"].trajectory
    s = np.linspace(0.0, motion.t[1], 41)
    pieces = (np.polynomial.Polynomial.fit(s, q, 5).convert() for q in motion(s).T)
    assert 2.0 * max(abs(piece.coef[2]) for piece in pieces) < 1e-6


def test_a_turned_plan_tells_the_times_of_its_own_direction() -> None:
    limit = 1.2
    path = line([0.3, -0.3, 0.3], [0.6, 0.1, 0.3], 1.3) + sm.paths.Dwell(
        SE3(DOWN, np.array([0.6, 0.1, 0.3])), 1.0
    )
    asked = [sm.constraints.JointVelocityLimits(np.full(7, limit))]
    plan = sm.plan(
        sm.Problem(robot_named("panda"), path, "pointing", constraints=asked, clearance=None)
    )
    turned = backwards_plan(plan, backwards(plan.problem)).require()
    spans = [span for item in turned.report.active for span in item.spans]
    assert spans
    for first, last in spans:
        t = np.linspace(first, last, 5)
        assert np.abs(turned.trajectory(t, 1)).max() > 0.95 * limit
    assert all(last > 1.0 for _, last in spans)
    # -ε(T - t) at the nodes of the other direction.
    times = np.array(turned.report.null_motion.times)
    np.testing.assert_allclose(times, 1.0 - np.array(plan.report.null_motion.times)[::-1])
    shape = (7, -1)
    np.testing.assert_array_equal(
        turned.coefficients.reshape(shape), -plan.coefficients.reshape(shape)[:, ::-1]
    )
