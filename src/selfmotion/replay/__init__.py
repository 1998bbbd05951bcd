"""The replay of a plan: one HTML file that needs no server, no network and no other file."""

from selfmotion.replay.page import notebook_html, replay_html, write_replay

__all__ = ["notebook_html", "replay_html", "write_replay"]
