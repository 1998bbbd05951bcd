"""The study, reduced: its verdicts, the paper's numbers in its tables, and the report's form."""

import dataclasses
import json
import re
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.model.motion import Sampling
from selfmotion.paper.study import Claim, Scale, Study, Verdict, run, write
from selfmotion.paper.study.context import bind, optimum
from selfmotion.paper.study.published import (
    PublishedFunction,
    flops_per_rate,
    published_null_motion,
)
from selfmotion.paper.study.results import Chapter, Table
from selfmotion.problem.costs import Samples
from support.followed import standing

# The whole study, reduced, takes half a minute.
pytestmark = pytest.mark.site

# Costs of the reading notes are given to four or five decimals.
PRINTED = 1e-4
# A Jacobian of many configurations at once, and of one [m, rad].
ROUNDING = 1e-14


VERDICTS = {
    "useful": Verdict.CONFIRMED,
    "mu": Verdict.CONFIRMED,
    "well_away": Verdict.CONFIRMED,
    "velocity_term": Verdict.QUALIFIED,
    "least_squares": Verdict.REFUTED,
    "different_starts": Verdict.CONFIRMED,
    "first_iterations": Verdict.CONFIRMED,
    "gradients": Verdict.REFUTED,
    "singular_poses": Verdict.REFUTED,
    "surging_cause": Verdict.REFUTED,
    "flops": Verdict.CONFIRMED,
    "growth": Verdict.CONFIRMED,
    "lagrange_cheaper": Verdict.QUALIFIED,
    "global_optimum": Verdict.QUALIFIED,
    "delta": Verdict.QUALIFIED,
    "crude_quadrature": Verdict.CONFIRMED,
    "one_boundary": Verdict.CONFIRMED,
    "minima": Verdict.QUALIFIED,
    "two_optima": Verdict.CONFIRMED,
    "better_than_local": Verdict.CONFIRMED,
}


@pytest.fixture(scope="module")
def study() -> Study:
    return run(Scale.reduced())


@pytest.fixture(scope="module")
def report(study: Study, tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("matplotlib")
    return write(study, tmp_path_factory.mktemp("study"))[0]


def chapter(study: Study, key: str) -> Chapter:
    return next(part for part in study.chapters if part.key == key)


def column(table: Table, name: str) -> dict[str, float]:
    index = table.columns.index(name)
    return {str(row[0]): float(row[index]) for row in table.rows if row[index] != "—"}


def test_verdicts(study: Study) -> None:
    assert {claim.key: claim.verdict for claim in study.claims} == VERDICTS


def test_every_claim_is_decided_by_a_number(study: Study) -> None:
    for claim in study.claims:
        assert re.search(r"\d", claim.number), claim.key
        assert claim.statement.endswith(".")
        assert "nan" not in claim.number + claim.reason, claim.key


def test_the_reading_notes_numbers(study: Study) -> None:
    rows = chapter(study, "sample").tables[0]
    assert column(rows, "F at x = 0")["eq. 12, μ = 1, T = 1"] == pytest.approx(
        15.500547, abs=PRINTED
    )
    assert column(rows, "F")["eq. 12, μ = 1, T = 1"] == pytest.approx(10.48497, abs=PRINTED)
    optima = column(chapter(study, "questions").tables[0], "F")
    assert optima["null space, degree 3"] == pytest.approx(10.5137, abs=PRINTED)
    assert optima["null space, degree 7"] == pytest.approx(10.4931, abs=PRINTED)
    assert optima["32-term expansion"] == pytest.approx(10.48496, abs=PRINTED)
    assert optima["Lagrangian optimum"] == pytest.approx(optima["32-term expansion"], rel=1e-6)


def test_the_published_scheme_lands_within_half_a_percent(study: Study) -> None:
    rows = chapter(study, "sample").tables[0]
    assert column(rows, "F")["as published, μ = 1"] < 10.48497 * 1.005
    assert column(rows, "evaluations of F")["as published, μ = 1"] > 100


def test_the_report_stands_alone(report: Path) -> None:
    text = report.read_text(encoding="utf-8")
    assert report.stat().st_size < 5_000_000
    for pattern in (r"<script", r"<link", r"<img", r'src="', r"@import", r"url\(http"):
        assert not re.search(pattern, text), pattern
    assert "prefers-color-scheme: dark" in text
    assert 'name="viewport"' in text
    anchors = set(re.findall(r' id="([\w-]+)"', text))
    for target in re.findall(r'<a href="#(\w+)"', text):
        assert target in anchors


def test_numbers_and_pictures_lie_beside_the_page(report: Path, study: Study) -> None:
    numbers = json.loads((report.parent / "study.json").read_text(encoding="utf-8"))
    assert [part["key"] for part in numbers["chapters"]] == [s.key for s in study.chapters]
    for plot in study.plots:
        assert (report.parent / f"{plot.name}.png").read_bytes().startswith(b"\x89PNG")


def test_verdicts_follow_the_numbers() -> None:
    """A page shows what it is given: a claim turned round is shown turned round."""
    claim = Claim("k", "It is so.", Verdict.REFUTED, "0 of 1", "Not so.")
    turned = dataclasses.replace(claim, verdict=Verdict.CONFIRMED)
    pages = []
    for shown in (claim, turned):
        parts = (Chapter("s", "S", claims=(shown,)),)
        from selfmotion.paper.study.page import html

        pages.append(html(Study(parts, 0.0, "test")))
    assert 'class="refuted"' in pages[0]
    assert 'class="refuted"' not in pages[1]


@pytest.fixture(scope="module")
def joint_space() -> sm.Problem:
    return sm.sample_problem(null_motion=published_null_motion())


def test_the_published_function_converges_to_ours(joint_space: sm.Problem) -> None:
    """Same costs, same null motion; integration and quadrature differ, and with the tolerance go.

    The trapezoidal rule over RK23's own steps: its error falls with the step, tolerance^(1/3)
    squared.
    """
    x = np.random.default_rng(0).normal(size=12)
    truth = bind(joint_space, 256).value(x)
    errors = [
        abs(PublishedFunction(joint_space, rtol=rtol).value(x) / truth - 1.0)
        for rtol in (1e-3, 1e-5, 1e-7)
    ]
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 1e-4


def test_equations_13_and_14_count_and_agree(joint_space: sm.Problem) -> None:
    x = np.random.default_rng(1).normal(size=12)
    direction = np.random.default_rng(2).normal(size=12)
    function = PublishedFunction(joint_space, rtol=1e-8, delta=1e-5)
    gradient = function.gradient(x)
    assert function.evaluations == 13
    slope = function.slope(x, direction)
    assert function.evaluations == 15
    exact = bind(joint_space, 256).gradient(x)
    # Forward differences of an integral that jumps with the adaptive steps.
    np.testing.assert_allclose(gradient, exact, atol=0.02 * np.abs(exact).max())
    assert slope == pytest.approx(float(exact @ direction), rel=0.05)


def test_solver_points_integrate_straight_lines(planar: sm.RobotModel) -> None:
    points = Sampling.trapezoidal(np.array([0.0, 0.1, 0.5, 1.0]))
    assert points.weights @ (3.0 * points.t + 1.0) == pytest.approx(2.5)
    assert points.weights @ points.t**2 > 1.0 / 3.0
    q = np.random.default_rng(0).normal(size=(4, 3))
    samples = Samples.along(standing(planar, sm.Task.PLANAR), points, q, np.zeros_like(q))
    for k in range(4):
        expected = planar.task_jacobian(q[k], sm.Task.PLANAR)
        np.testing.assert_allclose(samples.task_jacobian[k], expected, rtol=0, atol=ROUNDING)


def test_samples_along_are_those_of_the_rollout(panda: sm.RobotModel) -> None:
    start = panda.dexterous_configuration("pointing")
    path = sm.paths.Circle.around(panda.pose(start), 0.1, 2.0)
    objective = bind(sm.Problem(panda, path, "pointing", start), 8)
    ours = objective.samples(np.zeros(objective.size))
    again = Samples.along(standing(panda, sm.Task.POINTING), ours.sampling, ours.q, ours.qd)
    # Two orders of the same rotations' products.
    np.testing.assert_allclose(again.task_jacobian, ours.task_jacobian, atol=1e-12)


def test_operations_are_counted_as_stated() -> None:
    n, m, p = 3, 2, 3
    by_hand = 27 + 24 + 16 + 24 + 12 + 36 + 9 + 18 + 24 + 3 + 24
    assert flops_per_rate(n, m, p) == by_hand
    # Between n and n², and towards n² for long chains.
    assert flops_per_rate(1000, 2, 3) / flops_per_rate(500, 2, 3) == pytest.approx(4.0, rel=0.02)


def test_optimum_stops_where_coefficients_run_away(joint_space: sm.Problem) -> None:
    wild = dataclasses.replace(joint_space, costs=(sm.costs.Manipulability(),))
    _, found = optimum(wild, max_iterations=400, unbounded=100.0)
    assert found.status is sm.optimise.Status.UNBOUNDED
    assert "JointVelocity" in found.status.message


def test_missing_matplotlib_is_said_before_any_work(monkeypatch: pytest.MonkeyPatch) -> None:
    from selfmotion.paper import study
    from support.shell import complaint

    def work(*_: object) -> Study:
        raise AssertionError("it began")

    monkeypatch.setattr(study, "run", work)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert complaint("study") == "error: figures need matplotlib: pip install 'selfmotion[plots]'"


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What the command does around a run: scale, progress, files, the claims as a table."""
    from typer.testing import CliRunner

    from selfmotion.paper import study
    from selfmotion.shell import cli

    asked = []

    def short(scale: Scale, progress: Callable[[str], None]) -> Study:
        asked.append(scale.name)
        for part in study.PARTS:
            progress(part)
        claim = Claim("k", "It is so.", Verdict.REFUTED, "0 of 1", "Not so.")
        return Study((Chapter("s", "S", claims=(claim,)),), 0.0, scale.name)

    monkeypatch.setattr(study, "run", short)
    result = CliRunner().invoke(cli.app, ["study", "--out", str(tmp_path / "a")])
    assert result.exit_code == 0, result.output
    assert (
        CliRunner().invoke(cli.app, ["study", "--reduced", "--out", str(tmp_path)]).exit_code == 0
    )
    assert asked == ["full", "reduced"]
    assert (tmp_path / "a" / "study.html").is_file()
