"""Programs in KUKA Robot Language, read."""

from collections.abc import Callable, Mapping
from pathlib import Path as FilePath

import numpy as np
from typing_extensions import override

from selfmotion.model.robot import RobotModel
from selfmotion.model.task import SE3
from selfmotion.shop.controllers.controller_program import Switch
from selfmotion.shop.controllers.krl import (
    APPROACH_SPEED,
    APPROACH_TURNING,
    FULL_SPEED,
    KRL,
    UNBOUND_TURNING,
)
from selfmotion.shop.controllers.pose_segments import aligned_quaternions, largest_tool_speeds
from selfmotion.shop.controllers.program_reader import ProgramReader, Target
from selfmotion.shop.controllers.segment_building import Pose, times_of

# Difference of a block's time from the sum of its parts below which parts are seconds [s].
_SAME_TIME = 1e-4
# Variables of $VEL with the largest rates of turning.
_TURNINGS = ("ORI1", "ORI2")


class KrlReader(ProgramReader):
    """Reader of modules: of what `write_krl` writes, spaces, names and numbers aside."""

    language = KRL

    def __init__(self, file: FilePath, robot: RobotModel | None = None) -> None:
        super().__init__(file, robot)
        self._is_initialised = False
        # Of the block that is read: whether it has poses, and which of them are smooth.
        self._by_poses = False
        self._smooth: list[bool] = []

    @override
    def actions(self) -> Mapping[str, Callable[..., None]]:
        return {
            **super().actions(),
            "initialise": self._initialise,
            "base": self._set_base,
            "joint approach": self._joint_approach,
            "linear approach": self._linear_approach,
            "axis block": self._begin_block,
            "pose block": lambda: self._begin_block(by_poses=True),
            "times": self._begin_times,
            "joint": self._take_axes,
            "linear": self._take_pose,
            "spline": lambda **values: self._take_pose(is_smooth=True, **values),
            "circular": self._take_arc,
            "part": self._take_part,
            "trigger": self._take_trigger,
            "whole": self._end_times,
            "close": self._end_block,
        }

    @property
    @override
    def is_carried(self) -> bool | None:
        return bool(self.settings["unit"]) if "work" in self.settings else None

    @override
    def check(self, kind: str) -> None:
        if self.state == "time" and kind in ("joint", "spline", "linear"):
            if self._by_poses != (kind != "joint"):
                raise self.lines.fault("SPLINE has SPL and SLIN, PTP_SPLINE has SPTP")
            if self.run and not self.run[-1].seconds:
                raise self.lines.fault("the target before has no TIME_BLOCK PART")

    def _initialise(self) -> None:
        """Take that all settings begin anew, which has to come before anything is set."""
        if self.settings or self._is_initialised:
            raise self.lines.fault(
                "BAS(#INITMOV, 0) after frames, speeds or the load were set, expected it once and "
                "first: it may set them back"
            )
        self._is_initialised = True

    def _set_base(self, work: SE3, unit: str = "") -> None:
        """Take $BASE, all of it: one without a kinematic system stands in the world again."""
        self.settings["work"] = work
        self.settings["unit"] = unit

    def _joint_approach(self, axes: list[float]) -> None:
        """Take where the motion begins, or where it slowly goes on by axis targets."""
        facts = self.comments.facts()
        most = FULL_SPEED if facts is None else FULL_SPEED * facts.approach
        share = {name: self.settings.get(name, 0.0) for name in ("VEL", "ACC")}
        fast = [name for name, value in share.items() if not 0.0 < value <= most + _SAME_TIME]
        if fast:
            raise self.lines.fault(
                f"PTP goes to where the motion goes on at BAS(#{fast[0]}_PTP) of "
                f"{share[fast[0]]:g} %, expected up to {most:g}: nothing has judged it"
            )
        self.approach(axes)

    def _linear_approach(self, pose: Pose) -> None:
        """Take the pose from which the motion goes on by poses."""
        speed = self.settings.get("speed", 0.0)
        turning = max(self.settings.get(name, 0.0) for name in _TURNINGS)
        if not (0.0 < speed <= APPROACH_SPEED and turning <= APPROACH_TURNING):
            raise self.lines.fault(
                f"LIN goes to where the motion goes on at {speed:g} m/s and {turning:g}°/s, "
                f"expected at most {APPROACH_SPEED:g} m/s and {APPROACH_TURNING:g}°/s: nothing "
                f"has judged it"
            )
        self.approach(pose)

    def _begin_block(self, *, by_poses: bool = False) -> None:
        self._by_poses, self._smooth = by_poses, []

    def _begin_times(self) -> None:
        if self.run:
            raise self.lines.fault("a time block after segments without times")

    def _take_axes(self, axes: list[float]) -> None:
        self.run.append(Target(axes))

    def _take_pose(
        self, pose: Pose, speed: float | None = None, *, is_smooth: bool = False
    ) -> None:
        """Take a straight or smooth segment: with a time in a time block, else at a speed."""
        if self.state == "time":
            self.run.append(Target(pose))
        else:
            self._take_at_speed(pose, None, speed, is_smooth=is_smooth)

    def _take_arc(self, via: Pose, pose: Pose, speed: float | None = None) -> None:
        """Take a circular segment at a speed."""
        if not {"orientation", "circles"} <= set(self.settings):
            raise self.lines.fault(
                "SCIRC needs $ORI_TYPE = #VAR and $CIRC_TYPE = #BASE at the head: else the tool "
                "turns otherwise"
            )
        self._take_at_speed(pose, via, speed)

    def _take_at_speed(
        self, pose: Pose, via: Pose | None, speed: float | None, *, is_smooth: bool = False
    ) -> None:
        """Take a segment at a speed, in a block or alone."""
        alone = self.state == "body"
        if alone:
            self._begin_block(by_poses=True)
        if not self._by_poses:
            raise self.lines.fault("PTP_SPLINE has SPTP with times")
        tool_speed = self.settings.get("speed", 0.0) if speed is None else speed
        if not tool_speed > 0.0:
            raise self.lines.fault("a segment without a time, expected $VEL.CP before it")
        turning = {name: self.settings.get(name, UNBOUND_TURNING) for name in _TURNINGS}
        slow = [name for name, value in turning.items() if value < UNBOUND_TURNING]
        if slow:
            raise self.lines.fault(
                f"$VEL.{slow[0]} is {turning[slow[0]]:g}°/s, expected at least "
                f"{UNBOUND_TURNING:g}: a slower one holds the tool back from its speed"
            )
        self.run.append(Target(pose, speed=tool_speed, via=via))
        self._smooth.append(is_smooth)
        if alone:
            self.stop(is_spline=is_smooth)

    def _take_part(self, seconds: float) -> None:
        """Take the share of time of the target before."""
        if not self.run or self.run[-1].seconds:
            raise self.lines.fault("there is no target before this part")
        self.run[-1].seconds = seconds

    def _take_trigger(self, output: str = "", value: bool | None = None, event: str = "") -> None:
        """Take an output or event at the target that follows."""
        self.add_switch(Switch(0.0, output or event.strip(), value), ahead=1)

    def _end_times(self, seconds: float) -> None:
        """Take the time of all targets, and end their motion."""
        if not self.run or not self.run[-1].seconds:
            raise self.lines.fault("each target needs its TIME_BLOCK PART")
        parts = sum(target.seconds for target in self.run)
        share = seconds / parts
        # Parts are shares: those that are seconds stay what they are.
        scale = 1.0 if abs(share - 1.0) * parts < _SAME_TIME else share
        for target in self.run:
            target.seconds *= scale
        self._check_triggers()
        if self._by_poses:
            self._check_in_time()
        else:
            self._check_axis_speeds()
        self.stop()

    def _check_triggers(self) -> None:
        if any(number > len(self.run) for number, _ in self.run_switches):
            raise self.lines.fault("a trigger has no target after it")

    def _check_axis_speeds(self) -> None:
        """Refuse shares of speeds in force that hold the axes back from the times of a block."""
        for name in ("VEL", "ACC"):
            share = self.settings.get(name, 0.0)
            if share < FULL_SPEED:
                raise self.lines.fault(
                    f"BAS(#{name}_PTP) before this block is {share:g} %, expected "
                    f"{FULL_SPEED:g}: less holds the axes back from their times"
                )

    def _check_in_time(self) -> None:
        """Refuse speeds in force that hold the tool back from the times of a block."""
        poses = [place for place in self._run_places() if isinstance(place, Pose)]
        if len(poses) == len(self.run):
            # It begins at axis targets, which `stop` refuses.
            return
        positions = np.array([pose.position for pose in poses])
        quaternions = aligned_quaternions(np.array([pose.quaternion for pose in poses]))
        times = times_of([target.seconds for target in self.run])
        fast, turning = largest_tool_speeds(times, positions, quaternions)
        speed = self.settings.get("speed", 0.0)
        least = min(self.settings.get(name, 0.0) for name in _TURNINGS)
        if fast > speed:
            raise self.lines.fault(
                f"times ask for {fast:.4g} m/s, $VEL.CP is {speed:g} m/s: it holds the tool "
                f"back from its times"
            )
        if np.degrees(turning) > least:
            raise self.lines.fault(
                f"times ask for {np.degrees(turning):.4g}°/s, $VEL.ORI1 or $VEL.ORI2 is "
                f"{least:g}°/s: it holds the tool back from its times"
            )

    def _end_block(self) -> None:
        """End a spline block: one of segments at speeds stops there."""
        if self.state == "ended":
            return
        if not self.run:
            raise self.lines.fault("the spline block has no segments")
        if len(set(self._smooth)) > 1:
            raise self.lines.fault("SPL beside SLIN or SCIRC is not judged, expected SLIN")
        self._check_triggers()
        self.stop(is_spline=self._smooth[0])
