"""Many plans on a Dask cluster: here of two processes on this machine."""

from pathlib import Path

from distributed import Client, LocalCluster

import selfmotion as sm


def problems() -> list[sm.Problem]:
    """Return circles of several sizes."""
    panda = sm.load_robot("panda")
    start = panda.dexterous_configuration()
    radii = (0.05, 0.08, 0.11, 0.14)
    return [
        sm.Problem(panda, sm.paths.Circle.around(panda.pose(start), radius, 4.0), start=start)
        for radius in radii
    ]


if __name__ == "__main__":
    # On a cluster: Client("scheduler:8786")
    settings = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with LocalCluster(host="127.0.0.1", **settings) as cluster, Client(cluster) as client:
        batch = sm.plan_many(problems(), client.get_executor(), out=Path("out") / "dask")
    for row in batch.rows:
        print(f"{row.name}: cost {row.cost:.4f}, {row.verdict or row.error}")
