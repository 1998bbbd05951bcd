"""Pictures of a replay, drawn by a headless browser when one is installed."""

import io
import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, Any

import numpy as np

from selfmotion.basics import (
    Progress,
    RenderError,
    as_path,
    silent,
    write_atomically,
    write_bytes,
)
from selfmotion.shell.replay.page import Replayable, replay_html

_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
# Draw on the processor: the same picture on every machine, and no display needed.
_SOFTWARE = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
LAYERS = ("trace", "triads")


def render_png(
    plans: Replayable,
    file: str | os.PathLike[str],
    *,
    t: float,
    size: tuple[int, int] = (1280, 720),
    layers: Sequence[str] = LAYERS,
    whole_page: bool = False,
    dark: bool = False,
    **options: Any,
) -> Path:
    """Draw the first plan at one time as a PNG picture.

    Parameters
    ----------
    plans : Plan or sequence of Plan, Program, Parts or Move
        As for `replay_html`.
    file : path
        The picture; written whole or not at all.
    t : float
        Time from the start of the motion [s].
    size : (int, int)
        Width and height [pixels].
    layers : sequence of str
        What is shown beside the arm: of ``ghost``, ``trace``, ``triads``, ``ellipsoid``,
        ``frames``, ``names``, ``bodies``.
    whole_page : bool
        Draw the page with plots and controls, as tall as it is, instead of the scene alone.
    dark : bool
        Dark mode.
    **options
        Those of `replay_html`.

    Raises
    ------
    RenderError
        No browser, or it fails; says what to install.
    """
    path = as_path(file)
    with _opened(replay_html(plans, **options), size, layers, whole_page, dark) as page:
        duration = float(page.evaluate("replay.duration"))
        if not 0.0 <= t <= duration:
            raise RenderError(f"there is no picture at t = {t} s: the motion lasts {duration} s")
        picture = _shot(page, t, whole_page)
    write_bytes(path, picture)
    return path


def render_gif(
    plans: Replayable,
    file: str | os.PathLike[str],
    *,
    size: tuple[int, int] = (640, 400),
    frames_per_second: int = 20,
    layers: Sequence[str] = LAYERS,
    dark: bool = False,
    progress: Progress = silent,
    **options: Any,
) -> Path:
    """Draw the first plan's motion, in real time, as an animated GIF that repeats.

    Parameters and errors are those of `render_png`; `progress` hears of each picture, as in
    `plan`.
    """
    from PIL import Image

    path = as_path(file)
    with _opened(replay_html(plans, **options), size, layers, False, dark) as page:
        duration = float(page.evaluate("replay.duration"))
        count = max(2, round(duration * frames_per_second) + 1)
        shots = []
        for number, t in enumerate(np.linspace(0.0, duration, count).tolist(), 1):
            progress("picture", number, count)
            shots.append(_shot(page, t, False))
    frames = [Image.open(io.BytesIO(shot)).convert("RGB") for shot in shots]
    # One palette for all frames: a palette for each makes plain surfaces shimmer.
    palette = frames[count // 2].quantize(colors=255)
    first, *rest = (frame.quantize(palette=palette) for frame in frames)

    def write(stream: IO[bytes]) -> None:
        first.save(
            stream,
            format="GIF",
            save_all=True,
            append_images=rest,
            duration=round(1000 / frames_per_second),
            loop=0,
        )

    write_atomically(path, write)
    return path


def _shot(page: Any, t: float, whole_page: bool) -> bytes:
    page.evaluate("t => { replay.seek(t); viewer.render(); }", t)
    picture: bytes = page.screenshot(full_page=whole_page, animations="disabled")
    return picture


def check_pictures() -> None:
    """Raise RenderError where pictures cannot be drawn, before anything else is done."""
    with _playwright() as playwright:
        _find_browser(playwright)


@contextmanager
def _playwright() -> Iterator[Any]:
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        raise RenderError(
            "pictures need Playwright and a Chromium browser: pip install playwright, then "
            "`playwright install chromium` or your system's chromium package"
        ) from None
    with sync_playwright() as playwright:
        yield playwright


@contextmanager
def _opened(
    html: str, size: tuple[int, int], layers: Sequence[str], whole_page: bool, dark: bool
) -> Iterator[Any]:
    """Open a page in a browser of its own, which is gone afterwards."""
    # Only the superuser's Chromium refuses its sandbox.
    sandbox = ["--no-sandbox"] if hasattr(os, "geteuid") and os.geteuid() == 0 else []
    # Chromium leaves its socket's folder behind when it is stopped: give it one that goes.
    with TemporaryDirectory(prefix="sm") as folder, _playwright() as playwright:
        from playwright.sync_api import Error

        try:
            browser = playwright.chromium.launch(
                executable_path=_find_browser(playwright),
                args=_SOFTWARE + sandbox,
                env={**os.environ, "TMPDIR": folder},
            )
            try:
                page = browser.new_page(
                    viewport={"width": size[0], "height": size[1]},
                    color_scheme="dark" if dark else "light",
                    reduced_motion="reduce",
                )
                page.set_content(html)
                page.wait_for_selector("html[data-replay=ready]", timeout=60_000)
                page.evaluate(_PREPARE, {"layers": list(layers), "wholePage": whole_page})
                yield page
            finally:
                browser.close()
        except Error as error:
            raise RenderError(f"the browser could not draw the replay: {error}") from error


_PREPARE = """({ layers, wholePage }) => {
  document.documentElement.classList.toggle("picture", !wholePage);
  for (const name in replay.layers) replay.setLayer(name, layers.includes(name));
  replay.stage.resize();
}"""


def _find_browser(playwright: Any) -> str:
    for name in _BROWSERS:
        found = shutil.which(name)
        if found:
            return found
    own: str = playwright.chromium.executable_path
    if not Path(own).exists():
        raise RenderError(
            f"no browser to draw with: none of {', '.join(_BROWSERS)} is on the path; install "
            f"Chromium, or run `playwright install chromium`"
        )
    return own
