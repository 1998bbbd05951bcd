"""A job that is like an earlier one keeps what did not change, and begins at its motions."""

from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
import trimesh

import selfmotion as sm
from selfmotion.basics import silent
from selfmotion.model.task import SE3
from selfmotion.planning.transfer import FreeMotions, free_motion
from selfmotion.work.job import work
from selfmotion.work.job.earlier_program import EarlierProgram
from selfmotion.work.job.result_cache import ResultCache
from support.arms import robot_named

DOWN = np.diag([1.0, -1.0, -1.0])
HOME = np.array(sm.NAMED_ARMS["panda"].home)
# A part that is moved by 20 mm turns no joint by more than this [rad].
NEAR = 0.3


def seams(shift: float = 0.0, count: int = 3) -> list[sm.Seam]:
    """Return parallel seams, all of them moved by a shift [m]."""
    found = []
    # A little aside: of two orders that are mirror images, rounding would choose.
    for k, y in enumerate(np.linspace(-0.2, 0.2, 3)[:count] + 1e-4):
        ends = [SE3(DOWN, np.array([x, y + shift, 0.3])) for x in (0.4, 0.52)]
        found.append(sm.Seam(f"seam {k}", sm.paths.Line(*ends, 1.0), "pointing"))
    return found


@pytest.fixture(scope="module")
def program() -> sm.Program:
    panda = robot_named("panda")
    return sm.plan_job(panda, seams(), start=HOME, end=HOME, branches=1).require()


def planned_again(program, listed, **given) -> sm.Program:
    """Return a job planned from an earlier program."""
    return sm.plan_job(
        robot_named("panda"),
        listed,
        start=HOME,
        end=HOME,
        branches=1,
        warm_start=program,
        **given,
    )


def test_of_the_same_job_nothing_is_planned(program, monkeypatch) -> None:
    def never(*_, **__) -> None:
        raise AssertionError("something was planned")

    monkeypatch.setattr(work, "from_start", never)
    monkeypatch.setattr(work, "branches", never)
    monkeypatch.setattr(FreeMotions, "through", never)
    again = planned_again(program, seams()).require()
    assert again.order == program.order
    np.testing.assert_array_equal(again.trajectory.q, program.trajectory.q)
    np.testing.assert_array_equal(again.trajectory.t, program.trajectory.t)


def test_a_part_that_was_moved_is_made_near_the_earlier_motions(program) -> None:
    again = planned_again(program, seams(0.02)).require()
    assert again.order == program.order
    for step, before in zip(again.steps, program.steps, strict=True):
        assert step.turned == before.turned
        shares = np.linspace(0.0, 1.0, 9)
        q, known = (one.motion(shares * one.motion.t[-1]) for one in (step, before))
        assert np.abs(q - known).max() < NEAR
    # Nothing of the earlier part is left: each seam is where it is asked for now.
    for seam in seams(0.02):
        plan = again.plans[seam.name]
        tip = plan.robot.pose(plan.trajectory.q[0]).translation
        ends = [seam.path.pose(t).translation for t in (0.0, seam.path.duration)]
        assert min(np.abs(tip - end).max() for end in ends) < 1e-6


def test_of_other_seams_those_that_are_known_are_kept(program) -> None:
    fewer = planned_again(program, seams(count=2)).require()
    assert set(fewer.order) == {"seam 0", "seam 1"}
    more = planned_again(fewer, seams()).require()
    assert set(more.order) == set(program.order)
    for name in fewer.order:
        kept, known = more.plans[name].trajectory, fewer.plans[name].trajectory
        np.testing.assert_array_equal(kept.q, known.q)


def same_motion(one: sm.Plan, other: sm.Plan) -> bool:
    parts = ("t", "q", "qd")
    return all(
        np.array_equal(getattr(one.trajectory, part), getattr(other.trajectory, part))
        for part in parts
    )


@pytest.mark.parametrize("change", ["moved", "added", "removed"])
def test_what_did_not_change_is_kept_bit_for_bit(program, tmp_path, change: str) -> None:
    """From the file, in its direction; and it says what was kept, and why the rest was not."""
    program.save(tmp_path / "job.program")
    loaded, listed = sm.load_program(tmp_path / "job.program"), seams()
    if change == "moved":
        listed[1] = seams(0.03)[1]
    elif change == "added":
        more = replace(seams(0.03)[0], name="more")
        listed = [listed[0], more, *listed[1:]]
    else:
        listed.pop(1)
    again = planned_again(loaded, listed).require()
    same = {seam.name for seam in listed} - {"more"} - ({"seam 1"} if change == "moved" else set())
    turned = {step.name: step.turned for step in program.steps}
    for step in again.steps:
        if step.name in same:
            assert same_motion(step.made, program.plans[step.name])
            assert step.turned == turned[step.name]
    others = {"moved": {"seam 1": "its path is another"}, "removed": {}}.get(
        change, {"more": "the earlier program does not make it"}
    )
    assert again.kept == {**dict.fromkeys(same, ""), **others}
    count = len(listed)
    assert again.kept_told[0] == f"kept as they were: {len(same)} of {count} seams"
    assert len(again.kept_told) == 1 + len(others)


def test_of_what_is_asked_otherwise_it_says_why(program) -> None:
    first, second, third = seams()
    listed = [
        replace(first, constraints=[sm.constraints.JointVelocityLimits(2.0)]),
        replace(second, costs=[sm.costs.JointVelocity(2.0)]),
        replace(third, relaxations=[sm.Relaxation("z", band=1e-3)]),
    ]
    again = planned_again(program, listed).require()
    assert again.kept == {
        "seam 0": "its constraints are others",
        "seam 1": "its costs are others",
        "seam 2": "its tolerances are others",
    }
    assert planned_again(program, seams()).kept == dict.fromkeys(program.order, "")
    # A program that was not begun at another one has nothing to say.
    assert program.kept is None
    assert program.kept_told == ()


def test_what_is_kept_is_given_up_only_where_no_program_comes_of_it(program, monkeypatch) -> None:
    """Then the other direction is tried, and it says why."""
    between = FreeMotions.between
    begins = {step.motion.q[0].tobytes() for step in program.steps if step.is_seam}

    def to_no_kept_start(self, first, last, seconds, known=None):
        if last.tobytes() in begins:
            return sm.Move(self.robot, self.constraints, None, "not there")
        return between(self, first, last, seconds, known)

    monkeypatch.setattr(FreeMotions, "between", to_no_kept_start)
    monkeypatch.setattr(work, "serves", lambda *_: False)
    again = planned_again(program, seams()).require()
    turned = {step.name: step.turned for step in program.steps}
    for step in again.steps:
        if step.is_seam:
            assert step.turned != turned[step.name]
            assert again.kept[step.name].startswith("no program comes of what could be kept: ")


def test_a_seam_that_cannot_begin_there_is_planned_like_any_other(program, monkeypatch) -> None:
    monkeypatch.setattr(work, "like_before", lambda *_: None)
    again = planned_again(program, seams(0.02)).require()
    assert set(again.order) == set(program.order)


@pytest.mark.site
def test_where_no_program_comes_of_it_all_is_planned_anew(program, monkeypatch) -> None:
    panda = robot_named("panda")
    cold = sm.plan_job(panda, seams(0.02), start=HOME, end=HOME, branches=1)
    # Moves that nobody finds, as long as something is begun at what is known.
    found = FreeMotions.between

    def between(self, first, last, seconds, known=None):
        if known is not None:
            return sm.Move(self.robot, self.constraints, None, "not this way")
        return found(self, first, last, seconds)

    monkeypatch.setattr(FreeMotions, "between", between)
    again = planned_again(program, seams(0.02)).require()
    np.testing.assert_array_equal(again.trajectory.q, cold.trajectory.q)


def test_bodies_whose_file_has_changed_are_looked_at_anew(tmp_path, monkeypatch) -> None:
    """A motion that was kept clear of a mesh is not of what its file holds by now."""
    panda, file = robot_named("panda"), tmp_path / "part.stl"

    def clear_of(size) -> sm.constraints.Clearance:
        trimesh.creation.box(size).export(file)
        part = sm.obstacles.Mesh("part", SE3(np.eye(3), np.array([0.45, 0.0, 0.1])), file)
        return sm.constraints.Clearance([part], distance=0.0)

    def planned(apart, **given) -> sm.Program:
        return sm.plan_job(panda, seams(count=1), start=HOME, branches=1, clearance=apart, **given)

    low, high = [0.1, 0.1, 0.1], [0.3, 0.6, 0.6]
    before = planned(clear_of(low)).require()
    again = planned(clear_of(low), warm_start=before).require()
    np.testing.assert_array_equal(again.trajectory.q, before.trajectory.q)
    # Nothing else is tried than what is known.
    monkeypatch.setattr(work, "branches", lambda *_: ([], "nothing else is tried"))
    monkeypatch.setattr(
        FreeMotions,
        "through",
        lambda self, *_: sm.Move(self.robot, self.constraints, None, "nothing else"),
    )
    with pytest.raises(sm.errors.PlanError, match="nothing else is tried"):
        planned(clear_of(high), warm_start=before)
    # Nor is a move kept that goes through it.
    apart = clear_of(high)
    asked = work.JobSettings(panda, (), (apart,), 1, 1.0, 0)
    at_work = work.Work(
        asked, ResultCache(None, sm.Tolerance(), {}), None, silent, EarlierProgram(before)
    )
    move = next(step.made for step in before.steps if not step.is_seam)
    (found,) = at_work.moves([(*move.motion.q[[0, -1]], ())], ["move"])
    assert not found.verified


def test_other_costs_are_planned_for(program) -> None:
    """A motion that is best by other costs is not kept for nothing having moved."""
    costs = [sm.costs.JointVelocity([1.0, 50.0, 1.0, 1.0, 1.0, 1.0, 1.0])]
    other = [replace(seam, costs=costs) for seam in seams()]
    again = planned_again(program, other).require()
    for name, plan in again.plans.items():
        assert plan.problem.costs[0] is costs[0]
        known = program.plans[name].trajectory
        assert len(plan.trajectory.t) != len(known.t) or np.any(plan.trajectory.q != known.q)


def test_another_process_comes_to_the_same_program(program) -> None:
    here = planned_again(program, seams(0.02))
    with ProcessPoolExecutor(1) as executor:
        there = planned_again(program, seams(0.02), executor=executor)
    np.testing.assert_array_equal(there.trajectory.q, here.trajectory.q)


def test_a_way_that_is_known_is_taken_where_it_is_free(monkeypatch) -> None:
    panda = robot_named("panda")
    # Between these the straight leg goes through the post.
    aside = np.array([0.8, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    first, last = HOME + aside, HOME - aside
    post = sm.obstacles.Cylinder("post", [0.35, 0.0, 0.5], 0.04, 1.0)
    asked = [
        sm.constraints.JointPositionLimits(),
        sm.constraints.JointVelocityLimits(),
        sm.constraints.Clearance((post,)),
    ]
    free = FreeMotions(panda, asked, np.random.default_rng(0))
    # Back, round behind the post, and out again.
    back = np.array([0.0, -0.8, 0.0, 0.0, 0.0, 0.0, 0.0])
    polyline = np.stack([first, first + back, last + back, last])
    looked = []
    found = free_motion.find_path

    def find_path(*given):
        looked.append(given)
        return found(*given)

    monkeypatch.setattr(free_motion, "find_path", find_path)
    free.between(first, last, known=polyline).require()
    assert not looked
    # One that is blocked is not taken: others are looked for.
    through = np.stack([first, 0.5 * (first + last), last])
    free.between(first, last, known=through).require()
    assert looked


@pytest.mark.parametrize("given", ["job.program", None])
def test_what_is_no_program_of_the_arm_is_refused(program, given) -> None:
    if given is not None:
        with pytest.raises(
            sm.errors.ProblemError, match="expected a Program; load_program reads one"
        ):
            planned_again(given, seams())
        return
    xarm = robot_named("xarm7")
    with pytest.raises(sm.errors.ProblemError, match="warm_start: its joints are panda_joint1"):
        sm.plan_job(xarm, seams(), warm_start=program)
