"""The command line."""

from selfmotion.cli import (
    commands as commands,
    exports as exports,
    jobs as jobs,
    paces as paces,
    runs as runs,
)
from selfmotion.cli.app import app as app, main as main
