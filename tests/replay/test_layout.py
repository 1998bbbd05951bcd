"""Pages at the widths of a telephone, a tablet and a desk: all of it can be seen."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest

import selfmotion as sm
from selfmotion.shell.replay import write_replay
from selfmotion.work.batch import Row
from selfmotion.work.batch.folder import Folder
from support.layouts import WIDTHS, chromium, faults
from support.replay_plans import planar_plan, two_seams

pytestmark = pytest.mark.site

# What tells, and what is worked with.
TEXTS = (
    "h1",
    "#description",
    "#verdict",
    "#pair",
    "#numbers th",
    ".plot figcaption",
    ".map figcaption",
    ".map .said",
)
BOXES = (
    "#said", "#legend", "#layers", "#layers label", "#play", "#time", "#marks", "#clock", "#speed",
    "#home", "#download", "#last", "#choice button", "#steps", ".plot svg",
    ".map svg", ".key button", ".key output", "#numbers table",
)  # fmt: skip


@cache
def marked_job() -> sm.Program:
    """Two seams, with something that happens at both ends of the first one and in the other."""
    program = two_seams()
    first, second = (step for step in program.steps if step.is_seam)
    told = {
        first.name: (("arc on", 0.0), ("arc off", first.duration)),
        second.name: (("gas on", 0.4 * second.duration),),
    }
    steps = [replace(step, events=told.get(step.name, ())) for step in program.steps]
    return replace(program, steps=tuple(steps))


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("pages")
    plan = planar_plan()
    # Whatever there is to be said against a motion.
    told = replace(plan, certificate=replace(plan.certificate, notes=("what is noted, " * 20,)))
    return {
        "plans": write_replay([told, plan], folder / "plans.html"),
        "a job": write_replay(marked_job(), folder / "job.html"),
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


def marks_of(page: Any) -> dict[str, float]:
    """Return title → where a mark begins, or, of an event, its middle [px]."""
    middle = page.locator("#marks .event").evaluate_all(_PLACES.replace("SHARE", "0.5"))
    begin = page.locator("#marks .seam").evaluate_all(_PLACES.replace("SHARE", "0.0"))
    return {**dict(middle), **dict(begin)}


_PLACES = """marks => marks.map((mark) => {
  const { left, width } = mark.getBoundingClientRect();
  return [mark.title, left + SHARE * width];
})"""


def leads_to(page: Any, place: float) -> float:
    """Return the time that the slider leads to where it is pressed at a place [px]."""
    slider = page.locator("#time").bounding_box()
    page.mouse.click(place, slider["y"] + 0.5 * slider["height"])
    return float(page.evaluate("replay.now"))


def test_what_happens_is_marked_where_the_slider_leads_to_it(pages: dict[str, Any]) -> None:
    page, program = pages["a job"], marked_job()
    happens = [(at, f"{name}: {event}") for at, name, event in program.events]
    seams = [
        (begin, step.name)
        for begin, step in zip(program.begins, program.steps, strict=True)
        if step.is_seam
    ]
    expected = {f"{name}, at {at:.2f} s": at for at, name in (*seams, *happens)}
    page.set_viewport_size({"width": 800, "height": 800})
    page.locator("#controls").scroll_into_view_if_needed()
    places = marks_of(page)
    assert sorted(places) == sorted(expected)
    # Of the slider's length: two pixels, since browsers draw its knob as they like.
    near = 2.0 / page.locator("#marks").bounding_box()["width"] * program.duration
    for title, at in expected.items():
        assert leads_to(page, places[title]) == pytest.approx(at, abs=near), title
    title, at = next(iter(expected.items()))
    assert leads_to(page, places[title] + 6.0) != pytest.approx(at, abs=near), "a shifted mark"
    assert not pages["plans"].locator("#marks").is_visible()


def test_keys_and_marks_lead_to_each_event_and_seam(pages: dict[str, Any]) -> None:
    page, program = pages["a job"], marked_job()
    events = {at: f"{name}: {event}" for at, name, event in program.events}
    begins = [b for b, s in zip(program.begins, program.steps, strict=True) if s.is_seam]
    times = sorted({*(round(at, 6) for at in (*events, *begins))})
    page.evaluate("replay.seek(0.0)")
    met = []
    for _ in range(len(times)):
        page.keyboard.press(".")
        met.append(page.evaluate("replay.now"))
    assert met == pytest.approx(times, abs=1e-6)
    # Behind the last one there is none, and back they come in the other order.
    page.keyboard.press(".")
    assert page.evaluate("replay.now") == pytest.approx(times[-1], abs=1e-6)
    for at in reversed(times[:-1]):
        page.keyboard.press(",")
        assert page.evaluate("replay.now") == pytest.approx(at, abs=1e-6)
    for at, name in events.items():
        page.get_by_role("button", name=f"{name}, at").dispatch_event("click")
        assert page.evaluate("replay.now") == pytest.approx(at, abs=1e-6)
        assert name in page.locator("#time").get_attribute("aria-valuetext")
        assert page.locator("#last").inner_text().startswith(name)


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
