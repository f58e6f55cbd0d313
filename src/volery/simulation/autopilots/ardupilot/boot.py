"""The boot of ArduPilot: the timeline that was recorded of 4.5.6 as data, and the work of each second.

Times are seconds after boot. Parameters are announced as PARAM_VALUE with index 65535 and with the value that
they have at that time.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from volery.base.time import S
from volery.simulation.autopilots.ardupilot.feature import build_of
from volery.simulation.autopilots.ardupilot.modes import (
    failing_prearm_checks,
    reports_of,
    update_prearm_state,
)
from volery.simulation.autopilots.ardupilot.versions import ArduPilotVersion
from volery.simulation.autopilots.autopilot import BootEvent
from volery.simulation.autopilots.mavlink.firmware import BootBytes
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle, VehicleAction
from volery.trace.events import INFO

DEBUG = 7

BANNER = (
    "\n\nInit {name} {version}\n\nFree RAM: 131072\nBooting 0/0\nFirmware change: erasing EEPROM...\n"
    "done.\nload_all took 11661us\n0 0 0 AP_Logger_File: buffer size=204800\n"
)


def banner(name: str, version: ArduPilotVersion) -> bytes:
    """Return the text that the firmware prints on its console after power-on."""
    return BANNER.format(name=name, version=version.text).encode()


def action_event(seconds: float, act: VehicleAction) -> BootEvent:
    """Return an event that executes an action."""
    return BootEvent(round(seconds * S), act)


def texts_event(seconds: float, *texts: str, severity: int = INFO) -> BootEvent:
    """Return an event that sends these status texts."""

    def act(vehicle: AutopilotVehicle) -> None:
        for text in texts:
            vehicle.send_text(severity, text)

    return action_event(seconds, act)


def announcement_event(seconds: float, *names: str) -> BootEvent:
    """Return an event that announces these parameters."""

    def act(vehicle: AutopilotVehicle) -> None:
        for name in names:
            if name in vehicle.parameters:
                vehicle.output.parameter_changed(name)

    return action_event(seconds, act)


def measurement_event(seconds: float, values: Sequence[tuple[str, float]]) -> BootEvent:
    """Return an event that sets these parameters to measured values and announces them."""

    def act(vehicle: AutopilotVehicle) -> None:
        for name, value in values:
            vehicle.set_parameter(name, value)

    return action_event(seconds, act)


def bytes_at(*pairs: tuple[float, bytes]) -> tuple[BootBytes, ...]:
    """Return raw bytes on the wire, as pairs of seconds after boot and data."""
    return tuple(BootBytes(round(seconds * S), data) for seconds, data in pairs)


def set_up_outputs(vehicle: AutopilotVehicle) -> None:
    """Let the features set up their outputs."""
    for act in build_of(vehicle).boots:
        act(vehicle)


def set_origin(vehicle: AutopilotVehicle) -> None:
    """Set the estimator's origin where the vehicle is."""
    vehicle.flight.set_origin()


def set_home_position(vehicle: AutopilotVehicle) -> None:
    """Set the home position where the vehicle is, unless it has one or the estimator has no position."""
    if vehicle.position_ok and vehicle.home is None:
        vehicle.set_home_here()


def find_home(vehicle: AutopilotVehicle) -> None:
    """Set the home position as soon as the estimator has a position, if it had none at the usual time."""
    late = vehicle.uptime() > vehicle.rules.startup.origin_after + S // 2
    waits = vehicle.home is None and late and "elevation" not in vehicle.reports.sent_once
    if waits and vehicle.position_ok:
        set_home_position(vehicle)
        report_field_elevation(vehicle)


def report_field_elevation(vehicle: AutopilotVehicle) -> None:
    """Report the altitude of the home position once after a boot."""
    if vehicle.home is not None and "elevation" not in vehicle.reports.sent_once:
        vehicle.reports.sent_once.add("elevation")
        vehicle.send_text(INFO, f"Field Elevation Set: {round(vehicle.home.amsl)}m")


def report_gps_use(vehicle: AutopilotVehicle, units: Sequence[int]) -> None:
    """Report that these estimator units use GPS, unless they use external poses."""
    for unit in () if vehicle.estimate.by_poses else units:
        vehicle.send_text(INFO, f"EKF3 IMU{unit} is using GPS")


def for_both_units(text: str) -> tuple[str, str]:
    """Return a text for each of the two estimator units."""
    return text.format(unit=0), text.format(unit=1)


_IDS = ("INS_GYR_ID", "INS_ACC_ID", "INS_GYR2_ID", "INS_ACC2_ID")


def _gyros(first: tuple[float, float, float], second: tuple[float, float, float]) -> list[tuple[str, float]]:
    axes = "XYZ"
    return [
        *((f"INS_GYROFFS_{axis}", value) for axis, value in zip(axes, first, strict=True)),
        ("INS_GYR_ID", 2_752_772),
        ("INS_GYR1_CALTEMP", 25.018353),
        *((f"INS_GYR2OFFS_{axis}", value) for axis, value in zip(axes, second, strict=True)),
        ("INS_GYR2_ID", 2_752_780),
        ("INS_GYR2_CALTEMP", 25.018353),
        *((f"INS_GYR3OFFS_{axis}", 0.0) for axis in axes),
        ("INS_GYR3_ID", 0),
    ]


COPTER_GYROS = _gyros(
    (3.5415786e-05, 3.0671483e-05, 2.865993e-05), (1.474886e-05, 6.246919e-07, -3.2503358e-06)
)
ROVER_GYROS = _gyros(
    (2.1818953e-05, -4.2986367e-06, -3.8552480e-07), (6.7699526e-05, 1.7263334e-06, -1.9344696e-05)
)
COPTER_PRESSURE = (("BARO1_GND_PRESS", 101079.71), ("BARO2_GND_PRESS", 101081.83))
ROVER_PRESSURE = (("BARO1_GND_PRESS", 100997.73), ("BARO2_GND_PRESS", 100994.25))


def store_parameters(vehicle: AutopilotVehicle, values: Sequence[tuple[str, float]]) -> None:
    """Store measured values without an announcement."""
    for name, value in values:
        vehicle.parameters.set(name, value)


def copter_events(version: ArduPilotVersion, ready: VehicleAction) -> tuple[BootEvent, ...]:
    """Return the boot timeline of a copter. ``ready`` is called at the end of the set-up."""
    return (
        announcement_event(0.01, "COMPASS_DEV_ID", "COMPASS_DEV_ID2", "COMPASS_DEV_ID3", "COMPASS_EXTERNAL"),
        announcement_event(
            0.01, "ESC_CALIBRATION", "RELAY1_FUNCTION", "COMPASS_DEV_ID", "COMPASS_DEV_ID2", "COMPASS_DEV_ID3"
        ),
        texts_event(0.16, "Calibrating barometer"),
        announcement_event(0.16, "MNT1_TYPE", "CAM1_TYPE", "BARO_ALT_OFFSET"),
        action_event(1.75, set_up_outputs),
        texts_event(1.75, "Barometer 1 calibration complete", "Barometer 2 calibration complete"),
        measurement_event(1.75, (("BARO1_GND_PRESS", 94502.516), ("BARO2_GND_PRESS", 94502.242))),
        announcement_event(1.75, *_IDS),
        action_event(2.28, ready),
        texts_event(2.28, "ArduPilot Ready", "AHRS: DCM active"),
        measurement_event(2.28, COPTER_GYROS),
        texts_event(2.58, "RC7: SaveWaypoint LOW"),
        announcement_event(3.28, "EK3_SRC1_POSXY"),
        texts_event(4.28, *for_both_units("EKF3 IMU{unit} initialised"), "AHRS: EKF3 active"),
        *(texts_event(5.63, text) for text in for_both_units("EKF3 IMU{unit} tilt alignment complete")),
        *(
            texts_event(5.73, text)
            for text in for_both_units("EKF3 IMU{unit} MAG0 initial yaw alignment complete")
        ),
        texts_event(9.64, *version.receiver_found),
        action_event(19.84, set_origin),
        action_event(19.852, set_home_position),
        texts_event(19.852, "EKF3 IMU0 origin set"),
        measurement_event(19.885, COPTER_PRESSURE),
        action_event(19.885, report_field_elevation),
        texts_event(20.05, "EKF3 IMU1 origin set"),
        action_event(41.45, partial(report_gps_use, units=(0,))),
        action_event(41.456, partial(report_gps_use, units=(1,))),
    )


def rover_events(version: ArduPilotVersion, ready: VehicleAction) -> tuple[BootEvent, ...]:
    """Return the boot timeline of a rover. ``ready`` is called at the end of the set-up."""
    return (
        texts_event(0.01, "Calibrating barometer"),
        announcement_event(0.01, "BARO_ALT_OFFSET"),
        texts_event(1.73, "Barometer 1 calibration complete", "Barometer 2 calibration complete"),
        action_event(1.73, set_up_outputs),
        texts_event(1.73, "Beginning INS calibration. Do not move vehicle"),
        measurement_event(1.73, (("BARO1_GND_PRESS", 94503.914), ("BARO2_GND_PRESS", 94503.42))),
        announcement_event(1.73, "RELAY1_FUNCTION", "RELAY2_FUNCTION", "MNT1_TYPE", "CAM1_TYPE"),
        announcement_event(1.83, *_IDS),
        texts_event(2.35, "INS: alloc 6144 bytes for ISB (free=131072)", severity=DEBUG),
        action_event(2.355, ready),
        texts_event(2.355, "ArduPilot Ready", "AHRS: DCM active"),
        measurement_event(2.355, ROVER_GYROS),
        announcement_event(3.37, "EK3_SRC1_POSXY"),
        texts_event(4.38, *for_both_units("EKF3 IMU{unit} initialised")),
        *(texts_event(5.98, text) for text in for_both_units("EKF3 IMU{unit} tilt alignment complete")),
        *(
            texts_event(6.06, text)
            for text in for_both_units("EKF3 IMU{unit} MAG0 initial yaw alignment complete")
        ),
        texts_event(9.67, *version.receiver_found),
        action_event(10.34, set_origin),
        measurement_event(10.345, (("BARO1_GND_PRESS", 94504.55), ("BARO2_GND_PRESS", 94503.32))),
        action_event(10.36, set_home_position),
        texts_event(19.86, *for_both_units("EKF3 IMU{unit} origin set")),
        action_event(19.94, report_field_elevation),
        measurement_event(21.34, (("BARO1_GND_PRESS", 101020.25), ("BARO2_GND_PRESS", 101018.77))),
        measurement_event(32.34, ROVER_PRESSURE),
        action_event(42.08, partial(report_gps_use, units=(0, 1))),
        texts_event(42.085, "AHRS: EKF3 active"),
    )


STORE_COUNTERS_EVERY = 30 * S


def skip_reports(vehicle: AutopilotVehicle) -> None:
    """Regard the reports of the boot as sent: a warm vehicle has its home a moment later."""
    vehicle.reports.sent_once.add("elevation")
    reports_of(vehicle).arming_checks_at = reports_of(vehicle).counters_at = vehicle.uptime()


def on_position(vehicle: AutopilotVehicle) -> None:
    """Set the home position and evaluate the pre-arm checks of a vehicle that starts warm."""
    set_home_position(vehicle)
    if vehicle.home is None:
        vehicle.reports.sent_once.discard("elevation")
    vehicle.arming.checks_passed = not failing_prearm_checks(vehicle)


def each_second(vehicle: AutopilotVehicle) -> None:
    """Evaluate the pre-arm checks, and store the flight time and run time counters every 30 s."""
    if vehicle.uptime() < vehicle.rules.startup.ready_after:
        return
    update_prearm_state(vehicle)
    if vehicle.uptime() - reports_of(vehicle).counters_at >= STORE_COUNTERS_EVERY:
        reports_of(vehicle).counters_at = vehicle.uptime()
        if vehicle.ground.flight_time:
            vehicle.set_parameter("STAT_FLTTIME", vehicle.ground.flight_time // S)
        vehicle.set_parameter("STAT_RUNTIME", vehicle.uptime() // S)
