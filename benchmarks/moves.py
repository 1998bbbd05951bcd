"""Random transfers among boxes, each with a known way: `make bench NAME=moves`.

Arms of 6 to 9 joints. How many are found in two seconds, how many are wrong by a look at 4,000
times with exact distances, and how long they take against the best of 50 tries of OMPL's
RRTConnect, its paths simplified by OMPL, rounded and timed as ours, of some transfers of each arm.
"""

import argparse
import time

import numpy as np

import selfmotion as sm
from selfmotion.model.task import SE3
from selfmotion.planning.transfer import FreeMotions, Room, rounded
from selfmotion.problem.problem import KEPT

# Distance kept [m]; seconds in which a move should be found; looks at each that is found.
APART, IN_TIME, LOOKS = 5e-3, 2.0, 4000
# Steps of the walk that is known to lead from one end to the other, and how far each goes [rad].
WALK, STRIDE = 80, 0.5
# Seconds for each try of the peer.
TRY = 1.0


def arms() -> dict[str, sm.RobotModel]:
    """Return arms of 6 to 9 joints."""
    table = SE3(np.eye(3), np.array([0.7, 0.0, 0.0]))
    return {
        "ur5": sm.load_robot("ur5"),
        "panda": sm.load_robot("panda"),
        "xarm7": sm.load_robot("xarm7"),
        "panda, table": sm.load_robot(
            {"arm": "panda", "table": "positioner"},
            base={"table": table},
            tool="arm/panda_hand_tcp",
            reference="table/plate",
        ),
    }


def transfer(
    robot: sm.RobotModel, rng: np.random.Generator
) -> tuple[sm.constraints.Clearance, np.ndarray, np.ndarray] | None:
    """Return boxes and two configurations that a free walk connects; None for an unlucky draw."""
    boxes = []
    for k in range(5):
        angle, far = rng.uniform(-np.pi, np.pi), rng.uniform(0.35, 0.8)
        place = [far * np.cos(angle), far * np.sin(angle), rng.uniform(0.1, 0.9)]
        boxes.append(sm.obstacles.Box(f"box {k}", place, rng.uniform(0.08, 0.3, 3)))
    clearance = sm.constraints.Clearance(boxes, APART)
    free = FreeMotions(robot, [*KEPT, clearance], rng)
    room = Room(free.envelope, robot, 2e-3)
    lower, upper = free.envelope.arm(robot).finite_limits()
    starts = 0.8 * rng.uniform(lower, upper, (200, robot.dof))
    starts = starts[room.free(starts)]
    if not len(starts):
        return None
    q = first = starts[0]
    pull = rng.normal(size=robot.dof)
    for _ in range(WALK):
        pull = 0.8 * pull + 0.6 * rng.normal(size=robot.dof)
        there = np.clip(q + STRIDE * pull / np.abs(pull).max(), lower, upper)
        if room.is_open(q, there):
            q = there
        else:
            pull = -pull + rng.normal(size=robot.dof)
    return (clearance, first, q) if np.abs(q - first).max() > 1.0 else None


def is_wrong(
    move: sm.Move, clearance: sm.constraints.Clearance, first: np.ndarray, last: np.ndarray
) -> bool:
    """Whether a verified move is not what it should be, by samples."""
    motion, robot = move.motion, move.robot
    t = np.linspace(motion.t[0], motion.t[-1], LOOKS)
    q, step = motion(t), t[1] - t[0]
    model = clearance.model(robot)
    speed = np.abs(np.diff(q, axis=0)) / step
    return bool(
        np.any(q[0] != first)
        or np.abs(q[-1] - last).max() > 1e-12
        or np.any(q < robot.lower - 1e-9)
        or np.any(q > robot.upper + 1e-9)
        or np.any(speed > robot.velocity_limit * (1.0 + 1e-6))
        or model.worst(q).value < APART
    )


def peer_best(free: FreeMotions, first: np.ndarray, last: np.ndarray, tries: int) -> float:
    """Return the shortest duration of tries of OMPL's RRTConnect [s]; inf where none is found."""
    from ompl import base, geometric, util

    util.setLogLevel(util.LogLevel.LOG_NONE)
    room, n = Room(free.envelope, free.robot), len(first)
    lower, upper = free.envelope.arm(free.robot).finite_limits()
    space = base.RealVectorStateSpace(n)
    bounds = base.RealVectorBounds(n)
    for k in range(n):
        bounds.setLow(k, float(lower[k]))
        bounds.setHigh(k, float(upper[k]))
    space.setBounds(bounds)
    best = np.inf
    for _ in range(tries):
        setup = geometric.SimpleSetup(space)
        setup.setStateValidityChecker(
            lambda state: bool(room.free(np.array([[state[k] for k in range(n)]]))[0])
        )
        ends = []
        for q in (first, last):
            state = space.allocState()
            for k in range(n):
                state[k] = float(q[k])
            ends.append(state)
        setup.setStartAndGoalStates(*ends)
        setup.setPlanner(geometric.RRTConnect(setup.getSpaceInformation()))
        if not setup.solve(TRY):
            continue
        setup.simplifySolution()
        found = setup.getSolutionPath().getStates()
        way = np.array([[state[k] for k in range(n)] for state in found])
        path = rounded(room, way)
        if path is not None:
            move = free.at_its_pace(path)
            best = min(best, move.motion.duration if move.verified else np.inf)
    return best


def main() -> None:
    """Run the transfers, and print a line for each arm."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--each", type=int, default=25, help="transfers of each arm")
    parser.add_argument("--peer", type=int, default=0, help="of them so many by OMPL as well")
    parser.add_argument("--tries", type=int, default=50)
    options = parser.parse_args()
    totals = [0, 0, 0]
    for name, robot in arms().items():
        rng, seconds, ratios, missed, wrong = np.random.default_rng(1), [], [], 0, 0
        # What is compiled on first use, and bodies made once, are no part of it.
        sm.move(robot, np.zeros(robot.dof) + 0.01, np.zeros(robot.dof) + 0.02)
        while len(seconds) < options.each:
            drawn = transfer(robot, rng)
            if drawn is None:
                continue
            clearance, first, last = drawn
            clearance.model(robot)
            began = time.perf_counter()
            move = sm.move(robot, first, last, clearance=clearance, seconds=IN_TIME)
            seconds.append(time.perf_counter() - began)
            if not move.verified:
                missed += 1
                print(f"  {move.trouble}")
                continue
            wrong += is_wrong(move, clearance, first, last)
            if len(ratios) < options.peer:
                free = FreeMotions(robot, move.constraints, np.random.default_rng(0))
                best = peer_best(free, first, last, options.tries)
                ratios.append(move.motion.duration / best if np.isfinite(best) else np.nan)
        against = f"the best of {options.tries} tries of OMPL"
        peer = f", at most {max(ratios):.2f} times {against}" if ratios else ""
        found = len(seconds) - missed
        print(
            f"{name} ({robot.dof} joints): {found} of {len(seconds)} found, {wrong} "
            f"wrong; median {np.median(seconds):.2f} s, longest {max(seconds):.2f} s{peer}",
            flush=True,
        )
        if ratios:
            print(f"  {np.array2string(np.array(ratios), precision=2)}", flush=True)
        totals = [a + b for a, b in zip(totals, (len(seconds), missed, wrong), strict=True)]
    print(f"in all {totals[0] - totals[1]} of {totals[0]} found, {totals[2]} wrong")


if __name__ == "__main__":
    main()
