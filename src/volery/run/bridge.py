"""``bridge``: a vehicle on a real ROS graph, under MAVROS's names, roscopter's or pprzros's, until it is
stopped.

A vehicle that is out there lives in real time; a simulated one in a world of its own, whose time passes
*speed* times as fast. Where an autopilot does not speak the protocol of the names, its driver hears and flies
it, and an interpreter speaks for it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from typing import TypeVar

from volery.base.errors import CapabilityError, UsageError, choices, did_you_mean
from volery.base.geoid import EGM96_NAME, parse_geoid
from volery.base.time import Ns
from volery.bridge import (
    MAVROS,
    ROSCOPTER,
    MavlinkAdapter,
    NamingScheme,
    PprzrosNode,
    VehicleNode,
    VehicleNodeOptions,
)
from volery.kernel.api import Kernel
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import FOREVER, VirtualKernel
from volery.kernel.wall import WallKernel
from volery.links.link import Link
from volery.run.assembly.ros_graphs import GRAPHS
from volery.run.assembly.simulated_vehicles import link_to, parse_simulated
from volery.run.assembly.vehicle_nodes import open_simulated_driver
from volery.run.assembly.vehicles import EMBEDDED, RealGraphs, for_driver
from volery.trace.events import Record, ignore
from volery.vehicles.address import LOCAL_PORT, REPLY_PORT, Address, open_link, parse
from volery.vehicles.driver import drivers

MAVLINK_NAMES: Mapping[str, NamingScheme] = {"mavros": MAVROS, "roscopter": ROSCOPTER}
NAMES: Mapping[str, tuple[str, ...]] = {"MAVLink": tuple(MAVLINK_NAMES), "pprzlink": ("pprzros",)}
"""By the protocol that they are made for; the first is usual. Those of MAVLink serve every autopilot."""
KNOWN = tuple(name for names in NAMES.values() for name in names)
ON_A_GRAPH = (*GRAPHS, EMBEDDED)

NAMESPACES: Mapping[str, str] = {"mavros": "/mavros", "roscopter": "/", "pprzros": "/"}
"""Where a node of these names is on a real vehicle."""

T = TypeVar("T")

FASTEST_HZ = 1000
MOST_IDS = 255


@dataclass(frozen=True, kw_only=True)
class BridgeOptions:
    """What is wanted. ``names`` and ``namespace`` are the usual ones if they are empty.

    ``rate`` in hertz is what the autopilot is asked for, ``system`` the id that the bridge speaks as;
    ``control``: roscopter's ``send_rc`` is taken. ``geoid``: see ``parse_geoid``.
    """

    url: str
    graph: str
    names: str = ""
    namespace: str = ""
    rate: int = 10
    control: bool = False
    system: int = 255
    geoid: str = EGM96_NAME
    speed: float = 1.0
    seed: int = 1


class Bridge:
    """It is on the graph as soon as it runs.

    Raises ``UsageError`` for what makes no sense, ``CapabilityError`` for names that do not go with the
    autopilot, and what ``open_graph`` raises. *record* is told when links are lost and come back, and what
    goes wrong.
    """

    def __init__(self, wanted: BridgeOptions, record: Record = ignore) -> None:
        _check(wanted)
        address = parse(wanted.url)
        self.names = _names(address, wanted.names)
        self.namespace = wanted.namespace or NAMESPACES[self.names]
        self.kernel: VirtualKernel | WallKernel
        in_simulation = address.carrier == "sim"
        self.kernel = VirtualKernel(record, pace=wanted.speed) if in_simulation else WallKernel(record)
        self._graphs = RealGraphs(self.kernel)
        self._interpreted = self.names not in _own_names(address)
        way = self._interpreter if self._interpreted else self._way
        with ExitStack() as undo:
            undo.callback(self._graphs.close)
            self._link = way(address, wanted)
            undo.callback(self._link.close)
            self._node = self._made(address, wanted)
            undo.pop_all()
        self._node.start(ExecutionContext("bridge"), self.kernel.root)

    def _way(self, address: Address, wanted: BridgeOptions) -> Link:
        """To an autopilot that speaks the protocol of the names."""
        if address.carrier == "sim":
            return _in_the_air(self.kernel, address, wanted.seed, link_to)
        address.only("baud", "system", LOCAL_PORT, REPLY_PORT)
        return open_link(self.kernel, address, drivers.load(address.driver).codec)

    def _interpreter(self, address: Address, wanted: BridgeOptions) -> Link:
        """To one that does not."""
        name, factory = address.driver, drivers.load(address.driver)
        if address.carrier == "sim":
            driver = _in_the_air(self.kernel, address, wanted.seed, open_simulated_driver)
        elif address.carrier in GRAPHS:
            driver = self._graphs.driver(name, address)
        else:
            assert factory.on_link is not None, "seen when the names were chosen"
            link = open_link(self.kernel, address, factory.codec)
            try:
                driver = factory.on_link(self.kernel, link, name, for_driver(address))
            except UsageError:
                link.close()
                raise
        return MavlinkAdapter(self.kernel, driver, ExecutionContext("bridge"))

    def _made(self, address: Address, wanted: BridgeOptions) -> VehicleNode | PprzrosNode:
        graph = self._graphs.graph(wanted.graph)
        if self.names not in MAVLINK_NAMES:
            return PprzrosNode(graph, self._link, self.namespace)
        names = MAVLINK_NAMES[self.names]
        options = VehicleNodeOptions(
            names=names,
            period=None,
            streams=dict.fromkeys(names.streams, wanted.rate) if wanted.rate else {},
            system=wanted.system,
            vehicle=0 if self._interpreted else int(address.number("system", 0)),
            geoid=parse_geoid(wanted.geoid),
            control=wanted.control,
        )
        return VehicleNode(graph, self._link, self.namespace, options)

    @property
    def status(self) -> str:
        """In one line: whom it hears, or what is wrong with the way there."""
        return self._node.summary or f"hears no autopilot: {self._link.problem() or 'nothing has come yet'}"

    def every(self, period: Ns, action: Callable[[], None]) -> None:
        """Do something now and then each *period* while it runs."""
        self.kernel.every(period, action)

    def run(self) -> None:
        """Until the process is told to stop (``KeyboardInterrupt``)."""
        try:
            self.kernel.run(FOREVER)
        finally:
            self._link.close()
            self._graphs.close()
            self.kernel.close("the bridge was stopped")


def _check(wanted: BridgeOptions) -> None:
    if wanted.graph == "embedded":
        raise UsageError(
            "the embedded graph is inside a run, where vehicles are bridged to it by themselves; "
            f"from outside it is {choices(GRAPHS)}"
        )
    if not 0 <= wanted.rate <= FASTEST_HZ:
        raise UsageError(f"a rate of {wanted.rate} Hz: 1 to {FASTEST_HZ}, or 0 to ask for nothing")
    if not 1 <= wanted.system <= MOST_IDS:
        raise UsageError(f"{wanted.system} is no system id; 1 to {MOST_IDS} are")
    if not 0.0 < wanted.speed < float("inf"):
        raise UsageError(f"a speed of {wanted.speed:g}: simulated seconds per second, above 0")
    parse_geoid(wanted.geoid)


def _own_names(address: Address) -> tuple[str, ...]:
    """The names that are made for the protocol in which the autopilot is reached there."""
    factory = drivers.load(address.driver)
    if factory.on_link is None or address.carrier in ON_A_GRAPH:
        return ()
    return NAMES.get(factory.codec.name, ())


def _names(address: Address, wanted: str) -> str:
    """Which set of names it is."""
    _check_where(address, wanted)
    own = _own_names(address)
    valid = (*own, *(name for name in MAVLINK_NAMES if name not in own))
    if not wanted:
        return valid[0]
    if wanted not in KNOWN:
        raise UsageError(f"no names {wanted!r}{did_you_mean(wanted, KNOWN)}; there is {choices(KNOWN)}")
    if wanted not in valid:
        made_for = next(protocol for protocol, names in NAMES.items() if wanted in names)
        raise CapabilityError(
            f"{address}: {wanted}'s names are those of vehicles that speak {made_for}; "
            f"this one goes by {choices(valid)}"
        )
    return wanted


def _check_where(address: Address, wanted: str) -> None:
    """A vehicle that is on a graph under names of its own gets others if they are asked for."""
    factory = drivers.load(address.driver)
    if factory.on_link is not None and address.carrier not in ON_A_GRAPH:
        return
    own = factory.graph_names
    if own in MAVLINK_NAMES or address.carrier == EMBEDDED:
        raise CapabilityError(
            f"{address}: that vehicle is on a graph already, under {own}'s names; there is nothing to bridge"
        )
    if wanted in ("", own):
        served = f"`volery serve {address.driver} --graph ros1`"
        raise CapabilityError(
            f"{address}: {address.driver} is on a graph by itself, under {own}'s names "
            f"(a simulated one: {served}); for others say --names {choices(MAVLINK_NAMES)}"
        )


def _in_the_air(kernel: Kernel, address: Address, seed: int, reach: Callable[..., T]) -> T:
    """What *reach* makes of a simulated vehicle in a world of its own."""

    from volery.run.assembly.simulated_fleet import fleet_of

    wanted = parse_simulated(address, address.driver)
    return reach(kernel, fleet_of(kernel, [wanted], seed), wanted, seed)
