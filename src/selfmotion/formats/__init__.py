"""Files that people write and robots read: problems, tool motions, joint motions."""

from typing import Any

from selfmotion.formats.documents import (
    in_si,
    read_document,
    read_values,
    write_document,
    write_text,
)
from selfmotion.formats.example import example_text
from selfmotion.formats.joint_limits import read_joint_limits
from selfmotion.formats.motions import FORMS, READABLE, SUFFIXES, read_motion, write_motion
from selfmotion.formats.overrides import grid_documents, parse_setting, set_key
from selfmotion.formats.path_files import read_path
from selfmotion.formats.poses import pose_of
from selfmotion.formats.problem_file import Job, job_of, obstacle, read_job, read_problem
from selfmotion.formats.problem_writing import write_job, write_problem
from selfmotion.formats.samples import LinearMiss, linear_miss

__all__ = [
    "FORMS",
    "READABLE",
    "SUFFIXES",
    "Job",
    "LinearMiss",
    "example_text",
    "grid_documents",
    "in_si",
    "job_of",
    "json_schema",
    "linear_miss",
    "obstacle",
    "parse_setting",
    "pose_of",
    "read_document",
    "read_job",
    "read_joint_limits",
    "read_motion",
    "read_path",
    "read_problem",
    "read_values",
    "set_key",
    "write_document",
    "write_job",
    "write_motion",
    "write_problem",
    "write_text",
]


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of problem files, for editors."""
    from selfmotion.formats import models

    return models.json_schema()
