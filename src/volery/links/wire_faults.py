"""Faults of a wire or a radio, and a link within one process whose bytes suffer from them.

All faults are drawn from one seeded stream of random numbers in the order of sending, so a run with faults
repeats exactly.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from random import Random

from volery.base.errors import UsageError, choices, did_you_mean
from volery.base.time import MS, Ns, S, from_seconds
from volery.kernel.api import Kernel
from volery.links.coded_link import CodedLink
from volery.links.link import WireFormat
from volery.links.mavlink_codec import MAVLINK

BURST_LENGTH = 40
"""Bytes that a burst of noise overwrites."""

REORDER_DELAY: Ns = 60 * MS
"""Delay of a reordered frame: longer than the period of a fast stream, so that later frames overtake it."""

BUFFER = 2048
"""Bytes that a radio keeps for sending; a Holybro or RFD radio has some 2 KiB."""
BITS_PER_BYTE = 10
"""Start bit, eight bits of data, stop bit."""

PROBABILITIES = ("burst", "drop", "duplicate", "flip", "reorder", "truncate")


@dataclass(frozen=True)
class WireFaults:
    """What happens to bytes on their way. Probabilities are in 0..1.

    Args:
        drop: Probability that a frame is lost.
        flip: Probability, per byte, that one of its bits is inverted.
        burst: Probability, per frame, that noise begins with it and overwrites ``BURST_LENGTH`` bytes.
        truncate: Probability that a frame ends too early.
        duplicate: Probability that a frame arrives twice.
        reorder: Probability that a frame is delayed by ``REORDER_DELAY``, so that later ones overtake it.
        jitter: Largest additional delay in ns; the order of frames is kept.
        baud: Bits per second that a radio or serial line carries, ten for each byte; 0 for no limit. A frame
            that finds ``BUFFER`` bytes waiting is lost.
        cuts: Intervals (from, to) in ns in which nothing passes in either direction.
    """

    drop: float = 0.0
    flip: float = 0.0
    burst: float = 0.0
    truncate: float = 0.0
    duplicate: float = 0.0
    reorder: float = 0.0
    jitter: Ns = 0
    baud: float = 0.0
    cuts: tuple[tuple[Ns, Ns], ...] = ()

    def __post_init__(self) -> None:
        for name in PROBABILITIES:
            value = getattr(self, name)
            if not 0.0 <= value <= 1.0:
                raise UsageError(f"wire faults: {name}={value} is no probability; 0 to 1")
        if not (isfinite(self.baud) and self.baud >= 0.0):
            raise UsageError(f"wire faults: baud={self.baud} is no rate in bits per second")

    def cut_at(self, now: Ns) -> bool:
        """Return whether the connection is cut at time *now*."""
        return any(start <= now < end for start, end in self.cuts)


FAULT_OPTIONS = (*PROBABILITIES, "baud", "cut", "jitter")


def parse_wire_faults(options: Mapping[str, str]) -> WireFaults:
    """Return the faults that the options of an address state.

    Example: ``drop=0.01&flip=1e-5&burst=0.001&jitter=0.05&cut=20-25,60-70``.

    Args:
        options: Values by name, one of ``FAULT_OPTIONS``. ``jitter`` and ``cut`` (FROM-TO) are in
            seconds, ``baud`` in bits per second.

    Raises:
        UsageError: An option is unknown or its value is no number, no interval or no probability.
    """
    numbers: dict[str, float] = {}
    cuts: tuple[tuple[Ns, Ns], ...] = ()
    for name, given in options.items():
        if name == "cut":
            cuts = tuple(_parse_interval(part) for part in given.split(","))
        elif name in FAULT_OPTIONS:
            numbers[name] = _parse_number(name, given)
        else:
            hint = did_you_mean(name, FAULT_OPTIONS)
            raise UsageError(f"no wire fault {name!r}{hint}; there is {choices(FAULT_OPTIONS)}")
    jitter = from_seconds(numbers.pop("jitter", 0.0))
    return WireFaults(jitter=jitter, cuts=cuts, **numbers)


def _parse_number(name: str, given: str) -> float:
    try:
        return float(given)
    except ValueError:
        raise UsageError(f"wire faults: {name}={given!r} is not a number") from None


def _parse_interval(text: str) -> tuple[Ns, Ns]:
    start, dash, end = text.partition("-")
    if not dash:
        raise UsageError(f"wire faults: cut={text!r} should be FROM-TO in seconds, as in cut=20-25")
    return from_seconds(_parse_number("cut", start)), from_seconds(_parse_number("cut", end))


class FaultyLink(CodedLink):
    """One end of a link within one process that carries bytes, with faults."""

    def __init__(
        self, kernel: Kernel, name: str, faults: WireFaults, random: Random, *, delay: Ns, codec: WireFormat
    ) -> None:
        super().__init__(kernel, name, codec)
        self.peer: FaultyLink = self
        self._delay = delay
        self._faults = faults
        self._random = random
        self._noise = 0  # bytes that the burst in progress will still overwrite
        self._last_arrival: Ns = 0
        self._sent_at: Ns = 0  # when the last byte that waits will have been sent

    def set_faults(self, faults: WireFaults) -> None:
        """Apply *faults* from now on, in both directions."""
        self._faults = self.peer._faults = faults

    def _transmit(self, data: bytes) -> None:
        now = self._kernel.now()
        faults, random = self._faults, self._random
        if faults.drop and random.random() < faults.drop:
            return
        if faults.burst and random.random() < faults.burst:
            self._noise = BURST_LENGTH
        if faults.flip or self._noise:
            data = self._corrupted(data)
        if faults.truncate and random.random() < faults.truncate:
            data = data[: random.randrange(len(data))]
        if faults.cut_at(now) or (faults.baud and not self._queue(len(data), now)):
            return
        for arrival in self._arrivals():
            self._kernel.call_at(arrival, lambda: self.peer.arrived(data))

    def _queue(self, count: int, now: Ns) -> bool:
        """Send *count* bytes after those that wait; return False if the buffer is full."""
        per_byte = BITS_PER_BYTE * S / self._faults.baud
        if (self._sent_at - now) / per_byte > BUFFER:
            return False
        self._sent_at = max(now, self._sent_at) + round(count * per_byte)
        return True

    def _arrivals(self) -> list[Ns]:
        """Return the times at which data that is sent now arrives; there are two if it is duplicated."""
        faults, random = self._faults, self._random
        jitter = int(random.random() * faults.jitter) if faults.jitter else 0
        sent = max(self._kernel.now(), self._sent_at)
        self._last_arrival = max(self._last_arrival, sent + self._delay + jitter)
        arrival = self._last_arrival
        if faults.reorder and random.random() < faults.reorder:
            arrival += REORDER_DELAY
        if faults.duplicate and random.random() < faults.duplicate:
            return [arrival, arrival + self._delay]
        return [arrival]

    def _corrupted(self, data: bytes) -> bytes:
        corrupted = bytearray(data)
        for at in range(len(corrupted)):
            if self._noise:
                self._noise -= 1
                corrupted[at] = self._random.randrange(256)
            elif self._random.random() < self._faults.flip:
                corrupted[at] ^= 1 << self._random.randrange(8)
        return bytes(corrupted)


def faulty_pair(
    kernel: Kernel,
    name: str,
    faults: WireFaults,
    random: Random,
    *,
    delay: Ns = MS,
    codec: WireFormat = MAVLINK,
) -> tuple[FaultyLink, FaultyLink]:
    """Return the vehicle's end and the autopilot's end of a link over bytes with faults.

    Args:
        kernel: Delivers the bytes.
        name: Name of the link in messages and in the trace.
        faults: What happens to the bytes.
        random: Named, seeded stream of random numbers.
        delay: Time of flight in ns.
        codec: Protocol of the link.
    """
    ours = FaultyLink(kernel, name, faults, random, delay=delay, codec=codec)
    theirs = FaultyLink(kernel, f"{name} (autopilot)", faults, random, delay=delay, codec=codec)
    ours.peer, theirs.peer = theirs, ours
    return ours, theirs
