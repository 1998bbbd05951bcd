"""Problem files and job files: what they may say, read and written.

The format, table by table: `problem_table` is a whole problem file and `job_tables` a job file;
`robot_tables`, `path_tables`, `pose_tables`, `cost_tables`, `constraint_tables` and `body_tables`
are what these are made of. What a table is, `tables` says. They are imported when a file is read.
"""

from collections.abc import Mapping
from typing import Any

from selfmotion.shell.documents.example import (
    MAYBE as MAYBE,
    example_text as example_text,
    example_texts as example_texts,
)
from selfmotion.shell.documents.grid_items import grid_items as grid_items
from selfmotion.shell.documents.joint_limits import (
    joint_limit_notes as joint_limit_notes,
    read_joint_limits as read_joint_limits,
)
from selfmotion.shell.documents.named_files import named_from as named_from
from selfmotion.shell.documents.overrides import (
    belonging as belonging,
    grid_documents as grid_documents,
    keys_of as keys_of,
    moved_workpiece as moved_workpiece,
    parse_setting as parse_setting,
    set_key as set_key,
    write_combination as write_combination,
)
from selfmotion.shell.documents.problem_file import (
    plan_request_of as plan_request_of,
    problem_document as problem_document,
    read_job as read_job,
    read_problem as read_problem,
    read_seam_job as read_seam_job,
    seam_job_of as seam_job_of,
    write_problem as write_problem,
)
from selfmotion.shell.documents.seam_job import SeamJob as SeamJob


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of problem and job files, for editors."""
    from selfmotion.shell.documents import schema

    return schema.json_schema()


def flipped_normals(table: Mapping[str, Any]) -> tuple[dict[str, Any], str]:
    """Return a table of a file of poses with its normals the other way, and how to say that."""
    from selfmotion.shell.documents import pose_tables

    return pose_tables.flipped_normals(table)
