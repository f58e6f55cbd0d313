"""Phases of a flight, found in the trace of a run that nothing disturbs: when a fault campaign injects.

States show what every autopilot does alike: arming, take-off, cruise, hover, landing and the contact with the
ground; of a vehicle on the ground arming, drive and halt. What else was asked of a vehicle is a phase under
the name of its operation.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from math import hypot
from typing import Final

import numpy as np
import numpy.typing as npt

from volery.base.time import Ns
from volery.trace.events import Event, Operation, VehicleState

Flags = npt.NDArray[np.bool_]

ARMING, TAKE_OFF, CRUISE, HOVER, LANDING, CONTACT = (
    "arming", "take-off", "cruise", "hover", "landing", "ground contact",
)  # fmt: skip
DRIVE, HALT = "drive", "halt"
ORDER: Final = (ARMING, TAKE_OFF, CRUISE, HOVER, DRIVE, HALT, LANDING, CONTACT)

SHOWN_BY_STATES: Final = {"wait_ready", "arm", "takeoff", "goto", "land", "disarm"}
"""Operations that the phases above are about."""

ABOVE_GROUND_M: Final = 0.5
STILL_M_S: Final = 0.3
"""Speed below which a vehicle hovers, halts, or neither climbs nor descends."""

Phases = Mapping[str, Mapping[str, Ns]]
"""Time of each phase by its name and by vehicle, ns from the start of the run. ``EVERYWHERE`` as the vehicle:
the phase of everything."""

EVERYWHERE: Final = ""


def flight_phases(events: Iterable[Event], on_ground: Collection[str] = ()) -> Phases:
    """Return a time in each phase of a run, by its name and by vehicle.

    The time is the middle of the longest stretch, for arming and the contact with the ground the first
    moment. A phase that a vehicle does not go through is missing.

    Args:
        events: Events of the trace; others than ``VehicleState`` and ``Operation`` are left alone.
        on_ground: Names of the vehicles that do not fly.
    """
    states: dict[str, list[VehicleState]] = {}
    asked: dict[tuple[str, str], tuple[Ns, Ns]] = {}
    for event in events:
        if isinstance(event, VehicleState):
            states.setdefault(event.vehicle, []).append(event)
        elif isinstance(event, Operation) and event.operation not in SHOWN_BY_STATES:
            key = (event.operation, event.vehicle)
            start, end = asked.get(key, (0, 0))
            if event.end - event.start > end - start:
                asked[key] = (event.start, event.end)
    found: dict[str, dict[str, Ns]] = {name: {} for name in ORDER}
    for vehicle, seen in states.items():
        for name, at in _of_vehicle(seen, flies=vehicle not in on_ground):
            found[name][vehicle] = at
    for (operation, vehicle), (start, end) in asked.items():
        found.setdefault(operation, {})[vehicle] = (start + end) // 2
    return {name: times for name, times in found.items() if times}


def _of_vehicle(states: list[VehicleState], *, flies: bool) -> Iterable[tuple[str, Ns]]:
    """Yield name and time of the phases of one vehicle."""
    armed = np.array([state.armed for state in states])
    if not armed.any():
        return
    first, last = int(np.argmax(armed)), len(states) - 1
    yield ARMING, states[first].at
    along = np.array([hypot(state.vx, state.vy) for state in states])
    up = np.array([state.vz for state in states])
    fast = along >= max(0.5 * float(along[armed].max()), STILL_M_S)
    still = np.hypot(along, up) < STILL_M_S
    if not flies:
        yield from _stretches(states, {DRIVE: armed & fast, HALT: armed & still})
        return
    heights = np.array([state.where()[2] for state in states])
    aloft = armed & (heights > min(heights[first], heights[last]) + ABOVE_GROUND_M)
    if not aloft.any():
        return
    lifted, landed = int(np.argmax(aloft)), last - int(np.argmax(aloft[::-1])) + 1
    levelled = lifted + int(np.argmax(up[lifted:landed] < STILL_M_S))
    sinks = lifted + int(np.max(np.flatnonzero(up[lifted:landed] > -STILL_M_S), initial=0)) + 1
    middle = np.zeros_like(aloft)
    middle[levelled:sinks] = True
    between = {CRUISE: aloft & middle & fast, HOVER: aloft & middle & still}
    yield TAKE_OFF, (states[lifted].at + states[levelled].at) // 2
    yield from _stretches(states, between)
    if landed <= last:  # the run does not end in the air
        yield LANDING, (states[sinks].at + states[landed].at) // 2
        resting = heights[landed:] <= heights[last] + STILL_M_S
        yield CONTACT, states[landed + int(np.argmax(resting))].at


def _stretches(states: list[VehicleState], phases: Mapping[str, Flags]) -> Iterable[tuple[str, Ns]]:
    """Yield the middle of the longest stretch in which each phase lasts."""
    for name, flags in phases.items():
        edges = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False])).astype(int)))
        stretches = [
            (states[end - 1].at - states[begin].at, begin, end) for begin, end in edges.reshape(-1, 2)
        ]
        if stretches:
            _, begin, end = max(stretches, key=lambda one: (one[0], -one[1]))
            yield name, (states[begin].at + states[end - 1].at) // 2
