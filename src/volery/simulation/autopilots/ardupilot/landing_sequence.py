"""Landing sequence of a copter's mission: the items after DO_LAND_START, which the mode AUTO_RTL flies.

The mode is AUTO under another name: it begins at the nearest start of a landing, and becomes AUTO as soon as
an item is chosen that precedes every such start.
"""

from __future__ import annotations

from math import dist

from volery.simulation.autopilots.ardupilot.commands import to_mode
from volery.simulation.autopilots.ardupilot.feature import Feature
from volery.simulation.autopilots.ardupilot.mission import fly_mission
from volery.simulation.autopilots.ardupilot.modes import AUTO, AUTO_BITS, AUTO_RTL, LEVEL_AND_HEIGHT, enter
from volery.simulation.autopilots.manoeuvres.onboard_mission_flight import item_point
from volery.simulation.autopilots.onboard_mission import LAND_START
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle, Mode
from volery.trace.events import INFO, WARNING

SEQUENCE_SWITCH = 99
"""RCn_OPTION."""


def nearest_landing(vehicle: AutopilotVehicle) -> int | None:
    """Return the index of the nearest DO_LAND_START, or ``None`` without one or without a position.

    A start without a place counts as where the next item is that navigates.
    """
    if not vehicle.has_position:
        return None
    items, here = vehicle.mission.items, vehicle.estimate.position
    distances: dict[int, float] = {}
    for index, item in enumerate(items):
        if item.command != LAND_START:
            continue
        following = next((later for later in items[index:] if later.navigates), None)
        place = item if item.has_place else following
        if place is not None:
            distances[index] = dist(here, item_point(vehicle, place))
    return min(distances, key=lambda index: distances[index], default=None)


def leave_sequence(vehicle: AutopilotVehicle) -> None:
    """Go on in AUTO once an item before every start of a landing has been chosen; called at each tick."""
    if vehicle.mode.number != AUTO_RTL:
        return
    passed = vehicle.mission.items[: vehicle.mission.current + 1]
    if not any(item.command == LAND_START for item in passed):
        vehicle.enter_mode(vehicle.rules.modes[AUTO])


def enter_sequence(vehicle: AutopilotVehicle, mode: Mode) -> bool:
    """Enter AUTO_RTL at the nearest start of a landing, also from a later place of the sequence."""
    start = nearest_landing(vehicle)
    if start is None:
        vehicle.send_text(WARNING, "Unable to start landing sequence")
        vehicle.send_text(WARNING, "Mode change to AUTO RTL failed: No landing sequence found")
        return False
    plan = vehicle.mission
    before, complete = plan.current, plan.complete
    vehicle.choose_item(start)
    vehicle.send_text(INFO, "Landing sequence start")
    if enter(vehicle, mode):
        return True
    plan.current, plan.complete = before, complete
    return False


COPTER = Feature(
    modes=(
        Mode(
            AUTO_RTL,
            "AUTO_RTL",
            AUTO_BITS,
            fly_mission,
            LEVEL_AND_HEIGHT,
            needs_position=True,
            armable=False,
            starts_high=True,
        ),
    ),
    mode_switches={SEQUENCE_SWITCH: AUTO_RTL},
    entries={AUTO_RTL: enter_sequence},
    commands={LAND_START: to_mode("AUTO_RTL")},
    on_tick=leave_sequence,
)
