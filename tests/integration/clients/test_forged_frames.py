"""A signed link with someone in the middle: forged arrivals end no operation. Without a key they do."""

from __future__ import annotations

import select
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

import volery
from volery.base.frames import LocalFrame
from volery.base.position import AMSL, Position
from volery.links.frame import Frame
from volery.links.mavlink_codec import MavlinkParser, SignedMavlink, encode

KEY = bytes(range(32))
AWAY_M = 60.0
NEAR_M = 6.0
HERE = "127.0.0.1"


class Forger:
    """Relays a vehicle to one client, and after each piece says that the vehicle is at ``goal``.

    Attributes:
        genuine: The last position that the vehicle itself has reported: latitude and longitude, degrees.
        goal: What is forged; None until the test sets it.
    """

    def __init__(self, port: int) -> None:
        self._vehicle = socket.create_connection((HERE, port), 30.0)
        self._listener = socket.create_server((HERE, 0))
        self.port: int = self._listener.getsockname()[1]
        self._parser, self._other = MavlinkParser(), SignedMavlink(b"x" * 32)
        self._ends, self._end = socket.socketpair()
        self.genuine: dict[str, Any] = {}
        self.goal: Position | None = None
        self.forged = 0
        self._thread = threading.Thread(target=self._relay)
        self._thread.start()

    def _relay(self) -> None:
        waited, _, _ = select.select([self._listener, self._ends], [], [])
        if self._ends in waited:
            return
        client, _ = self._listener.accept()
        with closing(client):
            while True:
                ready, _, _ = select.select([self._vehicle, client, self._ends], [], [])
                if self._ends in ready:
                    return
                for source, target in ((self._vehicle, client), (client, self._vehicle)):
                    if source in ready:
                        piece = source.recv(65536)
                        if not piece:
                            return
                        target.sendall(piece)
                        if source is self._vehicle:
                            client.sendall(self._forge(piece))

    def _forge(self, piece: bytes) -> bytes:
        for frame in self._parser.feed(piece):
            if frame.name == "GLOBAL_POSITION_INT":
                self.genuine = frame.fields
        if self.goal is None or not self.genuine:
            return b""
        arrived = self.genuine | {
            "lat": round(self.goal.latitude * 1e7),
            "lon": round(self.goal.longitude * 1e7),
            "vx": 0,
            "vy": 0,
            "vz": 0,
        }
        frame = Frame("GLOBAL_POSITION_INT", arrived, 1, 1)
        self.forged += 1
        return encode(frame, self.forged) + self._other.encode(frame, self.forged)

    def close(self) -> None:
        self._end.send(b".")
        self._thread.join(200.0)
        for one in (self._vehicle, self._listener, self._ends, self._end):
            one.close()


@pytest.fixture
def between() -> Iterator[Callable[[int], Forger]]:
    made: list[Forger] = []

    def start(port: int) -> Forger:
        made.append(Forger(port))
        return made[-1]

    yield start
    for one in made:
        one.close()


def distance_left(forger: Forger, goal: Position) -> float:
    frame = LocalFrame(goal.latitude, goal.longitude, 0.0)
    east, north, _ = frame.to_enu(forger.genuine["lat"] / 1e7, forger.genuine["lon"] / 1e7, 0.0)
    return float((east**2 + north**2) ** 0.5)


@pytest.mark.parametrize("signed", [True, False])
def test_a_forged_arrival(
    serve: Callable[..., Any], between: Callable[[int], Forger], tmp_path: Path, signed: bool
) -> None:
    key = tmp_path / "key"
    key.touch(mode=0o600)
    key.write_text(KEY.hex(), encoding="ascii")
    forger = between(serve("tcp", 20.0, *(["--signing", str(key)] if signed else [])).port)
    query = f"?signing={key}" if signed else ""
    with volery.connect(f"ardupilot+tcp://{HERE}:{forger.port}{query}") as drone:
        drone.takeoff(10)
        start = drone.position
        frame = LocalFrame(start.latitude, start.longitude, 0.0)
        latitude, longitude, _ = frame.from_enu((0.0, AWAY_M, 0.0))
        goal = forger.goal = Position(latitude, longitude, AMSL(start.altitude.metres))
        drone.goto(goal)
        left = distance_left(forger, goal)
        forger.goal = None
        drone.land()
    assert forger.forged > 0
    assert left < NEAR_M if signed else left > AWAY_M / 2
