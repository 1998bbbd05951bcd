"""Outputs that a program switches, compared with the events of its job."""

from collections.abc import Iterator
from itertools import combinations

from selfmotion.shop.controllers.controller_program import ControllerProgram, Switch
from selfmotion.shop.controllers.program_texts import plain
from selfmotion.work.job import Program, are_opposite

# Tolerance of the times of outputs, which are switched at targets [s].
_SWITCHING_TOLERANCE = 1e-3


def switching_faults(program: ControllerProgram, planned: object) -> tuple[str, ...]:
    """Return the differences between the outputs of a controller's program and its job's events.

    Only a job has events: of a plan, parts or a move each output is a difference.
    """
    if isinstance(planned, Program):
        return tuple(_job_switching_faults(planned, program))
    return tuple(
        f"'{switch.output}' is switched at {switch.at:.4f} s, and the motion has no events"
        for switch in program.switches
    )


def _job_switching_faults(job: Program, program: ControllerProgram) -> Iterator[str]:
    """Yield what of a job's events a program does not switch, or switches otherwise."""
    events = sorted(job.events, key=lambda event: event[0])
    switched = sorted(program.switches, key=lambda switch: switch.at)
    stated = None if program.facts is None else program.facts.outputs
    if events and stated is None:
        yield "its head does not say which output each event switches: write the program again"
    if len(events) != len(switched):
        yield f"it switches {len(switched)} times, the job {len(events)} times"
        return
    switches: dict[str, Switch] = {}
    for (at, seam, event), switch in zip(events, switched, strict=True):
        if abs(at - switch.at) > _SWITCHING_TOLERANCE:
            yield (
                f"event '{event}' of '{seam}' is at {at:.4f} s, but '{switch.output}' is switched "
                f"at {switch.at:.4f} s"
            )
        if switch.value is None and switch.output != plain(event):
            yield f"event '{event}' of '{seam}' is called '{switch.output}'"
        if stated is not None and plain(event) in stated:
            meant = stated[plain(event)]
            if meant is None and switch.value is not None:
                yield f"event '{event}' is a comment only, but '{switch.output}' is switched"
            if meant is not None and meant != (switch.output, switch.value):
                yield (
                    f"event '{event}' switches '{switch.output}' to {switch.value} at "
                    f"{switch.at:.4f} s, it was written to switch '{meant[0]}' to {meant[1]}"
                )
        elif stated is not None:
            yield f"its head does not say which output event '{event}' switches"
        before = switches.setdefault(event, switch)
        if before[1:] != switch[1:]:
            yield (
                f"event '{event}' switches '{before.output}' to {before.value} once, and "
                f"'{switch.output}' to {switch.value} at {switch.at:.4f} s"
            )
    for (one, first), (other, second) in combinations(switches.items(), 2):
        if first.value is not None and first[1:] == second[1:] and are_opposite(one, other):
            yield f"events '{one}' and '{other}' both switch '{first.output}' to {first.value}"
