"""What a step teaches of the Hessian: Broyden's family, Fletcher's switch, Powell's damping."""

import numpy as np

from selfmotion.basics import Array

# Powell's damping: sᵀy is at least this share of sᵀBs.
_DAMPING = 0.2


def renewed(h: Array, s: Array, y: Array, update: str) -> tuple[Array, str]:
    """Return H renewed by a formula of Broyden's family for s = Δx and y = Δ∇F, and its name.

    `update` is "bfgs", "dfp", or "fletcher" for the switch; the name is "none" where no formula
    keeps H positive definite.
    """
    hy = h @ y
    sy, yhy = float(s @ y), float(y @ hy)
    # Without positive curvature along s no update keeps H positive definite.
    if not (sy > 1e-14 * float(np.linalg.norm(s) * np.linalg.norm(y)) and yhy > 0.0):
        return h, "none"
    if update == "fletcher":
        update = "dfp" if sy < yhy else "bfgs"
    h = h + (np.outer(s, s) / sy - np.outer(hy, hy) / yhy)
    if update == "bfgs":
        v = s / sy - hy / yhy
        h = h + yhy * np.outer(v, v)
    return h, update


def damped(y: Array, s: Array, hessian: Array) -> Array:
    """Return y moved towards Bs so that its curvature along s is a share of that of B at least.

    M. J. D. Powell, "A fast algorithm for nonlinearly constrained optimization calculations", 1978:
    the Hessian of a Lagrangian need not be positive along s.
    """
    bent = hessian @ s
    curvature, found = float(s @ bent), float(s @ y)
    if found >= _DAMPING * curvature:
        return y
    share = (1.0 - _DAMPING) * curvature / (curvature - found)
    return np.asarray(share * y + (1.0 - share) * bent)
