"""Folders of 50 jobs and 50 batches, each spoilt in one way and begun again.

`make bench NAME=fuzz-kept`.

Whatever was done to a folder, what comes of it is what comes of an empty one: never a wrong
'verified', never stuck. Ways: files swapped, truncated, touched, of another job; a mesh edited; a
motion bent, with a certificate that says otherwise; a tolerance loosened; another version.
"""

import argparse
import json
import shutil
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np
import trimesh

import selfmotion as sm
from selfmotion.model.task import SE3

DOWN = np.diag([1.0, -1.0, -1.0])
HOME = np.array(sm.NAMED_ARMS["panda"].home)
# Where the mesh stands, out of the way and in it [m].
AWAY, INSIDE = np.array([0.0, 0.9, 0.3]), np.array([0.45, 0.0, 0.3])
ALONG = np.array([0.0, 1.0, 0.0])
PANDA = sm.load_robot("panda")


def write_mesh(file: Path, at: np.ndarray) -> None:
    """Write a box as a mesh at a place."""
    box = trimesh.creation.box((0.06, 0.06, 0.06))
    box.apply_translation(at)
    box.export(file)


def bent(plan: sm.Plan, tolerance: sm.Tolerance | None = None) -> sm.Plan:
    """Return a plan with a smooth bump of one joint, and a certificate that says otherwise."""
    motion = plan.trajectory
    t, middle = motion.t, motion.t[-1]
    x, w = np.pi * t / middle, np.pi / middle
    q, qd, qdd = (np.array(motion(t, order)) for order in range(3))
    q[:, 1] += 0.05 * np.sin(x) ** 6
    qd[:, 1] += 0.3 * w * np.sin(x) ** 5 * np.cos(x)
    qdd[:, 1] += 0.05 * w**2 * (30 * np.sin(x) ** 4 * np.cos(x) ** 2 - 6 * np.sin(x) ** 6)
    other = sm.Trajectory(t, q, qd, motion.joint_names, qdd)
    said = replace(plan.certificate, motion=other.digest)
    if tolerance is not None:
        said = replace(said, tolerance=tolerance)
    return replace(plan, trajectory=other, certificate=said)


def archives(folder: Path, kind: str = "") -> list[Path]:
    """Return the plans and moves of a folder."""
    return sorted(file for file in folder.rglob(f"{kind}*.npz"))


def swap(folder: Path, rng: np.random.Generator) -> None:
    """Exchange two files."""
    files = archives(folder)
    one, other = (files[k] for k in rng.choice(len(files), 2, replace=False))
    data = one.read_bytes()
    one.write_bytes(other.read_bytes())
    other.write_bytes(data)


def truncate(folder: Path, rng: np.random.Generator) -> None:
    """Cut a file short."""
    files = [file for file in folder.rglob("*") if file.suffix in (".npz", ".json")]
    file = files[int(rng.integers(len(files)))]
    file.write_bytes(file.read_bytes()[: int(rng.integers(file.stat().st_size))])


def touch(folder: Path, rng: np.random.Generator) -> None:
    """Change a number by its last digits."""
    files = archives(folder)
    file = files[int(rng.integers(len(files)))]
    arrays = dict(np.load(file))
    np.savez(file, **{**arrays, "q": arrays["q"] * (1.0 + 1e-13)})


def bend(folder: Path, rng: np.random.Generator) -> None:
    """Put another motion into a plan."""
    for file in [*archives(folder, "seam"), *archives(folder / "plans")]:
        bent(sm.load_plan(file)).save(file)


def loosen(folder: Path, rng: np.random.Generator) -> None:
    """Put another motion into a plan, and say that it may be anywhere."""
    for file in [*archives(folder, "seam"), *archives(folder / "plans")]:
        bent(sm.load_plan(file), sm.Tolerance(1.0, 1.0)).save(file)


def rename(folder: Path, rng: np.random.Generator) -> None:
    """Put what is said of one piece of work under the name of another."""
    files = sorted(folder.rglob("*.json"))
    one, other = (files[k] for k in rng.choice(len(files), 2, replace=False))
    shutil.copy(one, other)


def lie(folder: Path, rng: np.random.Generator) -> None:
    """Say of all work that it is verified, or was given up."""
    for file in folder.rglob("*.json"):
        said = json.loads(file.read_text())
        said |= {"verified": True, "verdict": "verified", "cost": 0.0} if "verdict" in said else {}
        file.write_text(json.dumps(said))
    bend(folder, rng)


WAYS: dict[str, Callable[[Path, np.random.Generator], None]] = {
    "swapped": swap,
    "truncated": truncate,
    "touched": touch,
    "bent": bend,
    "loosened": loosen,
    "renamed": rename,
    "lied": lie,
}


def job(folder: Path, mesh: Path, shift: float) -> tuple[str, str]:
    """Return the verdict of a job that is begun in a folder, and its motion's digest."""
    seams = [
        sm.Seam(
            name,
            sm.paths.Line(
                SE3(DOWN, np.array([0.4, y, 0.3])), SE3(DOWN, np.array([0.5, y, 0.3])), 1.0
            ),
            "pointing",
            either_way=False,
        )
        for name, y in (("a", shift), ("b", shift - 0.15))
    ]
    apart = sm.constraints.Clearance([sm.obstacles.Mesh("part", np.zeros(3), str(mesh))], 0.005)
    try:
        made = sm.plan_job(PANDA, seams, start=HOME, clearance=apart, branches=1, folder=folder)
    except sm.SelfmotionError as error:
        return f"refused: {error}", ""
    motion = "" if any(step.is_missing for step in made.steps) else made.trajectory.digest
    return made.verdict, motion


def batch(folder: Path, mesh: Path, shift: float) -> tuple[str, str]:
    """Return the verdicts of a batch that is begun in a folder, and its motions' digests."""
    apart = sm.constraints.Clearance([sm.obstacles.Mesh("part", np.zeros(3), str(mesh))], 0.005)
    problems = [
        sm.Problem(
            PANDA,
            sm.paths.Line(
                SE3(DOWN, np.array([0.4, y, 0.3])), SE3(DOWN, np.array([0.5, y, 0.3])), 1.0
            ),
            "pointing",
            start=PANDA.inverse_kinematics(SE3(DOWN, np.array([0.4, y, 0.3])), "pointing", HOME),
            constraints=(),
            clearance=apart,
        )
        for y in (shift, shift - 0.15)
    ]
    found = sm.work.batch.plan_many(problems, out=folder, workers=1)
    plans = "".join("" if row.error else row.plan().trajectory.digest for row in found.rows)
    return "; ".join(row.verdict or row.error for row in found.rows), plans


def main() -> None:
    """Spoil folders, and begin again."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--each", type=int, default=50, help="folders of each kind")
    options = parser.parse_args()
    wrong = 0
    for kind, run in (("job", job), ("batch", batch)):
        for number in range(options.each):
            rng = np.random.default_rng(number)
            shift = float(rng.uniform(-0.02, 0.02))
            ways = [*WAYS, "mesh", "version"]
            way = ways[number % len(ways)]
            with tempfile.TemporaryDirectory() as name:
                mesh, kept, fresh = (Path(name, each) for each in ("part.stl", "kept", "fresh"))
                write_mesh(mesh, AWAY)
                run(kept, mesh, shift)
                if way == "mesh":
                    write_mesh(mesh, INSIDE + shift * ALONG)
                elif way != "version":
                    WAYS[way](kept, rng)
                said = "another" if way == "version" else sm.basics.version()
                with mock.patch(
                    "selfmotion.planning.result.archive.version", lambda said=said: said
                ):
                    again = run(kept, mesh, shift)
                    once_more = run(kept, mesh, shift)
                expected = run(fresh, mesh, shift)
                same = again == expected == once_more
                wrong += not same
                print(f"{kind} {number:2d} {way:10s} {'same' if same else 'OTHER'} {again[0][:90]}")
    print(f"{2 * options.each} folders: {wrong} other than from an empty one")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
