"""A link within one process that goes through real bytes, and the faults that a wire or a radio adds to them.

Every fault is drawn from one seeded stream in the order of sending, so a run with faults repeats exactly.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from random import Random

from volery.base.errors import UsageError, choices, did_you_mean
from volery.base.time import MS, Ns, from_seconds
from volery.kernel.api import Kernel
from volery.links.coded_link import CodedLink
from volery.links.link import Codec
from volery.links.mavlink_codec import MAVLINK

BURST_LENGTH = 40
"""Bytes that a burst of noise overwrites, from where it begins."""

REORDER_DELAY: Ns = 60 * MS
"""How much later a frame arrives that is overtaken by others: longer than between two of a fast stream."""

PROBABILITIES = ("burst", "drop", "duplicate", "flip", "reorder", "truncate")


@dataclass(frozen=True)
class WireFaults:
    """What happens to bytes on their way. Probabilities are 0..1.

    ``drop``: that a frame vanishes. ``flip``: that a bit of a byte is turned, for each byte. ``burst``: that
    noise begins with a frame and overwrites ``BURST_LENGTH`` bytes. ``truncate``: that a frame ends too
    early. ``duplicate``: that a frame arrives twice. ``reorder``: that a frame is overtaken by those sent in
    the next 60 ms. ``jitter``: up to so much later, in order. ``cuts``: from, to; in between nothing passes
    in either direction.
    """

    drop: float = 0.0
    flip: float = 0.0
    burst: float = 0.0
    truncate: float = 0.0
    duplicate: float = 0.0
    reorder: float = 0.0
    jitter: Ns = 0
    cuts: tuple[tuple[Ns, Ns], ...] = ()

    def __post_init__(self) -> None:
        for name in PROBABILITIES:
            value = getattr(self, name)
            if not 0.0 <= value <= 1.0:
                raise UsageError(f"wire faults: {name}={value} is no probability; 0 to 1")

    def cut_at(self, now: Ns) -> bool:
        """Nothing passes at this time."""
        return any(start <= now < end for start, end in self.cuts)


FAULT_OPTIONS = (*PROBABILITIES, "cut", "jitter")


def parse_wire_faults(options: Mapping[str, str]) -> WireFaults:
    """Faults as an address states them: ``drop=0.01&flip=1e-5&burst=0.001&jitter=0.05&cut=20-25,60-70``.

    Also ``truncate``, ``duplicate`` and ``reorder``. ``jitter`` and ``cut`` (from-to) in seconds. Raises
    ``UsageError`` for anything else.
    """
    numbers: dict[str, float] = {}
    cuts: tuple[tuple[Ns, Ns], ...] = ()
    for name, given in options.items():
        if name == "cut":
            cuts = tuple(_span(part) for part in given.split(","))
        elif name in FAULT_OPTIONS:
            numbers[name] = _number(name, given)
        else:
            hint = did_you_mean(name, FAULT_OPTIONS)
            raise UsageError(f"no wire fault {name!r}{hint}; there is {choices(FAULT_OPTIONS)}")
    jitter = from_seconds(numbers.pop("jitter", 0.0))
    return WireFaults(jitter=jitter, cuts=cuts, **numbers)


def _number(name: str, given: str) -> float:
    try:
        return float(given)
    except ValueError:
        raise UsageError(f"wire faults: {name}={given!r} is not a number") from None


def _span(text: str) -> tuple[Ns, Ns]:
    start, dash, end = text.partition("-")
    if not dash:
        raise UsageError(f"wire faults: cut={text!r} should be FROM-TO in seconds, as in cut=20-25")
    return from_seconds(_number("cut", start)), from_seconds(_number("cut", end))


class FaultyLink(CodedLink):
    """One end. What it sends arrives as bytes at the peer, or does not."""

    def __init__(
        self, kernel: Kernel, name: str, faults: WireFaults, random: Random, *, delay: Ns, codec: Codec
    ) -> None:
        super().__init__(kernel, name, codec)
        self.peer: FaultyLink = self
        self._delay = delay
        self._faults = faults
        self._random = random
        self._noise = 0  # bytes that the burst under way will still overwrite
        self._latest: Ns = 0  # nothing overtakes, unless faults say so

    def suffer(self, faults: WireFaults) -> None:
        """From now on this happens to what passes, in both directions."""
        self._faults = self.peer._faults = faults

    def _transmit(self, data: bytes) -> None:
        now = self._kernel.now()
        faults, random = self._faults, self._random
        if faults.drop and random.random() < faults.drop:
            return
        if faults.burst and random.random() < faults.burst:
            self._noise = BURST_LENGTH
        if faults.flip or self._noise:
            data = self._garbled(data)
        if faults.truncate and random.random() < faults.truncate:
            data = data[: random.randrange(len(data))]
        if faults.cut_at(now):
            return
        for late in self._delays():
            self._kernel.call_at(late, lambda: self.peer.arrived(data))

    def _delays(self) -> list[Ns]:
        """When what is sent now arrives: twice, it may be."""
        faults, random = self._faults, self._random
        late = int(random.random() * faults.jitter) if faults.jitter else 0
        self._latest = max(self._latest, self._kernel.now() + self._delay + late)
        arrives = self._latest
        if faults.reorder and random.random() < faults.reorder:
            arrives += REORDER_DELAY
        if faults.duplicate and random.random() < faults.duplicate:
            return [arrives, arrives + self._delay]
        return [arrives]

    def _garbled(self, data: bytes) -> bytes:
        garbled = bytearray(data)
        for place in range(len(garbled)):
            if self._noise:
                self._noise -= 1
                garbled[place] = self._random.randrange(256)
            elif self._random.random() < self._faults.flip:
                garbled[place] ^= 1 << self._random.randrange(8)
        return bytes(garbled)


def faulty_pair(
    kernel: Kernel,
    name: str,
    faults: WireFaults,
    random: Random,
    *,
    delay: Ns = MS,
    codec: Codec = MAVLINK,
) -> tuple[FaultyLink, FaultyLink]:
    """The vehicle's and the autopilot's side of a link through bytes; *random* is a named, seeded stream."""
    ours = FaultyLink(kernel, name, faults, random, delay=delay, codec=codec)
    theirs = FaultyLink(kernel, f"{name} (autopilot)", faults, random, delay=delay, codec=codec)
    ours.peer, theirs.peer = theirs, ours
    return ours, theirs
