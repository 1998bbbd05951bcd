"""A job planned again from its program: what stays is kept, what moved is as the old one was."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.task import SE3, Quaternion
from selfmotion.transfer import FreeMotions
from support.arms import robot_named
from support.shell import invoke

HOME = np.array(sm.NAMED_ARMS["panda"].home)
LIMITS = (sm.JointPositionLimits(), sm.JointVelocityLimits(), sm.JointAccelerationLimits(5.0))
POST = sm.Box("post", [0.55, 0.0, 0.15], [0.05, 0.05, 0.5])


def seams(by: float = 0.0, *, moved: tuple[int, ...] = (0, 1, 2)) -> list[sm.Seam]:
    """Three short lines, some of them elsewhere."""
    found, ur5 = [], robot_named("ur5")
    first = ur5.pose(ur5.dexterous_configuration("pointing"))
    for k, y in enumerate((0.0, 0.05, 0.1)):
        begin = first.translation + np.array([0.0, y, by if k in moved else 0.0])
        ends = [SE3(first.rotation, begin + np.array([0.0, 0.0, up])) for up in (0.0, 0.05)]
        found.append(
            sm.Seam(f"seam {k}", sm.Line(*ends, 1.5), "pointing", either_way=k == 1, wait=0.1 * k)
        )
    return found


def planned(asked: list[sm.Seam], before: sm.Program | None = None) -> sm.Program:
    ur5 = robot_named("ur5")
    start = ur5.dexterous_configuration("pointing")
    return sm.plan_job(
        ur5,
        asked,
        start=start,
        end=start,
        branches=1,
        order="given",
        constraints=LIMITS,
        clearance=None,
        begin_with=before,
    )


@pytest.fixture(scope="module")
def before() -> sm.Program:
    return planned(seams()).require()


def test_what_asks_for_the_same_is_kept(before: sm.Program) -> None:
    again = planned(seams(), before)
    assert again.verified
    assert [step.name for step in again.steps] == [step.name for step in before.steps]
    for new, old in zip(again.steps, before.steps, strict=True):
        np.testing.assert_array_equal(new.motion.q, old.motion.q)
        if not new.name.endswith("wait"):
            assert new.made is old.made


def test_only_what_moved_is_made_anew(before: sm.Program) -> None:
    again = planned(seams(0.03, moved=(1,)), before)
    assert again.verified, again.verdict
    assert again.order == before.order
    olds = {step.name: step for step in before.steps}
    for step in again.steps:
        old = olds[step.name]
        assert (step.made is old.made) == ("seam 1" not in step.name and not _waits(step.name))
        if step.is_seam:
            assert step.turned == old.turned
            # The part moved by 30 mm: so does the arm, in the same configuration.
            assert np.abs(step.motion.q[0] - old.motion.q[0]).max() < 0.3


def _waits(name: str) -> bool:
    return name.endswith("wait")


def test_other_seams_are_planned_from_nothing(before: sm.Program) -> None:
    fewer = planned(seams()[:2], before)
    assert fewer.verified
    assert sorted(fewer.order) == ["seam 0", "seam 1"]
    with pytest.raises(sm.ProblemError, match=r"begin_with is 'a.program', expected a Program"):
        sm.plan_job(robot_named("ur5"), seams(), begin_with="a.program")


def test_what_was_not_verified_is_not_kept(before: sm.Program) -> None:
    """A plan that somebody changed is planned anew."""
    steps = list(before.steps)
    k = next(k for k, step in enumerate(steps) if step.is_seam)
    plan = steps[k].made
    assert isinstance(plan, sm.Plan)
    motion = plan.trajectory
    broken = replace(plan, trajectory=replace(motion, q=motion.q + 0.01))
    broken = replace(broken, certificate=broken.check())
    assert not broken.certificate.verified
    steps[k] = replace(steps[k], made=broken)
    again = planned(seams(), replace(before, steps=tuple(steps)))
    assert again.verified
    made = next(step.made for step in again.steps if step.name == steps[k].name)
    assert made is not broken


def test_a_guide_is_followed_where_it_is_free_and_left_where_it_is_not() -> None:
    panda = robot_named("panda")
    out = np.array([0.0, 0.5, 0.0, 0.5, 0.0, 0.0, 0.0])
    side = np.array([0.9, *[0.0] * 6])
    first, last = HOME + out - side, HOME + out + side
    asked = (*LIMITS, sm.Clearance([POST], 0.01))
    free = FreeMotions(panda, asked, np.random.default_rng(0))
    found = free.between(first, last)
    assert found.verified
    lengths = np.linspace(0.0, 1.0, 30)
    guide = found.motion(found.motion.t[0] + lengths * found.motion.duration)
    guide[[0, -1]] = first, last
    again = FreeMotions(panda, asked, np.random.default_rng(1)).between(first, last, guide=guide)
    assert again.verified
    # A way through the post leads to what is found without one.
    through = np.stack([first, last])
    other = FreeMotions(panda, asked, np.random.default_rng(0))
    assert other.between(first, last, guide=through).verified


def test_the_shell_plans_a_job_from_its_program(tmp_path: Path) -> None:
    begin = robot_named("ur5").pose(robot_named("ur5").dexterous_configuration("pointing"))
    x, y, z, w = Quaternion(begin.rotation).coeffs()
    table = ["seam,x,y,z,qw,qx,qy,qz"]
    for up in (0.0, 0.05):
        place = begin.translation + np.array([0.0, 0.0, up])
        table.append(",".join(map(str, ["lane", *place, w, x, y, z])))
    (tmp_path / "lanes.csv").write_text("\n".join(table))
    file = tmp_path / "lanes.toml"
    file.write_text(
        'task = "pointing"\ncollision = false\nrobot = { name = "ur5" }\n'
        '[job]\nbranches = 1\norder = "given"\n'
        '[seams]\nfile = "lanes.csv"\nfeed = 0.05\neither_way = false\n'
    )
    first, second = tmp_path / "first.program", tmp_path / "second.program"
    code, text = invoke("job", file, "--out", first, "--folder", tmp_path / "one")
    assert code == 0, text
    moved = "seams.frame.position=[0.02,0,0.01]"
    kept = ("--folder", tmp_path / "two", "--from", first)
    code, text = invoke("job", file, "--out", second, "--set", moved, *kept)
    assert code == 0, text
    programs = [sm.load_program(name) for name in (first, second)]
    assert programs[0].order == programs[1].order
    assert programs[1].verified
    # Nothing was looked for in the folder: it was planned from the other program.
    assert not list((tmp_path / "two").glob("**/seam*"))
