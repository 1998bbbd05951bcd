"""The page of `selfmotion view` in a browser: each handle dragged, each slider moved, ten times.

`make bench NAME=view_browser`. By the mouse, in Chromium without a window. Of each document the
plan that is shown last is held against what is planned of the file as it was saved, and nothing
that the page asks for may leave this machine.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any
from urllib.parse import urlsplit

import typer
from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.dragging import drag, settled, turn
from support.layouts import chromium
from support.views import Served, served
from view import DOCUMENTS, is_that_of_the_file, written

# Steps of a slider, there and back.
THERE, BACK = 8, 4


def moved(page: Any, server: Served, repeats: int) -> tuple[int, int]:
    """Move all that there is to move; return how often, and how often it was verified then."""
    handles = page.evaluate("Array.from(replay.live.handles.shown.values(), (one) => one.handle)")
    sliders = page.evaluate("Array.from(replay.live.sliders.keys())")
    count = verified = 0
    for k in range(repeats):
        for handle in handles:
            if handle["moves"]:
                drag(page, handle["name"], 1.0 if k % 2 == 0 else -0.5)
            else:
                turn(page, handle["name"], 0.05 if k % 2 == 0 else -0.03)
            settled(page, server)
            count, verified = count + 1, verified + page.locator("html[data-live=verified]").count()
        for name in sliders:
            slider = page.locator(f"[data-slider='{name}']")
            place = int(slider.input_value())
            slider.fill(str(place + THERE if k % 2 == 0 else max(place - BACK, 0)))
            settled(page, server)
            count, verified = count + 1, verified + page.locator("html[data-live=verified]").count()
    return count, verified


def seen(browser: Any, text: str, repeats: int) -> tuple[int, int, bool, set[str]]:
    """Return how often was moved, and verified, whether the last is the file's, and all hosts."""
    with TemporaryDirectory() as folder:
        file = written(text, Path(folder))
        with served(file) as server:
            page = browser.new_page(viewport={"width": 640, "height": 480}, reduced_motion="reduce")
            asked: list[str] = []
            page.on("request", lambda request: asked.append(request.url))
            page.on("websocket", lambda socket: asked.append(socket.url))
            page.goto(server.address)
            page.wait_for_selector("html[data-live=verified]", timeout=60_000)
            count, verified = moved(page, server, repeats)
            page.locator("#save").click()
            page.locator("#told", has_text="Saved").wait_for()
            hosts = {str(urlsplit(url).hostname) for url in asked if url[:5] not in _OWN}
            same = is_that_of_the_file(server.session.found, file)
            page.close()
            return count, verified, same, hosts


# Addresses of what a page has itself.
_OWN = ("data:", "blob:")


def main(
    repeats: Annotated[int, typer.Option(help="Drags of each handle and slider.")] = 10,
    only: Annotated[str, typer.Option(help="Begin of a document's name; default: all.")] = "",
) -> None:
    table = Table("", "moved", "verified", "shown last", "asked")
    sound = True
    with chromium() as browser:
        for name, text in DOCUMENTS.items():
            if name.startswith(only):
                count, verified, same, hosts = seen(browser, text, repeats)
                sound &= same and hosts == {"127.0.0.1"}
                said = "that of the file" if same else "ANOTHER"
                table.add_row(name, str(count), str(verified), said, ", ".join(hosts))
                print(name, count, verified, same, hosts, flush=True)
    Console(width=120).print(table)
    raise SystemExit(0 if sound else 1)


if __name__ == "__main__":
    typer.run(main)
