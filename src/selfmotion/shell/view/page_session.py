"""One session at the page: what is shown, to whom, and what of it is exported."""

import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from selfmotion.basics import FileFormatError, PlanError, ProblemError
from selfmotion.model.robot import RobotModel
from selfmotion.planning.result import Parts, Plan, load_plan
from selfmotion.shell.replay import Json, PlanReplay, live_html
from selfmotion.shell.view.requests import Outcome
from selfmotion.shell.view.shown import Shown
from selfmotion.shop.controllers import PROGRAMS, ProgramSettings, check_arm, write_motion

# Files that motions are exported to, by suffix, and how the page calls them.
_OF_MOTIONS = {
    ".csv": "CSV",
    ".json": "JSON",
    ".yaml": "ROS 2 (.yaml)",
    ".xml": "MuJoCo (.xml)",
    ".script": "URScript",
    ".src": "KUKA (.src)",
    ".mod": "ABB (.mod)",
}
_OF_PLANS = {".npz": "plan (.npz)", **_OF_MOTIONS}
_OF_PROGRAMS = {".program": "program (.program)", **_OF_MOTIONS}
_OF_PARTS = {".parts": "parts (.parts)", **_OF_MOTIONS}
# Those that only some arms have.
_CONTROLLERS = {".script": "urscript", **PROGRAMS}
# Files that are read again with all that they hold.
_OWN = (".npz", ".program", ".parts")


class PageSession:
    """A page that shows what a file holds, and has nothing to be changed.

    Parameters
    ----------
    file : Path
    why : str
        Why nothing can be changed.
    """

    def __init__(self, file: Path, why: str = "") -> None:
        self.file, self._why = file, why
        # How programs of controllers are written; None for what these settings are by default.
        self.settings: ProgramSettings | None = None
        self._found: Outcome | None = None
        self._beside: tuple[str, Plan] | None = None
        self._html, self._shown = "", Shown()
        self._send: Callable[[bytes], None] | None = None
        self._lock, self._telling = threading.RLock(), threading.Lock()

    def open(self, outcome: Outcome) -> None:
        """Make the page, with what there is to show first.

        Raises
        ------
        ProblemError
            That is nothing.
        """
        if outcome.replayed is None:
            raise ProblemError(f"{self.file}: {outcome.words}")
        self._found = outcome
        live = {"exports": list(self.exports.items()), "saves": self.saves, "why": self._why}
        self._html, radius = live_html(outcome.replayed, title=self.file.name, live=live)
        self._shown.begin(radius, outcome.replayed.plan.robot)

    @property
    def found(self) -> Outcome | None:
        """What was found last."""
        return self._found

    @property
    def html(self) -> str:
        """The page, with what was found first."""
        return self._html

    @property
    def saves(self) -> str:
        """What is written when the page saves, in words; "" where nothing can be changed."""
        return ""

    @property
    def exports(self) -> dict[str, str]:
        """Files that the motion can be exported to: their suffixes, and how they are called."""
        outcome = self._found
        if outcome is None or outcome.plan is None:
            return _OF_PLANS
        if isinstance(outcome.replayed, PlanReplay):
            files = _OF_PLANS
        elif outcome.made is None and not self.saves:
            # A motion of a controller's own program is there already.
            files = {}
        else:
            files = _OF_PARTS if isinstance(outcome.made, Parts) else _OF_PROGRAMS
        robot = outcome.plan.robot
        return {key: name for key, name in files.items() if self._has_programs(robot, key)}

    def _has_programs(self, robot: RobotModel, suffix: str) -> bool:
        """Return whether files of a suffix are for such an arm."""
        if suffix not in _CONTROLLERS:
            return True
        try:
            check_arm(robot, _CONTROLLERS[suffix], self.settings or ProgramSettings())
        except ProblemError:
            return False
        return True

    def close(self) -> None:
        """End what works for the page."""

    def attach(self, send: Callable[[bytes], None]) -> bool:
        """Tell a page from now on what is found; False where there is one already."""
        with self._lock:
            if self._send is not None:
                return False
            self._send = send
        self.tell()
        return True

    def detach(self) -> None:
        """Let another page come."""
        with self._lock:
            self._send = None

    def answer(self, message: Any) -> Json | None:
        """Do what a page asks for; what it is to be told at once, or None.

        Raises
        ------
        SelfmotionError
            It cannot be done; the document is as before.
        """
        del message
        raise ProblemError(f"{self.file}: {self._why}")

    def tell(self) -> None:
        """Tell the page of what was found last."""
        # One after the other, so that an older message never comes last.
        with self._telling:
            with self._lock:
                outcome, send, beside = self._found, self._send, self._beside
                if outcome is None or send is None:
                    return
                state = {**self._state(), "answers": self._answered(outcome)}
            # The page may go on to ask while this is made.
            send(self._shown.message(outcome, state, beside))

    def show_beside(self, name: str, data: bytes) -> None:
        """Show the plan of a file beside the own one; none where there are no `data`.

        Raises
        ------
        FileFormatError
            It is no plan.
        ProblemError
            It is of another arm, or here are several seams.
        """
        beside = None
        if data:
            with TemporaryDirectory(prefix="selfmotion-") as folder:
                file = Path(folder) / "beside.npz"
                file.write_bytes(data)
                try:
                    beside = name, load_plan(file)
                except FileFormatError as error:
                    text = str(error).replace(str(file), name)
                    raise FileFormatError(text) from error
            self._check_beside(*beside)
        with self._lock:
            self._beside = beside
        self.tell()

    def _check_beside(self, name: str, plan: Plan) -> None:
        outcome = self._found
        if outcome is None or not isinstance(outcome.replayed, PlanReplay):
            raise ProblemError(f"{name}: a plan is shown beside a plan, and here are several seams")
        robot = outcome.replayed.plan.robot
        if plan.robot.joint_names != robot.joint_names or plan.robot.name != robot.name:
            raise ProblemError(
                f"{name}: is of '{plan.robot.name}', expected a plan of '{robot.name}' with the "
                f"same joints"
            )

    def _state(self) -> Json:
        return {"sliders": [], "changed": False, "undo": False}

    def _answered(self, outcome: Outcome) -> int:
        """Return the number of what a page asked that is answered."""
        del outcome
        return 0

    def _is_current(self, outcome: Outcome) -> bool:
        """Whether it answers what was asked for last."""
        return outcome.kind in ("whole", "none")

    def current(self, done: str) -> Outcome:
        """Return what is shown, where all of it is planned; else PlanError: nothing is `done`."""
        outcome = self._found
        if outcome is None or not self._is_current(outcome):
            raise PlanError(
                f"what is shown is being planned; wait for its verdict, then it is {done}"
            )
        return outcome

    def export(self, suffix: str, mass: float | None = None) -> bytes:
        """Return the motion as a file for a controller, or as a plan's or program's own file.

        Parameters
        ----------
        suffix : str
        mass : float, optional
            Of what the flange carries [kg], which ABB's programs say; by default that of the
            settings.

        Raises
        ------
        ProblemError
            The suffix is of no format, or the mass is missing.
        PlanError
            What is shown is not verified, or is being planned.
        """
        if suffix not in self.exports:
            raise ProblemError(f"{suffix}: is no format, expected one of {', '.join(self.exports)}")
        outcome = self.current("exported")
        if not outcome.verified or outcome.plan is None:
            raise PlanError(f"{outcome.words}; nothing is exported until it is verified")
        settings = None
        if suffix in _CONTROLLERS:
            settings = self.settings or ProgramSettings()
            settings = settings if mass is None else replace(settings, mass=mass)
        if suffix == ".mod" and settings is not None and settings.mass is None:
            raise ProblemError(
                "a controller of ABB moves by the mass that the flange carries: type it beside "
                "Export, or give it in the file of --settings"
            )
        made = outcome.plan if outcome.made is None else outcome.made
        with TemporaryDirectory(prefix="selfmotion-") as folder:
            file = Path(folder) / f"{self.file.stem}{suffix}"
            if suffix in _OWN:
                made.save(file)
            else:
                write_motion(made, file, settings=settings)
            return file.read_bytes()
