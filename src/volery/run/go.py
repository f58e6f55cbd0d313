"""``go``: a flight under a control law on this side of the link, on any vehicle.

It makes a mission of a manoeuvre, the way its commands are applied and the safety switch, and ``fly`` flies
it. Gains can be changed in flight, see ``gains``.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from volery.base.errors import NotArrived, UsageError, choices, did_you_mean
from volery.base.time import Ns
from volery.control.actuation import Actuation, AttitudeSetpoints, RcOverride, VelocitySetpoints
from volery.control.flight import PERIOD, ControlledFlight
from volery.control.link_failsafes import BY_STICKS, link_failsafes
from volery.control.manoeuvres import LawManoeuvre
from volery.control.safety_switch import SwitchSettings
from volery.run.assembly.ros_graphs import GRAPHS, open_graph
from volery.run.fly import fly
from volery.run.gains import GainParameters, GainsFile
from volery.run.result import Options, Run
from volery.trace.events import INFO, Event, Text
from volery.trace.stream import Stream
from volery.vehicles import Drone
from volery.vehicles.address import MAVLINK_OPTIONS, parse
from volery.vehicles.driver import drivers

ACTUATIONS: Mapping[str, Callable[[Drone], Actuation]] = {
    "setpoints": VelocitySetpoints,
    "attitude": AttitudeSetpoints,
    "rc": RcOverride,
}
WAYS = tuple(ACTUATIONS)
RATES = {"rate": "20", "attitude": "50", "rc": "20"}
"""Telemetry that a control loop needs, Hz, unless the address states other rates."""
SIMULATED_TRANSMITTERS = frozenset({"ardupilot"})
"""Simulated autopilots that receive a transmitter without being asked to."""
NODE = "volery_go"
"""Node whose parameters are the gains."""


@dataclass(frozen=True, kw_only=True)
class GoSettings:
    """How a manoeuvre is flown.

    Attributes:
        by: one of ``WAYS``.
        switch: the operator's switch, or ``None`` to fly without.
        height: height of the take-off, m above home.
        gains: file with gains by loop, or ``None``.
        graph: real ROS graph on which the gains are parameters, ``ros1`` or ``ros2``; empty for none. A
            simulated vehicle then flies in real time, unless the options state a pace.
        period: sample time, ns.
        experiment: whether the gains are flown as they are, and the end is not judged.
    """

    by: str = "setpoints"
    switch: SwitchSettings | None = None
    height: float = 5.0
    gains: Path | None = None
    graph: str = ""
    period: Ns = PERIOD
    experiment: bool = False

    def __post_init__(self) -> None:
        if self.by not in WAYS:
            raise UsageError(f"by {self.by!r}{did_you_mean(self.by, WAYS)}; there is {choices(WAYS)}")
        if not self.height > 0.0:
            raise UsageError(f"a take-off to {self.height:g} m; give a height above 0")
        if self.graph and self.graph not in GRAPHS:
            hint = did_you_mean(self.graph, GRAPHS)
            raise UsageError(f"no graph {self.graph!r}{hint}; there is {choices(GRAPHS)}")


def has_transmitter(url: str) -> bool:
    """Return whether a vehicle may have a transmitter: a real one, or a simulated one with one."""
    address = parse(url)
    simulated = address.in_virtual_time
    return not simulated or address.driver in SIMULATED_TRANSMITTERS or "transmitter" in address.options


def with_rates(url: str, switch: SwitchSettings | None) -> str:
    """Return the address with the telemetry rates that a control loop needs, where they can be requested.

    A simulated pilot's transmitter has its switch in the middle, unless the address states otherwise.
    """
    address = parse(url)
    factory = drivers.load(address.driver)
    if (
        factory.on_link is None
        or factory.codec.name != "MAVLink"
        or address.transport in {"ros1", "ros2", "graph"}
    ):
        return url
    added = {name: value for name, value in RATES.items() if name in MAVLINK_OPTIONS}
    if switch is None:
        del added["rc"]
    elif address.in_virtual_time:
        added["transmitter"] = f"{switch.channel}:{sum(switch.middle) // 2}"
    missing = [f"{name}={value}" for name, value in added.items() if name not in address.options]
    return f"{url}{'&' if '?' in url else '?'}{'&'.join(missing)}" if missing else url


def go(
    make: Callable[[], LawManoeuvre],
    on: str,
    settings: GoSettings,
    options: Options,
    *,
    listener: Callable[[Event], None] | None = None,
) -> Run:
    """Fly a manoeuvre and return the record.

    Args:
        make: makes the manoeuvre.
        on: address of the vehicle.
        settings: how it is flown.
        options: options of the run.
        listener: called with each event of the run while the mission lasts.

    Raises:
        UsageError: the address, the gains or the settings are wrong; nothing has started.
    """
    manoeuvre = make()
    gains = GainsFile(settings.gains, manoeuvre) if settings.gains is not None else None
    if settings.graph and options.pace is None and parse(on).in_virtual_time:
        options = replace(options, pace=1.0)

    def mission(drone: Drone) -> None:
        actuation = ACTUATIONS[settings.by](drone)
        stated = set(gains.stated) if gains is not None else set()
        flight = ControlledFlight(
            drone,
            manoeuvre,
            actuation,
            switch=settings.switch,
            period=settings.period,
            height=settings.height,
            as_stated=lambda loop: settings.experiment or loop in stated,
            on_sample=gains.watch(drone) if gains is not None else lambda _: None,
        )
        stream = drone.kernel.record
        if listener is not None and isinstance(stream, Stream):
            stream.tap(listener)
        with _gain_parameters(settings.graph, drone, manoeuvre) as parameters:
            stated.update(parameters)
            drone.wait_ready()
            if settings.by == "rc":
                channel = settings.switch.channel if settings.switch is not None else None
                for line in link_failsafes(drone, channel):
                    drone.kernel.record(Text(drone.kernel.now(), drone.name, INFO, f"{BY_STICKS}: {line}"))
            off = flight.run()
            if off and not settings.experiment:
                raise NotArrived(drone.name, "fly under a law", f"it ended {off}; it was landed")

    return fly(mission, with_rates(on, settings.switch), options)


@contextmanager
def _gain_parameters(name: str, drone: Drone, manoeuvre: LawManoeuvre) -> Iterator[Collection[str]]:
    """Let the gains be parameters of a node on the graph *name*; yield the loops that were set before."""
    if not name:
        yield ()
        return
    graph = open_graph(drone.kernel, name)
    parameters = None
    try:
        parameters = GainParameters(graph.node(NODE), manoeuvre)
        parameters.watch(drone)
        yield parameters.stated
    finally:
        if parameters is not None:
            parameters.close()
        graph.close()
