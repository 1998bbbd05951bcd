"""The command line."""

from selfmotion.cli.app import app as app, main as main
