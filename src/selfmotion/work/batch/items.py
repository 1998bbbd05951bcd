"""Items of a batch: problems, and their descriptions for workers."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from selfmotion.basics import ProblemError, SelfmotionError
from selfmotion.planning.planner import PlanRequest
from selfmotion.planning.result import files_of, identity_of, key_of, own_modules
from selfmotion.problem.costs import FunctionCost
from selfmotion.problem.problem import Problem, problem_to_dict

# Arguments of `plan` besides the problem.
OPTIONS = ("search", "optimizer", "tolerance", "max_evaluations")


@dataclass(frozen=True, eq=False)
class Item:
    """One of many problems.

    Attributes
    ----------
    name : str
        Name of its files.
    make : callable
        Returns the request to plan; raises SelfmotionError where the problem is wrong.
    settings : dict
        What tells it from the other items: keys of the grid and their values.
    file : Path or None
        The problem file, of whose grid it is a combination.
    write : callable, optional
        Writes the problem file of this combination to a path.
    """

    name: str
    make: Callable[[], PlanRequest]
    settings: Mapping[str, Any] = field(default_factory=dict)
    file: Path | None = None
    write: Callable[[Path], None] | None = None

    @cached_property
    def description(self) -> dict[str, Any]:
        """What a worker needs to plan it.

        Raises
        ------
        SelfmotionError
            The problem is wrong, or cannot be sent to another process.
        """
        request = self.make()
        functions = [cost.name for cost in request.problem.costs if isinstance(cost, FunctionCost)]
        if functions:
            raise ProblemError(
                f"cost '{functions[0]}' is a function, which cannot be sent to another process; "
                f"derive a class from selfmotion.costs.Cost"
            )
        problem = problem_to_dict(request.problem)
        # A class in a script that is run is known to processes that begin with it alone.
        modules = [name for name in own_modules(problem) if name != "__main__"]
        options = {
            **request.settings,
            "goal": request.goal,
            "keep": request.keep,
            "parts": request.parts,
        }
        files = files_of(request.problem.robot, request.problem.all_constraints, {})
        return {"problem": problem, "options": options, "modules": modules, "files": files}

    def drop_description(self) -> None:
        """Drop the description, which is large and computed again when it is needed."""
        self.__dict__.pop("description", None)

    @cached_property
    def key(self) -> str:
        """A digest of all that decides the plan; where the problem is wrong, the error."""
        try:
            description = self.description
        except SelfmotionError as error:
            return f"error: {error}"
        identity = description["problem"], identity_of(description["options"])
        return key_of(identity, description["files"])


def problem_items(problems: list[Problem | PlanRequest], options: Mapping[str, Any]) -> list[Item]:
    """Return an item for each problem, to plan with options unless it says its own.

    Raises
    ------
    ProblemError
        An option is not known or has no effect, or a problem is none.
    """
    for name in options:
        if name not in OPTIONS:
            raise ProblemError(f"{name}: is no option of a batch; expected {', '.join(OPTIONS)}")
        if problems and all(isinstance(item, PlanRequest) for item in problems):
            raise ProblemError(
                f"{name}: has no effect: each problem is a PlanRequest, which says its own"
            )
    digits = len(str(max(len(problems) - 1, 0)))
    items = []
    for k, item in enumerate(problems):
        if not isinstance(item, Problem | PlanRequest):
            raise ProblemError(f"problems[{k}] is {item!r}, expected a Problem or a PlanRequest")
        request = item if isinstance(item, PlanRequest) else PlanRequest(item, **options)
        items.append(Item(f"plan-{k:0{digits}d}", lambda request=request: request))  # type: ignore[misc]
    return items


def unread_item(file: Path, error: SelfmotionError) -> Item:
    """Return the item of a file that cannot be read: its row will say why."""

    def make() -> PlanRequest:
        raise error

    return Item(file.stem, make, {}, file)
