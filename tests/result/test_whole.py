"""A certificate belongs to one motion of one problem, and a whole is more than its pieces."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.model.task import SE3
from selfmotion.planning.result import CheckedMotion, MotionSpecification, continuity_faults
from selfmotion.planning.result.equality import same_path
from selfmotion.planning.result.plan import views
from support.arms import robot_named

# A bump of the path: far above what paths that are one may differ by [m].
BUMP = 1e-6


def toward(first: SE3, seconds: float) -> sm.paths.Path:
    """Return a straight line from a pose, of so many seconds."""
    last = SE3(first.rotation, first.translation + np.array([-0.3, 0.1, 0.0]))
    return sm.paths.Line(first, last, seconds)


@pytest.fixture(scope="module")
def plan() -> sm.Plan:
    robot = robot_named("planar_3r")
    start = np.array([0.1, 0.9, 0.9])
    line = toward(robot.pose(start), 2.0)
    return sm.plan(sm.Problem(robot, line, "planar", start)).require()


def by(plan: sm.Plan, times: int) -> sm.Plan:
    """Return a plan with its motion sampled otherwise."""
    return replace(plan, trajectory=plan.trajectory.sample(times))


def test_a_plan_with_another_motion_has_no_certificate(plan: sm.Plan, tmp_path: Path) -> None:
    coarse = by(plan, 2)
    assert coarse.certificate.verdict.startswith("not verified: its certificate is of another")
    for attempt in (
        coarse.require,
        lambda: coarse.save(tmp_path / "a.npz"),
        lambda: sm.files.write_motion(coarse, tmp_path / "a.csv"),
    ):
        with pytest.raises(sm.errors.PlanError, match="of another motion or problem"):
            attempt()
    assert not list(tmp_path.iterdir())
    # What is judged again is what it is.
    again = replace(coarse, certificate=coarse.check())
    assert again.certificate.motion == coarse.trajectory.digest != plan.trajectory.digest
    assert "off the path" in again.certificate.verdict


def test_a_plan_of_another_problem_has_no_certificate(plan: sm.Plan) -> None:
    problem = plan.problem
    slower = replace(
        problem, constraints=[*problem.constraints, sm.constraints.JointVelocityLimits(1.0)]
    )
    other = replace(plan, problem=slower)
    assert not other.certificate.verified
    assert replace(other, certificate=other.check()).certificate.problem == slower.digest
    # Nor can that of another problem be handed over.
    assert not replace(other, certificate=plan.certificate).certificate.verified
    # What no certificate judges does not count.
    dearer = replace(problem, costs=[sm.costs.JointVelocity(weight=2.0)])
    assert replace(plan, problem=dearer).certificate.verified
    assert plan.certificate.version


def test_everything_that_is_judged_is_in_the_digest_of_a_problem(plan: sm.Plan) -> None:
    problem = plan.problem
    longer = toward(problem.path.pose(0.0), 2.0 + 1e-12)
    others = [
        replace(problem, path=longer),
        replace(problem, rest=False),
        replace(problem, constraints=[]),
        replace(problem, constraints=[sm.constraints.JointVelocityLimits(1.0)]),
        replace(problem, constraints=[sm.constraints.JointVelocityLimits(1.0 + 1e-15)]),
        replace(problem, relaxations=[sm.Relaxation("x", 0.01)]),
        replace(problem, damping=sm.Damping()),
        # What limits of one's own are held against besides.
        *(
            replace(problem, robot=replace(problem.robot, **{f"{rate}_limit": np.full(3, 7.0)}))
            for rate in ("velocity", "acceleration", "jerk", "effort")
        ),
        sm.Problem(robot_named("planar_3r"), problem.path, "position", problem.start)
        if robot_named("planar_3r").can_follow("position")
        else replace(problem, relaxations=[sm.Relaxation("y", 0.01)]),
    ]
    digests = [problem.digest, *(item.digest for item in others)]
    assert len(set(digests)) == len(digests)
    assert replace(problem, costs=[sm.costs.JointVelocity(weight=3.0)]).digest == problem.digest
    assert replace(problem, start=None).digest not in digests


def test_a_motion_that_begins_elsewhere_than_at_the_given_start_is_not_verified(
    plan: sm.Plan,
) -> None:
    """The same motion of the tool, in another configuration: what a file with a start judges."""
    problem = plan.problem
    other = problem.robot.inverse_kinematics(problem.path.pose(0.0), "planar", [2.0, -1.0, -1.0])
    assert np.abs(other - problem.start).max() > 0.1
    made = sm.plan(replace(problem, start=other)).require()
    said = problem.certify(made.trajectory).verdict
    assert said.startswith("not verified: it does not begin at the given start: joint 'joint")
    assert "rad away (1e-05 allowed)" in said
    assert replace(problem, start=None).certify(made.trajectory).verified
    assert not replace(made, problem=problem).certificate.verified
    free = replace(made, problem=replace(problem, start=None))
    parts = sm.Parts(problem, (replace(free, certificate=free.check()),))
    assert "part 1: it does not begin where it was asked to: joint 'joint" in parts.verdict
    assert "rad away (1e-05 allowed); plan it again, from there" in parts.verdict


def test_a_motion_has_one_digest_whatever_made_it() -> None:
    rng = np.random.default_rng(0)
    t, q, qd = np.linspace(0.0, 1.0, 4), rng.normal(size=(4, 3)), rng.normal(size=(4, 3))
    motion = sm.Trajectory(t, q, qd, ("one", "two", "three"))
    assert motion.digest == sm.Trajectory(t.copy(), q + 0.0, qd + 0.0, motion.joint_names).digest
    for field, values in (("t", t), ("q", q), ("qd", qd)):
        changed = np.array(values)
        changed.flat[-1] = np.nextafter(changed.flat[-1], 2.0)
        assert replace(motion, **{field: changed}).digest != motion.digest
    assert replace(motion, qdd=np.zeros((4, 3))).digest != motion.digest


class Bumped(sm.paths.Path, kind="bumped for a test"):
    """A line with a bump that is no longer than a thousandth of it, at a place of its own."""

    def __init__(self, line: sm.paths.Path, at: float, height: float) -> None:
        self.line, self.at, self.height, self.duration = line, at, height, line.duration

    @property
    def marks(self) -> np.ndarray:
        width = 1e-3 * self.duration
        return np.array([0.0, self.at, self.at + width, self.duration])

    def evaluate(self, t: np.ndarray) -> object:
        found = self.line.samples(t)
        inside = np.clip((t - self.at) / (1e-3 * self.duration), 0.0, 1.0)
        away = self.height * (inside * (1.0 - inside))[:, None] * [1.0, 0.0, 0.0]
        return replace(found, translation=found.translation + away)


def test_a_path_with_a_bump_between_two_looks_is_another(plan: sm.Plan) -> None:
    line = plan.problem.path
    for at in np.random.default_rng(1).uniform(0.1, 1.8, 20):
        assert not same_path(Bumped(line, float(at), BUMP), line)
        assert same_path(Bumped(line, float(at), 0.0), line)


def test_what_a_plan_was_not_judged_by_is_told(plan: sm.Plan) -> None:
    problem = plan.problem
    asked = MotionSpecification(
        problem.robot, problem.path, problem.task, constraints=problem.all_constraints
    )
    assert not list(asked.failures(plan))
    for changes, said in (
        ({"robot": robot_named("panda")}, "another arm"),
        (
            {"robot": replace(problem.robot, acceleration_limit=np.full(3, 7.0))},
            "acceleration of its joint 'joint1' is inf rad/s², not 7",
        ),
        ({"robot": replace(problem.robot, touching=(("a", "b"),))}, "links of it may touch"),
        ({"path": sm.paths.Dwell(problem.path.pose(0.0), 2.0)}, "along another path"),
        ({"task": sm.Task.POSITION}, "its task is"),
        ({"relaxations": [sm.Relaxation("x", 0.01)]}, "other rows are relaxed"),
        (
            {"constraints": [sm.constraints.JointVelocityLimits(1.0)]},
            "not judged by JointVelocityLimits",
        ),
        ({"clearance": sm.constraints.Clearance()}, "the clearance that was asked for"),
        ({"tolerance": sm.Tolerance(1e-8, 1e-8)}, "judged within 1e-06 m"),
    ):
        assert said in "; ".join(replace(asked, **changes).failures(plan)), changes


def test_parts_that_are_not_judged_by_rest_are_not_verified(plan: sm.Plan) -> None:
    asked = plan.problem
    assert sm.Parts(asked, (plan,)).verified
    others = (replace(asked, rest=False), replace(asked, damping=sm.Damping()))
    for problem in others:
        made = replace(plan, problem=problem)
        made = replace(made, certificate=made.check())
        assert made.certificate.verified
        assert "not judged by rest" in sm.Parts(asked, (made,)).verdict
        # But where it was asked for without.
        assert sm.Parts(problem, (made,)).verified


def test_what_was_changed_stays_so_in_another_file(plan: sm.Plan, tmp_path: Path) -> None:
    robot, start = plan.robot, plan.trajectory.q[0]
    move = sm.move(
        robot, start, start + 0.1, constraints=[sm.constraints.JointAccelerationLimits(2.0)]
    )
    for made, load in ((plan, sm.load_plan), (move.require(), sm.files.load_move)):
        made.save(tmp_path / "a.npz")
        arrays = dict(np.load(tmp_path / "a.npz"))
        np.savez(tmp_path / "a.npz", **{**arrays, "q": arrays["q"] * (1.0 + 1e-12)})
        changed = load(tmp_path / "a.npz")
        changed.save(tmp_path / "b.npz")
        again = load(tmp_path / "b.npz")
        again.save(tmp_path / "c.npz")
        for found in (changed, again, load(tmp_path / "c.npz")):
            with pytest.raises(sm.errors.PlanError, match=r"a\.npz was changed after"):
                found.require()
    parts = sm.Parts(plan.problem, (plan,), altered="it was changed")
    parts.save(tmp_path / "a.parts")
    assert sm.files.load_parts(tmp_path / "a.parts").verdict == "not verified: it was changed"


def test_motions_are_in_the_robots_order_of_joints(plan: sm.Plan, tmp_path: Path) -> None:
    """What is joined is joined by columns."""
    motion, names = plan.trajectory, plan.robot.joint_names
    other = motion.of_joints(names[::-1])
    mixed = replace(plan, trajectory=other, initial_trajectory=other)
    for found in (mixed.trajectory, mixed.initial_trajectory):
        assert (found.joint_names, found.digest) == (names, motion.digest)
    assert sm.Parts(plan.problem, (mixed,)).verified
    assert sm.Move(plan.robot, (), other).motion.digest == motion.digest


def test_gaps_are_told_with_joint_amount_unit_and_what_is_allowed(plan: sm.Plan) -> None:
    robot, motion = plan.robot, plan.trajectory
    whole = CheckedMotion("'one'", motion)

    def moved(**changes) -> CheckedMotion:
        return CheckedMotion("'other'", replace(motion, **changes))

    back = replace(motion, q=motion.q[::-1], qd=-motion.qd[::-1], qdd=np.array(motion.qdd)[::-1])
    assert not list(continuity_faults(robot, [whole, CheckedMotion("'back'", back)]))
    rate = np.array(back.qd)
    rate[0, 1] = 2e-6
    push = np.array(back.qdd)
    push[0, 2] = -2e-3
    for piece, said in (
        (moved(q=back.q + 2e-9, qd=back.qd, qdd=back.qdd), "would jump by 2e-09 rad (1e-09"),
        (moved(q=back.q, qd=rate, qdd=back.qdd), "'joint2' moves at 2e-06 rad/s (1e-06"),
        (moved(q=back.q, qd=back.qd, qdd=push), "accelerates at 0.002 rad/s² (0.001"),
    ):
        assert said in "; ".join(continuity_faults(robot, [whole, piece]))
    # Between its samples a cubic among quintics would be another motion.
    cubic = CheckedMotion("'other'", replace(back, qdd=None))
    assert "'other' states no accelerations" in "; ".join(continuity_faults(robot, [whole, cubic]))
    assert not list(
        continuity_faults(robot, [cubic, CheckedMotion("'one'", replace(motion, qdd=None))])
    )
    # But where the tool's own motion accelerates.
    pushed = replace(motion, q=back.q, qd=back.qd, qdd=push)
    assert not list(
        continuity_faults(robot, [whole, CheckedMotion("'feed'", pushed, (True, True))])
    )


def test_a_package_without_what_draws_is_told_to_be_installed_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("selfmotion.planning.result.plan.entry_points", lambda **_: ())
    views.cache_clear()
    with pytest.raises(sm.errors.RenderError, match="install it again"):
        views()
    monkeypatch.undo()
    views.cache_clear()
    assert views()
