"""FOLLOW: a copter keeps its place beside another vehicle, as ArduCopter's mode of that name does.

The position comes as GLOBAL_POSITION_INT or FOLLOW_TARGET of the system FOLL_SYSID, and counts for three
seconds, carried on by its velocity. The law is that of ArduCopter's mode_follow.cpp: the velocity of the
other vehicle plus a share of the distance, limited so that the copter can stop.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, radians
from typing import Any

from volery.base.elementary import atan2
from volery.base.frames import Vector, quaternion_to_euler, turn_clockwise
from volery.base.time import Ns, S, to_seconds
from volery.simulation.autopilots.ardupilot.feature import Feature, Kept
from volery.simulation.autopilots.ardupilot.modes import AUTO_BITS, LEVEL_AND_HEIGHT, enter
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.simulation.autopilots.manoeuvres.to_point import root_speed
from volery.simulation.autopilots.mavlink.messages import all_within
from volery.simulation.autopilots.onboard_mission import GLOBAL, GLOBAL_RELATIVE
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle, FlightManoeuvre, Mode
from volery.trace.events import INFO, WARNING

OUTDATED: Ns = 3 * S
"""Age from which a position does not count."""
FORGOTTEN: Ns = 10 * S
"""Age from which another vehicle may be followed, if FOLL_SYSID is 0."""
UNKNOWN_HEADING = 36_000
"""Larger values of ``hdg`` are no heading."""
HAS_POSITION, HAS_VELOCITY, HAS_ATTITUDE = 1, 2, 8
"""Bits of ``est_capabilities``."""
FACE_LEAD, AS_LEAD, ALONG_FLIGHT = 1, 2, 3
"""FOLL_YAW_BEHAVE."""
FOLLOW, FOLLOW_SWITCH = 23, 57
"""Number of the mode, and value of RCn_OPTION."""


@dataclass
class LeadState:
    """Another vehicle that this one may follow, as it last reported itself."""

    system: int = 0
    """System that was chosen where none is named."""
    at: Ns = NEVER
    """Time of the report [ns]."""
    place: Vector = (0.0, 0.0, 0.0)
    """North, east, down about the estimator's origin [m], as ``velocity`` [m/s]."""
    velocity: Vector = (0.0, 0.0, 0.0)
    heading: float = 0.0
    """Clockwise from north [rad], and the time [ns] at which it was last reported."""
    heading_at: Ns = NEVER


lead_of = Kept(LeadState)


def _is_followed(vehicle: AutopilotVehicle, sender: int) -> bool:
    """Return whether FOLL_SYSID names that system; 0 is the first that reports its position."""
    lead = lead_of(vehicle)
    if not vehicle.parameters["FOLL_ENABLE"] or sender == vehicle.system:
        return False
    named = round(vehicle.parameters["FOLL_SYSID"])
    if named:
        return sender == named
    if lead.system not in (0, sender) and vehicle.kernel.now() - lead.at <= FORGOTTEN:
        return False
    lead.system = sender
    return True


def on_position(vehicle: AutopilotVehicle, fields: dict[str, Any], sender: int) -> None:
    """Handle GLOBAL_POSITION_INT of another vehicle."""
    lead = lead_of(vehicle)
    if (fields["lat"] == 0 and fields["lon"] == 0) or not _is_followed(vehicle, sender):
        return
    relative = vehicle.parameters["FOLL_ALT_TYPE"] == 1.0
    frame, height = (GLOBAL_RELATIVE, "relative_alt") if relative else (GLOBAL, "alt")
    lead.place = vehicle.point(frame, fields["lat"] / 1e7, fields["lon"] / 1e7, fields[height] / 1000.0)
    lead.velocity = (fields["vx"] / 100.0, fields["vy"] / 100.0, fields["vz"] / 100.0)
    lead.at = vehicle.kernel.now()
    if fields["hdg"] <= UNKNOWN_HEADING:
        lead.heading, lead.heading_at = radians(fields["hdg"] / 100.0), lead.at


def on_target(vehicle: AutopilotVehicle, fields: dict[str, Any], sender: int) -> None:
    """Handle FOLLOW_TARGET."""
    lead, given = lead_of(vehicle), fields["est_capabilities"]
    unusable = (fields["lat"] == 0 and fields["lon"] == 0) or not given & HAS_POSITION
    if unusable or not all_within((fields["alt"], *fields["vel"])) or not _is_followed(vehicle, sender):
        return
    lead.place = vehicle.point(GLOBAL, fields["lat"] / 1e7, fields["lon"] / 1e7, fields["alt"])
    north, east, down = fields["vel"] if given & HAS_VELOCITY else (0.0, 0.0, 0.0)
    lead.velocity = (north, east, down)
    lead.at = vehicle.kernel.now()
    w, x, y, z = fields["attitude_q"]
    if given & HAS_ATTITUDE and all_within((w, x, y, z)):
        lead.heading, lead.heading_at = quaternion_to_euler((w, x, y, z))[2], lead.at


def _turned(vector: Vector, angle: float) -> Vector:
    """Turn a vector clockwise about the down axis by *angle* [rad]."""
    return *turn_clockwise(vector[:2], angle), vector[2]


class Follow(FlightManoeuvre):
    """Keep the place beside the other vehicle; without its position, stop.

    Args:
        vehicle: The vehicle.
    """

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        super().__init__(vehicle)
        self._kept: Vector | None = None
        """Place beside the other vehicle that is kept where FOLL_OFS_X, _Y and _Z are 0."""
        self._by_heading = False
        """Whether that place turns with the heading of the other vehicle."""

    def step(self) -> None:
        """Give a velocity, and a heading as FOLL_YAW_BEHAVE says."""
        vehicle, tuning = self.vehicle, self.vehicle.tuning
        now = vehicle.kernel.now()
        lead = lead_of(vehicle)
        velocity: Vector = (0.0, 0.0, 0.0)
        yaw = None
        self.target = None
        if now - lead.at <= OUTDATED:
            age = to_seconds(now - lead.at)
            here = vehicle.estimate.position
            to_lead: Vector = (
                lead.place[0] + lead.velocity[0] * age - here[0],
                lead.place[1] + lead.velocity[1] * age - here[1],
                lead.place[2] + lead.velocity[2] * age - here[2],
            )
            offset = self._offset(lead, to_lead)
            if offset is not None:
                missing = (to_lead[0] + offset[0], to_lead[1] + offset[1], to_lead[2] + offset[2])
                self.target = (here[0] + missing[0], here[1] + missing[1], here[2] + missing[2])
                velocity = self._velocity(lead, missing)
                yaw = self._heading(lead, to_lead, velocity)
        vehicle.drive(
            Setpoint(
                Control.VELOCITY,
                velocity=velocity,
                yaw=yaw,
                speed=vehicle.commanded.speed or tuning.speed,
                speed_up=vehicle.commanded.speed_up or tuning.speed_up,
                speed_down=vehicle.commanded.speed_down or tuning.speed_down,
                accel=tuning.accel,
                accel_z=tuning.accel_z,
                tilt=tuning.tilt,
            )
        )

    def _offset(self, lead: LeadState, to_lead: Vector) -> Vector | None:
        """Return the place to keep, north, east, down of the other vehicle [m]; ``None``: not now."""
        vehicle, parameters = self.vehicle, self.vehicle.parameters
        farthest = parameters["FOLL_DIST_MAX"]
        if farthest > 0.0 and hypot(*to_lead) > farthest:
            return None
        knows_heading = vehicle.kernel.now() - lead.heading_at <= OUTDATED
        by_heading = parameters["FOLL_OFS_TYPE"] == 1.0
        offset: Vector = (parameters["FOLL_OFS_X"], parameters["FOLL_OFS_Y"], parameters["FOLL_OFS_Z"])
        if offset == (0.0, 0.0, 0.0):
            if self._kept is None:
                away = (-to_lead[0], -to_lead[1], -to_lead[2])
                self._by_heading = by_heading and knows_heading
                self._kept = _turned(away, -lead.heading) if self._by_heading else away
                words = "Relative" if self._by_heading else "N-E-D"
                vehicle.send_text(INFO, f"{words} follow offset loaded")
            offset, by_heading = self._kept, self._by_heading
        if not by_heading:
            return offset
        return _turned(offset, lead.heading) if knows_heading else None

    def _velocity(self, lead: LeadState, missing: Vector) -> Vector:
        """Return the velocity [m/s] that closes a distance [m], both north, east, down."""
        vehicle, tuning = self.vehicle, self.vehicle.tuning
        gain = vehicle.parameters["FOLL_POS_P"]
        north, east = lead.velocity[0] + gain * missing[0], lead.velocity[1] + gain * missing[1]
        down = lead.velocity[2] + gain * missing[2]
        speed = hypot(north, east)
        stops = root_speed(hypot(missing[0], missing[1]), tuning.accel / 2.0)
        fastest = min(vehicle.commanded.speed or tuning.speed, stops)
        share = min(1.0, fastest / speed) if speed > 0.0 else 0.0
        stops = root_speed(abs(missing[2]), tuning.accel_z / 2.0)
        return north * share, east * share, min(tuning.speed_down, stops, max(-tuning.speed_up, -stops, down))

    def _heading(self, lead: LeadState, to_lead: Vector, velocity: Vector) -> float | None:
        behaviour = self.vehicle.parameters["FOLL_YAW_BEHAVE"]
        if behaviour == FACE_LEAD and hypot(to_lead[0], to_lead[1]) > 1.0:
            return atan2(to_lead[1], to_lead[0])
        if behaviour == AS_LEAD and self.vehicle.kernel.now() - lead.heading_at <= OUTDATED:
            return lead.heading
        if behaviour == ALONG_FLIGHT and hypot(velocity[0], velocity[1]) > 1.0:
            return atan2(velocity[1], velocity[0])
        return None


def _enter_follow(vehicle: AutopilotVehicle, mode: Mode) -> bool:
    if vehicle.parameters["FOLL_ENABLE"] or mode is vehicle.mode:
        return enter(vehicle, mode)
    vehicle.send_text(WARNING, "Set FOLL_ENABLE = 1")
    return enter(vehicle, mode, "init failed")


COPTER = Feature(
    parameters={
        "FOLL_ENABLE": ("", "any value but 0: FOLLOW may be entered"),
        "FOLL_SYSID": ("", "system that FOLLOW follows; 0: the first that reports its position"),
        "FOLL_DIST_MAX": ("m", "distance beyond which it is not followed; 0: none"),
        "FOLL_ALT_TYPE": ("", "1: its height above home counts, 0: above the sea"),
        "FOLL_OFS_TYPE": ("", "1: the place beside it turns with its heading"),
        "FOLL_POS_P": ("1/s", "speed for each metre that is missing"),
        "FOLL_YAW_BEHAVE": (
            "",
            "1 turns the nose to it, 2 takes its heading, 3 turns the nose where it flies",
        ),
        **{f"FOLL_OFS_{axis}": ("m", "place beside it; all 0: the place at the start") for axis in "XYZ"},
    },
    modes=(Mode(FOLLOW, "FOLLOW", AUTO_BITS, Follow, LEVEL_AND_HEIGHT, needs_position=True, armable=False),),
    mode_switches={FOLLOW_SWITCH: FOLLOW},
    entries={FOLLOW: _enter_follow},
    avoiding=("FOLLOW",),
    messages={"FOLLOW_TARGET": on_target, "GLOBAL_POSITION_INT": on_position},
)
