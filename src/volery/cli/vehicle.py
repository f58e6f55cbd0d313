"""``volery vehicle``: one simulated vehicle for whoever speaks its protocol."""

from __future__ import annotations

from dataclasses import dataclass

from volery.base.errors import UsageError
from volery.cli.clients import CLIENTS
from volery.cli.console import Output
from volery.cli.endings import OK
from volery.run.assembly.simulated_vehicles import SimulatedVehicle, parse_simulated
from volery.run.serve import VehicleNodeServer, VehicleServer, has_links
from volery.vehicles.address import Address, parse, parse_listen


@dataclass(frozen=True)
class Wanted:
    """What was asked for."""

    autopilot: str
    listen: str | None
    speed: float
    home: str | None
    kind: str
    sensors: str
    seed: int
    system: int | None = None
    graph: str = ""


def vehicle(output: Output, wanted: Wanted) -> int:
    """Serve until told to stop; the exit status."""
    if not 0.0 < wanted.speed < float("inf"):
        raise UsageError(f"--speed {wanted.speed:g}: simulated seconds per second, above 0")
    described = parse_simulated(_address(wanted), wanted.autopilot)
    if wanted.graph or not has_links(wanted.autopilot):
        return _as_node(output, wanted, described)
    listen = None if wanted.listen is None else parse_listen(wanted.listen)
    server = VehicleServer(described, listen, speed=wanted.speed, seed=wanted.seed)
    try:
        server.run(lambda: output.show(*how_to_connect(server, wanted)))
    except KeyboardInterrupt:
        output.note("stopped")
    return OK


def _as_node(output: Output, wanted: Wanted, described: SimulatedVehicle) -> int:
    """On a real ROS graph."""
    if not wanted.graph or wanted.listen is not None:
        name = wanted.autopilot
        raise UsageError(
            f"{name}: a simulated {name} is reached over a graph, not over links: serve it on real ROS with "
            f"--graph ros1 (a roscore must run) or --graph ros2, or fly it right here: --on sim:{name}"
        )
    server = VehicleNodeServer(described, wanted.graph, speed=wanted.speed, seed=wanted.seed)
    below = server.namespace
    said = [
        f"serving {wanted.autopilot} on {wanted.graph} at {wanted.speed:g}× real time; Ctrl-C stops it",
        f"  its topics      {below}/...",
        f"  volery          volery fly MISSION.py --on {wanted.autopilot}+{wanted.graph}://{below}",
    ]
    try:
        server.run(lambda: output.show(*said))
    except KeyboardInterrupt:
        output.note("stopped")
    return OK


def _address(wanted: Wanted) -> Address:
    options = {
        "kind": wanted.kind,
        "sensors": wanted.sensors,
        "home": wanted.home,
        "system": wanted.system,
    }
    query = "&".join(f"{name}={value}" for name, value in options.items() if value is not None)
    return parse(f"sim:{wanted.autopilot}?{query}")


def how_to_connect(server: VehicleServer, wanted: Wanted) -> list[str]:
    """What to type in the usual clients."""
    said = f"serving {wanted.autopilot} ({wanted.kind}) at {wanted.speed:g}× real time; Ctrl-C stops it"
    clients = CLIENTS.get(server.protocol)
    lines = [said]
    for address in server.addresses:
        lines += clients(address, wanted.autopilot) if clients is not None else [f"  {address}"]
    return lines
