"""The command line."""

from selfmotion.cli import (
    commands as commands,
    exports as exports,
    jobs as jobs,
    margins as margins,
    paces as paces,
    placing as placing,
    runs as runs,
    warm_up as warm_up,
)
from selfmotion.cli.app import app as app, main as main
