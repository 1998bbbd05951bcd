"""Facts that a program depends on besides its targets: held joints, outputs, and the load."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from hashlib import sha256
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from selfmotion.basics import Array, ProblemError
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import SE3
from selfmotion.problem.constraints import Constraint
from selfmotion.shop.controllers.controller_axes import flange_of, tool_from_flange
from selfmotion.shop.controllers.program_settings import ProgramSettings
from selfmotion.shop.controllers.program_texts import TOLERANCE_HEADING, plain

# Beginnings of comments that state these facts.
_HELD = "held joints: "
_OUTPUTS = "outputs: "
_UNIT = "positioner: "
_FLANGE = "flange: "
_LOAD = "load: "
_APPROACH = "approach: "
_FACTS = (_FLANGE, _HELD, _OUTPUTS, _UNIT, _LOAD, _APPROACH)
# Other statements of a head that readers use; the checksum guards all of them.
_BELIEVED = (
    *(
        "axes: ",
        "deviation: ",
        "deviation of moves: ",
        TOLERANCE_HEADING,
        "poses: ",
        "planned work object: ",
    ),
    *_FACTS,
)
_CHECKSUM = "checksum of what is stated: "
# Held joints stand where the file says within its digits [rad or m].
_DIGITS = 1e-6
# Relative difference of masses that are the same: that of a scale.
_SHARE = 1e-3
# Difference of masses that are the same in any case [kg].
_GRAM = 1e-3
# Difference of centres of mass that are the same: that of a drawing [m].
_MILLIMETRE = 1e-3


class Load(NamedTuple):
    """The load at the flange.

    Attributes
    ----------
    mass : float
        [kg]
    center : (3,)
        Its centre of mass from the flange [m].
    """

    mass: float
    center: Array

    def is_like(self, other: "Load") -> bool:
        """Whether it is the same load, as a scale and a drawing give it."""
        most = max(self.mass, other.mass)
        if abs(self.mass - other.mass) > max(_SHARE * most, _GRAM):
            return False
        return most <= _GRAM or bool(np.abs(self.center - other.center).max() <= _MILLIMETRE)

    def __str__(self) -> str:
        """Mass and centre, as settings of a program have them."""
        center = ", ".join(f"{1e3 * value:.4g}" for value in self.center)
        return f"{self.mass:.4g} kg at ({center}) mm from the flange"


@dataclass(frozen=True, eq=False)
class ProgramFacts:
    """Facts in the head of a program that its targets depend on.

    Attributes
    ----------
    flange : str
        The link that the tool and the load are counted from.
    held : mapping
        Joint that is held → where [rad or m].
    outputs : mapping
        Event → the output that it switches, as the program calls it, and to what; None for an event
        that is a comment.
    positioner : str
        The mechanical unit that carries the work object; empty for none.
    load : Load or None
        What the program was written to say of the flange's load; None where it says nothing.
    approach : float
        How fast it was written to go to its begin, as a share.
    is_changed : bool
        Whether somebody changed what is stated, by its checksum.
    """

    flange: str = ""
    held: Mapping[str, float] = field(default_factory=dict)
    outputs: Mapping[str, tuple[str, bool] | None] = field(default_factory=dict)
    positioner: str = ""
    load: Load | None = None
    approach: float = 1.0
    is_changed: bool = False

    @classmethod
    def of(
        cls, robot: RobotModel, settings: ProgramSettings, events: Sequence[str], *, by_poses: bool
    ) -> "ProgramFacts":
        """Return those of a program for a robot, with events (their names)."""
        outputs = dict[str, tuple[str, bool] | None]()
        for event in events:
            signal = settings.signal(event)
            outputs[plain(event)] = None if signal is None else (str(signal[0]), signal[1])
        held = {name: round(float(value), 9) + 0.0 for name, value in robot.locked.items()}
        unit = settings.positioner if by_poses else None
        load = None if settings.mass is None else Load(settings.mass, np.array(settings.center))
        named = "" if unit is None else str(unit)
        return cls(flange_of(robot, settings), held, outputs, named, load, settings.approach)

    @classmethod
    def stated(cls, notes: Sequence[str]) -> "ProgramFacts | None":
        """Return those that the comments of a program state; None where they state none."""
        statements = {
            key: note.removeprefix(key) for note in notes for key in _FACTS if _is(note, key)
        }
        sums = [note.removeprefix(_CHECKSUM) for note in notes if _is(note, _CHECKSUM)]
        if not (statements or sums):
            return None
        changed = sums != [checksum(notes)]
        try:
            flange = str(json.loads(statements.get(_FLANGE, '""')))
            approach = float(json.loads(statements.get(_APPROACH, "1.0")))
            carried = json.loads(statements.get(_LOAD, "null"))
            load = None
            if carried is not None:
                load = Load(float(carried[0]), np.array([float(x) for x in carried[1:4]]))
            held = {name: float(x) for name, x in json.loads(statements.get(_HELD, "{}")).items()}
            outputs = {
                event: None if value is None else (str(value[0]), bool(value[1]))
                for event, value in json.loads(statements.get(_OUTPUTS, "{}")).items()
            }
        except (
            ValueError,
            ArithmeticError,
            TypeError,
            AttributeError,
            LookupError,
            RecursionError,
        ):
            return cls(is_changed=True)
        return cls(flange, held, outputs, statements.get(_UNIT, ""), load, approach, changed)

    @property
    def notes(self) -> list[str]:
        """Their lines in the head, without the marks of comments."""
        parts = [f"{_FLANGE}{json.dumps(self.flange)}"]
        parts += [f"{_HELD}{json.dumps(dict(self.held))}"] if self.held else []
        parts += [f"{_OUTPUTS}{json.dumps(dict(self.outputs))}"] if self.outputs else []
        parts += [f"{_UNIT}{self.positioner}"] if self.positioner else []
        if self.load is not None:
            parts.append(f"{_LOAD}{json.dumps([self.load.mass, *self.load.center.tolist()])}")
        return [*parts, f"{_APPROACH}{json.dumps(self.approach)}"]

    def against(self, robot: RobotModel, load: Load | None) -> Iterator[str]:
        """Yield the facts that differ from an arm's held joints or from the program's own load."""
        if self.is_changed:
            yield (
                "what its head states (axes, deviations, held joints, outputs, frames) was changed "
                "by hand, as its checksum tells: write the program again"
            )
            return
        yield from self._load_fault(load)
        yield from self._held_joint_faults(robot)

    def _load_fault(self, load: Load | None) -> Iterator[str]:
        """Yield that the load of the program is another one than it was written with."""
        is_only_one_stated = (load is None) != (self.load is None)
        if is_only_one_stated or (load and self.load and not load.is_like(self.load)):
            now, before = ("no load" if x is None else str(x) for x in (load, self.load))
            yield f"it says that the flange carries {now}, it was written with {before}"

    def _held_joint_faults(self, robot: RobotModel) -> Iterator[str]:
        """Yield the joints that are held in the program alone, in the arm alone, or elsewhere."""
        for name in sorted({*self.held, *robot.locked}):
            written, current = self.held.get(name), robot.locked.get(name)
            if written is None:
                yield f"it was written for an arm whose joint '{name}' is not held"
                continue
            statement = f"it was written with joint '{name}' held at {written:.6g}"
            if current is None:
                yield f"{statement}, here it is not held"
            elif abs(written - current) > _DIGITS:
                yield f"{statement}, here at {current:.6g}"


def with_checksum(notes: Sequence[str]) -> list[str]:
    """Return the comments of a head, with a last one that guards what a reader believes of it."""
    return [*notes, f"{_CHECKSUM}{checksum(notes)}"]


def checksum(notes: Sequence[str]) -> str:
    """Return the checksum of those comments that a reader believes."""
    believed = [note for note in notes if note.startswith(_BELIEVED)]
    return sha256("\n".join(believed).encode()).hexdigest()[:12]


def _is(note: str, key: str) -> bool:
    return note.startswith(key)


def held_in_words(robot: RobotModel) -> str:
    """Return which joints have to stand where while a motion runs; empty for none."""
    if not robot.locked:
        return ""
    each = ", ".join(
        f"{name} at {value:.4g} {'m' if _slides(robot, name) else 'rad'}"
        for name, value in robot.locked.items()
    )
    return f"joints that are held, and have to stand there: {each}"


def _slides(robot: RobotModel, joint: str) -> bool:
    return robot.urdf.joints[joint].kind == "prismatic"


def verified_loads(robot: RobotModel, constraints: Sequence[Constraint], flange: str) -> list[Load]:
    """Return the load at the flange in each constraint of torques, by payload and URDF."""
    held = [item.load for item in constraints if item.load is not None]
    if not held:
        return []
    settings = ProgramSettings(flange=flange or None)
    tool, link_loads = tool_from_flange(robot, settings), _beyond(robot, flange)
    loads = []
    for mass, center in held:
        loads.append(_together([*link_loads, Load(mass, np.asarray(tool.act(center)))]))
    return loads


def check_load(
    load: Load | None, robot: RobotModel, constraints: Sequence[Constraint], flange: str
) -> None:
    """Refuse a load that torques were not verified with.

    Raises
    ------
    ProblemError
        The load is another one; both are named.
    """
    if load is None:
        return
    for verified in verified_loads(robot, constraints, flange):
        if not load.is_like(verified):
            raise ProblemError(
                f"{robot.name}: the program says that the flange carries {load}, torques were "
                f"verified with {verified}: give the same to both (JointTorqueLimits(payload=…, "
                f"center=…), which counts from the tool; ProgramSettings(mass=…, center=…))"
            )


def _beyond(robot: RobotModel, flange: str) -> list[Load]:
    """Return the masses of links beyond the flange that move with it."""
    if not flange:
        return []
    carrier, place = robot.carrier_of(flange)
    root = ElementTree.fromstring(robot.urdf.text)
    children: dict[str, list[str]] = {}
    for joint in root.iter("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        if parent is not None and child is not None:
            children.setdefault(parent.get("link", ""), []).append(child.get("link", ""))
    links, loads = [flange], list[Load]()
    while links:
        name = links.pop()
        links += [each for each in children.get(name, ()) if robot.carrier_of(each)[0] == carrier]
        element = root.find(f"link[@name='{name}']/inertial") if "'" not in name else None
        mass = None if element is None else element.find("mass")
        if element is None or mass is None:
            continue
        origin = element.find("origin")
        text = "0 0 0" if origin is None else origin.get("xyz", "0 0 0")
        center = np.array([float(value) for value in text.split()])
        link_pose: SE3 = place.inverse() * robot.carrier_of(name)[1]
        loads.append(Load(float(mass.get("value", "0")), np.asarray(link_pose.act(center))))
    return loads


def _together(loads: Sequence[Load]) -> Load:
    mass = sum(item.mass for item in loads)
    if mass <= 0.0:
        return Load(0.0, np.zeros(3))
    return Load(mass, np.asarray(sum(item.mass * item.center for item in loads) / mass))
