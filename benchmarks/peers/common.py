"""What the peers' programs share: path, start and arm, and a clock. Needs NumPy only."""

from __future__ import annotations

import csv
import json
import re
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

DATA = Path(__file__).parent.parent / "data"


def waypoints(name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times (W,), positions (W, 3) and quaternions (W, 4) [w, x, y, z] of a path."""
    with (DATA / name / "path.csv").open() as stream:
        table = np.array([[float(x) for x in row] for row in list(csv.reader(stream))[1:]])
    return table[:, 0], table[:, 1:4], table[:, 4:8]


def rotation(quaternion: np.ndarray) -> np.ndarray:
    """Return the rotation matrix of a quaternion [w, x, y, z]."""
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def report(name: str, settings: str, solve: Callable[[], np.ndarray], repeats: int = 3) -> None:
    """Time `solve` (best of `repeats`), and print its motion (K, 7) as one JSON line.

    It is judged by `run_peers.py`, as that of all tools. A motion that stops early has fewer rows
    than the path has waypoints.
    """
    seconds = []
    for _ in range(repeats):
        began = time.perf_counter()
        q = solve()
        seconds.append(time.perf_counter() - began)
    result = {"name": name, "settings": settings, "seconds": min(seconds), "q": q.tolist()}
    sys.stdout.write(json.dumps(result) + "\n")


def start() -> np.ndarray:
    """Return the start configuration that `run_peers.py` wrote (7,)."""
    return np.array(json.loads(Path(sys.argv[1]).read_text())["start"])


def panda_urdf() -> str:
    """Return the text of the Panda's URDF without geometry: kinematics are all that is needed."""
    text = Path(json.loads(Path(sys.argv[1]).read_text())["urdf"]).read_text()
    for tag in ("visual", "collision"):
        text = re.sub(rf"<{tag}\b.*?</{tag}>", "", text, flags=re.DOTALL)
    return text
