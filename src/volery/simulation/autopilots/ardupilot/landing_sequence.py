"""Landing sequence of a copter's mission: the items after DO_LAND_START, which the mode AUTO_RTL flies.

The mode is AUTO under another name: it begins at the nearest start of a landing, and becomes AUTO as soon as
an item is chosen that precedes every such start.
"""

from __future__ import annotations

from math import dist

from volery.simulation.autopilots.manoeuvres.onboard_mission_flight import item_point
from volery.simulation.autopilots.onboard_mission import LAND_START
from volery.simulation.autopilots.vehicle_state import Vehicle

AUTO, AUTO_RTL = 3, 27
"""Numbers of the modes."""


def nearest_landing(vehicle: Vehicle) -> int | None:
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


def leave_sequence(vehicle: Vehicle) -> None:
    """Go on in AUTO once an item before every start of a landing has been chosen; called at each tick."""
    if vehicle.mode.number != AUTO_RTL:
        return
    passed = vehicle.mission.items[: vehicle.mission.current + 1]
    if not any(item.command == LAND_START for item in passed):
        vehicle.enter_mode(vehicle.rules.modes[AUTO])
