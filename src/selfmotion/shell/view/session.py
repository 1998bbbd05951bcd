"""One sitting at the page: the document, its planner, and what is told to the page."""

import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NoReturn

import numpy as np

from selfmotion.basics import PlanError, ProblemError, SelfmotionError, shown as told
from selfmotion.model.task import SE3
from selfmotion.planning.result import Plan
from selfmotion.shell.replay.meshes import Json
from selfmotion.shell.replay.page import live_html
from selfmotion.shell.view.document import Edited
from selfmotion.shell.view.handles import Handle, dragged, handles_of
from selfmotion.shell.view.planning import Found, Planning, Request
from selfmotion.shell.view.shown import Shown
from selfmotion.shell.view.sliders import Slider, sliders_of
from selfmotion.shop.controllers import write_motion

# Files that motions are exported to, by suffix.
EXPORTS = (".npz", ".csv", ".json", ".yaml", ".xml", ".script", ".src", ".mod")
# How far a matrix of the page may be from a pose.
_RIGID = 1e-3
# No page gives this number to what it asks.
_NOTHING = -1


class Session:
    """A document that is changed on a page while its plan follows.

    Parameters
    ----------
    file : Path
        A problem file.
    allow_code : bool
        Whether code that it names is run.

    Raises
    ------
    FileFormatError
        The file cannot be read, or is no problem that the page can plan.
    """

    def __init__(self, file: Path, *, allow_code: bool = False) -> None:
        self.edited = Edited(file)
        self._begun = dict(self.edited.document)
        self._number = self._mark = 0
        self._found: Found | None = None
        # The last plan of a document that describes a problem, and what of that can be changed.
        self._known: Plan | None = None
        self._handles: dict[str, Handle] = {}
        self._sliders: dict[str, Slider] = {}
        self._send: Callable[[bytes], None] | None = None
        self._lock, self._telling = threading.RLock(), threading.Lock()
        self._planning = Planning(file, allow_code, self._take)
        plan = self._first_plan()
        self._sliders = sliders_of(self.edited.document, self._begun)
        self._html, radius = live_html(plan, title=file.name)
        self._shown = Shown(radius, plan.robot)
        self._planning.start()

    def _first_plan(self) -> Plan:
        """Plan before there is a page; what is no problem at all is told at once."""
        self._planning.answer(Request(0, self.edited.document))
        if self._known is None:
            words = "" if self._found is None else self._found.words
            raise ProblemError(f"{self.edited.file}: {words}")
        return self._known

    @property
    def found(self) -> Found | None:
        """What was found last."""
        return self._found

    @property
    def html(self) -> str:
        """The page, with the plan that was made first."""
        return self._html

    def close(self) -> None:
        """End the planner."""
        self._planning.close()

    # The page, and what it asks for.

    def attach(self, send: Callable[[bytes], None]) -> bool:
        """Tell a page from now on what is found; False where there is one already."""
        with self._lock:
            if self._send is not None:
                return False
            self._send = send
            # Another page counts anew.
            self._mark = 0
        self._tell()
        return True

    def detach(self) -> None:
        """Let another page come."""
        with self._lock:
            self._send = None

    def answer(self, asked: Any) -> Json | None:
        """Do what a page asks for; what it is to be told at once, or None.

        Raises
        ------
        SelfmotionError
            It cannot be done; the document is as before.
        """
        if not isinstance(asked, Mapping):
            raise ProblemError(f"the page asks for {told(asked)}, expected a table")
        mark = asked.get("mark", 0)
        if isinstance(mark, bool) or not isinstance(mark, int):
            raise ProblemError(f"mark: is {told(mark)}, expected a whole number")
        try:
            with self._lock:
                is_new, self._mark = mark != self._mark, mark
                return self._done(asked)
        except SelfmotionError:
            # The plan of what was asked for before answers this, too.
            if is_new:
                self._tell()
            raise

    def _done(self, asked: Mapping[str, Any]) -> Json | None:
        match asked.get("do"):
            case "drag":
                self._drag(asked)
            case "slide":
                self._slide(asked)
            case "undo":
                self.edited.undo()
                self._ask()
            case "save":
                self.edited.save()
                return {"saved": True, **self._state}
            case other:
                raise ProblemError(
                    f"the page asks for {told(other)}, expected drag, slide, undo or save"
                )
        return None

    def _drag(self, asked: Mapping[str, Any]) -> None:
        handle = self._handles.get(str(asked.get("name")))
        if handle is None:
            self._refuse(asked, self._handles)
        values = dragged(self.edited.document, handle, _pose(asked.get("matrix")))
        self.edited.change(values, final=bool(asked.get("final")))
        self._ask()

    def _slide(self, asked: Mapping[str, Any]) -> None:
        slider = self._sliders.get(str(asked.get("name")))
        if slider is None:
            self._refuse(asked, self._sliders)
        value = asked.get("value")
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ProblemError(f"{slider.name}: is {told(value)}, expected a number")
        if not slider.low <= value <= slider.high:
            raise ProblemError(
                f"{slider.name}: is {told(value)}, expected {slider.low:g} to {slider.high:g}"
            )
        self.edited.change({slider.keys: float(value)}, final=bool(asked.get("final")))
        self._ask()

    def _refuse(self, asked: Mapping[str, Any], known: Mapping[str, Any]) -> NoReturn:
        raise ProblemError(
            f"there is no {told(asked.get('name'))} in this document, which has {', '.join(known)}"
        )

    def export(self, suffix: str) -> bytes:
        """Return the motion as a file for a controller, or as a plan's own file (.npz).

        Raises
        ------
        ProblemError
            The suffix is of no format.
        PlanError
            What is shown is not verified, or is being planned.
        """
        if suffix not in EXPORTS:
            raise ProblemError(f"{suffix}: is no format, expected one of {', '.join(EXPORTS)}")
        found = self._found
        if found is None or found.plan is None or found.request.number != self._number:
            raise PlanError("what is shown is being planned; wait for its verdict, then export")
        if not found.plan.certificate.verified:
            raise PlanError(f"{found.words}; nothing is exported until it is verified")
        with TemporaryDirectory(prefix="selfmotion-") as folder:
            file = Path(folder) / f"{self.edited.file.stem}{suffix}"
            if suffix == ".npz":
                found.plan.save(file)
            else:
                write_motion(found.plan, file)
            return file.read_bytes()

    # The planner.

    def _ask(self) -> None:
        self._number += 1
        self._planning.ask(Request(self._number, self.edited.document))

    @property
    def _state(self) -> Json:
        edited = self.edited
        self._sliders = sliders_of(edited.document, self._begun)
        return {
            "sliders": [slider.json for slider in self._sliders.values()],
            "changed": edited.is_changed,
            "undo": edited.can_undo,
        }

    def _take(self, found: Found) -> None:
        with self._lock:
            self._found = found
            if found.plan is not None:
                self._known = found.plan
                self._handles = handles_of(found.request.document, found.plan.problem)
        self._tell()

    def _tell(self) -> None:
        """Tell the page of what was found last."""
        # One after the other, so that an older message never comes last.
        with self._telling:
            with self._lock:
                found, send = self._found, self._send
                if found is None or send is None:
                    return
                state = {**self._state, "answers": self._answered(found)}
            # The page may go on to ask while this is made.
            send(self._shown.message(found, state))

    def _answered(self, found: Found) -> int:
        """Return the number of what a page asked that is answered; that of nothing for older ones.

        The last document answers whatever was asked last, whichever page had asked for it.
        """
        return self._mark if found.request.number == self._number else _NOTHING


def _pose(matrix: Any) -> SE3:
    """Return the pose of a matrix that the page sends, column by column."""
    try:
        values = np.array(matrix, dtype=np.float64).reshape(4, 4).T
    except (TypeError, ValueError, OverflowError):
        raise ProblemError(f"matrix: is {told(matrix)}, expected 16 numbers") from None
    turn = values[:3, :3]
    off = np.abs(turn @ turn.T - np.eye(3)).max()
    if not np.all(np.isfinite(values)) or off > _RIGID or np.linalg.det(turn) < 0.0:
        raise ProblemError(f"matrix: is {told(matrix)}, expected that of a pose")
    left, _, right = np.linalg.svd(turn)
    return SE3(left @ right, values[:3, 3])
