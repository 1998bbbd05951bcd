"""The command line."""

from selfmotion.shell.cli import (
    check_commands as check_commands,
    exports as exports,
    file_commands as file_commands,
    jobs as jobs,
    margins as margins,
    places as places,
    plan_commands as plan_commands,
    runs as runs,
    viewing as viewing,
)
from selfmotion.shell.cli.app import app as app, main as main

# What most people come for is listed first; the others as their modules are imported.
_FIRST = ("plan", "job", "retime", "init", "schema")
app.registered_commands.sort(
    key=lambda command: (
        _FIRST.index(name)
        if (name := getattr(command.callback, "__name__", "")) in _FIRST
        else len(_FIRST)
    )
)
