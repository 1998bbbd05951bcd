"""pink: two arms that carry a bar, instant by instant, one quadratic programme per step."""

import itertools
import json
import sys
import time
from pathlib import Path

import numpy as np
import pink
import pinocchio as pin
from pink.tasks import FrameTask, PostureTask, RelativeFrameTask

STEPS_PER_SECOND = (100, 1000)
given = json.loads(Path(sys.argv[1]).read_text())
HANDS = "left/panda_hand_tcp", "right/panda_hand_tcp"


def pose(values: list[float]) -> pin.SE3:
    return pin.XYZQUATToSE3(np.array(values))


def cell() -> pin.Model:
    model = pin.buildModelFromXML(given["urdf"])
    # The joints of the fingers and others that the plan holds.
    held = [k for k, name in enumerate(model.names) if k and name not in given["joints"]]
    return pin.buildReducedModel(model, held, pin.neutral(model))


def track(model: pin.Model, rate: int) -> tuple[np.ndarray, np.ndarray]:
    """Return times and configurations: both hands as soft tasks, as pink has them."""
    order = [model.joints[model.getJointId(name)].idx_q for name in given["joints"]]
    q = np.zeros(model.nq)
    q[order] = given["start"]
    configuration = pink.Configuration(model, model.createData(), q)
    left = FrameTask(HANDS[0], position_cost=1.0, orientation_cost=1.0)
    right = RelativeFrameTask(HANDS[1], HANDS[0], position_cost=1.0, orientation_cost=1.0)
    rest = PostureTask(cost=1e-4)
    rest.set_target(q)
    right.set_target(pose(given["grasp"]))
    times = np.linspace(0.0, given["duration"], round(given["duration"] * rate) + 1)
    table, known = np.array(given["path"]), np.array(given["t"])
    found = [q[order]]
    for before, now in itertools.pairwise(times):
        goal = np.array([np.interp(now, known, column) for column in table.T])
        goal[3:] /= np.linalg.norm(goal[3:])
        left.set_target(pin.XYZQUATToSE3(goal))
        step = now - before
        rates = pink.solve_ik(configuration, [left, right, rest], step, solver="daqp")
        configuration.integrate_inplace(rates, step)
        found.append(configuration.q[order])
    return times, np.array(found)


model = cell()
for rate in STEPS_PER_SECOND:
    track(model, 10)
    began = time.process_time()
    times, q = track(model, rate)
    result = {
        "name": "pink, soft tasks",
        "settings": f"{rate} steps per second",
        "seconds": time.process_time() - began,
        "t": times.tolist(),
        "q": q.tolist(),
    }
    sys.stdout.write(json.dumps(result) + "\n")
