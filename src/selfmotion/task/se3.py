"""Poses and rotations, by Pinocchio: the values that all of the house speaks of."""

from pinocchio import (
    SE3 as SE3,
    Jexp3 as Jexp3,
    Quaternion as Quaternion,
    exp3 as exp3,
    log3 as log3,
    rpy as rpy,
    skew as skew,
)
