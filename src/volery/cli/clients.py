"""What to type in the usual clients of a served vehicle, by the protocol that it speaks."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from volery.vehicles.address import LOCAL_PORT, Address

Lines = Callable[[Address, str], list[str]]
"""Where it is served, and the name of its driver."""


def mavlink(address: Address, driver: str) -> list[str]:
    """QGroundControl, MAVSDK, MAVProxy, pymavlink."""
    if address.carrier == "tcp":
        return _over_tcp(f"{address.host}:{address.port}", address, driver)
    return _to_udp(address, driver) if address.host else _bound_to_udp(address)


def _over_tcp(where: str, address: Address, driver: str) -> list[str]:
    return [
        f"  listening on tcp://{where}",
        f"  QGroundControl  Application Settings > Comm Links > Add: TCP, {address.host}, {address.port}",
        f'  MAVSDK          await drone.connect(system_address="tcpout://{where}")',
        f"  MAVProxy        mavproxy.py --master tcp:{where}",
        f"  pymavlink       mavutil.mavlink_connection('tcp:{where}')",
        f"  volery          volery fly MISSION.py --on {driver}+tcp://{where}",
    ]


def _bound_to_udp(address: Address) -> list[str]:
    where = f"127.0.0.1:{address.port}"
    return [
        f"  bound to UDP port {address.port}; answers the first who speaks",
        f'  MAVSDK          await drone.connect(system_address="udpout://{where}")',
        f"  MAVProxy        mavproxy.py --master udpout:{where}",
        f"  pymavlink       mavutil.mavlink_connection('udpout:{where}')",
    ]


QGROUNDCONTROL_PORT = 14550


def _to_udp(address: Address, driver: str) -> list[str]:
    port = address.port
    listens_already = address.host == "127.0.0.1" and port == QGROUNDCONTROL_PORT
    ground_station = "connects by itself" if listens_already else f"add a UDP link with port {port}"
    return [
        f"  sending to UDP {address.host}:{port}",
        f"  QGroundControl  {ground_station}",
        f'  MAVSDK          await drone.connect(system_address="udpin://0.0.0.0:{port}")',
        f"  MAVProxy        mavproxy.py --master udpin:0.0.0.0:{port}",
        f"  pymavlink       mavutil.mavlink_connection('udpin:0.0.0.0:{port}')",
        f"  volery          volery fly MISSION.py --on {driver}+udp://:{port}",
    ]


AIRCRAFT_SYSTEM = 1
"""Id of a vehicle that is served alone."""


def pprzlink(address: Address, driver: str) -> list[str]:
    """Paparazzi's ground segment, pprzlink, pprzros. All need the aircraft in their configuration."""
    if address.carrier == "tcp":
        where = f"tcp://{address.host}:{address.port}"
        said = f"  listening on {where}; Paparazzi's own ground segment has no TCP"
        return [said, f"  volery          volery fly MISSION.py --on {driver}+{where}"]
    if not address.host:
        return [f"  bound to UDP port {address.port}; answers the first who speaks"]
    down, up = address.port, address.options.get(LOCAL_PORT, "any free one")
    return [
        f"  sending to UDP {address.host}:{down} from port {up}; aircraft {AIRCRAFT_SYSTEM}, pprzlink 2.0",
        "  Paparazzi       aircraft 1 with the stock flight plan rotorcraft_basic, then",
        f"                  link -udp -udp_port {down} -udp_uplink_port {up}",
        f"  pprzlink        UdpMessagesInterface(heard, uplink_port={up}, downlink_port={down})",
        f"  pprzros         pprzros_run udp -d {address.host} -dp {down} -up {up}",
        f"  volery          volery fly MISSION.py --on {driver}+udp://:{down}",
    ]


CLIENTS: Mapping[str, Lines] = {"MAVLink": mavlink, "pprzlink": pprzlink}
"""By the name of the codec."""
