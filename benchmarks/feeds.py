"""200 random feeds: kept wherever a plan is verified, and possible ones named where it is not.

Random lines, circles, splines and polylines of several arms, at feeds from 5 mm/s to 1 m/s. Of each
verified plan the tool's speed is measured by Pinocchio's kinematics and differences: it is never
faster than the feed by what may be missing of it, and slower only around both ends and rounded
corners. Of each refused one the feed that the verdict names is planned: that has to be verified.
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

ARMS = ("panda", "xarm7", "ur10", "kinova")
# Times between which the tool's speed is measured [s], and what differences of positions miss.
STEP, MISSED = 1e-4, 2e-3
# How far from its corner a rounded one begins and ends [m].
CORNER = 0.03


def random_paths(seed: int) -> Iterator[tuple[sm.RobotModel, sm.Feed, np.ndarray]]:
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
            lambda a=pose, b=last: sm.Line(a, b, 1.0),
            lambda a=pose, s=size: sm.Circle.around(a, s, 1.0, turns=0.8),
            lambda p=points: sm.Waypoints(np.arange(5.0), p),
            lambda p=points: sm.Polyline(p, tolerance=0.01),
        )
        feed = np.exp(rng.uniform(np.log(5e-3), 0.0))
        most = np.exp(rng.uniform(np.log(0.5), np.log(20.0)))
        path = shapes[rng.integers(len(shapes))]()
        corners = points[1:-1] if isinstance(path, sm.Polyline) else np.zeros((0, 3))
        bounds = {"acceleration": float(f"{most:.2g}")}
        try:
            yield robot, sm.Feed(path, float(f"{feed:.2g}"), **bounds), corners
        except sm.PathError as error:
            print(f"  no path: {error}")


def is_kept(plan: sm.Plan, feed: sm.Feed, corners: np.ndarray) -> str:
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


def possible(feed: sm.Feed, verdict: str) -> sm.Feed | None:
    """Return the feed that a verdict names, None where it names none."""
    if re.search(r"motion ends at|apart at|beyond its limit|off the path", verdict):
        # Also wrong at any feed.
        return None
    less = re.search(r"ask for ([0-9.e-]+) m/s", verdict)
    if less:
        values = {**feed.to_dict(), "feed": float(less[1])}
        feed = sm.Feed.from_dict({key: v for key, v in values.items() if key != "kind"})
    slower = re.search(r"Feed\.slower\(([0-9.]+)\)", verdict)
    if slower:
        return feed.slower(float(slower[1]))
    return feed if less else None


def main() -> int:
    """Print a line for each that is not as it should be, and the counts; return 1 for any."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=28)
    options = parser.parse_args()
    ends, wrong, began = Counter[str](), 0, time.process_time()
    for number, (robot, feed, corners) in enumerate(random_paths(options.seed)):
        if ends.total() >= options.count:
            break
        problem = sm.Problem(robot, feed, "position")
        try:
            plan = sm.plan(problem)
        except (sm.PlanError, sm.NoSequenceError) as error:
            ends["no motion at any feed"] += 1
            print(f"  {number}: {str(error)[:100]}")
            continue
        check = plan.certificate
        if check.verified:
            ends["verified"] += 1
            trouble = is_kept(plan, feed, corners)
        else:
            slower = possible(feed, check.verdict)
            if slower is None:
                ends["refused for another reason"] += 1
                print(f"  {number}: {check.verdict[:150]}")
                continue
            ends["refused, with a feed"] += 1
            again = sm.plan(sm.Problem(robot, slower, "position"))
            trouble = "" if again.certificate.verified else again.certificate.verdict
            trouble = trouble or is_kept(again, slower, corners)
        if trouble:
            wrong += 1
            print(f"  {number}: {robot.name}, {feed.feed:g} m/s: WRONG: {trouble}", flush=True)
    seconds = (time.process_time() - began) / max(ends.total(), 1)
    told = ", ".join(f"{count} {end}" for end, count in ends.most_common())
    print(f"{ends.total()} feeds: {told}; wrong: {wrong}; {seconds:.2f} s of the processor each")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
