"""Outputs that a program switches, compared with the events of its job.

An event of a job has a time and a name, such as 'arc on'. In a program it is an output that is
switched, or a comment with its name. The header of the program states which output each event
switches. So the outputs of a program are compared with the events in the order of their times, and
with the header.
"""

from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import NamedTuple

from selfmotion.shop.controllers.controller_program import ControllerProgram, Switch
from selfmotion.shop.controllers.program_texts import plain
from selfmotion.work.job import Program, are_opposite

# Tolerance of the times of outputs, which are switched at targets [s].
_SWITCHING_TOLERANCE = 1e-3


class _Event(NamedTuple):
    """An event of a job: its time since the start [s], the step it belongs to, and its name."""

    time: float
    step: str
    name: str


def switching_faults(program: ControllerProgram, planned: object) -> tuple[str, ...]:
    """Return the differences between the outputs that a program switches and its job's events.

    Only a job has events. Of anything else (a plan, parts, a move) each output is a difference.
    """
    if isinstance(planned, Program):
        return tuple(_event_faults(planned, program))
    return tuple(
        f"'{switch.output}' is switched at {switch.time:.4f} s, and the motion has no events"
        for switch in program.switches
    )


def _event_faults(job: Program, program: ControllerProgram) -> Iterator[str]:
    """Yield the events of a job that a program does not switch, or switches otherwise."""
    events = sorted((_Event(*event) for event in job.events), key=lambda event: event.time)
    switches = sorted(program.switches, key=lambda switch: switch.time)
    outputs = None if program.facts is None else program.facts.outputs
    if events and outputs is None:
        yield "its head does not say which output each event switches: write the program again"
    if len(events) != len(switches):
        yield f"it switches {len(switches)} times, the job {len(events)} times"
        return
    first_switches = dict[str, Switch]()
    for event, switch in zip(events, switches, strict=True):
        yield from _time_fault(event, switch)
        yield from _name_fault(event, switch)
        if outputs is not None:
            yield from _output_fault(event, switch, outputs)
        first = first_switches.setdefault(event.name, switch)
        yield from _repetition_fault(event, first, switch)
    yield from _opposite_faults(first_switches)


def _time_fault(event: _Event, switch: Switch) -> Iterator[str]:
    """Yield that an event is switched at another time."""
    if abs(event.time - switch.time) > _SWITCHING_TOLERANCE:
        yield (
            f"event '{event.name}' of '{event.step}' is at {event.time:.4f} s, but "
            f"'{switch.output}' is switched at {switch.time:.4f} s"
        )


def _name_fault(event: _Event, switch: Switch) -> Iterator[str]:
    """Yield that a comment in place of an output has another name than the event."""
    if switch.value is None and switch.output != plain(event.name):
        yield f"event '{event.name}' of '{event.step}' is called '{switch.output}'"


def _output_fault(
    event: _Event, switch: Switch, outputs: Mapping[str, tuple[str, bool] | None]
) -> Iterator[str]:
    """Yield that an event switches another output than the header states.

    `outputs` are those of the header: event → output and value, or None for a comment.
    """
    if plain(event.name) not in outputs:
        yield f"its head does not say which output event '{event.name}' switches"
        return
    expected = outputs[plain(event.name)]
    if expected is None:
        if switch.value is not None:
            yield f"event '{event.name}' is a comment only, but '{switch.output}' is switched"
    elif expected != (switch.output, switch.value):
        yield (
            f"event '{event.name}' switches '{switch.output}' to {switch.value} at "
            f"{switch.time:.4f} s, it was written to switch '{expected[0]}' to {expected[1]}"
        )


def _repetition_fault(event: _Event, first: Switch, switch: Switch) -> Iterator[str]:
    """Yield that an event switches otherwise than the first event of its name."""
    if (first.output, first.value) != (switch.output, switch.value):
        yield (
            f"event '{event.name}' switches '{first.output}' to {first.value} once, and "
            f"'{switch.output}' to {switch.value} at {switch.time:.4f} s"
        )


def _opposite_faults(first_switches: Mapping[str, Switch]) -> Iterator[str]:
    """Yield pairs of events, one to switch on and one to switch off, that do the same."""
    for (event, switch), (other_event, other) in combinations(first_switches.items(), 2):
        is_same = (switch.output, switch.value) == (other.output, other.value)
        if switch.value is not None and is_same and are_opposite(event, other_event):
            yield (
                f"events '{event}' and '{other_event}' both switch '{switch.output}' to "
                f"{switch.value}"
            )
