"""The command line."""

from selfmotion.shell.cli import (
    batch_command as batch_command,
    check_commands as check_commands,
    exports as exports,
    file_commands as file_commands,
    follow_command as follow_command,
    jobs as jobs,
    margins as margins,
    places as places,
    plan_commands as plan_commands,
    project_commands as project_commands,
    viewing as viewing,
)
from selfmotion.shell.cli.app import app as app, main as main

# What most people come for is listed first, the loop last, the others in the order of imports.
_FIRST, _LAST = ("plan", "job", "retime", "init", "schema"), ("follow",)


def _rank(name: str) -> int:
    return _FIRST.index(name) if name in _FIRST else len(_FIRST) + (name in _LAST)


app.registered_commands.sort(key=lambda command: _rank(getattr(command.callback, "__name__", "")))
