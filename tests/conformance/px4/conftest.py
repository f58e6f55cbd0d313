"""A simulated PX4 at the end of a link, and the facts that were recorded of the real one."""

from __future__ import annotations

import json
from collections.abc import Callable
from math import nan
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from volery.autopilots.px4 import DIALECT
from volery.autopilots.simulated.autopilot import Autopilot
from volery.autopilots.simulated.flight import make_world
from volery.base.frames import LocalFrame
from volery.base.time import MS, S, from_seconds, to_seconds
from volery.kernel.api import Handle
from volery.kernel.virtual import VirtualKernel
from volery.links.in_process import in_process
from volery.links.link import Frame
from volery.world.specs import Multirotor, Rover

FACTS = Path(__file__).parents[2] / "golden" / "px4" / "facts.json"
HOME = LocalFrame(45.4671160, -73.7578370, 32.34)
STATION, STATION_COMPONENT = 255, 190


class Heard(NamedTuple):
    """A frame from the autopilot, and when it came, in seconds."""

    at: float
    name: str
    fields: dict[str, Any]


class Bench:
    """One vehicle, one ground station on one link, whose heartbeat it hears."""

    def __init__(
        self, kind: str = "copter", *, warm: bool = True, use: str = "", beats: bool = True, **options: Any
    ) -> None:
        self.kernel = VirtualKernel()
        spec = Multirotor(sensors="rtk") if kind == "copter" else Rover(sensors="rtk")
        self.world, (self.flight,) = make_world(self.kernel.now, [spec], seed=3, frame=HOME)
        self.autopilot = Autopilot(self.kernel, self.flight, DIALECT, warm=warm, **options)
        self.vehicle = self.autopilot.vehicle
        self.heard: list[Heard] = []
        self.latest: dict[str, dict[str, Any]] = {}
        self._streams: list[Handle] = []
        self.link, theirs = in_process(self.kernel, MS, "station")
        self.autopilot.connect(theirs, use=use)
        self.link.receive(self._hear)
        if beats:
            self.beat()

    def _hear(self, frame: Frame) -> None:
        self.heard.append(Heard(self.now, frame.name, frame.fields))
        self.latest[frame.name] = frame.fields

    @property
    def now(self) -> float:
        return to_seconds(self.kernel.now())

    def send(self, name: str, *, system: int = STATION, **fields: Any) -> None:
        self.link.send(Frame(name, fields, system, STATION_COMPONENT))

    def run(self, seconds: float) -> None:
        self.kernel.run(self.kernel.now() + from_seconds(seconds))

    def run_until(self, done: Callable[[], bool], within: float = 120.0) -> float:
        """Seconds until *done*."""
        start = self.now
        while not done():
            assert self.now - start < within, (
                f"not within {within} s: mode {self.vehicle.mode.name}, {self.texts()[-3:]}"
            )
            self.kernel.run(self.kernel.now() + S // 50)
        return self.now - start

    def command(self, number: int, *params: float, **options: Any) -> int | None:
        """Send a COMMAND_LONG and return its MAV_RESULT, ``None`` if nothing answers."""
        values = {f"param{place}": float(value) for place, value in enumerate(params, start=1)}
        fields = {"target_system": 1, "target_component": 1, "command": number, **values, **options}
        for place in range(1, 8):
            fields.setdefault(f"param{place}", 0.0)
        return self._answered("COMMAND_LONG", number, fields)

    def command_int(self, number: int, **fields: Any) -> int | None:
        whole = {"target_system": 1, "target_component": 1, "command": number, "frame": 5, **fields}
        for place in range(1, 5):
            whole.setdefault(f"param{place}", 0.0)
        return self._answered("COMMAND_INT", number, whole)

    def _answered(self, name: str, number: int, fields: dict[str, Any]) -> int | None:
        count = len(self.heard)
        self.send(name, **fields)
        self.run(0.05)
        answers = [one.fields for one in self.heard[count:] if one.name == "COMMAND_ACK"]
        return next((int(answer["result"]) for answer in answers if answer["command"] == number), None)

    def mode(self, main: int, sub: int = 0) -> int | None:
        return self.command(176, 1, main, sub)

    def beat(self) -> None:
        """Heartbeats of the ground station from now on."""
        self.kernel.every(S, lambda: self.send("HEARTBEAT", type=6, autopilot=8))

    # -- streams

    def stream(self, rate: float = 20.0, **target: Any) -> None:
        """Set-points from now on, that often; instead of those before."""
        self.stop_stream()
        fields = {**POSITION_ONLY, **target}
        self._streams.append(
            self.kernel.every(round(S / rate), lambda: self.send("SET_POSITION_TARGET_LOCAL_NED", **fields))
        )

    def stop_stream(self) -> None:
        for stream in self._streams:
            stream.cancel()
        self._streams.clear()

    def sticks(self, rate: float = 20.0, x: int = 0, y: int = 0, z: int = 500, r: int = 0) -> None:
        """MANUAL_CONTROL from now on; instead of the streams before."""
        self.stop_stream()
        fields = {"target": 1, "x": x, "y": y, "z": z, "r": r, "buttons": 0}
        self._streams.append(
            self.kernel.every(round(S / rate), lambda: self.send("MANUAL_CONTROL", **fields))
        )

    # -- what was heard

    def texts(self, since: float = 0.0) -> list[str]:
        return ["".join(pieces) for _, pieces in self._texts(since)]

    def _texts(self, since: float) -> list[tuple[float, list[str]]]:
        found: list[tuple[float, list[str]]] = []
        for one in self.of("STATUSTEXT"):
            if one.fields["chunk_seq"]:
                found[-1][1].append(one.fields["text"])
            elif one.at >= since:
                found.append((one.at, [one.fields["text"]]))
        return found

    def said_at(self, text: str, since: float = 0.0) -> float:
        """When that was said first."""
        return next(at for at, pieces in self._texts(since) if "".join(pieces) == text)

    def events(self, since: float = 0.0) -> list[int]:
        return [one.fields["id"] for one in self.of("EVENT") if one.at >= since]

    def of(self, name: str) -> list[Heard]:
        return [one for one in self.heard if one.name == name]

    def modes(self, since: float = 0.0) -> list[tuple[float, int]]:
        """Changes of the heartbeat's mode: when, and to what."""
        found: list[tuple[float, int]] = []
        for one in self.of("HEARTBEAT"):
            number = one.fields["custom_mode"]
            if one.at >= since and (not found or found[-1][1] != number):
                found.append((one.at, number))
        return found

    @property
    def height(self) -> float:
        return self.vehicle.height

    @property
    def ned(self) -> tuple[float, float, float]:
        return self.vehicle.estimate.position

    def ready(self) -> None:
        """A warm vehicle that may be armed."""
        self.run(1.0)

    def airborne(self, height: float = 10.0) -> None:
        """In AUTO.LOITER somewhat below that height."""
        self.ready()
        assert self.command(22, -1, 0, 0, nan, nan, nan, self.vehicle.estimate.geodetic[2] + height) == 0
        assert self.command(400, 1) == 0
        self.run_until(lambda: self.vehicle.mode.name == "AUTO.LOITER")
        self.run(4.0)

    def offboard(self, **target: Any) -> None:
        """In OFFBOARD, with a stream."""
        self.stream(**target)
        self.run(0.1)
        assert self.mode(6) == 0


POSITION_ONLY = {
    "time_boot_ms": 0,
    "target_system": 1,
    "target_component": 1,
    "coordinate_frame": 1,
    "type_mask": 0b0000_1101_1111_1000,
    "x": 0.0,
    "y": 0.0,
    "z": -10.0,
    "vx": 0.0,
    "vy": 0.0,
    "vz": 0.0,
    "afx": 0.0,
    "afy": 0.0,
    "afz": 0.0,
    "yaw": 0.0,
    "yaw_rate": 0.0,
}


@pytest.fixture(scope="session")
def facts() -> dict[str, Any]:
    """What ``extract.py`` found in the recordings."""
    found: dict[str, Any] = json.loads(FACTS.read_text(encoding="utf-8"))
    return found


@pytest.fixture(scope="session")
def bench() -> type[Bench]:
    """Makes vehicles: ``bench()`` a warm multirotor, ``bench(warm=False)`` one that boots."""
    return Bench
