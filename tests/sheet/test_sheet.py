"""Process sheets: each number is of the certificate, the report or the margins."""

import dataclasses
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.shop.sheet.page import sections
from support.arms import robot_named
from support.shell import complaint, invoke


class Cells(HTMLParser):
    """The rows of all tables of a page, by the heading above them."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tables: dict[str, list[list[str]]] = {}
        self._tag, self._title, self.outside = "", "", []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self._tag = tag
        if tag == "tr":
            self.tables[self._title].append([])
        if tag in ("td", "th"):
            self.tables[self._title][-1].append("")
        self.outside += [value for key, value in attrs if key in ("src", "href")]  # type: ignore[attr-defined]

    def handle_endtag(self, tag: str) -> None:
        self._tag = ""

    def handle_data(self, data: str) -> None:
        if self._tag == "h2":
            self._title = data
            self.tables[data] = []
        if self._tag in ("td", "th"):
            self.tables[self._title][-1][-1] += data


@pytest.fixture(scope="module")
def plan() -> sm.Plan:
    """A motion with a body near it, whose joints reach a limit of their speed."""
    robot = robot_named("panda")
    start = np.array(sm.NAMED_ARMS["panda"].home)
    circle = sm.paths.Circle.around(robot.pose(start), 0.1, 3.0, normal=(1.0, 0.0, 0.0))
    block = sm.obstacles.Box(
        "<block>", robot.pose(start).translation - np.array([0, 0, 0.15]), [0.2, 0.2, 0.02]
    )
    constraints = [
        sm.constraints.JointPositionLimits(),
        sm.constraints.JointVelocityLimits(),
        sm.constraints.Clearance([block], 5e-3),
    ]
    return sm.plan(sm.Problem(robot, circle, start=start, constraints=constraints)).require()


def test_numbers_are_those_of_certificate_report_and_margins(plan: sm.Plan, tmp_path: Path) -> None:
    margins = sm.margin(plan, sm.Tolerance(1e-3, 0.1))
    page = sm.files.write_sheet(plan, tmp_path / "sheet.html", margins).read_text()
    cells, check = Cells(page), plan.certificate
    assert not cells.outside
    assert check.verdict.split(":")[0] in page
    path = {row[0]: row for row in cells.tables["Path, at all times"][1:]}
    assert float(path["position error"][1].split()[0]) == pytest.approx(
        check.position_error.value, rel=5e-3
    )
    near = {row[0]: row for row in cells.tables["Closest approaches"][1:]}
    for name, found in plan.approaches.items():
        assert float(near[name][1].split()[0]) == pytest.approx(1e3 * found.value, rel=1e-3)
    turned = cells.tables["Joint reversals"][1:]
    assert sum(int(row[1]) for row in turned if row[1]) == plan.reversals.count
    wide = cells.tables["How far it may be off while the program runs unchanged"][1:]
    assert len(wide) == 9
    assert wide[0][2] == margins.part.translation.size
    kept = cells.tables["Requirements, at all times"][1:]
    assert len(kept) == len([item for item in check.findings if item.requirement != "feed"])
    assert {row[-1] for row in kept} == {"kept"}
    active = cells.tables.get("Active constraints", [[]])[1:]
    assert len(active) == len(plan.report.active)
    assert "the arm is built as its URDF draws it" in page


def test_what_is_not_kept_is_said(plan: sm.Plan, tmp_path: Path) -> None:
    broken = dataclasses.replace(plan, certificate=plan.check(sm.Tolerance(1e-15, 1e-15)))
    page = sm.files.write_sheet(broken, tmp_path / "sheet.html").read_text()
    assert 'class="refused"' in page
    assert "off the path" in page
    titles = [section.title for section in sections(broken, None)]
    assert not any("runs unchanged" in title for title in titles)


def test_feeds_are_asked_and_reached(tmp_path: Path) -> None:
    robot = robot_named("panda")
    pose = robot.pose(np.array(sm.NAMED_ARMS["panda"].home))
    end = pose.copy()
    end.translation = pose.translation + np.array([0.0, 0.1, 0.0])
    line = sm.paths.Line(pose, end, 3.0)
    plan = sm.plan(sm.Problem(robot, sm.paths.Feed(line, 0.02), "position"))
    (feed,) = plan.path.feeds
    cells = Cells(sm.files.write_sheet(plan, tmp_path / "sheet.html", title="a & b").read_text())
    (row,) = cells.tables["Feeds"][1:]
    assert float(row[1].split()[0]) == 0.02
    assert float(row[2].split()[0]) == pytest.approx(feed.reached, rel=1e-3)


def test_what_is_no_sheet_is_refused(plan: sm.Plan, tmp_path: Path) -> None:
    with pytest.raises(sm.errors.ProblemError, match="expected a Plan"):
        sm.files.write_sheet(None, tmp_path / "a.html")  # type: ignore[arg-type]
    with pytest.raises(sm.errors.ProblemError, match=re.escape("ends in .html")):
        sm.files.write_sheet(plan, tmp_path / "a.pdf")
    with pytest.raises(sm.errors.ProblemError, match="expected Margins"):
        sm.files.write_sheet(plan, tmp_path / "a.html", 3)  # type: ignore[arg-type]
    moved = dataclasses.replace(plan.trajectory, t=plan.trajectory.t * 2.0)
    other = dataclasses.replace(plan, trajectory=moved)
    with pytest.raises(sm.errors.PlanError, match="of another motion"):
        sm.files.write_sheet(other, tmp_path / "a.html")


def test_sheets_from_the_shell(plan: sm.Plan, tmp_path: Path) -> None:
    file, page = tmp_path / "plan.npz", tmp_path / "sheet.html"
    plan.save(file)
    code, told = invoke("sheet", file, "-o", page, "--title", "cell 3")
    assert code == 0, told
    assert "<h1>cell 3</h1>" in page.read_text()
    assert "&lt;block&gt;" in page.read_text()
    assert "together" in complaint("sheet", file, "--turn", "0.1")
