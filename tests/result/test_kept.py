"""What finished work is kept under changes with all that decides what comes of it."""

import importlib
from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.result import key_of, own_modules
from support.arms import robot_named

OWN = """
from dataclasses import dataclass
from typing import ClassVar
import coal
import selfmotion as sm

class Own(sm.paths.Path, kind="kept for a test"):
    duration = 2.0
    def __init__(self, path): self.path = path
    def evaluate(self, t): return self.path.samples(t)
    def to_dict(self): return {"kind": self.kind}

@dataclass(frozen=True, eq=False)
class Cone(sm.obstacles.Obstacle):
    shape: ClassVar[str] = "cone kept for a test"
    radius: float
    def geometry(self): return coal.Cone(self.radius, self.radius)
"""


def test_ones_own_code_is_in_the_key(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a path within another one, and of a body of a clearance."""
    file = tmp_path / "kept_own_code.py"
    file.write_text(OWN)
    monkeypatch.syspath_prepend(tmp_path)
    own = importlib.import_module("kept_own_code")
    pose = robot_named("planar_3r").pose(np.zeros(3))
    path = own.Own(sm.paths.Dwell(pose, 2.0)) + sm.paths.Dwell(pose, 1.0)
    apart = sm.constraints.Clearance([own.Cone("cone", pose, 0.1)])
    plain = sm.paths.Dwell(pose, 2.0)
    described = [item.to_dict() for item in (path, apart, plain)]
    assert [own_modules(item) for item in described] == [["kept_own_code"]] * 2 + [[]]
    before = [key_of(item, {}) for item in described]
    file.write_text(OWN + "# changed")
    after = [key_of(item, {}) for item in described]
    assert [one == other for one, other in zip(before, after, strict=True)] == [False, False, True]
