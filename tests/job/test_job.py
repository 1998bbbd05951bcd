"""A program makes every seam once, keeps everything at all times, and is the best that is known."""

import itertools
import os
import signal
import sys
from collections.abc import Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.model.task import SE3
from selfmotion.planning.transfer import FreeMotions
from selfmotion.work.job import Step, work
from support.arms import robot_named

DOWN = np.diag([1.0, -1.0, -1.0])
HOME = np.array(sm.NAMED_ARMS["panda"].home)
# Sums of a few durations in another order differ by this [s].
ROUNDING = 1e-9
# What other motions of the same seams may take more.
ALIKE = 1.05


def seam(name: str, first, last, **given) -> sm.Seam:
    """Return a straight seam of a second, the tool pointing down."""
    line = sm.paths.Line(SE3(DOWN, np.array(first)), SE3(DOWN, np.array(last)), 1.0)
    return sm.Seam(name, line, "pointing", **given)


def row_of_seams(count: int = 3) -> list[sm.Seam]:
    """Return parallel seams in an order and in directions that suit nobody."""
    y = np.linspace(-0.2, 0.2, count)
    order = sorted(range(count), key=lambda k: (k % 2, k))
    return [seam(f"seam {k}", [0.4, y[k], 0.3], [0.5, y[k], 0.3]) for k in order]


@pytest.fixture(scope="module")
def program() -> sm.Program:
    return sm.plan_job(robot_named("panda"), row_of_seams(), start=HOME, end=HOME, branches=1)


def test_every_seam_is_made_once_and_all_is_verified(program) -> None:
    program.require()
    assert sorted(program.order) == [f"seam {k}" for k in range(3)]
    motion = program.trajectory
    np.testing.assert_allclose(motion.q[[0, -1]], [HOME, HOME], rtol=0.0, atol=1e-12)
    assert motion.duration == pytest.approx(program.duration, abs=ROUNDING)
    # Every time belongs to one step.
    begins = [*program.begins, program.duration]
    durations = [step.motion.duration for step in program.steps]
    np.testing.assert_allclose(np.diff(begins), durations, atol=ROUNDING)
    for begin, step in zip(program.begins, program.steps, strict=True):
        t = np.linspace(0.0, step.motion.duration, 7)
        whole = motion(np.clip(begin + t, 0.0, motion.duration))
        np.testing.assert_allclose(whole, step.motion(step.motion.t[0] + t), atol=1e-9)


def test_the_order_is_the_best_of_all_by_the_times_of_the_moves(program) -> None:
    panda = robot_named("panda")
    seams = row_of_seams()
    alone = FreeMotions(panda, program.moves[0].constraints, np.random.default_rng(0))
    plans = program.plans
    ends = {name: plan.trajectory.q[[0, -1]] for name, plan in plans.items()}
    known: dict[bytes, float] = {}

    def seconds(first, last) -> float:
        pair = np.stack([first, last])
        if pair.tobytes() not in known:
            known[pair.tobytes()] = sm.move(panda, first, last).require().motion.duration
        return known[pair.tobytes()]

    orders = []
    for order in itertools.permutations(ends):
        for turned in itertools.product([1, -1], repeat=len(order)):
            ways = zip(order, turned, strict=True)
            q = [HOME, *(x for name, way in ways for x in ends[name][::way]), HOME]
            pairs = list(zip(q[::2], q[1::2], strict=True))
            orders.append((sum(float(alone.time_of(*pair)) for pair in pairs), pairs))
    # All that promise to take less, and some more.
    orders.sort(key=lambda item: item[0])
    for number, (least, pairs) in enumerate(orders):
        if number < 4 or least < program.transfer_time - ROUNDING:
            assert sum(seconds(*pair) for pair in pairs) >= program.transfer_time - ROUNDING
    assert program.bound == pytest.approx(program.transfer_time, abs=ROUNDING)
    given = sm.plan_job(panda, seams, start=HOME, end=HOME, order="given", branches=1).require()
    assert given.order == tuple(item.name for item in seams)
    # The motions that are known differ a little: some begin where the seam before ends.
    assert program.transfer_time < ALIKE * given.transfer_time


EVENTS = (("on", 0.1), ("off", 0.9))


def ordered_seams() -> list[sm.Seam]:
    """Return seams with an order, directions, events and a wait."""
    seams = {item.name: replace(item, either_way=False) for item in row_of_seams(3)}
    first = replace(seams["seam 0"], after=("seam 1",), wait=0.5, events=EVENTS)
    second = replace(seams["seam 1"], after_any=("seam 0", "seam 2"), wait=0.2)
    return [first, second, seams["seam 2"]]


@pytest.fixture(scope="module")
def ordered() -> sm.Program:
    return sm.plan_job(robot_named("panda"), ordered_seams(), branches=1)


def test_directions_order_waits_and_events_are_as_asked(ordered) -> None:
    panda, seams = robot_named("panda"), {item.name: item for item in ordered_seams()}
    circle = [seams["seam 0"], replace(seams["seam 1"], after=("seam 0",)), seams["seam 2"]]
    with pytest.raises(sm.errors.ProblemError, match="circular"):
        sm.plan_job(panda, circle, branches=1)
    made = ordered.require()
    assert made.order == ("seam 2", "seam 1", "seam 0")
    assert not any(step.turned for step in made.steps)
    for name, plan in made.plans.items():
        first = seams[name].path.pose(0.0)
        reached = panda.pose(plan.trajectory.q[0]).translation
        np.testing.assert_allclose(reached, first.translation, atol=1e-6)
    assert made.steps[-1].name == "seam 0, wait"
    assert made.steps[-1].motion.duration == 0.5
    begin = made.begins[[step.name for step in made.steps].index("seam 0")]
    assert made.events == ((begin + 0.1, "seam 0", "on"), (begin + 0.9, "seam 0", "off"))


def test_events_of_the_timetable_are_in_their_order(program, tmp_path) -> None:
    """Gas before the arc, and seams may be called as the ends of a job are in other words."""
    steps = list(program.steps)
    k = next(k for k, step in enumerate(steps) if step.is_seam)
    asked = [("gas on", 0.2), ("arc on", 0.2), ("arc off", 0.9), ("zap off", 1.0), ("air", 1.0)]
    steps[k] = replace(steps[k], name="end", events=tuple(asked))
    made = replace(program, steps=tuple(steps))
    sm.files.write_timetable(made, tmp_path / "a.csv")
    rows = [line.split(",") for line in (tmp_path / "a.csv").read_text().splitlines()[1:]]
    begins = [float(row[0]) for row in rows]
    assert begins == sorted(begins)
    events = [row[3].strip('"') for row in rows if row[2] == "event"]
    assert events == [f"end: {name}" for name, _ in asked]
    moves = [row[3].strip('"') for row in rows if row[2] == "move"]
    assert moves[0].startswith("job start → ")
    assert moves[-1].endswith(" → job end")


@pytest.mark.parametrize(
    ("events", "refused"),
    [
        ([("arc on", 0.3), ("arc off", 0.3)], True),
        ([("Arc off", 0.3), ("gas on", 0.3), ("arc on", 0.3)], True),
        ([("arc on", 0.3), ("arc off", 0.4)], False),
        ([("gas off", 0.3), ("arc on", 0.3)], False),
        ([("arc on", 0.3), ("arc on", 0.3)], False),
    ],
)
def test_what_is_switched_on_and_off_at_once_is_refused(events, refused: bool) -> None:
    with pytest.raises(sm.errors.ProblemError, match="no effect") if refused else nullcontext():
        seam("a", [0.4, 0.0, 0.3], [0.5, 0.0, 0.3], events=events)


@pytest.mark.parametrize("name", ["job start", "job end"])
def test_ends_of_a_job_have_names_of_their_own(name: str) -> None:
    with pytest.raises(sm.errors.ProblemError, match=f"'{name}' is an end of the job"):
        seam(name, [0.4, 0.0, 0.3], [0.5, 0.0, 0.3])


def tampered(program: sm.Program) -> Iterator[tuple[str, list[Step]]]:
    """Yield steps of which something is missing, elsewhere, shorter, or has another name."""
    steps = list(program.steps)
    for k, step in enumerate(steps):
        yield f"without {step.name}", steps[:k] + steps[k + 1 :]
        yield f"{step.name} twice", [*steps[: k + 1], *steps[k:]]
        for name in ("another", *(item.name for item in steps if item.name != step.name)):
            yield f"{step.name} as {name}", [*steps[:k], replace(step, name=name), *steps[k + 1 :]]
        if step.is_seam:
            turned = replace(step, turned=not step.turned)
            yield f"{step.name} turned", [*steps[:k], turned, *steps[k + 1 :]]
            late = replace(step, events=(*step.events[1:], ("late", 0.5)))
            yield f"{step.name} with other events", [*steps[:k], late, *steps[k + 1 :]]
            left = replace(step, leaves=(sm.obstacles.Sphere("drop", [0.0, 1.0, 2.0], 0.01),))
            yield f"{step.name} leaves something", [*steps[:k], left, *steps[k + 1 :]]
        met = replace(step, may_meet=("post",))
        yield f"{step.name} may meet more", [*steps[:k], met, *steps[k + 1 :]]
        if step.name.endswith(", wait"):
            motion = step.motion
            brief = replace(step.made, trajectory=replace(motion, t=0.9 * motion.t))
            yield f"{step.name} is short", [*steps[:k], replace(step, made=brief), *steps[k + 1 :]]
        for j in range(k):
            swapped = list(steps)
            swapped[j], swapped[k] = steps[k], steps[j]
            yield f"{steps[j].name} and {step.name} swapped", swapped
            swapped[j] = replace(swapped[j], name=steps[j].name)
            swapped[k] = replace(swapped[k], name=step.name)
            yield f"{steps[j].name} and {step.name} swapped and renamed", swapped


def test_whatever_is_not_as_asked_is_caught(program, ordered, tmp_path) -> None:
    for made in (program.require(), ordered.require()):
        # What a file gives back is held against the same.
        made.save(tmp_path / "asked.program")
        again = sm.load_program(tmp_path / "asked.program").require()
        for whole in (made, again):
            for what, steps in tampered(whole):
                assert not replace(whole, steps=tuple(steps)).verified, what


def test_the_reason_says_what_is_not_as_asked(program, ordered) -> None:
    def verdict(made: sm.Program, **given) -> str:
        return replace(made, **given).verdict

    assert "'seam 0' was asked for, and is neither" in verdict(ordered, steps=ordered.steps[:-3])
    assert "rests 0 s, not 0.5 s" in verdict(ordered, steps=ordered.steps[:-1])
    # Nor longer, or where nobody asked for it.
    *steps, wait = ordered.steps
    still = wait.motion
    longer = sm.Trajectory(100.0 * still.t, still.q, still.qd, still.joint_names, still.qdd)
    waits = [*steps, replace(wait, made=replace(wait.made, trajectory=longer))]
    assert "rests 50 s, not 0.5 s" in verdict(ordered, steps=waits)
    asked = ordered.specification
    none = replace(asked, seams=[replace(seam, wait=0.0) for seam in asked.seams])
    assert "'seam 0' the arm rests 0.5 s, not 0 s" in verdict(ordered, specification=none)
    assert "does not begin where it was asked" in verdict(program, steps=program.steps[1:])
    asked = ordered.specification
    assert asked is not None
    reversed_ = replace(asked.seams[2], after=("seam 0",))
    early = replace(asked, seams=(*asked.seams[:2], reversed_))
    assert "is made before 'seam 0'" in verdict(ordered, specification=early)
    listed = replace(asked, in_order=True)
    assert "not in the order" in verdict(ordered, specification=listed)
    # What is judged by less than the job asked for is not verified either.
    number = next(k for k, step in enumerate(ordered.steps) if not step.is_seam)
    step = ordered.steps[number]
    assert isinstance(step.made, sm.Move)
    for less in ((), step.made.constraints[1:], step.made.constraints[:-1]):
        free = replace(step, made=replace(step.made, constraints=less))
        steps = (*ordered.steps[:number], free, *ordered.steps[number + 1 :])
        assert "is not judged by" in verdict(ordered, steps=steps)
    # Steps that were put together by hand are told from a job.
    assert "the file does not say what was asked for" in verdict(ordered, specification=None)


def test_what_is_made_stands_in_the_way_of_what_comes_later() -> None:
    panda = robot_named("panda")
    hand = panda.urdf.links
    assert "panda_hand" in hand
    post = sm.obstacles.Box("post", [0.45, 0.0, 0.3], [0.04, 0.04, 0.3])
    seams = [
        seam("raise", [0.45, 0.3, 0.35], [0.5, 0.3, 0.35], leaves=[post], wait=0.1),
        seam("beside", [0.4, -0.3, 0.35], [0.5, -0.3, 0.35], after=["raise"]),
    ]
    made = sm.plan_job(panda, seams, branches=1).require()
    wait, move = made.moves
    for judged in (wait, move):
        assert [item.name for item in judged.obstacles] == ["post"]
    assert [item.name for item in made.plans["beside"].obstacles] == ["post"]
    # One without it is not verified: what stands there was not looked at.
    blind = sm.move(panda, move.motion.q[0], move.motion.q[-1]).require()
    steps = tuple(replace(s, made=blind) if s.made is move else s for s in made.steps)
    assert "is not checked against 'post'" in replace(made, steps=steps).verdict
    # Nor one that is judged against the same thing elsewhere.
    elsewhere = replace(post, pose=SE3(np.eye(3), np.array([0.45, 0.1, 0.3])))
    steps = tuple(replace(s, leaves=(elsewhere,) if s.leaves else ()) for s in made.steps)
    assert "is not checked against 'post'" in replace(made, steps=steps).verdict
    # What is made where another one stands has to come before it.
    inside = seam("inside", [0.45, 0.0, 0.3], [0.45, 0.05, 0.3])
    early = sm.plan_job(panda, [seams[0], inside], branches=1).require()
    assert early.order == ("inside", "raise")
    # But an order that is given stays.
    given = sm.plan_job(panda, [seams[0], inside], branches=1, order="given")
    assert given.order == ("raise",)
    assert "seam 'inside' is not made" in given.verdict
    # Where one is in the way of two, it is the one that is left out.
    deeper = seam("deeper", [0.45, 0.05, 0.3], [0.45, 0.0, 0.3])
    two = sm.plan_job(panda, [seams[0], inside, deeper], branches=1, order="given")
    assert two.order == ("inside", "deeper")
    assert "seam 'raise' is not made: it leaves what is in the way of '" in two.verdict
    late = sm.plan_job(panda, [seams[0], replace(inside, after=("raise",))], branches=1)
    assert "seam 'inside' is not made" in late.verdict
    assert "post" in late.verdict
    assert late.order == ("raise",)


def test_a_seam_that_ends_in_what_it_leaves_is_made_from_there() -> None:
    panda = robot_named("panda")
    post = sm.obstacles.Box("post", [0.5, 0.2, 0.35], [0.04, 0.04, 0.04])
    seams = [
        seam("towards", [0.45, 0.3, 0.35], [0.5, 0.2, 0.35], leaves=[post]),
        seam("then", [0.4, -0.3, 0.35], [0.5, -0.3, 0.35]),
    ]
    made = sm.plan_job(panda, seams, branches=1, order="given").require()
    assert [step.turned for step in made.steps if step.name == "towards"] == [True]
    # One that may meet what it leaves can go on from either end.
    free = [replace(seams[0], may_meet=("post",)), seams[1]]
    assert sm.plan_job(panda, free, branches=1, order="given").verified
    # From neither end where it leaves something at both: then it is the last one.
    other = sm.obstacles.Box("other", [0.45, 0.3, 0.35], [0.04, 0.04, 0.04])
    both = replace(seams[0], leaves=[post, other])
    assert sm.plan_job(panda, [both, seams[1]], branches=1).require().order == ("then", "towards")
    # Nor does it rest in it, or move away to the end of the program.
    for alone, end in ((replace(seams[0], wait=0.1), None), (seams[0], HOME)):
        last = sm.plan_job(panda, [alone], end=end, branches=1).require()
        assert [step.turned for step in last.steps if step.is_seam] == [True]
    resting = sm.plan_job(panda, [replace(both, wait=0.1), seams[1]], branches=1)
    assert resting.order == ("then",)
    assert "'towards' is not made: it ends in what it leaves" in resting.verdict


def test_a_seam_that_no_move_reaches_is_given_up_soon(monkeypatch) -> None:
    post = sm.obstacles.Box("post", [-0.5, 0.5, 0.3], [0.05, 0.05, 0.05])
    lone = seam("lone", [0.4, 0.3, 0.4], [0.45, 0.3, 0.4])
    first = replace(lone, name="first", leaves=[post])
    then = seam("then", [0.5, 0.0, 0.35], [0.55, 0.0, 0.35], after=["first"])
    tried, move = itertools.count(1), work._compute_move

    def blocked(task) -> sm.Move:
        missing = sm.Move(*task["arm"], None, "not found")
        if not missing.obstacles:
            return move(task)
        next(tried)
        return missing

    monkeypatch.setattr(work, "_compute_move", blocked)
    made = sm.plan_job(robot_named("panda"), [first, then, lone], branches=1)
    assert made.order == ("lone", "first")
    assert made.missing["then"] == "the move to it: not found"
    # What is not made does not count in the bound.
    assert made.bound <= made.transfer_time
    # Each takes its whole deadline: of hundreds of pairs of states twenty to each of two seams are
    # tried, and some with other ways.
    assert next(tried) < 50


@pytest.mark.parametrize("order", ["free", "given"])
def test_what_stands_on_what_is_not_made_is_not_made(order: str) -> None:
    lone = seam("lone", [0.4, 0.2, 0.3], [0.5, 0.2, 0.3])
    far = seam("far", [2.0, 0.0, 0.3], [2.1, 0.0, 0.3])
    upon = seam("upon", [0.4, 0.0, 0.3], [0.5, 0.0, 0.3], after_any=["far", "then"])
    then = seam("then", [0.4, -0.2, 0.3], [0.5, -0.2, 0.3], after=["upon"])
    made = sm.plan_job(robot_named("panda"), [far, upon, then, lone], branches=1, order=order)
    assert made.order == ("lone",)
    assert made.missing["upon"] == "nothing that supports it is made before it"
    assert made.missing["then"] == "it comes after 'upon', which is not made"
    # In a list it is in time that counts.
    later = [far, upon, replace(then, after=()), lone]
    listed = sm.plan_job(robot_named("panda"), later, branches=1, order=order)
    assert sorted(listed.missing) == (["far"] if order == "free" else ["far", "upon"])


def not_verified(file: Path) -> bool:
    """Whether a file is refused, or is not verified."""
    try:
        return not sm.load_program(file).verified
    except sm.errors.FileFormatError:
        return True


def test_a_program_that_was_changed_is_not_verified(program, tmp_path) -> None:
    program.save(tmp_path / "whole.program")
    again = sm.load_program(tmp_path / "whole.program").require()
    assert again.order == program.order
    np.testing.assert_array_equal(again.trajectory.q, program.trajectory.q)
    assert again.verdict == program.verdict
    # Steps in another order leave gaps, and one left out as well.
    swapped = replace(program, steps=program.steps[::-1])
    assert "would jump by" in swapped.verdict
    assert not replace(program, steps=program.steps[:2] + program.steps[3:]).verified
    data = bytearray((tmp_path / "whole.program").read_bytes())
    data[len(data) // 3] ^= 1
    (tmp_path / "spoiled.program").write_bytes(bytes(data))
    assert not_verified(tmp_path / "spoiled.program")


def test_what_was_put_in_afterwards_is_judged_anew(program) -> None:
    number = next(k for k, step in enumerate(program.steps) if not step.is_seam)
    step = program.steps[number]

    def with_step(**changes) -> sm.Program:
        steps = list(program.steps)
        steps[number] = replace(step, **changes)
        return replace(program, steps=tuple(steps))

    assert with_step().verified
    motion = step.motion
    hurried = replace(motion, t=0.2 * motion.t, qd=5.0 * motion.qd, qdd=25.0 * np.array(motion.qdd))
    assert not replace(step.made, trajectory=hurried).verified
    assert "times its limit" in with_step(made=replace(step.made, trajectory=hurried)).verdict
    late = with_step(events=(("on", 2.0 * motion.duration),))
    assert "event 'on'" in late.verdict
    other = replace(program, robot=robot_named("xarm7"))
    assert "of another arm than" in other.verdict


def test_a_program_begins_and_ends_at_rest() -> None:
    panda = robot_named("panda")
    ends = SE3(DOWN, np.array([0.4, 0.0, 0.3])), SE3(DOWN, np.array([0.45, 0.0, 0.3]))
    moving = sm.paths.Line(*ends, 1.0, time_law="constant")
    turning = sm.paths.TwistPath(ends[0], lambda t: np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.2]), 1.0)
    with pytest.raises(
        sm.errors.ProblemError, match=r"begins at 0 m/s and 0\.2 rad/s, expected rest"
    ):
        sm.Seam("turn", turning)
    # What the task leaves free need not rest.
    sm.Seam("turn", turning, "position")
    with pytest.raises(sm.errors.ProblemError, match=r"'hurry': its path begins at 0\.05 m/s"):
        sm.Seam("hurry", moving, "pointing")
    plan = sm.plan(sm.Problem(panda, moving, "pointing")).require()
    alone = sm.Program(panda, (Step("hurry", plan),), {})
    assert "'hurry' does not begin at rest" in alone.verdict
    assert "'hurry' does not end at rest" in alone.verdict


class OneAtOnce(Executor):
    """Does all but what comes first, which never ends."""

    def __init__(self) -> None:
        self.first: Future | None = None

    def submit(self, function, /, *given, **named) -> Future:
        future: Future = Future()
        if self.first is None:
            self.first = future
        else:
            future.set_result(function(*given, **named))
        return future


def test_what_is_finished_elsewhere_is_kept_before_what_takes_longer(tmp_path) -> None:
    def stop(_: str, number: int, __: int) -> None:
        if number == 2:
            raise KeyboardInterrupt

    executor = OneAtOnce()
    with pytest.raises(KeyboardInterrupt):
        sm.plan_job(
            robot_named("panda"),
            row_of_seams(2),
            branches=1,
            folder=tmp_path,
            executor=executor,
            progress=stop,
        )
    assert list(tmp_path.glob("seam-seam-1.*.npz"))
    # Nor does anybody wait for the other one.
    assert executor.first is not None
    assert executor.first.cancelled()


def test_a_job_that_is_ended_anywhere_goes_on_to_the_same_program(program, tmp_path) -> None:
    panda, seams = robot_named("panda"), row_of_seams()
    for end in (1, 4):
        told = itertools.count()

        def stop(*_, told=told, end=end) -> None:
            if next(told) == end:
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            sm.plan_job(
                panda, seams, start=HOME, end=HOME, branches=1, folder=tmp_path, progress=stop
            )
    kept = {file.name: file.stat().st_mtime_ns for file in tmp_path.glob("*.npz")}
    assert kept
    again = sm.plan_job(panda, seams, start=HOME, end=HOME, branches=1, folder=tmp_path)
    # What was finished is not done again.
    for name, time in kept.items():
        assert (tmp_path / name).stat().st_mtime_ns == time
    assert again.order == program.order
    np.testing.assert_array_equal(again.trajectory.q, program.trajectory.q)


def test_a_deadline_ends_a_job_which_goes_on_from_its_folder(program, tmp_path) -> None:
    panda, seams = robot_named("panda"), row_of_seams()
    given = {"start": HOME, "end": HOME, "branches": 1}
    with pytest.raises(sm.errors.DeadlineError, match="give a folder="):
        sm.plan_job(panda, seams, **given, deadline=1e-9)
    with pytest.raises(sm.errors.DeadlineError, match="planned by then is in"):
        sm.plan_job(panda, seams, **given, folder=tmp_path, deadline=1e-9)
    again = sm.plan_job(panda, seams, **given, folder=tmp_path, deadline=1e6)
    np.testing.assert_array_equal(again.trajectory.q, program.trajectory.q)


def test_bad_jobs_are_refused() -> None:
    panda, seams = robot_named("panda"), row_of_seams(2)
    for given, message in (
        ([], "no seams"),
        ([seams[0], seams[0]], "there twice"),
        ([replace(seams[0], after=("nobody",))], "no other seam"),
        ([replace(seams[0], may_meet=("nobody",))], "may meet 'nobody', which no seam leaves"),
        (["seam"], "expected a Seam"),
    ):
        with pytest.raises(sm.errors.ProblemError, match=message):
            sm.plan_job(panda, given)
    with pytest.raises(sm.errors.ProblemError, match="give it as clearance="):
        sm.plan_job(panda, seams, constraints=[sm.constraints.Clearance()])
    with pytest.raises(sm.errors.ProblemError, match="one way only"):
        replace(seams[0], constraints=[sm.constraints.EndConfiguration(HOME)])
    far = seam("far", [2.0, 0.0, 0.3], [2.1, 0.0, 0.3])
    farther = seam("farther", [3.0, 0.0, 0.3], [3.1, 0.0, 0.3])
    # A seam a line.
    with pytest.raises(
        sm.errors.PlanError, match=r"no seam has a motion:\n  'far': .*\n  'farther': "
    ):
        sm.plan_job(panda, [far, farther], branches=1)


def test_other_processes_come_to_the_same_program() -> None:
    panda, seams = robot_named("panda"), row_of_seams(2)
    with ProcessPoolExecutor(1) as executor:
        there = sm.plan_job(panda, seams, start=HOME, branches=1, executor=executor).require()
    here = sm.plan_job(panda, seams, start=HOME, branches=1)
    assert there.order == here.order
    np.testing.assert_array_equal(there.trajectory.q, here.trajectory.q)


def test_progress_tells_what_each_stage_is_about(program) -> None:
    told: list[tuple[str, int, int]] = []
    panda, seams = robot_named("panda"), row_of_seams()
    sm.plan_job(
        panda,
        seams,
        start=HOME,
        end=HOME,
        branches=1,
        progress=lambda *given: told.append(given),
    )
    stages = [stage for stage, *_ in told]
    assert {f"seam 'seam {k}'" for k in range(3)} <= set(stages)
    names = [step.name for step in program.steps if not step.is_seam]
    assert {f"move '{name}'" for name in names} <= set(stages)
    assert all(1 <= done <= total for _, done, total in told)


def test_ends_of_a_job_are_looked_at_before_anything_is_planned(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def planned(*_: object, **__: object) -> None:
        raise AssertionError("something was planned")

    monkeypatch.setattr(work, "branches", planned)
    panda, seams = robot_named("panda"), row_of_seams(1)
    beyond, met = HOME.copy(), HOME.copy()
    beyond[3] = -90.0
    met[1], met[3] = 1.7, -0.1
    floor = sm.obstacles.Box("floor", [0.0, 0.0, -0.06], [3.0, 3.0, 0.1])
    clearance = sm.constraints.Clearance([floor])
    for name, end, said in (
        ("start", beyond, r"'panda_joint4' is at -90 rad .*allowed.*are these degrees"),
        ("end", met, "floor"),
    ):
        with pytest.raises(sm.errors.ProblemError, match=rf"panda: the job's {name}: .*{said}"):
            sm.plan_job(panda, seams, clearance=clearance, **{name: end})


def test_an_interrupted_seam_stops_the_job(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever a plan had found when Ctrl-C was pressed: the job does not go on with it."""
    module = sys.modules["selfmotion.planning.planner.branches"]
    made = module.plan

    def pressed(*given: object, **options: object) -> sm.Plan:
        found = made(*given, **options)
        # After all was done, and the report says so.
        os.kill(os.getpid(), signal.SIGINT)
        return found

    monkeypatch.setattr(module, "plan", pressed)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            sm.plan_job(robot_named("panda"), row_of_seams(1), branches=1)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
