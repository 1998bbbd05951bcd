"""Redundancy maps of the suite's problems against brute force, pixel by pixel.

Of problems with one degree of redundancy: at each pixel Newton's method from many random starts
finds all configurations, the plan's branch is chained through them, and limits and distances
decide. Of slices, which depend on the way to them, the maps' own configurations are judged.
Distances are coal's between the URDF's own bodies, and, where all are convex, MuJoCo's.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import coal
import numpy as np
import pinocchio as pin
import typer
from rich import box as tables
from rich.table import Table
from suite import DATA, PathProblem, load, plan

import selfmotion as sm
from selfmotion.basics import Array, Flags, Ints, silent
from selfmotion.problem.problem import envelope_of_problem
from selfmotion.result import Reason, RedundancyMap
from selfmotion.shell.cli.tables import console

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from support.redundancy_oracle import Bodies, Oracle

# Share of pixels that may differ; none is left out beside borders.
ALLOWED_SHARE = 0.005
# Reasons that the brute force does not look at: what has them is allowed otherwise.
NOT_JUDGED = (Reason.ALLOWED, Reason.SINGULAR, Reason.SPEED)
# What the maps say of bodies.
OF_BODIES = (Reason.OBSTACLE, Reason.ITSELF)


@dataclass(frozen=True)
class Compared:
    """A problem's map, and what brute force says of it.

    Attributes
    ----------
    name, coordinate : str
    degrees : int
        Of redundancy.
    seconds : float
        For a map of the usual size.
    pixels, wrong, wrong_on_line : int
        All pixels compared; those that differ; and of these the ones on the plan's line.
    """

    name: str
    coordinate: str
    degrees: int
    seconds: float
    pixels: int
    wrong: int
    wrong_on_line: int

    @property
    def is_right(self) -> bool:
        """Whether few enough pixels differ, and none on the plan's line."""
        return self.wrong <= ALLOWED_SHARE * self.pixels and not self.wrong_on_line


class Meetings:
    """Whether the URDF's own bodies meet, by coal, in the pairs of a collision model."""

    def __init__(self, robot: sm.RobotModel, obstacles: Any, pairs: Any) -> None:
        self._robot, self._geometry = robot, robot.geometry(pin.GeometryType.COLLISION)
        names = [robot.link_of(item.parentFrame) for item in self._geometry.geometryObjects]
        for item in obstacles:
            body = pin.GeometryObject(item.name, 0, 0, item.pose, coal.Box(*item.size))
            self._geometry.addGeometryObject(body)
            names.append(item.name)
        wanted = {frozenset(pair) for pair in pairs}
        for i, first in enumerate(names):
            for j, second in enumerate(names[:i]):
                if first != second and frozenset((first, second)) in wanted:
                    self._geometry.addCollisionPair(pin.CollisionPair(j, i))

    def at(self, q: Array) -> Flags:
        """Return the mask of configurations (K, n) in which some pair meets."""
        model, data = self._robot.model, self._robot.model.createData()
        places = self._geometry.createData()
        return np.array(
            [
                pin.computeCollisions(model, data, self._geometry, places, x, True)
                for x in self._robot.coupling.spread(q)
            ],
            dtype=bool,
        )


def compared(problem: PathProblem, columns: int, rows: int, starts: int, seed: int) -> Compared:
    """Plan a problem, and compare its map."""
    found, _ = plan(problem, seed, silent)
    found.redundancy_map(shape=(2, 2))
    began = time.perf_counter()
    found.redundancy_map()
    seconds = time.perf_counter() - began
    shown = found.redundancy_map(shape=(columns, rows))
    wrong = differences(shown.state, by_brute_force(found, shown, problem, starts))
    nearest = np.abs(shown.coordinate - shown.plan_line[:, None]).argmin(axis=1)
    on_line = wrong[np.arange(columns), nearest]
    return Compared(
        problem.name,
        shown.label,
        shown.redundancy,
        seconds,
        wrong.size,
        int(wrong.sum()),
        int(on_line.sum()),
    )


def by_brute_force(found: sm.Plan, shown: RedundancyMap, problem: PathProblem, starts: int) -> Ints:
    """Return what stops the arm at each pixel, as brute force has it, (N, M)."""
    model, required = envelope_of_problem(found.problem).bodies[0]
    own = found.trajectory(shown.times)
    oracle = Oracle(found.problem, shown, own, (), (), required, starts)
    if shown.redundancy == 1 and problem.robot.reference is None:
        # Without bodies: those are of the URDF, and are asked below.
        state, q = oracle.states()
    else:
        state, q = oracle.judged(shown.q), shown.q
    inside = state == Reason.ALLOWED
    meets = np.zeros(state.shape, dtype=bool)
    meets[inside] = Meetings(problem.robot, problem.obstacles, model.pairs).at(q[inside])
    if model.is_all_convex:
        near = Bodies(problem.robot, problem.obstacles, model.pairs).distances(q[inside], 1e-3)
        by_mujoco = near.min(axis=1, initial=1.0) < required
        print(f"{problem.name}: coal and MuJoCo differ at {(by_mujoco != meets[inside]).sum()}")
    return np.where(meets, int(Reason.ITSELF), state)


def differences(said: Ints, brute: Ints) -> Flags:
    """Return which pixels of a map differ from brute force, (N, M)."""
    said = np.where(np.isin(said, NOT_JUDGED), int(Reason.ALLOWED), said)
    said = np.where(np.isin(said, OF_BODIES), int(Reason.ITSELF), said)
    return np.asarray(said != brute)


def main(
    only: Annotated[list[str] | None, typer.Option(help="Names of problems; default: all.")] = None,
    columns: Annotated[int, typer.Option(help="Times that are compared.")] = 9,
    rows: Annotated[int, typer.Option(help="Values of the coordinate.")] = 91,
    starts: Annotated[int, typer.Option(help="Random starts at each pixel.")] = 64,
    seed: Annotated[int, typer.Option(help="Of the search's random numbers.")] = 0,
) -> None:
    """Compare the map of every problem of the suite with brute force."""
    table = Table(box=tables.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    heads = ("problem", "coordinate", "degrees", "map", "pixels", "differ", "on the line")
    for head in heads:
        table.add_column(head, overflow="fold")
    every = []
    for folder in sorted(DATA.glob("*/")):
        if not (folder / "problem.json").is_file() or (only and folder.name not in only):
            continue
        item = compared(load(folder), columns, rows, starts, seed)
        every.append(item)
        table.add_row(
            item.name,
            item.coordinate,
            str(item.degrees),
            f"{item.seconds:.2f} s",
            str(item.pixels),
            str(item.wrong),
            str(item.wrong_on_line),
        )
        print(item, flush=True)
    console().print(table)
    sys.exit(0 if all(item.is_right for item in every) else 1)


if __name__ == "__main__":
    typer.run(main)
