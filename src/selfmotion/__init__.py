"""Plans the self-motion of redundant arms along a prescribed tool motion.

The tool motion holds by construction; what is optimised is the self-motion, the joint motion in
the null space of the task.

What a first script needs is here. The rest is in namespaces: `costs`, `constraints`, `paths`,
`obstacles`, `files`, `errors`, `motion` (null motions), `optimise`, `robot` (coordinates),
`certificate`, `result`, `job`, `margins`, `placement`, `realtime`, `replay` and `baselines` (other
works' methods).
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any
from warnings import warn

from selfmotion import (
    certificate as certificate,
    constraints as constraints,
    costs as costs,
    errors as errors,
    motion as motion,
    obstacles as obstacles,
    optimise as optimise,
    paths as paths,
    result as result,
    robot as robot,
)
from selfmotion.basics import SelfmotionError as SelfmotionError, version as _version
from selfmotion.basics.moved import tell_moved as _tell_moved
from selfmotion.certificate import (
    Certificate as Certificate,
    Tolerance as Tolerance,
    certify as certify,
)
from selfmotion.model.follow import Follow as Follow, Follows as Follows
from selfmotion.model.motion import (
    PolynomialNullMotion as PolynomialNullMotion,
    Trajectory as Trajectory,
)
from selfmotion.model.robot import (
    NAMED_ARMS as NAMED_ARMS,
    RobotModel as RobotModel,
    load_robot as load_robot,
)
from selfmotion.model.task import Damping as Damping, Relaxation as Relaxation, Task as Task
from selfmotion.planning.optimise import QuasiNewton as QuasiNewton
from selfmotion.planning.planner import (
    Fastest as Fastest,
    Search as Search,
    fastest as fastest,
    plan as plan,
    plan_in_parts as plan_in_parts,
)
from selfmotion.planning.result import (
    Move as Move,
    Parts as Parts,
    Plan as Plan,
    Report as Report,
    compare as compare,
    load_plan as load_plan,
    retime as retime,
    slowdown as slowdown,
)
from selfmotion.planning.transfer import move as move
from selfmotion.problem.problem import (
    Problem as Problem,
    calibrated as calibrated,
    off_nominal as off_nominal,
    sample_problem as sample_problem,
)

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

    from selfmotion import (
        baselines as baselines,
        files as files,
        job as job,
        margins as margins,
        placement as placement,
        realtime as realtime,
        replay as replay,
        testing as testing,
    )
    from selfmotion.paper.baselines import plan_by as plan_by
    from selfmotion.realtime import Replanner as Replanner, warm_up as warm_up
    from selfmotion.shell.documents import read_problem as read_problem
    from selfmotion.work.batch import Batch as Batch, plan_many as plan_many
    from selfmotion.work.job import (
        Program as Program,
        Seam as Seam,
        load_program as load_program,
        plan_job as plan_job,
    )
    from selfmotion.work.margins import Margin as Margin, margin as margin
    from selfmotion.work.placement import (
        correction as correction,
        place as place,
        plan_with_margin as plan_with_margin,
    )

# Names that a plan does not need → the module that has them, imported when they are first used.
_LATER = {
    **dict.fromkeys(("Batch", "plan_many"), "work.batch"),
    **dict.fromkeys(("Program", "Seam", "load_program", "plan_job"), "work.job"),
    **dict.fromkeys(("Margin", "margin"), "work.margins"),
    **dict.fromkeys(("correction", "place", "plan_with_margin"), "work.placement"),
    **dict.fromkeys(("Replanner", "warm_up"), "realtime"),
    "plan_by": "paper.baselines",
    "read_problem": "shell.documents",
}
_LATER_NAMESPACES = (
    "baselines",
    "files",
    "job",
    "margins",
    "placement",
    "realtime",
    "replay",
    "testing",
)
# Names that were at the top level once, and have another one since.
_RENAMED = {"Binding": "ActiveConstraint", "BoughtMargin": "PlanWithMargin"}
_NAMESPACES = (
    "baselines",
    "certificate",
    "constraints",
    "costs",
    "errors",
    "files",
    "job",
    "margins",
    "motion",
    "obstacles",
    "optimise",
    "paths",
    "placement",
    "result",
    "robot",
)
__all__ = [
    "NAMED_ARMS",
    "Batch",
    "Certificate",
    "Damping",
    "Fastest",
    "Follow",
    "Follows",
    "Margin",
    "Move",
    "Parts",
    "Plan",
    "PolynomialNullMotion",
    "Problem",
    "Program",
    "QuasiNewton",
    "Relaxation",
    "Replanner",
    "Report",
    "RobotModel",
    "Seam",
    "Search",
    "SelfmotionError",
    "Task",
    "Tolerance",
    "Trajectory",
    "baselines",
    "calibrated",
    "certificate",
    "certify",
    "compare",
    "constraints",
    "correction",
    "costs",
    "errors",
    "fastest",
    "files",
    "job",
    "load_plan",
    "load_program",
    "load_robot",
    "margin",
    "margins",
    "motion",
    "move",
    "obstacles",
    "off_nominal",
    "optimise",
    "paths",
    "place",
    "placement",
    "plan",
    "plan_by",
    "plan_in_parts",
    "plan_job",
    "plan_many",
    "plan_with_margin",
    "read_problem",
    "result",
    "retime",
    "robot",
    "sample_problem",
    "slowdown",
    "warm_up",
]


def __getattr__(name: str) -> Any:
    """Return what is imported when it is first asked for: not every plan is made in a loop.

    What has a namespace was here in earlier states of 0.1.
    """
    if name == "__version__":
        return _version()
    if name in _LATER_NAMESPACES:
        return import_module(f"selfmotion.{name}")
    if name in _LATER:
        found = getattr(import_module(f"selfmotion.{_LATER[name]}"), name)
        globals()[name] = found
        return found
    now = _RENAMED.get(name, name)
    for space in _NAMESPACES:
        offered = import_module(f"selfmotion.{space}")
        if now in offered.__all__:
            moved = f"sm.{name} is sm.{space}.{now} now; the old name goes with the next version"
            warn(moved, DeprecationWarning, stacklevel=2)
            return getattr(offered, now)
    raise AttributeError(f"module 'selfmotion' has no attribute '{name}'")


def __dir__() -> list[str]:
    """Return what is offered: names of the top level, and namespaces."""
    return sorted([*__all__, *_LATER_NAMESPACES])


class _Views:
    """Shows plans by the replay, which is imported when the first one is shown."""

    def notebook_html(self, plan: Plan) -> str:
        from selfmotion.shell.replay import notebook_html

        return notebook_html(plan)

    def figure(self, plan: Plan) -> "Figure":
        from selfmotion.shell.replay import figure

        return figure(plan)

    def write_replay(self, plan: Plan, file: "Path") -> None:
        from selfmotion.shell.replay import write_replay

        write_replay(plan, file)


Plan.views = _Views()
_tell_moved()
