"""Full paths of modules that have moved: where they are now, for one version."""

import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from types import ModuleType

# Former package → present one.
MOVED = {
    "batch": "work.batch",
    "cam": "shop.cam",
    "cli": "shell.cli",
    "collision": "model.collision",
    "controllers": "shop.controllers",
    "documents": "shell.documents",
    "follow": "model.follow",
    "kernels": "model.kernels",
    "nodes": "planning.nodes",
    "paper": "planning.paper",
    "path": "model.path",
    "planning": "planning.planner",
    "problem": "problem.problem",
    "sheet": "shell.sheet",
    "task": "model.task",
    "transfer": "planning.transfer",
    "warm": "realtime.warm",
}
# Former module → present one.
MOVED_MODULES = {
    "model.follow.augmented": "model.follow.relaxed",
    "planning.nodes.samples": "planning.formulation.sampled",
    "paper.rollout": "planning.rollout.rollout",
    "planning.paper.minimum_norm": "planning.rollout.minimum_norm",
    "planning.paper.rollout": "planning.rollout.rollout",
    "planning.paper.still": "planning.rollout.minimum_norm",
    "planning.planner.candidate": "planning.planner.guess",
    "planning.planner.polish": "planning.planner.local_search",
    "planning.planner.solutions": "planning.planner.outcomes",
    "planning.result.asked": "planning.result.specification",
    "planning.search.nodes": "planning.search.vertices",
    "planning.search.stretches": "planning.search.segments",
    "planning.transfer.ways": "planning.transfer.rrt_connect",
    "problem.problem.augmented": "planning.formulation.formulation",
    "problem.problem.of_arm": "planning.formulation.tolerances",
    "realtime.clear": "realtime.moving_clearance",
    "shell.cli.reread": "shell.cli.file_verification",
    "shop.controllers.feed_stretches": "shop.controllers.feed_segments",
    "shop.controllers.commented_lines": "shop.controllers.program_lines",
    "shop.controllers.read_segments": "shop.controllers.segment_building",
    "shop.controllers.read_stretches": "shop.controllers.segment_building",
    "shop.controllers.stretches": "shop.controllers.segments",
    "shop.sheet": "shell.sheet",
    "work.job.kernels": "work.job.two_opt",
    "work.placement.corners": "work.placement.correction_range",
}


class MovedModules:
    """A finder of the import system: finds no module, but says where moved ones are."""

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Raise ModuleNotFoundError with the new path of a moved module; else find nothing."""
        top, *parts = name.split(".")
        if top != "selfmotion" or not parts:
            return None
        if module := MOVED_MODULES.get(".".join(parts)):
            raise ModuleNotFoundError(f"{name} is {top}.{module} now", name=name)
        if parts[0] not in MOVED:
            return None
        new_package = f"{top}.{MOVED[parts[0]]}"
        # A package that has moved into itself: the name is of the present one.
        if name.startswith(new_package):
            return None
        new_name = ".".join([new_package, *parts[1:]])
        if _exists(new_name):
            raise ModuleNotFoundError(f"{name} is {new_name} now", name=name)
        return None


def tell_moved() -> None:
    """Register `MovedModules`, which is used only after all other finders fail."""
    if not any(isinstance(each, MovedModules) for each in sys.meta_path):
        sys.meta_path.append(MovedModules())


def _exists(module: str) -> bool:
    try:
        return find_spec(module) is not None
    except ModuleNotFoundError:
        return False
