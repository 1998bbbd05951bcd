"""How far motions are from each other."""

from collections.abc import Callable

import numpy as np

from selfmotion.basics import Array, Ints
from selfmotion.robot import RobotModel

Apart = Callable[[Array, Array], Array]
"""How far a motion (N, n) is from each of others (K, N, n), (K,) [rad or m]."""


def apart_of(robot: RobotModel) -> Apart:
    """Return how far motions of an arm are from each other, at most, up to whole turns."""
    turning, sizes = robot.is_revolute, robot.coordinate_sizes

    def apart(motion: Array, others: Array) -> Array:
        difference = others - motion
        turns = np.round(difference / (2.0 * np.pi))
        away = sizes * np.abs(difference - 2.0 * np.pi * turns * turning)
        return np.asarray(away.max(axis=(1, 2)))

    return apart


def unlike(motions: Array, order: Ints, apart: Apart, least: float) -> tuple[list[int], list[int]]:
    """Return those of motions (K, N, n) that are not near one earlier in an order, and the others.

    Numbers of motions, in that order; farther apart than `least` is not near.
    """
    alone: list[int] = []
    near: list[int] = []
    for k in order.tolist():
        is_alone = bool((apart(motions[k], motions[alone]) > least).all())
        (alone if is_alone else near).append(k)
    return alone, near
