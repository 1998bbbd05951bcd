"""The page in a browser: what is dragged and slid is planned, and nothing leaves this machine."""

import re
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import ProblemError
from selfmotion.shell.view import maps, opened as open_page
from support.dragging import PATIENCE, drag, settled, turn
from support.industrial import two_seams
from support.layouts import WIDTHS, chromium, faults
from support.views import CIRCLE, Heard, Served, served

# A page that plans in a browser without a graphics card takes seconds for each drag.
pytestmark = pytest.mark.site

# So often each handle is dragged, and each slider moved; `make bench NAME=view` does so more often.
TIMES = 3
# Pixels of a map along either axis.
PIXELS = 41
# What tells, and what is worked with.
TEXTS = ("h1", "#verdict", "#told", "#change h2", "#figures dd", "#sliders span")
BOXES = (
    "#said", "#legend", "#layers", "#play", "#time", "#undo", "#save", "#export", "#handles button",
    "#turns", "#letgo", "#place input", "#why", "#green", "#sliders input", "#figures", "#jog",
    "#measure",
)  # fmt: skip


@pytest.fixture(scope="module")
def browser() -> Any:
    with chromium() as found:
        yield found


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Any:
    file = tmp_path_factory.mktemp("view") / "circle.toml"
    file.write_text(CIRCLE)
    # A page chooses how fine its maps are by how fast its machine is; these are alike on all.
    with pytest.MonkeyPatch.context() as patch, served(file) as found:
        patch.setattr(maps, "_side", lambda *_: PIXELS)
        yield found


@pytest.fixture(scope="module")
def page(browser: Any, server: Served) -> Any:
    # Pixels are drawn without a graphics card: few are enough.
    page = browser.new_page(viewport={"width": 640, "height": 480}, reduced_motion="reduce")
    page.complaints, page.requests = [], []
    page.on("pageerror", lambda error: page.complaints.append(str(error)))
    page.on(
        "console",
        lambda m: page.complaints.append(m.text) if m.type in ("error", "warning") else None,
    )
    page.on("request", lambda request: page.requests.append(request.url))
    page.on("websocket", lambda socket: page.requests.append(socket.url))
    page.goto(server.address)
    page.wait_for_selector("html[data-live=verified]", timeout=60_000)
    yield page
    quiet = ("GPU stall", "409 (Conflict)")  # of the machine; of the file that is refused
    loud = [text for text in page.complaints if not any(part in text for part in quiet)]
    assert loud == []
    hosts = {urlsplit(url).hostname for url in page.requests if url[:5] not in ("data:", "blob:")}
    assert hosts == {"127.0.0.1"}
    page.close()


SEEN = """(name) => {
  const { x, y } = new THREE.Vector3().setFromMatrixPosition(
    replay.live.handles.shown.get(name).mark.matrixWorld).project(viewer.camera);
  const box = viewer.renderer.domElement.getBoundingClientRect();
  return [box.left + (0.5 + x / 2) * box.width, box.top + (0.5 - y / 2) * box.height];
}"""


def saved(page: Any, server: Served) -> sm.Plan:
    """Save, and return what `selfmotion plan` makes of the file."""
    if page.locator("#save").is_enabled():
        page.locator("#save").click()
        page.locator("#told", has_text="Saved circle.toml.").wait_for()
    job = sm.files.read_job(server.session.edited.file)
    return sm.plan(job.problem, **job.settings)


def assert_same(shown: sm.Plan, plan: sm.Plan) -> None:
    np.testing.assert_array_equal(shown.trajectory.q, plan.trajectory.q)
    assert shown.report.cost == plan.report.cost


@pytest.mark.parametrize("name", ["path", "base", "post"])
def test_a_handle_is_dragged_and_the_plan_follows(page: Any, server: Served, name: str) -> None:
    """Each time the document is another one; in the end the plan is that of the file."""
    before = server.session.edited.document
    for k in range(TIMES):
        # Twice as far there as back, so that each place is a new one.
        drag(page, name, 1.0 if k % 2 == 0 else -0.5)
        shown = settled(page, server)
        assert server.session.edited.document != before
        before = server.session.edited.document
    assert shown.certificate.verified == page.locator("#verdict.verified").is_visible()
    assert_same(shown, saved(page, server))


def test_the_tool_is_turned(page: Any, server: Served) -> None:
    page.locator("[data-handle=tool]").click()
    assert page.evaluate("replay.live.handles.controls.mode") == "rotate"
    for k in range(TIMES):
        turn(page, "tool", 0.05 if k % 2 == 0 else -0.03)
        shown = settled(page, server)
    assert "tool_offset" in server.session.edited.document["robot"]
    assert_same(shown, saved(page, server))


@pytest.mark.parametrize("name", ["duration", "clearance", "weight of JointVelocity"])
def test_a_slider_is_moved_and_the_plan_follows(page: Any, server: Served, name: str) -> None:
    slider = page.locator(f"[data-slider='{name}']")
    begun = int(slider.input_value())
    for k in range(TIMES):
        place = begun + (8 if k % 2 == 0 else 4)
        slider.fill(str(place))
        shown = settled(page, server)
    assert shown.certificate.verified
    assert int(slider.input_value()) == place
    assert_same(shown, saved(page, server))


def test_a_number_is_typed(page: Any, server: Served) -> None:
    page.locator("[data-typed=clearance]").fill("20")
    page.locator("[data-typed=clearance]").press("Enter")
    shown = settled(page, server)
    assert server.session.edited.document["clearance"]["distance_mm"] == 20.0
    assert shown.certificate.verified
    page.locator("[data-typed=clearance]").fill("2000")
    page.locator("[data-typed=clearance]").press("Enter")
    page.wait_for_selector("#told.bad")
    assert "expected 0 to 100" in page.locator("#told").inner_text()
    page.locator("#undo").click()
    settled(page, server)


def test_the_map_beside_the_scene_says_why_and_its_slice_stays(page: Any, server: Served) -> None:
    choice = page.locator("#maps:not(.stale) .map select")
    choice.wait_for(timeout=PATIENCE)
    labels = choice.locator("option").all_inner_texts()
    names = settled(page, server).redundancy_coordinates()
    assert labels[0] == "rotation of the tool about its axis"
    assert [label.split("'")[1] for label in labels[1:]] == list(names[1 : len(labels)])
    choice.select_option(labels[1])
    # Where the line of the plan turns back, its pixel may have no configuration.
    x, y = page.evaluate("""() => {
      const { map } = replay.maps, high = map.values.length;
      const at = map.state.findIndex((state) => state !== map.nowhere);
      return [map.x(map.t[Math.floor(at / high)]), map.y(map.values[at % high])];
    }""")
    page.locator("#maps svg").click(position={"x": x, "y": y})
    assert page.locator("#pair").inner_text().startswith("shown from the map: ")
    # Another plan is shown along the same slice, if it has that one; this plan is so again.
    page.locator("[data-slider=duration]").fill("210")
    settled(page, server)
    page.locator("#maps.stale").wait_for(state="detached", timeout=PATIENCE)
    choice.wait_for(timeout=PATIENCE)
    others = choice.locator("option").all_inner_texts()
    assert choice.input_value() == (labels[1] if labels[1] in others else others[0])
    page.locator("#undo").click()
    settled(page, server)
    page.locator("#maps.stale").wait_for(state="detached", timeout=PATIENCE)
    choice.wait_for(timeout=PATIENCE)
    assert choice.locator("option").all_inner_texts() == labels
    assert choice.input_value() == labels[1]


def test_places_in_reach_are_green_as_long_as_the_path_is_chosen(page: Any, server: Served) -> None:
    """Also before it is dragged, and when it is released."""
    floor = "viewer.nodes.has('/selfmotion/floor')"
    page.evaluate("replay.live.handles.choose('path')")
    page.locator("#green").wait_for(timeout=PATIENCE)
    drag(page, "path", 1.0)
    settled(page, server)
    page.locator("#green").wait_for(timeout=PATIENCE)
    assert page.evaluate(floor)
    page.locator("#letgo").click()
    page.locator("#green").wait_for(state="hidden", timeout=PATIENCE)
    assert not page.evaluate(floor)
    page.locator("#undo").click()
    settled(page, server)


def test_a_place_is_typed(page: Any, server: Served) -> None:
    page.locator("[data-handle=post]").click()
    across = page.locator("[data-axis='1']")
    assert float(across.input_value()) == pytest.approx(
        1e3 * server.session.edited.document["clearance"]["obstacles"][0]["position"][1], abs=0.05
    )
    across.fill("-612.5")
    across.press("Enter")
    shown = settled(page, server)
    assert server.session.edited.document["clearance"]["obstacles"][0]["position"][1] == -0.6125
    assert_same(shown, saved(page, server))
    # What is dragged tells where it is.
    drag(page, "post", 1.0)
    settled(page, server)
    along = 1e3 * server.session.edited.document["clearance"]["obstacles"][0]["position"][0]
    assert float(page.locator("[data-axis='0']").input_value()) == pytest.approx(along, abs=0.051)
    page.locator("#letgo").click()
    assert not page.locator("#place").is_visible()


def test_it_says_why_the_arm_moves_as_it_does(page: Any, server: Served) -> None:
    """By the motion, and by what stops it on the map beside the plan's line."""
    page.locator("#maps:not(.stale) .map").wait_for(timeout=PATIENCE)
    plan = settled(page, server)
    page.wait_for_function("replay.plan.redundancy.length > 0", timeout=PATIENCE)
    labels = page.evaluate("replay.plan.redundancy[0].slices.map(({ label }) => label)")
    shown = page.evaluate("replay.maps.map.label")
    found = server.session.found.maps[0].maps[labels.index(shown)]
    k = len(found.times) // 3
    page.evaluate("(time) => replay.seek(time)", float(found.times[k]))
    said = page.locator("#why").inner_text()
    q, qd = (plan.trajectory(found.times[k], order) for order in (0, 1))
    shares = np.abs(qd) / plan.robot.velocity_limit
    room = np.minimum(q - plan.robot.lower, plan.robot.upper - q)
    assert f"{plan.robot.joint_names[int(np.argmax(shares))]} moves fastest" in said
    assert f"{plan.robot.joint_names[int(np.argmin(room))]} is nearest to a limit" in said
    assert f"What the path leaves free, the {shown}, is " in said
    # The first pixel that is not allowed above the line then, and at its height later.
    column, row = found.state[k], int(np.argmin(np.abs(found.coordinate - found.plan_line[k])))
    scale = np.degrees(1.0) if found.unit == "rad" else 1e3
    above = np.flatnonzero(column[row + 1 :] != 0)
    told = re.search(r"has to be below (-?[\d.]+)", said)
    assert (told is None) == (len(above) == 0)
    if told is not None:
        limit = scale * found.coordinate[row + 1 + above[0]]
        assert float(told[1]) == pytest.approx(limit, abs=0.051)
    later = np.flatnonzero(found.state[k + 1 :, row] != 0)
    told = re.search(r" from ([\d.]+) s", said)
    assert (told is None) == (len(later) == 0)
    if told is not None:
        time = found.times[k + 1 + later[0]] - found.times[0]
        assert float(told[1]) == pytest.approx(time, abs=0.0051)


def test_undo_goes_back(page: Any, server: Served) -> None:
    before = server.session.edited.document
    page.locator("[data-slider=duration]").fill("240")
    settled(page, server)
    assert server.session.edited.document != before
    page.locator("#undo").click()
    settled(page, server)
    assert server.session.edited.document == before


def test_what_is_refused_leaves_what_is_planned_to_be_shown(page: Any, server: Served) -> None:
    page.evaluate("""() => {
      replay.live.ask({ do: "slide", name: "duration", value: 4.5, final: true });
      replay.live.ask({ do: "drag", name: "roof", matrix: [], final: true });
    }""")
    settled(page, server)
    assert page.locator("html[data-live=verified]").count() == 1
    assert "there is no 'roof'" in page.locator("#told.bad").inner_text()


def test_a_page_loaded_anew_shows_what_is_planned(page: Any, server: Served) -> None:
    page.evaluate("""() => {
      replay.live.ask({ do: "slide", name: "duration", value: 4.0, final: true });
      replay.live.changed = false;
    }""")
    page.reload()
    page.wait_for_selector("html[data-live]", timeout=60_000)
    settled(page, server)
    assert page.locator("html[data-live=verified]").count() == 1
    assert server.session.found.plan.trajectory.duration == 4.0


def test_what_stops_it_is_said_and_red(page: Any, server: Served) -> None:
    page.evaluate("""() => {
      const { handles, ask } = replay.live;
      const matrix = handles.shown.get("path").handle.matrix.slice();
      matrix[12] += 3;
      replay.live.ask({ do: "drag", name: "path", matrix, final: true });
    }""")
    settled(page, server)
    assert page.locator("html[data-live=stopped]").count() == 1
    assert "no configuration" in page.locator("#verdict").inner_text()
    color = """() => { let found; viewer.find("/selfmotion/plan0/tip0/stopped").traverse(
      (object) => { found = object.material?.color.getHexString() ?? found; }); return found; }"""
    red, green, blue = (int(page.evaluate(color)[k : k + 2], 16) for k in (0, 2, 4))
    assert red > 5 * max(green, blue)
    page.locator("#undo").click()
    settled(page, server)
    assert page.locator("html[data-live=verified]").count() == 1


def test_a_motion_is_exported(page: Any, server: Served) -> None:
    with page.expect_download() as found:
        page.locator("#export").select_option(".csv")
    assert found.value.suggested_filename == "circle.csv"
    # Of the mass that ABB's programs need the page asks.
    assert not page.locator("#load").is_visible()
    page.locator("#export").select_option(".mod")
    page.wait_for_selector("#told.bad")
    assert "type it beside Export" in page.locator("#told").inner_text()
    with page.expect_download() as found:
        page.locator("#mass").fill("1.5")
        page.locator("#mass").press("Enter")
    assert found.value.suggested_filename == "circle.mod"
    text = Path(found.value.path()).read_text()
    assert "[1.5000" in text or "[1.5," in text


def test_joints_are_jogged_and_come_back(page: Any, server: Served) -> None:
    page.locator("#jog summary").click()
    place = """() => { const node = viewer.find("/selfmotion/robot/panda_joint2");
      node.updateWorldMatrix(true, false); return node.matrixWorld.toArray(); }"""
    before = page.evaluate(place)
    page.locator("[data-joint=panda_joint1]").fill("1.0")
    assert page.evaluate(place) != before
    assert "jogged by hand" in page.locator("#pair").inner_text()
    # What is told of the plan later does not take it away.
    jogged = page.evaluate(place)
    page.evaluate("replay.live.take(replay.live.last)")
    np.testing.assert_allclose(page.evaluate(place), jogged)
    page.evaluate("replay.seek(replay.now)")
    np.testing.assert_allclose(page.evaluate(place), before)
    page.locator("#jog summary").click()


def test_a_distance_is_measured(page: Any, server: Served) -> None:
    page.evaluate("replay.live.handles.choose(undefined)")
    page.locator("#measure").click()
    page.locator("#view").scroll_into_view_if_needed()
    hits: list[str] = []
    for name in ("post", "base"):
        page.mouse.click(*page.evaluate(SEEN, name))
        hits.append(page.locator("#measured").inner_text())
    assert hits[0] == "and another one"
    assert re.fullmatch(r"\d+\.\d mm", hits[1])
    points = page.evaluate("""() => replay.measure.points.map((point) => point.toArray())""")
    apart = 1e3 * float(np.linalg.norm(np.subtract(*points)))
    assert float(hits[1].removesuffix(" mm")) == pytest.approx(apart, abs=0.051)
    page.locator("#measure").click()


def test_a_second_tab_is_told(browser: Any, page: Any, server: Served) -> None:
    second = browser.new_page(viewport={"width": 640, "height": 480}, reduced_motion="reduce")
    second.goto(server.address)
    second.wait_for_selector("html[data-live=taken]", timeout=60_000)
    assert "Another tab has this page" in second.locator("#told").inner_text()
    assert second.locator("#change").evaluate("panel => panel.inert")
    second.close()
    assert page.evaluate("replay.live.socket.readyState") == 1


def test_it_is_seen_whole(page: Any, server: Served) -> None:
    page.locator("[data-handle=post]").click()
    page.evaluate("scrollTo(0, 0)")
    for width in WIDTHS:
        assert faults(page, TEXTS, BOXES, width) == [], width
    page.set_viewport_size({"width": 640, "height": 480})


def test_a_controllers_program_is_judged_by_its_job(tmp_path: Path) -> None:
    """As `selfmotion check` does: what is wrong with it is said, and its seam is red."""
    program = two_seams()
    job, file = tmp_path / "job.program", tmp_path / "job.src"
    program.save(job)
    signals = {"arc on": (1, True), "arc off": (1, False)}
    # The page writes it as its settings say.
    session = open_page(job)
    with pytest.raises(ProblemError, match="has no signal"):
        session.export(".src")
    session.settings = sm.files.ProgramSettings(signals=signals)
    file.write_bytes(session.export(".src"))
    shown = Heard(open_page(file, job=job)).messages[-1]
    assert shown["plans"][0]["verified"]
    names = [step["name"] for step in shown["plans"][0]["steps"]]
    assert names == [step.name for step in program.steps]
    broken = tmp_path / "broken.src"
    # One target in the middle is taught elsewhere.
    targets = list(re.finditer(r"A1 (-?[\d.]+)", file.read_text()))
    first, last = targets[len(targets) // 2].span(1)
    text = file.read_text()
    broken.write_text(f"{text[:first]}{float(text[first:last]) + 2.0:.6f}{text[last:]}")
    shown = Heard(open_page(broken, job=job)).messages[-1]
    assert shown["words"].startswith("not verified: ")
    assert not shown["plans"][0]["verified"]
    with pytest.raises(ProblemError, match=r"give the \.program that it was made of as --robot"):
        open_page(file)
    with pytest.raises(ProblemError, match="has no use for --robot"):
        open_page(job, job=job)
