"""The optimum over all joint motions, by Pontryagin's conditions as a boundary-value problem."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, ProblemError
from selfmotion.model.motion import Sampling
from selfmotion.model.robot import null_space
from selfmotion.paper.baselines.base import Motion, pseudo_inverse, start_of
from selfmotion.planning.optimise import Status
from selfmotion.planning.result import Plan
from selfmotion.problem.costs import Cost, JointVelocity, Samples, weight_matrix
from selfmotion.problem.problem import Problem

# Rate K of the pose feedback, which removes errors of the collocation, times the duration.
_FEEDBACK = 5.0

# Ends of a path nearer than this [m, rad] are the same.
_CLOSED = 1e-6

# Number of nodes of the first mesh; `solve_bvp` refines it.
_MESH = 101


@dataclass(frozen=True, eq=False)
class LagrangianOptimum:
    """The minimum of ∫ ½ q̇ᵀWq̇ + V(q) dt over all motions that hold the task.

    D. P. Martin, J. Baillieul and J. M. Hollerbach, "Resolution of kinematic redundancy using
    optimization techniques", IEEE Trans. Robotics Autom. 5, 1989, give the second-order
    Euler-Lagrange equation; this is its Hamiltonian form, which needs no derivative of J. With
    costate p and multipliers λ of Jq̇ = ẋ,

        q̇ = W⁻¹(Jᵀλ - p),  λ = (JW⁻¹Jᵀ)⁻¹(ẋ + JW⁻¹p),  ṗ = -∂V/∂q + ∂/∂q λᵀ(Jq̇ - ẋ),

    between q(0) = start and, for a free end, p(T) = 0 (the natural condition); for a cyclic motion
    q(T) = q(0). p counts only up to Jᵀc; for the cyclic end the m rows Jp(T) = 0 settle c. Solved
    by fourth-order collocation (`scipy.integrate.solve_bvp`).

    Parameters
    ----------
    guess : Plan, optional
        Where to start; by default the pseudo-inverse motion. The equations are those of a
        stationary motion: a start near the optimum decides which one is found.
    cyclic : bool
        Whether the motion ends in the configuration where it began; the path must be closed.
    tolerance : float
        Of the collocation, relative.
    """

    guess: Plan | None = None
    cyclic: bool = False
    tolerance: float = 1e-7

    def solve(self, problem: Problem) -> Motion:
        """See `Method.solve`.

        Raises
        ------
        ProblemError
            A cost is neither a joint velocity nor a function of the pose, W is singular, or the
            path is not closed for a cyclic motion.
        """
        from scipy.integrate import solve_bvp

        first, last = problem.path.pose(0.0), problem.path.pose(problem.path.duration)
        if self.cyclic and max(problem.task.miss(first, last)) > _CLOSED:
            raise ProblemError("cyclic Lagrangian optimum: the path does not end where it begins")
        flow = _Flow(problem)
        t = np.linspace(0.0, problem.path.duration, _MESH)
        q = pseudo_inverse(problem).at(t)[0] if self.guess is None else self.guess.trajectory(t)
        found = solve_bvp(
            flow.rates,
            self._end_conditions(problem, flow),
            t,
            np.vstack([q.T, flow.costates(t, q)]),
            tol=self.tolerance,
            max_nodes=20_000,
        )

        def at(times: Array) -> tuple[Array, Array]:
            state = found.sol(times)
            return np.ascontiguousarray(state[: flow.n].T), flow.rates(times, state)[: flow.n].T

        message = f"two-point boundary-value problem, {len(found.x)} mesh points: {found.message}"
        status = Status.CONVERGED if found.success else Status.MAX_ITERATIONS
        return Motion(at, message, found.niter, flow.jacobian_evaluations, status)

    def _end_conditions(self, problem: Problem, flow: _Flow) -> Callable[[Array, Array], Array]:
        start, n = start_of(problem), flow.n
        rows = problem.follows.jacobian(start)
        null = null_space(rows).T

        def conditions(first: Array, last: Array) -> Array:
            if self.cyclic:
                end = np.concatenate([null @ (last[:n] - start), rows @ last[n:]])
            else:
                end = last[n:]
            return np.concatenate([first[:n] - start, end])

        return conditions


class _Flow:
    """The Hamiltonian vector field of a problem."""

    def __init__(self, problem: Problem) -> None:
        self._problem, self.n = problem, problem.robot.dof
        self._inverse_weight = np.linalg.inv(_velocity_weight(problem))
        self._gain = _FEEDBACK / problem.path.duration
        self.jacobian_evaluations = 0

    def rates(self, t: Array, state: Array) -> Array:
        """Return d/dt [q; p] for states (2n, K) at times (K,)."""
        n = self.n
        q = np.ascontiguousarray(state[:n].T)
        samples = self._samples(t, q)
        qd, pd = self._hamilton(samples, state[n:].T)
        return np.vstack([qd.T, pd.T])

    def costates(self, t: Array, q: Array) -> Array:
        """Return costates (n, K) of a motion q (K, n), from p(T) = 0 backwards."""
        from scipy.integrate import solve_ivp
        from scipy.interpolate import CubicSpline

        motion = CubicSpline(t, q)

        def rate(time: float, p: Array) -> Array:
            samples = self._samples(np.array([time]), motion(time)[None])
            return np.asarray(self._hamilton(samples, p[None])[1][0])

        backwards = solve_ivp(
            rate, (t[-1], t[0]), np.zeros(self.n), t_eval=t[::-1], rtol=1e-6, atol=1e-8
        )
        return np.asarray(backwards.y[:, ::-1])

    def _samples(self, t: Array, q: Array) -> Samples:
        self.jacobian_evaluations += len(t)
        problem = self._problem
        moments = Sampling.trapezoidal(t)
        return Samples.along(problem.follows, moments, q, np.zeros_like(q))

    def _hamilton(self, samples: Samples, p: Array) -> tuple[Array, Array]:
        """Return q̇ and ṗ, (K, n) each."""
        problem, inverse = self._problem, self._inverse_weight
        jacobian = samples.task_jacobian
        transpose = jacobian.transpose(0, 2, 1)
        command, omega = self._command(samples)
        free = p @ inverse
        wanted = command + np.einsum("kmn,kn->km", jacobian, free)
        multipliers = np.linalg.solve(jacobian @ inverse @ transpose, wanted[:, :, None])[:, :, 0]
        qd = np.einsum("kmn,km->kn", jacobian, multipliers) @ inverse - free
        pd = samples.contract(multipliers[:, :, None] * qd[:, None, :])
        if problem.task.tool_axes:
            # ẋ in tool axes turns with the tool: λᵀ ∂(Rᵀω)/∂q = λᵀRᵀ[ω]× J_ω.
            world = np.zeros_like(omega)
            angular = problem.task.rows >= 3
            world[:, problem.task.rows[angular] - 3] = multipliers[:, angular]
            world = np.einsum("kij,kj->ki", samples.rotation, world)
            pd -= np.einsum("ki,kin->kn", np.cross(world, omega), samples.jacobian[:, 3:])
        for cost in problem.costs:
            if not isinstance(cost, JointVelocity):
                by_q = cost.gradient(samples).q
                if by_q is not None:
                    pd -= by_q
        return np.asarray(qd), np.asarray(pd)

    def _command(self, samples: Samples) -> tuple[Array, Array]:
        """Return ẋ + K e (K, m), and the path's angular velocity (K, 3)."""
        from selfmotion.model.task import SE3

        task = self._problem.task
        target = self._problem.path.samples(samples.t)
        command = np.empty((len(samples.t), task.dimension))
        for k, twist in enumerate(target.twist):
            rotation = samples.rotation[k]
            error = target.translation[k] - samples.translation[k]
            wanted = twist.copy()
            wanted[:3] += self._gain * error
            if np.any(task.rows >= 3):
                pose = SE3(target.rotation[k], target.translation[k])
                actual = SE3(rotation, samples.translation[k])
                wanted[3:] += self._gain * task.twist_error(pose, actual)[3:]
            command[k] = task.select(wanted[:, None], rotation)[:, 0]
        return command, target.twist[:, 3:]


def _velocity_weight(problem: Problem) -> Array:
    """Return W; ProblemError where the costs are not ½ q̇ᵀWq̇ + V(q) with W > 0."""
    n, t = problem.robot.dof, problem.path.knots[:1]
    weight = np.zeros((n, n))
    q = start_of(problem)[None]
    moment = Sampling.trapezoidal(t)
    at_rest = Samples.along(problem.follows, moment, q, np.zeros((1, n)))
    for cost in problem.costs:
        if isinstance(cost, JointVelocity):
            weight += weight_matrix(np.asarray(cost.weight), n)
            continue
        partials = cost.gradient(at_rest) if not _of_derivatives(cost, n) else None
        if partials is None or partials.qd is not None:
            raise ProblemError(
                f"Lagrangian optimum: cost '{cost.name}' is neither a joint velocity nor a "
                f"function of the pose alone"
            )
    if np.linalg.eigvalsh(weight)[0] <= 0.0:
        raise ProblemError(
            "Lagrangian optimum: no joint velocity cost with a positive definite weight, without "
            "which the optimum is no smooth motion"
        )
    return weight


def _of_derivatives(cost: Cost, n: int) -> bool:
    return any(order > 0 for order in cost.curvature(n))
