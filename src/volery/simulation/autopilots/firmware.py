"""Firmwares of simulated autopilots, as data and small functions by subject, and their protocol endpoints.

The flight stack reads these groups and never branches on the name of a firmware. What a ``Vehicle`` needs
of its firmware stands in ``VehicleRules``; what manoeuvres and protocol endpoints need is passed to them
directly. A protocol endpoint is one protocol of one vehicle: on any number of links, or as a node on a ROS
graph.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

from volery.base.installed import Registry
from volery.base.time import MS, Ns
from volery.kernel.task import ExecutionContext
from volery.links.link import Codec, Link
from volery.links.mavlink_codec import MAVLINK
from volery.ros.graph import RosGraph
from volery.simulation.autopilots.vehicle_state import (
    Vehicle,
    VehicleAction,
    VehicleOutput,
    VehicleRules,
    do_nothing,
)


class ProtocolEndpoint(VehicleOutput, Protocol):
    """One vehicle's protocol."""

    def start(self) -> None:
        """Start what is sent regularly, at the phase of the boot."""

    def stop(self) -> None:
        """Stop sending: the vehicle was switched off."""

    def close(self) -> None:
        """Close all links or the node."""


@runtime_checkable
class LinkEndpoint(ProtocolEndpoint, Protocol):
    """A protocol on links."""

    @property
    def banner(self) -> bytes:
        """Bytes that the autopilot writes to a new byte connection before any frame."""

    def connect(self, link: Link, use: str = "") -> None:
        """Serve *link*.

        Args:
            link: The autopilot's end of the link.
            use: What the firmware uses the link for; empty: its default.
        """

    def disconnect(self, link: Link) -> None:
        """Stop serving *link*."""


@runtime_checkable
class GraphEndpoint(ProtocolEndpoint, Protocol):
    """A protocol of topics and services on a ROS graph."""

    def join(self, graph: RosGraph, namespace: str, place: ExecutionContext) -> None:
        """Serve on *graph*.

        Args:
            graph: The graph.
            namespace: Prefix of all names.
            place: Execution context that the node's computing is charged to.
        """


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


class Failsafe(NamedTuple):
    """A condition that is checked regularly, and the actions when it begins and when it ends."""

    name: str
    tripped: Callable[[Vehicle], bool]
    begins: VehicleAction
    ends: VehicleAction = do_nothing


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
    failsafes: tuple[Failsafe, ...] = ()
    """In the order in which they are checked."""
    endpoint: Callable[[Vehicle], ProtocolEndpoint]
    """Create the endpoint of the firmware's protocol (telemetry and commands)."""


class DefaultLink(NamedTuple):
    """An address to which a firmware connects by default, and what the firmware uses that link for."""

    address: str
    use: str = ""


GROUND_STATION = DefaultLink("udp://127.0.0.1:14550")
"""Where ground stations listen for MAVLink."""


@dataclass(frozen=True)
class FirmwareFamily:
    """The firmwares of one autopilot project by kind of vehicle, and the codec of their links.

    Without a codec the autopilot is reached over a ROS graph.
    """

    name: str
    kinds: Mapping[str, Firmware]
    codec: Codec | None = MAVLINK
    default_links: tuple[DefaultLink, ...] = (GROUND_STATION,)
    """Links that ``volery serve`` opens unless addresses are given."""


firmwares: Registry[FirmwareFamily] = Registry("volery.autopilots", "simulated autopilot")
"""Entry points of the group ``volery.autopilots``."""
