"""``volery vehicle``: one simulated vehicle for whoever speaks its protocol."""

from __future__ import annotations

from dataclasses import dataclass

from volery.base.errors import UsageError
from volery.cli.console import Output
from volery.cli.endings import OK
from volery.run.serve import GROUND_STATION, Server
from volery.run.simulated import simulated
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


def vehicle(output: Output, wanted: Wanted) -> int:
    """Serve until told to stop; the exit status."""
    if not 0.0 < wanted.speed < float("inf"):
        raise UsageError(f"--speed {wanted.speed:g}: simulated seconds per second, above 0")
    described = simulated(_address(wanted), wanted.autopilot)
    address = parse_listen(wanted.listen or GROUND_STATION)
    server = Server(described, address, speed=wanted.speed, seed=wanted.seed)
    try:
        server.run(lambda: output.show(*how_to_connect(address, wanted)))
    except KeyboardInterrupt:
        output.note("stopped")
    return OK


def _address(wanted: Wanted) -> Address:
    options = {"kind": wanted.kind, "sensors": wanted.sensors, "home": wanted.home}
    query = "&".join(f"{name}={value}" for name, value in options.items() if value is not None)
    return parse(f"sim:{wanted.autopilot}?{query}")


def how_to_connect(address: Address, wanted: Wanted) -> list[str]:
    """What to type in the usual clients."""
    said = f"serving {wanted.autopilot} ({wanted.kind}) at {wanted.speed:g}× real time; Ctrl-C stops it"
    if address.carrier == "tcp":
        return [said, *_over_tcp(f"{address.host}:{address.port}", address, wanted)]
    return [said, *(_to_udp(address, wanted) if address.host else _bound_to_udp(address))]


def _over_tcp(where: str, address: Address, wanted: Wanted) -> list[str]:
    return [
        f"  listening on tcp://{where}",
        f"  QGroundControl  Application Settings > Comm Links > Add: TCP, {address.host}, {address.port}",
        f'  MAVSDK          await drone.connect(system_address="tcpout://{where}")',
        f"  MAVProxy        mavproxy.py --master tcp:{where}",
        f"  pymavlink       mavutil.mavlink_connection('tcp:{where}')",
        f"  volery          volery fly MISSION.py --on {wanted.autopilot}+tcp://{where}",
    ]


def _bound_to_udp(address: Address) -> list[str]:
    where = f"127.0.0.1:{address.port}"
    return [
        f"  bound to UDP port {address.port}; answers the first who speaks",
        f'  MAVSDK          await drone.connect(system_address="udpout://{where}")',
        f"  MAVProxy        mavproxy.py --master udpout:{where}",
        f"  pymavlink       mavutil.mavlink_connection('udpout:{where}')",
    ]


def _to_udp(address: Address, wanted: Wanted) -> list[str]:
    port = address.port
    listens_already = f"udp://127.0.0.1:{port}" == GROUND_STATION
    ground_station = "connects by itself" if listens_already else f"add a UDP link with port {port}"
    return [
        f"  sending to UDP {address.host}:{port}",
        f"  QGroundControl  {ground_station}",
        f'  MAVSDK          await drone.connect(system_address="udpin://0.0.0.0:{port}")',
        f"  MAVProxy        mavproxy.py --master udpin:0.0.0.0:{port}",
        f"  pymavlink       mavutil.mavlink_connection('udpin:0.0.0.0:{port}')",
        f"  volery          volery fly MISSION.py --on {wanted.autopilot}+udp://:{port}",
    ]
