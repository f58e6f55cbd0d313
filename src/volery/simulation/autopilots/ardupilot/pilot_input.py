"""Manual control and heartbeats received by link. Only the station that SYSID_MYGCS names counts."""

from __future__ import annotations

from typing import Any

from volery.base.time import from_seconds
from volery.simulation.autopilots.manual_control import ChannelRange
from volery.simulation.autopilots.vehicle_state import Vehicle

IGNORE, RELEASE = 65_535, 65_534
LAST_PLAIN_CHANNEL = 8
INVALID_AXIS = 32_767


def _is_my_station(vehicle: Vehicle, sender: int) -> bool:
    return sender == round(vehicle.parameters["SYSID_MYGCS"])


def on_heartbeat(vehicle: Vehicle, _fields: dict[str, Any], sender: int) -> None:
    """Handle HEARTBEAT."""
    if _is_my_station(vehicle, sender):
        vehicle.failsafes.station_last_ns = vehicle.kernel.now()


def on_override(vehicle: Vehicle, fields: dict[str, Any], sender: int) -> None:
    """Handle RC_CHANNELS_OVERRIDE.

    Channels 1 to 8: 0 releases, 65535 is ignored. From channel 9: 0 and 65535 are ignored, 65534 releases.
    """
    if not _is_my_station(vehicle, sender) or vehicle.parameters["RC_OVERRIDE_TIME"] == 0.0:
        return
    now = vehicle.kernel.now()
    vehicle.failsafes.station_last_ns = now
    for channel in range(1, len(vehicle.rc.transmitter) + 1):
        pulse = fields[f"chan{channel}_raw"]
        if channel <= LAST_PLAIN_CHANNEL:
            if pulse != IGNORE:
                vehicle.rc.override(channel, pulse, now)
        elif pulse not in (0, IGNORE):
            vehicle.rc.override(channel, 0 if pulse == RELEASE else pulse, now)
    _moved(vehicle)


def on_manual_control(vehicle: Vehicle, fields: dict[str, Any], sender: int) -> None:
    """Handle MANUAL_CONTROL: axes -1000..1000 over the whole range of their channels, throttle 0..1000."""
    if not _is_my_station(vehicle, sender) or fields["target"] != vehicle.system:
        return
    now = vehicle.kernel.now()
    vehicle.failsafes.station_last_ns = now
    sticks = vehicle.tuning.sticks
    roll, pitch, throttle, yaw = sticks.travels
    middle = vehicle.rules.rc.throttle_centred
    _give(vehicle, sticks.roll, roll, _share(fields["y"]))
    if vehicle.flies:
        _give(
            vehicle,
            sticks.pitch,
            pitch,
            _share(-fields["x"] if fields["x"] != INVALID_AXIS else INVALID_AXIS),
        )
        _give(vehicle, sticks.yaw, yaw, _share(fields["r"]))
    _give(
        vehicle, sticks.throttle, throttle, _share(fields["z"]) if middle else _share(2 * fields["z"] - 1000)
    )
    _moved(vehicle)


def _share(axis: int) -> float | None:
    """Return an axis -1000..1000 as 0..1, or None if the axis is not given."""
    if axis == INVALID_AXIS:
        return None
    return min(1.0, max(0.0, (axis + 1000) / 2000.0))


def _give(vehicle: Vehicle, channel: int, travel: ChannelRange, share: float | None) -> None:
    pulse = 0 if share is None else max(0, travel.pulse(share))
    vehicle.rc.override(channel, pulse, vehicle.kernel.now())


def _moved(vehicle: Vehicle) -> None:
    """Let a mode that the pilot flies act at once; other modes act at the next tick."""
    if vehicle.armed and vehicle.mode.pilot:
        vehicle.run_manoeuvre()


def on_step(vehicle: Vehicle) -> None:
    """Simulate a failing transmitter and expire overrides, at each tick."""
    if vehicle.parameters["SIM_RC_FAIL"] or vehicle.rc.transmitter != list(vehicle.rules.rc.transmitter):
        simulate_rc_failure(vehicle)
    simulate_faults(vehicle)
    expire_overrides(vehicle)


def simulate_faults(vehicle: Vehicle) -> None:
    """Inject the faults that SIM_GPS_DISABLE and SIM_ENGINE_MUL name, once after each change."""
    parameters = vehicle.parameters
    motor_and_share = parameters["SIM_ENGINE_FAIL"], parameters["SIM_ENGINE_MUL"]
    wanted = (parameters["SIM_GPS_DISABLE"], *motor_and_share)
    if wanted == vehicle.failsafes.simulated:
        return
    vehicle.failsafes.simulated = wanted
    vehicle.flight.block_gps(bool(wanted[0]))
    if vehicle.flies:
        for motor in range(4):
            weak = motor == round(wanted[1])
            vehicle.flight.weaken_motor(motor, min(1.0, max(0.0, wanted[2])) if weak else 1.0)


def expire_overrides(vehicle: Vehicle) -> None:
    """Release overrides that are older than RC_OVERRIDE_TIME; a negative time keeps them."""
    seconds = vehicle.parameters["RC_OVERRIDE_TIME"]
    if seconds > 0.0 and vehicle.rc.expire(vehicle.kernel.now(), from_seconds(seconds)):
        _moved(vehicle)


def simulate_rc_failure(vehicle: Vehicle) -> None:
    """Simulate SIM_RC_FAIL, whose values 1 and 2 both read as a throttle of 950 us."""
    throttle = vehicle.tuning.sticks.throttle
    healthy = vehicle.rules.rc.transmitter[throttle - 1]
    vehicle.rc.transmitter[throttle - 1] = 950 if vehicle.parameters["SIM_RC_FAIL"] else healthy
