"""A flight as numbers, from which a firmware writes a log in its own format."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from struct import Struct
from typing import NamedTuple

from volery.base.frames import Vector
from volery.base.time import US, Ns
from volery.simulation.autopilots.autopilot_parameters import StoredParameter


class LogSample(NamedTuple):
    """One sample: SI units, angles in rad, positions north, east, down about the estimator's origin."""

    time_us: float
    """Since the boot of the autopilot."""
    mode: float
    """Number of the mode on the wire."""
    north: float
    east: float
    down: float
    v_north: float
    v_east: float
    v_down: float
    roll: float
    pitch: float
    yaw: float
    roll_rate: float
    pitch_rate: float
    yaw_rate: float
    volts: float
    amps: float
    used_mah: float
    left: float
    """Fraction of the charge, 0..1."""
    fix: float
    """GPS_FIX_TYPE."""
    satellites: float
    hdop: float
    latitude: float
    longitude: float
    amsl: float


SAMPLE = Struct("=d20f2d1f")
"""A ``LogSample`` as it is kept: single precision, but for its time and its place."""

LogRow = tuple[str, tuple[float, ...]]
"""A row that only one firmware logs: name of the message, and its values after the time."""


@dataclass
class FlightLog:
    """One log, from arming to disarming.

    Args:
        started_at: Time of the run [ns].
        flies: Whether it is the log of a multirotor; else of a rover.
        origin: Latitude, longitude [degrees] and height AMSL [m] of the estimator's origin.
        home_down: Home below the estimator's origin [m].
        parameters: The parameters at the start.
    """

    started_at: Ns
    flies: bool
    origin: Vector
    home_down: float
    parameters: tuple[StoredParameter, ...]
    values: bytearray = field(default_factory=bytearray)
    """Samples, each a ``SAMPLE``."""
    extras: list[tuple[LogRow, ...]] = field(default_factory=list)
    """Rows of the firmware's own beside each sample."""
    encoded: bytes | None = None
    """The file, once it has been requested."""

    @property
    def ended_at(self) -> Ns:
        """Time of the run of the last sample [ns]."""
        if not self.values:
            return self.started_at
        first: float = SAMPLE.unpack_from(self.values)[0]
        last: float = SAMPLE.unpack_from(self.values, len(self.values) - SAMPLE.size)[0]
        return self.started_at + round(last - first) * US

    def samples(self) -> Iterator[LogSample]:
        """Return the samples in order."""
        return map(LogSample._make, SAMPLE.iter_unpack(self.values))
