"""A simulated ArduCopter under a control law, with a monitor of who has control and of the touch-down."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from volery.base.errors import VoleryError
from volery.base.time import MS, S, from_seconds
from volery.control.flight import ControlledFlight
from volery.control.manoeuvres import LawManoeuvre
from volery.control.safety_switch import SwitchSettings
from volery.kernel.waiting import sleep
from volery.run.assembly.vehicles import VehicleSettings, open_vehicles
from volery.run.connect import SCRIPT
from volery.run.go import ACTUATIONS
from volery.trace.events import ControlSample, Text
from volery.vehicles import Drone

DRONE = "ardupilot"
LOOK = 5 * MS


@dataclass
class Look:
    """What is true at one moment: time s, switch µs, whether a channel is overridden, mode, height m, m/s."""

    at: float
    switch: int
    overridden: bool
    mode: str
    armed: bool
    height: float
    climb: float


@dataclass
class Watched:
    """A flight that has ended."""

    looks: list[Look] = field(default_factory=list)
    samples: list[ControlSample] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)
    error: VoleryError | None = None
    authority: str = ""

    @property
    def touch_down(self) -> float:
        """Greatest rate of descent in m/s within the last 0.3 m of height before it came to rest."""
        low = [one for one in self.looks if one.height < 0.3 and one.climb < -0.05]
        flown = max((one.at for one in self.looks if one.height > 0.6), default=0.0)
        return max((-one.climb for one in low if one.at > flown), default=0.0)

    @property
    def end(self) -> Look:
        """The last look."""
        return self.looks[-1]


def fly_watched(
    make: Callable[[], LawManoeuvre],
    moves: Sequence[tuple[float, int]] = (),
    *,
    by: str = "setpoints",
    options: str = "",
    switch: SwitchSettings | None = None,
    limit_s: float = 120.0,
    height: float = 4.0,
    during: Callable[[Any, Drone], None] | None = None,
    after_s: float = 0.0,
    as_stated: bool = False,
) -> Watched:
    """Fly under a law while the switch moves.

    Args:
        make: makes the manoeuvre.
        moves: times in s and pulse widths of channel 6.
        by: how commands are applied.
        options: further options of the address.
        switch: settings of the switch.
        limit_s: time after which the flight is cut off.
        height: height of the take-off.
        during: called with the fleet and the drone before the flight.
        after_s: time that passes after the flight, s.
        as_stated: whether the gains are flown as they are.
    """
    url = f"sim:{DRONE}?start=warm&attitude=50&rate=20&rc=20{options}"
    opened = open_vehicles({DRONE: url}, {DRONE: Drone}, VehicleSettings())
    kernel, fleet, watched = opened.kernel, opened.fleet, Watched()
    drone = opened.vehicles[0]
    assert fleet is not None
    assert isinstance(drone, Drone)
    vehicle, truth = fleet.autopilots[DRONE].vehicle, fleet.flights[DRONE].truth
    for at, pulse in moves:
        fleet.move_transmitter(DRONE, from_seconds(at), 6, pulse)

    def look() -> None:
        body = truth()
        watched.looks.append(
            Look(
                kernel.now() / S,
                vehicle.rc.transmitter[5],
                vehicle.rc.overridden,
                vehicle.mode.name,
                vehicle.armed,
                body.position[2] - body.ground,
                body.velocity[2],
            )
        )

    def record(event: object) -> None:
        if isinstance(event, ControlSample):
            watched.samples.append(event)
        elif isinstance(event, Text):
            watched.texts.append(event.text)

    kernel.record = record
    if during is not None:
        during(fleet, drone)
    kernel.every(LOOK, look)
    flight = ControlledFlight(
        drone,
        make(),
        ACTUATIONS[by](drone),
        switch=switch,
        height=height,
        as_stated=lambda _: as_stated,
    )
    try:
        with kernel.adopt(SCRIPT):
            drone.wait_connected()
            kernel.call_at(from_seconds(limit_s), lambda: kernel.cancel(kernel.root, "the test is over"))
            try:
                flight.run()
            except VoleryError as error:
                watched.error = error
            watched.authority = flight.authority.value
            sleep(kernel, from_seconds(after_s))
    finally:
        drone.close()
        opened.leave()
        kernel.close()
    return watched
