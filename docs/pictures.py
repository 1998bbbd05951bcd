"""Draw the pictures of `docs` from real replays: ``python docs/pictures.py``.

Needs a Chromium browser. Takes some minutes.
"""

import contextlib
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import selfmotion as sm
from selfmotion.shell.cli.project_commands import panda_past_a_box
from selfmotion.shell.replay import render_png

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.layouts import chromium
from support.views import served

DOCS = Path(__file__).parent
# So long the map of a page may take [ms].
_SETTLED = 4000


def plan_of(name: str) -> sm.Plan:
    """Plan a vertical circle for a named arm, or the paper's sample problem for the planar one."""
    if name == "planar_3r":
        return sm.plan(sm.sample_problem())
    robot = sm.load_robot(name)
    task = sm.Task.POSE if robot.dof > 6 else sm.Task.POSITION
    start = robot.dexterous_configuration(task)
    path = sm.paths.Circle.around(robot.pose(start), 0.06, 4.0, normal=(1.0, 0.0, 0.0))
    return sm.plan(sm.Problem(robot, path, task, start))


def draw_view() -> None:
    """Draw the page of the how-to's file: a handle dragged, with the map beside the scene."""
    text = (DOCS / "pages" / "howto" / "view.md").read_text(encoding="utf-8")
    problem = text.split('```toml title="post.toml"\n')[1].split("```")[0]
    with TemporaryDirectory() as folder, chromium() as browser:
        file = Path(folder) / "post.toml"
        file.write_text(problem, encoding="utf-8")
        with served(file) as server:
            page = browser.new_page(
                viewport={"width": 1240, "height": 860}, reduced_motion="reduce"
            )
            page.goto(server.address)
            page.wait_for_selector("html[data-live=verified][data-brief=false]")
            page.evaluate(
                """() => {
                  const { handles } = replay.live;
                  handles.choose("path");
                  handles.grip(true);
                  handles.shown.get("path").mark.position.y -= 0.02;
                  handles.dragged();
                }"""
            )
            page.locator("#green").wait_for()
            page.locator("#maps:not(.stale) .map").wait_for()
            page.wait_for_timeout(_SETTLED)
            page.evaluate("replay.seek(2.0)")
            page.screenshot(path=DOCS / "view.png")


def draw_places() -> None:
    """Draw the map of places of the how-to's problem."""
    text = (DOCS / "pages" / "howto" / "places.md").read_text(encoding="utf-8")
    code = text.split("```python\n")[1].split("```")[0]
    names: dict[str, Any] = {}
    with TemporaryDirectory() as folder, chromium() as browser:
        with contextlib.chdir(folder):
            exec(code, names)
            found = names["found"]
            page_file = Path(folder) / "map.html"
            sm.files.write_placement(found, page_file, found.map(points=9))
        page = browser.new_page(viewport={"width": 1100, "height": 640})
        page.goto(page_file.as_uri())
        page.screenshot(path=DOCS / "places.png", full_page=True)


def main() -> None:
    """Draw a replay's page and the page that is changed, then every named arm."""
    draw_view()
    draw_places()
    shown = ("trace", "triads", "ghost")
    size = (1200, 900)
    plan = sm.plan(panda_past_a_box())
    render_png(plan, DOCS / "replay.png", t=2.5, size=size, layers=shown, whole_page=True)
    for name in sm.NAMED_ARMS:
        plan = plan_of(name)
        time = 0.3 * plan.trajectory.duration
        render_png(plan, DOCS / "arms" / f"{name}.png", t=time, size=(640, 420), layers=shown)


if __name__ == "__main__":
    main()
