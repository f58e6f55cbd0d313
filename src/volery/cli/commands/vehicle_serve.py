"""``volery vehicle serve``: a simulated vehicle for other programs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Annotated

import typer

from volery.base.errors import UsageError
from volery.base.installed import require_extra
from volery.cli.command import OK, Commands
from volery.cli.console import CommandOutput
from volery.cli.options import Seed

if TYPE_CHECKING:
    from volery.run.serve import VehicleNodeServer, VehicleServer
    from volery.vehicles.address import Address

commands = Commands("vehicle")


@commands.add("quiet", "debug")
def serve(
    output: CommandOutput,
    autopilot: Annotated[str, typer.Argument(help="Autopilot to simulate.")] = "ardupilot",
    listen: Annotated[
        str | None,
        typer.Option(
            metavar="URL", help="tcp://HOST:PORT or udp://:PORT; by default send to the usual UDP port."
        ),
    ] = None,
    speed: Annotated[float, typer.Option(help="Simulated seconds per second.")] = 1.0,
    home: Annotated[
        str | None, typer.Option(metavar="LAT,LON,AMSL", help="Home position: degrees, metres.")
    ] = None,
    kind: Annotated[str, typer.Option(help="multirotor or rover.")] = "multirotor",
    sensors: Annotated[str, typer.Option(help="consumer or rtk.")] = "consumer",
    system: Annotated[int | None, typer.Option(help="System id of the vehicle; 1 by default.")] = None,
    version: Annotated[
        str | None, typer.Option(help="Version of the firmware, such as 1.14; the newest by default.")
    ] = None,
    features: Annotated[
        str | None,
        typer.Option(
            metavar="all|NAME,...", help="Features of the firmware that are off by default, such as winch."
        ),
    ] = None,
    graph: Annotated[
        str,
        typer.Option(
            metavar="ros1|ros2", help="Serve the vehicle as a node of that ROS graph, if it has one."
        ),
    ] = "",
    signing: Annotated[
        str,
        typer.Option(metavar="FILE", help="Key of signed MAVLink, 64 hexadecimal digits; default unsigned."),
    ] = "",
    seed: Seed = 1,
) -> int:
    """Serve one simulated vehicle to ground stations, MAVSDK, MAVProxy or a script, until Ctrl-C."""
    require_extra("simulation", "simulated vehicles")
    from volery.run.assembly.simulated_vehicles import parse_simulated
    from volery.run.serve import VehicleNodeServer, VehicleServer, has_links
    from volery.vehicles.address import parse, parse_listen

    if not 0.0 < speed < float("inf"):
        raise UsageError(f"--speed {speed:g}: give simulated seconds per second, above 0")
    options = {"kind": kind, "sensors": sensors, "home": home, "system": system}
    options |= {"version": version, "features": features}
    query = "&".join(f"{name}={value}" for name, value in options.items() if value is not None)
    vehicle = parse_simulated(parse(f"sim:{autopilot}?{query}"), autopilot)
    server: VehicleServer | VehicleNodeServer
    if not graph and has_links(autopilot):
        address = None if listen is None else parse_listen(listen)
        server = VehicleServer(vehicle, address, speed=speed, seed=seed, signing=signing, notice=output.note)
        lines = [
            f"serving {autopilot} ({kind}) at {speed:g}× real time; Ctrl-C stops it",
            *how_to_connect(server.protocol, server.addresses, autopilot),
        ]
    elif not graph or listen is not None or signing:
        raise UsageError(
            f"{autopilot}: a simulated {autopilot} is reached over a ROS graph, not over a link. Serve it on "
            f"real ROS with --graph ros1 (a roscore must run) or --graph ros2, or fly it without a server: "
            f"volery fly MISSION.py --on sim:{autopilot}"
        )
    else:
        server = VehicleNodeServer(vehicle, graph, speed=speed, seed=seed)
        lines = [
            f"serving {autopilot} on {graph} at {speed:g}× real time; Ctrl-C stops it",
            f"  its topics      {server.namespace}/...",
            f"  volery          volery fly MISSION.py --on {autopilot}+{graph}://{server.namespace}",
        ]
    try:
        server.run(lambda: output.show(*lines))
    except KeyboardInterrupt:
        output.note("stopped")
    return OK


def how_to_connect(protocol: str, addresses: list[Address], driver: str) -> list[str]:
    """Return what to type in the usual clients of a vehicle that is served at *addresses*."""
    clients = _CLIENTS.get(protocol)
    lines: list[str] = []
    for address in addresses:
        lines += clients(address, driver) if clients is not None else [f"  {address}"]
    return lines


QGROUNDCONTROL_PORT = 14550
"""UDP port on which QGroundControl listens by default."""


def _mavlink_clients(address: Address, driver: str) -> list[str]:
    where = f"{address.host}:{address.port}"
    if address.transport == "tcp":
        return [
            f"  listening on tcp://{where}",
            f"  QGroundControl  Application Settings > Comm Links > Add: TCP, {address.host}, {address.port}",
            f'  MAVSDK          await drone.connect(system_address="tcpout://{where}")',
            f"  MAVProxy        mavproxy.py --master tcp:{where}",
            f"  pymavlink       mavutil.mavlink_connection('tcp:{where}')",
            f"  volery          volery fly MISSION.py --on {driver}+tcp://{where}",
        ]
    port = address.port
    if not address.host:
        return [
            f"  bound to UDP port {port}; answers the first client that sends",
            f'  MAVSDK          await drone.connect(system_address="udpout://127.0.0.1:{port}")',
            f"  MAVProxy        mavproxy.py --master udpout:127.0.0.1:{port}",
            f"  pymavlink       mavutil.mavlink_connection('udpout:127.0.0.1:{port}')",
        ]
    listens = address.host == "127.0.0.1" and port == QGROUNDCONTROL_PORT
    return [
        f"  sending to UDP {where}",
        f"  QGroundControl  {'connects by itself' if listens else f'add a UDP link with port {port}'}",
        f'  MAVSDK          await drone.connect(system_address="udpin://0.0.0.0:{port}")',
        f"  MAVProxy        mavproxy.py --master udpin:0.0.0.0:{port}",
        f"  pymavlink       mavutil.mavlink_connection('udpin:0.0.0.0:{port}')",
        f"  volery          volery fly MISSION.py --on {driver}+udp://:{port}",
    ]


AIRCRAFT_ID = 1
"""pprzlink id of a vehicle that is served alone."""


def _pprzlink_clients(address: Address, driver: str) -> list[str]:
    """Paparazzi's ground segment, pprzlink, pprzros. All need the aircraft in their configuration."""
    from volery.vehicles.address import LOCAL_PORT

    if address.transport == "tcp":
        where = f"tcp://{address.host}:{address.port}"
        return [
            f"  listening on {where}; Paparazzi's own ground segment has no TCP",
            f"  volery          volery fly MISSION.py --on {driver}+{where}",
        ]
    if not address.host:
        return [f"  bound to UDP port {address.port}; answers the first client that sends"]
    down, up = address.port, address.options.get(LOCAL_PORT, "any free one")
    return [
        f"  sending to UDP {address.host}:{down} from port {up}; aircraft {AIRCRAFT_ID}, pprzlink 2.0",
        "  Paparazzi       aircraft 1 with the stock flight plan rotorcraft_basic, then",
        f"                  link -udp -udp_port {down} -udp_uplink_port {up}",
        f"  pprzlink        UdpMessagesInterface(callback, uplink_port={up}, downlink_port={down})",
        f"  pprzros         pprzros_run udp -d {address.host} -dp {down} -up {up}",
        f"  volery          volery fly MISSION.py --on {driver}+udp://:{down}",
    ]


_CLIENTS: Mapping[str, Callable[[Address, str], list[str]]] = {
    "MAVLink": _mavlink_clients,
    "pprzlink": _pprzlink_clients,
}
"""By the name of the codec."""
