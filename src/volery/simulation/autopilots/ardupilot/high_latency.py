"""ArduPilot's links of high latency, such as satellite modems: HIGH_LATENCY2, and what switches them on.

A link whose SERIALn_PROTOCOL is 43 at the boot carries HIGH_LATENCY2 every five seconds instead of
heartbeats, and nothing at all until CONTROL_HIGH_LATENCY. Source: GCS_Common and GCS_Mavlink of the vehicles.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot

from volery.simulation.autopilots.ardupilot import sensor_status, telemetry
from volery.simulation.autopilots.ardupilot.feature import Feature, Kept, build_of
from volery.simulation.autopilots.mavlink.firmware import HighLatency
from volery.simulation.autopilots.mavlink.messages import ACCEPTED, FAILED, Command, Fields, boot_ms
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle
from volery.trace.events import NOTICE

CONTROL_HIGH_LATENCY = 2600
PROTOCOL = 43
"""SERIALn_PROTOCOL of such a link."""
SERIAL_PORTS = range(1, 8)
NO_TEMPERATURE = -128

FAILURES = {
    sensor_status.GPS: 1 << 0,
    sensor_status.DIFFERENTIAL_PRESSURE: 1 << 1,
    sensor_status.PRESSURE: 1 << 2,
    sensor_status.ACCELEROMETERS: 1 << 3,
    sensor_status.GYROSCOPES: 1 << 4,
    sensor_status.MAG: 1 << 5,
    sensor_status.TERRAIN: 1 << 6,
    sensor_status.BATTERY: 1 << 7,
    sensor_status.RC_RECEIVER: 1 << 8,
    sensor_status.GEOFENCE: 1 << 11,
    sensor_status.AHRS: 1 << 12,
}
"""Bit of HL_FAILURE_FLAG by that of MAV_SYS_STATUS_SENSOR."""


@dataclass
class HighLatencyLinks:
    """Links of high latency."""

    on: bool = False
    """Whether a command has switched them on."""


links_of = Kept(HighLatencyLinks)


def links(vehicle: AutopilotVehicle) -> frozenset[int]:
    """Return the numbers of the links that SERIALn_PROTOCOL makes links of high latency."""
    return frozenset(
        port for port in SERIAL_PORTS if vehicle.parameters[f"SERIAL{port}_PROTOCOL"] == PROTOCOL
    )


def on_control(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle CONTROL_HIGH_LATENCY: param1 is 1 to switch the links on, 0 to switch them off."""
    if command.param1 not in (0.0, 1.0):
        return FAILED
    links_of(vehicle).on = command.param1 == 1.0
    vehicle.send_text(NOTICE, f"High Latency {'enabled' if links_of(vehicle).on else 'disabled'}")
    return ACCEPTED


def _byte(value: float) -> int:
    return min(255, max(0, int(value)))


def _built(vehicle: AutopilotVehicle, name: str) -> Fields:
    """Return a message of which there is always one."""
    built = build_of(vehicle).telemetry[name](vehicle)
    return built[0] if isinstance(built, list) else built or {}


def report(vehicle: AutopilotVehicle) -> Fields:
    """Return HIGH_LATENCY2."""
    status, hud, beat = (_built(vehicle, name) for name in ("SYS_STATUS", "VFR_HUD", "HEARTBEAT"))
    latitude, longitude, amsl = vehicle.estimate.geodetic
    base_mode = beat["base_mode"]
    healthy = status["onboard_control_sensors_health"]
    return {
        "timestamp": boot_ms(vehicle),
        "type": beat["type"],
        "autopilot": 3,
        "custom_mode": vehicle.mode.number,
        "latitude": round(latitude * 1e7),
        "longitude": round(longitude * 1e7),
        "altitude": int(amsl),
        "heading": hud["heading"] // 2,
        "throttle": hud["throttle"],
        "airspeed": _byte(hud["airspeed"] * 5.0),
        "groundspeed": _byte(hud["groundspeed"] * 5.0),
        "temperature_air": NO_TEMPERATURE,
        "battery": status["battery_remaining"],
        "wp_num": vehicle.mission.current,
        "failure_flags": sum(flag for sensor, flag in FAILURES.items() if not healthy & sensor),
        "custom0": (base_mode + 128) % 256 - 128,
        **(_copter_targets(vehicle) if vehicle.flies else _rover_targets(vehicle)),
    }


def _copter_targets(vehicle: AutopilotVehicle) -> Fields:
    target = telemetry.nav_controller(vehicle)
    return {
        "target_altitude": int(vehicle.estimate.geodetic[2] + target.get("alt_error", 0.0)),
        "target_heading": target.get("target_bearing", 0) // 2,
        "target_distance": target.get("wp_dist", 0) // 10,
        "airspeed_sp": _byte(hypot(*vehicle.setpoint.velocity) * 5.0),
        "wind_heading": 90,  # half the direction of no wind, as sent by the original
    }


def _rover_targets(vehicle: AutopilotVehicle) -> Fields:
    """Return them in the modes that the autopilot steers; the wanted speed is the measured one, as there."""
    if not vehicle.mode.controls:
        return {}
    target = telemetry.nav_controller(vehicle)
    return {
        "target_heading": target.get("target_bearing", 0) // 2,
        "target_distance": target.get("wp_dist", 0) // 10,
        "airspeed_sp": _byte(_built(vehicle, "VFR_HUD")["airspeed"] * 5.0),
    }


COPTER = ROVER = Feature(
    parameters={
        f"SERIAL{port}_PROTOCOL": ("", "43: link of that number is of high latency, from the next boot on")
        for port in SERIAL_PORTS
    },
    commands={CONTROL_HIGH_LATENCY: on_control},
    telemetry={"HIGH_LATENCY2": report},
    high_latency=HighLatency(links, muted=lambda vehicle: not links_of(vehicle).on),
)
