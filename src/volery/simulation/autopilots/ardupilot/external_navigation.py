"""External navigation: poses from a companion computer as position source of EKF3 (6, ExternalNav).

Laws, times and texts are those of AP_VisualOdom_MAV, GCS_Common and AP_NavEKF3. Velocities (VELXY, VELZ) are
not taken. The real estimator uses poses before it has an origin, without a place in degrees; this one begins
with the origin.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import Any

from volery.base.elementary import cbrt
from volery.base.time import MS, Ns, S
from volery.simulation.autopilots.ardupilot.boot import for_both_units
from volery.simulation.autopilots.ardupilot.estimator_sources import sources_of
from volery.simulation.autopilots.ardupilot.feature import ArmingCheck, Feature, Kept
from volery.simulation.autopilots.ardupilot.parameter_checks import EXTERNAL, GPS
from volery.simulation.autopilots.ardupilot.telemetry import EKF_ALIGNED_AFTER
from volery.simulation.autopilots.external_aiding import (
    AidingPose,
    ExternalAiding,
    Fusion,
    place_origin,
    pose_of,
)
from volery.simulation.autopilots.mavlink.messages import Fields
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle
from volery.trace.events import INFO, WARNING

HEALTHY_FOR: Ns = 300 * MS
"""AP_VISUALODOM_TIMEOUT_MS."""
RETRY_AFTER: Ns = 7 * S
"""posRetryTimeNoVel_ms: all poses were refused for that time, and the estimate is reset to one."""
STOPS_AFTER: Ns = 15 * S
"""tiltDriftTimeMax_ms: none has been fused for that time, and aiding stops."""
LARGEST_SIGMA = 10.0
DRIFT = 0.105, 0.04
"""Standard deviations of velocity [m/s] and acceleration [m/s^2] of an estimate without poses.

Fitted to jumps of 2, 3 and 5 m, which ArduCopter 4.6.3 in its own simulator took after 2.0, 3.4 and 4.6 s.
"""


@dataclass
class NavigationState:
    """External navigation of one vehicle."""

    kind: int | None = None
    """VISO_TYPE that the vehicle has booted with; ``None``: not known yet."""
    aiding: ExternalAiding = field(default_factory=ExternalAiding)
    chosen: bool = False
    """Whether the chosen set of sources takes the position from poses."""
    begun: bool = False
    """Whether it was said that they are used."""


navigation_of = Kept(NavigationState)


def _kind(vehicle: AutopilotVehicle) -> int:
    state = navigation_of(vehicle)
    if state.kind is None:
        state.kind = round(vehicle.parameters["VISO_TYPE"])
    return state.kind


def _source(vehicle: AutopilotVehicle, of: str) -> int:
    """Return the source of a quantity in the chosen set."""
    return round(vehicle.parameters[f"EK3_SRC{sources_of(vehicle).number}_{of}"])


def position_error(pose: AidingPose) -> float:
    """Return the standard deviation of a pose [m]: the cube root of the sum of its squared variances."""
    north, east, down = pose.variances[:3]
    return cbrt(north * north + east * east + down * down)


def _fusion(vehicle: AutopilotVehicle, pose: AidingPose) -> Fusion:
    p = vehicle.parameters
    sigma = min(max(position_error(pose), p["VISO_POS_M_NSE"], 0.01), LARGEST_SIGMA)
    return Fusion(
        sigmas=(sigma, max(0.1, sigma) if _source(vehicle, "POSZ") == EXTERNAL else 0.0),
        heading=_source(vehicle, "YAW") == EXTERNAL,
        delay=round(p["VISO_DELAY_MS"]) * MS,
        gate=max(1.0, p["EK3_POS_I_GATE"] / 100.0),
        together=True,
        retry=RETRY_AFTER,
        drift=DRIFT,
    )


def on_pose(vehicle: AutopilotVehicle, fields: dict[str, Any], _sender: int, *, name: str) -> None:
    """Handle VISION_POSITION_ESTIMATE and ODOMETRY."""
    pose = pose_of(name, fields)
    if not _kind(vehicle) or pose is None:
        return
    state = navigation_of(vehicle)
    age = state.aiding.age(vehicle, pose)
    state.aiding.note_received(vehicle)
    if not state.chosen or vehicle.uptime() < EKF_ALIGNED_AFTER:
        return
    if not state.begun:
        state.begun = True
        place = "{:.1f},{:.1f},{:.1f}".format(*pose.position)
        for text in (
            *for_both_units("EKF3 IMU{unit} is using external nav data"),
            *for_both_units(f"EKF3 IMU{{unit}} initial pos NED = {place} (m)"),
        ):
            vehicle.send_text(INFO, text)
    if state.aiding.origin:
        state.aiding.fuse(vehicle, pose, age, _fusion(vehicle, pose))


def on_origin(vehicle: AutopilotVehicle, fields: dict[str, Any], _sender: int) -> None:
    """Handle SET_GPS_GLOBAL_ORIGIN."""
    if place_origin(vehicle, navigation_of(vehicle).aiding, fields):
        vehicle.output.send_message("GPS_GLOBAL_ORIGIN")


def follow_source(vehicle: AutopilotVehicle) -> None:
    """Take the position from poses while the chosen set says so, and stop aiding when they stay away."""
    state, now = navigation_of(vehicle), vehicle.kernel.now()
    aiding, by_poses = state.aiding, vehicle.estimate.by_poses
    if not aiding.origin and vehicle.estimate.position_ok and not by_poses:
        aiding.origin = True
    source = _source(vehicle, "POSXY")
    chosen = source == EXTERNAL and bool(_kind(vehicle))
    if chosen and not by_poses:
        vehicle.flight.use_poses()
    elif state.chosen and not chosen:
        vehicle.flight.use_gps(source == GPS)
        aiding.used = state.begun = False
    state.chosen = chosen
    if not chosen:
        return
    if aiding.used and now - aiding.passed_at > STOPS_AFTER:
        aiding.used = state.begun = False
        vehicle.flight.use_gps(False)
        for text in for_both_units("EKF3 IMU{unit} stopped aiding"):
            vehicle.send_text(WARNING, text)


def _unhealthy(vehicle: AutopilotVehicle) -> bool:
    """Return whether no pose has come for a moment, though there should be some."""
    received = navigation_of(vehicle).aiding.received_at
    silent = received == NEVER or vehicle.kernel.now() - received > HEALTHY_FOR
    return bool(_kind(vehicle)) and silent


def _origin(vehicle: AutopilotVehicle) -> list[Fields]:
    """Return GPS_GLOBAL_ORIGIN for an origin that a user has set, while the core does not send it."""
    sent = vehicle.home is not None and vehicle.position_ok
    if not navigation_of(vehicle).aiding.placed or sent:
        return []
    latitude, longitude, amsl = vehicle.estimate.origin
    place = {"latitude": round(latitude * 1e7), "longitude": round(longitude * 1e7)}
    return [{**place, "altitude": round(amsl * 1000.0), "time_usec": vehicle.uptime() // 1000}]


COPTER = ROVER = Feature(
    parameters={
        "VISO_TYPE": ("", "any value but 0: poses are taken, from the next boot on"),
        "VISO_DELAY_MS": ("ms", "time that is subtracted from the time of a pose"),
        "VISO_POS_M_NSE": ("m", "least standard deviation of a pose"),
    },
    messages={
        **{name: partial(on_pose, name=name) for name in ("VISION_POSITION_ESTIMATE", "ODOMETRY")},
        "SET_GPS_GLOBAL_ORIGIN": on_origin,
    },
    checks=(ArmingCheck("VisOdom: not healthy", _unhealthy),),
    on_tick=follow_source,
    extends={"GPS_GLOBAL_ORIGIN": _origin},
)
