"""Motions planned while the arm moves."""
