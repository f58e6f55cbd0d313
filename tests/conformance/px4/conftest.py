"""A simulated PX4 at the end of a link, and the facts that were recorded of the real one."""

from __future__ import annotations

from collections.abc import Callable
from math import nan
from typing import Any

import pytest

from rigs.station import TARGET, Station, facts_of
from volery.base.frames import LocalFrame
from volery.base.time import S
from volery.kernel.api import Handle
from volery.simulation.autopilots.px4 import FIRMWARE


class Bench(Station):
    """One vehicle, one ground station on one link, whose heartbeat it hears."""

    firmware = FIRMWARE.of_version("1.14")  # the recorded one
    home = LocalFrame(45.4671160, -73.7578370, 32.34)
    looks_per_second = 50

    def __init__(self, kind: str = "copter", *, beats: bool = True, **options: Any) -> None:
        super().__init__(kind, **options)
        self._streams: list[Handle] = []
        if beats:
            self.beat()

    def command_int(self, number: int, **fields: Any) -> int | None:
        return super().command_int(number, **{"frame": 5, **fields})

    def mode(self, main: int, sub: int = 0) -> int | None:
        return self.command(176, 1, main, sub)

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

    def modes(self, since: float = 0.0) -> list[tuple[float, int]]:
        """Changes of the heartbeat's mode: when, and to what."""
        found: list[tuple[float, int]] = []
        for one in self.of("HEARTBEAT"):
            number = one.fields["custom_mode"]
            if one.at >= since and (not found or found[-1][1] != number):
                found.append((one.at, number))
        return found

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


class Today(Bench):
    """The same of the newest version, at the home of its recordings."""

    firmware = FIRMWARE
    home = LocalFrame(46.0825, -103.8995, 900.0)


POSITION_ONLY = {
    "time_boot_ms": 0,
    **TARGET,
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
    return facts_of("px4")


@pytest.fixture(scope="session")
def today() -> type[Bench]:
    """The same as ``bench``, of the newest version."""
    return Today


@pytest.fixture(scope="session")
def rig_of() -> Callable[..., Bench]:
    """Makes a warm multirotor of a version: ``rig_of("1.17")``."""
    return lambda version, **options: {"1.14": Bench, "1.17": Today}[version](**options)


@pytest.fixture(scope="session")
def bench() -> type[Bench]:
    """Makes vehicles: ``bench()`` a warm multirotor, ``bench(warm=False)`` one that boots."""
    return Bench
