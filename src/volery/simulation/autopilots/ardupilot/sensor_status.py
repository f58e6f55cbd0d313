"""Which sensors ArduPilot reports in SYS_STATUS as present, enabled and healthy."""

from __future__ import annotations

from typing import NamedTuple

from volery.base.time import S
from volery.simulation.autopilots.ardupilot.battery import MEASURED_AFTER, gauge
from volery.simulation.autopilots.ardupilot.pilot_input import faults_of
from volery.simulation.autopilots.mavlink.messages import Fields
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

NO_FIX_AFTER = int(9.64 * S)
"""Uptime [ns] from which the GPS receiver is detected."""
FIX_AFTER = int(9.85 * S)
"""Uptime [ns] from which the GPS receiver has a fix."""

POSITION_KEPT = 7.0
"""Time for which the position counts after the last fix [s] (posRetryTimeNoVel_ms of EKF3)."""

# MAV_SYS_STATUS_SENSOR
GYROSCOPES, ACCELEROMETERS, MAG, PRESSURE = 1 << 0, 1 << 1, 1 << 2, 1 << 3
DIFFERENTIAL_PRESSURE, GPS, RC_RECEIVER = 1 << 4, 1 << 5, 1 << 16
GEOFENCE = 1 << 20
AHRS, TERRAIN, LOGGING, BATTERY, PREARM = 1 << 21, 1 << 22, 1 << 24, 1 << 25, 1 << 28


class Health(NamedTuple):
    """Sensor bits of SYS_STATUS of a healthy, disarmed vehicle in a mode without controls of its own."""

    present: int
    enabled: int
    healthy: int
    estimator_enabled_after: int
    """Uptimes [ns] from which the attitude estimator is enabled and healthy."""
    estimator_healthy_after: int


def is_logging(vehicle: AutopilotVehicle) -> bool:
    """Return whether the log is written: armed, and for 15 s after disarming or a refusal to arm."""
    now = vehicle.kernel.now()
    return (
        vehicle.armed or now - vehicle.arming.refused_at < 15 * S or now - vehicle.arming.disarmed_at < 15 * S
    )


def receiver_is_lost(vehicle: AutopilotVehicle) -> bool:
    """Return whether no message of a receiver has come for GPS_TIMEOUT_MS of AP_GPS."""
    since = faults_of(vehicle).no_receiver_since
    return since != NEVER and vehicle.kernel.now() - since > 4 * S


def sys_status(vehicle: AutopilotVehicle, health: Health) -> Fields:
    """Return SYS_STATUS."""
    age, controls = vehicle.uptime(), vehicle.mode.controls
    present, enabled, healthy = health.present, health.enabled | controls, health.healthy | controls
    missing = 0
    if age < NO_FIX_AFTER or receiver_is_lost(vehicle):
        missing |= GPS
    if age < MEASURED_AFTER:
        missing |= TERRAIN
        healthy &= ~(MAG | BATTERY)
    if age < health.estimator_enabled_after:
        enabled &= ~AHRS
    if age < health.estimator_healthy_after or not vehicle.estimate.attitude_ok:
        healthy &= ~AHRS
    if not is_logging(vehicle):
        enabled &= ~LOGGING
    if not vehicle.arming.checks_passed:
        healthy &= ~PREARM
    volts, amps, left = gauge(vehicle)
    return {
        "onboard_control_sensors_present": present & ~missing,
        "onboard_control_sensors_enabled": enabled & ~missing,
        "onboard_control_sensors_health": healthy & ~missing,
        "load": 0,
        "voltage_battery": volts,
        "current_battery": amps,
        "battery_remaining": left,
    }
