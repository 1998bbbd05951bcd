"""The page in a real browser: it moves as Pinocchio says, and its controls work."""

import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

from selfmotion.errors import ProblemError
from selfmotion.model.collision import Box, CollisionModel
from selfmotion.model.robot import NAMED_ARMS
from selfmotion.planning.redundancy import LEGEND
from selfmotion.problem.constraints import Clearance
from selfmotion.result import Reason
from selfmotion.shell.replay import notebook_html, write_meshcat, write_replay
from selfmotion.shop.controllers import read_motion
from support.layouts import chromium
from support.replay_plans import arm_plan, planar_plan, shelf_plan

pytestmark = pytest.mark.site


@pytest.fixture(scope="module")
def browser():
    with chromium() as found:
        yield found


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("replays")
    plans = {
        "planar": planar_plan(),
        "panda": arm_plan("panda"),
        "ur5": arm_plan("ur5"),
        "two": [planar_plan(), planar_plan(mu=30.0)],
    }
    return {name: write_replay(plan, folder / f"{name}.html") for name, plan in plans.items()}


class Seen:
    """What a page complained about, and what it asked for."""

    def __init__(self, page):
        self.complaints, self.requests = [], []
        page.on(
            "console",
            lambda m: self.complaints.append(m.text) if m.type in ("error", "warning") else None,
        )
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("request", lambda request: self.requests.append(request.url))


@pytest.fixture(scope="module")
def context(browser):
    """Return where pages are opened: those of one context share what is compiled to draw them."""
    # Pixels are drawn without a graphics card: few are enough.
    return browser.new_context(viewport={"width": 640, "height": 480}, reduced_motion="reduce")


def opened(context, file, *, viewport=None, reduced_motion=None):
    page = context.new_page()
    if viewport is not None:
        page.set_viewport_size(viewport)
    if reduced_motion is not None:
        page.emulate_media(reduced_motion=reduced_motion)
    page.seen = Seen(page)
    page.goto(file.as_uri())
    page.wait_for_selector("html[data-replay=ready]", timeout=60_000)
    return page


@pytest.fixture
def open_page(context):
    pages = []

    def open_file(file, **options):
        pages.append(opened(context, file, **options))
        return pages[-1]

    yield open_file
    for page in pages:
        page.close()


@pytest.fixture(scope="module")
def pages(context, files):
    """Open the page of each arm; scenes are set up anew for each that is opened."""
    found = {name: opened(context, files[name]) for name in ("planar", "panda", "ur5")}
    yield found
    for page in found.values():
        page.close()


def assert_quiet(page):
    # Chromium's remark on software rendering is about the machine, not about the page.
    loud = [text for text in page.seen.complaints if "GPU stall" not in text]
    assert loud == []
    assert [url for url in page.seen.requests if url[:5] not in ("file:", "data:", "blob:")] == []


POSES = """() => {
  const found = {};
  const inverse = viewer.scene.matrixWorld.clone().invert();
  viewer.scene.updateMatrixWorld(true);
  viewer.find(`/selfmotion/robot`).children.forEach((node) => {
    found[node.name] = inverse.clone().multiply(node.matrixWorld).toArray();
  });
  return found;
}"""


PLACES = """() => {
  const found = {};
  viewer.scene.updateMatrixWorld(true);
  const inverse = viewer.scene.matrixWorld.clone().invert();
  viewer.find(`/selfmotion/plan0/obstacles`).children.forEach((node) => {
    node.traverse((object) => {
      if (object.isMesh) found[node.name] = inverse.clone().multiply(object.matrixWorld).toArray();
    });
  });
  return found;
}"""


def page_poses(page):
    return {name: np.reshape(m, (4, 4)).T for name, m in page.evaluate(POSES).items()}


def largest_difference(poses, plan, time):
    robot, data = plan.robot, plan.robot.model.createData()
    pin.forwardKinematics(robot.model, data, plan.trajectory(time))
    return max(
        np.abs(poses[name] - data.oMi[k + 1].homogeneous).max()
        for k, name in enumerate(robot.joint_names)
    )


@pytest.mark.parametrize("name", ["planar", "panda", "ur5"])
def test_links_are_where_pinocchio_has_them(pages, name):
    page = pages[name]
    plan = planar_plan() if name == "planar" else arm_plan(name)
    assert page.evaluate("replay.duration") == pytest.approx(plan.trajectory.duration)
    for share in (0.0, 0.137, 0.5, 0.81, 1.0):
        time = share * plan.trajectory.duration
        page.evaluate("t => replay.seek(t)", time)
        poses = page_poses(page)
        assert largest_difference(poses, plan, time) < 1e-4
        if 0 < share < 1:
            assert largest_difference(poses, plan, 0.9 * time) > 1e-3
    assert_quiet(page)


def test_every_triangle_reaches_the_scene(pages):
    drawn = pages["ur5"].evaluate("""() => {
      let count = 0;
      viewer.find(`/selfmotion/robot`).traverse((object) => {
        if (object.isMesh) count += object.geometry.index.count / 3;
      });
      return count;
    }""")
    assert drawn == 95_694


def test_pixels_change_with_time_and_come_back(open_page, files):
    page = open_page(files["planar"], viewport={"width": 320, "height": 400})
    shots = [
        page.evaluate("t => { replay.seek(t); return viewer.image(); }", t) for t in (0.5, 2.0, 0.5)
    ]
    assert shots[0] != shots[1]
    assert shots[0] == shots[2]
    page.keyboard.press("g")
    ghost = page.evaluate("() => { replay.seek(0.5); return viewer.image(); }")
    assert ghost != shots[0]


def time_of(page):
    return page.evaluate("replay.now")


def box_of(seen):
    seen.scroll_into_view_if_needed()
    return seen.bounding_box()


def cursor_of(page):
    return page.evaluate("""[...document.querySelectorAll(".plot .cursor")]
      .map((line) => Number(line.getAttribute("x1")))""")


def test_keys_slider_and_plots_keep_one_time(pages):
    page = pages["planar"]
    page.evaluate("replay.seek(0.0)")
    places = [cursor_of(page)]
    for key, expected in (("ArrowRight", 0.02), ("Shift+ArrowRight", 0.22), ("ArrowLeft", 0.2)):
        page.keyboard.press(key)
        assert time_of(page) == pytest.approx(expected)
        places.append(cursor_of(page))
    assert all(a != b for a, b in pairwise(places))
    page.keyboard.press("End")
    assert time_of(page) == pytest.approx(2.0)
    page.keyboard.press("Home")
    assert time_of(page) == 0.0
    page.locator("#time").fill("1.5")
    assert time_of(page) == pytest.approx(1.5)
    assert page.locator("#clock").inner_text() == "1.50 / 2.00 s"
    box = box_of(page.locator(".plot svg").first)
    page.mouse.click(box["x"] + 52 + 0.25 * (box["width"] - 62), box["y"] + 60)
    assert time_of(page) == pytest.approx(0.5, abs=0.02)
    page.evaluate("replay.seek(1.0); viewer.render()")
    assert page.locator("#clock").inner_text() == "1.00 / 2.00 s"
    assert_quiet(page)


def test_play_and_pause(open_page, files):
    page = open_page(files["planar"])
    page.wait_for_timeout(200)
    assert time_of(page) == 0.0, "it must not start by itself where motion is to be reduced"
    page.locator("#speed").select_option("0.1")
    page.locator("#play").click()
    page.wait_for_timeout(600)
    page.locator("#play").click()
    stopped = time_of(page)
    assert 0.0 < stopped < 0.5
    page.wait_for_timeout(200)
    assert time_of(page) == stopped
    page.locator("#view").click()
    page.keyboard.press(" ")
    page.wait_for_timeout(400)
    assert time_of(page) != stopped


def test_it_starts_by_itself_otherwise(open_page, files):
    page = open_page(files["planar"], reduced_motion="no-preference")
    page.wait_for_timeout(500)
    assert time_of(page) > 0.0
    assert_quiet(page)


def test_hover_shows_the_values_there(pages):
    page = pages["planar"]
    page.evaluate("replay.seek(0.0)")
    plan = planar_plan()
    box = box_of(page.locator(".plot svg").first)
    page.mouse.move(box["x"] + 52 + 0.5 * (box["width"] - 62), box["y"] + 60)
    shown = [
        float(text) for text in page.locator(".plot").first.locator("output").all_inner_texts()
    ]
    np.testing.assert_allclose(shown, plan.trajectory(1.0), atol=0.05)
    assert time_of(page) == 0.0


def test_a_joint_singled_out_shows_its_limits(pages):
    page = pages["panda"]
    plot = page.locator(".plot").first
    before = plot.locator("svg text").all_text_contents()
    plot.locator("button").nth(3).click()
    assert plot.locator("button").nth(3).get_attribute("aria-pressed") == "true"
    assert plot.locator("svg text").all_text_contents() != before
    heights = plot.locator("svg .limit:not(.beyond)").evaluate_all(
        "lines => lines.map((line) => Number(line.getAttribute('y1')))"
    )
    assert len(heights) == 2
    assert all(10 <= height <= 168 for height in heights)


def test_plans_share_a_page(open_page, files):
    page = open_page(files["two"])
    second = planar_plan(mu=30.0)
    assert page.locator("#choice button:not(#sides)").count() == 2
    page.locator("#choice button").nth(1).click()
    page.evaluate("replay.seek(1.3)")
    assert largest_difference(page_poses(page), second, 1.3) < 1e-4
    assert largest_difference(page_poses(page), planar_plan(), 1.3) > 1e-3
    cost = f"{second.report.cost:.4g}"
    assert cost in page.locator("#description").inner_text()
    page.keyboard.press("1")
    assert cost not in page.locator("#description").inner_text()
    page.evaluate("replay.seek(1.3)")
    assert largest_difference(page_poses(page), planar_plan(), 1.3) < 1e-4
    assert page.locator("#numbers thead th").all_inner_texts() == ["Plan A", "Plan B"]
    assert_quiet(page)


LIT = """() => {
  const names = [];
  viewer.find(`/selfmotion`).traverse((object) => {
    if (object.material?.emissive?.getHex()) names.push(object.uuid);
  });
  return names;
}"""


def test_the_closest_pair_is_named_and_tinted(open_page, tmp_path):
    plan = shelf_plan()
    (clearance,) = plan.problem.clearances
    world = clearance.model(plan.robot)
    # Nearer than twice what is asked: of what is farther apart nothing is coloured.
    near = max(world.distance(plan.trajectory(time)).value for time in (0.5, 2.0))
    asked = Clearance(clearance.obstacles, 0.6 * near)
    plan = replace(plan, problem=replace(plan.problem, clearance=asked))
    page = open_page(write_replay([plan, arm_plan("panda")], tmp_path / "shelf.html"))
    for time in (0.5, 2.0):
        page.evaluate("t => replay.seek(t)", time)
        expected = world.distance(plan.trajectory(time))
        said = page.locator("#pair").inner_text()
        apart = f"{1e3 * expected.value:.3g}"
        assert said.startswith(f"closest: {expected.first} and {expected.second}, ")
        assert float(said.split(", ")[1].removesuffix(" mm")) == pytest.approx(
            float(apart), rel=1e-2
        )
        ends = np.array(page.evaluate("replay.stage.ends"))
        assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(expected.value, abs=1e-5)
        assert page.locator(".apart span.near").inner_text() == said.split(", ")[1]
        bodies = [name.replace("/", "_") for name in (expected.first, expected.second)]
        lit = page.evaluate(LIT)
        assert lit
        assert all(any(f"/{body}/" in name for body in bodies) for name in lit)
        assert all(any(f"/{body}/" in name for name in lit) for body in bodies)
    drawn = page.evaluate("""viewer.find(`/selfmotion/plan0/obstacles`)
      .children.map((node) => node.name)""")
    assert drawn == ["shelf", "ball", "post", "a_b", "part"]
    assert page.locator(".plot figcaption", has_text="Clearance").count() == 1
    page.keyboard.press("c")
    assert page.evaluate(LIT) == []
    assert not page.locator("#pair").is_visible()
    page.keyboard.press("c")
    page.keyboard.press("2")
    links = set(CollisionModel(plan.robot).bodies)
    assert page.evaluate(LIT) == [], "it asks for nothing"
    assert page.locator(".apart span:not(.near)").count() == 1
    first, second = (
        page.locator("#pair").inner_text()[len("closest: ") :].split(",")[0].split(" and ")
    )
    assert {first, second} <= links, "the second plan knows of no obstacles"
    assert not page.evaluate("viewer.find(`/selfmotion/plan0/obstacles`).visible")
    assert_quiet(page)


def test_bodies_that_meet_are_red(open_page, tmp_path):
    plan = arm_plan("panda")
    block = Box("block", plan.path.pose(1.0).translation, (0.05, 0.05, 0.05))
    plan = replace(plan, problem=replace(plan.problem, clearance=Clearance([block])))
    page = open_page(write_replay(plan, tmp_path / "block.html"))
    page.evaluate("replay.seek(1.0)")
    assert page.locator("#pair").inner_text().endswith("and block meet")
    colors = page.evaluate("""() => {
      const found = [];
      viewer.find(`/selfmotion`).traverse((object) => {
        if (object.material?.emissive?.getHex()) found.push(object.material.emissive.getHex());
      });
      return found;
    }""")
    assert set(colors) == {0xE00000}
    assert_quiet(page)


def test_the_motion_can_be_downloaded(pages):
    page = pages["panda"]
    plan = arm_plan("panda")
    with page.expect_download() as found:
        page.locator("#download").click()
    assert found.value.suggested_filename == "motion.csv"
    motion = read_motion(found.value.path().rename(found.value.path().with_suffix(".csv")))
    assert motion.joint_names == plan.robot.joint_names
    # The page holds single precision.
    assert np.abs(motion(motion.t) - plan.trajectory(motion.t)).max() < 1e-6
    assert_quiet(page)


def test_what_rides_is_drawn_on_its_link(open_page, tmp_path):
    plan = arm_plan("panda")
    pose = pin.SE3(pin.rpy.rpyToMatrix(0.3, 0.0, 0.5), np.array([0.0, 0.05, 0.1]))
    torch = Box("torch", pose, (0.04, 0.04, 0.2), frame="panda_hand")
    shelf = Box("shelf", [0.9, 0.0, 0.2], (0.1, 0.1, 0.1), frame="panda_link0")
    plan = replace(plan, problem=replace(plan.problem, clearance=Clearance([torch, shelf])))
    page = open_page(write_replay(plan, tmp_path / "torch.html"))
    robot, data = plan.robot, plan.robot.model.createData()
    hand = robot.model.getFrameId("panda_hand", pin.FrameType.BODY)
    seen = []
    for time in (0.0, 1.3, 4.0):
        page.evaluate("t => replay.seek(t)", time)
        pin.framesForwardKinematics(robot.model, data, plan.trajectory(time))
        places = page.evaluate(PLACES)
        expected = (data.oMf[hand] * pose).homogeneous
        assert np.abs(np.reshape(places["torch"], (4, 4)).T - expected).max() < 1e-4
        assert np.reshape(places["shelf"], (4, 4)).T[:3, 3] == pytest.approx([0.9, 0.0, 0.2])
        seen.append(expected)
    assert np.abs(seen[1] - seen[0]).max() > 1e-2
    assert_quiet(page)


@pytest.mark.parametrize("name", sorted(NAMED_ARMS))
def test_every_named_arm_is_drawn(open_page, pages, tmp_path, name):
    plan = planar_plan() if name == "planar_3r" else arm_plan(name)
    page = pages.get("planar" if name == "planar_3r" else name)
    if page is None:
        small = {"width": 120, "height": 250}
        page = open_page(write_replay(plan, tmp_path / "arm.html"), viewport=small)
    page.evaluate("replay.seek(0.5 * replay.duration)")
    time = 0.5 * plan.trajectory.duration
    assert largest_difference(page_poses(page), plan, time) < 1e-4
    # Without the arm the picture is another one.
    shots = page.evaluate("""() => [true, false].map((visible) => {
      replay.stage.show("/selfmotion/robot", visible);
      return viewer.image();
    })""")
    assert shots[0] != shots[1]
    assert_quiet(page)


def test_a_notebook_frame_works_in_its_sandbox(browser, tmp_path):
    notebook = tmp_path / "notebook.html"
    notebook.write_text(f"<!doctype html>{notebook_html(planar_plan())}", encoding="utf-8")
    context = browser.new_context(reduced_motion="reduce")
    page = context.new_page()
    page.seen = Seen(page)
    page.goto(notebook.as_uri())
    frame = page.frame_locator("iframe")
    frame.locator("html[data-replay=ready]").wait_for(timeout=60_000)
    assert frame.locator("#notice").is_hidden()
    assert_quiet(page)
    context.close()


def test_meshcat_shows_the_same_motion(open_page, tmp_path):
    plan = planar_plan()
    page = open_page(write_meshcat(plan, tmp_path / "meshcat.html"))
    for time in (0.3, 1.7):
        page.evaluate("t => { viewer.animator.pause(); viewer.animator.seek(t); }", time)
        poses = page.evaluate("""() => Object.fromEntries(
          viewer.scene_tree.find(["selfmotion", "robot"]).object.children.map((node) => {
            node.updateMatrix();
            return [node.name, node.matrix.toArray()];
          }))""")
        found = {name: np.reshape(matrix, (4, 4)).T for name, matrix in poses.items()}
        assert largest_difference(found, plan, time) < 1e-4
        assert largest_difference(found, plan, 0.9 * time) > 1e-3
    assert page.locator(".dg.main .close-button").first.is_visible(), "its own controls"
    assert_quiet(page)
    with pytest.raises(ProblemError, match="expected a Plan"):
        write_meshcat([plan], tmp_path / "several.html")


def test_a_telephone_shows_it_whole(open_page, files):
    page = open_page(files["panda"], viewport={"width": 390, "height": 780})
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    view = page.locator("#view canvas").bounding_box()
    assert view["width"] > 350
    for part in ("#play", "#time", "#legend", "#layers", "#verdict"):
        box = page.locator(part).bounding_box()
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= 390
    # Nothing of the verdict is cut.
    heights = "[verdict.scrollHeight, verdict.clientHeight]"
    whole, shown = page.evaluate(heights)
    assert whole <= shown + 1
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        text, ground = page.evaluate("""() => {
          const style = getComputedStyle(document.body);
          return [style.color, style.backgroundColor].map((c) => Number(c.match(/\\d+/)[0]));
        }""")
        assert (text > ground) == (scheme == "dark")


def test_without_webgl_the_plots_remain(playwright_without_webgl, files):
    page = playwright_without_webgl
    page.goto(files["planar"].as_uri())
    page.wait_for_selector("html[data-replay=ready]")
    notice = page.locator("#notice")
    assert "No 3-D view" in notice.inner_text()
    assert ".." not in notice.inner_text()
    assert page.locator("#still").is_visible()
    # It stands in the lowest part of the picture, not across the arm.
    words, picture = notice.bounding_box(), page.locator("#still").bounding_box()
    assert words["y"] > picture["y"] + 0.85 * picture["height"]
    page.keyboard.press("End")
    assert page.locator("#clock").inner_text() == "2.00 / 2.00 s"


def test_without_scripts_there_is_a_picture(browser, files):
    """On paper, too, in place of the scene."""
    still = browser.new_page(java_script_enabled=False)
    still.goto(files["panda"].as_uri())
    assert still.locator("#still").is_visible()
    assert not still.locator("#play").is_visible()
    assert "verified" in still.locator("#description").inner_text()
    still.close()


def test_the_picture_is_of_the_arm(files):
    """Each line ends where the next begins, and the last at the tool's path."""
    text = files["panda"].read_text(encoding="utf-8")
    drawn = re.findall(r'<polyline points="([^"]*)"', text)
    lines = [np.array([p.split(",") for p in each.split()], dtype=float) for each in drawn]
    *bones, path = lines
    # Three arms of seven joints, from the world to the tool.
    assert len(bones) == 3 * 8
    for k, share in enumerate((0, 50, 100)):
        arm = bones[8 * k : 8 * k + 8]
        for one, other in pairwise(arm):
            assert np.abs(one[1] - other[0]).max() < 0.11
        assert np.abs(arm[-1][1] - path[share]).max() < 0.11


@pytest.fixture
def playwright_without_webgl(browser):
    context = browser.new_context(reduced_motion="reduce")
    context.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    yield context.new_page()
    context.close()


def test_the_policy_stops_foreign_code(open_page, files, tmp_path):
    """The checks above can fail: a page with an added script and image is found out."""
    text = files["planar"].read_text(encoding="utf-8")
    tampered = tmp_path / "tampered.html"
    tampered.write_text(
        text.replace(
            "</main>",
            '</main><script>window.foreign = 1</script><img src="http://localhost:9/a.png">',
        ),
        encoding="utf-8",
    )
    page = open_page(tampered)
    assert page.evaluate("window.foreign") is None
    with pytest.raises(AssertionError):
        assert_quiet(page)


TIP = """() => {
  viewer.scene.updateMatrixWorld(true);
  const inverse = viewer.scene.matrixWorld.clone().invert();
  const object = viewer.find(`/selfmotion/robot/panda_joint7`);
  return inverse.multiply(object.matrixWorld).toArray();
}"""
# Between the times at which self-motions are known the tool is off by this at most [m, rad].
BETWEEN = 1e-3


def test_the_arm_moves_along_its_self_motion_and_the_tool_stays(pages):
    page = pages["panda"]
    page.evaluate("replay.seek(1.3)")
    before = page_poses(page)
    tip = np.array(page.evaluate(TIP))
    for step in (-7.0, -0.4, 4.5, 10.0):
        page.evaluate("step => replay.turn(step)", step)
        assert np.abs(np.array(page.evaluate(TIP)) - tip).max() < BETWEEN
        moved = page_poses(page)
        far = max(np.abs(moved[name] - pose).max() for name, pose in before.items())
        assert far > 1e-2
        # Of a posture of which nobody has measured it no distance is told.
        assert not page.locator("#pair").is_visible()
    page.evaluate("replay.seek(1.3)")
    assert largest_difference(page_poses(page), arm_plan("panda"), 1.3) < 1e-4
    assert_quiet(page)


def test_two_plans_move_side_by_side_on_one_clock(open_page, files):
    page = open_page(files["two"])
    page.locator("#sides").click()
    page.evaluate("replay.seek(1.3)")
    places = page.evaluate("""replay.sides.map(([stage, number]) => {
      const { viewer } = stage;
      viewer.scene.updateMatrixWorld(true);
      const inverse = viewer.scene.matrixWorld.clone().invert();
      return [number, stage.content.movers.map((name) => inverse.clone().multiply(
        viewer.find(`/selfmotion/robot/${name}`).matrixWorld).toArray())];
    })""")
    for (number, shown), plan in zip(places, (planar_plan(), planar_plan(mu=30.0)), strict=True):
        poses = [np.reshape(matrix, (4, 4)).T for matrix in shown]
        named = dict(zip(plan.robot.joint_names, poses, strict=True))
        assert largest_difference(named, plan, 1.3) < 1e-4, number
    labels = page.locator("[data-label]").evaluate_all("all => all.map((one) => one.dataset.label)")
    assert labels == ["Plan A", "Plan B"]
    # Both are seen from where one of them is turned to.
    page.locator("#camera").select_option("1,0,0.15")
    eyes = page.evaluate("replay.sides.map(([stage]) => stage.viewer.camera.position.toArray())")
    np.testing.assert_allclose(*eyes)
    page.locator("#sides").click()
    assert page.locator("#beside").is_hidden()
    assert_quiet(page)


def test_the_address_leads_to_a_time_and_a_plan(open_page, files):
    page = open_page(files["two"])
    page.evaluate("replay.choose(1); replay.seek(0.75)")
    assert page.url.endswith("#t=0.750&plan=2")
    again = page.context.new_page()
    again.seen = Seen(again)
    again.goto(page.url)
    again.wait_for_selector("html[data-replay=ready]", timeout=60_000)
    assert again.locator("#clock").inner_text().startswith("0.75 /")
    assert again.evaluate("replay.number") == 1
    assert_quiet(again)


def test_bodies_frames_and_names_are_shown_when_asked_for(pages):
    page = pages["panda"]
    shown = """() => viewer.find(`/selfmotion/bodies`).visible"""
    assert not page.evaluate(shown)
    for key in ("b", "n", "f"):
        page.keyboard.press(key)
    page.evaluate("viewer.render()")
    assert page.evaluate(shown)
    assert page.evaluate("replay.stage.axes.every(({ visible }) => visible)")
    assert "panda_link4" in page.locator(".names span").all_inner_texts()
    # The bodies move with their links.
    page.evaluate("replay.seek(2.0)")
    apart = page.evaluate("""() => {
      viewer.scene.updateMatrixWorld(true);
      const node = (part) => viewer.find(`/selfmotion/${part}/panda_joint5`);
      const at = (part) => node(part).matrixWorld.toArray();
      const [one, other] = [at("robot"), at("bodies")];
      return Math.max(...one.map((value, k) => Math.abs(value - other[k])));
    }""")
    assert apart == 0.0
    for key in ("b", "n", "f"):
        page.keyboard.press(key)
    assert page.locator(".names span").count() == 0
    assert_quiet(page)


def test_the_view_goes_along_with_the_tool(pages):
    page = pages["panda"]
    page.evaluate("replay.seek(0.0)")
    page.keyboard.press("v")
    target = "viewer.controls.target.toArray()"
    tool = "replay.stage.toolAt(replay.plan.ellipsoid, replay.now).toArray()"
    began = [np.array(page.evaluate(what)) for what in (target, tool)]
    page.evaluate("replay.seek(2.0)")
    ended = [np.array(page.evaluate(what)) for what in (target, tool)]
    np.testing.assert_allclose(ended[0] - began[0], ended[1] - began[1], atol=1e-9)
    assert np.abs(ended[1] - began[1]).max() > 1e-2
    page.keyboard.press("v")
    page.keyboard.press("r")


def test_the_redundancy_map_says_what_stops_the_arm_and_lets_it_stand_there(pages):
    page, plan = pages["panda"], arm_plan("panda")
    shown = plan.redundancy_map()
    # So high that the playback's buttons lie beside the map.
    page.set_viewport_size({"width": 640, "height": 1400})
    page.evaluate("replay.seek(0.0)")
    box = box_of(page.locator(".map canvas"))
    colors = np.reshape(page.evaluate(PIXELS), (*shown.state.T.shape, 4))[::-1, :, :3]
    for reason, (_, color) in LEGEND.items():
        drawn = [int(color[k : k + 2], 16) for k in (1, 3, 5)]
        np.testing.assert_array_equal((colors == drawn).all(axis=2).T, shown.state == reason)
    robot, data = plan.robot, plan.robot.model.createData()
    limited = np.argwhere(shown.state == Reason.LIMIT)[[0, -1]].tolist()
    for i, j in [(20, 61), *limited]:
        x = box["x"] + box["width"] * (i + 0.5) / len(shown.times)
        y = box["y"] + box["height"] * (1.0 - (j + 0.5) / len(shown.coordinate))
        page.mouse.move(x, y)
        said = page.locator(".map .said").inner_text()
        degrees = np.degrees(shown.coordinate[j])
        assert said.startswith(f"{shown.times[i]:.2f} s, {degrees:.1f}°: ")
        assert said.endswith(shown.reason(i, j)) if shown.reason(i, j) else "allowed" in said
        page.mouse.click(x, y)
        assert time_of(page) == pytest.approx(shown.times[i], abs=1e-3)
        poses = page_poses(page)
        pin.forwardKinematics(robot.model, data, shown.q[i, j])
        # Configurations travel in steps of 0.1 mrad.
        assert (
            max(
                np.abs(poses[name] - data.oMi[k + 1].homogeneous).max()
                for k, name in enumerate(robot.joint_names)
            )
            < 5e-4
        )
        assert largest_difference(poses, plan, shown.times[i]) > 1e-2
    page.evaluate("replay.seek(1.0)")
    assert largest_difference(page_poses(page), plan, 1.0) < 1e-4
    page.set_viewport_size({"width": 640, "height": 480})
    assert_quiet(page)


PIXELS = """() => {
  const canvas = document.querySelector(".map canvas");
  return Array.from(canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data);
}"""


def test_the_time_moves_along_the_redundancy_map(pages):
    page = pages["planar"]
    places = []
    for time in (0.0, 1.0, 2.0):
        page.evaluate("t => replay.seek(t)", time)
        places.append(float(page.locator(".map .cursor").get_attribute("x1")))
    canvas, svg = box_of(page.locator(".map canvas")), box_of(page.locator(".map svg"))
    first = canvas["x"] - svg["x"] + 0.5 * canvas["width"] / 121
    np.testing.assert_allclose(places, first + canvas["width"] * np.array([0, 60, 120]) / 121)
    assert page.locator(".map .line").count() == 2
    assert "Redundancy map: joint" in page.locator(".map figcaption").inner_text()
