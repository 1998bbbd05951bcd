"""Laws of all commands: what bad input is, in words and as JSON, and with which exit code."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from typer.main import get_command

import selfmotion as sm
from selfmotion.basics import write_document
from selfmotion.shell.cli import app
from support.shell import in_full, invoke

# Bad input of each command: a file that is not there, or what is no robot.
BAD = {
    "plan": ("no.toml",),
    "job": ("no.toml",),
    "batch": ("no.toml",),
    "check": ("no.npz",),
    "compare": ("no.npz",),
    "replay": ("no.npz",),
    "retime": ("no.npz",),
    "calibrate": ("no.npz", "no.yaml"),
    "margin": ("no.npz",),
    "plan-margin": ("no.toml",),
    "sheet": ("no.npz",),
    "place": ("no.toml", "--within", "x=0,1"),
    "export": ("no.npz", "--out", "a.csv"),
    "init": ("no.urdf",),
    "follow": ("no.toml",),
    "view": ("no.toml",),
}
# These are given nothing that could be bad but options.
WITHOUT_INPUT = {"demo", "study", "warm-up", "robots", "schema"}


def test_all_commands_are_under_these_laws() -> None:
    named = set(get_command(app).commands)  # type: ignore[attr-defined]
    assert named == set(BAD) | WITHOUT_INPUT


@pytest.mark.parametrize("command", sorted(BAD))
def test_bad_input_is_2_and_json_where_that_is_asked_for(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    code, output, errors = in_full(command, *BAD[command])
    assert (code, output) == (2, "")
    assert errors.startswith("error: ")
    code, output, errors = in_full(command, *BAD[command], "--json")
    assert code == 2
    error = json.loads(output)["error"]
    assert set(error) >= {"class", "message", "file", "key", "line"}
    assert error["message"] in errors


@pytest.mark.parametrize("command", sorted({*BAD, *WITHOUT_INPUT}))
def test_options_that_are_not_there_are_bad_input(command: str) -> None:
    code, output, _ = in_full(command, "--nosuch", "--json")
    assert code == 2
    assert json.loads(output)["error"]["class"] == "NoSuchOption"


def test_what_is_not_verified_is_1_in_every_command(tmp_path: Path) -> None:
    """Judged by limits that no motion keeps, so that nothing is wrong with the input."""
    fast = "constraints.JointVelocityLimits.limit=1e-3"
    problem, plan = tmp_path / "a.toml", tmp_path / "a.npz"
    sm.files.write_problem(sm.sample_problem(), problem)
    sm.plan(sm.sample_problem()).save(plan)
    unsound, slow = tmp_path / "b.npz", tmp_path / "slow.toml"
    limited = [sm.constraints.JointVelocityLimits(1e-3)]
    sm.files.write_problem(replace(sm.sample_problem(), constraints=limited), slow)
    for arguments in (
        ("plan", problem, "--set", fast, "--out", unsound),
        ("check", plan, "--set", fast),
        ("check", unsound),
        ("export", unsound, "--out", tmp_path / "a.csv"),
        ("batch", slow, "--out", tmp_path / "batch", "--workers", "1"),
    ):
        code, text = invoke(*arguments, "--json")
        assert code == 1, (arguments, text)
        json.loads(text)


# Commands of plans, and of problems and jobs, with what else they need.
OF_PLANS = {name: BAD[name][1:] for name in ("compare", "replay", "retime", "margin", "sheet")}
OF_PLANS |= {"export": ("--out", "a.csv"), "calibrate": ("no.yaml",)}
OF_DOCUMENTS = {name: BAD[name][1:] for name in ("job", "batch", "plan-margin", "follow", "place")}


@pytest.mark.parametrize("command", sorted(OF_PLANS))
def test_a_problem_in_place_of_a_plan_is_told_how_to_become_one(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.toml").write_text('robot.name = "panda"\n')
    code, _, errors = in_full(command, "a.toml", *OF_PLANS[command])
    assert code == 2
    said = "a.toml: is no plan written by selfmotion (.npz); `selfmotion plan` makes one"
    assert said in " ".join(errors.split())


@pytest.mark.parametrize("command", sorted(OF_DOCUMENTS))
def test_what_is_planned_in_place_of_a_problem_is_refused_by_its_suffix(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.program").write_bytes(b"PK\x05\x06" + bytes(18))
    code, _, errors = in_full(command, "a.program", *OF_DOCUMENTS[command])
    assert code == 2
    assert "a.program: has suffix '.program', expected .toml, .json or .yaml" in " ".join(
        errors.split()
    )


@pytest.mark.parametrize("suffix", [".toml", ".json", ".yaml", ".yml"])
def test_a_problem_file_has_any_suffix_of_documents(
    suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_document(Path(f"a{suffix}"), {"robot": {"name": "panda"}, "task": "pose"})
    code, _, errors = in_full("plan", f"a{suffix}")
    assert code == 2
    assert f"error: a{suffix}: path: is missing" in errors
