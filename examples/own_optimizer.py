"""An optimiser of one's own: SciPy's BFGS in the place of ours."""

import contextlib

import numpy as np
from scipy.optimize import minimize

import selfmotion as sm
from selfmotion.testing import check_optimizer


class ScipyBfgs:
    """`scipy.optimize.minimize` behind the protocol `selfmotion.optimise.Optimizer`."""

    def minimize(
        self,
        function,
        x0,
        inverse_hessian=None,
        *,
        max_evaluations=None,
        callback=None,
    ):
        if inverse_hessian is None:
            inverse_hessian = np.linalg.pinv(function.metric(x0), hermitian=True)
        best = [np.array(x0), function.value(x0)]
        history, stopped = [], [None]

        def note(x, cost, gradient):
            if cost <= best[1]:
                best[:] = [x.copy(), cost]
            size = float(np.linalg.norm(gradient))
            step = float(bool(history))
            history.append(sm.optimise.Iteration(x, cost, size, "bfgs", step, function.evaluations))
            if callback is not None and callback(history[-1]):
                stopped[0] = sm.optimise.Status.STOPPED
            elif max_evaluations is not None and function.evaluations >= max_evaluations:
                stopped[0] = sm.optimise.Status.MAX_EVALUATIONS
            if stopped[0]:
                raise StopIteration

        def value_and_gradient(x):
            cost, gradient = function.value(x), function.gradient(x)
            note(x.copy(), cost, gradient)
            return cost, gradient

        options = {"hess_inv0": 0.5 * (inverse_hessian + inverse_hessian.T), "gtol": 1e-6}
        with contextlib.suppress(StopIteration):
            minimize(value_and_gradient, x0, jac=True, method="BFGS", options=options)
        status = stopped[0] or sm.optimise.Status.CONVERGED
        return sm.optimise.Minimum(best[0], best[1], inverse_hessian, tuple(history), status)


check_optimizer(ScipyBfgs())
problem = sm.sample_problem()
for optimizer in (sm.QuasiNewton(), ScipyBfgs()):
    plan = sm.plan(problem, optimizer=optimizer).require()
    name, report = type(optimizer).__name__, plan.report
    print(f"{name}: cost {report.cost:.6f} in {report.evaluations} evaluations")
