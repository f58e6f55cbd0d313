"""A simulated ArduPilot at the end of a link, and the facts that were recorded of the real one."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from volery.autopilots.ardupilot import DIALECT
from volery.autopilots.simulated.autopilot import Autopilot
from volery.autopilots.simulated.flight import make_world
from volery.base.frames import LocalFrame
from volery.base.time import MS, S, from_seconds, to_seconds
from volery.kernel.virtual import VirtualKernel
from volery.links.in_process import in_process
from volery.links.link import Frame
from volery.world.specs import Multirotor, Rover

FACTS = Path(__file__).parents[2] / "golden" / "ardupilot" / "facts.json"
HOME = LocalFrame(-35.363261, 149.165230, 584.0)
STATION, STATION_COMPONENT = 255, 190


class Heard(NamedTuple):
    """A frame from the autopilot, and when it came, in seconds."""

    at: float
    name: str
    fields: dict[str, Any]


class Bench:
    """One vehicle, one ground station on one link."""

    def __init__(self, kind: str = "copter", *, warm: bool = True, **options: Any) -> None:
        self.kernel = VirtualKernel()
        spec = (
            Multirotor(sensors="rtk", heading_deg=353.0)
            if kind == "copter"
            else Rover(sensors="rtk", heading_deg=353.0)
        )
        self.world, (self.flight,) = make_world(self.kernel.now, [spec], seed=3, frame=HOME)
        self.autopilot = Autopilot(self.kernel, self.flight, DIALECT, warm=warm, **options)
        self.vehicle = self.autopilot.vehicle
        self.heard: list[Heard] = []
        self.latest: dict[str, dict[str, Any]] = {}
        self.link = self.another_link()
        self.link.receive(self._hear)

    def another_link(self) -> Any:
        """The station's end of one more link."""
        ours, theirs = in_process(self.kernel, MS, "station")
        self.autopilot.connect(theirs)
        return ours

    def _hear(self, frame: Frame) -> None:
        self.heard.append(Heard(self.now, frame.name, frame.fields))
        self.latest[frame.name] = frame.fields

    @property
    def now(self) -> float:
        return to_seconds(self.kernel.now())

    def send(self, name: str, *, system: int = STATION, **fields: Any) -> None:
        self.link.send(Frame(name, fields, system, STATION_COMPONENT))

    def at(self, seconds: float, action: Callable[[], None]) -> None:
        self.kernel.call_at(max(self.kernel.now(), from_seconds(seconds)), action)

    def run(self, seconds: float) -> None:
        self.kernel.run(self.kernel.now() + from_seconds(seconds))

    def run_until(self, done: Callable[[], bool], within: float = 120.0) -> float:
        """Seconds until *done*."""
        start = self.now
        while not done():
            assert self.now - start < within, (
                f"not within {within} s: mode {self.vehicle.mode.name}, {self.texts()[-3:]}"
            )
            self.kernel.run(self.kernel.now() + S // 20)
        return self.now - start

    def command(self, number: int, *params: float, **options: Any) -> int | None:
        """Send a COMMAND_LONG and return its MAV_RESULT, ``None`` if nothing answers."""
        values = {f"param{place}": float(value) for place, value in enumerate(params, start=1)}
        fields = {"target_system": 1, "target_component": 1, "command": number, **values, **options}
        return self._answered("COMMAND_LONG", number, fields)

    def command_int(self, number: int, **fields: Any) -> int | None:
        return self._answered(
            "COMMAND_INT", number, {"target_system": 1, "target_component": 1, "command": number, **fields}
        )

    def _answered(self, name: str, number: int, fields: dict[str, Any]) -> int | None:
        count = len(self.heard)
        self.send(name, **fields)
        self.run(0.05)
        answers = [one.fields for one in self.heard[count:] if one.name == "COMMAND_ACK"]
        return next((int(answer["result"]) for answer in answers if answer["command"] == number), None)

    def mode(self, number: int) -> int | None:
        return self.command(176, 1, number)

    def beat(self) -> None:
        """Heartbeats of the ground station from now on."""
        self.kernel.every(S, lambda: self.send("HEARTBEAT", type=6, autopilot=8))

    def sticks(self, *pulses: int, system: int = STATION) -> None:
        channels = {f"chan{number}_raw": pulse for number, pulse in enumerate(pulses, start=1)}
        self.send("RC_CHANNELS_OVERRIDE", system=system, target_system=1, target_component=1, **channels)

    def hold_sticks(self, seconds: float, *pulses: int) -> None:
        """Repeat them for that long, ten times a second."""
        for _ in range(round(seconds * 10)):
            self.sticks(*pulses)
            self.run(0.1)

    def stream(self, rate: int = 10, group: int = 0) -> None:
        self.send(
            "REQUEST_DATA_STREAM",
            target_system=1,
            target_component=1,
            req_stream_id=group,
            req_message_rate=rate,
            start_stop=1,
        )

    def texts(self) -> list[str]:
        return [one.fields["text"] for one in self.heard if one.name == "STATUSTEXT"]

    def names(self) -> list[str]:
        """The messages that came, each once, in order."""
        return list(dict.fromkeys(one.name for one in self.heard))

    def of(self, name: str) -> list[Heard]:
        return [one for one in self.heard if one.name == name]

    @property
    def height(self) -> float:
        return self.vehicle.height

    def airborne(self, height: float = 10.0) -> None:
        """In GUIDED at that height."""
        self.beat()
        assert self.mode(4) == 0
        assert self.command(400, 1) == 0
        assert self.command(22, 0, 0, 0, 0, 0, 0, height) == 0
        self.run_until(lambda: self.height > height - 0.3)
        self.run(6.0)


@pytest.fixture(scope="session")
def facts() -> dict[str, Any]:
    """What ``extract.py`` found in the recordings."""
    found: dict[str, Any] = json.loads(FACTS.read_text(encoding="utf-8"))
    return found


@pytest.fixture(scope="session")
def bench() -> type[Bench]:
    """Makes vehicles: ``bench()`` a warm copter, ``bench("rover", warm=False)`` a rover that boots."""
    return Bench
