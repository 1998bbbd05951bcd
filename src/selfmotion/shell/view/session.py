"""A sitting at a page that changes a document while its plan follows."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from typing_extensions import override

from selfmotion.basics import PlanError, ProblemError, SelfmotionError, shown as told
from selfmotion.model.task import SE3
from selfmotion.planning.result import Plan
from selfmotion.shell.replay.meshes import Json
from selfmotion.shell.view.document import Edited, EditedPlan
from selfmotion.shell.view.found import Found, Request
from selfmotion.shell.view.handles import Handle, dragged, handles_of
from selfmotion.shell.view.planning import Planning
from selfmotion.shell.view.sitting import Sitting
from selfmotion.shell.view.sliders import Slider, sliders_of

# How far a matrix of the page may be from a pose.
_RIGID = 1e-3
# No page gives this number to what it asks.
_NOTHING = -1


class Session(Sitting):
    """A document that is changed on a page while its plan follows.

    Parameters
    ----------
    file : Path
        A problem file or a job file; or a plan's.
    edited : Edited, optional
        The document; by default what the file says.
    allow_code : bool
        Whether code that it names is run.

    Raises
    ------
    FileFormatError
        The file cannot be read, or is no problem that the page can plan.
    """

    def __init__(
        self, file: Path, edited: Edited | None = None, *, allow_code: bool = False
    ) -> None:
        super().__init__(file)
        self.edited = Edited(file) if edited is None else edited
        self._begun = dict(self.edited.document)
        self._number = self._mark = self._drags = 0
        # The last plan of a document that describes a problem, and what of that can be changed.
        self._known: Plan | None = None
        self._handles: dict[str, Handle] = {}
        self._sliders: dict[str, Slider] = {}
        given = None
        if isinstance(self.edited, EditedPlan):
            given = self.edited.document, self.edited.plan
        self._planning = Planning(file, allow_code, self._take, given)
        # Before there is a page; what is no problem at all is told at once.
        first = self._planning.answer(Request(0, self.edited.document))
        self.open(first)
        self._sliders = sliders_of(self.edited.document, self._begun)
        self._planning.start(first)

    @property
    @override
    def saves(self) -> str:
        return self.edited.saves

    @override
    def close(self) -> None:
        self._planning.close()

    # The page, and what it asks for.

    @override
    def attach(self, send: Callable[[bytes], None]) -> bool:
        with self._lock:
            if self._send is None:
                # Another page counts anew.
                self._mark = 0
        return super().attach(send)

    @override
    def answer(self, asked: Any) -> Json | None:
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
                self.tell()
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
                self._save()
                return {"saved": f"Saved {self.edited.saves}.", **self._state()}
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
        final = bool(asked.get("final"))
        self.edited.change(values, final=final)
        self._ask(None if final else (self._drags, handle.name))
        self._drags += final

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

    def _save(self) -> None:
        if isinstance(self.edited, EditedPlan):
            found = self.current("saved")
            if found.plan is None or found.kind == "none":
                raise PlanError(f"{found.words}; there is no plan to be saved")
            self.edited.plan = found.plan
        self.edited.save()

    # The planner.

    def _ask(self, drag: tuple[int, str] | None = None) -> None:
        self._number += 1
        self._planning.ask(Request(self._number, self.edited.document, drag))

    @override
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
        self.tell()

    @override
    def _is_current(self, found: Found) -> bool:
        return super()._is_current(found) and found.request.number == self._number

    @override
    def _answered(self, found: Found) -> int:
        # The last document answers whatever was asked last, whichever page had asked for it; older
        # ones nothing.
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
