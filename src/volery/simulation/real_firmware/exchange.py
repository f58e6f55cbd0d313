"""What the link to a firmware's simulation port does: samples of sensors in, commands of motors out.

The firmware's clock is the time that the samples state. After ``send`` it computes by itself while this
program goes on and prepares the next samples; ``receive`` waits for its answer. So a command acts one
exchange after the samples that it answers, about as late as on a board.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from volery.base.frames import Quaternion, Vector, attitude_enu_to_ned, enu_to_ned, multiply
from volery.base.time import Ns
from volery.simulation.world.state_layout import S_ATTITUDE, S_POSITION, S_RATES, S_VELOCITY

ANSWER_LIMIT_S = 10.0
"""Time of the wall clock after which a firmware that does not answer hangs."""


class TrueMotion(NamedTuple):
    """True motion of a body.

    Args:
        position: North, east, down about the world's origin [m].
        velocity: North, east, down [m/s].
        attitude: Quaternion (w, x, y, z) from forward, right, down to north, east, down.
    """

    position: Vector
    velocity: Vector
    attitude: Quaternion


def vector(row: Sequence[float], column: int) -> Vector:
    """Return the three values of *row* from *column* on."""
    return row[column], row[column + 1], row[column + 2]


def pose_after(row: Sequence[float], ahead: float) -> TrueMotion:
    """Return the motion in *row*, *ahead* seconds later: a firmware's step is no multiple of the world's.

    Args:
        row: State row of a body, by the columns of ``state_layout``.
        ahead: Time since the grid step of the row [s], less than one step of the world.
    """
    east, north, up = row[S_POSITION : S_POSITION + 3]
    v_east, v_north, v_up = velocity = vector(row, S_VELOCITY)
    attitude = row[S_ATTITUDE], row[S_ATTITUDE + 1], row[S_ATTITUDE + 2], row[S_ATTITUDE + 3]
    if ahead:
        east, north, up = east + ahead * v_east, north + ahead * v_north, up + ahead * v_up
        half = 0.5 * ahead
        forward, left, above = vector(row, S_RATES)
        turn = 1.0, half * forward, half * left, half * above
        attitude = multiply(attitude, turn)  # its length is off by 1e-6 at most
    return TrueMotion(enu_to_ned((east, north, up)), enu_to_ned(velocity), attitude_enu_to_ned(attitude))


class SimulationPort(Protocol):
    """The simulation port of one firmware."""

    @property
    def period(self) -> Ns:
        """Time between two exchanges."""

    def prepare(self, time: Ns, row: Sequence[float], ahead: float) -> None:
        """Make the samples of *time*; the firmware may still compute.

        Args:
            time: Clock of the firmware from now on, from its start; it grows from call to call.
            row: State row of the body, by the columns of ``state_layout``.
            ahead: Time since the grid step of the row [s].
        """

    def send(self) -> None:
        """Send the samples to the firmware, which waits; do not wait for the answer."""

    def transmit(self, pulses: Sequence[int]) -> None:
        """Send the pulse widths of a pilot's transmitter [us], channel 1 first."""

    def receive(self) -> Sequence[float]:
        """Wait for the answer to the last samples and return the motor commands.

        Returns:
            Commands for the columns from ``U_THROTTLE`` on: of each motor 0..1; of a rover steering, left
            positive, and throttle, both -1..1.

        Raises:
            FirmwareError: The firmware has ended, or has not answered for ``ANSWER_LIMIT_S``.
        """
