"""Sticks and heartbeats that come by link: only those of the ground station that SYSID_MYGCS names count."""

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
    """HEARTBEAT of somebody else."""
    if _is_my_station(vehicle, sender):
        vehicle.station_seen = vehicle.kernel.now()


def on_override(vehicle: Vehicle, fields: dict[str, Any], sender: int) -> None:
    """RC_CHANNELS_OVERRIDE.

    Channels 1 to 8: 0 releases, 65535 leaves as it is. Above: 0 and 65535 leave as it is, 65534 releases.
    """
    if not _is_my_station(vehicle, sender) or vehicle.parameters["RC_OVERRIDE_TIME"] == 0.0:
        return
    now = vehicle.kernel.now()
    vehicle.station_seen = now
    for channel in range(1, len(vehicle.sticks.transmitter) + 1):
        pulse = fields[f"chan{channel}_raw"]
        if channel <= LAST_PLAIN_CHANNEL:
            if pulse != IGNORE:
                vehicle.sticks.override(channel, pulse, now)
        elif pulse not in (0, IGNORE):
            vehicle.sticks.override(channel, 0 if pulse == RELEASE else pulse, now)
    _moved(vehicle)


def on_manual_control(vehicle: Vehicle, fields: dict[str, Any], sender: int) -> None:
    """MANUAL_CONTROL: axes -1000..1000 onto the whole travel of their channels, throttle 0..1000."""
    if not _is_my_station(vehicle, sender) or fields["target"] != vehicle.system:
        return
    now = vehicle.kernel.now()
    vehicle.station_seen = now
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
    """-1000..1000 as 0..1; ``None`` for an axis that is not given."""
    if axis == INVALID_AXIS:
        return None
    return min(1.0, max(0.0, (axis + 1000) / 2000.0))


def _give(vehicle: Vehicle, channel: int, travel: ChannelRange, share: float | None) -> None:
    pulse = 0 if share is None else max(0, travel.pulse(share))
    vehicle.sticks.override(channel, pulse, vehicle.kernel.now())


def _moved(vehicle: Vehicle) -> None:
    """A pilot's mode obeys at once; others at the next tick."""
    if vehicle.armed and vehicle.mode.pilot:
        vehicle.act()


def on_step(vehicle: Vehicle) -> None:
    """At each tick: a transmitter that fails or comes back, overrides that expire."""
    if vehicle.parameters["SIM_RC_FAIL"] or vehicle.sticks.transmitter != list(vehicle.rules.rc.transmitter):
        fail(vehicle)
    expire(vehicle)


def expire(vehicle: Vehicle) -> None:
    """Overrides fall back to the transmitter after RC_OVERRIDE_TIME; a negative time means never."""
    seconds = vehicle.parameters["RC_OVERRIDE_TIME"]
    if seconds > 0.0 and vehicle.sticks.expire(vehicle.kernel.now(), from_seconds(seconds)):
        _moved(vehicle)


def fail(vehicle: Vehicle) -> None:
    """SIM_RC_FAIL: 2 brings the transmitter's throttle below the failsafe's value, 1 takes the transmitter
    away.

    Both look the same to the firmware: a throttle of 950.
    """
    throttle = vehicle.tuning.sticks.throttle
    healthy = vehicle.rules.rc.transmitter[throttle - 1]
    vehicle.sticks.transmitter[throttle - 1] = 950 if vehicle.parameters["SIM_RC_FAIL"] else healthy
