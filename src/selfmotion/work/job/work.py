"""Work of a job: plans of seams and moves, in this or other processes, saved when finished.

A piece of work depends on its parameters alone, its random numbers too: the result is the same in
every process, and in any order.
"""

import tempfile
import zlib
from collections.abc import Callable, Generator, Mapping, Sequence
from concurrent.futures import Executor, Future, as_completed
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from selfmotion.basics import (
    Array,
    ProblemError,
    Progress,
    digest_of,
    obeying,
    one_blas_thread,
    silent,
)
from selfmotion.model.collision import Obstacle
from selfmotion.model.motion import Trajectory
from selfmotion.model.robot import RobotModel
from selfmotion.planning.planner import branches, from_start, like_before, near_start
from selfmotion.planning.result import ArmCache, Move, Plan, load_move, load_plan
from selfmotion.planning.transfer import FreeMotions, constraints_of_moves
from selfmotion.problem.constraints import Clearance, Constraint, said_once
from selfmotion.problem.costs import FunctionCost
from selfmotion.problem.problem import (
    Problem,
    arm_and_constraints,
    describe_arm,
    problem_from_dict,
    problem_to_dict,
)
from selfmotion.work.job.files import Earlier, Shelf, leads, way_along
from selfmotion.work.job.seam import Seam, Step, backwards

# Clearances that are remembered: of a seam, and of the moves around it.
_REMEMBERED = 8


# A piece of work by its parameters, and its result.
_Task = Mapping[str, Any]
_Made = TypeVar("_Made")
# Which task is finished, and what came of it.
_Finished = tuple[int, Any]


@dataclass(frozen=True, eq=False)
class Asked:
    """The settings that all seams and moves of a job share.

    Attributes
    ----------
    robot : RobotModel
    constraints : tuple of Constraint
    clearance : Clearance or None
    branches : int
        Motions in different branches for each seam.
    move_seconds : float
        Of the processor, for each move [s].
    seed : int
    """

    robot: RobotModel
    constraints: tuple[Constraint, ...]
    clearance: Clearance | None
    branches: int
    move_seconds: float
    seed: int
    _apart: dict[tuple[str, ...], Clearance] = field(default_factory=dict, repr=False)

    def apart(self, standing: Sequence[Any]) -> Clearance | None:
        """Return the clearance with what stands there by then as well."""
        if not standing:
            return self.clearance
        key = tuple(item.name for item in standing)
        if key not in self._apart:
            # Made once for a seam and the move to it: bodies take a while.
            if len(self._apart) >= _REMEMBERED:
                self._apart.clear()
            known = self.clearance or Clearance(distance=0.0)
            obstacles = (*known.obstacles, *standing)
            self._apart[key] = replace(known, obstacles=obstacles, srdf=None)
        return self._apart[key]

    def problem(self, seam: Seam, standing: Sequence[Any] = (), turned: bool = False) -> Problem:
        """Return the problem of a seam, with what stands there by then."""
        every = (*self.constraints, *seam.constraints)
        constraints, clearances = said_once(every, self.apart(standing))
        given = Problem(
            self.robot,
            seam.path,
            seam.task,
            constraints=constraints,
            relaxations=tuple(seam.relaxations),
            clearance=clearances,
        )
        if seam.costs is not None:
            given = replace(given, costs=tuple(seam.costs))
        return backwards(given) if turned else given

    def of_moves(self, standing: Sequence[Any]) -> tuple[Constraint, ...]:
        """Return the constraints of moves, with the obstacles that are there by then."""
        apart = self.apart(standing)
        has_bodies = self.robot.urdf.has_collisions or bool(apart and apart.obstacles)
        return self.constraints if apart is None or not has_bodies else (*self.constraints, apart)


class Work:
    """Does the work of a job.

    Parameters
    ----------
    asked : Asked
    shelf : Shelf
    executor : Executor or None
        None does all here.
    progress : Progress
    earlier : Earlier, optional
        Where ways of moves begin.
    """

    def __init__(
        self,
        asked: Asked,
        shelf: Shelf,
        executor: Executor | None,
        progress: Progress,
        earlier: Earlier | None = None,
    ) -> None:
        self.asked, self._shelf, self._executor = asked, shelf, executor
        self.tell, self.earlier = progress, earlier

    def kept(self, seam: Seam) -> tuple[Plan | None, str]:
        """Return the earlier plan of a seam of which the same is asked, or why there is none."""
        if self.earlier is None:
            return None, ""
        asked, known = self.asked, self.earlier.plan_of(seam)
        problem = asked.problem(seam, turned=known is not None and known[1])
        return self.earlier.kept(seam, problem, asked.constraints, asked.clearance)

    def like_before(
        self, wanted: Sequence[tuple[Seam, Problem, Plan | None]]
    ) -> list[tuple[list[Plan], str]]:
        """Return the verified plan of each problem that begins at the motion of another one.

        Where there is none, or no other one, `branches` of it.
        """
        tasks = self._branches([(seam, problem) for seam, problem, _ in wanted])
        likes = [{} if plan is None else {"like": plan} for _, _, plan in wanted]
        both = zip(tasks, likes, strict=True)
        return self._plans([{**task, **like} for task, like in both], "seam")

    def branches(
        self, wanted: Sequence[tuple[Seam, Problem]], allowed: Problem | None = None
    ) -> list[tuple[list[Plan], str]]:
        """Return verified plans of problems in different branches, and why there are none.

        Their starts keep clear of all that is asked by what is `allowed`, where something is.
        """
        tasks = self._branches(wanted, allowed)
        return self._plans(tasks, "seam" if allowed is None else "other ways")

    def _branches(
        self, wanted: Sequence[tuple[Seam, Problem]], allowed: Problem | None = None
    ) -> list[_Task]:
        return [
            {
                "problem": problem,
                "name": seam.name,
                "count": self.asked.branches,
                "seed": [self.asked.seed, _number(seam.name.encode())],
                **({} if allowed is None else {"allowed": allowed}),
            }
            for seam, problem in wanted
        ]

    def nearby(self, wanted: Sequence[tuple[Seam, Problem, Array]]) -> list[list[Plan]]:
        """Return the plans that begin nearest to configurations (n,), none or one."""
        tasks: list[_Task] = [
            {"problem": problem, "name": seam.name, "near": q.tolist()}
            for seam, problem, q in wanted
        ]
        return [found for found, _ in self._plans(tasks, "nearby")]

    def moves(
        self, wanted: Sequence[tuple[Array, Array, Sequence[Any]]], names: Sequence[str]
    ) -> list[Move]:
        """Return moves from configurations (n,) to others, with what stands there each time.

        Progress tells their `names`.
        """
        tasks, before = list[_Task](), list[Move | None]()
        for (first, last, standing), name in zip(wanted, names, strict=True):
            ends = np.stack([first, last])
            known = None if self.earlier is None else self.earlier.move_like(ends)
            before.append(known)
            tasks.append(
                {
                    "arm": (self.asked.robot, self.asked.of_moves(standing)),
                    "named": name,
                    "ends": ends,
                    "seconds": self.asked.move_seconds,
                    "seed": [self.asked.seed, _number(ends.tobytes())],
                    **({} if known is None else {"way": way_along(known.motion, ends)}),
                }
            )
        shelf = self._shelf
        files = [shelf.file("move", partial(_move_asked, task), *task["arm"]) for task in tasks]
        kept = list[Move | None]()
        for file, task, known in zip(files, tasks, before, strict=True):
            missing = _missing(task, "")
            # Judged by what is asked now: files of bodies may have changed.
            arm, asked = missing.robot, missing.constraints
            again = None if known is None else replace(known, robot=arm, constraints=asked)
            same = again is not None and leads(again, missing, task["ends"])
            kept.append(again if same else shelf.move(file, missing, task["ends"]))
        return self._finished("move", "move", tasks, files, kept, shelf.keep_move)

    def _plans(self, tasks: Sequence[_Task], stage: str) -> list[tuple[list[Plan], str]]:
        shelf = self._shelf
        files = [
            shelf.file(
                f"{stage} {task['name']}",
                partial(_plans_asked, task),
                self.asked.robot,
                _constraints_of(task),
            )
            for task in tasks
        ]
        both = zip(files, tasks, strict=True)
        kept = [shelf.plans(file, task["problem"]) for file, task in both]
        return self._finished("plans", stage, tasks, files, kept, shelf.keep_plans)

    def _finished(
        self,
        kind: str,
        stage: str,
        tasks: Sequence[_Task],
        files: Sequence[Path | None],
        kept: Sequence[_Made | None],
        keep: Callable[[Path | None, _Made], None],
    ) -> list[_Made]:
        """Return the results of tasks: saved ones, and new ones, which are saved when finished."""
        found = {k: known for k, known in enumerate(kept) if known is not None}
        todo = {k: task for k, task in enumerate(tasks) if k not in found}
        with closing(self._done(todo, kind)) as fresh:
            # In other processes all are begun at once.
            here = [] if self._executor is not None else list(todo)
            for number in range(1, len(tasks) + 1):
                k = number - 1 - (len(tasks) - len(todo))
                named = tasks[here[k]] if k >= 0 and here else {}
                about = named.get("named", named.get("name", ""))
                self.tell(f"{stage} '{about}'" if about else stage, number, len(tasks))
                if number > len(tasks) - len(todo):
                    k, made = next(fresh)
                    keep(files[k], made)
                    found[k] = made
        return [found[k] for k in range(len(tasks))]

    def _done(self, tasks: Mapping[int, _Task], kind: str) -> Generator[_Finished, None, None]:
        """Yield task and result as each is finished; other processes begin all at once."""
        if self._executor is None:
            for k, task in tasks.items():
                yield k, _move_here(task) if kind == "move" else _plans_here(task)
            return
        known: dict[str, Any] = {}
        sent = {self._sent(task, kind): k for k, task in tasks.items()}
        try:
            for future in as_completed(sent):
                found, why = future.result()
                k = sent[future]
                if kind == "move":
                    missing = _missing(tasks[k], why)
                    yield k, _unpacked(found, load_move, known) if found else missing
                else:
                    yield k, ([_unpacked(data, load_plan, known) for data in found], why)
        finally:
            # After an interruption the others are not waited for.
            for future in sent:
                future.cancel()

    def _sent(self, task: _Task, kind: str) -> "Future[Any]":
        if self._executor is None:
            raise RuntimeError("there is no other process to send to")
        if kind == "move":
            files = self._shelf.files(*task["arm"])
            return self._executor.submit(_move_there, {**_move_asked(task), "files": files})
        files = self._shelf.files(self.asked.robot, _constraints_of(task))
        like = {"like": _packed(task["like"])} if "like" in task else {}
        return self._executor.submit(_plans_there, {**_plans_asked(task), **like, "files": files})


def check_can_be_sent(costs: Sequence[Any]) -> None:
    """Raise ProblemError where a cost is a function: no file and no other process knows it."""
    for cost in costs:
        if isinstance(cost, FunctionCost):
            raise ProblemError(
                f"cost '{cost.name}' is a function, which can neither be kept in a folder nor sent "
                f"to another process; derive a class from selfmotion.costs.Cost"
            )


def _constraints_of(task: _Task) -> list[Constraint]:
    """Return the constraints of the plans of a task, and their starts."""
    problems = (task["problem"], task.get("allowed"))
    return [item for problem in problems if problem for item in problem.all_constraints]


def _number(data: bytes) -> int:
    return zlib.crc32(data)


def _plans_here(task: _Task) -> tuple[list[Plan], str]:
    problem = task["problem"]
    with one_blas_thread():
        if "like" in task:
            made = like_before(problem, task["like"])
            if made is not None:
                return [made], ""
        if "near" not in task:
            generator = np.random.default_rng(task["seed"])
            return branches(problem, task["count"], generator, task.get("allowed"))
        start = near_start(problem, np.array(task["near"]))
        if start is None:
            return [], "no configuration near"
        made, why = from_start(problem, start)
        return ([], why) if made is None else ([made], "")


def _move_here(task: _Task) -> Move:
    robot, constraints = task["arm"]
    first, last = task["ends"]
    generator = np.random.default_rng(task["seed"])
    with one_blas_thread():
        free = FreeMotions(robot, constraints, generator, obeying(silent))
        return free.between(first, last, task["seconds"], task.get("way"))


def _missing(task: _Task, trouble: str) -> Move:
    robot, constraints = task["arm"]
    return Move(robot, constraints_of_moves(robot, constraints), None, trouble)


def _plans_asked(task: _Task) -> dict[str, Any]:
    problems = [name for name in ("problem", "allowed") if name in task]
    asked = {**task, **{name: problem_to_dict(task[name]) for name in problems}}
    if "like" in task:
        motion = task["like"].trajectory
        asked["like"] = digest_of(motion.t, motion.q)
    return asked


def _move_asked(task: _Task) -> dict[str, Any]:
    # The name is not part of the key.
    asked = {key: value for key, value in task.items() if key != "named"}
    return {**asked, "arm": describe_arm(*task["arm"]), "ends": task["ends"].tolist()}


# Arms and bodies of tasks done before in this process.
_arms = ArmCache()


def _plans_there(task: _Task) -> tuple[list[bytes], str]:
    """Do a task in another process: plans as the bytes of their files."""
    known = _arms.of(task["files"])
    problems = [name for name in ("problem", "allowed") if name in task]
    made: dict[str, Any] = {name: problem_from_dict(task[name], known) for name in problems}
    if "like" in task:
        made["like"] = _unpacked(task["like"], load_plan, known)
    found, reason = _plans_here({**task, **made})
    return [_packed(plan) for plan in found], reason


def _move_there(task: _Task) -> tuple[bytes, str]:
    known = _arms.of(task["files"])
    arm, ends = arm_and_constraints(task["arm"], known), np.array(task["ends"])
    move = _move_here({**task, "arm": arm, "ends": ends})
    return (b"" if move.trajectory is None else _packed(move)), move.trouble


def _packed(made: Plan | Move) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "made.npz")
        made.save(file)
        return file.read_bytes()


def _unpacked(data: bytes, load: Any, known: dict[str, Any]) -> Any:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "made.npz")
        file.write_bytes(data)
        return load(file, known=known)


# The steps of a program that a seam becomes.


def seam_steps(
    seam: Seam, plan: Plan, turned: bool, work: Work, standing: Sequence[Obstacle] = ()
) -> list[Step]:
    """Return the steps of a seam: itself, and the wait after it."""
    steps = [
        Step(
            seam.name,
            plan,
            turned,
            tuple(seam.events),
            tuple(seam.leaves),
            tuple(seam.may_meet),
        )
    ]
    if seam.wait > 0.0:
        q = np.tile(plan.trajectory.q[-1], (2, 1))
        times, names = np.array([0.0, seam.wait]), plan.robot.joint_names
        still = Trajectory(times, q, np.zeros_like(q), names, np.zeros_like(q))
        # The obstacles that it leaves are there by then.
        left = [item for item in seam.leaves if item.name not in seam.may_meet]
        wait = Move(plan.robot, work.asked.of_moves((*standing, *left)), still)
        steps.append(Step(f"{seam.name}, wait", wait, may_meet=tuple(seam.may_meet)))
    return steps
