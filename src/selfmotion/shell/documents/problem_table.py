"""The tables of a whole problem file, and of how its problem is planned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Annotated, Any, Literal

import numpy as np

from selfmotion.basics import ProblemError
from selfmotion.certificate import Tolerance
from selfmotion.model.collision import Obstacle
from selfmotion.model.follow import Follow
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import Task
from selfmotion.planning.optimise import LineSearch, QuasiNewton
from selfmotion.planning.planner import PlanRequest, Search
from selfmotion.problem.constraints import (
    NO_OVERLAP,
    Clearance,
    Constraint,
    as_clearances,
    separate_clearances,
    with_own_distances,
)
from selfmotion.problem.problem import Problem, problem_to_dict
from selfmotion.shell.documents.body_tables import WorkpieceTable
from selfmotion.shell.documents.constraint_tables import (
    AnyConstraint,
    ClearanceConstraint,
    ClearanceTable,
    DampingTable,
    RelaxationTable,
)
from selfmotion.shell.documents.cost_tables import AnyCost, AnyNullMotion
from selfmotion.shell.documents.field_types import (
    AnyTable,
    File,
    Files,
    Flag,
    Length,
    Number,
    Numbers,
    Start,
    Text,
    Turn,
    Whole,
    key,
    needed,
)
from selfmotion.shell.documents.joint_limits import joint_limit_notes, read_joint_limits
from selfmotion.shell.documents.one_of import Either
from selfmotion.shell.documents.own_code import described
from selfmotion.shell.documents.path_tables import ToolMotion
from selfmotion.shell.documents.robot_tables import RobotTable
from selfmotion.shell.documents.tables import Context, Pose, Table

TaskName = Literal["pose", "position", "pointing", "planar", "planar_pose"]
# Note on a file that says a clearance as one of its constraints.
_FORMER_CLEARANCE_NOTE = (
    'constraints: kind = "Clearance" is read for one more version; give the table [clearance], or '
    "[[clearance]] of several"
)


class FollowTable(Table):
    """What else of the arm follows a path at the same time, or is held at a pose."""

    tool: Text = key("The link that follows; by default the arm's tool.")
    reference: Text = key(
        "The link in whose frame the path is given; by default the arm's reference where the tool "
        "is its own, else the world."
    )
    task: TaskName = key("The rows of it that are prescribed.", "pose")
    path: ToolMotion = key("What it follows; or give a pose.")
    pose: Pose = key("A pose that is held; or give a path.")

    def build(self, context: Context, piece: WorkpieceTable | None = None) -> Follow:
        """Return what follows, in the frame of the workpiece that stands there."""
        if (self.pose is None) == (self.path is None):
            raise ProblemError("expected either path, or the pose that is held")
        # What follows in the frame of another link is not where the workpiece is.
        apart = piece is None or self.given.get("reference", piece.on) != piece.on
        place = None if apart or piece is None else piece.place
        reference = self.reference if place is None or piece is None else piece.on
        if self.path is not None:
            return Follow(self.path.build(context, place), self.task, self.tool, reference)
        pose = self.pose if place is None else place * self.pose
        return Follow(pose, self.task, self.tool, reference)


class SearchTable(Table):
    """Initial guesses of a free start."""

    starts: Whole = key(
        "Largest number: for redundancy 1 along all self-motions of the first pose, else of the "
        "solutions of Newton's method from twice as many seeds.",
        48,
    )
    finalists: Whole = key(
        "Largest number of starts that are optimised to the end: those with the best rough optima "
        "on few nodes. With as many as `starts`, starts are not screened.",
        3,
    )
    mode: Text = key(
        'Optimise from many starts ("local"), or from the best sequences over all self-motions '
        '("global"): sampled evenly where the redundancy is 1, at random where it is more. "auto": '
        "from many starts first, and from sequences where none of them leads to a motion that "
        "keeps the constraints.",
        "auto",
    )
    compare: Flag = key(
        "Search globally whatever the other search finds, also with a given start, for the "
        "distance of the plan from the best motion of all. Needs redundancy 1.",
        False,
    )
    rng: Whole = key("Shifts the seeds; the same one gives the same plan.", 0)

    def build(self, _context: Context) -> Search:
        """Return the settings."""
        return Search(**self.given)


class ToleranceTable(Table):
    """Allowed error of a verified motion from the path, at any time."""

    position: Length = key("[m].", 1e-6)
    rotation: Turn = key("[rad].", 1e-6)

    def build(self, _context: Context) -> Tolerance:
        """Return the tolerance."""
        return Tolerance(**self.given)


class LineSearchTable(Table):
    """Finds a step α with sufficient decrease and a small slope (strong Wolfe conditions)."""

    rho: Number = key("0 < ρ < σ < 1.", 0.01)
    sigma: Number = key("0 < ρ < σ < 1; 0.1 is a fairly exact search, 0.9 a weak one.", 0.9)
    tau1: Number = key("How far bracketing extrapolates, in multiples of the last advance.", 9.0)
    tau2: Number = key("How near to an end of the bracket sectioning steps, as a share.", 0.1)
    tau3: Number = key("How near to the other end, likewise.", 0.5)


class QuasiNewtonTable(Table):
    """The published method's quasi-Newton method: Broyden's family, with Fletcher's line search."""

    update: Text = key("Which end of the family: Fletcher's switch, or one alone.", "fletcher")
    tolerance: Number = key(
        "Converged when the decrease that the model predicts, ½ ∇Fᵀ H ∇F, is below this times |F|.",
        1e-8,
    )
    max_iterations: Whole = key("Limit of iterations.", 200)
    line_search: LineSearchTable = key("How far it goes along each direction.")
    unbounded: Number = key(
        "Stops when |x| exceeds this times its scale at the start (1 + |x0|), or F is so negative "
        "that its value at the start is lost in rounding.",
        1e8,
    )
    initial_metric: Text = key(
        "H0 where none is given: the inverse of the function's Gauss-Newton matrix at the start, "
        "or the paper's identity.",
        "gauss-newton",
    )

    def build(self, _context: Context) -> QuasiNewton:
        """Return the optimiser."""
        values = self.given
        if self.line_search is not None:
            values["line_search"] = LineSearch(**self.line_search.given)
        return QuasiNewton(**values)


class InPartsTable(Table):
    """How a motion in parts leaves and meets the path."""

    retreat: Length = key(
        "Distance that the tool leaves the path along `axis` before each move, and returns by "
        "[m]; by default the move starts on the path.",
        0.0,
    )
    ramp: Number = key(
        "How long the tool takes to come to rest at a cut, and up to speed [s].", 0.5
    )
    axis: Numbers = key("Where to, in tool axes: by default back along the tool's z axis.")


class LoopTable(Table):
    """How `selfmotion follow` runs the loop with a controller."""

    horizon: Number = key("How far ahead is planned [s]; 2 by default.")
    period: Number = key("Time between states [s]; 0.01 by default.")
    cycle: Number = key("Time between set-points [s]; 0.001 by default.")
    latency: Number = key("From measuring a state until its segment is followed [s]; 0 by default.")
    silence: Number = key("Without a state for so long it ends [s]; 5 by default.")
    seconds: Number = key("How long it runs [s]; by default until it is stopped.")


class PartTable(Table):
    """What a problem and a seam have in common."""

    task: TaskName = key(
        "Which rows of the tool's pose are prescribed: pose, by default, or planar of a planar arm."
    )
    costs: list[AnyCost] = key(
        "Their integrals are added up. By default ∫ ½ q̇ᵀq̇ dt; see `JointVelocity.usual`."
    )
    constraints: list[AnyConstraint] = key(
        "Conditions on the motion, each judged by the certificate. By default the URDF's limits "
        "of joint position and velocity, and the limits of acceleration and jerk that the arm's "
        "maker publishes. The URDF's always apply in addition, unless these replace them."
    )
    relaxations: list[RelaxationTable] = key(
        "Rows in which the tool may leave its path, by how much and when. Each is one more joint "
        "between tool and path, which costs nothing. By default none."
    )

    def built(self, context: Context, *names: str) -> dict[str, Any]:
        """Return what lists of tables stand for, those that are given."""
        return {
            name: context.each(name, getattr(self, name)) for name in names if name in self.given
        }


class SharedTable(PartTable):
    """What problem files and job files have in common."""

    robot: RobotTable
    clearance: Annotated[bool | ClearanceTable | list[ClearanceTable], Either()] = key(
        "How far bodies keep apart, and which; by default links must not overlap. False to leave "
        "that out."
    )
    workpiece: WorkpieceTable = key()
    joint_limits: File = key("A MoveIt file of joint limits that count besides the arm's own.")

    def arm(self, context: Context) -> Task:
        """Make the arm, and return the task."""
        on = None if self.workpiece is None else self.workpiece.on
        if on is not None and self.robot.reference != on:
            with context.naming():
                raise ProblemError(
                    f"workpiece: is on '{on}', so that paths are in its frame: expected "
                    f"robot.reference = '{on}'"
                )
        with context.naming("robot"):
            context.robot = robot = self.robot.build(context)
        slides = [name for name in robot.joint_names if robot.is_prismatic(name)]
        if context.degrees_key and slides:
            with context.naming(context.degrees_key):
                raise ProblemError(
                    f"joint '{slides[0]}' slides, its coordinate is in metres; give rad and m "
                    f"under the key without _deg"
                )
        return _usual_task(robot) if self.task is None else Task.of(self.task)

    def kept(self, context: Context) -> dict[str, Any]:
        """Return the constraints and the clearance, with the bodies of the workpiece."""
        found: dict[str, Any] = {}
        with context.naming("workpiece"):
            bodies = [] if self.workpiece is None else self.workpiece.build(context)
        # Files of before have clearances among the constraints.
        former = [x for x in self.constraints or () if isinstance(x, ClearanceConstraint)]
        if self.constraints is not None:
            found["constraints"] = context.each(
                "constraints",
                self.constraints,
                lambda x: {"bodies": bodies} if former and x is former[0] else {},
            )
        apart = self._apart(context, () if former else bodies)
        if former:
            context.notes.append(_FORMER_CLEARANCE_NOTE)
            found["constraints"], several = separate_clearances(found["constraints"], apart)
            apart = several if len(several) > 1 else several[0]
        with context.naming("clearance"):
            apart = self._with_own_distances(apart, former)
        return {**found, **({} if apart is NO_OVERLAP else {"clearance": apart})}

    def _with_own_distances(self, apart: Any, former: Sequence[ClearanceTable]) -> Any:
        """Return clearances in which bodies with a distance of their own have one of their own."""
        given = self.clearance if isinstance(self.clearance, list) else [self.clearance]
        tables = [*former, *(item for item in given if isinstance(item, ClearanceTable))]
        bodies = [body for table in tables for body in table.obstacles]
        bodies += [] if self.workpiece is None else self.workpiece.obstacles
        own = {body.name: body.distance for body in bodies if body.distance is not None}
        if not own:
            return apart
        return tuple(one for item in as_clearances(apart) for one in with_own_distances(item, own))

    def _apart(self, context: Context, bodies: Sequence[Obstacle]) -> Any:
        """Return the clearance, or several, of which the first looks at further bodies."""
        given = self.clearance
        if given is False and bodies:
            with context.naming():
                raise ProblemError(
                    "workpiece: has bodies, but clearance is false; give its distance"
                )
        if given is False:
            return None
        if given is None or given is True:
            return Clearance(tuple(bodies), 0.0) if bodies else NO_OVERLAP
        # The workpiece alone is no reason to keep further away.
        more: dict[str, Any] = {"bodies": bodies, "usual": 0.0} if bodies else {}
        if isinstance(given, list):
            return context.each("clearance", given, lambda x: more if x is given[0] else {})
        with context.naming("clearance"):
            return given.build(context, **more)

    def limits(self, context: Context) -> tuple[Constraint, ...]:
        """Return the limits of a file of joint limits."""
        if self.joint_limits is None:
            return ()
        with context.naming("joint_limits"):
            file = context.beside(self.joint_limits)
            limits = read_joint_limits(file, context.robot)
            context.notes.extend(joint_limit_notes(file, context.robot))
            return limits


def _usual_task(robot: RobotModel) -> Task:
    """Return the task of a document that says none: of an arm in the plane of x and y that."""
    is_planar = robot.can_follow(Task.PLANAR) and not robot.can_follow(Task.POSITION)
    return Task.PLANAR if is_planar else Task.POSE


class ProblemTable(SharedTable):
    """A planning problem."""

    start: Start = key(
        "The start configuration [rad or m], or which; by default free: many are tried.", "free"
    )
    path: ToolMotion = needed("The tool motion.")
    also: list[FollowTable] = key(
        "What else of the arm follows a path at the same time: their rows are prescribed."
    )
    null_motion: AnyNullMotion = key(
        "The parameterisation of the self-motion. By default any, optimised at nodes."
    )
    damping: Annotated[bool | DampingTable, Either()] = key(
        "Go through singular poses, and past the edge of the workspace, at the price of the path. "
        'By default the tool stays on the path. Adds the cost "path error".'
    )
    rest: Flag = key(
        "Whether the arm is at rest where the path starts or ends at rest, which a controller "
        "needs, unless a constraint says how fast it is there. The paper's does not.",
        True,
    )
    goal: Literal["best", "retimed", "fastest", "parts"] = key(
        "What is looked for: the best motion by its costs, that at its fastest pace, the fastest "
        "one, or one in parts.",
        "best",
    )
    keep: dict[str, float] = key(
        "Costs that the fastest motion keeps, by kind, as multiples of the best's."
    )
    parts: InPartsTable = key()
    search: SearchTable = key()
    optimiser: QuasiNewtonTable = key()
    tolerance: ToleranceTable = key()
    max_evaluations: Whole = key("Limit of the evaluations of the cost.")
    outputs: Files = key("Files to write, beside this one; see `selfmotion plan --out`.", [])
    loop: LoopTable = key()
    grid: AnyTable = key("Values to try for keys, for `selfmotion batch`: a list for each.")

    def build(self, context: Context) -> PlanRequest:
        """Return the problem, and how it is planned."""
        task = self.arm(context)
        with context.naming("start"):
            context.start = context.once(
                (self.robot, self.start, task.value),
                lambda: start_of(self.start, context.robot, task),
            )
        piece = self.workpiece
        with context.naming("path"):
            path = self.path.build(context, None if piece is None else piece.place)
        options = {"rest": self.rest, **self.built(context, "costs", "relaxations")}
        if self.also is not None:
            options["also"] = context.each("also", self.also, lambda _: {"piece": piece})
        if self.null_motion is not None:
            with context.naming("null_motion"):
                options["null_motion"] = self.null_motion.build(context)
        if self.damping:
            table = DampingTable() if self.damping is True else self.damping
            with context.naming("damping"):
                options["damping"] = table.build(context)
        options |= self.kept(context)
        with context.naming():
            problem = Problem(context.robot, path, task, context.start, **options)
        limits = self.limits(context)
        if limits:
            with context.naming("joint_limits"):
                problem = replace(problem, constraints=(*problem.constraints, *limits))
        return PlanRequest(problem, **self._how(context), notes=tuple(context.notes))

    def _how(self, context: Context) -> dict[str, Any]:
        """Return how the problem is planned: the rest of a `PlanRequest`."""
        found: dict[str, Any] = {
            "goal": self.goal,
            "parts": None if self.parts is None else self.parts.given,
            "keep": self.keep,
            "outputs": tuple(context.beside(name) for name in self.outputs),
            "max_evaluations": self.max_evaluations,
        }
        for name in ("search", "tolerance", "optimiser"):
            if name in self.given:
                with context.naming(name):
                    option = "optimizer" if name == "optimiser" else name
                    found[option] = self.given[name].build(context)
        return found

    @classmethod
    def of(cls, request: PlanRequest) -> dict[str, Any]:
        """Return what a file says of a problem, and of how it is planned.

        Raises
        ------
        ProblemError
            It holds what a file cannot carry.
        """
        search, optimizer = request.search, request.optimizer
        if search is not None and not isinstance(search.rng, int):
            raise ProblemError(
                "search: rng is a generator, which a file cannot carry; give a number"
            )
        if not isinstance(optimizer, QuasiNewton | None):
            raise ProblemError(
                f"optimizer: {type(optimizer).__name__} is no QuasiNewton, which a file can carry"
            )
        settings: dict[str, Any] = {
            "goal": None if request.goal == "best" else request.goal,
            "outputs": [str(name) for name in request.outputs] or None,
            "max_evaluations": request.max_evaluations,
            "parts": {key: _plain(value) for key, value in (request.parts or {}).items()} or None,
            "keep": {key: float(factor) for key, factor in (request.keep or {}).items()} or None,
        }
        tables = {"search": search, "tolerance": request.tolerance, "optimiser": optimizer}
        for name, value in tables.items():
            settings[name] = None if value is None else asdict(value)
        table = problem_to_dict(request.problem, RobotTable.of, described)
        if "collision" in table:
            # Plans' files have the name that it had when their format was made.
            table["clearance"] = table.pop("collision")
        apart = table.get("clearance")
        for item in apart if isinstance(apart, list) else [apart]:
            if isinstance(item, dict):
                del item["kind"]
        found: dict[str, Any] = _without_none({**settings, **table})
        return found


def _plain(value: Any) -> Any:
    return np.asarray(value).tolist()


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    return [_without_none(item) for item in value] if isinstance(value, list) else value


def start_of(setting: Any, robot: RobotModel, task: Task) -> Any:
    """Return the start configuration (n,) that a file asks for, None for a free one."""
    if setting == "free":
        return None
    if setting == "dexterous":
        return robot.dexterous_configuration(task)
    return robot.home if setting == "home" else robot.configuration(setting)
