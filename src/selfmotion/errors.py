"""What can go wrong: every error is a `selfmotion.SelfmotionError`, and says what to do."""

from selfmotion.basics import (
    BreakdownError,
    CollisionError,
    DeadlineError,
    FeedError,
    FileFormatError,
    FormerUseWarning,
    InverseKinematicsError,
    NoSequenceError,
    PathError,
    PlanError,
    ProblemError,
    RedundancyError,
    RenderError,
    RobotError,
    StartError,
)

__all__ = [
    "BreakdownError",
    "CollisionError",
    "DeadlineError",
    "FeedError",
    "FileFormatError",
    "FormerUseWarning",
    "InverseKinematicsError",
    "NoSequenceError",
    "PathError",
    "PlanError",
    "ProblemError",
    "RedundancyError",
    "RenderError",
    "RobotError",
    "StartError",
]
