"""What users write themselves: judged like ours, saved and loaded, refused when something lacks."""

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import selfmotion as sm
from selfmotion.basics import Array, restore
from selfmotion.model.motion import NullMotion
from selfmotion.shell import testing
from selfmotion.shell.cli import app
from support.arms import PANDA_HOME

LIMITS = (sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits())


@dataclass(frozen=True)
class SlowElbow(sm.constraints.Constraint):
    """|q̇_4| ≤ limit [rad/s], as somebody who read the docstrings would write it."""

    limit: float

    def conditions(self, robot: sm.RobotModel) -> sm.constraints.Conditions:
        return sm.constraints.Conditions(points=(SlowNodes(self.limit),))

    def requirement(self, robot: sm.RobotModel) -> sm.certificate.Requirement:
        return SlowJudge(self.limit)


@dataclass(frozen=True)
class SlowNodes(sm.constraints.BoundConstraint):
    limit: float
    name: str = "slow elbow"
    equality: bool = False
    tolerance: float = 1e-3

    def residual(self, samples: sm.costs.Samples) -> Array:
        return np.abs(samples.qd[samples.nodes][:, 3:4]) / self.limit - 1.0 + 2e-3

    def tangents(self, samples: sm.costs.Samples, motion: sm.constraints.NodeTangents) -> Array:
        signs = np.sign(samples.qd[samples.nodes][:, 3])
        return (signs[:, None] * motion.qd[:, 3] / self.limit)[:, None]

    def describe(self, samples: sm.costs.Samples, row: int, column: int) -> str:
        return f"the elbow turns at {samples.qd[samples.nodes][row, 3]:.3f} rad/s"


@dataclass(frozen=True)
class SlowJudge(sm.certificate.Requirement):
    limit: float
    name: str = "slow elbow"

    def judge(self, motion: sm.certificate.FinishedMotion) -> sm.certificate.Finding:
        speeds = np.abs(motion.qd[:, 3])
        worst = int(np.argmax(speeds))
        time, speed = float(motion.t[worst]), float(speeds[worst])
        text = f"the elbow turns at {speed:.3f} rad/s at t = {time:.3f} s"
        return sm.certificate.Finding(
            self.name, "elbow", time, speed, self.limit, bool(speed <= self.limit), text
        )


@dataclass(frozen=True, eq=False)
class Hop(sm.paths.Path):
    """Up by a height and down again, as a sine."""

    start: Array
    height: float
    duration: float

    def evaluate(self, t: Array) -> sm.paths.PathSamples:
        pose = np.asarray(self.start)
        place, twist = np.tile(pose[:3, 3], (len(t), 1)), np.zeros((len(t), 6))
        rate = np.pi / self.duration
        place[:, 2] += self.height * np.sin(rate * t) ** 2
        twist[:, 2] = self.height * rate * np.sin(2.0 * rate * t)
        return sm.paths.PathSamples(t, place, np.tile(pose[:3, :3], (len(t), 1, 1)), twist)


@dataclass(frozen=True)
class Cosines(NullMotion):
    count: int = 3

    @property
    def fewest_steps(self) -> int:
        return 4 * self.count

    def functions(self, t: Array, duration: float) -> Array:
        return np.cos(np.pi * np.outer(t / duration, np.arange(self.count)))


@dataclass(frozen=True)
class Warmth(sm.costs.Cost):
    """∫ Σ |q̇_i|³ dt."""

    mu: float = 1.0
    name: str = "warmth"

    def value(self, samples: sm.costs.Samples) -> Array:
        return self.mu * np.sum(np.abs(samples.qd) ** 3, axis=1)

    def gradient(self, samples: sm.costs.Samples) -> sm.costs.Partials:
        return sm.costs.Partials(qd=3.0 * self.mu * np.abs(samples.qd) * samples.qd)


@pytest.fixture(scope="module")
def problem() -> sm.Problem:
    panda = sm.load_robot("panda")
    hop = Hop(panda.pose(PANDA_HOME).homogeneous, 0.2, 3.0)
    costs = [sm.costs.JointVelocity(), Warmth(0.5)]
    return sm.Problem(panda, hop, "position", PANDA_HOME, Cosines(), costs)


@dataclass(frozen=True)
class Careless(SlowElbow):
    """Asks the optimiser for nothing, so that only its requirement can tell."""

    def conditions(self, robot: sm.RobotModel) -> sm.constraints.Conditions:
        return sm.constraints.Conditions(points=(SlowNodes(1e3),))


@pytest.fixture(scope="module")
def broken(problem: sm.Problem) -> sm.Plan:
    """A plan whose own constraint is not kept."""
    return sm.plan(dataclasses.replace(problem, constraints=(*LIMITS, Careless(0.02))))


def test_what_is_ones_own_keeps_the_laws(problem: sm.Problem) -> None:
    testing.check_path(problem.path)
    testing.check_cost(Warmth())
    testing.check_null_motion(Cosines())
    testing.check_constraint(SlowElbow(0.3), problem)
    assert sm.plan(problem).require().certificate.verified
    # A null motion of one's own knows no constraints.
    slow = dataclasses.replace(
        problem, null_motion=sm.motion.FreeNullMotion(), constraints=(*LIMITS, SlowElbow(0.3))
    )
    kept = sm.plan(slow).require()
    assert np.abs(kept.trajectory.qd[:, 3]).max() <= 0.3


def test_a_broken_constraint_of_ones_own_is_judged(broken: sm.Plan, tmp_path: Path) -> None:
    """Not verified, `require` raises, and the command line says so with exit code 1."""
    assert not broken.certificate.verified
    assert "not verified: the elbow turns at" in broken.report.message
    assert "the elbow turns at" in broken.certificate.verdict
    with pytest.raises(sm.errors.PlanError, match="the elbow turns at"):
        broken.require()
    (finding,) = (f for f in broken.certificate.findings if f.requirement == "slow elbow")
    assert (finding.requirement, finding.allowed, finding.satisfied) == ("slow elbow", 0.02, False)
    broken.save(tmp_path / "plan.npz")
    result = CliRunner().invoke(app, ["check", str(tmp_path / "plan.npz")])
    assert result.exit_code == 1
    assert "the elbow turns at" in result.output


def test_plans_carry_what_is_ones_own(broken: sm.Plan, tmp_path: Path) -> None:
    broken.save(tmp_path / "plan.npz")
    again = sm.load_plan(tmp_path / "plan.npz").problem
    assert isinstance(again.path, Hop)
    assert again.constraints[-1] == Careless(0.02)
    assert again.costs[-1] == Warmth(0.5)
    assert again.null_motion == Cosines()
    assert again.task is sm.Task.POSITION
    np.testing.assert_array_equal(again.given_start, PANDA_HOME)
    np.testing.assert_array_equal(
        again.path.samples([0.3, 2.0]).translation,
        broken.path.samples([0.3, 2.0]).translation,
    )


def test_code_that_is_not_imported_is_named(
    broken: sm.Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Costs may be missing, since the motion can be judged without; paths and constraints not."""
    file = tmp_path / "plan.npz"
    broken.save(file)
    with monkeypatch.context() as patch:
        patch.delitem(sm.costs.Cost._known, "Warmth")
        lost = sm.load_plan(file)
        assert not lost.check().verified
        with pytest.raises(
            sm.errors.ProblemError, match=r"'warmth' was a Warmth, which .* give it again"
        ):
            sm.plan(lost.problem)
    for family, kind in (
        (sm.paths.Path, "Hop"),
        (sm.constraints.Constraint, "Careless"),
        (NullMotion, "Cosines"),
    ):
        with monkeypatch.context() as patch:
            patch.delitem(family._known, kind)
            with pytest.raises(
                sm.errors.FileFormatError, match=f"kind is '{kind}'.*import its module"
            ):
                sm.load_plan(file)


def test_a_function_as_cost_is_missed_when_it_is_needed(tmp_path: Path) -> None:
    cost = sm.costs.FunctionCost(lambda qd, q, t: np.sum(qd**2, axis=1), name="mine")
    plan = sm.plan(dataclasses.replace(sm.sample_problem(), costs=[cost]))
    plan.save(tmp_path / "plan.npz")
    again = sm.load_plan(tmp_path / "plan.npz")
    assert again.check().verified
    with pytest.raises(sm.errors.ProblemError, match="cost 'mine' was a FunctionCost"):
        sm.plan(again.problem)
    assert sm.plan(dataclasses.replace(again.problem, costs=[cost])).certificate.verified


class NoRequirement:
    def conditions(self, robot: sm.RobotModel) -> sm.constraints.Conditions:
        return sm.constraints.Conditions(points=(SlowNodes(1.0),))


@dataclass(frozen=True)
class EmptyRequirement(SlowElbow, kind="empty"):
    def requirement(self, robot: sm.RobotModel) -> sm.certificate.Requirement:
        return None


def test_a_constraint_that_nothing_judges_is_refused(problem: sm.Problem) -> None:
    with pytest.raises(sm.errors.ProblemError, match=r"is no Constraint; derive a class"):
        dataclasses.replace(problem, constraints=[NoRequirement()])
    half = type("Half", (sm.constraints.Constraint,), {"conditions": NoRequirement.conditions})()
    with pytest.raises(
        sm.errors.ProblemError, match=r"Half does not say what it asks for: give it quant"
    ):
        dataclasses.replace(problem, constraints=[half])
    with pytest.raises(
        sm.errors.ProblemError, match=r"EmptyRequirement: requirement\(\) returned None"
    ):
        dataclasses.replace(problem, constraints=[EmptyRequirement(1.0)])


def test_two_classes_of_one_kind_are_refused() -> None:
    with pytest.raises(TypeError, match="path kind 'line' is taken"):
        type("Line2", (sm.paths.Path,), {"evaluate": Hop.evaluate}, kind="line")


@dataclass(frozen=True)
class WrongGradient(Warmth, kind="wrong gradient"):
    def gradient(self, samples: sm.costs.Samples) -> sm.costs.Partials:
        return sm.costs.Partials(qd=-super().gradient(samples).qd)


@dataclass(frozen=True)
class WritesToSamples(Warmth, kind="writes"):
    def value(self, samples: sm.costs.Samples) -> Array:
        samples.qd[:] = 0.0
        return super().value(samples)


@dataclass(frozen=True, eq=False)
class WrongTwist(Hop, kind="wrong twist"):
    def evaluate(self, t: Array) -> sm.paths.PathSamples:
        return dataclasses.replace(super().evaluate(t), twist=np.zeros((len(t), 6)))


@dataclass(frozen=True)
class Deaf(SlowElbow, kind="deaf"):
    def requirement(self, robot: sm.RobotModel) -> sm.certificate.Requirement:
        return SlowJudge(np.inf)


@dataclass(frozen=True)
class ElbowBand(sm.constraints.Constraint, kind="elbow band"):
    """|q3 + 2 q4| ≤ limit [rad], whose series counts joint 4 as often as it says."""

    limit: float
    times: float

    def quantity(self, robot: sm.RobotModel) -> sm.certificate.Quantity:
        row = np.array([0.0, 0.0, 1.0, 2.0, 0.0, 0.0, 0.0])
        return sm.certificate.Quantity.between(
            "q3 + 2 q4",
            -self.limit,
            self.limit,
            values=lambda q, qd, qdd: q @ row,
            derivatives=lambda q, qd, qdd: (np.tile(row, (len(q), 1)),),
            series=lambda segments: (
                segments.chain().joints[2] + self.times * segments.chain().joints[3]
            ),
        )


class Lazy:
    def minimize(
        self, function: sm.optimise.Function, x0: Array, *_: object, **__: object
    ) -> sm.optimise.Minimum:
        return sm.optimise.Minimum(
            x0, function.value(x0), np.eye(len(x0)), (), sm.optimise.Status.CONVERGED
        )


class Silent:
    """Finds the minimum, and tells nothing of the way."""

    def minimize(
        self, function: sm.optimise.Function, x0: Array, *given: Any, **options: Any
    ) -> sm.optimise.Minimum:
        options["callback"] = None
        found = sm.QuasiNewton().minimize(function, x0, *given, **options)
        return dataclasses.replace(found, history=())


def test_an_optimiser_need_not_tell_of_its_way(problem: sm.Problem) -> None:
    told, untold = (sm.plan(problem, optimizer=one) for one in (sm.QuasiNewton(), Silent()))
    assert untold.report.status is told.report.status is sm.optimise.Status.CONVERGED
    assert untold.report.cost == pytest.approx(told.report.cost, rel=1e-6)


class Nowhere:
    def minimize(
        self, function: sm.optimise.Function, x0: Array, *_: object, **__: object
    ) -> sm.optimise.Minimum:
        return sm.optimise.Minimum(
            np.nan * x0, 0.0, np.eye(len(x0)), (), sm.optimise.Status.CONVERGED
        )


def test_an_optimiser_that_ends_nowhere_is_named(problem: sm.Problem) -> None:
    with pytest.raises(
        sm.errors.ProblemError, match=r"optimizer: Nowhere returned x = .*nan.*, expected"
    ):
        sm.plan(problem, optimizer=Nowhere())


@dataclass(frozen=True)
class OneNumber(SlowNodes):
    """One number for the whole motion, where one for each node is expected."""

    def residual(self, samples: sm.costs.Samples) -> Array:
        return np.asarray(super().residual(samples).max(axis=0, keepdims=True))


@dataclass(frozen=True)
class AsOne(SlowElbow, kind="as one"):
    equality: bool = False

    def conditions(self, robot: sm.RobotModel) -> sm.constraints.Conditions:
        mine = OneNumber(self.limit, equality=self.equality)
        return sm.constraints.Conditions(points=(mine,))


@pytest.mark.parametrize(
    ("equality", "message"),
    [
        (False, r"its residual has shape \(1, 1\), expected a row for each of \d+ nodes"),
        (True, "it is an equality, expected h ≤ 0 at all nodes"),
    ],
)
def test_conditions_that_nodes_cannot_ask_are_refused_by_name(
    problem: sm.Problem, equality: bool, message: str
) -> None:
    asked = dataclasses.replace(
        problem, null_motion=sm.motion.FreeNullMotion(), constraints=[AsOne(0.3, equality)]
    )
    for start in (problem.given_start, None):
        with pytest.raises(sm.errors.ProblemError, match=f"constraint 'slow elbow': {message}"):
            sm.plan(dataclasses.replace(asked, start=start))


def test_checkers_refuse_what_is_wrong(problem: sm.Problem) -> None:
    hop = problem.path
    wrong_path = WrongTwist(hop.start, hop.height, hop.duration)
    for check, message in (
        (lambda: testing.check_cost(WrongGradient()), "gradient is not that of the value"),
        (lambda: testing.check_path(wrong_path), r"velocity is not that .* at t ="),
        (lambda: testing.check_constraint(Deaf(0.3), problem), "accepts every motion"),
        (lambda: testing.check_optimizer(Lazy()), "above the minimum"),
    ):
        with pytest.raises(AssertionError, match=message):
            check()
    with pytest.raises(ValueError, match="read-only"):
        testing.check_cost(WritesToSamples())


def test_a_series_that_is_no_majorant_is_refused(problem: sm.Problem) -> None:
    """What a verdict says with it would be no proof; one that counts too much is only loose."""
    free = dataclasses.replace(problem, constraints=())
    for times in (2.0, 3.0):
        testing.check_constraint(ElbowBand(6.0, times), free)
    for times in (0.0, 1.0, 1.9):
        with pytest.raises(AssertionError, match=r"'q3 \+ 2 q4': series\(\) is no majorant"):
            testing.check_constraint(ElbowBand(6.0, times), free)


def test_our_own_keep_the_laws_that_users_are_given(problem: sm.Problem) -> None:
    free = dataclasses.replace(problem, constraints=())
    box = sm.obstacles.Box("box", [0.3, 0.25, 0.6], [0.1, 0.1, 0.1])
    for constraint in (
        sm.constraints.JointPositionLimits(),
        sm.constraints.JointVelocityLimits(),
        sm.constraints.JointAccelerationLimits(5.0),
        sm.constraints.ClosedPath(),
        sm.constraints.EndVelocity(),
        sm.constraints.EndConfiguration(PANDA_HOME),
        sm.constraints.Clearance((box,), 0.02),
    ):
        testing.check_constraint(constraint, free)
    testing.check_optimizer(sm.QuasiNewton())
    for motion in (sm.PolynomialNullMotion(5), sm.motion.BSplineNullMotion(6)):
        testing.check_null_motion(motion)


def test_an_unknown_kind_lists_the_known_ones() -> None:
    with pytest.raises(
        sm.errors.FileFormatError, match=r"path kind is 'corkscrew'.*circle.*line.*waypoints"
    ):
        restore(sm.paths.Path, {"kind": "corkscrew"})


@dataclass(frozen=True, eq=False)
class Halfway(sm.costs.JointVelocity):
    """A quadratic form that tells a multiple of its matrix, or nothing."""

    told: float = 1.0

    def curvature(self, dof: int) -> dict[int, Array]:
        known = super().curvature(dof)
        return {order: self.told * matrix for order, matrix in known.items()} if self.told else {}


@pytest.mark.parametrize(("told", "right"), [(1.0, True), (0.5, False), (0.0, False)])
def test_a_quadratic_form_tells_all_that_bends(told: float, right: bool) -> None:
    cost = Halfway(told=told)
    if right:
        testing.check_cost(cost)
        return
    with pytest.raises(AssertionError, match="curvature"):
        testing.check_cost(cost)


@dataclass(frozen=True)
class Crowded(sm.costs.Cost):
    """G = ½ q1², times how many samples there are: beside others it would be another one."""

    is_pointwise = True
    name: str = "crowded"

    def value(self, samples: sm.costs.Samples) -> Array:
        return np.asarray(0.5 * len(samples.t) * samples.q[:, 0] ** 2)

    def gradient(self, samples: sm.costs.Samples) -> sm.costs.Partials:
        by_q = np.zeros_like(samples.q)
        by_q[:, 0] = len(samples.t) * samples.q[:, 0]
        return sm.costs.Partials(q=by_q)


@dataclass(frozen=True)
class CrowdedSlope(Crowded):
    """G = ½ q1², with a gradient that is right only among as many samples as are looked at."""

    def value(self, samples: sm.costs.Samples) -> Array:
        return np.asarray(0.5 * samples.q[:, 0] ** 2)

    def gradient(self, samples: sm.costs.Samples) -> sm.costs.Partials:
        by_q = np.zeros_like(samples.q)
        by_q[:, 0] = samples.q[:, 0] + (len(samples.t) < 40)
        return sm.costs.Partials(q=by_q)


def test_what_is_pointwise_knows_no_other_samples(panda: sm.RobotModel) -> None:
    for cost in (
        sm.costs.JointVelocity(),
        sm.costs.InverseManipulability(1e-3),
        sm.costs.Manipulability(1e-3),
        sm.costs.SmallestSingularValue(1e-3),
        sm.costs.PathLength(),
        sm.costs.KineticEnergy(panda),
        sm.costs.GravityTorque(panda),
    ):
        assert cost.is_pointwise
        testing.check_cost(cost, panda)
    for crowded in (Crowded(), CrowdedSlope()):
        with pytest.raises(AssertionError, match="is_pointwise"):
            testing.check_cost(crowded)


@dataclass(frozen=True)
class Misshapen(sm.constraints.Constraint):
    """|q4 + 1.5| ≤ 0.3, with a series of the wrong shape."""

    def quantity(self, robot: sm.RobotModel) -> sm.certificate.Quantity:
        row = np.eye(robot.dof)[3]
        return sm.certificate.Quantity.between(
            *("elbow", -1.8, -1.2),
            values=lambda q, qd, qdd: q @ row,
            derivatives=lambda q, qd, qdd: (np.tile(row, (len(q), 1)),),
            series=lambda segments: segments.chain().joints[3][None],
        )


def test_a_series_of_another_shape_is_named(panda: sm.RobotModel) -> None:
    circle = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.1, 4.0)
    problem = sm.Problem(panda, circle, "position", PANDA_HOME)
    with pytest.raises(sm.errors.ProblemError, match=r"quantity 'elbow': series\(\) has shape"):
        testing.check_constraint(Misshapen(), problem)
