"""Pages of programs, parts and moves: every step can be jumped to, and seams have colours."""

from dataclasses import replace

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.shell.replay import replay_html, three
from selfmotion.shell.replay.meshes import Payload
from selfmotion.shell.replay.replayed import ToolTip
from selfmotion.shell.replay.sequence import SequenceReplay
from support.replay_plans import two_seams


@pytest.fixture(scope="module")
def program() -> sm.Program:
    return two_seams()


def test_the_steps_of_a_page_are_those_of_the_program(program) -> None:
    sequence = SequenceReplay.of(program)
    assert [mark.name for mark in sequence.marks] == [step.name for step in program.steps]
    assert [mark.begin for mark in sequence.marks] == list(program.begins)
    # Without a gap in between.
    for one, other in zip(sequence.marks[:-1], sequence.marks[1:], strict=True):
        assert one.end == pytest.approx(other.begin, abs=1e-12)
    assert [bool(step["color"]) for step in sequence.steps()] == [s.is_seam for s in program.steps]
    # The path that stands for it is where the tool goes.
    t = np.linspace(0.0, program.duration, 9)
    path = sequence.plan.problem.path.samples(t)
    for place, q in zip(path.translation, program.trajectory(t), strict=True):
        np.testing.assert_allclose(place, program.robot.pose(q).translation, atol=1e-12)
    assert [item.name for item in sequence.obstacles] == ["post"]


def test_a_program_becomes_a_page_and_what_is_missing_none(program) -> None:
    page = replay_html(program)
    assert "panda, program" in page
    assert program.verdict in page
    assert SequenceReplay.of(program.moves[0]).marks[0].end == program.moves[0].motion.duration
    missing = sm.Move(program.robot, (), None, "no way")
    with pytest.raises(sm.errors.PlanError, match="no way"):
        replay_html(missing)


def test_seams_are_drawn_thicker_than_moves(program, monkeypatch) -> None:
    tube, drawn = three.tube, []

    def recorded(points, radius):
        drawn.append((radius, np.ptp(points, axis=0).max()))
        return tube(points, radius)

    monkeypatch.setattr(three, "tube", recorded)
    replay_html(program)
    thick = max(radius for radius, _ in drawn)
    seams = [length for radius, length in drawn if radius == thick]
    moves = [radius for radius, _ in drawn if radius < thick]
    assert seams == pytest.approx([0.1, 0.1], abs=1e-3)
    assert len(moves) == sum(not step.is_seam for step in program.steps)
    assert max(moves) < 0.6 * thick


def test_moves_are_drawn_in_the_world_and_seams_where_they_are_carried() -> None:
    """On a table that turns, a move is no coil."""
    table = np.eye(4)
    table[0, 3] = 0.55
    cell = sm.load_robot(
        {"arm": "panda", "table": "positioner"},
        base={"table": table},
        tool="arm/panda_hand_tcp",
        reference="table/plate",
    )
    first, last = cell.home.copy(), cell.home.copy()
    first[-1], last[-1] = -1.5, 1.5
    move = sm.move(cell, first, last, clearance=None).require()
    sequence = SequenceReplay.of(move)
    tip = ToolTip(sequence.plan, sequence.plan.problem.follows.items[0], sequence.points())
    shown = tip.shown
    # The arm hardly moves in the world, while the plate turns by 3 rad below it.
    assert np.ptp(shown.tool_in_world, axis=0).max() < 1e-6
    assert np.ptp(shown.tool, axis=0).max() > 0.1
    assert sequence.trace_commands("/plan/tip0", Payload(), tip, {}, 0.005) == []


def test_what_happens_is_on_the_path_in_the_order_of_time() -> None:
    program = two_seams()
    first = program.steps[0]
    at = 0.4 * first.duration
    marked = replace(first, events=(("gas off", 2.0 * at), ("gas on", at)))
    told = SequenceReplay.of(replace(program, steps=(marked, *program.steps[1:])))
    assert SequenceReplay.of(program).events() == []
    assert [(each["t"], each["name"]) for each in told.events()] == [
        (pytest.approx(at), f"{first.name}: gas on"),
        (pytest.approx(2.0 * at), f"{first.name}: gas off"),
    ]
    assert [color for *_, color in told.seams()] == [
        step["color"] for step in told.steps() if step["color"]
    ]
