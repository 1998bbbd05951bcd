"""Draw the pictures of `docs` from real replays: ``python docs/pictures.py``.

Needs a Chromium browser. Takes about a minute.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import selfmotion as sm
from selfmotion.shell.cli.runs import panda_past_a_box
from selfmotion.shell.replay import render_png

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.layouts import chromium
from support.views import served

DOCS = Path(__file__).parent


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
    """Draw the page of the how-to's file, with a handle chosen."""
    text = (DOCS / "pages" / "howto" / "view.md").read_text(encoding="utf-8")
    problem = text.split('```toml title="post.toml"\n')[1].split("```")[0]
    with TemporaryDirectory() as folder, chromium() as browser:
        file = Path(folder) / "post.toml"
        file.write_text(problem, encoding="utf-8")
        with served(file) as server:
            page = browser.new_page(
                viewport={"width": 1400, "height": 900}, reduced_motion="reduce"
            )
            page.goto(server.address)
            page.wait_for_selector("html[data-live=verified][data-brief=false]")
            page.locator("[data-handle=post]").click()
            page.evaluate("replay.seek(2.0)")
            page.screenshot(path=DOCS / "view.png")


def main() -> None:
    """Draw a replay's page and the page that is changed, then every named arm."""
    draw_view()
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
