"""Problems with tolerances: `python benchmarks/relaxed.py`.

200 random ones: arms, tasks, bands, cones, discs, windows, in world and in tool axes, from given
starts and free ones. Each is planned with its tolerances and without; what is verified is judged by
the tests' own kinematics. `--store` writes the results of a revision, `--against` compares with
those of another. Times are those of the processor.
"""

from __future__ import annotations

import json
import sys
import time
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from problems import PANDA_HOME
from rich.console import Console

import selfmotion as sm

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from support.oracle import Judge

ARMS = ("panda", "xarm7", "baxter", "ur5", "panda", "ur10")
COUNT = 200
# Every so many, the start is free.
FREE = 5
KINDS = ("band", "turn", "cone", "disc", "tool band", "window", "free row", "two")


def problem(number: int) -> tuple[str, sm.Problem]:
    """Return the name of a problem, and the problem."""
    rng = np.random.default_rng([23, number])
    robot = sm.load_robot(ARMS[number % len(ARMS)])
    kind = KINDS[number % len(KINDS)]
    # Homes of the others are upright, and singular.
    home = PANDA_HOME if robot.name == "panda" else robot.dexterous_configuration("pose")
    start = home + rng.uniform(-0.3, 0.3, robot.dof)
    pose, duration = robot.pose(start), float(np.round(rng.uniform(2.0, 5.0), 2))
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    size = float(np.round(rng.uniform(0.04, 0.15), 3))
    path: sm.paths.Path
    if rng.uniform() < 0.5:
        path = sm.paths.Circle.around(pose, size, duration, normal=normal)
    else:
        end = pose.copy()
        end.translation = pose.translation + 2.0 * size * normal
        path = sm.paths.Line(pose, end, duration)
    limits = [sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits()]
    cost = [sm.costs.JointVelocity(), sm.costs.JointAcceleration()][int(rng.uniform() < 0.2)]
    asked = sm.Problem(
        robot,
        path,
        "pose",
        None if number % FREE == FREE - 1 else start,
        costs=[cost],
        constraints=limits,
        relaxations=_relaxations(kind, duration, rng),
    )
    where = "free start" if asked.given_start is None else "given start"
    return f"{number:03d} {robot.name}, {kind}, {where}", asked


def _relaxations(kind: str, duration: float, rng: np.random.Generator) -> list[sm.Relaxation]:
    length, angle = 10.0 ** rng.uniform(-3.5, -1.7), 10.0 ** rng.uniform(-1.7, 0.3)
    times = (float(rng.uniform(0.1, 0.4)) * duration, float(rng.uniform(0.6, 0.9)) * duration)
    row = str(rng.choice(["x", "y", "z"]))
    turn = sm.Relaxation("rz", angle)
    made = {
        "band": [sm.Relaxation(row, length)],
        "turn": [turn],
        "cone": [sm.Relaxation(("rx", "ry"), 0.5 * angle)],
        "disc": [sm.Relaxation(("x", "y"), length, axes="tool")],
        "tool band": [sm.Relaxation("z", length, axes="tool")],
        "window": [sm.Relaxation("rz", angle, during=times)],
        "free row": [sm.Relaxation("rz")],
        "two": [turn, sm.Relaxation("z", length, axes="tool")],
    }
    return made[kind]


def solve(number: int) -> dict[str, Any]:
    """Plan a problem with its tolerances and without, and return what came of both."""
    name, asked = problem(number)
    return {"name": name, **_planned(asked), "strict": _planned(asked, relaxations=())}


def _planned(asked: sm.Problem, **changes: Any) -> dict[str, Any]:
    began = time.process_time()
    try:
        # Six axes have no self-motion without a tolerance.
        plan = sm.plan(replace(asked, **changes))
    except sm.SelfmotionError as error:
        seconds = time.process_time() - began
        return {"solved": False, "said": str(error)[:200], "seconds": seconds}
    found = {
        "seconds": time.process_time() - began,
        "solved": plan.certificate.verified,
        "said": plan.certificate.verdict[:200],
        "cost": plan.report.cost,
        "evaluations": plan.report.evaluations,
    }
    if plan.certificate.verified:
        # Bodies of these arms are meshes: others judge those.
        judge = replace(Judge.of(plan), bodies=())
        found["false"] = list(judge.judge(plan.trajectory).refutes)
    return found


def main(
    first: Annotated[int, typer.Option(help="Number of the first problem.")] = 0,
    count: Annotated[int, typer.Option(help="How many.")] = COUNT,
    store: Annotated[Path | None, typer.Option(help="Write the results to a file.")] = None,
    against: Annotated[Path | None, typer.Option(help="Compare with these results.")] = None,
) -> None:
    """Plan all problems, and print what came of them."""
    warnings.simplefilter("ignore")
    out = Console(soft_wrap=True, highlight=False, markup=False)
    # Kernels are compiled, or loaded, before anything is timed.
    solve(FREE - 1)
    results = []
    for number in range(first, first + count):
        results.append(solve(number))
        told = results[-1]
        cost = told.get("cost")
        out.print(
            f"{told['name']}: {'verified' if told['solved'] else told['said']}, cost {cost}, "
            f"{told.get('evaluations')} evaluations, {told['seconds']:.2f} s, "
            f"{told['strict']['seconds']:.2f} s without"
        )
        if store is not None:
            store.write_text(json.dumps(results, indent=1))
    _sum_up(results, out)
    if against is not None:
        _compare(results, json.loads(against.read_text()), out)


def _sum_up(results: list[dict[str, Any]], out: Console) -> None:
    solved = [each for each in results if each["solved"]]
    false = [each["name"] for each in solved if each["false"]]
    both = [each for each in solved if each["strict"]["solved"]]
    out.print(f"{len(solved)} of {len(results)} verified; false: {false or 'none'}")
    if not both:
        return
    evaluations = np.array([each["evaluations"] for each in solved])
    times = np.array([each["seconds"] / each["strict"]["seconds"] for each in both])
    costs = np.array([each["cost"] / each["strict"]["cost"] for each in both])
    out.print(
        f"evaluations: median {np.median(evaluations):.0f}, most {evaluations.max()}; against the "
        f"same without tolerances ({len(both)}): time median {np.median(times):.2f}, 95 % "
        f"{np.quantile(times, 0.95):.2f}, most {times.max():.2f}; cost median "
        f"{np.median(costs):.4f}, most {costs.max():.6f}"
    )


def _compare(results: list[dict[str, Any]], before: list[dict[str, Any]], out: Console) -> None:
    known = {each["name"]: each for each in before}
    pairs = [(each, known[each["name"]]) for each in results if each["name"] in known]
    lost = [now["name"] for now, was in pairs if was["solved"] and not now["solved"]]
    both = [(now, was) for now, was in pairs if was["solved"] and now["solved"]]
    costs = np.array([now["cost"] / was["cost"] for now, was in both])
    times = np.array([now["seconds"] / was["seconds"] for now, was in both])
    sums = [sum(each[k]["seconds"] for each in both) for k in (0, 1)]
    new = sum(now["solved"] and not was["solved"] for now, was in pairs)
    dearer = [
        f"{now['name']} {c:.4f}" for (now, _), c in zip(both, costs, strict=True) if c > 1.0005
    ]
    out.print(
        f"before: {sum(was['solved'] for _, was in pairs)} verified; lost: {lost or 'none'}; new: "
        f"{new}; cost median {np.median(costs):.4f}, least {costs.min():.4f}, most "
        f"{costs.max():.4f}; dearer by more than 0.05 %: {dearer or 'none'}; time median "
        f"{np.median(times):.2f}, most {times.max():.2f}, sum {sums[0] / sums[1]:.2f}"
    )


if __name__ == "__main__":
    typer.run(main)
