"""CasADi and IPOPT: the whole path as one nonlinear program, with exact derivatives.

Two first guesses: a tracker that is drawn towards the middle of the joints' limits, which is its
own best one, and the pseudo-inverse, clipped to the limits.
"""

import time
import xml.etree.ElementTree as ElementTree

import casadi as ca
import numpy as np
from common import panda_urdf, report, rotation, start, waypoints

PATH, TIP = "panda__1cube", "panda_hand"
# How strongly the tracker is drawn, in each of so many corrections for a waypoint.
DRAWN, CORRECTIONS = 0.02, 4
OPTIONS = {"print_time": 0, "ipopt.print_level": 0, "ipopt.tol": 1e-8, "ipopt.max_iter": 300}
t, positions, quaternions = waypoints(PATH)
rotations = [rotation(u) for u in quaternions]
count = len(t)


def numbers(text: str | None) -> list[float]:
    return [float(x) for x in (text or "0 0 0").split()]


def turned(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Return the rotation of a URDF's roll, pitch and yaw."""
    (a, b, c), (x, y, z) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    return np.array(
        [
            [b * c, x * y * c - a * z, a * y * c + x * z],
            [b * z, x * y * z + a * c, a * y * z - x * c],
            [-y, x * b, a * b],
        ]
    )


def chain() -> tuple[list[tuple[np.ndarray, np.ndarray, bool]], np.ndarray, np.ndarray]:
    """Return rotation, translation and whether it turns of each joint, and the limits."""
    every = ElementTree.fromstring(panda_urdf()).iter("joint")
    above = {one.find("child").get("link"): one for one in every if one.find("child") is not None}
    joints, limits, link = [], [], TIP
    while link in above:
        joint = above[link]
        origin = joint.find("origin")
        turns = joint.get("type") == "revolute"
        if turns:
            assert numbers(joint.find("axis").get("xyz")) == [0.0, 0.0, 1.0]
            limits.insert(0, [float(joint.find("limit").get(k)) for k in ("lower", "upper")])
        place = (None, None) if origin is None else (origin.get("rpy"), origin.get("xyz"))
        joints.insert(0, (turned(*numbers(place[0])), np.array(numbers(place[1])), turns))
        link = joint.find("parent").get("link")
    lower, upper = np.array(limits).T
    return joints, lower, upper


joints, lower, upper = chain()
middle = 0.5 * (lower + upper)


def forward(q: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return rotation and translation of the tip."""
    turn, place, j = ca.SX.eye(3), ca.SX.zeros(3), 0
    for fixed, offset, turns in joints:
        place = place + ca.mtimes(turn, ca.DM(offset))
        turn = ca.mtimes(turn, ca.DM(fixed))
        if turns:
            s, c = ca.sin(q[j]), ca.cos(q[j])
            about = ca.vertcat(ca.horzcat(c, -s, 0), ca.horzcat(s, c, 0), ca.horzcat(0, 0, 1))
            turn, j = ca.mtimes(turn, about), j + 1
    return turn, place


q, goal, point = ca.SX.sym("q", 7), ca.SX.sym("R", 3, 3), ca.SX.sym("x", 3)
turn, place = forward(q)
E = ca.mtimes(goal, turn.T)
angular = 0.5 * ca.vertcat(E[2, 1] - E[1, 2], E[0, 2] - E[2, 0], E[1, 0] - E[0, 1])
error = ca.Function("error", [q, goal, point], [ca.vertcat(point - place, angular)])
slope = ca.Function("slope", [q, goal, point], [ca.jacobian(error(q, goal, point), q)])


def tracked(drawn: float) -> np.ndarray:
    """Return a configuration for each waypoint, one after the other."""
    here, found = start(), [start()]
    for k in range(1, count):
        for _ in range(CORRECTIONS):
            wrong = np.array(error(here, rotations[k], positions[k])).ravel()
            jacobian = np.array(slope(here, rotations[k], positions[k]))
            inverse = np.linalg.pinv(jacobian)
            free = drawn * (np.eye(7) - inverse @ jacobian) @ (middle - here)
            here = here - inverse @ wrong + free
        found.append(here)
    return np.array(found)


def build() -> ca.Function:
    """Return the solver for this path."""
    # --8<-- [start:follow]
    motion = ca.SX.sym("Q", 7, count)
    step = motion[:, 1:] - motion[:, :-1]
    cost = 0.5 * ca.sum2(ca.sum1(step**2) / ca.DM(np.diff(t)).T)
    poses = [error(motion[:, k], rotations[k], positions[k]) for k in range(1, count)]
    program = {"x": ca.vec(motion), "f": cost, "g": ca.vec(ca.horzcat(*poses))}
    solver = ca.nlpsol("solver", "ipopt", program, OPTIONS)
    # --8<-- [end:follow]
    return solver


began = time.perf_counter()
solver = build()
built = time.perf_counter() - began
least, most = np.tile(lower, (count, 1)), np.tile(upper, (count, 1))
least[0] = most[0] = start()
for name, guess in (
    ("tracker drawn to the middle", tracked(DRAWN)),
    ("clipped pseudo-inverse", np.clip(tracked(0.0), lower, upper)),
):

    def solve(guess: np.ndarray = guess) -> np.ndarray:
        # --8<-- [start:solve]
        bounds = {"lbx": least.ravel(), "ubx": most.ravel(), "lbg": 0, "ubg": 0}
        found = solver(x0=guess.ravel(), **bounds)["x"]
        # --8<-- [end:solve]
        return np.array(found).reshape(count, 7)

    solve()
    status = solver.stats()["return_status"]
    settings = f"IPOPT from {name}: {status}, built in {built:.1f} s besides"
    report("CasADi", settings, solve)
