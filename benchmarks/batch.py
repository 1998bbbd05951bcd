"""How much faster two processes plan than one, and what a batch costs besides planning.

Before that: whether one process, two, and a Dask cluster of two workers, one of which is killed in
between, give the same motions to the last bit, each of them once.
"""

import argparse
import multiprocessing
import os
import resource
import signal
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor

import numpy as np

import selfmotion as sm


def problems(count):
    """Return Pandas on circles of many durations."""
    panda = sm.load_robot("panda")
    start = panda.dexterous_configuration()
    pose = panda.pose(start)
    return [
        sm.Problem(panda, sm.paths.Circle.around(pose, 0.1, 4.0 + k / count), start=start)
        for k in range(count)
    ]


def identical(count):
    """Return how many motions of two processes and of a cluster differ from those of one."""
    import distributed

    given, killed = problems(count), []
    with tempfile.TemporaryDirectory() as out:
        one = sm.plan_many(given, out=f"{out}/one", workers=1)
        two = sm.plan_many(given, out=f"{out}/two", workers=2)
        cluster = distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None,
            silence_logs=50, local_directory=f"{out}/dask",
        )  # fmt: skip
        with cluster, distributed.Client(cluster) as client:
            pids = list(client.run(os.getpid).values())

            def kill_one(found):
                if found.done >= count // 2 and not killed:
                    killed.append(pids[0])
                    os.kill(pids[0], signal.SIGKILL)

            dask = sm.plan_many(given, client.get_executor(), out=f"{out}/dask", progress=kill_one)
        assert killed
        motions = [[row.plan().trajectory for row in batch.rows] for batch in (one, two, dask)]
    assert all(len(each) == count for each in motions)
    return [
        sum(not np.array_equal(a.q, b.q) for a, b in zip(motions[0], other, strict=True))
        for other in motions[1:]
    ]


def used():
    """Return the processor time of processes that have ended [s]."""
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    return ended.ru_utime + ended.ru_stime


def timed(count, workers):
    """Plan so many problems.

    Returns plans per second once all processes plan; per plan, what is neither planning nor saving,
    the processor time where the batch was started and that of the processes; time to the first [s].
    """
    given = problems(count)
    ends, began, worked, before = [], time.perf_counter(), time.process_time(), used()
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
    return (count - first) / span, overhead, own, (used() - before) / count, ends[0] - began


def looped(count):
    """Return plans per second of a process that plans and does nothing else."""
    given = problems(count)
    for problem in given[:4]:
        sm.plan(problem)
    began = time.perf_counter()
    for problem in given:
        sm.plan(problem)
    return count / (time.perf_counter() - began)


def possible(count):
    """Return how many times the plans two processes make that share nothing but the machine."""
    rates = []
    for workers in (1, 2):
        with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as pool:
            rates.append(sum(pool.map(looped, [count // workers] * workers)))
    return rates[1] / rates[0]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=150)
    parser.add_argument("--same", type=int, default=200, help="plans compared, 0 for none")
    given = parser.parse_args()
    count = given.count
    if given.same:
        two, cluster = identical(given.same)
        print(
            f"of {given.same} motions {two} differ between one and two processes, {cluster} "
            f"between one and a cluster of two, one of which was killed"
        )
    timed(8, 1)  # compiles, where nothing has
    one, overhead, own, alone, begin = timed(count, 1)
    two, _, _, together, _ = timed(count, 2)
    print(f"one process: {one:.1f} plans per second, first plan after {begin:.1f} s")
    print(
        f"besides planning and saving: {1e3 * overhead:.1f} ms per plan, "
        f"{1e3 * own:.1f} ms of processor time where the batch was started"
    )
    print(f"two processes: {two:.1f} plans per second, {two / one:.2f} × as many")
    print(f"two processes that share nothing but this machine: {possible(count):.2f} × as many")
    print(
        f"processor time per plan, start of processes included: {1e3 * alone:.1f} ms with one, "
        f"{1e3 * together:.1f} ms with two"
    )


if __name__ == "__main__":
    main()
