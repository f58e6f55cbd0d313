"""``bridge``: a vehicle on a real ROS graph, under MAVROS's names, roscopter's or pprzros's, until it is
stopped.

A vehicle that is out there lives in real time; a simulated one in a world of its own, whose time passes
*speed* times as fast.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from volery.base.errors import CapabilityError, UsageError, choices, did_you_mean
from volery.base.geoid import BY_NAME, geoid_of
from volery.base.time import Ns
from volery.bridge import MAVROS, ROSCOPTER, Names, PprzrosNode, VehicleNode, VehicleNodeOptions
from volery.kernel.api import Kernel
from volery.kernel.task import Place
from volery.kernel.virtual import FOREVER, VirtualKernel
from volery.kernel.wall import WallKernel
from volery.links.link import Link
from volery.run.graphs import GRAPHS, open_graph
from volery.run.simulated import link_to, simulated
from volery.trace.events import Record, ignore
from volery.vehicles.address import Address, parse
from volery.vehicles.carriers import ANSWERS_TO, SENDS_FROM, open_link
from volery.vehicles.driver import drivers

MAVLINK_NAMES: Mapping[str, Names] = {"mavros": MAVROS, "roscopter": ROSCOPTER}
NAMES: Mapping[str, tuple[str, ...]] = {"MAVLink": tuple(MAVLINK_NAMES), "pprzlink": ("pprzros",)}
"""By the protocol that the autopilot speaks; the first is usual."""

NAMESPACES: Mapping[str, str] = {"mavros": "/mavros", "roscopter": "/", "pprzros": "/"}
"""Where a node of these names is on a real vehicle."""

FASTEST_HZ = 1000
MOST_IDS = 255


@dataclass(frozen=True, kw_only=True)
class Bridging:
    """What is wanted. ``names`` and ``namespace`` are the usual ones if they are empty.

    ``rate`` in hertz is what the autopilot is asked for, ``system`` the id that the bridge speaks as;
    ``control``: roscopter's ``send_rc`` is taken. ``geoid``: see ``geoid_of``.
    """

    url: str
    graph: str
    names: str = ""
    namespace: str = ""
    rate: int = 10
    control: bool = False
    system: int = 255
    geoid: str = BY_NAME
    speed: float = 1.0
    seed: int = 1


class Bridge:
    """It is on the graph as soon as it runs.

    Raises ``UsageError`` for what makes no sense, ``CapabilityError`` for names that do not go with the
    autopilot, and what ``open_graph`` raises. *record* is told when links are lost and come back, and what
    goes wrong.
    """

    def __init__(self, wanted: Bridging, record: Record = ignore) -> None:
        _check(wanted)
        address = parse(wanted.url)
        self.names = _names(address, wanted.names)
        self.namespace = wanted.namespace or NAMESPACES[self.names]
        self.kernel: VirtualKernel | WallKernel
        if address.carrier == "sim":
            self.kernel = VirtualKernel(record, pace=wanted.speed)
            self._link = _simulated_link(self.kernel, address, wanted.seed)
        else:
            address.only("baud", "system", SENDS_FROM, ANSWERS_TO)
            self.kernel = WallKernel(record)
            self._link = open_link(self.kernel, address, drivers.load(address.driver).codec)
        try:
            self._graph = open_graph(self.kernel, wanted.graph)
        except BaseException:
            self._link.close()
            raise
        self._node = self._made(address, wanted)
        self._node.start(Place("bridge"), self.kernel.root)

    def _made(self, address: Address, wanted: Bridging) -> VehicleNode | PprzrosNode:
        if self.names not in MAVLINK_NAMES:
            return PprzrosNode(self._graph, self._link, self.namespace)
        names = MAVLINK_NAMES[self.names]
        options = VehicleNodeOptions(
            names=names,
            period=None,
            streams=dict.fromkeys(names.streams, wanted.rate) if wanted.rate else {},
            system=wanted.system,
            vehicle=int(address.number("system", 0)),
            geoid=geoid_of(wanted.geoid),
            control=wanted.control,
        )
        return VehicleNode(self._graph, self._link, self.namespace, options)

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
            self._graph.close()
            self._link.close()
            self.kernel.close("the bridge was stopped")


def _check(wanted: Bridging) -> None:
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
    geoid_of(wanted.geoid)


def _names(address: Address, wanted: str) -> str:
    """Which set of names it is."""
    factory = drivers.load(address.driver)
    if factory.on_link is None:
        raise CapabilityError(
            f"{address}: {address.driver} is reached over a graph already, under names of its own; "
            f"a simulated one is put there by `volery vehicle {address.driver} --graph ros1`"
        )
    if address.carrier in (*GRAPHS, "graph"):
        raise CapabilityError(f"{address}: that vehicle is on a graph already; there is nothing to bridge")
    valid = NAMES[factory.codec.name]
    if not wanted:
        return valid[0]
    known = [name for names in NAMES.values() for name in names]
    if wanted not in known:
        raise UsageError(f"no names {wanted!r}{did_you_mean(wanted, known)}; there is {choices(known)}")
    if wanted not in valid:
        raise CapabilityError(
            f"{address}: {wanted}'s names are those of vehicles that speak "
            f"{next(protocol for protocol, names in NAMES.items() if wanted in names)}; "
            f"{address.driver} speaks {factory.codec.name}, which goes by {choices(valid)}"
        )
    return wanted


def _simulated_link(kernel: Kernel, address: Address, seed: int) -> Link:
    from volery.run.airfield import airfield_of

    wanted = simulated(address, address.driver)
    return link_to(kernel, airfield_of(kernel, [wanted], seed), wanted, seed)
