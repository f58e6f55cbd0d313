"""A simulated autopilot: one vehicle's flight stack behind the protocol of its firmware.

```python
world, flights = make_world(kernel.now, [Multirotor()], seed=7, frame=frame)
autopilot = Autopilot(kernel, flights[0], dialects.load("ardupilot"), warm=True)
ours, theirs = in_process(kernel, "drone_1")
autopilot.connect(theirs)
```
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from math import nan

from volery.base.errors import UsageError, choices
from volery.base.frames import Vector, ned_to_enu
from volery.base.time import MS, Ns, S
from volery.kernel.api import Action, Handle, Kernel
from volery.kernel.task import ExecutionContext
from volery.links.link import Link
from volery.ros.graph import RosGraph
from volery.simulation.autopilots.endpoint import GraphEndpoint, LinkEndpoint, ProtocolEndpoint
from volery.simulation.autopilots.firmware import Firmware, FirmwareFamily
from volery.simulation.autopilots.flight_stack.flight import Flight
from volery.simulation.autopilots.vehicle_state import Vehicle
from volery.trace.events import VehicleState

WARM_UP = 300 * MS
"""A warm vehicle has its position and its home this long after it was made."""


class Autopilot:
    """One vehicle's autopilot. *dialect* is a firmware's, or the firmware: then the kind of body chooses.

    ``warm``: booted, with a position, before the run begins. Cold, it boots when the first link is
    connected, and takes as long as the firmware does. ``parameters`` replace the firmware's values. Raises
    ``UsageError`` for a parameter or a kind of vehicle that the firmware does not know.
    """

    def __init__(
        self,
        kernel: Kernel,
        flight: Flight,
        firmware: Firmware | FirmwareFamily,
        *,
        system: int = 1,
        parameters: Mapping[str, float] | None = None,
        warm: bool = False,
        name: str = "",
    ) -> None:
        self._kernel = kernel
        self._flight = flight
        chosen = _of_kind(firmware, "multirotor" if flight.flying else "rover")
        self.firmware = chosen
        self.name = name or f"{chosen.name}_{system}"
        self.vehicle = Vehicle(
            kernel, flight, chosen.rules, system=system, name=self.name, overrides=parameters
        )
        self.face: ProtocolEndpoint = chosen.endpoint(self.vehicle)
        self.vehicle.outlet = self.face
        self.on_reboot: Action = _nothing
        """Called when a station restarts the autopilot: whoever serves its links may close them."""
        self._clocks: list[Handle] = []
        self._ticks = 0
        self._origin: tuple[Vector, Vector] | None = None
        self._booted = warm
        self.vehicle.restart = self._restart
        if warm:
            self._boot(chosen.rules.startup.warm_age)

    # -- life

    @property
    def banner(self) -> bytes:
        """The first bytes on a wire after the autopilot was switched on, if they are no frame."""
        return self._on_links().banner

    def connect(self, link: Link, *, switch_on: bool = True, use: str = "") -> None:
        """Serve this link, too. The first one switches a cold vehicle on, unless *switch_on* is False.

        *use* is what the firmware has the link for, such as ``station``; by default its usual one.
        """
        self._on_links().connect(link, use)
        if switch_on:
            self.switch_on()

    def join(
        self, graph: RosGraph, namespace: str, place: ExecutionContext, *, switch_on: bool = True
    ) -> None:
        """Serve on *graph* under *namespace*; the node's computing is spent at *place*. A cold vehicle is
        switched on, unless *switch_on* is False. Raises ``UsageError`` for a firmware that speaks on links.
        """
        if not isinstance(self.face, GraphEndpoint):
            raise UsageError(f"{self.name}: a simulated {self.firmware.name} is reached over links")
        self.face.join(graph, namespace, place)
        if switch_on:
            self.switch_on()

    def _on_links(self) -> LinkEndpoint:
        if not isinstance(self.face, LinkEndpoint):
            raise UsageError(f"{self.name}: a simulated {self.firmware.name} is reached over a graph")
        return self.face

    def switch_on(self) -> None:
        """Boot now, if that has not happened yet: a firmware on TCP waits for its first client."""
        if not self._booted:
            self._booted = True
            self._boot(0)

    def disconnect(self, link: Link) -> None:
        """Stop serving it. The vehicle flies on."""
        self._on_links().disconnect(link)

    def close(self) -> None:
        """Stop all clocks and serve no link any more."""
        self._halt()
        self.face.hang_up()

    def _halt(self) -> None:
        for clock in self._clocks:
            clock.cancel()
        self._clocks.clear()
        self.face.stop()

    def _restart(self) -> None:
        self._halt()
        self._flight.forget_origin()
        self._boot(0)
        self.on_reboot()

    def _boot(self, age: Ns) -> None:
        vehicle, firmware = self.vehicle, self.firmware
        vehicle.boot(age)
        self._ticks = 0
        if age:
            self._flight.set_origin()
            firmware.boot.on_warm(vehicle)
            self._at(age + WARM_UP, lambda: firmware.boot.on_warm_position(vehicle))
        else:
            for event in firmware.boot.events:
                self._at(event.after, partial(event.act, vehicle))
        self.face.start()
        self._clocks.append(self._kernel.every(firmware.periodic.tick, self._tick))
        phase = (firmware.periodic.each_second_from - age) % S
        self._at(
            age + phase,
            lambda: self._clocks.append(
                self._kernel.every(S, lambda: firmware.periodic.each_second(vehicle))
            ),
        )

    def _at(self, uptime: Ns, action: Action) -> None:
        self._clocks.append(self._kernel.call_at(self.vehicle.boot_at + uptime, action))

    def _tick(self) -> None:
        vehicle, firmware = self.vehicle, self.firmware
        self._ticks += 1
        if vehicle.armed:
            vehicle.watch_ground()
            vehicle.act()
        firmware.periodic.on_step(vehicle)
        if self._ticks % firmware.periodic.failsafe_ticks == 0:
            self._watch()

    def _watch(self) -> None:
        """Look whether a failsafe begins or ends."""
        vehicle = self.vehicle
        for failsafe in self.firmware.failsafes:
            tripped, was = failsafe.tripped(vehicle), failsafe.name in vehicle.failsafes
            if tripped and not was:
                vehicle.failsafes.add(failsafe.name)
                failsafe.begins(vehicle)
            elif was and not tripped:
                vehicle.failsafes.discard(failsafe.name)
                failsafe.ends(vehicle)

    # -- for recorders

    def state(self) -> VehicleState:
        """The vehicle now, as it is and as its autopilot believes: for a trace."""
        truth, estimate = self._flight.truth(), self._flight.estimate()
        x, y, z = truth.position
        east, north, up = (nan, nan, nan)
        if self.vehicle.has_position:
            east, north, up = self._about_world(estimate.origin, estimate.position)
        return VehicleState(
            self._kernel.now(),
            self.name,
            x,
            y,
            z,
            *truth.attitude,
            *truth.velocity,
            east,
            north,
            up,
            estimate.battery_left,
            estimate.battery_volts,
            estimate.battery_amps,
            self.vehicle.armed,
            self.vehicle.mode.name,
        )

    def _about_world(self, origin: Vector, position: Vector) -> Vector:
        """NED about the estimator's origin to ENU about the world's."""
        if self._origin is None or self._origin[0] != origin:
            self._origin = origin, self._flight.frame.to_ned(*origin)
        offset = self._origin[1]
        return ned_to_enu((position[0] + offset[0], position[1] + offset[1], position[2] + offset[2]))


def _of_kind(firmware: Firmware | FirmwareFamily, kind: str) -> Firmware:
    if isinstance(firmware, Firmware):
        if firmware.kind != kind:
            raise UsageError(f"{firmware.name} flies a {firmware.kind}, but the body is a {kind}")
        return firmware
    if kind not in firmware.kinds:
        raise UsageError(f"{firmware.name} has no {kind}; it has {choices(firmware.kinds)}")
    return firmware.kinds[kind]


def _nothing() -> None:
    """Nobody wants to know."""
