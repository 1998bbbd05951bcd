"""What the peers' programs share: the path, and how a motion is measured. Needs NumPy only."""

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


def report(
    name: str,
    settings: str,
    solve: Callable[[], np.ndarray],
    pose: Callable[[np.ndarray], np.ndarray],
    path: str,
    repeats: int = 3,
) -> None:
    """Time `solve` (best of `repeats`), measure its motion, and print one JSON line.

    The cost is Σ ½ |Δq|²/Δt over the waypoints [rad²/s]; errors are those at the waypoints.
    """
    t, positions, quaternions = waypoints(path)
    seconds = []
    for _ in range(repeats):
        began = time.perf_counter()
        q = solve()
        seconds.append(time.perf_counter() - began)
    poses = np.array([pose(x) for x in q])
    misses = np.linalg.norm(poses[:, :3, 3] - positions, axis=1)
    angles = [
        np.arccos(np.clip((np.trace(rotation(u) @ p[:3, :3].T) - 1) / 2, -1, 1))
        for u, p in zip(quaternions, poses, strict=True)
    ]
    steps = np.diff(q, axis=0)
    result = {
        "name": name,
        "settings": settings,
        "path": path,
        "seconds": min(seconds),
        "cost": float(np.sum(0.5 * np.sum(steps**2, axis=1) / np.diff(t))),
        "position_error": float(misses.max()),
        "rotation_error": float(np.max(angles)),
    }
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
