"""Which commands a simulated autopilot accepts without doing anything: all of MAV_CMD, tried one by one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from enum import Enum
from typing import Any

from pymavlink.dialects.v20 import all as dialect

from rigs.station import Station

ACCEPTED, UNSUPPORTED = 0, 3
COMMANDS = tuple(sorted(number for number in dialect.enums["MAV_CMD"] if number))

ZEROS, ONE, ONES = (0.0,) * 7, (1.0,), (1.0,) * 7
OF_THE_RUN = frozenset({"kernel", "flight", "output", "rules", "restart", "tuning", "vehicle", "parameters"})
"""Attributes that are no state of the vehicle, or follow from it."""
DEEPEST = 6


def fingerprint(value: Any, depth: int = 0) -> Any:
    """What there is to compare of a state: plain values, and those of its attributes and elements."""
    if isinstance(value, int | float | str | bytes | Enum | None):
        return repr(value)
    if depth > DEEPEST or callable(value):
        return type(value).__name__
    if isinstance(value, Mapping):
        return {key: fingerprint(one, depth + 1) for key, one in value.items()}
    if isinstance(value, Iterable):
        return [fingerprint(one, depth + 1) for one in value]
    slots = (name for cls in type(value).__mro__ for name in getattr(cls, "__slots__", ()))
    own = getattr(value, "__dict__", None) or {name: getattr(value, name, None) for name in slots}
    state = {key: one for key, one in own.items() if key.lstrip("_") not in OF_THE_RUN}
    return type(value).__name__, {key: fingerprint(one, depth + 1) for key, one in state.items()}


Trial = tuple[tuple[float, ...], Callable[[Any], object]]
"""Parameters of a command, and what is done with the vehicle before."""


def without_effect(
    make: Callable[[], Station], unasked: Iterable[str], examples: Mapping[int, Trial]
) -> set[int]:
    """Commands that are accepted although no trial of them changes the vehicle or is answered by a message.

    Args:
        make: Makes a vehicle at rest, in which nothing is under way.
        unasked: Messages that come at any rate.
        examples: Trials where zeros and ones ask for nothing of a vehicle at rest.
    """
    usual = {"COMMAND_ACK", "HEARTBEAT", *unasked}
    found = set()
    first = make()
    for number in COMMANDS:
        parameters = (ZEROS, ONE, ONES, *(examples[number][:1] if number in examples else ()))
        answers = [first.command(number, *ZEROS)]
        if answers[0] != UNSUPPORTED:
            answers += [first.command(number, *one) for one in parameters[1:]]
        if ACCEPTED not in answers:
            continue
        accepted = (one for one, answer in zip(parameters, answers, strict=False) if answer == ACCEPTED)
        trials: list[Trial] = [(one, fingerprint) for one in accepted]
        trials += [examples[number]] if number in examples else []
        if not any(_acts(make(), number, trial, usual) for trial in reversed(trials)):
            found.add(number)
        first = make()
    return found


def _acts(rig: Station, number: int, trial: Trial, usual: set[str]) -> bool:
    parameters, prepare = trial
    prepare(rig)
    before, changes = fingerprint(rig.vehicle), rig.vehicle.parameters.changes
    count = len(rig.received)
    rig.command(number, *parameters)
    heard = {one.name for one in rig.received[count:]} - usual
    return bool(heard) or rig.vehicle.parameters.changes > changes or fingerprint(rig.vehicle) != before
