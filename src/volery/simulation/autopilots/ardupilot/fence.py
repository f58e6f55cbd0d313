"""ArduPilot's fence: its limits, the arming checks, and the response to a breach.

The fence is also checked while disarmed. A breach counts anew once the vehicle is 20 m further out. The floor
counts only after DO_FENCE_ENABLE or its switch, not by FENCE_ENABLE alone. A guided point beyond the fence is
ignored without a text. ``avoidance`` slows the vehicle down before the fence.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from math import hypot, inf

from volery.base.frames import Vector
from volery.base.time import MS, Ns
from volery.simulation.autopilots.ardupilot.feature import Feature, Kept, MissionCommand, as_command
from volery.simulation.autopilots.ardupilot.fence_points import (
    FENCE,
    clear_if_emptied,
    on_fence_fetch,
    on_fence_point,
)
from volery.simulation.autopilots.ardupilot.fence_shapes import shapes
from volery.simulation.autopilots.ardupilot.modes import change_mode, disarm, first_of
from volery.simulation.autopilots.manoeuvres.manual_flight import Stabilize
from volery.simulation.autopilots.mavlink.messages import ACCEPTED, FAILED, Command, Fields, to_uint32
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle
from volery.trace.events import NOTICE

CEILING, CIRCLE, POLYGON, FLOOR = 1, 2, 4, 8
"""Bits of FENCE_TYPE."""

NO_BREACH, BELOW, ABOVE, BOUNDARY = 0, 1, 2, 3
"""FENCE_BREACH."""

GIVE_UP = 100.0
"""Distance beyond the fence [m] at which a copter lands and a rover stops."""

BACKUP = 20.0
"""Distance [m] after which a breach counts anew."""

Respond = Callable[[AutopilotVehicle, float], None]
"""Responds to a new breach at a distance beyond the fence [m]."""
FENCE_ENABLE, FENCE_SWITCH = 207, 11
"""MAV_CMD, and value of RCn_OPTION."""
SENSOR = 1 << 20
"""MAV_SYS_STATUS_SENSOR of the fence."""


@dataclass
class FenceState:
    """Breaches of the fence."""

    floor: bool = False
    """Whether the floor counts."""
    breached: dict[int, float] = field(default_factory=dict)
    """Limits beyond which the vehicle is, to the distance beyond [m] at which the breach counts anew."""
    count: int = 0
    """Number of breaches."""
    breached_at: Ns = 0
    """Uptime of the last of them [ns]."""


fence_of = Kept(FenceState)


def on_fence_enable(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_FENCE_ENABLE: 0 switches off, 1 on, the floor included."""
    if command.param1 not in (0.0, 1.0):
        return FAILED
    enable_fence(vehicle, on=command.param1 == 1.0)
    return ACCEPTED


def enable_fence(vehicle: AutopilotVehicle, *, on: bool) -> None:
    """Switch the fence and its floor on or off."""
    vehicle.parameters.set("FENCE_ENABLE", float(on))
    fence_of(vehicle).floor = on
    fence_of(vehicle).breached.clear()


def _types(vehicle: AutopilotVehicle) -> int:
    return round(vehicle.parameters["FENCE_TYPE"])


def _beyond(vehicle: AutopilotVehicle, point: Vector, *, floor: bool) -> dict[int, float]:
    """Return how far a point is beyond each limit.

    Args:
        vehicle: The vehicle, whose fence is on and whose home position is known.
        point: North, east, down about the estimator's origin [m].
        floor: Whether the floor counts.

    Returns:
        Distances [m] by bit of FENCE_TYPE, for those limits that the point is beyond; 0 for polygons.
    """
    home, types, parameters = vehicle.home, _types(vehicle), vehicle.parameters
    if home is None:
        return {}
    found: dict[int, float] = {}
    if vehicle.flies:
        height = home.ned[2] - point[2]
        if types & CEILING:
            found[CEILING] = height - parameters["FENCE_ALT_MAX"]
        if types & FLOOR and floor:
            found[FLOOR] = parameters["FENCE_ALT_MIN"] - height
    if types & CIRCLE:
        away = hypot(point[0] - home.ned[0], point[1] - home.ned[1])
        found[CIRCLE] = away - parameters["FENCE_RADIUS"]
    if types & POLYGON and not all(shape.admits((point[0], point[1])) for shape in shapes(vehicle)):
        found[POLYGON] = 0.0
    return {limit: distance for limit, distance in found.items() if distance >= 0.0}


def fence_admits(vehicle: AutopilotVehicle, point: Vector) -> bool:
    """Return whether a guided point may be flown to; a rover drives to any."""
    checked = vehicle.flies and vehicle.parameters["FENCE_ENABLE"]
    return not (checked and _beyond(vehicle, point, floor=True))


def check_fence(vehicle: AutopilotVehicle, respond: Respond) -> None:
    """Check the fence; respond to a new breach of an armed vehicle."""
    fence = fence_of(vehicle)
    clear_if_emptied(vehicle)
    if not vehicle.parameters["FENCE_ENABLE"]:
        fence.breached.clear()
        return
    if not vehicle.position_ok:
        return
    found = _beyond(vehicle, vehicle.estimate.position, floor=fence.floor)
    new = [limit for limit, distance in found.items() if distance >= fence.breached.get(limit, 0.0)]
    if new and not fence.breached:
        fence.breached_at = vehicle.uptime()
        vehicle.output.send_message("FENCE_STATUS")
    fence.count += len(new)
    renewed = {limit: inf if limit == POLYGON else found[limit] + BACKUP for limit in new}
    fence.breached = {limit: renewed.get(limit, fence.breached.get(limit, 0.0)) for limit in found}
    if new and vehicle.armed:
        respond(vehicle, max(found[limit] for limit in new))


def fence_status(vehicle: AutopilotVehicle) -> Fields | None:
    """Return FENCE_STATUS while the fence is enabled."""
    if not vehicle.parameters["FENCE_ENABLE"]:
        return None
    fence = fence_of(vehicle)
    kinds = {FLOOR: BELOW, CEILING: ABOVE, CIRCLE: BOUNDARY, POLYGON: BOUNDARY}
    return {
        "breach_status": int(bool(fence.breached)),
        "breach_count": fence.count % 65_536,
        "breach_type": next((kind for limit, kind in kinds.items() if limit in fence.breached), NO_BREACH),
        "breach_time": to_uint32(fence.breached_at // MS),
    }


# -- arming


def _first_problem(vehicle: AutopilotVehicle) -> str:
    """Return the text of the first check of the fence that fails; empty if none does."""
    parameters, types = vehicle.parameters, _types(vehicle)
    if not parameters["FENCE_ENABLE"]:
        return ""
    present = types & (CEILING | CIRCLE | FLOOR) or (types & POLYGON and vehicle.points.get(FENCE))
    if not present:
        return "Fences enabled, but none selected"
    radius, margin = parameters["FENCE_RADIUS"], parameters["FENCE_MARGIN"]
    if types & (CIRCLE | POLYGON) and not vehicle.has_position:
        return "Fence requires position"
    if radius < 0.0:
        return "Invalid FENCE_RADIUS value"
    if radius < margin:
        return "FENCE_MARGIN is less than FENCE_RADIUS"
    return _height_problem(vehicle, margin) if vehicle.flies else _breach_problem(vehicle, margin)


def _breach_problem(vehicle: AutopilotVehicle, margin: float) -> str:
    if fence_of(vehicle).breached:
        return "vehicle outside fence"
    return "Invalid FENCE_MARGIN value" if margin < 0.0 else ""


def _height_problem(vehicle: AutopilotVehicle, margin: float) -> str:
    ceiling, floor = vehicle.parameters["FENCE_ALT_MAX"], vehicle.parameters["FENCE_ALT_MIN"]
    if ceiling < 0.0:
        return "Invalid FENCE_ALT_MAX value"
    if floor < -100.0:
        return "Invalid FENCE_ALT_MIN value"
    problem = _breach_problem(vehicle, margin)
    if not problem and ceiling < floor:
        return "FENCE_ALT_MAX < FENCE_ALT_MIN"
    return "FENCE_MARGIN too big" if not problem and ceiling - floor <= 2.0 * margin else problem


_TEXTS = (
    "Fences enabled, but none selected",
    "Fence requires position",
    "Invalid FENCE_RADIUS value",
    "FENCE_MARGIN is less than FENCE_RADIUS",
    "Invalid FENCE_ALT_MAX value",
    "Invalid FENCE_ALT_MIN value",
    "vehicle outside fence",
    "Invalid FENCE_MARGIN value",
    "FENCE_ALT_MAX < FENCE_ALT_MIN",
    "FENCE_MARGIN too big",
)


FENCE_CHECKS = first_of(_TEXTS, _first_problem)
"""Arming checks of the fence; at most one of them fails."""

# -- response

RTL, LAND, BRAKE, SMART_RTL = 6, 9, 17, 21
COPTER_ACTIONS = {
    2: (LAND,),
    3: (SMART_RTL, RTL, LAND),
    4: (BRAKE, LAND),
    5: (SMART_RTL, LAND),
}
"""FENCE_ACTION to the modes of a copter that are tried in order; all other values: RTL, LAND."""


def respond_copter(vehicle: AutopilotVehicle, distance: float) -> None:
    """Respond as FENCE_ACTION demands; on the ground, or falling with the throttle closed, disarm."""
    if not vehicle.landed:
        vehicle.send_text(NOTICE, "Fence Breached")
    action = round(vehicle.parameters["FENCE_ACTION"])
    if not action:
        return
    closed = vehicle.mode.manual_throttle and Stabilize(vehicle).pilot.throttle <= 0.0
    falls = closed and "radio" not in vehicle.failsafes.active and CEILING not in fence_of(vehicle).breached
    if vehicle.landed or falls:
        disarm(vehicle, force=True)
        return
    modes = (LAND,) if distance > GIVE_UP else COPTER_ACTIONS.get(action, (RTL, LAND))
    any(change_mode(vehicle, mode) for mode in modes)


ROVER_HOLD, ROVER_RTL, ROVER_SMART_RTL = 4, 11, 12
ROVER_ACTIONS = {
    1: (ROVER_RTL, ROVER_HOLD),
    2: (ROVER_HOLD,),
    3: (ROVER_SMART_RTL, ROVER_RTL, ROVER_HOLD),
    4: (ROVER_SMART_RTL, ROVER_HOLD),
}
"""FENCE_ACTION to the modes of a rover that are tried in order."""
TERMINATE = 5


def respond_rover(vehicle: AutopilotVehicle, distance: float) -> None:
    """Respond as FENCE_ACTION demands, without a text."""
    action = round(vehicle.parameters["FENCE_ACTION"])
    if action == TERMINATE and distance <= GIVE_UP:
        disarm(vehicle, force=True)
    elif action:
        modes = (ROVER_HOLD,) if distance > GIVE_UP else ROVER_ACTIONS.get(action, ())
        any(change_mode(vehicle, mode) for mode in modes)


def _switch_fence(vehicle: AutopilotVehicle, position: int) -> None:
    enable_fence(vehicle, on=position > 0)


def _amend_status(vehicle: AutopilotVehicle, status: Fields) -> Fields:
    """Return SYS_STATUS with the fence: enabled if it acts, healthy if it is not breached."""
    if not vehicle.parameters["FENCE_ENABLE"]:
        return status
    enabled, healthy = status["onboard_control_sensors_enabled"], status["onboard_control_sensors_health"]
    return {
        **status,
        "onboard_control_sensors_enabled": enabled | (SENSOR if vehicle.parameters["FENCE_ACTION"] else 0),
        "onboard_control_sensors_health": healthy & ~SENSOR
        if fence_of(vehicle).breached
        else healthy | SENSOR,
    }


ROVER = Feature(
    parameters={
        "FENCE_ACTION": ("", "action beyond the fence; 0 only reports"),
        "FENCE_ENABLE": ("", "any value but 0 switches the fence on"),
        "FENCE_RADIUS": ("m", "circle of the fence about home"),
        "FENCE_TYPE": ("", "bits: 1 height, 2 circle, 4 polygons, 8 floor"),
        "FENCE_MARGIN": (
            "m",
            "distance that avoidance keeps from the fence; the limits have to leave room for it",
        ),
        "FENCE_TOTAL": ("", "number of points; 0 clears the fence"),
    },
    commands={FENCE_ENABLE: on_fence_enable},
    messages={"FENCE_POINT": on_fence_point},
    questions={"FENCE_FETCH_POINT": on_fence_fetch},
    items={FENCE_ENABLE: MissionCommand("FenceEnable", as_command(on_fence_enable))},
    switches={FENCE_SWITCH: _switch_fence},
    checks=FENCE_CHECKS,
    on_tick=partial(check_fence, respond=respond_rover),
    telemetry={"FENCE_STATUS": fence_status},
    amends={"SYS_STATUS": _amend_status},
)
COPTER = replace(
    ROVER,
    parameters={
        **ROVER.parameters,
        "FENCE_ALT_MAX": ("m", "ceiling of the fence above home"),
        "FENCE_ALT_MIN": ("m", "floor of the fence above home"),
    },
    on_tick=partial(check_fence, respond=respond_copter),
)
