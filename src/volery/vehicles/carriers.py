"""From an address to an open link. ``sim`` and ``graph`` are not carriers of bytes: ``run`` supplies them."""

from __future__ import annotations

from collections.abc import Callable

from volery.base.errors import UsageError
from volery.kernel.api import Kernel
from volery.links.codec import Codec
from volery.links.coded import CodedLink
from volery.links.parser import MAVLINK
from volery.links.serial_line import SerialLine
from volery.links.tcp import TcpClient, TcpServer
from volery.links.udp import UdpLink
from volery.links.udp_server import UdpServer
from volery.vehicles.address import Address

DEFAULT_BAUD = 57_600
USUAL_BAUD = {"pprzlink": 115_200}
"""By protocol, where another one is usual."""
ANYWHERE = "0.0.0.0"
"""``udp://:PORT`` means just this: whoever speaks first."""

SENDS_FROM = "from"
"""Option of a UDP address with a host: the port that is sent from, and listened at."""
ANSWERS_TO = "uplink"
"""Option of a UDP address without: the port at which whoever speaks listens, if it speaks from another."""
LAST_PORT = 65_535


def open_link(kernel: Kernel, address: Address, codec: Codec = MAVLINK, *, shared: bool = False) -> CodedLink:
    """The link to an autopilot at *address* (tcp, udp, serial), in the words of *codec*; *shared*: to all
    that speak there.

    It connects by itself, again after a break.

    Raises ``UsageError`` for another carrier, a baud rate that is none, or a port that is taken.
    """
    if address.carrier == "tcp":
        return TcpClient(kernel, address.host, _port(address), address.text, codec)
    if address.carrier == "udp":
        if shared and not address.host:
            if ANSWERS_TO in address.options:
                raise UsageError(f"{address}: {ANSWERS_TO} is for one vehicle behind a port, not for several")
            return UdpServer(kernel, ANYWHERE, _port(address), address.text, codec=codec)
        return _udp(kernel, address, codec)
    if address.carrier == "serial":
        baud = address.number("baud", USUAL_BAUD.get(codec.name, DEFAULT_BAUD))
        if baud <= 0 or baud != int(baud):
            raise UsageError(f"{address}: baud={baud:g} is no baud rate; usual are 57600, 115200 and 921600")
        return SerialLine(kernel, address.path, int(baud), address.text, codec)
    raise UsageError(f"{address}: {address.carrier} is not a carrier of bytes; tcp, udp and serial are")


def listen(
    kernel: Kernel,
    address: Address,
    *,
    joined: Callable[[], None] | None = None,
    codec: Codec = MAVLINK,
) -> CodedLink:
    """Where an autopilot serves: tcp clients connect; udp sends to a host or answers the first speaker.

    A UDP address with a host may say with option ``from`` which port is sent from, and listened at.
    """
    if address.carrier == "tcp":
        address.only()
        return TcpServer(kernel, address.host, _port(address), address.text, joined=joined, codec=codec)
    address.only(SENDS_FROM)
    return _udp(kernel, address, codec)


def _udp(kernel: Kernel, address: Address, codec: Codec) -> UdpLink:
    if address.host:
        ours = _port_option(address, SENDS_FROM)
        return UdpLink(kernel, ANYWHERE, ours, (address.host, _port(address)), address.text, codec=codec)
    theirs = _port_option(address, ANSWERS_TO) or None
    return UdpLink(kernel, ANYWHERE, _port(address), None, address.text, codec=codec, answers_to=theirs)


def _port_option(address: Address, name: str) -> int:
    """0 if it is not given."""
    port = address.number(name, 0)
    if not 0 <= port <= LAST_PORT or port != int(port):
        raise UsageError(f"{address}: {name}={port:g} is no port; 1 to {LAST_PORT} are")
    return int(port)


def _port(address: Address) -> int:
    if address.port is None:
        raise UsageError(f"{address} lacks the port")
    return address.port
