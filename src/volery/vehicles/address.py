"""Where a vehicle is reached: one URL is a driver plus a carrier.

```
sim:ardupilot?home=46.0828,-103.899,900     simulated here
ardupilot+tcp://127.0.0.1:5760              connects there
ardupilot+udp://:14550                      binds, answers the first who speaks
ardupilot+udp://10.0.0.7:14551              sends there
ardupilot+serial:///dev/ttyUSB0?baud=57600  a radio or a cable
mavros+graph:///drone_1                     topics and services of a graph, under that namespace
```

Listening uses the same form without a driver: ``tcp://127.0.0.1:5760``, ``udp://127.0.0.1:14550``.

From an address to an open link. ``sim`` and ``graph`` are not carriers of bytes: ``run`` supplies them.

Options of an address that are the drivers' own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from urllib.parse import SplitResult, parse_qsl, urlsplit

from volery.base.errors import UsageError, choices, did_you_mean
from volery.kernel.api import Kernel
from volery.links.coded_link import CodedLink
from volery.links.link import Codec
from volery.links.mavlink_codec import MAVLINK
from volery.links.serial_link import SerialLink
from volery.links.tcp_link import TcpClient, TcpServer
from volery.links.udp_link import UdpLink, UdpServer

TRANSPORTS = ("graph", "ros1", "ros2", "serial", "sim", "tcp", "udp")
"""How a driver can reach an autopilot."""

EXAMPLES = (
    "sim:ardupilot, ardupilot+tcp://127.0.0.1:5760, ardupilot+udp://:14550, "
    "ardupilot+serial:///dev/ttyUSB0?baud=57600 or mavros+graph:///drone_1"
)


def _no_options() -> Mapping[str, str]:
    return MappingProxyType({})


@dataclass(frozen=True)
class Address:
    """A parsed URL. ``driver`` is empty in an address to listen at; ``port`` is ``None`` where there is none.

    ``host`` is empty in ``udp://:14550``: bind there and answer the first who speaks.
    """

    driver: str
    carrier: str
    host: str = ""
    port: int | None = None
    path: str = ""
    options: Mapping[str, str] = field(default_factory=_no_options, hash=False)
    text: str = field(default="", compare=False)

    def __str__(self) -> str:
        return self.text

    def number(self, option: str, default: float) -> float:
        """The option as a number; a ``UsageError`` names the option if it is none."""
        given = self.options.get(option)
        if given is None:
            return default
        try:
            return float(given)
        except ValueError:
            raise UsageError(f"{self.text}: {option}={given!r} is not a number") from None

    def numbers(self, option: str, count: int) -> tuple[float, ...] | None:
        """The option as *count* numbers between commas; ``None`` if it is not given."""
        given = self.options.get(option)
        if given is None:
            return None
        parts = given.split(",")
        try:
            numbers = tuple(float(part) for part in parts)
        except ValueError:
            numbers = ()
        if len(numbers) != count:
            raise UsageError(f"{self.text}: {option}={given!r} should be {count} numbers between commas")
        return numbers

    def only(self, *allowed: str) -> None:
        """Refuse options that nobody would look at."""
        for name in self.options:
            if name not in allowed:
                hint = did_you_mean(name, allowed)
                raise UsageError(f"{self.text}: no option {name!r}{hint}; there is {choices(allowed)}")


def parse(text: str) -> Address:
    """The address of a vehicle. Raises ``UsageError`` naming what is wrong and the valid choices."""
    url = _split(text)
    if url.scheme == "sim":
        return _simulated(text, url)
    driver, plus, carrier = url.scheme.partition("+")
    if not plus or not driver:
        raise UsageError(f"{text!r} does not say which driver to use; an address is like {EXAMPLES}")
    return _with_transport(text, url, driver, carrier)


def parse_listen(text: str) -> Address:
    """An address to listen at, or to send to: ``tcp://HOST:PORT``, ``udp://:PORT`` or ``udp://HOST:PORT``."""
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


def _simulated(text: str, url: SplitResult) -> Address:
    name = (url.netloc + url.path).strip("/")
    if not name:
        raise UsageError(f"{text!r} does not say which autopilot to simulate; try sim:ardupilot")
    return Address(name, "sim", options=_options(text, url), text=text)


def _with_transport(text: str, url: SplitResult, driver: str, carrier: str) -> Address:
    if carrier not in TRANSPORTS or carrier == "sim":
        valid = [name for name in TRANSPORTS if name != "sim"]
        known = f"{choices(valid)} (and sim:{driver})"
        raise UsageError(f"{text!r}: no carrier {carrier!r}{did_you_mean(carrier, valid)}; there is {known}")
    address = Address(driver, carrier, url.hostname or "", url.port, url.path, _options(text, url), text)
    _complete(address)
    return address


def _complete(address: Address) -> None:
    if address.carrier in {"tcp", "udp"}:
        _complete_socket(address)
    elif address.host:
        raise UsageError(
            f"{address.text!r}: {address.host!r} stands where a host would; "
            f"write three slashes, as in {address.carrier}:///{address.host}{address.path}"
        )
    elif address.carrier == "serial" and not address.path.strip("/"):
        raise UsageError(f"{address.text!r} lacks the device, as in serial:///dev/ttyUSB0?baud=57600")


def _complete_socket(address: Address) -> None:
    if address.port is None:
        raise UsageError(f"{address.text!r} lacks the port, as in {address.carrier}://127.0.0.1:5760")
    if address.carrier == "tcp" and not address.host:
        raise UsageError(f"{address.text!r} lacks the host, as in tcp://127.0.0.1:{address.port}")
    if address.path.strip("/"):
        raise UsageError(f"{address.text!r}: {address.path!r} means nothing after HOST:PORT")


DEFAULT_BAUD = 57_600
USUAL_BAUD = {"pprzlink": 115_200}
"""By protocol, where another one is usual."""
ANYWHERE = "0.0.0.0"
"""``udp://:PORT`` means just this: whoever speaks first."""

LOCAL_PORT = "from"
"""Option of a UDP address with a host: the port that is sent from, and listened at."""
REPLY_PORT = "uplink"
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
            if REPLY_PORT in address.options:
                raise UsageError(f"{address}: {REPLY_PORT} is for one vehicle behind a port, not for several")
            return UdpServer(kernel, ANYWHERE, _port(address), address.text, codec=codec)
        return _udp(kernel, address, codec)
    if address.carrier == "serial":
        baud = address.number("baud", USUAL_BAUD.get(codec.name, DEFAULT_BAUD))
        if baud <= 0 or baud != int(baud):
            raise UsageError(f"{address}: baud={baud:g} is no baud rate; usual are 57600, 115200 and 921600")
        return SerialLink(kernel, address.path, int(baud), address.text, codec)
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
        return TcpServer(kernel, address.host, _port(address), address.text, on_connect=joined, codec=codec)
    address.only(LOCAL_PORT)
    return _udp(kernel, address, codec)


def _udp(kernel: Kernel, address: Address, codec: Codec) -> UdpLink:
    if address.host:
        ours = _port_option(address, LOCAL_PORT)
        return UdpLink(kernel, ANYWHERE, ours, (address.host, _port(address)), address.text, codec=codec)
    theirs = _port_option(address, REPLY_PORT) or None
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


MAVLINK_OPTIONS = ("attitude", "baud", "rate", "system", "texts")
"""``rate_option`` of the position and ``attitude`` in Hz, ``system_option`` id; and ``texts=unrecorded`` where the
autopilot records its texts itself, as a simulated one does.
"""


def rate_option(name: str, options: Mapping[str, str], default: float, *, least: float = 0.0) -> float:
    """Hz."""
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
    """The autopilot's texts are to go into the trace."""
    given = options.get("texts", "recorded")
    if given not in {"recorded", "unrecorded"}:
        raise UsageError(f"texts={given!r}; there is recorded or unrecorded")
    return given == "recorded"


def system_option(options: Mapping[str, str]) -> int | None:
    """A system id; ``None``: take the first autopilot that speaks."""
    given = options.get("system")
    if given is None:
        return None
    if not given.isdigit() or not 1 <= int(given) <= 255:
        raise UsageError(f"system={given!r} is no system id from 1 to 255")
    return int(given)


def check_options(driver: str, options: Mapping[str, str], *allowed: str) -> None:
    """Refuse options that nobody would look at."""
    for name in options:
        if name not in allowed:
            hint = did_you_mean(name, allowed)
            raise UsageError(f"the {driver} driver has no option {name!r}{hint}; it has {choices(allowed)}")
