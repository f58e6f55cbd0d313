"""A ground segment in plain Python: a UDP socket and ``struct``, by the protocol's definition alone.

The aircraft sends to the ground's port 4242 and listens at 4243; here, at two ports that are free.
"""

from __future__ import annotations

import select
import socket
import struct
from collections.abc import Callable, Iterator
from time import monotonic
from typing import Any

import pytest

pytestmark = pytest.mark.integration

HERE, WITHIN_S = "127.0.0.1", 60.0
AIRCRAFT = 1
TELEMETRY, DATALINK = 1, 2
FP, STATUS, NAV_STATUS, PONG = 147, 231, 159, 3
SETTING, BLOCK, PING, GUIDED_SETPOINT = 4, 5, 8, 40
MODE = 5
"""Number of the setting."""


def summed(covered: bytes) -> bytes:
    first = second = 0
    for octet in covered:
        first = (first + octet) % 256
        second = (second + first) % 256
    return bytes((first, second))


class Ground:
    """Keeps the last payload of each telemetry message."""

    def __init__(self, downlink: int, uplink: int) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind((HERE, downlink))
        self.uplink = uplink
        self.last: dict[int, bytes] = {}

    def send(self, number: int, form: str = "", *values: float) -> None:
        payload = struct.pack("<" + form, *values)
        body = bytes((len(payload) + 8, 0, AIRCRAFT, DATALINK, number)) + payload
        self.socket.sendto(b"\x99" + body + summed(body), (HERE, self.uplink))

    def hear(self) -> None:
        ready, _, _ = select.select([self.socket], [], [], 1.0)
        if not ready:
            return
        frame, sender = self.socket.recvfrom(4096)
        assert sender[1] == self.uplink
        assert frame[0] == 0x99
        assert frame[1] == len(frame)
        assert frame[-2:] == summed(frame[1:-2])
        assert (frame[2], frame[3], frame[4] & 0x0F) == (AIRCRAFT, 0, TELEMETRY)
        self.last[frame[5]] = frame[6:-2]

    def until(self, condition: Callable[[], bool], again: Callable[[], None] | None = None) -> None:
        """Listen until it holds; ask *again* each second."""
        end, asked = monotonic() + WITHIN_S, 0.0
        while monotonic() < end:
            if again is not None and monotonic() - asked > 1.0:
                asked = monotonic()
                again()
            self.hear()
            if {FP, STATUS, NAV_STATUS} <= self.last.keys() and condition():
                return
        raise AssertionError(f"it did not come to pass; heard {sorted(self.last)}")

    @property
    def place(self) -> tuple[float, float, float]:
        """East, north, up [m]."""
        east, north, up = struct.unpack_from("<3i", self.last[FP])
        return east / 256.0, north / 256.0, up / 256.0

    @property
    def mode(self) -> int:
        return self.last[STATUS][8]

    @property
    def motors(self) -> bool:
        return self.last[STATUS][10] == 1

    @property
    def block(self) -> int:
        return self.last[NAV_STATUS][12]


@pytest.fixture
def ground(serve: Callable[..., Any], free_port: Callable[..., int]) -> Iterator[Ground]:
    """At an aircraft that has just been switched on."""
    uplink = free_port(socket.SOCK_DGRAM)
    served = serve("udp", 20.0, autopilot="paparazzi", query=f"?from={uplink}")
    ground = Ground(served.port, uplink)
    yield ground
    ground.socket.close()


def test_from_switching_on_to_the_ground_again(ground: Ground) -> None:
    ground.until(lambda: ground.block == 2)  # holding point
    ground.until(lambda: PONG in ground.last, lambda: ground.send(PING))
    ground.until(lambda: ground.motors, lambda: ground.send(BLOCK, "BB", 3, AIRCRAFT))
    ground.until(lambda: ground.block == 5, lambda: ground.send(BLOCK, "BB", 4, AIRCRAFT))  # standby
    ground.until(lambda: ground.mode == 19, lambda: ground.send(SETTING, "BBf", MODE, AIRCRAFT, 19.0))
    there = 5.0, 10.0, 8.0
    ground.until(
        lambda: all(abs(is_at - wanted) < 0.5 for is_at, wanted in zip(ground.place, there, strict=True)),
        lambda: ground.send(GUIDED_SETPOINT, "BBffff", AIRCRAFT, 0, 10.0, 5.0, -8.0, 0.5),
    )
    ground.send(BLOCK, "BB", 13, AIRCRAFT)  # land here
    ground.until(lambda: ground.mode == 13, lambda: ground.send(SETTING, "BBf", MODE, AIRCRAFT, 13.0))
    ground.until(lambda: not ground.motors)
    assert ground.place[2] < 0.7
