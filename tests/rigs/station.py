"""A simulated autopilot at the end of a link that speaks MAVLink, and the ground station at the other."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from volery.base.frames import LocalFrame
from volery.base.time import MS, S, from_seconds, to_seconds
from volery.kernel.virtual import VirtualKernel
from volery.links.frame import Frame
from volery.links.in_process_link import in_process_pair
from volery.simulation.autopilots.autopilot import FirmwareFamily
from volery.simulation.autopilots.flight_stack.flight import make_world
from volery.simulation.world.body_specs import Multirotor, WheeledRover
from volery.trace.events import Record, ignore

GOLDEN = Path(__file__).parents[1] / "golden"
STATION, STATION_COMPONENT = 255, 190
TARGET = {"target_system": 1, "target_component": 1}


def facts_of(firmware: str) -> dict[str, Any]:
    """What ``extract.py`` found in the recordings of that firmware."""
    found: dict[str, Any] = json.loads((GOLDEN / firmware / "facts.json").read_text(encoding="utf-8"))
    return found


class Heard(NamedTuple):
    """A frame from the autopilot, and when it came, in seconds."""

    at: float
    name: str
    fields: dict[str, Any]


class Station:
    """One vehicle, one ground station on one link."""

    firmware: FirmwareFamily
    home: LocalFrame
    heading: float = 0.0
    features = ""  # that are on beside those that are on by default
    looks_per_second = 20  # while it waits
    record: Record = staticmethod(ignore)  # of the events of the run

    def __init__(
        self,
        kind: str = "copter",
        *,
        warm: bool = True,
        use: str = "",
        sensors: str = "rtk",
        seed: int = 3,
        features: str = "",
        **options: Any,
    ) -> None:
        self.kernel = VirtualKernel(self.record)
        body = Multirotor if kind == "copter" else WheeledRover
        spec = body(sensors=sensors, heading_deg=self.heading)
        self.world, (self.flight,) = make_world(self.kernel.now, [spec], seed=seed, frame=self.home)
        firmware = self.firmware.with_features(features or self.features)
        self.autopilot = firmware.create(self.kernel, self.flight, warm=warm, **options)
        self.vehicle = self.autopilot.vehicle
        self.received: list[Heard] = []
        self.latest: dict[str, dict[str, Any]] = {}
        self.link = self.another_link(use)
        self.link.receive(self._hear)

    def another_link(self, use: str = "") -> Any:
        """The station's end of one more link."""
        ours, theirs = in_process_pair(self.kernel, MS, "station")
        self.autopilot.connect(theirs, use=use)
        return ours

    def _hear(self, frame: Frame) -> None:
        self.received.append(Heard(self.now, frame.name, frame.fields))
        self.latest[frame.name] = frame.fields

    @property
    def now(self) -> float:
        return to_seconds(self.kernel.now())

    @property
    def height(self) -> float:
        return self.vehicle.height

    def run(self, seconds: float) -> None:
        self.kernel.run(self.kernel.now() + from_seconds(seconds))

    def run_until(self, done: Callable[[], bool], within: float = 120.0) -> float:
        """Seconds until *done*."""
        start = self.now
        while not done():
            assert self.now - start < within, (
                f"not within {within} s: mode {self.vehicle.mode.name}, {self.texts()[-3:]}"
            )
            self.kernel.run(self.kernel.now() + S // self.looks_per_second)
        return self.now - start

    # -- what is sent

    def send(self, name: str, *, system: int = STATION, **fields: Any) -> None:
        self.link.send(Frame(name, fields, system, STATION_COMPONENT))

    def beat(self) -> None:
        """Heartbeats of the ground station from now on."""
        self.kernel.every(S, lambda: self.send("HEARTBEAT", type=6, autopilot=8))

    def command(self, number: int, *params: float, **options: Any) -> int | None:
        """Send a COMMAND_LONG and return its MAV_RESULT, ``None`` if nothing answers."""
        values = {f"param{place}": 0.0 for place in range(1, 8)}
        values.update({f"param{place}": float(value) for place, value in enumerate(params, start=1)})
        return self._answered("COMMAND_LONG", number, {**values, **options})

    def command_int(self, number: int, **fields: Any) -> int | None:
        """Likewise a COMMAND_INT."""
        values = {f"param{place}": 0.0 for place in range(1, 5)}
        return self._answered("COMMAND_INT", number, {**values, **fields})

    def _answered(self, name: str, number: int, fields: dict[str, Any]) -> int | None:
        count = len(self.received)
        self.send(name, **{**TARGET, "command": number, **fields})
        self.run(0.05)
        answers = [one.fields for one in self.received[count:] if one.name == "COMMAND_ACK"]
        return next((int(answer["result"]) for answer in answers if answer["command"] == number), None)

    # -- what was heard

    def of(self, name: str) -> list[Heard]:
        return [one for one in self.received if one.name == name]

    def texts(self) -> list[str]:
        return [one.fields["text"] for one in self.of("STATUSTEXT")]
