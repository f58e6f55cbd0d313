"""MAVLink messages in the form that all firmwares read and write: numbers, common fields, commands.

A float on the wire may be no number, and a field of 16 bits does not hold every value. A command has one
form, whether it arrives as COMMAND_LONG or as COMMAND_INT.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from math import degrees, isfinite, nan
from typing import Any, NamedTuple

from volery.base.time import MS, US
from volery.links.mavlink_messages import constant
from volery.simulation.autopilots.onboard_mission import GLOBAL_RELATIVE
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

Fields = dict[str, Any]

EPOCH_US = 1_767_225_600_000_000
"""Satellite time at the start of a run: 2026-01-01 00:00 UTC [us]."""

LARGEST = float(2**31)
FARTHEST = 2.1e7
"""Largest distance of a point that is accepted [m]."""


def finite(value: float) -> float:
    """Return *value* limited to plus and minus ``LARGEST``, or 0 if it is no number."""
    return min(LARGEST, max(-LARGEST, value)) if isfinite(value) else 0.0


def all_within(values: Iterable[float], most: float = LARGEST) -> bool:
    """Return whether all values are numbers of a magnitude up to *most*."""
    return all(abs(value) <= most for value in values)  # false for NaN


def to_int16(value: float) -> int:
    """Return the nearest signed 16-bit integer."""
    return min(32_767, max(-32_768, round(value)))


def to_uint16(value: float) -> int:
    """Return the nearest unsigned 16-bit integer."""
    return min(65_535, max(0, round(value)))


def to_uint32(value: int) -> int:
    """Return *value* as a counter of 32 bits shows it, which begins anew after 2^32."""
    return value & 0xFFFF_FFFF


MULTIROTORS = {4: 2, 6: 13, 8: 14}
"""MAV_TYPE by the number of rotors: quadrotor, hexarotor, octorotor."""


def vehicle_type(vehicle: AutopilotVehicle, kind: int) -> int:
    """Return the MAV_TYPE of a vehicle: that of its rotors, *kind* of one without."""
    return MULTIROTORS.get(vehicle.flight.rotors, kind)


def boot_ms(vehicle: AutopilotVehicle) -> int:
    """Return the field ``time_boot_ms``, which begins anew after 49.7 days."""
    return to_uint32(vehicle.uptime() // MS)


def boot_us(vehicle: AutopilotVehicle) -> int:
    """Return a field ``time_usec`` of 64 bits, counted from boot."""
    return vehicle.uptime() // US


def heading_cdeg(yaw: float) -> int:
    """Return a yaw angle [rad] as 0..35999 hundredths of a degree."""
    return round(degrees(yaw) * 100.0) % 36_000


def attitude(vehicle: AutopilotVehicle) -> Fields:
    """Return the fields of ATTITUDE."""
    estimate = vehicle.estimate
    roll, pitch, yaw = estimate.attitude
    p, q, r = estimate.rates
    return {
        "time_boot_ms": boot_ms(vehicle),
        "roll": roll,
        "pitch": pitch,
        "yaw": yaw,
        "rollspeed": p,
        "pitchspeed": q,
        "yawspeed": r,
    }


def attitude_quaternion(vehicle: AutopilotVehicle) -> Fields:
    """Return the fields of ATTITUDE_QUATERNION."""
    estimate = vehicle.estimate
    w, x, y, z = estimate.quaternion
    p, q, r = estimate.rates
    return {
        "time_boot_ms": boot_ms(vehicle),
        "q1": w,
        "q2": x,
        "q3": y,
        "q4": z,
        "rollspeed": p,
        "pitchspeed": q,
        "yawspeed": r,
    }


ACCEPTED = constant("MAV_RESULT_ACCEPTED")
TEMPORARILY_REJECTED = constant("MAV_RESULT_TEMPORARILY_REJECTED")
DENIED = constant("MAV_RESULT_DENIED")
UNSUPPORTED = constant("MAV_RESULT_UNSUPPORTED")
FAILED = constant("MAV_RESULT_FAILED")

NOT_GIVEN = 2_147_483_647
"""Value of a coordinate of COMMAND_INT that is not given."""


class Command(NamedTuple):
    """One command.

    Args:
        number: MAV_CMD.
        param1: First parameter; likewise ``param2`` and ``param3``.
        param4: Fourth parameter; NaN may mean to keep the heading.
        x: Fifth parameter; degrees where it is a latitude. Likewise ``y`` for the longitude.
        z: Seventh parameter.
        frame: MAV_FRAME.
        is_int: Whether it arrived as COMMAND_INT.
        sender: System and component that sent it.

    A place (x, y, z) that is no number stays NaN, and is refused by what needs one. The other parameters are
    NaN only for firmwares that read NaN as "not given".
    """

    number: int
    param1: float
    param2: float
    param3: float
    param4: float
    x: float
    y: float
    z: float
    frame: int
    is_int: bool
    sender: tuple[int, int] = (0, 0)

    @property
    def fifth(self) -> float:
        """Fifth parameter as it was sent, where it is no latitude; likewise ``sixth``."""
        return float(round(self.x * 1e7)) if self.is_int and isfinite(self.x) else finite(self.x)

    @property
    def sixth(self) -> float:
        """Sixth parameter as it was sent, where it is no longitude."""
        return float(round(self.y * 1e7)) if self.is_int and isfinite(self.y) else finite(self.y)


Handler = Callable[[AutopilotVehicle, Command], int | None]
"""Executes a command and returns a MAV_RESULT; ``None``: the command stays without an answer."""


def from_long(fields: dict[str, Any], reads_nan: bool = False) -> Command:
    """Return the command of a COMMAND_LONG; with *reads_nan*, NaN parameters stay NaN."""
    read = _number_or_nan if reads_nan else finite
    return Command(
        fields["command"],
        read(fields["param1"]),
        read(fields["param2"]),
        read(fields["param3"]),
        _number_or_nan(fields["param4"]),
        _number_or_nan(fields["param5"]),
        _number_or_nan(fields["param6"]),
        _number_or_nan(fields["param7"]),
        GLOBAL_RELATIVE,
        is_int=False,
    )


def from_int(fields: dict[str, Any], reads_nan: bool = False) -> Command:
    """Return the command of a COMMAND_INT.

    With *reads_nan*, NaN parameters stay NaN and the largest integer becomes NaN.
    """
    read = _number_or_nan if reads_nan else finite
    x, y = (nan if reads_nan and value == NOT_GIVEN else value / 1e7 for value in (fields["x"], fields["y"]))
    return Command(
        fields["command"],
        read(fields["param1"]),
        read(fields["param2"]),
        read(fields["param3"]),
        _number_or_nan(fields["param4"]),
        x,
        y,
        _number_or_nan(fields["z"]),
        fields["frame"],
        is_int=True,
    )


def _number_or_nan(value: float) -> float:
    return finite(value) if isfinite(value) else nan
