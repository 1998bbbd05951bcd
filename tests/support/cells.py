"""A problem file that tests read, and break."""

from pathlib import Path

CELL = """
task = "pose"
start = "home"
max_evaluations = 50

[robot]
name = "panda"
tool = "panda_hand_tcp"
lock = { panda_finger_joint1 = 0.02 }

[path]
kind = "circle"
radius_mm = 100
normal = [1, 0, 0]
duration = 4

[null_motion]
kind = "FreeNullMotion"

[[costs]]
kind = "JointVelocity"

[[costs]]
kind = "InverseManipulability"
mu = 0.001

[[constraints]]
kind = "JointPositionLimits"

[clearance]
distance_mm = 10

[[clearance.obstacles]]
shape = "box"
name = "post"
position = [0, -0.6, 0.6]
rpy_deg = [0, 0, 10]
size_mm = [100, 100, 1200]

[[relaxations]]
rows = ["rx", "ry"]
band_deg = 5

[tolerance]
position = 1e-5
"""


def written(folder: Path, text: str, name: str = "cell.toml") -> Path:
    file = folder / name
    file.write_text(text)
    return file
