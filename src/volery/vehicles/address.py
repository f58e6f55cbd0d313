"""Where a vehicle is reached: an address is a URL of driver, transport and options.

```
sim:ardupilot?home=46.0828,-103.899,900     simulated in this program
firmware:ardupilot?program=arducopter       a program of its real firmware, in the simulated world
ardupilot+tcp://127.0.0.1:5760              connects to a server
ardupilot+udp://:14550                      binds the port and answers the first sender
ardupilot+udp://:14550?bind=127.0.0.1       the same, for senders on this computer only
ardupilot+udp://10.0.0.7:14551              sends to a host
ardupilot+serial:///dev/ttyUSB0?baud=57600  a radio or a cable
mavros+graph:///drone_1                     topics and services of a graph, below that namespace
px4+ros2:///                                PX4's own topics on ROS 2; below /px4_1: px4+ros2:///px4_1
```

Addresses to listen at have the same form without a driver: ``tcp://127.0.0.1:5760``,
``udp://127.0.0.1:14550``. Links are opened here for tcp, udp and serial; the package ``run`` supplies
simulated vehicles and graphs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from urllib.parse import SplitResult, parse_qsl, urlsplit

from volery.base.errors import UsageError, choices, did_you_mean
from volery.kernel.api import Kernel
from volery.links.coded_link import CodedLink
from volery.links.link import WireFormat
from volery.links.mavlink_codec import MAVLINK, SignedMavlink, read_key
from volery.links.stream_links import SerialLink, TcpClient, TcpServer
from volery.links.udp_link import UdpLink, UdpServer

IN_VIRTUAL_TIME = ("sim", "firmware")
"""Transports to vehicles of the simulated world: an autopilot of volery, or a program of real firmware."""
TRANSPORTS = ("graph", "ros1", "ros2", "serial", *IN_VIRTUAL_TIME, "tcp", "udp")

EXAMPLES = (
    "sim:ardupilot, ardupilot+tcp://127.0.0.1:5760, ardupilot+udp://:14550, "
    "ardupilot+serial:///dev/ttyUSB0?baud=57600 or mavros+graph:///drone_1"
)

DEFAULT_BAUD = 57_600
USUAL_BAUD = {"pprzlink": 115_200}
"""Default baud rate by protocol, where it differs."""
LOCAL_ADDRESS = "bind"
"""Option of a UDP address without a host: the local address to listen at, else all addresses."""
SIGNING = "signing"
"""Option of a MAVLink address: the file with the key of the link."""
LOCAL_PORT = "from"
"""Option of a UDP address with a host: the local port to send from and listen at."""
REPLY_PORT = "uplink"
"""Option of a UDP address without a host: port for replies, if it differs from the sender's."""
LAST_PORT = 65_535

MAVLINK_OPTIONS = ("attitude", "baud", LOCAL_ADDRESS, "rate", "rc", SIGNING, "system", "texts")
"""Options of MAVLink drivers: ``rate`` of the position, ``attitude`` and ``rc`` channels in Hz, ``system``
id, and ``texts=unrecorded`` if the autopilot records its texts itself, as a simulated one does.
"""


def _no_options() -> Mapping[str, str]:
    return MappingProxyType({})


@dataclass(frozen=True)
class Address:
    """A parsed address.

    Args:
        driver: name of the driver; empty in an address to listen at.
        transport: one of ``TRANSPORTS``.
        host: host; empty in ``udp://:14550``, which binds the port and answers the first sender.
        port: port; ``None`` where there is none.
        path: device or namespace.
        options: options by name.
        text: the address as written.
    """

    driver: str
    transport: str
    host: str = ""
    port: int | None = None
    path: str = ""
    options: Mapping[str, str] = field(default_factory=_no_options, hash=False)
    text: str = field(default="", compare=False)

    def __str__(self) -> str:
        return self.text

    @property
    def in_virtual_time(self) -> bool:
        """Whether the vehicle flies in the simulated world, in virtual time."""
        return self.transport in IN_VIRTUAL_TIME

    def with_option(self, name: str, value: str) -> Address:
        """Return the same address with one more option."""
        return replace(self, options=MappingProxyType({**self.options, name: value}))

    def number(self, option: str, default: float) -> float:
        """Return an option as a number; ``UsageError`` names an option that is not a number."""
        given = self.options.get(option)
        if given is None:
            return default
        try:
            number = float(given)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise UsageError(f"{self.text}: {option}={given!r} is not a number")
        return number

    def numbers(self, option: str, count: int) -> tuple[float, ...] | None:
        """Return an option as *count* comma-separated numbers, or ``None`` if it is not given."""
        given = self.options.get(option)
        if given is None:
            return None
        try:
            numbers = tuple(float(part) for part in given.split(","))
        except ValueError:
            numbers = ()
        if len(numbers) != count or not all(map(math.isfinite, numbers)):
            raise UsageError(f"{self.text}: {option}={given!r} should be {count} numbers between commas")
        return numbers

    def only(self, *allowed: str) -> None:
        """Raise ``UsageError`` for an option that is not among *allowed*."""
        for name in self.options:
            if name not in allowed:
                hint = did_you_mean(name, allowed)
                raise UsageError(f"{self.text}: no option {name!r}{hint}; there is {choices(allowed)}")


# -- parsing


def parse(text: str) -> Address:
    """Parse the address of a vehicle.

    Raises:
        UsageError: the address is invalid; the message names the error and the valid choices.
    """
    url = _split(text)
    if url.scheme in IN_VIRTUAL_TIME:
        name = (url.netloc + url.path).strip("/")
        if not name:
            raise UsageError(f"{text!r} does not say which autopilot to simulate; try {url.scheme}:ardupilot")
        return Address(name, url.scheme, options=_options(text, url), text=text)
    driver, plus, transport = url.scheme.partition("+")
    if not plus or not driver:
        raise UsageError(f"{text!r} does not say which driver to use; an address is like {EXAMPLES}")
    return _with_transport(text, url, driver, transport)


def parse_listen(text: str) -> Address:
    """Parse an address to listen at or to send to: ``tcp://HOST:PORT``, ``udp://:PORT``, ``udp://HOST:PORT``.

    Raises:
        UsageError: the address is invalid.
    """
    url = _split(text)
    if url.scheme not in {"tcp", "udp"}:
        raise UsageError(f"{text!r}: one listens at tcp://HOST:PORT or udp://HOST:PORT, not {url.scheme!r}")
    return _with_transport(text, url, "", url.scheme)


def _split(text: str) -> SplitResult:
    try:
        url = urlsplit(text.strip())
        _ = url.port
    except ValueError as error:
        raise UsageError(f"{text!r} is not an address: {error}") from None
    if not url.scheme:
        raise UsageError(f"{text!r} is not an address; an address is like {EXAMPLES}")
    return url


def _options(text: str, url: SplitResult) -> Mapping[str, str]:
    if not url.query:
        return _no_options()
    try:
        pairs = parse_qsl(url.query, keep_blank_values=True, strict_parsing=True)
    except ValueError:
        raise UsageError(f"{text!r}: options are name=value, joined by &; not {url.query!r}") from None
    return MappingProxyType(dict(pairs))


def _with_transport(text: str, url: SplitResult, driver: str, transport: str) -> Address:
    if transport not in TRANSPORTS or transport in IN_VIRTUAL_TIME:
        valid = [name for name in TRANSPORTS if name not in IN_VIRTUAL_TIME]
        known = f"{choices(valid)} (and sim:{driver})"
        hint = did_you_mean(transport, valid)
        raise UsageError(f"{text!r}: no transport {transport!r}{hint}; there is {known}")
    address = Address(driver, transport, url.hostname or "", url.port, url.path, _options(text, url), text)
    if transport in {"tcp", "udp"}:
        _check_socket(address)
    elif address.host:
        raise UsageError(
            f"{text!r}: {address.host!r} stands where a host would; "
            f"write three slashes, as in {transport}:///{address.host}{address.path}"
        )
    elif transport == "serial" and not address.path.strip("/"):
        raise UsageError(f"{text!r} lacks the device, as in serial:///dev/ttyUSB0?baud=57600")
    return address


def _check_socket(address: Address) -> None:
    if address.port is None:
        raise UsageError(f"{address.text!r} lacks the port, as in {address.transport}://127.0.0.1:5760")
    if address.transport == "tcp" and not address.host:
        raise UsageError(f"{address.text!r} lacks the host, as in tcp://127.0.0.1:{address.port}")
    try:
        _ = address.host.encode("idna")
    except UnicodeError as error:
        raise UsageError(f"{address.text!r}: {address.host!r} is no name of a host ({error})") from None
    if address.path.strip("/"):
        raise UsageError(f"{address.text!r}: {address.path!r} means nothing after HOST:PORT")


# -- opening links


def open_link(
    kernel: Kernel, address: Address, codec: WireFormat = MAVLINK, *, shared: bool = False
) -> CodedLink:
    """Open the link to an autopilot; it connects by itself, and again after a break.

    Args:
        kernel: clock and tasks.
        address: address with transport tcp, udp or serial.
        codec: codec of the frames.
        shared: whether several autopilots send to the same UDP port.

    Raises:
        UsageError: another transport, an invalid baud rate, or a port that is in use.
    """
    codec = _signed(address, codec)
    if address.transport == "tcp":
        return TcpClient(kernel, address.host, _port(address), address.text, codec)
    if address.transport == "udp":
        if shared and not address.host:
            if REPLY_PORT in address.options:
                raise UsageError(f"{address}: {REPLY_PORT} is for one vehicle behind a port, not for several")
            local = address.options.get(LOCAL_ADDRESS, "")
            return UdpServer(kernel, local, _port(address), address.text, codec=codec)
        return _udp(kernel, address, codec)
    if address.transport == "serial":
        baud = address.number("baud", USUAL_BAUD.get(codec.name, DEFAULT_BAUD))
        if baud <= 0 or baud != int(baud):
            raise UsageError(f"{address}: baud={baud:g} is no baud rate; usual are 57600, 115200 and 921600")
        return SerialLink(kernel, address.path, int(baud), address.text, codec)
    raise UsageError(f"{address}: {address.transport} carries no bytes; tcp, udp and serial do")


def listen(
    kernel: Kernel,
    address: Address,
    *,
    on_connect: Callable[[], None] | None = None,
    codec: WireFormat = MAVLINK,
) -> CodedLink:
    """Open the link at which a simulated autopilot is served.

    Args:
        kernel: clock and tasks.
        address: tcp: clients connect; udp: sends to a host, or answers the first sender.
        on_connect: called when a TCP client connects.
        codec: codec of the frames.
    """
    codec = _signed(address, codec)
    if address.transport == "tcp":
        address.only(SIGNING)
        host, port = address.host, _port(address)
        return TcpServer(kernel, host, port, address.text, on_connect=on_connect, codec=codec)
    address.only(*(() if address.host else (LOCAL_ADDRESS,)), LOCAL_PORT, SIGNING)
    return _udp(kernel, address, codec)


def _signed(address: Address, codec: WireFormat) -> WireFormat:
    """Return the codec of a link: a signed one if the address names a key."""
    file = address.options.get(SIGNING)
    if file is None:
        return codec
    if codec is not MAVLINK:
        raise UsageError(f"{address}: {codec.name} has no signatures; {SIGNING} is for MAVLink")
    return SignedMavlink(read_key(Path(file)))


def _udp(kernel: Kernel, address: Address, codec: WireFormat) -> UdpLink:
    if address.host:
        local = _port_option(address, LOCAL_PORT)
        if LOCAL_ADDRESS in address.options:
            raise UsageError(f"{address}: {LOCAL_ADDRESS} is for udp://:PORT, which listens; this one sends")
        return UdpLink(kernel, "", local, (address.host, _port(address)), address.text, codec=codec)
    reply = _port_option(address, REPLY_PORT) or None
    bound = address.options.get(LOCAL_ADDRESS, "")
    return UdpLink(kernel, bound, _port(address), None, address.text, codec=codec, answers_to=reply)


def _port_option(address: Address, name: str) -> int:
    """Return the port in an option; 0 if it is not given."""
    port = address.number(name, 0)
    if not 0 <= port <= LAST_PORT or port != int(port):
        raise UsageError(f"{address}: {name}={port:g} is no port; 1 to {LAST_PORT} are")
    return int(port)


def _port(address: Address) -> int:
    if address.port is None:
        raise UsageError(f"{address} lacks the port")
    return address.port


# -- options of drivers


def check_options(driver: str, options: Mapping[str, str], *allowed: str) -> None:
    """Raise ``UsageError`` for an option that is not among *allowed*."""
    for name in options:
        if name not in allowed:
            hint = did_you_mean(name, allowed)
            raise UsageError(f"the {driver} driver has no option {name!r}{hint}; it has {choices(allowed)}")


def rate_option(name: str, options: Mapping[str, str], default: float, *, least: float = 0.0) -> float:
    """Return the option as a rate in Hz, from *least* to 100."""
    given = options.get(name)
    if given is None:
        return default
    try:
        number = float(given)
    except ValueError:
        number = -1.0
    if not least <= number <= 100.0:
        raise UsageError(f"{name}={given!r} is no rate in Hz from {least:g} to 100")
    return number


def records_texts(options: Mapping[str, str]) -> bool:
    """Return whether the driver records the autopilot's texts (option ``texts``)."""
    given = options.get("texts", "recorded")
    if given not in {"recorded", "unrecorded"}:
        raise UsageError(f"texts={given!r}; there is recorded or unrecorded")
    return given == "recorded"


def system_option(options: Mapping[str, str]) -> int | None:
    """Return the system id, or ``None`` to take the first autopilot that is received."""
    given = options.get("system")
    if given is None:
        return None
    if not (given.isdecimal() and len(given) <= 3 and 1 <= int(given) <= 255):
        raise UsageError(f"system={given!r} is no system id from 1 to 255")
    return int(given)
