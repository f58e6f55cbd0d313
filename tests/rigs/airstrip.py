"""A simulated vehicle in virtual time, flown by its driver over a link, with a pilot beside."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rigs.missions import carried_out
from volery.base.frames import LocalFrame
from volery.base.installed import Registry
from volery.base.position import AMSL, AboveHome, Position
from volery.base.seeds import stream
from volery.base.time import MS, S
from volery.kernel.virtual import VirtualKernel
from volery.links.frame import Frame
from volery.links.in_process_link import in_process_pair
from volery.links.link import Link
from volery.links.wire_faults import WireFaults, faulty_pair
from volery.simulation.autopilots.flight_stack.flight import make_world
from volery.simulation.world.body_specs import Multirotor, WheeledRover
from volery.trace.events import Operation
from volery.vehicles import Drone, Vehicle

FRAME = LocalFrame(46.0825, -103.8995, 900.0)
dialects: Registry[Any] = Registry("volery.autopilots", "autopilot")


def at(east: float, north: float, height: float = 10.0) -> Position:
    """Metres from where the vehicle stands."""
    latitude, longitude, _ = FRAME.from_enu((east, north, 0.0))
    return Position(latitude, longitude, AboveHome(height))


class Airstrip:
    """One simulated vehicle, its driver, and a second station that plays the pilot."""

    firmware: str
    version = ""
    """Version of that firmware; the newest if empty."""
    opener: Any

    def __init__(
        self,
        kind: type[Vehicle] = Drone,
        *,
        warm: bool = True,
        faults: WireFaults | None = None,
        parameters: dict[str, float] | None = None,
        logging: bool = False,
    ) -> None:
        self.events: list[Any] = []
        self.kernel = VirtualKernel(record=self.events.append)
        body = Multirotor() if kind is Drone else WheeledRover()
        _, (self.flight,) = make_world(self.kernel.now, [body], seed=7, frame=FRAME)
        firmware = dialects.load(self.firmware).of_version(self.version)
        self.autopilot = firmware.create(
            self.kernel,
            self.flight,
            warm=warm,
            name="craft_1",
            parameters=parameters,
            logging=logging,
        )
        self.link = self._connect(faults)
        self._pilot, theirs = in_process_pair(self.kernel, name="pilot")
        self.autopilot.connect(theirs)
        self.kind = kind
        self.vehicle: Any = self.open()

    def _connect(self, faults: WireFaults | None) -> Link:
        ours: Link
        theirs: Link
        if faults is None:
            ours, theirs = in_process_pair(self.kernel, 2 * MS)
        else:
            ours, theirs = faulty_pair(self.kernel, "radio", faults, stream(7, "radio"))
        self.autopilot.connect(theirs)
        return ours

    def open(self) -> Vehicle | None:
        """The vehicle, unless it is opened by the mission's task."""
        return self.commanded_by(self.opener(self.kernel, self.link, "craft_1", {"texts": "unrecorded"}))

    def commanded_by(self, driver: Any) -> Vehicle:
        return self.kind(self.kernel, "craft_1", driver, truth=self.truth)

    def truth(self) -> Position:
        latitude, longitude, amsl = FRAME.from_enu(self.flight.truth().position)
        return Position(latitude, longitude, AMSL(amsl))

    def fly(self, mission: Callable[[Any], Any]) -> Any:
        return carried_out(self.kernel, lambda: mission(self.vehicle))

    def station_sends(self, name: str, after_s: float, **stated: float) -> None:
        frame = Frame(name, {"target_system": 1, "target_component": 1, **stated}, 254, 190)
        self.kernel.call_at(self.kernel.now() + round(after_s * S), lambda: self._pilot.send(frame))

    def operations(self) -> list[Operation]:
        return [event for event in self.events if isinstance(event, Operation)]
