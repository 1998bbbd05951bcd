"""The command line in this process, which spares each test the start of Python."""

from pathlib import Path

from typer.testing import CliRunner

import selfmotion as sm
from selfmotion.cli import app


def invoke(*arguments: str | Path) -> tuple[int, str]:
    """Return exit code and standard output; exceptions come through."""
    result = CliRunner().invoke(app, list(map(str, arguments)))
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.stdout


def complaint(*arguments: str | Path) -> str:
    """Return the one line that `main` prints before it exits with 2."""
    try:
        code, output = invoke(*arguments)
    except sm.SelfmotionError as error:
        line = f"error: {error}"
        assert "\n" not in line
        return line
    raise AssertionError(f"exit code {code}: {output}")
