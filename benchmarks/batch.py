"""How much faster two processes plan than one, and what a batch costs besides planning."""

import argparse
import tempfile
import time

import selfmotion as sm


def problems(count):
    """Return Pandas on circles of many durations."""
    panda = sm.load_robot("panda")
    start = panda.dexterous_configuration()
    pose = panda.pose(start)
    return [
        sm.Problem(panda, sm.Circle.around(pose, 0.1, 4.0 + k / count), start=start)
        for k in range(count)
    ]


def timed(count, workers):
    """Return problems per second once all processes plan, overheads per plan and time to begin."""
    given = problems(count)
    ends, began, worked = [], time.perf_counter(), time.process_time()
    with tempfile.TemporaryDirectory() as out:
        batch = sm.plan_many(
            given,
            out=out,
            workers=workers,
            progress=lambda found: ends.append(time.perf_counter()),
        )
    own = (time.process_time() - worked) / count
    assert all(row.verified for row in batch.rows)
    # The first plans of a process load what is compiled; from then on it is at speed.
    first = 4 * workers
    span = ends[-1] - ends[first - 1]
    # Rows of problems in the order they were given, which is that of one worker.
    busy = sum(row.seconds for row in batch.rows[first:])
    overhead = (workers * span - busy) / (count - first)
    return (count - first) / span, overhead, own, ends[0] - began


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=150)
    count = parser.parse_args().count
    timed(8, 1)  # compiles, where nothing has
    one, overhead, own, begin = timed(count, 1)
    two, *_ = timed(count, 2)
    print(f"one process: {one:.1f} plans per second, first plan after {begin:.1f} s")
    print(
        f"besides planning and saving: {1e3 * overhead:.1f} ms per plan, "
        f"{1e3 * own:.1f} ms of processor time where the batch was started"
    )
    print(f"two processes: {two:.1f} plans per second, {two / one:.2f} × as many")


if __name__ == "__main__":
    main()
