"""The command line in this process, which spares each test the start of Python."""

import io
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from unittest.mock import patch

import pytest
from typer.testing import CliRunner

from selfmotion.shell.cli import app, main


def invoke(*arguments: str | Path) -> tuple[int, str]:
    """Return exit code and standard output; exceptions come through."""
    result = CliRunner().invoke(app, list(map(str, arguments)))
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.stdout


def in_full(*arguments: str | Path) -> tuple[int | str | None, str, str]:
    """Return exit code, output and errors of the command with all that surrounds it."""
    output, errors = io.StringIO(), io.StringIO()
    with (
        patch.object(sys, "argv", ["selfmotion", *map(str, arguments)]),
        redirect_stdout(output),
        redirect_stderr(errors),
        pytest.raises(SystemExit) as stopped,
    ):
        main()
    return stopped.value.code, output.getvalue(), errors.getvalue()


def complaint(*arguments: str | Path) -> str:
    """Return the one line that the command prints for bad input, with exit code 2."""
    printed = io.StringIO()
    with (
        patch.object(sys, "argv", ["selfmotion", *map(str, arguments)]),
        redirect_stderr(printed),
        pytest.raises(SystemExit) as stopped,
    ):
        main()
    assert stopped.value.code == 2
    (line,) = printed.getvalue().strip().splitlines()
    assert line.startswith("error: ")
    return line


def on_circle(radius: float | str, axis: str = "x", pace: str = "duration=4") -> tuple[str, str]:
    """Return the option of a circle [m] about an axis, from where the arm starts."""
    normal = [int(axis == name) for name in "xyz"]
    return "--set", f'path={{kind="circle", radius={radius}, normal={normal}, {pace}}}'


def on_line(by: str, pace: str = "duration=4") -> tuple[str, str]:
    """Return the option of a straight line by dx,dy,dz [m], from where the arm starts."""
    return "--set", f'path={{kind="line", by=[{by}]{pace and ", "}{pace}}}'
