"""Editing a problem document on a page: each change is planned, and the page is updated."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from typing_extensions import override

from selfmotion.basics import PlanError, ProblemError, SelfmotionError, shown
from selfmotion.model.task import SE3
from selfmotion.planning.result import Plan
from selfmotion.shell.replay import Json
from selfmotion.shell.view.document import Edited, EditedPlan
from selfmotion.shell.view.handles import Handle, dragged, handles_of
from selfmotion.shell.view.page_session import PageSession
from selfmotion.shell.view.planning import Planning
from selfmotion.shell.view.requests import Outcome, Request
from selfmotion.shell.view.sliders import Slider, sliders_of

# Largest deviation of a matrix that the page sends from a pose.
_RIGID = 1e-3
# A request id that no page gives.
_NO_REQUEST = -1


class EditSession(PageSession):
    """A document that is edited on a page, with the plan of its present state.

    Parameters
    ----------
    file : Path
        A problem file, a job file, or a saved plan.
    edited : Edited, optional
        The document; by default what the file says.
    allow_code : bool
        Whether code that the document names is run.

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
        self._initial_document = dict(self.edited.document)
        # The number of changes, the id of the last request, and the number of drags.
        self._revision = self._request_id = self._drags = 0
        # The name of the handle that is chosen; "" for none.
        self._chosen = ""
        # The last plan, and the handles and sliders of its document.
        self._last_plan: Plan | None = None
        self._handles: dict[str, Handle] = {}
        self._sliders: dict[str, Slider] = {}
        initial = None
        if isinstance(self.edited, EditedPlan):
            initial = self.edited.document, self.edited.plan
        self._planning = Planning(file, allow_code, self._on_result, initial)
        # Planned before there is a page, so that an invalid file fails at once.
        first = self._planning.answer(Request(0, self.edited.document))
        self.open(first)
        self._sliders = sliders_of(self.edited.document, self._initial_document)
        self._planning.start(first)

    @property
    @override
    def saves(self) -> str:
        return self.edited.saves

    @override
    def close(self) -> None:
        self._planning.close()

    # Requests of the page.

    @override
    def attach(self, send: Callable[[bytes], None]) -> bool:
        with self._lock:
            if self._send is None:
                # A new page starts its request ids at 0.
                self._request_id = 0
                self._chosen = ""
        return super().attach(send)

    @override
    def answer(self, request: Any) -> Json | None:
        if not isinstance(request, Mapping):
            raise ProblemError(f"the page asks for {shown(request)}, expected a table")
        request_id = request.get("mark", 0)
        if isinstance(request_id, bool) or not isinstance(request_id, int):
            raise ProblemError(f"mark: is {shown(request_id)}, expected a whole number")
        try:
            with self._lock:
                is_new, self._request_id = request_id != self._request_id, request_id
                return self._handle(request)
        except SelfmotionError:
            # Sends the present plan again, so that the page sees its request answered.
            if is_new:
                self.tell()
            raise

    def _handle(self, request: Mapping[str, Any]) -> Json | None:
        match request.get("do"):
            case "drag":
                self._drag(request)
            case "slide":
                self._slide(request)
            case "choose":
                name = request.get("name")
                self._chosen = name if isinstance(name, str) else ""
                self._request_plan()
            case "undo":
                self.edited.undo()
                self._request_plan()
            case "save":
                self._save()
                return {"saved": f"Saved {self.edited.saves}.", **self._state()}
            case other:
                raise ProblemError(
                    f"the page asks for {shown(other)}, expected drag, choose, slide, undo or save"
                )
        return None

    def _drag(self, request: Mapping[str, Any]) -> None:
        handle = self._handles.get(str(request.get("name")))
        if handle is None:
            self._refuse(request, self._handles)
        values = dragged(self.edited.document, handle, _pose(request.get("matrix")))
        final = bool(request.get("final"))
        self.edited.change(values, final=final)
        self._chosen = handle.name
        self._request_plan(is_held=not final)
        if final:
            self._drags += 1

    def _slide(self, request: Mapping[str, Any]) -> None:
        slider = self._sliders.get(str(request.get("name")))
        if slider is None:
            self._refuse(request, self._sliders)
        value = request.get("value")
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ProblemError(f"{slider.name}: is {shown(value)}, expected a number")
        if not slider.low <= value <= slider.high:
            raise ProblemError(
                f"{slider.name}: is {shown(value)}, expected {slider.low:g} to {slider.high:g}"
            )
        final = bool(request.get("final"))
        self.edited.change({slider.keys: float(value)}, final=final)
        self._request_plan(is_held=not final)

    def _refuse(self, request: Mapping[str, Any], known: Mapping[str, Any]) -> NoReturn:
        name, names = shown(request.get("name")), ", ".join(known)
        raise ProblemError(f"there is no {name} in this document, which has {names}")

    def _save(self) -> None:
        if isinstance(self.edited, EditedPlan):
            outcome = self.current("saved")
            if outcome.plan is None or outcome.kind == "none":
                raise PlanError(f"{outcome.words}; there is no plan to be saved")
            self.edited.plan = outcome.plan
        self.edited.save()

    # The planner.

    def _request_plan(self, *, is_held: bool = False) -> None:
        self._revision += 1
        drag = (self._drags, self._chosen) if self._chosen else None
        self._planning.ask(Request(self._revision, self.edited.document, drag, is_held))

    @override
    def _state(self) -> Json:
        edited = self.edited
        self._sliders = sliders_of(edited.document, self._initial_document)
        return {
            "sliders": [slider.json for slider in self._sliders.values()],
            "changed": edited.is_changed,
            "undo": edited.can_undo,
        }

    def _on_result(self, outcome: Outcome) -> None:
        with self._lock:
            self._found = outcome
            if outcome.plan is not None:
                self._last_plan = outcome.plan
                self._handles = handles_of(outcome.request.document, outcome.plan.problem)
        self.tell()

    @override
    def _is_current(self, outcome: Outcome) -> bool:
        return super()._is_current(outcome) and outcome.request.number == self._revision

    @override
    def _answered(self, outcome: Outcome) -> int:
        # Only the plan of the latest document answers the latest request.
        return self._request_id if outcome.request.number == self._revision else _NO_REQUEST


def _pose(matrix: Any) -> SE3:
    """Return the pose of a matrix that the page sends, column by column."""
    try:
        values = np.array(matrix, dtype=np.float64).reshape(4, 4).T
    except (TypeError, ValueError, OverflowError):
        raise ProblemError(f"matrix: is {shown(matrix)}, expected 16 numbers") from None
    turn = values[:3, :3]
    off = np.abs(turn @ turn.T - np.eye(3)).max()
    if not np.all(np.isfinite(values)) or off > _RIGID or np.linalg.det(turn) < 0.0:
        raise ProblemError(f"matrix: is {shown(matrix)}, expected that of a pose")
    left, _, right = np.linalg.svd(turn)
    return SE3(left @ right, values[:3, 3])
