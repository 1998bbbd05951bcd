"""ROS 2 bags: what a public reader finds in them, and what comes back."""

import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

import selfmotion as sm
from support.shell import complaint, invoke

# A stamp is a whole nanosecond.
NANO = 1e-9
# Dense enough that cubics through q and q̇ are the motion, to what is told of it.
RATE = 200.0
SPOILED = 120


@pytest.fixture(scope="module")
def bag(plan: sm.Plan, tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("bag") / "motion.mcap"
    sm.files.write_motion(plan, file, rate=RATE)
    return file


def test_a_public_reader_finds_states_and_the_tool(plan: sm.Plan, bag: Path) -> None:
    with bag.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        found = [
            (channel.topic, message) for _, channel, _, message in reader.iter_decoded_messages()
        ]
    states = [message for topic, message in found if topic == "/joint_states"]
    frames = [message.transforms[0] for topic, message in found if topic == "/tf"]
    assert len(states) == len(frames) == len(found) // 2 == int(3 * RATE) + 1
    stamps = [item.header.stamp for item in states]
    t = np.array([stamp.sec + 1e-9 * stamp.nanosec for stamp in stamps])
    np.testing.assert_allclose(t, np.arange(len(t)) / RATE, atol=NANO)
    robot = plan.robot
    for at, state, frame in list(zip(t, states, frames, strict=True))[::60]:
        assert tuple(state.name) == robot.joint_names
        np.testing.assert_allclose(state.position, plan.trajectory(min(at, 3.0)), atol=1e-8)
        np.testing.assert_allclose(state.velocity, plan.trajectory(min(at, 3.0), 1), atol=1e-6)
        assert (frame.header.stamp.sec, frame.child_frame_id) == (int(at), robot.tool)
        assert frame.header.frame_id == robot.urdf.root
        place, turn = frame.transform.translation, frame.transform.rotation
        q = pin.Quaternion(turn.w, turn.x, turn.y, turn.z)
        pose = robot.pose(np.array(state.position))
        np.testing.assert_allclose([place.x, place.y, place.z], pose.translation, atol=1e-12)
        np.testing.assert_allclose(q.matrix(), pose.rotation, atol=1e-12)


def test_what_is_read_back_is_the_motion(plan: sm.Plan, bag: Path) -> None:
    again = sm.files.read_motion(bag)
    assert plan.problem.certify(again, plan.tolerance).on_path
    assert again.joint_names == plan.trajectory.joint_names
    np.testing.assert_allclose(again.q, plan.trajectory(np.minimum(again.t, 3.0)), atol=1e-8)


def test_the_shell_writes_and_checks_a_bag(plan: sm.Plan, tmp_path: Path) -> None:
    plan.save(tmp_path / "plan.npz")
    code, text = invoke("export", tmp_path / "plan.npz", "--out", tmp_path / "b.mcap")
    assert (code, "b.mcap" in text) == (0, True)
    assert sm.files.read_motion(tmp_path / "b.mcap").duration == pytest.approx(3.0)


def test_spoiled_bags_are_refused_by_name(bag: Path, tmp_path: Path) -> None:
    """Or read as long as they were: not every byte counts."""
    whole, rng = bag.read_bytes(), np.random.default_rng(0)
    original, file, refused = sm.files.read_motion(bag), tmp_path / "spoiled.mcap", 0
    for _ in range(SPOILED):
        spoiled = bytearray(whole)
        for at in rng.integers(0, len(whole), 3):
            spoiled[at] = rng.integers(0, 256)
        kept = len(whole) if rng.integers(2) else int(rng.integers(0, len(whole)))
        file.write_bytes(spoiled[:kept])
        told, again = outcome(file)
        refused += again is None
        assert told.startswith(f"{file}: ") if again is None else len(again.q) == len(original.q)
    assert refused > SPOILED // 2


def outcome(file: Path) -> tuple[str, sm.Trajectory | None]:
    """Return why a file is refused, or its motion."""
    try:
        return "", sm.files.read_motion(file)
    except sm.errors.FileFormatError as error:
        return str(error), None


def test_a_bag_without_states_and_a_missing_package_are_told(
    plan: sm.Plan, bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    empty = tmp_path / "empty.mcap"
    empty.write_bytes(b"")
    with pytest.raises(sm.errors.FileFormatError, match="is no bag"):
        sm.files.read_motion(empty)
    monkeypatch.setitem(sys.modules, "mcap_ros2.writer", None)
    with pytest.raises(sm.errors.ProblemError, match=r"pip install 'selfmotion\[bags\]'"):
        sm.files.write_motion(plan, tmp_path / "b.mcap")
    plan.save(tmp_path / "plan.npz")
    said = complaint("export", tmp_path / "plan.npz", "--out", tmp_path / "b.mcap")
    assert "selfmotion[bags]" in said
