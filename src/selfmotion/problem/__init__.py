"""What is wanted: costs, constraints, and the problem."""

from selfmotion.problem.problem import *  # noqa: F403
