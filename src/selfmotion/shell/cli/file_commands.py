"""The commands to begin with: `init`, `schema` and `robots`."""

import json
import os
from pathlib import Path
from typing import Annotated, Any

import typer

import selfmotion as sm
from selfmotion.basics import write_text
from selfmotion.shell.cli import documents, options, outputs, result_json, tables
from selfmotion.shell.cli.app import FILES, app, print_json, print_written, terminal
from selfmotion.shell.documents import MAYBE, example_texts, json_schema

# Keys that --set of `init` accepts.
_EXAMPLE_KEYS = (
    *("robot.lock", "robot.arguments", "robot.packages"),
    *("clearance", "clearance.srdf", "clearance.disabled"),
)


@app.command(
    epilog="Example: selfmotion init panda; then: selfmotion plan panda.toml; or: selfmotion init "
    "arm.xacro --job --out seams.toml",
    rich_help_panel=FILES,
)
def init(
    robot: options.ProblemArgument,
    out: options.OneOutOption = None,
    tool: options.ToolOption = None,
    settings: options.SetOption = None,
    job: Annotated[bool, typer.Option("--job", help="Write a job with several seams.")] = False,
    positioner: Annotated[
        bool,
        typer.Option("--positioner", help="Write a cell that has a table that tilts and turns."),
    ] = False,
    force: options.ForceOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Write a commented example of a problem file, ROBOT.toml by default.

    For an arm from a file the example is planned first. --set accepts robot.lock, robot.arguments,
    robot.packages, clearance.disabled, clearance.srdf and clearance=false.
    """
    file = Path(f"{Path(robot).stem}.toml") if out is None else out
    if os.path.exists(file) and not force:
        raise sm.errors.FileFormatError(f"{file}: is there already; give --out or --force")
    texts = example_texts(
        robot, file, tool=tool, job=job, positioner=positioner, **_example_options(settings or [])
    )
    text = next(texts) if robot in sm.NAMED_ARMS else documents.first_that_runs(texts, file, job)
    write_text(file, text)
    if MAYBE in text:
        pairs = [line[2:] for line in text.splitlines() if ": overlap in " in line]
        listed = "; ".join(pairs)
        outputs.print_notes([f"left out in {file}, as these links {MAYBE}: {listed}"])
    print_written([file], as_json)


def _example_options(settings: list[str]) -> dict[str, Any]:
    """Return the settings of --set as keyword arguments of `example_texts`."""
    document: dict[str, Any] = {"robot": {}, "clearance": {}}
    documents.DocumentOptions(settings).set_in(document, Path())
    robot_keys, clearance = document["robot"], document["clearance"]
    clearance_keys = clearance if isinstance(clearance, dict) else {}
    keys = [*document, *(f"robot.{key}" for key in robot_keys)]
    keys += [f"clearance.{key}" for key in clearance_keys]
    for key in keys:
        if key not in ("robot", *_EXAMPLE_KEYS):
            raise sm.errors.ProblemError(
                f"--set {key}: an example takes {', '.join(_EXAMPLE_KEYS)}; change the file that "
                f"is written"
            )
    packages = robot_keys.get("packages", [])
    robot_keys["packages"] = [packages] if isinstance(packages, str) else packages
    return {**robot_keys, "clearance": clearance is not False, **clearance_keys}


@app.command(epilog="Example: selfmotion schema --out problem.schema.json", rich_help_panel=FILES)
def schema(out: options.OneOutOption = None) -> None:
    """Write the JSON Schema of problem files, for completion in an editor."""
    text = json.dumps(json_schema(), indent=1)
    if out is None:
        typer.echo(text)
        return
    write_text(out, text + "\n")
    print_written([out])


@app.command(epilog="Example: selfmotion robots", rich_help_panel=FILES)
def robots(as_json: options.JsonOption = False) -> None:
    """List the arms known by name: joints, tool frame, and redundancy for each task."""
    arms = {name: sm.load_robot(name) for name in sm.NAMED_ARMS}
    if as_json:
        print_json(result_json.robots_json(arms))
    else:
        tables.show_robots(arms, terminal)
