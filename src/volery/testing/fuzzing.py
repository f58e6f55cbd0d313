"""Fuzzing of drivers with mutated frames from a seeded stream, as noise, bugs or malice might produce them.

Most mutated frames have a correct checksum, since parsers drop the others. ``fuzz`` passes them to a driver
while a program flies with it; only errors of this project may be raised.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from random import Random

from volery.base.errors import VoleryError
from volery.base.position import AboveHome, Position
from volery.base.seeds import stream
from volery.base.time import MS
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.kernel.waiting import sleep
from volery.links.coded_link import CodedLink
from volery.links.mavlink_codec import CHECKSUM, HEADER
from volery.links.mavlink_messages import message_type_of
from volery.links.pprzlink_codec import checksum as pprz_checksum
from volery.vehicles import Drone
from volery.vehicles.driver import drivers

Seal = Callable[[bytearray], bytes]
"""Returns a frame with a correct checksum."""

AWKWARD = (0x00, 0x01, 0x7F, 0x80, 0xFE, 0xFF, 0x99, 0xFD)
AWKWARD_FLOATS = tuple(
    struct.pack("<f", value) for value in (float("nan"), float("inf"), float("-inf"), 3.4e38, -0.0, 1e-42)
)
PAYLOAD = {"MAVLink": HEADER.size, "pprzlink": 6}
"""Offset of the payload in a frame, by protocol."""
ENDS = {"MAVLink": CHECKSUM.size, "pprzlink": 2}
SENDER = {"MAVLink": 5, "pprzlink": 2}
"""Offset of the sender's system id in a frame, by protocol."""


def seal_mavlink(frame: bytearray) -> bytes:
    """Return the frame with a matching length byte and checksum."""
    if len(frame) < HEADER.size + CHECKSUM.size:
        return bytes(frame)
    body = frame[: -CHECKSUM.size]
    body[1] = (len(body) - HEADER.size) % 256
    kind = message_type_of(body[7] | body[8] << 8 | body[9] << 16)
    return bytes(body) + CHECKSUM.pack(kind.checksum(bytes(body[1:])) if kind is not None else 0)


def seal_pprzlink(frame: bytearray) -> bytes:
    """Return the frame with a matching length byte and checksum."""
    body = frame[:-2]
    if len(body) < PAYLOAD["pprzlink"]:
        return bytes(frame)
    body[1] = (len(body) + 2) % 256
    return bytes(body) + pprz_checksum(body[1:])


SEALS: Mapping[str, Seal] = {"MAVLink": seal_mavlink, "pprzlink": seal_pprzlink}


class Mutator:
    """An endless stream of mutations of `frames` of one protocol (``MAVLink``, ``pprzlink``)."""

    def __init__(self, protocol: str, frames: Sequence[bytes], random: Random) -> None:
        self._frames = [bytearray(frame) for frame in frames]
        self._seal = SEALS[protocol]
        self._payload, self._end, self._sender = PAYLOAD[protocol], ENDS[protocol], SENDER[protocol]
        self._random = random
        ways: tuple[tuple[Callable[[bytearray], bytes], int], ...] = (
            (bytes, 20),
            (self._bits_turned, 2),
            (self._cut_short, 1),
            (self._bytes_put_in, 1),
            (self._two_in_one, 1),
            (self._noise, 1),
            (self._length_wrong, 1),
            (self._some_bytes_awkward, 5),
            (self._all_bytes_awkward, 1),
            (self._floats_awkward, 4),
            (self._payload_random, 2),
            (self._another_kind, 2),
            (self._another_sender, 1),
            (self._payload_shorter, 2),
        )
        self._ways = [way for way, weight in ways for _ in range(weight)]

    def __iter__(self) -> Iterator[bytes]:
        choice = self._random.choice
        while True:
            yield choice(self._ways)(choice(self._frames)[:])

    # -- spoiled on the wire

    def _bits_turned(self, frame: bytearray) -> bytes:
        for _ in range(self._random.randint(1, 4)):
            frame[self._random.randrange(len(frame))] ^= 1 << self._random.randrange(8)
        return bytes(frame)

    def _cut_short(self, frame: bytearray) -> bytes:
        return bytes(frame[: self._random.randrange(len(frame))])

    def _bytes_put_in(self, frame: bytearray) -> bytes:
        place = self._random.randrange(len(frame))
        return bytes(frame[:place] + self._random.randbytes(self._random.randint(1, 20)) + frame[place:])

    def _two_in_one(self, frame: bytearray) -> bytes:
        other = self._random.choice(self._frames)
        return bytes(
            frame[: self._random.randrange(len(frame))] + other[self._random.randrange(len(other)) :]
        )

    def _noise(self, frame: bytearray) -> bytes:
        return self._random.randbytes(len(frame))

    def _length_wrong(self, frame: bytearray) -> bytes:
        frame[1] = self._random.randrange(256)
        return bytes(frame)

    # -- whole on the wire, and wrong

    def _inside(self, frame: bytearray) -> range:
        return range(self._payload, max(self._payload, len(frame) - self._end))

    def _some_bytes_awkward(self, frame: bytearray) -> bytes:
        places = self._inside(frame)
        for _ in range(min(self._random.randint(1, 6), len(places))):
            frame[self._random.choice(places)] = self._random.choice(AWKWARD)
        return self._seal(frame)

    def _all_bytes_awkward(self, frame: bytearray) -> bytes:
        octet = self._random.choice(AWKWARD)
        for place in self._inside(frame):
            frame[place] = octet
        return self._seal(frame)

    def _floats_awkward(self, frame: bytearray) -> bytes:
        places = self._inside(frame)[:-3:4]
        for _ in range(min(self._random.randint(1, 4), len(places))):
            place = self._random.choice(places)
            frame[place : place + 4] = self._random.choice(AWKWARD_FLOATS)
        return self._seal(frame)

    def _payload_random(self, frame: bytearray) -> bytes:
        places = self._inside(frame)
        frame[places.start : places.stop] = self._random.randbytes(len(places))
        return self._seal(frame)

    def _another_kind(self, frame: bytearray) -> bytes:
        """Return the payload of one message under the id of another."""
        other = self._random.choice(self._frames)
        return self._seal(other[: self._payload] + frame[self._payload :])

    def _another_sender(self, frame: bytearray) -> bytes:
        frame[self._sender] = self._random.randrange(256)
        return self._seal(frame)

    def _payload_shorter(self, frame: bytearray) -> bytes:
        places = self._inside(frame)
        keep = self._random.randint(0, len(places))
        return self._seal(frame[: self._payload + keep] + frame[places.stop :])


class FuzzTarget(CodedLink):
    """A link without a peer, whose incoming bytes are fed by the fuzzer."""

    def _transmit(self, data: bytes) -> None:
        """Drop the bytes."""


@dataclass
class FuzzResult:
    """Result of fuzzing: ``received`` counts complete frames, ``ended`` outcomes of operations by name."""

    fed: int = 0
    received: int = 0
    ended: dict[str, int] = field(default_factory=dict)


AT_ONCE = 20
"""Frames per step of virtual time: 100 ms of a busy link."""
PASSES = 100 * MS


def fuzz(
    driver: str,
    frames: Sequence[bytes],
    count: int,
    *,
    seed: int = 1,
    after: Callable[[int], None] = lambda fed: None,
) -> FuzzResult:
    """Pass mutated frames to a driver while a program flies with it.

    Exceptions that are not errors of this project, in the parser, the driver or the program's calls, are
    raised.
    """
    kernel = VirtualKernel()
    factory = drivers.load(driver)
    assert factory.on_link is not None, "hostile bytes need a link"
    link = FuzzTarget(kernel, "campaign", factory.codec)
    opened = factory.on_link(kernel, link, "craft", {})
    drone = Drone(kernel, "craft", opened)
    random = stream(seed, f"hostile/{driver}")
    result = FuzzResult()
    kernel.spawn(lambda: _fly_on(kernel, drone, result), "program", ExecutionContext("program"))
    portion: list[bytes] = []
    for data in Mutator(factory.codec.name, frames, random):
        portion.append(data)
        result.fed += 1
        if len(portion) < AT_ONCE and result.fed < count:
            continue
        _arrive(link, b"".join(portion), random)
        portion.clear()
        kernel.run(kernel.now() + PASSES)
        after(result.fed)
        if result.fed >= count:
            break
    result.received = link.statistics.frames
    drone.close()
    kernel.close()
    return result


def _arrive(link: FuzzTarget, data: bytes, random: Random) -> None:
    """Yield the bytes in portions of random size."""
    place = 0
    while place < len(data):
        size = random.randint(1, 400)
        link.arrived(data[place : place + size])
        place += size


def _fly_on(kernel: VirtualKernel, drone: Drone, result: FuzzResult) -> None:
    """Run operations one after the other without end; those that fail are repeated."""
    tries: tuple[Callable[[], object], ...] = (
        lambda: drone.wait_ready(within=2.0),
        drone.arm,
        lambda: drone.takeoff(10.0),
        lambda: drone.goto(Position(drone.home.latitude, drone.home.longitude, AboveHome(20.0))),
        lambda: drone.set_velocity(north=1.0),
        lambda: drone.set_heading(90.0),
        drone.hold,
        lambda: drone.manual_control(0.0, 0.0, 0.5, 0.0),
        drone.altitude_hold,
        drone.return_home,
        drone.land,
        drone.disarm,
    )
    while True:
        for attempt in tries:
            outcome = "done"
            try:
                attempt()
            except VoleryError as error:
                outcome = type(error).__name__
            result.ended[outcome] = result.ended.get(outcome, 0) + 1
            sleep(kernel, 50 * MS)
