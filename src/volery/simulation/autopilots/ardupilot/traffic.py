"""Other aircraft near an ArduCopter: which are a threat, and what the copter does (AVD_ parameters).

Reports are ADSB_VEHICLE, and GLOBAL_POSITION_INT of other systems; one counts for five seconds. The laws are
those of ArduPilot's AP_Avoidance and AP_ADSB, with their mixed units where they show: the height between
two aircraft is taken in centimetres beside rates in m/s.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import hypot, radians
from typing import Any

from volery.base.elementary import cos, sin
from volery.base.frames import Vector
from volery.base.time import Ns, S
from volery.simulation.autopilots.ardupilot.feature import ArmingCheck, Feature, Kept
from volery.simulation.autopilots.ardupilot.modes import AUTO_BITS, LEVEL_AND_HEIGHT, change_mode, disarm
from volery.simulation.autopilots.manoeuvres.guided_flight import Guided
from volery.simulation.autopilots.manoeuvres.manual_flight import ManualFlight
from volery.simulation.autopilots.manoeuvres.onboard_mission_flight import FlyMission
from volery.simulation.autopilots.onboard_mission import GLOBAL
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle, Mode

BY_ADSB, BY_POSITION = 0, 1
"""MAV_COLLISION_SRC."""
NO_THREAT, LOW, HIGH = 0, 1, 2
"""MAV_COLLISION_THREAT_LEVEL."""
NONE, REPORT, CLIMB_OR_DESCEND, MOVE_LEVEL, MOVE_AWAY, RETURN, HOVER = range(7)
"""AVD_F_ACTION, which is MAV_COLLISION_ACTION."""
RESUME, RETURN_AFTER, RESUME_AUTO = 1, 2, 3
"""AVD_F_RCVRY."""
AUTO, LOITER, RTL, LAND, AVOID_ADSB = 3, 5, 6, 9, 19
"""Numbers of modes."""

OUTDATED = 5 * S
"""Age of a report from which its aircraft is no threat [ns]."""
RECOVERY = 2 * S
"""Least time at a level before a lower one [ns]."""
REPORT_EVERY, CLEARED_FOR = S, 5 * S
"""Period of COLLISION, and how long it goes on after the threat [ns]."""
VALID_PLACE = 0b11
"""Flags of ADSB_VEHICLE: position and altitude."""
LARGEST_ADDRESS = 0xFFFFFF
SLOW = 1.0
"""Speed of another aircraft below which the copter flies straight away from it [m/s]."""


@dataclass
class Aircraft:
    """Another aircraft: its last report, and the threat that it is. Lengths in metres, times in ns."""

    place: Vector
    """North, east, down about the estimator's origin."""
    velocity: Vector
    """North, east, down [m/s]."""
    at: Ns
    """Time of the report."""
    level: int = 0
    """MAV_COLLISION_THREAT_LEVEL."""
    nearest: float = 0.0
    """Least horizontal distance to come."""
    nearest_height: float = 0.0
    """Least vertical distance to come."""
    time: float = 0.0
    """Time until the least horizontal distance [s]."""
    reported_at: Ns = NEVER


@dataclass
class TrafficState:
    """Other aircraft, and the response to the most serious threat. Times in ns."""

    others: dict[tuple[int, int], Aircraft] = field(default_factory=dict)
    """By the kind of report and the address or system id."""
    level: int = 0
    """Level of threat that the vehicle responds to."""
    level_since: Ns = NEVER
    action: int = 0
    """MAV_COLLISION_ACTION that was last possible."""
    active: bool = False
    """Whether avoidance acts."""
    mode_before: int = 0
    """Number of the mode before avoidance."""
    mode_entered: int | None = None
    """Number of the mode that avoidance has entered."""
    threatened_at: Ns = NEVER
    """When a threat was last reported."""


traffic_of = Kept(TrafficState)


def on_adsb(vehicle: AutopilotVehicle, fields: dict[str, Any], _sender: int) -> None:
    """Handle ADSB_VEHICLE."""
    p, address, now = vehicle.parameters, fields["ICAO_address"], vehicle.kernel.now()
    placed = fields["flags"] & VALID_PLACE and (fields["lat"] or fields["lon"])
    if not p["ADSB_TYPE"] or not placed or address > LARGEST_ADDRESS or address == p["ADSB_ICAO_ID"] > 0:
        return
    place = vehicle.point(GLOBAL, fields["lat"] / 1e7, fields["lon"] / 1e7, fields["altitude"] / 1000.0)
    here, radius, height = vehicle.estimate.position, p["ADSB_LIST_RADIUS"], p["ADSB_LIST_ALT"]
    far = vehicle.has_position and 0.0 < radius < hypot(place[0] - here[0], place[1] - here[1])
    if far or (vehicle.has_position and 0.0 < height < abs(place[2] - here[2])):
        return
    speed, course = fields["hor_velocity"] / 100.0, radians(fields["heading"] / 100.0)
    velocity = (speed * cos(course), speed * sin(course), -fields["ver_velocity"] / 100.0)
    _note(vehicle, (BY_ADSB, address), Aircraft(place, velocity, now - fields["tslc"] * S))


def on_position(vehicle: AutopilotVehicle, fields: dict[str, Any], sender: int) -> None:
    """Handle GLOBAL_POSITION_INT of another system."""
    if sender != vehicle.system:
        place = vehicle.point(GLOBAL, fields["lat"] / 1e7, fields["lon"] / 1e7, fields["alt"] / 1000.0)
        velocity = (fields["vx"] / 100.0, fields["vy"] / 100.0, fields["vz"] / 100.0)
        _note(vehicle, (BY_POSITION, sender), Aircraft(place, velocity, vehicle.kernel.now()))


def _note(vehicle: AutopilotVehicle, key: tuple[int, int], seen: Aircraft) -> None:
    """Keep a report; where AVD_OBS_MAX aircraft are known already, in place of the oldest."""
    others = traffic_of(vehicle).others
    if not vehicle.parameters["AVD_ENABLE"]:
        return
    if key in others:
        seen.reported_at = others[key].reported_at
    elif len(others) >= vehicle.parameters["AVD_OBS_MAX"]:
        oldest = min(others, key=lambda one: others[one].at, default=None)
        if oldest is None or others[oldest].at >= seen.at:
            return
        del others[oldest]
    others[key] = seen


def update_traffic(vehicle: AutopilotVehicle) -> None:
    """Find the most serious threat, act on it and report it, at each tick."""
    traffic = traffic_of(vehicle)
    if not vehicle.parameters["AVD_ENABLE"]:
        if traffic.others:
            traffic.others.clear()
            _recover(vehicle, RETURN_AFTER)
        return
    if not vehicle.has_position:
        return
    now = vehicle.kernel.now()
    for key in [key for key, one in traffic.others.items() if now - one.at > OUTDATED]:
        del traffic.others[key]
    for one in traffic.others.values():
        _judge(vehicle, one)
    worst = min(
        traffic.others, key=lambda key: (-traffic.others[key].level, traffic.others[key].time), default=None
    )
    threat = None if worst is None else traffic.others[worst]
    _respond(vehicle, threat)
    if worst is not None and threat is not None:
        _report(vehicle, worst, threat)


def is_threatened(vehicle: AutopilotVehicle) -> bool:
    """Return whether avoidance acts on a threat."""
    return traffic_of(vehicle).active


# -- threats


def _judge(vehicle: AutopilotVehicle, other: Aircraft) -> None:
    """Set the level of a threat, and the closest approach."""
    p = vehicle.parameters
    age = (vehicle.kernel.now() - other.at) // S
    soon, later = p["AVD_F_TIME"] + age, p["AVD_W_TIME"] + age
    level, near = HIGH, _nearest_level(vehicle, other, soon)
    if near >= p["AVD_F_DIST_XY"]:
        near = _nearest_level(vehicle, other, later)
        level = LOW if near < p["AVD_W_DIST_XY"] else NO_THREAT
    above = _nearest_height(vehicle, other, later)
    if level and above > p["AVD_W_DIST_Z"]:
        level = NO_THREAT
    elif level:
        above = _nearest_height(vehicle, other, soon)
        level = LOW if above > p["AVD_F_DIST_Z"] else level
    here, own = vehicle.estimate.position, vehicle.estimate.velocity
    other.level, other.nearest, other.nearest_height = level, near, above
    to_go = hypot(other.place[0] - here[0], other.place[1] - here[1]) - near
    speed = hypot(other.velocity[0] - own[0], other.velocity[1] - own[1])
    other.time = to_go / speed if to_go and speed else 0.0


def _nearest_level(vehicle: AutopilotVehicle, other: Aircraft, horizon: float) -> float:
    """Return the least horizontal distance [m] within *horizon* [s] at the present velocities."""
    here, own = vehicle.estimate.position, vehicle.estimate.velocity
    gap = (here[0] - other.place[0], here[1] - other.place[1])
    path = ((other.velocity[0] - own[0]) * horizon, (other.velocity[1] - own[1]) * horizon)
    length = path[0] * path[0] + path[1] * path[1]
    share = min(1.0, max(0.0, (gap[0] * path[0] + gap[1] * path[1]) / length)) if length else 0.0
    return hypot(gap[0] - share * path[0], gap[1] - share * path[1])


def _nearest_height(vehicle: AutopilotVehicle, other: Aircraft, horizon: float) -> float:
    """Return the least vertical distance [m] within *horizon* [s], as AP_Avoidance computes it."""
    above_cm = 100.0 * (vehicle.estimate.position[2] - other.place[2])
    sinking = other.velocity[2] - vehicle.estimate.velocity[2]
    if above_cm * sinking >= 0.0:
        return abs(above_cm) / 100.0
    return abs(above_cm - sinking * horizon) / 100.0


# -- response


def _respond(vehicle: AutopilotVehicle, threat: Aircraft | None) -> None:
    """Follow the level upwards at once and downwards slowly, and act on a high one."""
    p, traffic, now = vehicle.parameters, traffic_of(vehicle), vehicle.kernel.now()
    level = threat.level if threat is not None else NO_THREAT
    action = round(p["AVD_F_ACTION"]) if level == HIGH else NONE
    lowest = p["AVD_F_ALT_MIN"]
    if action != NONE and lowest > 0.0 and vehicle.estimate.geodetic[2] < lowest:
        action = REPORT
    if level > traffic.level or (level < traffic.level and now - traffic.level_since > RECOVERY):
        if traffic.level == HIGH:
            _recover(vehicle, round(p["AVD_F_RCVRY"]))
            traffic.action = NONE
        traffic.level, traffic.level_since = level, now
    if threat is not None and traffic.level == HIGH and action > REPORT:
        traffic.action = _act(vehicle, threat, action)


def _act(vehicle: AutopilotVehicle, threat: Aircraft, action: int) -> int:
    """Avoid another aircraft, and return the action that was possible."""
    traffic = traffic_of(vehicle)
    begins = not traffic.active
    if begins:
        traffic.active, traffic.mode_before = True, vehicle.mode.number
    if vehicle.mode.number == LAND:
        return NONE
    if _may_disarm(vehicle):
        disarm(vehicle, force=True)
        return NONE
    if action in (RETURN, HOVER):
        entered = not begins or _enter(vehicle, RTL if action == RETURN else LOITER)
        return action if entered else NONE
    if begins and vehicle.mode.number != AVOID_ADSB:
        _enter(vehicle, AVOID_ADSB)
    guided = vehicle.manoeuvre
    if vehicle.mode.number != AVOID_ADSB or not isinstance(guided, Guided):
        return NONE
    velocity = _escape(vehicle, threat, action)
    if velocity is None:
        return NONE
    guided.follow_velocity(velocity)
    return action


def _may_disarm(vehicle: AutopilotVehicle) -> bool:
    """Return whether a failsafe may stop the motors: on the ground, or in manual flight without throttle."""
    if vehicle.kernel.now() - vehicle.arming.armed_at < vehicle.rules.arming.motors_rest:
        return True
    if vehicle.mode.name in ("STABILIZE", "ACRO"):
        return vehicle.landed or ManualFlight(vehicle).pilot.throttle <= 0.0
    flown = vehicle.manoeuvre
    return vehicle.landed and not (isinstance(flown, FlyMission) and flown.started)


def _enter(vehicle: AutopilotVehicle, mode: int) -> bool:
    entered = change_mode(vehicle, mode)
    if entered:
        traffic_of(vehicle).mode_entered = mode
    return entered


def _escape(vehicle: AutopilotVehicle, threat: Aircraft, action: int) -> Vector | None:
    """Return the velocity away from an aircraft, north, east, down [m/s]; ``None``: no direction is away."""
    tuning = vehicle.tuning
    stays = vehicle.height < tuning.return_height
    here, place, velocity = vehicle.estimate.position, threat.place, threat.velocity
    if action == CLIMB_OR_DESCEND:
        if here[2] < place[2]:
            return 0.0, 0.0, -tuning.speed_up
        return 0.0, 0.0, 0.0 if stays else tuning.speed_down
    if action not in (MOVE_LEVEL, MOVE_AWAY):
        return None
    north, east, down = here[0] - place[0], here[1] - place[1], here[2] - place[2]
    if hypot(*velocity) < SLOW:
        down *= 100.0
    else:
        square = velocity[0] * velocity[0] + velocity[1] * velocity[1] + velocity[2] * velocity[2]
        along = (north * velocity[0] + east * velocity[1] + down * velocity[2]) / square
        north, east, down = (
            north - along * velocity[0],
            east - along * velocity[1],
            down - along * velocity[2],
        )
    down = 0.0 if action == MOVE_LEVEL else down
    size = hypot(north, east, down)
    if not size:
        return None
    sink = (
        0.0 if stays and down > 0.0 else down / size * (tuning.speed_down if down > 0.0 else tuning.speed_up)
    )
    return north / size * tuning.speed, east / size * tuning.speed, sink


def _recover(vehicle: AutopilotVehicle, recovery: int) -> None:
    """End avoidance; unless the mode was changed meanwhile, enter the one that AVD_F_RCVRY names."""
    traffic = traffic_of(vehicle)
    if not traffic.active:
        return
    traffic.active = False
    entered, traffic.mode_entered = traffic.mode_entered, None
    if vehicle.mode.number != entered:
        return
    wanted = {RESUME: traffic.mode_before, RETURN_AFTER: RTL}.get(recovery)
    if recovery == RESUME_AUTO and traffic.mode_before == AUTO:
        wanted = AUTO
    if wanted is not None:
        any(change_mode(vehicle, mode) for mode in (wanted, RTL, LAND))


def _report(vehicle: AutopilotVehicle, key: tuple[int, int], threat: Aircraft) -> None:
    """Send COLLISION once a second, for some seconds after the threat, too."""
    traffic, now = traffic_of(vehicle), vehicle.kernel.now()
    if threat.level != NO_THREAT:
        traffic.threatened_at = now
    if now - traffic.threatened_at > CLEARED_FOR or now - threat.reported_at <= REPORT_EVERY:
        return
    threat.reported_at = now
    fields = {
        "src": BY_ADSB,
        "id": key[1],
        "action": traffic.action,
        "threat_level": threat.level,
        "time_to_minimum_delta": threat.time,
        "altitude_minimum_delta": threat.nearest_height,
        "horizontal_minimum_delta": threat.nearest,
    }
    vehicle.output.send_event("COLLISION", fields)


COPTER = Feature(
    parameters={
        "ADSB_ICAO_ID": ("", "address of the vehicle itself, which is no other aircraft"),
        "ADSB_LIST_ALT": ("m", "difference of height from which other aircraft do not count; 0: any counts"),
        "ADSB_LIST_RADIUS": ("m", "distance from which other aircraft do not count; 0: any counts"),
        "ADSB_TYPE": ("", "any value but 0: ADSB_VEHICLE counts"),
        "AVD_ENABLE": ("", "any value but 0: other aircraft are avoided"),
        "AVD_F_ACTION": (
            "",
            "2 climbs or descends, 3 moves away level, 4 in three axes, 5 returns, 6 hovers",
        ),
        "AVD_F_ALT_MIN": ("m", "height above the sea below which other aircraft are reported only; 0: none"),
        "AVD_F_RCVRY": ("", "mode after that: 0 stays, 1 the one before, 2 RTL, 3 AUTO if it was that"),
        "AVD_OBS_MAX": ("", "number of other aircraft"),
        **{
            f"AVD_{level}_{limit}": (
                unit,
                f"{words} of a threat that is {'avoided' if level == 'F' else 'reported'}",
            )
            for level in "FW"
            for limit, unit, words in (
                ("TIME", "s", "time ahead"),
                ("DIST_XY", "m", "horizontal distance"),
                ("DIST_Z", "m", "vertical distance"),
            )
        },
    },
    modes=(
        Mode(
            AVOID_ADSB, "AVOID_ADSB", AUTO_BITS, Guided, LEVEL_AND_HEIGHT, needs_position=True, armable=False
        ),
    ),
    messages={"ADSB_VEHICLE": on_adsb, "GLOBAL_POSITION_INT": on_position},
    checks=(ArmingCheck("ADSB threat detected", is_threatened),),
    on_tick=update_traffic,
)
