"""What a step teaches of the Hessian: Broyden's family, Fletcher's switch."""

import numpy as np

from selfmotion.basics import Array


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
