"""A frame of 132 strokes, extruded by a Panda with a nozzle of 80 mm: `make bench NAME=job`.

Each stroke once, from either end, begun where it is grounded or at what was made before; what was
made stands there, but within 5 mm of a node that the stroke shares. The tool's axis stays within
45° of down, turning about it is free; 10 mm/s along a stroke. With `--given` in the order of the
layers and of the list, and from the first end of each to the second.
"""

import argparse
import csv
import json
import time
from pathlib import Path

import numpy as np

import selfmotion as sm
from selfmotion.model.task import SE3

FOLDER = Path(__file__).parent / "data" / "frame__topopt100"
# Of the nozzle and what heats it [m].
NOZZLE, TIP, HEATER = 0.08, 0.002, 0.008
# What a stroke shares with its neighbours [m], its speed [m/s], and how near others may come [m].
SHARED, FEED, APART = 0.005, 0.01, 2e-4
# So many layers down all is made before a stroke is.
DOWN = 2
# The frame stands so much nearer than in the file, where the arm reaches all of it [m].
NEARER = 0.1


def arm() -> sm.RobotModel:
    """Return a Panda that holds a nozzle in its hand, pointing on along the hand's axis."""
    bodies = [
        sm.obstacles.Capsule("nozzle", [0.0, 0.0, -0.021], TIP, 0.032),
        sm.obstacles.Cylinder("heater", [0.0, 0.0, -0.06], HEATER, 0.04),
    ]
    offset = SE3(np.eye(3), np.array([0.0, 0.0, NOZZLE]))
    return sm.load_robot("panda", "panda_hand_tcp", tool_offset=offset, bodies=bodies)


def rod(name: str, first: np.ndarray, last: np.ndarray, radius: float) -> sm.obstacles.Capsule:
    """Return a stroke, or a piece of it, that stands there."""
    along = last - first
    length = float(np.linalg.norm(along))
    z = along / length
    x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    x /= np.linalg.norm(x)
    place = SE3(np.stack([x, np.cross(z, x), z], axis=1), 0.5 * (first + last))
    return sm.obstacles.Capsule(name, place, radius, length)


def seams(count: int | None = None, either_way: bool = True) -> list[sm.Seam]:
    """Return the strokes as seams, the first `count` of them that stand on each other."""
    job = json.loads((FOLDER / "job.json").read_text())
    grounded, radius = set(job["grounded_nodes"]), job["strut_radius_m"]
    with (FOLDER / "strokes.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    rows = sorted(rows, key=lambda row: int(row["layer"]))[:count]
    ends = {
        row["stroke"]: np.array([[float(row[f"{axis}{k}"]) for axis in "xyz"] for k in "01"])
        - [NEARER, 0.0, 0.0]
        for row in rows
    }
    nodes = {row["stroke"]: (int(row["node0"]), int(row["node1"])) for row in rows}
    layers = {row["stroke"]: row["layer"] for row in rows}
    at: dict[int, list[str]] = {}
    for stroke, pair in nodes.items():
        for node in pair:
            at.setdefault(node, []).append(stroke)
    down = np.diag([1.0, -1.0, -1.0])
    found = []
    for stroke, (first, last) in ends.items():
        length = float(np.linalg.norm(last - first))
        cut = min(SHARED, 0.5 * length) * (last - first) / length
        pair = nodes[stroke]
        leaves = [
            rod(f"{stroke} at {pair[0]}", first, first + 0.999 * cut, radius),
            rod(f"{stroke} at {pair[1]}", last - 0.999 * cut, last, radius),
        ]
        if length > 2.0 * SHARED + 1e-3:
            leaves.append(rod(f"{stroke}", first + cut, last - cut, radius))
        # From below: what is two layers down is made before, so that nothing is built over.
        layer = int(layers[stroke])
        below = [other for other in ends if int(layers[other]) <= layer - DOWN]
        others = {other for node in pair for other in at[node]} - {stroke}
        is_grounded = not grounded.isdisjoint(pair)
        line = sm.paths.Line(SE3(down, first), SE3(down, last), 1.0)
        found.append(
            sm.Seam(
                stroke,
                sm.paths.Feed(line, FEED),
                "position",
                constraints=[sm.constraints.Tilt("panda_hand_tcp", within=np.pi / 4)],
                either_way=either_way,
                after=below,
                after_any=() if is_grounded else tuple(sorted(others, key=int)),
                leaves=leaves,
                may_meet=tuple(f"{other} at {node}" for node in pair for other in at[node]),
            )
        )
    return found


def main() -> None:
    """Plan the frame, and say how it went."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--strokes", type=int, help="the first ones only")
    parser.add_argument("--given", action="store_true", help="order and directions as given")
    parser.add_argument("--folder", help="keeps what is finished")
    parser.add_argument("--out", default="out/frame.program")
    options = parser.parse_args()
    robot, began = arm(), time.perf_counter()
    told = [""]

    def progress(stage: str, done: int, total: int) -> None:
        if stage in ("seam", "program") and told[0] != f"{stage} {done}":
            told[0] = f"{stage} {done}"
            if done % 10 == 1:
                print(
                    f"{time.perf_counter() - began:6.0f} s: {stage} {done} of {total}", flush=True
                )

    program = sm.plan_job(
        robot,
        seams(options.strokes, not options.given),
        clearance=sm.constraints.Clearance(distance=APART),
        order="given" if options.given else "free",
        branches=2,
        move_seconds=2.0,
        folder=options.folder,
        progress=progress,
    )
    seconds = time.perf_counter() - began
    print(program)
    for note in program.notes:
        print(f"  {note}")
    print(
        f"{len(program.order)} strokes made, {len(program.missing)} named, in {seconds:.0f} s; "
        f"transfers {program.transfer_time:.2f} s, bound {program.bound:.2f} s"
    )
    program.save(options.out)


if __name__ == "__main__":
    main()
