"""A path followed in a closed loop by the command, with a simulated controller over a socket."""

import json
import re
import socket
import threading
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.shell.cli import follow_command, outputs
from selfmotion.shell.cli.following import out_of_reach, replanner_of
from support.arms import PANDA_HOME, robot_named
from support.shell import complaint, invoke

# What the tool is off its path: the middle rule's error over cycles of 1 ms.
TRACKED = 1e-5
PERIOD, STEPS = 0.01, 60
# The same where limits hold the tool back [m].
LATE = 1e-3

CELL = """
task = "pose"
start = [{start}]
robot.name = "panda"

[path]
kind = "circle"
radius = 0.05
normal = [1, 0, 0]
duration = 3.0

[[constraints]]
kind = "JointVelocityLimits"
"""


def written(folder: Path) -> Path:
    file = folder / "cell.toml"
    file.write_text(CELL.format(start=", ".join(map(repr, PANDA_HOME.tolist()))))
    return file


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as port:
        port.bind(("127.0.0.1", 0))
        return int(port.getsockname()[1])


class Controller(threading.Thread):
    """Plays segments, and tells its state once a period, from a clock of its own."""

    def __init__(self, port: int, steps: int = STEPS, ends: bool = True) -> None:
        super().__init__(daemon=True)
        self.there, self.steps, self.ends = ("127.0.0.1", port), steps, ends
        self.clock, self.q, self.qd = 1000.0, PANDA_HOME, np.zeros(7)
        self.passed: list[tuple[float, np.ndarray]] = []
        self.pushed = -1

    def run(self) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
            # Until somebody listens.
            own.settimeout(0.1)
            for _ in range(self.steps):
                rows = self._answer(own)
                now = rows[np.argmin(np.abs(rows[:, 0] - self.clock - PERIOD))]
                self.clock, self.q, self.qd = now[0], now[1:8], now[8:15]
                if len(self.passed) + 1 == self.pushed:
                    self.q = self.q + 2e-3 * np.eye(7)[1]
                self.passed.append((self.clock - 1000.0, self.q))
                # What is no state changes nothing, wherever it comes from.
                own.sendto(b"nonsense", self.there)
            if self.ends:
                own.sendto(b"", self.there)

    def _answer(self, own: socket.socket) -> np.ndarray:
        own.settimeout(0.1)
        while True:
            state = np.concatenate([[self.clock], self.q, self.qd])
            own.sendto(state.tobytes(), self.there)
            try:
                return np.frombuffer(own.recv(65_536)).reshape(-1, 22)
            except TimeoutError:
                own.settimeout(1.0)


def test_the_arm_follows_the_path_of_the_file(tmp_path: Path) -> None:
    file, port = written(tmp_path), free_port()
    controller = Controller(port)
    controller.start()
    code, shown = invoke("follow", file, "--listen", f"127.0.0.1:{port}", "--json")
    controller.join(10.0)
    path, robot = sm.read_problem(file).path, robot_named("panda")
    for t, q in controller.passed:
        miss = sm.Task.POSE.miss(path.pose(t), robot.pose(q))
        assert max(miss) < TRACKED
    # It moved.
    assert np.abs(controller.q - PANDA_HOME).max() > 0.01
    found = json.loads(shown)
    assert code == 0
    assert found["ended"] == "the controller ended it"
    assert found["segments"] == {"planned": STEPS}
    assert found["states left out"] >= STEPS - 1
    assert found["largest position error"] < TRACKED


def test_states_of_a_wrong_length_are_told_with_the_right_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At once, as the controller waits for an answer that never comes, and at the end."""
    file, port = written(tmp_path), free_port()
    controller = Controller(port, steps=20)
    told: list[str] = []
    monkeypatch.setattr(follow_command, "_print_line", told.append)
    controller.start()
    code, shown = invoke("follow", file, "--listen", f"127.0.0.1:{port}")
    controller.join(10.0)
    assert code == 0
    said = "a state has 120: 15 doubles (time, 7 positions, 7 velocities)"
    # Once, however many there are.
    assert told == [f"left out: a datagram of 8 bytes; {said}"]
    assert f"of 8 bytes; {said}" in " ".join(shown.split("datagrams left out")[1].split())
    assert "kept by all commands; used: position" in " ".join(shown.split())


def test_a_path_that_leaves_the_reach_is_told_before_the_arm_moves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, told = written(tmp_path), list[str]()
    assert out_of_reach(sm.read_problem(file)) == ""
    file.write_text(file.read_text().replace("radius = 0.05", "radius = 0.9"))
    file.write_text("goal = 'fastest'\nmax_evaluations = 9\n" + file.read_text())
    monkeypatch.setattr(outputs, "print_notes", told.extend)
    # An address that is none ends it before anything moves.
    assert "expected host:port" in complaint("follow", file, "--listen", "nowhere")
    left, note = told
    assert left.endswith("goal, max_evaluations: of plans, and left out while the arm moves")
    assert re.match(r"from t = [0-9.]+ s on the pose is out of reach", note)


def test_when_the_tool_was_off_its_path_is_told(tmp_path: Path) -> None:
    """A push of 2 mrad in one joint, which is led back within the limits."""
    file, port = written(tmp_path), free_port()
    controller = Controller(port, steps=80)
    controller.pushed = 20
    controller.start()
    code, shown = invoke("follow", file, "--listen", f"127.0.0.1:{port}", "--json")
    controller.join(10.0)
    found = json.loads(shown[shown.index("{") :])
    assert code == 0
    ((first, last),) = found["off the path"]
    assert first == pytest.approx(20 * PERIOD, abs=1.5 * PERIOD)
    assert first < last < 80 * PERIOD
    assert found["limits kept"]
    assert found["limits used"]["acceleration"] > 0.0


def test_by_how_much_the_tool_is_late_is_told(tmp_path: Path) -> None:
    """On a path that is faster than the limits the tool stays on it, late."""
    file, port = written(tmp_path), free_port()
    file.write_text(file.read_text().replace("duration = 3.0", "duration = 0.5"))
    controller = Controller(port)
    controller.start()
    _, shown = invoke("follow", file, "--listen", f"127.0.0.1:{port}", "--json")
    controller.join(10.0)
    found = json.loads(shown[shown.index("{") :])
    t, q = controller.passed[-1]
    path, arm = sm.read_problem(file).path, robot_named("panda")
    # The arm stands where the path was by so much earlier; a segment's delay is that of its start.
    late = t - PERIOD - found["delay at the end"]
    assert 0.0 < found["delay at the end"] <= found["largest delay"]
    moved = arm.pose(controller.passed[-2][1]).translation - path.pose(late).translation
    assert np.linalg.norm(moved) < LATE
    assert np.abs(q - PANDA_HOME).max() > 0.01


def test_a_controller_that_is_silent_ends_it(tmp_path: Path) -> None:
    file, port = written(tmp_path), free_port()
    Controller(port, steps=3, ends=False).start()
    address = f"127.0.0.1:{port}"
    code, shown = invoke("follow", file, "--listen", address, "--set", "loop.silence=0.3")
    assert code == 0
    assert "no state for 0.3 s" in shown
    assert "3 planned" in shown


@pytest.mark.parametrize("address", ["5005", "127.0.0.1:", "127.0.0.1:99999", "nowhere:x"])
def test_an_address_that_is_none_is_refused(tmp_path: Path, address: str) -> None:
    assert "expected host:port" in complaint("follow", written(tmp_path), "--listen", address)


def test_what_is_not_kept_while_moving_is_refused(tmp_path: Path) -> None:
    file = written(tmp_path)
    file.write_text(file.read_text() + '\n[[relaxations]]\nrows = ["z"]\nband = 0.01\n')
    assert "no row is relaxed" in complaint("follow", file)
    problem = sm.read_problem(written(tmp_path))
    with pytest.raises(sm.errors.ProblemError, match="nothing is damped: leave 'damping' out"):
        replanner_of(replace(problem, damping=sm.Damping()))


def test_a_clearance_that_is_given_as_collision_is_kept_while_moving(tmp_path: Path) -> None:
    problem = sm.read_problem(written(tmp_path))
    apart = sm.constraints.Clearance(
        [sm.obstacles.Box("post", [0.0, -0.6, 0.6], [0.1, 0.1, 1.2])], 0.01
    )
    asked = []
    with patch.object(sm, "Replanner", lambda *given, **_: asked.append(given[3])):
        replanner_of(replace(problem, clearance=apart))
        replanner_of(problem)
    assert apart in asked[0]
    # By default the arm keeps off itself, as in plans.
    assert any(isinstance(item, sm.constraints.Clearance) for item in asked[1])


def test_a_file_without_constraints_is_followed_within_the_makers_limits(tmp_path: Path) -> None:
    file = written(tmp_path)
    text, _ = file.read_text().split("[[constraints]]")
    file.write_text(text)
    replanner = replanner_of(sm.read_problem(file))
    panda = robot_named("panda")
    expected = [panda.velocity_limit, panda.acceleration_limit]
    np.testing.assert_array_equal(replanner.limits[2:], expected)
    np.testing.assert_array_equal(replanner.jerk_limit, panda.jerk_limit)
    file.write_text(text + '[[constraints]]\nkind = "JointJerkLimits"\nlimit = 2000\n')
    assert np.all(replanner_of(sm.read_problem(file)).jerk_limit == 2000.0)
    file.write_text(text + '[[constraints]]\nkind = "ClosedPath"\n')
    assert "constraint ClosedPath is not kept while moving" in complaint("follow", file)


def test_a_port_that_is_taken_is_told(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{other.getsockname()[1]}"
        assert f"--listen {address}" in complaint("follow", written(tmp_path), "--listen", address)
