"""A simulated autopilot: its firmware as data, and the object that runs one vehicle behind the protocol.

The flight stack reads the groups of a ``Firmware`` and never branches on its name. What an
``AutopilotVehicle`` needs of its firmware stands in ``VehicleRules``; what manoeuvres and protocol endpoints
need is passed to them directly. A protocol endpoint is one protocol of one vehicle: on any number of links,
or as a node on a ROS graph.

```python
world, flights = make_world(kernel.now, [Multirotor()], seed=7, frame=frame)
autopilot = firmwares.load("ardupilot").create(kernel, flights[0], warm=True)
ours, theirs = in_process_pair(kernel, 0, "drone_1", MAVLINK)
autopilot.connect(theirs)
```
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, MutableSequence, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from math import nan
from typing import NamedTuple

from volery.base.errors import UsageError, choices
from volery.base.frames import Vector, ned_to_enu
from volery.base.time import MS, Ns, S
from volery.kernel.api import Action, Handle, Kernel
from volery.kernel.task import ExecutionContext
from volery.links.link import Link, WireFormat
from volery.links.mavlink_codec import MAVLINK
from volery.ros.graph import RosGraph
from volery.simulation.autopilots.fleet_autopilot import DefaultLink
from volery.simulation.autopilots.flight_recorder import FlightRecorder
from volery.simulation.autopilots.flight_stack.flight import Flight
from volery.simulation.autopilots.protocol_endpoint import GraphEndpoint, LinkEndpoint, ProtocolEndpoint
from volery.simulation.autopilots.vehicle_state import (
    AutopilotVehicle,
    VehicleAction,
    VehicleRules,
    do_nothing,
)
from volery.trace.events import VehicleState


class BootEvent(NamedTuple):
    """An action at a fixed time after boot."""

    after: Ns
    act: VehicleAction


class BootSequence(NamedTuple):
    """What a firmware does by itself after power-on, and for a vehicle that starts warm."""

    events: tuple[BootEvent, ...]
    on_warm: VehicleAction
    """Bring a warm vehicle to the state in which the boot leaves it, except for its position."""
    on_warm_position: VehicleAction = do_nothing
    """Called a moment later, when the estimator of a warm vehicle has a position."""


class WatchedCondition(NamedTuple):
    """A condition that is checked regularly, and the actions when it begins and when it ends."""

    name: str
    tripped: Callable[[AutopilotVehicle], bool]
    begins: VehicleAction
    ends: VehicleAction = do_nothing


_GAUGE_RESET: Ns = 20 * MS
"""From another battery to the reset of its gauge, which is not to count the old one."""


@dataclass(frozen=True, kw_only=True)
class PeriodicWork:
    """What a firmware does at fixed intervals."""

    tick: Ns = 100 * MS
    """Period of the manoeuvre and of ``on_step``."""
    on_step: VehicleAction
    """Called at each tick, after the manoeuvre."""
    failsafe_ticks: int = 3
    """Failsafes are checked at each multiple of so many ticks."""
    each_second: VehicleAction = do_nothing
    each_second_from: Ns = 0
    """Phase of ``each_second`` after boot."""


@dataclass(frozen=True, kw_only=True)
class Firmware:
    """One firmware for one kind of vehicle."""

    name: str
    kind: str
    """``multirotor`` or ``rover``."""
    rules: VehicleRules
    boot: BootSequence
    periodic: PeriodicWork
    failsafes: tuple[WatchedCondition, ...] = ()
    """In the order in which they are checked."""
    endpoint: Callable[[AutopilotVehicle], ProtocolEndpoint]
    """Create the endpoint of the firmware's protocol (telemetry and commands)."""


GROUND_STATION = DefaultLink("udp://127.0.0.1:14550")
"""Where ground stations listen for MAVLink."""


@dataclass(frozen=True)
class FirmwareFamily:
    """The firmwares of one autopilot project by kind of vehicle, and the codec of their links.

    Without a codec the autopilot is reached over a ROS graph.
    """

    name: str
    kinds: Mapping[str, Firmware]
    """Those of the newest version."""
    codec: WireFormat | None = MAVLINK
    default_links: tuple[DefaultLink, ...] = (GROUND_STATION,)
    """Links that ``volery vehicle serve`` opens unless addresses are given."""
    versions: Mapping[str, Mapping[str, Firmware]] = field(default_factory=dict)
    """``kinds`` of each version, the newest last; empty where there is one only."""
    airframes: bool = False
    """Whether it can be configured for the airframe of a model."""
    version: str = ""
    """The version that was chosen."""
    optional: Sequence[str] = ()
    """Names of features that are off unless they are asked for."""
    with_optional: Callable[[frozenset[str]], Mapping[str, Mapping[str, Firmware]]] | None = None
    """Return ``versions`` with some of these features."""

    def of_version(self, version: str) -> FirmwareFamily:
        """Return the family with the firmwares of one version; of the newest if *version* is empty.

        Raises:
            UsageError: There is no such version.
        """
        if not version:
            return self
        if version not in self.versions:
            there = f"there is {choices(self.versions)}" if self.versions else "there is one only"
            raise UsageError(f"a simulated {self.name} has no version {version!r}; {there}")
        return replace(self, kinds=self.versions[version], version=version)

    def with_features(self, names: str) -> FirmwareFamily:
        """Return the family with features that are off by default.

        Args:
            names: Their names with commas between them, or ``all``; empty: none.

        Raises:
            UsageError: There is no such feature.
        """
        wanted, known = [name.strip() for name in names.split(",") if name.strip()], ("all", *self.optional)
        if not wanted:
            return self
        if self.with_optional is None:
            raise UsageError(f"a simulated {self.name} has no features that are off by default: {names!r}")
        unknown = [name for name in wanted if name not in known]
        if unknown:
            there = choices(known)
            raise UsageError(
                f"a simulated {self.name} has no feature {unknown[0]!r}; off by default: {there}"
            )
        versions = self.with_optional(frozenset(self.optional if "all" in wanted else wanted))
        kinds = versions[self.version or list(versions)[-1]]
        return replace(self, kinds=kinds, versions=versions)

    def create(
        self,
        kernel: Kernel,
        flight: Flight,
        *,
        system: int = 1,
        parameters: Mapping[str, float] | None = None,
        warm: bool = False,
        name: str = "",
        logging: bool = False,
    ) -> Autopilot:
        """Return an autopilot with the firmware for the kind of body; see ``AutopilotFamily``.

        Raises:
            UsageError: It has no such parameter, or no firmware for the kind.
        """
        kind = _kind_of(flight)
        if kind not in self.kinds:
            raise UsageError(f"{self.name} has no {kind}; it has {choices(self.kinds)}")
        return Autopilot(
            kernel,
            flight,
            self.kinds[kind],
            system=system,
            parameters=parameters,
            warm=warm,
            name=name,
            logging=logging,
        )


WARM_UP = 300 * MS
"""Time after creation at which a warm vehicle has its position and its home."""


class Autopilot:
    """One vehicle's autopilot, a ``FleetAutopilot``: *firmware* on the flight stack.

    The other arguments are those of ``AutopilotFamily.create``.

    Raises:
        UsageError: The firmware has no such parameter or is for another kind of vehicle.
    """

    def __init__(
        self,
        kernel: Kernel,
        flight: Flight,
        firmware: Firmware,
        *,
        system: int = 1,
        parameters: Mapping[str, float] | None = None,
        warm: bool = False,
        name: str = "",
        logging: bool = False,
    ) -> None:
        self._kernel = kernel
        self._flight = flight
        kind = _kind_of(flight)
        if firmware.kind != kind:
            raise UsageError(f"{firmware.name} is for a {firmware.kind}, but the body is a {kind}")
        self.firmware = firmware
        self.name = name or f"{firmware.name}_{system}"
        self.vehicle = AutopilotVehicle(
            kernel, flight, firmware.rules, system=system, name=self.name, overrides=parameters
        )
        self.transmitter: MutableSequence[int] = self.vehicle.rc.transmitter
        """See ``FleetAutopilot``."""
        self.endpoint: ProtocolEndpoint = firmware.endpoint(self.vehicle)
        self.vehicle.output = self.endpoint
        self._recorder = FlightRecorder(self.vehicle) if logging else None
        self.on_reboot: Action = _nothing
        """Called when a station restarts the autopilot, so that the server of its links can close them."""
        self._timers: list[Handle] = []
        self._ticks = 0
        self._origin: tuple[Vector, Vector] | None = None
        self._booted = warm
        self.vehicle.restart = self._restart
        if warm:
            self._boot(firmware.rules.startup.warm_age)

    # -- life

    @property
    def banner(self) -> bytes:
        """Bytes that the autopilot writes to a new byte connection before any frame."""
        return self._on_links().banner

    def connect(self, link: Link, *, switch_on: bool = True, use: str = "") -> None:
        """Serve *link*, and boot if that has not happened yet.

        Args:
            link: The autopilot's end of the link.
            switch_on: Whether to boot a cold vehicle.
            use: What the firmware uses the link for, such as ``station``; empty: its default.
        """
        self._on_links().connect(link, use)
        if switch_on:
            self.switch_on()

    def join(
        self, graph: RosGraph, namespace: str, place: ExecutionContext, *, switch_on: bool = True
    ) -> None:
        """Serve on a ROS graph, and boot if that has not happened yet.

        Args:
            graph: The graph.
            namespace: Prefix of all names.
            place: Execution context that the node's computing is charged to.
            switch_on: Whether to boot a cold vehicle.

        Raises:
            UsageError: The firmware is reached over links.
        """
        if not isinstance(self.endpoint, GraphEndpoint):
            raise UsageError(f"{self.name}: a simulated {self.firmware.name} is reached over links")
        self.endpoint.join(graph, namespace, place)
        if switch_on:
            self.switch_on()

    def _on_links(self) -> LinkEndpoint:
        if not isinstance(self.endpoint, LinkEndpoint):
            raise UsageError(f"{self.name}: a simulated {self.firmware.name} is reached over a graph")
        return self.endpoint

    def switch_on(self) -> None:
        """Boot, if that has not happened yet: a firmware on TCP waits for its first client."""
        if not self._booted:
            self._booted = True
            self._boot(0)

    def disconnect(self, link: Link) -> None:
        """Stop serving *link*. The vehicle flies on."""
        self._on_links().disconnect(link)

    def close(self) -> None:
        """Stop all timers and close all links."""
        self._halt()
        self.endpoint.close()

    def _halt(self) -> None:
        for timer in self._timers:
            timer.cancel()
        self._timers.clear()
        self.endpoint.stop()

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
        self.endpoint.start()
        self._timers.append(self._kernel.every(firmware.periodic.tick, self._tick))
        phase = (firmware.periodic.each_second_from - age) % S
        self._at(
            age + phase,
            lambda: self._timers.append(
                self._kernel.every(S, lambda: firmware.periodic.each_second(vehicle))
            ),
        )

    def _at(self, uptime: Ns, action: Action) -> None:
        self._timers.append(self._kernel.call_at(self.vehicle.boot_at + uptime, action))

    def _tick(self) -> None:
        vehicle, firmware = self.vehicle, self.firmware
        self._ticks += 1
        if vehicle.armed:
            vehicle.update_ground()
            vehicle.run_manoeuvre()
        firmware.periodic.on_step(vehicle)
        if self._recorder is not None:
            self._recorder.on_tick()
        if self._ticks % firmware.periodic.failsafe_ticks == 0:
            self._check_failsafes()

    def _check_failsafes(self) -> None:
        """Begin and end failsafes whose condition has changed."""
        vehicle = self.vehicle
        for failsafe in self.firmware.failsafes:
            tripped, was = failsafe.tripped(vehicle), failsafe.name in vehicle.failsafes.active
            if tripped and not was:
                vehicle.failsafes.active.add(failsafe.name)
                failsafe.begins(vehicle)
            elif was and not tripped:
                vehicle.failsafes.active.discard(failsafe.name)
                failsafe.ends(vehicle)

    def swap_battery(self) -> None:
        """Fly on a full battery from now on.

        Its gauge and its failsafes begin anew, as after a power cycle; nothing else is restarted.
        """
        self._flight.set_charge(1.0)
        self._kernel.call_at(self._kernel.now() + _GAUGE_RESET, self._reset_gauge)

    def _reset_gauge(self) -> None:
        self.vehicle.reports.gauge_offset_mah = 0.0
        for name in [one for one in self.vehicle.failsafes.active if "battery" in one]:
            self.vehicle.failsafes.active.discard(name)

    # -- for recorders

    def state(self) -> VehicleState:
        """Return true and estimated state of the vehicle now, for a trace."""
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
        """Convert NED about the estimator's origin to ENU about the world's."""
        if self._origin is None or self._origin[0] != origin:
            self._origin = origin, self._flight.frame.to_ned(*origin)
        offset = self._origin[1]
        return ned_to_enu((position[0] + offset[0], position[1] + offset[1], position[2] + offset[2]))


def _kind_of(flight: Flight) -> str:
    return "multirotor" if flight.flying else "rover"


def _nothing() -> None:
    """Do nothing."""
