"""Programs in ABB RAPID, read."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path as FilePath

from typing_extensions import override

from selfmotion.model.robot import RobotModel
from selfmotion.model.task import SE3
from selfmotion.shop.controllers.feed_segments import ZONE
from selfmotion.shop.controllers.program_reader import ProgramReader, Target
from selfmotion.shop.controllers.rapid import APPROACH_TURNING, FASTEST, RAPID, SLOW, TURNING
from selfmotion.shop.controllers.segment_building import Pose

# Zones of seams at speeds, in which corners are rounded by as much as is judged.
_ZONES = ("fine", "z0")


class RapidReader(ProgramReader):
    """Reader of modules: of what `write_rapid` writes, spaces, names and numbers aside."""

    language = RAPID
    moving = "zone is not fine"

    def __init__(self, file: FilePath, robot: RobotModel | None = None) -> None:
        super().__init__(file, robot)
        # Speeddata by its name: of the tool, and of what turns [mm/s, °/s, mm/s, °/s].
        self._speeds: dict[str, list[float]] = {}

    @override
    def actions(self) -> Mapping[str, Callable[..., None]]:
        return {
            **super().actions(),
            "tool": partial(self._declare, "tool"),
            "work": partial(self._declare, "work"),
            "speed": self._take_speed,
            "procedure": self.no_action,
            "joint approach": self._joint_approach,
            "joint": self._take_axes,
            "linear": self._take_pose,
            "circular": self._take_pose,
            "leave": partial(self.check_stopped, "the program ends"),
        }

    @property
    @override
    def tool(self) -> SE3 | None:
        return self.settings.get("tool_frame")

    @property
    @override
    def work(self) -> SE3 | None:
        if "object" not in self.settings:
            return None
        user, object_frame = self.settings["user"], self.settings["object"]
        return user * object_frame if self.settings["fixed"] else object_frame

    @property
    @override
    def is_carried(self) -> bool | None:
        return None if "fixed" not in self.settings else not self.settings["fixed"]

    def _declare(self, kind: str, **values: object) -> None:
        """Take the tool or the work object, of which there is one."""
        if kind in self.settings:
            what = f"{'tool' if kind == 'tool' else 'wobj'}data '{self.settings[kind]}'"
            raise self.lines.fault(f"there is a {what} already, expected one")
        self.settings.update(values)

    def _take_speed(self, speed: str, speeds: list[float]) -> None:
        if speed.lower() in self._speeds:
            raise self.lines.fault(f"there is a speeddata '{speed}' already, expected one")
        self._speeds[speed.lower()] = speeds

    def _joint_approach(self, axes: list[float], speed: str, tool: str) -> None:
        self._check_name("tool", tool)
        self._approach(axes, speed)

    def _approach(self, target: list[float] | Pose, speed: str) -> None:
        """Take a slow motion; nothing has judged one that is faster than those."""
        speeds, limits = self._speeds.get(speed.lower()), (FASTEST, APPROACH_TURNING) * 2
        if speeds is None or any(x > most for x, most in zip(speeds, limits, strict=True)):
            speed_text = "none of the module" if speeds is None else _in_words(speeds)
            raise self.lines.fault(
                f"a motion to where the program goes on has speed '{speed}' ({speed_text}), "
                f"expected a speeddata of the module of at most {_in_words(limits)}: nothing has "
                f"judged it"
            )
        self.approach(target)

    def _take_axes(
        self, axes: list[float], speed: str, seconds: float, zone: str, tool: str
    ) -> None:
        self._check_name("tool", tool)
        self.take(Target(axes, seconds), stops=zone.lower() == "fine")

    def _take_pose(
        self,
        pose: Pose,
        speed: str,
        zone: str,
        tool: str,
        work: str,
        seconds: float | None = None,
        via: Pose | None = None,
    ) -> None:
        """Take a pose with a time or a speed; one whose speed is called …_v is a slow motion."""
        self._check_name("tool", tool)
        self._check_name("work", work)
        if "configurations" not in self.settings:
            raise self.lines.fault(
                "linear motions need ConfL \\Off before them: else the controller may stop where "
                "the configuration is another one than a target states"
            )
        stops = zone.lower() == "fine"
        if seconds is not None:
            self.take(Target(pose, seconds), stops=stops)
        elif via is None and speed.lower().endswith(SLOW):
            if not stops:
                raise self.lines.fault(f"a slow motion has zone {zone}, expected fine")
            self._approach(pose, speed)
        else:
            self._check_judged(speed, zone, is_round=via is not None)
            self.take(
                Target(pose, speed=1e-3 * self._speeds[speed.lower()][0], via=via), stops=stops
            )

    def _check_name(self, kind: str, name: str) -> None:
        """Refuse another tool or work object than that of the module."""
        expected = str(self.settings.get(kind, ""))
        if name.lower() != expected.lower():
            what = "tool" if kind == "tool" else "work object"
            raise self.lines.fault(
                f"{what} is '{name}', expected '{expected}', the one that the module has"
            )

    def _check_judged(self, speed: str, zone: str, *, is_round: bool) -> None:
        """Refuse what makes another motion of a seam at its speed than the one that is judged."""
        if speed.lower() not in self._speeds:
            raise self.lines.fault(f"speed '{speed}' is no speeddata of the module")
        if zone.lower() not in _ZONES:
            raise self.lines.fault(
                f"zone is {zone}, expected fine or z0: corners of seams at speeds are judged as "
                f"rounded by {1e3 * ZONE:g} mm at most"
            )
        turning = self._speeds[speed.lower()][1:]
        if any(value < least for value, least in zip(turning, TURNING, strict=True)):
            raise self.lines.fault(
                f"speeddata '{speed}' has {_in_words(turning)} for turning and external axes, "
                f"expected at least {_in_words(TURNING)}: slower ones hold the tool back from its "
                f"speed"
            )
        if is_round and "circles" not in self.settings:
            raise self.lines.fault(
                "MoveC needs CirPathMode \\ObjectFrame before it: else the tool turns otherwise"
            )


def _in_words(values: Sequence[float]) -> str:
    return ", ".join(f"{value:g}" for value in values)
