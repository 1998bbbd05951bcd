"""Pages at the widths of a telephone, a tablet and a desk: all of it can be seen."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from selfmotion.batch.folder import Folder, Row
from selfmotion.replay import write_replay
from support.layouts import WIDTHS, chromium, faults
from support.replay_plans import planar_plan, two_seams

# What tells, and what is worked with.
TEXTS = ("h1", "#description", "#verdict", "#pair", "#numbers th", ".plot figcaption")
BOXES = (
    "#said", "#legend", "#layers", "#layers label", "#play", "#time", "#clock", "#speed", "#home",
    "#download", "#choice button", "#steps", ".plot svg", ".key button", ".key output",
    "#numbers table",
)  # fmt: skip


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("pages")
    plan = planar_plan()
    # Whatever there is to be said against a motion.
    told = replace(plan, certificate=replace(plan.certificate, notes=("what is noted, " * 20,)))
    return {
        "plans": write_replay([told, plan], folder / "plans.html"),
        "a job": write_replay(two_seams(), folder / "job.html"),
    }


@pytest.fixture(scope="module")
def browser() -> Any:
    with chromium() as found:
        yield found


def opened(browser: Any, file: Path) -> Any:
    page = browser.new_page(reduced_motion="reduce")
    page.goto(file.as_uri())
    page.wait_for_selector("html[data-replay=ready]", timeout=60_000)
    page.evaluate("replay.seek(0.4 * replay.duration)")
    return page


@pytest.fixture(scope="module")
def pages(browser: Any, files: dict[str, Path]) -> dict[str, Any]:
    """Open each once; the browser closes them."""
    return {name: opened(browser, file) for name, file in files.items()}


@pytest.mark.parametrize("name", ["plans", "a job"])
def test_a_replay_is_seen_whole(pages: dict[str, Any], name: str) -> None:
    page = pages[name]
    assert page.locator("#verdict").inner_text()
    for width in WIDTHS:
        assert faults(page, TEXTS, BOXES, width) == [], width


SPOILT = {
    "is cut": "#verdict { height: 10px; overflow: hidden }",
    "not within": "#clock { position: relative; left: 3000px }",
    "over each other": "#speed { position: absolute; left: 0; top: 0; width: 300px }",
    "wide": "h1 { width: 2000px }",
}


def test_what_cannot_be_seen_is_found(pages: dict[str, Any]) -> None:
    page = pages["plans"]
    for said, style in SPOILT.items():
        sheet = page.add_style_tag(content=style)
        assert any(said in fault for fault in faults(page, TEXTS, BOXES, 800)), said
        sheet.evaluate("sheet => sheet.remove()")
    assert faults(page, TEXTS, BOXES, 800) == []


def test_a_batch_is_seen_whole(browser: Any, tmp_path: Path) -> None:
    settings = {"path.duration": 4, "robot.base.position": [0.0, 0.0, 0.2]}
    rows = [
        Row(f"many-{k}", "", tmp_path / f"plans/many-{k}.npz", settings, error=error, verdict=said)
        for k, (error, said) in enumerate(
            [("", "verified at all times " * 9), ("no way " * 40, "")]
        )
    ]
    Folder(tmp_path).write_tables(rows, 0)
    page = browser.new_page()
    page.goto((tmp_path / "index.html").as_uri())
    for width in WIDTHS:
        assert faults(page, ("h1", "td", "th"), ("td", "th"), width) == [], width
    page.close()
