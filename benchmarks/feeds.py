"""200 random feeds: refused before planning where no arm has them, kept where a plan is verified.

Random lines, circles, splines and polylines of several arms, at feeds from 5 mm/s to 1 m/s. Of each
verified plan the tool's speed is measured by Pinocchio's kinematics and differences: it is never
faster than the feed by what may be missing of it, and slower only around both ends and rounded
corners. Of each refused one the feed that is named is planned: that has to be verified.

A feed that is refused before planning is not kept by the path: by differences of its positions it
is too slow away from corners, and from ends by more than a run-up at half the acceleration. Nor is
one that is larger than the one that is named by 7 %. A path that is planned keeps its feed.
"""

import argparse
import re
import sys
import time
from collections import Counter
from collections.abc import Iterator

import numpy as np
import pinocchio as pin

import selfmotion as sm
from selfmotion.problem.problem import check_feeds

ARMS = ("panda", "xarm7", "ur10", "kinova")
# Times between which the tool's speed is measured [s], and what differences of positions miss.
STEP, MISSED = 1e-4, 2e-3
# How far from its corner a rounded one begins and ends [m].
CORNER = 0.03
# A feed that is larger by this than the named one is not kept.
NEAR = 1.07
# A smooth pace takes so many windows of smoothing more, and counts from a node of the path on: that
# is at most such a share of the path away.
WINDOWS, NODES = 2.0, 2e-3


def random_paths(seed: int) -> Iterator[tuple[sm.RobotModel, sm.paths.Feed, np.ndarray]]:
    """Yield arms, paths at a feed and their corners, for ever."""
    rng = np.random.default_rng(seed)
    robots = [sm.load_robot(name) for name in ARMS]
    while True:
        robot = robots[rng.integers(len(robots))]
        q = rng.uniform(np.maximum(robot.lower, -2.0), np.minimum(robot.upper, 2.0))
        pose = robot.pose(q)
        size = rng.uniform(0.05, 0.25)
        points = pose.translation + rng.uniform(-size, size, (5, 3))
        points[0] = pose.translation
        last = pin.SE3(pose.rotation, points[1])
        shapes = (
            lambda a=pose, b=last: sm.paths.Line(a, b, 1.0),
            lambda a=pose, s=size: sm.paths.Circle.around(a, s, 1.0, turns=0.8),
            lambda p=points: sm.paths.Waypoints(np.arange(5.0), p),
            lambda p=points: sm.paths.Polyline(p, tolerance=0.01),
        )
        feed = np.exp(rng.uniform(np.log(5e-3), 0.0))
        most = np.exp(rng.uniform(np.log(0.5), np.log(20.0)))
        path = shapes[rng.integers(len(shapes))]()
        corners = points[1:-1] if isinstance(path, sm.paths.Polyline) else np.zeros((0, 3))
        bounds = {"acceleration": float(f"{most:.2g}")}
        try:
            yield robot, sm.paths.Feed(path, float(f"{feed:.2g}"), **bounds), corners
        except sm.errors.PathError as error:
            print(f"  no path: {error}")


def is_kept(plan: sm.Plan, feed: sm.paths.Feed, corners: np.ndarray) -> str:
    """Return what is wrong with the tool's speed, "" for nothing."""
    motion, robot, within = plan.trajectory, plan.robot, 0.02
    t = np.arange(STEP, motion.duration - STEP, max(STEP, motion.duration / 20_000))
    places = np.array(
        [[robot.pose(q).translation for q in motion(at)] for at in (t - 0.5 * STEP, t + 0.5 * STEP)]
    )
    speed = np.linalg.norm(places[1] - places[0], axis=1) / STEP
    if speed.max() > (1.0 + within + MISSED) * feed.feed:
        return f"{speed.max():.4g} m/s, faster than {feed.feed:g}"
    slow = np.flatnonzero(speed < (1.0 - within - MISSED) * feed.feed)
    if not len(slow):
        return ""
    runs = np.split(slow, np.flatnonzero(np.diff(slow) > 1) + 1)
    for run in runs:
        at_end = run[0] == 0 or run[-1] == len(t) - 1
        away = np.linalg.norm(places[0][run, None] - corners, axis=2)
        if not (at_end or np.any(away < CORNER)):
            first, last = t[run[0]], t[run[-1]]
            return f"slower than {feed.feed:g} m/s from {first:.3f} to {last:.3f} s"
    return ""


def path_keeps(feed: sm.paths.Feed, corners: np.ndarray) -> bool:
    """Return whether a path keeps its feed by itself, by differences of its positions."""
    t = np.linspace(0.0, feed.duration, 20_001)
    places = feed.samples(t).translation
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    speed, along = steps / np.diff(t), np.cumsum(steps)
    limits = feed.limits
    run_up = feed.feed**2 / limits["acceleration"] + WINDOWS * limits["smoothing"] * feed.feed
    run_up += NODES * along[-1]
    away = (along > run_up) & (along[-1] - along > run_up)
    for corner in corners:
        away &= np.linalg.norm(places[1:] - corner, axis=1) > CORNER + run_up
    enough = (0.98 - MISSED) * feed.feed
    return bool(speed.max() > enough and not (speed[away] < enough).any())


def refusal(feed: sm.paths.Feed, corners: np.ndarray, found: float | None) -> str:
    """Return what is wrong with one before planning, with the feed it named; "" for nothing."""
    if path_keeps(feed, corners):
        return "refused, but kept by the path"
    if found is None:
        return "no feed is named"
    if not path_keeps(feed.changed({feed.feed: found}), corners):
        return f"the path does not keep {found:g} m/s, which is named"
    more = feed.changed({feed.feed: NEAR * found})
    return f"{more.feed:g} m/s is kept, too" * more.feeds[0].kept


def possible(feed: sm.paths.Feed, verdict: str) -> sm.paths.Feed | None:
    """Return the feed that a verdict names, None where it names none."""
    if re.search(r"motion ends at|apart at|beyond its limit|off the path", verdict):
        # Also wrong at any feed.
        return None
    slower = re.search(r"Feed\.slower\(([0-9.]+)\)", verdict)
    return feed.slower(float(slower[1])) if slower else None


def planned(robot: sm.RobotModel, feed: sm.paths.Feed, corners: np.ndarray) -> tuple[str, str]:
    """Return how planning a feed ends that was not refused, and what is wrong with that."""
    try:
        plan = sm.plan(sm.Problem(robot, feed, "position"))
    except (sm.errors.PlanError, sm.errors.NoSequenceError):
        return "no motion at any feed", ""
    except sm.errors.FeedError as error:
        return "refused again", str(error)
    verdict = plan.certificate.verdict
    if plan.certificate.verified:
        return "verified", is_kept(plan, feed, corners)
    if re.search(r"is reached up to.*held by|its own speed changes", verdict):
        return "not kept by the path", verdict
    slower = possible(feed, verdict)
    if slower is None:
        return "not verified for another reason", ""
    again = sm.plan(sm.Problem(robot, slower, "position"))
    if not again.certificate.verified:
        return "too fast for the arm, with a feed", again.certificate.verdict
    return "too fast for the arm, with a feed", is_kept(again, slower, corners)


def main() -> int:
    """Print a line for each that is not as it should be, and the counts; return 1 for any."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=28)
    options = parser.parse_args()
    ends, wrong, began = Counter[str](), 0, time.process_time()
    lasted = list[float]()
    for number, (robot, feed, corners) in enumerate(random_paths(options.seed)):
        if number >= options.count:
            break
        trouble, end, before = "", "", time.process_time()
        try:
            check_feeds(robot.name, [feed], ())
            lasted.append(time.process_time() - before)
        except sm.errors.FeedError as error:
            lasted.append(time.process_time() - before)
            trouble = refusal(feed, corners, error.possible)
            end = "refused before planning, the named feed: "
            feed = feed if trouble else feed.changed({feed.feed: error.possible})
        if not trouble:
            how, trouble = planned(robot, feed, corners)
            end += how
        ends[end] += 1
        if trouble:
            wrong += 1
            print(f"  {number}: {robot.name}, {feed.feed:g} m/s: WRONG: {trouble}", flush=True)
    seconds = (time.process_time() - began) / options.count
    for end, count in ends.most_common():
        print(f"{count:6} {end}")
    print(
        f"{options.count} feeds; wrong: {wrong}; {seconds:.2f} s of the processor each, of it "
        f"before planning {1e3 * np.median(lasted):.1f} ms, at most {1e3 * max(lasted):.0f}"
    )
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
