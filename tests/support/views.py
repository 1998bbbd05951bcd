"""Sessions of the page for tests: documents, a server of their own, and what a page is told."""

import json
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import uvicorn

from selfmotion.shell.view import (
    EditSession,
    application,
    configuration,
    listening,
    opened as open_page,
)

TOKEN = "the-token-of-the-tests"
# A circle beside a post, with a comment to be kept.
CIRCLE = """\
# a circle beside a post
task = "pointing"
start = "free"   # the best of many

[robot]
name = "panda"

[path]
kind = "circle"
radius_mm = 100
duration = 4.0
start = { position = [0.5, 0, 0.5], rpy_deg = [180, 0, 0] }

[[costs]]
kind = "JointVelocity"
weight = 1.0

[clearance]
distance_mm = 5

[[clearance.obstacles]]
shape = "box"
name = "post"
position = [0.3, -0.6, 0.6]
size = [0.1, 0.1, 1.2]
"""
# So long a plan may take on a busy machine [s].
_PATIENCE = 60.0


def told(data: bytes) -> dict[str, Any]:
    """Return the JSON of a message, without its arrays."""
    length = struct.unpack("<I", data[:4])[0]
    found: dict[str, Any] = json.loads(data[4 : 4 + length])
    return found


class Heard:
    """A page as the session knows it: what it is told."""

    def __init__(self, session: EditSession) -> None:
        self.session = session
        self.messages: list[dict[str, Any]] = []
        self._change = threading.Condition()
        assert session.attach(self._hear)

    def _hear(self, data: bytes) -> None:
        with self._change:
            self.messages.append(told(data))
            self._change.notify_all()

    def until(self, wanted: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """Return the last message when it is as wanted."""
        end = time.monotonic() + _PATIENCE
        with self._change:
            while not (self.messages and wanted(self.messages[-1])):
                assert self._change.wait(end - time.monotonic()), "the page waits for nothing"
            return self.messages[-1]

    def answer(self, number: int) -> dict[str, Any]:
        """Return what is told in the end of a request by its number."""
        return self.until(lambda found: found["number"] == number and found["kind"] != "coarse")

    def drag(self, name: str, by: Callable[[list[float]], None], *, final: bool = True) -> None:
        """Drag a handle: `by` changes its matrix, column by column."""
        handles = next(m["handles"] for m in reversed(self.messages) if "handles" in m)
        matrix = next(list(h["matrix"]) for h in handles if h["name"] == name)
        by(matrix)
        self.session.answer({"do": "drag", "name": name, "matrix": matrix, "final": final})


def moved(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Callable[[list[float]], None]:
    """Return what moves a matrix."""

    def move(matrix: list[float]) -> None:
        for place, by in zip((12, 13, 14), (x, y, z), strict=True):
            matrix[place] += by

    return move


@contextmanager
def opened(file: Path) -> Iterator[EditSession]:
    """Yield the session of a file; its planner ends."""
    session = open_page(file)
    assert isinstance(session, EditSession)
    try:
        yield session
    finally:
        session.close()


@dataclass(frozen=True)
class Served:
    """A session with its server."""

    session: EditSession
    port: int

    @property
    def address(self) -> str:
        """Of the page, with the token."""
        return f"http://127.0.0.1:{self.port}/?token={TOKEN}"


@contextmanager
def served(file: Path) -> Iterator[Served]:
    """Yield a session that is served at a free port."""
    with opened(file) as session:
        bound = listening(0)
        port = bound.getsockname()[1]
        server = uvicorn.Server(configuration(application(session, TOKEN, port)))
        thread = threading.Thread(target=server.run, kwargs={"sockets": [bound]})
        thread.start()
        try:
            while not server.started:
                time.sleep(0.01)
            yield Served(session, port)
        finally:
            server.should_exit = True
            thread.join()
            bound.close()
