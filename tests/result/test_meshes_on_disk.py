"""Meshes belong to a plan as evidence: one that was replaced is told, one that is gone is named."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

import selfmotion as sm
from support.arms import robot_named


def test_a_mesh_that_was_replaced_is_told(tmp_path: Path) -> None:
    panda = robot_named("panda")
    start = panda.dexterous_configuration()
    file = tmp_path / "post.stl"
    trimesh.creation.box((0.1, 0.1, 0.1)).export(file)
    post = sm.obstacles.Mesh("post", [1.0, 1.0, 1.0], file)
    circle = sm.paths.Circle.around(panda.pose(start), radius=0.05, duration=4.0)
    problem = sm.Problem(
        panda,
        circle,
        task="position",
        start=start,
        constraints=[],
        clearance=sm.constraints.Clearance([post]),
    )
    plan = sm.plan(problem, max_evaluations=3)
    plan.save(tmp_path / "plan.npz")
    assert sm.load_plan(tmp_path / "plan.npz").certificate.notes == plan.certificate.notes
    trimesh.creation.box((0.2, 0.1, 0.1)).export(file)
    # A certificate is none of the same names with other bodies.
    again = sm.Problem(
        panda,
        circle,
        task="position",
        start=start,
        constraints=[],
        clearance=sm.constraints.Clearance([post]),
    )
    assert problem.digest == plan.certificate.problem != again.digest
    loaded = sm.load_plan(tmp_path / "plan.npz")
    assert f"{file} has changed since the plan was made" in loaded.certificate.notes
    assert "has changed" in loaded.certificate.verdict
    assert not loaded.altered
    file.unlink()
    with pytest.raises(sm.errors.FileFormatError, match=r"cannot be checked again: .*no such file"):
        sm.load_plan(tmp_path / "plan.npz")


@pytest.mark.parametrize("suffix", ["csv", "json", "npz", "yaml"])
def test_degrees_are_degrees_in_all_formats(suffix: str, tmp_path: Path) -> None:
    plan = sm.plan(sm.sample_problem())
    file = tmp_path / f"motion.{suffix}"
    sm.files.write_motion(plan, file)
    plain, degrees = sm.files.read_motion(file), sm.files.read_motion(file, degrees=True)
    for name in ("q", "qd", "qdd"):
        np.testing.assert_allclose(getattr(degrees, name), np.radians(getattr(plain, name)))


@pytest.mark.parametrize("rate", [1e9, "x", np.nan, np.inf, -1.0, 0.0, None])
def test_rates_that_make_no_samples_are_refused(rate: object, tmp_path: Path) -> None:
    plan = sm.plan(sm.sample_problem())
    if rate is None:
        sm.files.write_motion(plan, tmp_path / "motion.csv", rate=rate)
        return
    with pytest.raises(sm.errors.ProblemError, match=r"rate is .* Hz, expected a number above"):
        sm.files.write_motion(plan, tmp_path / "motion.csv", rate=rate)  # type: ignore[arg-type]
