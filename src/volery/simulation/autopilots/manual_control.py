"""Manual control: RC channels of a simulated transmitter, overrides that expire, and stick positions.

Channels count from 1; a value is the pulse width in microseconds, 0 where the receiver has none. An override
replaces one channel of the transmitter until it is released or has not been repeated for the override time.
Stick positions are computed from the channel's own minimum, trim, maximum and dead zone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from volery.base.time import Ns
from volery.simulation.autopilots.state_groups import NEVER


class ChannelRange(NamedTuple):
    """Range of a channel's pulse widths.

    Args:
        low: Lower end [us].
        trim: Middle [us].
        high: Upper end [us].
        dead: Half width of the dead zone about the middle [us].
        reversed: Whether a larger pulse width is a smaller value.
    """

    low: float
    trim: float
    high: float
    dead: float
    reversed: bool = False

    def deflection(self, pulse: float) -> float:
        """Return a pulse width [us] as -1..1 about the trim; 0 within the dead zone."""
        upper, lower = self.trim + self.dead, self.trim - self.dead
        sign = -1.0 if self.reversed else 1.0
        if pulse > upper and self.high > upper:
            return sign * min(1.0, (pulse - upper) / (self.high - upper))
        if pulse < lower and lower > self.low:
            return sign * max(-1.0, (pulse - lower) / (lower - self.low))
        return 0.0

    def share(self, pulse: float) -> float:
        """Return a pulse width [us] as 0..1 between the ends, with the dead zone at the low end."""
        start = self.low + self.dead
        if self.high <= start:
            return 0.0
        within = min(max(pulse, self.low), self.high)
        if self.reversed:
            within = self.low + self.high - within
        return max(0.0, (within - start) / (self.high - start))

    def pulse(self, share: float) -> int:
        """Return the pulse width [us] at *share* (0..1) of the range."""
        along = 1.0 - share if self.reversed else share
        return int(self.low + (self.high - self.low) * along)


class ReceivedChannels:
    """RC channels as the autopilot reads them.

    Args:
        transmitter: Pulse widths of the simulated transmitter [us].
    """

    def __init__(self, transmitter: Sequence[int]) -> None:
        self.transmitter = list(transmitter)
        self._override = [0] * len(transmitter)
        self._none = [0] * len(transmitter)
        self._in_force = self._override
        self._given = [NEVER] * len(transmitter)

    def override(self, channel: int, pulse: int, now: Ns) -> None:
        """Replace a channel from now on; 0 returns it to the transmitter.

        Args:
            channel: Number of the channel, from 1; others are ignored.
            pulse: Pulse width [us].
            now: The time [ns].
        """
        if 1 <= channel <= len(self._override):
            self._override[channel - 1] = pulse
            self._given[channel - 1] = now

    def release(self) -> None:
        """Return every channel to the transmitter."""
        self._override[:] = self._none

    def admit(self, *, overrides: bool) -> bool:
        """Let overrides count or not, without dropping them; return whether that changes."""
        wanted = self._override if overrides else self._none
        changed = wanted is not self._in_force
        self._in_force = wanted
        return changed

    def expire(self, now: Ns, within: Ns) -> bool:
        """Drop overrides that were not repeated within a time [ns], and return whether one was dropped."""
        if not any(self._override):
            return False
        dropped = False
        for index, given in enumerate(self._given):
            if self._override[index] and now - given > within:
                self._override[index] = 0
                dropped = True
        return dropped

    @property
    def overridden(self) -> bool:
        """Whether any channel is overridden."""
        return any(self._in_force)

    def __getitem__(self, channel: int) -> int:
        return self._in_force[channel - 1] or self.transmitter[channel - 1]

    def pulses(self) -> list[int]:
        """Return the pulse widths of all channels in order [us]."""
        if not any(self._in_force):
            return list(self.transmitter)
        return [over or given for over, given in zip(self._in_force, self.transmitter, strict=True)]


class StickPositions(NamedTuple):
    """Positions of the four sticks without dead zones.

    Roll right, pitch back (nose up) and yaw clockwise are -1..1; the throttle is 0..1 from its low end.
    """

    roll: float
    pitch: float
    throttle: float
    yaw: float


@dataclass(frozen=True)
class StickMap:
    """Channel and range of each stick."""

    roll: int = 1
    pitch: int = 2
    throttle: int = 3
    yaw: int = 4
    travels: tuple[ChannelRange, ChannelRange, ChannelRange, ChannelRange] = (
        ChannelRange(1000, 1500, 2000, 20),
    ) * 4
    """Ranges of roll, pitch, throttle, yaw."""

    def read(self, sticks: ReceivedChannels) -> StickPositions:
        """Return the stick positions."""
        roll, pitch, throttle, yaw = self.travels
        return StickPositions(
            roll.deflection(sticks[self.roll]),
            pitch.deflection(sticks[self.pitch]),
            throttle.share(sticks[self.throttle]),
            yaw.deflection(sticks[self.yaw]),
        )

    @property
    def throttle_middle(self) -> float:
        """Position of the middle of the throttle stick's range on its scale of 0..1."""
        travel = self.travels[2]
        return travel.share((travel.low + travel.high) / 2.0)
