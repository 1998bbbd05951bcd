"""Comparison of the published method: its study, and other works' methods."""
