"""Vehicles on a ROS graph: the node that serves a vehicle, its names, and the driver that uses them.

| links of the autopilot | node | names |
|---|---|---|
| MAVLink | ``bridge.VehicleNode`` | MAVROS's, under ``/<vehicle>`` |
| pprzlink | ``bridge.PprzrosNode`` | pprzros's, under ``/<vehicle>`` |
| none: the autopilot is a node itself | its own | those of its SDK, where its driver expects them |

A simulated vehicle that a script commands over a graph gets a private graph. It takes the place of a link:
calls on it cost nothing and are not recorded. With faults, messages behave like the frames of a transport,
which are numbered and have a checksum:

* a corrupted or truncated frame is dropped, as is a frame during an interruption;
* a duplicate is delivered once; a frame that is overtaken arrives late;
* a request or a response that is lost fails at its caller after ``GIVE_UP_AFTER``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from random import Random
from typing import TYPE_CHECKING, NamedTuple

from volery.base.elementary import exp, log
from volery.base.errors import CapabilityError, ModelError, choices
from volery.base.frames import LocalFrame
from volery.base.seeds import stream
from volery.base.time import MS, Ns
from volery.kernel.api import Action, Kernel
from volery.kernel.task import ExecutionContext
from volery.links.link import Link, WireFormat
from volery.links.wire_faults import REORDER_DELAY, WireFaults
from volery.model.environment import VehicleSpec
from volery.ros.graph import EmbeddedGraph, RosGraph
from volery.ros.graph.interface import NodeId, Route
from volery.ros.messages import RosMessage, cdr_size
from volery.run.assembly.simulated_vehicles import LINK_DELAY, SimulatedVehicle
from volery.vehicles.driver import Driver, Opener, drivers

if TYPE_CHECKING:
    from volery.run.assembly.simulated_fleet import SimulatedFleet

FRAME_OVERHEAD = 30
"""Bytes that a transport adds to a message."""
GIVE_UP_AFTER: Ns = 500 * MS
NO_FAULTS = WireFaults()
"""A link without faults."""


class GraphWire:
    """Route of messages between two nodes. Faults are drawn from *random* in the order of sending."""

    def __init__(self, kernel: Kernel, random: Random, faults: WireFaults | None = None) -> None:
        self._kernel = kernel
        self._random = random
        self._faults = faults or NO_FAULTS
        self._latest: dict[tuple[str, str], Ns] = {}
        self._together: list[Action] = []  # messages that were sent at this instant
        self._sent: Ns = -1

    def set_faults(self, faults: WireFaults) -> None:
        """Apply *faults* to the messages in both directions from now on."""
        self._faults = faults

    def size_of(self, message: RosMessage) -> int:
        """Return the size of a message where it matters, for bits that flip; else 0."""
        return cdr_size(message) if self._faults.flip else 0

    def route(self, sender: NodeId, receiver: NodeId) -> Route:
        """Return the route between two nodes. It keeps the order of messages unless faults reorder them.

        See ``volery.ros.graph.Routing``.
        """
        return partial(self._carry, sender.name, receiver.name)

    def _carry(
        self, sender: str, receiver: str, size: int, _reliable: bool, deliver: Action, lost: Action
    ) -> None:
        now = self._kernel.now()
        if self._faults is NO_FAULTS and not self._latest:
            if self._sent != now:  # messages of one instant arrive together, in one event of the kernel
                self._sent, self._together = now, []
                self._kernel.call_at(now + LINK_DELAY, partial(_run_all, self._together))
            self._together.append(deliver)
            return
        if self._is_lost(size + FRAME_OVERHEAD):
            self._kernel.call_at(now + GIVE_UP_AFTER, lost)
            return
        faults, random = self._faults, self._random
        delay = int(random.random() * faults.jitter) if faults.jitter else 0
        pair = sender, receiver
        self._latest[pair] = arrives = max(self._latest.get(pair, 0), now + LINK_DELAY + delay)
        if faults.reorder and random.random() < faults.reorder:
            arrives += REORDER_DELAY
        self._kernel.call_at(arrives, deliver)

    def _is_lost(self, octets: int) -> bool:
        faults, random = self._faults, self._random
        chances = [faults.drop, faults.burst, faults.truncate]
        if faults.flip:
            chances.append(1.0 - exp(octets * log(1.0 - faults.flip)))
        drawn = [random.random() < chance for chance in chances if chance]
        return any(drawn) or faults.cut_at(self._kernel.now())


def _run_all(actions: list[Action]) -> None:
    for action in actions:
        action()


def private_graph(kernel: Kernel, wire: GraphWire, *, as_bytes: bool) -> EmbeddedGraph:
    """Return an unrecorded graph whose messages travel over *wire*.

    Args:
        kernel: Kernel of the graph.
        wire: Route between each two nodes.
        as_bytes: Encode and decode each message, as a transport does.
    """
    return EmbeddedGraph(kernel, route=wire.route, unrecorded=True, as_bytes=as_bytes, size_of=wire.size_of)


class NodeNames(NamedTuple):
    """How a vehicle's node is named.

    Attributes:
        whose: Whose names it has; empty for ``mavros``.
        ros2: Whether as in ROS 2.
        pose_transform: Whether it publishes the pose on ``/tf``.
        at_root: Whether its names lie below ``/``, else below ``/<vehicle>``.
    """

    whose: str = ""
    ros2: bool = False
    pose_transform: bool = True
    at_root: bool = False


_DEFAULT_NAMES = NodeNames()

Serve = Callable[[RosGraph, Link, str, ExecutionContext, LocalFrame, NodeNames], object]
"""``serve(graph, link, vehicle, context, origin, names)``."""


def _mavros(
    graph: RosGraph, link: Link, vehicle: str, context: ExecutionContext, origin: LocalFrame, names: NodeNames
) -> object:
    from volery.bridge import MAVLINK_SCHEMES, VehicleNodeOptions, serve_vehicle  # loads all messages

    options = VehicleNodeOptions(origin=origin, best_effort=names.ros2, pose_transform=names.pose_transform)
    if names.whose not in ("", MAVROS_NAMES):
        options = VehicleNodeOptions(names=MAVLINK_SCHEMES[names.whose], control=True)
    return serve_vehicle(graph, link, "" if names.at_root else vehicle, context, options)


def _pprzros(
    graph: RosGraph, link: Link, vehicle: str, context: ExecutionContext, origin: LocalFrame, names: NodeNames
) -> object:
    from volery.bridge import serve_pprzros

    return serve_pprzros(graph, link, vehicle, context)


NODES: Mapping[str, Serve] = {"MAVLink": _mavros, "pprzlink": _pprzros}
"""By the name of the codec."""

MAVROS_NAMES, ROSCOPTER_NAMES = "mavros", "roscopter"
NAMES_OF = {"MAVLink": (MAVROS_NAMES, ROSCOPTER_NAMES), "pprzlink": ("pprzros",)}
"""Whose names that node can have; the first is the default."""
OWN_NAMES = {
    "px4": ("px4", "px4-1.16", "px4-1.15", "px4-1.14"),
    "ardupilot": ("ardupilot", "ardupilot-4.5"),
}
"""Names of an autopilot's own ROS 2 interface, which its node can have as well."""


def own_names(names: str) -> bool:
    """Return whether these are names of an autopilot's own ROS 2 interface."""
    return any(names in valid for valid in OWN_NAMES.values())


def use_message_versions(vehicles: Iterable[VehicleSpec]) -> None:
    """Define messages as the firmwares have them whose own names the nodes of *vehicles* have.

    It is done before anything uses messages: before components are compiled, and when a node begins.
    """
    names = [vehicle.names for vehicle in vehicles if own_names(vehicle.names)]
    if names:
        from volery.bridge import MAVLINK_SCHEMES  # loads all messages

        for one in names:
            MAVLINK_SCHEMES[one].prepare()


def topics_below(names: str) -> str:
    """Return the beginning of the topics of an autopilot's own interface; empty for other names."""
    return {"px4": "fmu/", "ardupilot": "ap/"}.get(names.partition("-")[0], "")


def at_root(vehicle: VehicleSpec, vehicles: Iterable[VehicleSpec]) -> bool:
    """Return whether the names of the node of a vehicle lie below ``/``.

    Those of an autopilot's own interface do, as on an aircraft, unless several of *vehicles* have them.
    """
    return own_names(vehicle.names) and sum(own_names(vehicle.names) for vehicle in vehicles) == 1


SIMULATED_LINK_OPTIONS = {"texts": "unrecorded"}
"""Driver options for a simulated vehicle on a link: its autopilot records its status texts itself."""


def node_name(vehicle: str) -> str:
    """Return the component name of the node that serves *vehicle* on the graph of a run."""
    return f"{vehicle}/mavros"


@dataclass(frozen=True)
class GraphAccess:
    """Driver and namespace of one vehicle on a graph."""

    open_driver: Opener
    namespace: str


def graph_access(autopilot: str, vehicle: str) -> GraphAccess:
    """Return how *vehicle* with this *autopilot* is reached on a graph.

    Raises:
        CapabilityError: The driver of the autopilot has no ROS names.
    """
    factory = drivers.load(autopilot)
    if factory.on_graph is None:
        raise CapabilityError(
            f"{vehicle}: components command vehicles over a ROS graph, "
            f"which the driver {autopilot!r} cannot use"
        )
    return GraphAccess(factory.on_graph, factory.namespace.format(name=vehicle))


def names_of(vehicle: VehicleSpec, codec: WireFormat | None, commanded: bool) -> str:
    """Return whose names the node of *vehicle* has, as a model states them; empty for a node of its own.

    Raises:
        ModelError: The names do not fit its protocol, or components command it, which takes the default.
    """
    valid = (*NAMES_OF[codec.name], *OWN_NAMES.get(vehicle.autopilot, ())) if codec else ()
    if vehicle.names and vehicle.names not in valid:
        there = f"its node can have {choices(valid)}" if valid else "it is a node with names of its own"
        what = f"{vehicle.name}: {vehicle.names}'s names do not fit {vehicle.autopilot}: {there}"
        raise ModelError(what, where=vehicle.where)
    if commanded and vehicle.names and vehicle.names != valid[0]:
        what = f"{vehicle.name}: components command it by {valid[0]}'s names; leave out 'names'"
        raise ModelError(what, where=vehicle.where)
    return vehicle.names or (valid[0] if valid else "")


def serve_on_graph(
    graph: RosGraph,
    fleet: SimulatedFleet,
    vehicle: str,
    access: GraphAccess,
    context: ExecutionContext,
    names: NodeNames = _DEFAULT_NAMES,
) -> None:
    """Start the node that serves a simulated *vehicle*; its execution is charged to *context*.

    Args:
        graph: The graph.
        fleet: The vehicles.
        vehicle: Name of the vehicle.
        access: Its namespace.
        context: Context of the node.
        names: Whose names the node has.
    """
    codec = fleet.family(vehicle).codec
    if codec is None:
        fleet.autopilots[vehicle].join(graph, access.namespace, context)
        return
    NODES[codec.name](graph, fleet.link(vehicle), vehicle, context, fleet.frame, names)


class PrivateGraph:
    """Graph of one simulated vehicle and its commanders, in the place of a link."""

    def __init__(self, kernel: Kernel, fleet: SimulatedFleet, wanted: SimulatedVehicle, seed: int) -> None:
        self._kernel = kernel
        self._vehicle, self._autopilot = wanted.vehicle.name, wanted.vehicle.autopilot
        self._home = wanted.home
        access = graph_access(wanted.vehicle.autopilot, self._vehicle)
        if wanted.names:
            access = replace(access, namespace=f"/{self._vehicle}/{wanted.names}")
        self._access = access
        self._wire = GraphWire(kernel, stream(seed, f"wire/{self._vehicle}"), wanted.faults)
        self.graph = private_graph(kernel, self._wire, as_bytes=wanted.faults is not None)
        serve_on_graph(self.graph, fleet, self._vehicle, access, ExecutionContext(self._vehicle))

    def set_faults(self, faults: WireFaults) -> None:
        """Apply *faults* to the messages in both directions from now on."""
        self._wire.set_faults(faults)

    def open(self, commander: str = "commander", **options: str) -> Driver:
        """Return a driver of the vehicle, on a node called *commander*."""
        context = ExecutionContext(f"{commander} of {self._vehicle}")
        home = drivers.load(self._autopilot).home_options(self._home)
        node = self.graph.node(commander, f"/{self._vehicle}", context=context)
        options = {"namespace": self._access.namespace, **home, **options}
        return self._access.open_driver(self._kernel, node, self._vehicle, options)


def reached_over_links(fleet: SimulatedFleet, wanted: SimulatedVehicle) -> bool:
    """Return True if a script reaches this vehicle over a link, False if over a graph."""
    factory = drivers.load(wanted.vehicle.autopilot)
    return fleet.family(wanted.vehicle.name).codec is not None and factory.on_link is not None


def open_simulated_driver(
    kernel: Kernel, fleet: SimulatedFleet, wanted: SimulatedVehicle, seed: int
) -> Driver:
    """Return the driver of a simulated vehicle for a script: on a link, or on a private graph."""
    open_on_link = drivers.load(wanted.vehicle.autopilot).on_link
    if open_on_link is not None and reached_over_links(fleet, wanted):
        link = fleet.link_for(wanted)
        return open_on_link(kernel, link, wanted.vehicle.name, {**SIMULATED_LINK_OPTIONS, **wanted.rates})
    return PrivateGraph(kernel, fleet, wanted, seed).open()
