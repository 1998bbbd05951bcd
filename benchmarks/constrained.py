"""Problems whose constraints bind: `python benchmarks/constrained.py`.

60 problems made at random for each seed. Each is planned, and compared with what another revision
made of it: `--store` writes a revision's results, `--against` compares with them. Limits are taken
from another motion, which is then forgotten, so that they bind at x = 0 and can be kept. Times are
those of the processor. Last digits decide which random motions these are: so the problems that
results are stored of are stored, too (`--keep`).
"""

from __future__ import annotations

import json
import subprocess
import time
import warnings
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pinocchio as pin
import typer
from problems import PANDA_HOME
from rich.console import Console
from rich.table import Table

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.optimise import inverse_metric
from selfmotion.planning.paper import Objective
from selfmotion.planning.rollout import MinimumNormMotion, converged_minimum_norm
from selfmotion.problem.constraints import NO_OVERLAP, separate_clearances
from selfmotion.problem.problem import problem_from_dict, problem_to_dict

DATA = Path(__file__).parent / "data"
PROBLEMS = DATA / "constrained_problems.json"
ARMS = (
    ("panda", "pose"),
    ("panda", "position"),
    ("panda", "pointing"),
    ("xarm7", "pose"),
    ("xarm7", "position"),
    ("ur5", "pointing"),
    ("planar_3r", "planar"),
    ("xarm7", "pointing"),
    ("ur5", "position"),
)
KINDS = ("velocity", "acceleration", "position", "closed", "clearance", "at rest", "all limits")
COUNT = 60
# Every so many, the start is free.
FREE = 5
# A distance to obstacles [m], and how near to the motion at x = 0 they are put.
DISTANCE, NEAR = 5e-3, 0.25
TRIES, STARTS = 120, 100
# How much less the busiest joints of the other motion have to move.
CALMER = 0.95


def problem(seed: int, number: int) -> tuple[str, sm.Problem]:
    """Return the name of a problem, and the problem: as it is stored, or made anew."""
    (arm, task), kind = ARMS[number % len(ARMS)], KINDS[number % len(KINDS)]
    if arm == "planar_3r" and kind == "clearance":
        kind = "velocity"
    if arm == "ur5" and kind not in ("closed", "at rest"):
        # Pointing leaves it only the turn of its last joint.
        task = "position"
    robot = sm.load_robot(arm)
    stored = _stored().get(str(seed))
    if stored is None:
        made = _made(robot, task, kind, seed, number)
    else:
        named = {"named": arm}
        values = {**stored[number], "robot": named}
        # By default; an arm without bodies may not be asked.
        values.pop("collision", None)
        made = problem_from_dict(values, {json.dumps(named): robot})
    # What the constraints were made from is not what is planned with.
    made = replace(made, null_motion=sm.motion.FreeNullMotion())
    start = "" if made.given_start is not None else ", free start"
    return f"{number:02d} {arm} {task}, {kind}{start}", made


@cache
def _stored() -> dict[str, list[dict[str, Any]]]:
    found: dict[str, list[dict[str, Any]]] = json.loads(PROBLEMS.read_text())
    return found


def _made(robot: sm.RobotModel, task: str, kind: str, seed: int, number: int) -> sm.Problem:
    rng = np.random.default_rng([seed, number])
    for _ in range(STARTS):
        free = _without(robot, task, kind, rng)
        try:
            minimum_norm, _ = converged_minimum_norm(Formulation.of(free), free.given_start)
        except sm.SelfmotionError:
            continue
        constraints = _constraints(kind, free, minimum_norm, rng)
        if constraints is not None:
            break
    else:
        raise RuntimeError(f"problem {number} of seed {seed}: no constraints that bind were found")
    start = None if number % FREE == FREE - 1 else free.given_start
    others, apart = separate_clearances(constraints, NO_OVERLAP)
    return sm.Problem(
        robot,
        free.path,
        task,
        start,
        free.null_motion,
        costs=free.costs,
        constraints=others,
        clearance=apart,
        rest=False,
    )


def _without(robot: sm.RobotModel, task: str, kind: str, rng: np.random.Generator) -> sm.Problem:
    """Return a problem without constraints; closed paths are circles."""
    # Homes of the others are upright, and singular.
    is_panda = robot.name == "panda"
    start = PANDA_HOME if is_panda else robot.dexterous_configuration(task)
    start = start + rng.uniform(-0.15, 0.15, robot.dof)
    pose = robot.pose(start)
    duration = float(np.round(rng.uniform(1.5, 4.0), 2))
    normal = {"planar_3r": np.array([0.0, 0.0, 1.0])}.get(robot.name)
    if normal is None:
        normal = rng.normal(size=3)
        normal /= np.linalg.norm(normal)
    radius = float(np.round(rng.uniform(0.08, 0.2), 3))
    path: sm.paths.Path
    if kind == "closed" or rng.uniform() < 0.5:
        path = sm.paths.Circle.around(pose, radius, duration, normal=normal)
    else:
        end = pose.copy()
        way = np.cross(normal, rng.normal(size=3))
        end.translation = pose.translation + 2.0 * radius * way / np.linalg.norm(way)
        path = sm.paths.Line(pose, end, duration)
    motions = (
        sm.PolynomialNullMotion(3),
        sm.PolynomialNullMotion(5),
        sm.motion.BSplineNullMotion(8),
    )
    costs = (
        sm.costs.JointVelocity(),
        sm.costs.InverseManipulability(float(10 ** rng.uniform(-4.0, -1.5))),
    )
    motion = motions[int(rng.integers(3))]
    # Not at rest at the ends: the stored results are of a revision that knew no such thing.
    return sm.Problem(robot, path, task, start, motion, costs, (), rest=False)


def _constraints(
    kind: str, problem: sm.Problem, minimum_norm: MinimumNormMotion, rng: np.random.Generator
) -> list[sm.constraints.Constraint] | None:
    """Return constraints that the motion at x = 0 breaks and another one keeps; None for none.

    Closed paths and ends at rest come without another one.
    """
    robot = problem.robot
    limits: list[sm.constraints.Constraint] = [
        sm.constraints.JointPositionLimits(),
        sm.constraints.JointVelocityLimits(),
    ]
    if kind == "closed":
        return [*limits, sm.constraints.ClosedPath()]
    if kind == "at rest":
        return [*limits, sm.constraints.EndVelocity()]
    if kind == "clearance":
        spheres = _sphere(problem, minimum_norm, rng)
        return None if spheres is None else [*limits, sm.constraints.Clearance(spheres, DISTANCE)]
    orders = {"position": (0,), "velocity": (1,), "acceleration": (2,)}.get(kind, (0, 1, 2))
    found = _calmer(problem, minimum_norm, orders[-1], rng)
    if found is None:
        return None
    first, other = found
    for order in orders:
        idle, calm = _peaks(first[order], order), _peaks(other[order], order)
        bounds = 1.2 * np.maximum(idle, calm)
        bounds = np.maximum(bounds, 0.2 * bounds.max())
        joint = int(np.argmin(calm - idle))
        bounds[joint] = 1.03 * calm[joint]
        bounds = np.array([float(f"{bound:.3g}") for bound in bounds])
        if order == 0:
            start = minimum_norm.start
            limits[0] = sm.constraints.JointPositionLimits(start - bounds, start + bounds)
        elif order == 1:
            limits[1] = sm.constraints.JointVelocityLimits(bounds)
        else:
            limits.append(sm.constraints.JointAccelerationLimits(bounds))
    robot_limits = robot.finite_limits()
    inside = (other[0] > robot_limits[0] + 0.02) & (other[0] < robot_limits[1] - 0.02)
    possible = np.abs(other[1]) < 0.98 * robot.velocity_limit
    return limits if inside.all() and possible.all() else None


_Motion = tuple[Array, Array, Array]


def _motion(objective: Objective, x: Array) -> _Motion | None:
    if not np.isfinite(objective.value(x)):
        return None
    samples = objective.samples(x)
    tables = (samples.q, samples.qd, samples.qdd)
    return tuple(np.array(table[samples.nodes]) for table in tables)  # type: ignore[return-value]


def _peaks(table: Array, order: int) -> Array:
    """Return how far each joint goes from its start (order 0), or its largest rate."""
    return np.asarray(np.abs(table - table[0] if order == 0 else table).max(axis=0))


def _random(objective: Objective, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return a matrix whose columns are steps of like effect on the cost, and a random step."""
    values, vectors = np.linalg.eigh(inverse_metric(objective.metric(np.zeros(objective.size))))
    cost = objective.value(np.zeros(objective.size))
    steps = vectors * np.sqrt(values * 2.0 * abs(cost) / objective.size)
    return steps, steps @ rng.normal(size=objective.size)


def _calmer(
    problem: sm.Problem, minimum_norm: MinimumNormMotion, order: int, rng: np.random.Generator
) -> tuple[_Motion, _Motion] | None:
    """Return the motion at x = 0 and one whose busiest joints move less, by random search."""
    objective = Objective.of(Formulation.of(problem), minimum_norm)
    first = _motion(objective, np.zeros(objective.size))
    if first is None:
        return None
    idle = _peaks(first[order], order)
    busy = np.argsort(idle)[-2:]
    best, least, x = None, CALMER, np.zeros(objective.size)
    steps, _ = _random(objective, rng)
    size = 0.5
    for _ in range(TRIES):
        trial = x + size * steps @ rng.normal(size=objective.size)
        motion = _motion(objective, trial)
        if motion is None:
            continue
        ratio = float((_peaks(motion[order], order)[busy] / idle[busy]).mean())
        if ratio < least:
            best, least, x = motion, ratio, trial
        else:
            size = max(0.97 * size, 0.05)
    return None if best is None else (first, best)


def _sphere(
    problem: sm.Problem, minimum_norm: MinimumNormMotion, rng: np.random.Generator
) -> tuple[sm.obstacles.Sphere] | None:
    """Return a sphere that the motion at x = 0 runs into, and another one does not."""
    robot, objective = problem.robot, Objective.of(Formulation.of(problem), minimum_norm)
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, minimum_norm.q[len(minimum_norm.q) // 2])
    others = [_motion(objective, _random(objective, rng)[1]) for _ in range(4)]
    known = [motion[0] for motion in others if motion is not None]
    for _ in range(TRIES):
        joint = int(rng.integers(2, robot.model.njoints - 1))
        center = np.round(data.oMi[joint].translation + rng.normal(size=3) * 0.5 * NEAR, 3)
        sphere = sm.obstacles.Sphere("ball", center, float(np.round(rng.uniform(0.03, 0.08), 3)))
        model = sm.obstacles.CollisionModel(robot, (sphere,))
        worst = model.worst(minimum_norm.q).value
        if not (
            -0.03 < worst < DISTANCE and model.worst(minimum_norm.q[:1]).value > 2.0 * DISTANCE
        ):
            continue
        if any(model.worst(q).value > 1.5 * DISTANCE for q in known):
            return (sphere,)
    return None


def solve(seed: int, number: int) -> dict[str, Any]:
    """Plan a problem, and return what came of it."""
    name, made = problem(seed, number)
    began = time.process_time()
    result: dict[str, Any] = {"name": name, "solved": False, "cost": None, "evaluations": 0}
    try:
        plan = sm.plan(made)
    except sm.SelfmotionError as error:
        result["message"] = str(error)
    else:
        result["solved"] = plan.certificate.verified
        result["cost"] = plan.report.cost
        result["evaluations"] = plan.report.evaluations
        result["gradients"] = plan.report.gradient_evaluations
        result["message"] = plan.report.message
    result["seconds"] = time.process_time() - began
    return result


def main(
    seed: Annotated[int, typer.Option(help="Of the problems.")] = 0,
    only: Annotated[list[int] | None, typer.Option(help="Numbers of single problems.")] = None,
    store: Annotated[Path | None, typer.Option(help="Write the results to a file.")] = None,
    against: Annotated[Path, typer.Option(help="Compare with these results.")] = DATA
    / "constrained_reference.json",
    keep: Annotated[bool, typer.Option(help="Store the problems of a seed, and end.")] = False,
) -> None:
    """Plan all problems; print them side by side with another revision's results."""
    warnings.simplefilter("ignore")
    if keep:
        made = [problem_to_dict(problem(seed, number)[1]) for number in range(COUNT)]
        kept = [{key: each[key] for key in each if key != "robot"} for each in made]
        PROBLEMS.write_text(json.dumps({**_stored(), str(seed): kept}, separators=(",", ":")))
        return
    sm.plan(sm.sample_problem())
    numbers = only or list(range(COUNT))
    results = []
    for number in numbers:
        results.append(solve(seed, number))
        done = results[-1]
        Console(stderr=True).print(
            f"{done['name']}: solved {done['solved']}, {done['evaluations']} evaluations, "
            f"cost {done['cost']}, {done['seconds']:.2f} s",
            markup=False,
            highlight=False,
        )
    if store is not None:
        known = json.loads(store.read_text()) if store.exists() else {}
        revision = subprocess.run(
            ["git", "-C", str(Path(sm.__file__).parent), "rev-parse", "--short", "HEAD"],
            capture_output=True,
            text=True,
            check=True,
        ).stdout.strip()
        known[str(seed)] = {"revision": revision, "results": results}
        store.write_text(json.dumps(known, indent=1))
    elif against.exists():
        stored = json.loads(against.read_text())
        if str(seed) in stored:
            compare(results, stored[str(seed)], Console())


def compare(results: list[dict[str, Any]], stored: dict[str, Any], console: Console) -> None:
    """Print both, and what the goals are measured by."""
    before = {result["name"]: result for result in stored["results"]}
    table = Table(title=f"{stored['revision']}, then this revision")
    for column in ("problem", "solved", "evaluations", "cost", "cost ratio", "seconds"):
        table.add_column(column)
    pairs = [(before[result["name"]], result) for result in results if result["name"] in before]
    ratios = []
    for old, new in pairs:
        both = old["solved"] and new["solved"]
        ratio = new["cost"] / old["cost"] if both else float("nan")
        if both:
            ratios.append(ratio)
        table.add_row(
            new["name"],
            f"{_yes(old)} → {_yes(new)}",
            f"{old['evaluations']} → {new['evaluations']}",
            "" if new["cost"] is None else f"{new['cost']:.6g}",
            f"{ratio:.5f}" if both else "",
            f"{old['seconds']:.2f} → {new['seconds']:.2f}",
        )
    console.print(table)
    console.print(f"solved: {_count(old for old, _ in pairs)} → {_count(new for _, new in pairs)}")
    lost = [new["name"] for old, new in pairs if old["solved"] and not new["solved"]]
    console.print(f"solved before and not now: {', '.join(lost) or 'none'}")
    for start, free in (("given", False), ("free", True)):
        chosen = [pair for pair in pairs if ("free start" in pair[0]["name"]) == free]
        for label, side in (("before", 0), ("now", 1)):
            counts = [pair[side]["evaluations"] for pair in chosen if pair[0]["solved"]]
            if not counts:
                continue
            median, most = np.percentile(counts, [50, 95])
            seconds = sum(pair[side]["seconds"] for pair in chosen)
            console.print(
                f"{start} start, {label}: {median:.0f} evaluations in the median and {most:.0f} at "
                f"95 % of those solved before; {seconds:.1f} s of one processor in all"
            )
    if not ratios:
        return
    console.print(f"cost ratio: largest {max(ratios):.5f}, median {np.median(ratios):.5f}")


def _yes(result: dict[str, Any]) -> str:
    return "yes" if result["solved"] else "no"


def _count(results: Any) -> int:
    return sum(result["solved"] for result in results)


if __name__ == "__main__":
    typer.run(main)
