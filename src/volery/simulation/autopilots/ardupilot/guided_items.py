"""GUIDED within a mission of ArduPilot: the item NAV_GUIDED_ENABLE hands the vehicle to a companion computer.

Targets then count as in the mode GUIDED. The item ends at a limit that DO_GUIDED_LIMITS has set before it;
without limits it ends only when a rover comes near the item's place. The original rover also sends that place
to the companion computer, which is not done here.
"""

from __future__ import annotations

from math import hypot
from typing import NamedTuple

from volery.base.time import from_seconds
from volery.simulation.autopilots.ardupilot.feature import Feature, MissionCommand
from volery.simulation.autopilots.ardupilot.rover import guided_arrived, guided_stale
from volery.simulation.autopilots.manoeuvres.guided_flight import Guided
from volery.simulation.autopilots.manoeuvres.onboard_mission_flight import Leg
from volery.simulation.autopilots.manoeuvres.rover_driving import GuidedRover
from volery.simulation.autopilots.onboard_mission import GUIDED_ENABLE, GUIDED_LIMITS, MissionItem
from volery.simulation.autopilots.state_groups import CommandedLimits
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle, FlightManoeuvre


class GuidedLimits(NamedTuple):
    """Limits at which a mission takes the vehicle back from a companion computer; 0: none."""

    commanded: CommandedLimits
    """Limits of the mode in which they were set: they hold until it changes."""
    seconds: float = 0.0
    lowest: float = 0.0
    """Height [m] above the estimator's origin, as ``highest``."""
    highest: float = 0.0
    distance: float = 0.0
    """Horizontal distance [m] from where it was handed over."""


def set_limits(vehicle: AutopilotVehicle, item: MissionItem) -> None:
    """Execute DO_GUIDED_LIMITS: whole seconds, least and largest height, and distance; 0: no limit."""
    limits = int(item.param1), item.param2, item.param3, item.param4
    vehicle.kept[GuidedLimits] = GuidedLimits(vehicle.commanded, *limits)


def copter_guided_leg(vehicle: AutopilotVehicle, item: MissionItem) -> Leg:
    """Return the leg of NAV_GUIDED_ENABLE of a copter."""
    return _leg(vehicle, item, Guided(vehicle))


def rover_guided_leg(vehicle: AutopilotVehicle, item: MissionItem) -> Leg:
    """Return the leg of NAV_GUIDED_ENABLE of a rover, which is at its end near the item's place, too."""
    leg = _leg(vehicle, item, GuidedRover(vehicle, guided_arrived, guided_stale))
    if not item.has_place:
        return leg
    north, east, _ = vehicle.point(item.frame, item.x / 1e7, item.y / 1e7, item.z)

    def near() -> bool:
        here = vehicle.estimate.position
        return hypot(north - here[0], east - here[1]) <= vehicle.tuning.waypoint_radius

    return Leg(leg.manoeuvre, lambda: leg.done() or near())


def _leg(vehicle: AutopilotVehicle, item: MissionItem, guided: FlightManoeuvre) -> Leg:
    begun, start = vehicle.kernel.now(), vehicle.estimate.position
    limits: GuidedLimits | None = vehicle.kept.get(GuidedLimits)
    if limits is None or limits.commanded is not vehicle.commanded:
        limits = GuidedLimits(vehicle.commanded)
    enables = int(item.param1) > 0

    def ended() -> bool:
        north, east, down = vehicle.estimate.position
        return (
            not enables
            or 0 < from_seconds(limits.seconds) <= vehicle.kernel.now() - begun
            or (limits.lowest != 0.0 and -down < limits.lowest)
            or (limits.highest != 0.0 and -down > limits.highest)
            or 0.0 < limits.distance < hypot(north - start[0], east - start[1])
        )

    return Leg(guided, ended)


COPTER = Feature(
    items={
        GUIDED_ENABLE: MissionCommand("GuidedEnable", leg=copter_guided_leg, keeps_frame=True),
        GUIDED_LIMITS: MissionCommand("GuidedLimits", set_limits),
    }
)
ROVER = Feature(
    items={
        **COPTER.items,
        GUIDED_ENABLE: MissionCommand("GuidedEnable", leg=rover_guided_leg, keeps_frame=True),
    }
)
