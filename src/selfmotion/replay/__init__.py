"""The replay of a plan: one HTML file that needs no server, no network and no other file."""

from selfmotion.replay.browser import render_gif, render_png
from selfmotion.replay.figure import figure
from selfmotion.replay.page import notebook_html, replay_html, write_replay

__all__ = [
    "figure",
    "notebook_html",
    "render_gif",
    "render_png",
    "replay_html",
    "write_replay",
]
