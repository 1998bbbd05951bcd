"""The command line."""

from selfmotion.cli.app import app, main

__all__ = [
    "app",
    "main",
]
