"""Tasks of a job: plans of seams and moves, in this or other processes, stored when finished.

The result of a task, random numbers included, depends on its parameters alone. It is the same in
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
from selfmotion.problem.constraints import (
    Clearance,
    Constraint,
    clearances_among,
    without_clearances,
)
from selfmotion.problem.costs import FunctionCost
from selfmotion.problem.problem import (
    USUAL_COSTS,
    Problem,
    arm_and_constraints,
    describe_arm,
    problem_from_dict,
    problem_to_dict,
)
from selfmotion.work.job.earlier_program import EarlierProgram, adapted_waypoints
from selfmotion.work.job.result_cache import ResultCache, serves
from selfmotion.work.job.seam import Seam, backwards
from selfmotion.work.job.step import Step

# Clearances that are kept in memory: of a seam, and of the moves around it.
_CACHED_CLEARANCES = 8


# A task by its parameters, and its result.
_Task = Mapping[str, Any]
_Result = TypeVar("_Result")
# The number of a finished task, and its result.
_Finished = tuple[int, Any]


@dataclass(frozen=True, eq=False)
class JobSettings:
    """The settings that all seams and moves of a job share.

    Attributes
    ----------
    robot : RobotModel
    constraints : tuple of Constraint
    clearances : tuple of Clearance
        Bodies that come in addition are kept clear of as the first one says.
    branches : int
        Motions in different branches for each seam.
    move_seconds : float
        Of the processor, for each move [s].
    seed : int
    """

    robot: RobotModel
    constraints: tuple[Constraint, ...]
    clearances: tuple[Clearance, ...]
    branches: int
    move_seconds: float
    seed: int
    _clearances: dict[tuple[str, ...], Clearance] = field(default_factory=dict, repr=False)

    def clearances_with(self, obstacles: Sequence[Any]) -> tuple[Clearance, ...]:
        """Return the clearances, the first one with further obstacles."""
        if not obstacles:
            return self.clearances
        return self.clearance_from(obstacles), *self.clearances[1:]

    def clearance_from(self, obstacles: Sequence[Any]) -> Clearance:
        """Return the first clearance with further obstacles."""
        key = tuple(item.name for item in obstacles)
        if key not in self._clearances:
            # Made once for a seam and the move to it, since collision models take time.
            if len(self._clearances) >= _CACHED_CLEARANCES:
                self._clearances.clear()
            clearance = self.clearances[0] if self.clearances else Clearance(distance=0.0)
            obstacles = (*clearance.obstacles, *obstacles)
            self._clearances[key] = replace(clearance, obstacles=obstacles, srdf=None)
        return self._clearances[key]

    def problem(self, seam: Seam, obstacles: Sequence[Any] = (), turned: bool = False) -> Problem:
        """Return the problem of a seam, with further obstacles."""
        clearances = self.clearances_with(obstacles)
        problem = problem_of_seam(self.robot, seam, self.constraints, clearances)
        return backwards(problem) if turned else problem

    def move_constraints(self, obstacles: Sequence[Any]) -> tuple[Constraint, ...]:
        """Return the constraints of moves, with further obstacles."""
        found = self.clearances_with(obstacles)
        has_bodies = self.robot.urdf.has_collisions or any(item.obstacles for item in found)
        return (*self.constraints, *(found if has_bodies else ()))


def problem_of_seam(
    robot: RobotModel,
    seam: Seam,
    constraints: Sequence[Constraint],
    clearances: Sequence[Clearance],
) -> Problem:
    """Return the problem of a seam, with the constraints and clearances of its job.

    A clearance of its own comes in addition; the job's is left out where that one keeps as far.
    """
    own = clearances_among(seam.constraints)
    shared = [
        item
        for item in clearances
        if item.obstacles or not any(each.keeps_as_far(item) for each in own)
    ]
    return Problem(
        robot,
        seam.path,
        seam.task,
        costs=USUAL_COSTS if seam.costs is None else tuple(seam.costs),
        constraints=(*constraints, *without_clearances(seam.constraints)),
        relaxations=tuple(seam.relaxations),
        clearance=(*own, *shared),
    )


class Work:
    """Plans the seams and moves of a job.

    Parameters
    ----------
    settings : JobSettings
    cache : ResultCache
    executor : Executor or None
        None for this process.
    progress : Progress
    earlier : EarlierProgram, optional
        Whose motions moves begin with.
    """

    def __init__(
        self,
        settings: JobSettings,
        cache: ResultCache,
        executor: Executor | None,
        progress: Progress,
        earlier: EarlierProgram | None = None,
    ) -> None:
        self.settings, self._cache, self._executor = settings, cache, executor
        self.tell, self.earlier = progress, earlier

    def unchanged_plan(self, seam: Seam) -> tuple[Plan | None, str]:
        """Return the earlier plan of a seam that has not changed, or why there is none."""
        if self.earlier is None:
            return None, ""
        settings, earlier_plan = self.settings, self.earlier.plan_of(seam)
        problem = settings.problem(seam, turned=earlier_plan is not None and earlier_plan[1])
        constraints, clearances = settings.constraints, settings.clearances
        return self.earlier.unchanged_plan(seam, problem, constraints, clearances)

    def like_before(
        self, wanted: Sequence[tuple[Seam, Problem, Plan | None]]
    ) -> list[tuple[list[Plan], str]]:
        """Return for each problem the verified plan that begins at another plan's motion.

        Where there is no such plan, the `branches` of the problem.
        """
        tasks = self._branches([(seam, problem) for seam, problem, _ in wanted])
        likes = [{} if plan is None else {"like": plan} for _, _, plan in wanted]
        both = zip(tasks, likes, strict=True)
        return self._plans([{**task, **like} for task, like in both], "seam")

    def branches(
        self, wanted: Sequence[tuple[Seam, Problem]], allowed: Problem | None = None
    ) -> list[tuple[list[Plan], str]]:
        """Return verified plans of problems in different branches, and why there are none.

        Their starts keep the constraints of the problem `allowed`, where one is given.
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
                "count": self.settings.branches,
                "seed": [self.settings.seed, _number(seam.name.encode())],
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
        return [plan for plan, _ in self._plans(tasks, "nearby")]

    def moves(
        self, wanted: Sequence[tuple[Array, Array, Sequence[Any]]], names: Sequence[str]
    ) -> list[Move]:
        """Return moves between configurations (n,), with the further obstacles of each.

        Progress shows their `names`.
        """
        tasks, earlier = list[_Task](), list[Move | None]()
        for (first, last, obstacles), name in zip(wanted, names, strict=True):
            ends = np.stack([first, last])
            known = None if self.earlier is None else self.earlier.move_like(ends)
            earlier.append(known)
            tasks.append(
                {
                    "arm": (self.settings.robot, self.settings.move_constraints(obstacles)),
                    "named": name,
                    "ends": ends,
                    "seconds": self.settings.move_seconds,
                    "seed": [self.settings.seed, _number(ends.tobytes())],
                    **({} if known is None else {"way": adapted_waypoints(known.motion, ends)}),
                }
            )
        cache = self._cache
        files = [
            cache.file("move", partial(_description_of_move, task), *task["arm"]) for task in tasks
        ]
        stored = list[Move | None]()
        for file, task, known in zip(files, tasks, earlier, strict=True):
            missing = _missing(task, "")
            # Judged by the present constraints: files of bodies may have changed.
            arm, constraints = missing.robot, missing.constraints
            again = None if known is None else replace(known, robot=arm, constraints=constraints)
            same = again is not None and serves(again, missing, task["ends"])
            stored.append(again if same else cache.move(file, missing, task["ends"]))
        return self._results_of("move", "move", tasks, files, stored, cache.store_move)

    def _plans(self, tasks: Sequence[_Task], stage: str) -> list[tuple[list[Plan], str]]:
        cache = self._cache
        files = [
            cache.file(
                f"{stage} {task['name']}",
                partial(_description_of_plans, task),
                self.settings.robot,
                _constraints_of(task),
            )
            for task in tasks
        ]
        both = zip(files, tasks, strict=True)
        stored = [cache.plans(file, task["problem"]) for file, task in both]
        return self._results_of("plans", stage, tasks, files, stored, cache.store_plans)

    def _results_of(
        self,
        kind: str,
        stage: str,
        tasks: Sequence[_Task],
        files: Sequence[Path | None],
        stored: Sequence[_Result | None],
        store: Callable[[Path | None, _Result], None],
    ) -> list[_Result]:
        """Return the results of tasks: stored ones, and new ones, stored when finished."""
        results = {
            k: stored_result for k, stored_result in enumerate(stored) if stored_result is not None
        }
        todo = {k: task for k, task in enumerate(tasks) if k not in results}
        with closing(self._computed(todo, kind)) as new:
            # In other processes all begin at once, so that none is under way alone.
            here = [] if self._executor is not None else list(todo)
            for number in range(1, len(tasks) + 1):
                k = number - 1 - (len(tasks) - len(todo))
                named = tasks[here[k]] if k >= 0 and here else {}
                about = named.get("named", named.get("name", ""))
                self.tell(f"{stage} '{about}'" if about else stage, number, len(tasks))
                if number > len(tasks) - len(todo):
                    k, result = next(new)
                    store(files[k], result)
                    results[k] = result
        return [results[k] for k in range(len(tasks))]

    def _computed(self, tasks: Mapping[int, _Task], kind: str) -> Generator[_Finished, None, None]:
        """Yield task and result as each is finished; other processes begin all at once."""
        if self._executor is None:
            for k, task in tasks.items():
                yield k, _compute_move(task) if kind == "move" else _compute_plans(task)
            return
        arms: dict[str, Any] = {}
        sent = {self._submitted(task, kind): k for k, task in tasks.items()}
        try:
            for future in as_completed(sent):
                result, why = future.result()
                k = sent[future]
                if kind == "move":
                    missing = _missing(tasks[k], why)
                    yield k, _unpacked(result, load_move, arms) if result else missing
                else:
                    yield k, ([_unpacked(data, load_plan, arms) for data in result], why)
        finally:
            # After an interruption the others are not waited for.
            for future in sent:
                future.cancel()

    def _submitted(self, task: _Task, kind: str) -> "Future[Any]":
        if self._executor is None:
            raise RuntimeError("there is no other process to send to")
        if kind == "move":
            files = self._cache.files(*task["arm"])
            description = _description_of_move(task)
            return self._executor.submit(_move_for_parent, {**description, "files": files})
        files = self._cache.files(self.settings.robot, _constraints_of(task))
        like = {"like": _packed(task["like"])} if "like" in task else {}
        description = {**_description_of_plans(task), **like, "files": files}
        return self._executor.submit(_plans_for_parent, description)


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


def _compute_plans(task: _Task) -> tuple[list[Plan], str]:
    problem = task["problem"]
    with one_blas_thread():
        if "like" in task:
            plan = like_before(problem, task["like"])
            if plan is not None:
                return [plan], ""
        if "near" not in task:
            generator = np.random.default_rng(task["seed"])
            return branches(problem, task["count"], generator, task.get("allowed"))
        start = near_start(problem, np.array(task["near"]))
        if start is None:
            return [], "no configuration near"
        plan, why = from_start(problem, start)
        return ([], why) if plan is None else ([plan], "")


def _compute_move(task: _Task) -> Move:
    robot, constraints = task["arm"]
    first, last = task["ends"]
    generator = np.random.default_rng(task["seed"])
    with one_blas_thread():
        free = FreeMotions(robot, constraints, generator, obeying(silent))
        return free.between(first, last, task["seconds"], task.get("way"))


def _missing(task: _Task, trouble: str) -> Move:
    robot, constraints = task["arm"]
    return Move(robot, constraints_of_moves(robot, constraints), None, trouble)


def _description_of_plans(task: _Task) -> dict[str, Any]:
    problems = [name for name in ("problem", "allowed") if name in task]
    description = {**task, **{name: problem_to_dict(task[name]) for name in problems}}
    if "like" in task:
        motion = task["like"].trajectory
        description["like"] = digest_of(motion.t, motion.q)
    return description


def _description_of_move(task: _Task) -> dict[str, Any]:
    # The name is not part of the key.
    description = {key: value for key, value in task.items() if key != "named"}
    return {**description, "arm": describe_arm(*task["arm"]), "ends": task["ends"].tolist()}


# Arms and bodies of tasks done before in this process.
_arms = ArmCache()


def _plans_for_parent(task: _Task) -> tuple[list[bytes], str]:
    """Return the plans of a task, in another process, as the bytes of their files."""
    arms = _arms.of(task["files"])
    problems = [name for name in ("problem", "allowed") if name in task]
    values: dict[str, Any] = {name: problem_from_dict(task[name], arms) for name in problems}
    if "like" in task:
        values["like"] = _unpacked(task["like"], load_plan, arms)
    plans, reason = _compute_plans({**task, **values})
    return [_packed(plan) for plan in plans], reason


def _move_for_parent(task: _Task) -> tuple[bytes, str]:
    arms = _arms.of(task["files"])
    arm, ends = arm_and_constraints(task["arm"], arms), np.array(task["ends"])
    move = _compute_move({**task, "arm": arm, "ends": ends})
    return (b"" if move.trajectory is None else _packed(move)), move.trouble


def _packed(result: Plan | Move) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "result.npz")
        result.save(file)
        return file.read_bytes()


def _unpacked(data: bytes, load: Any, arms: dict[str, Any]) -> Any:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "result.npz")
        file.write_bytes(data)
        return load(file, known=arms)


def seam_steps(
    seam: Seam, plan: Plan, turned: bool, work: Work, obstacles: Sequence[Obstacle] = ()
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
        at_rest = Trajectory(times, q, np.zeros_like(q), names, np.zeros_like(q))
        # The obstacles that it leaves are there during the wait.
        left = [item for item in seam.leaves if item.name not in seam.may_meet]
        wait = Move(plan.robot, work.settings.move_constraints((*obstacles, *left)), at_rest)
        steps.append(Step(f"{seam.name}, wait", wait, may_meet=tuple(seam.may_meet)))
    return steps
