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
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from urllib.parse import SplitResult, parse_qsl, urlsplit

from volery.base.errors import UsageError, choices, did_you_mean

CARRIERS = ("graph", "ros1", "ros2", "serial", "sim", "tcp", "udp")
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
    return _carried(text, url, driver, carrier)


def parse_listen(text: str) -> Address:
    """An address to listen at, or to send to: ``tcp://HOST:PORT``, ``udp://:PORT`` or ``udp://HOST:PORT``."""
    url = _split(text)
    if url.scheme not in {"tcp", "udp"}:
        raise UsageError(f"{text!r}: one listens at tcp://HOST:PORT or udp://HOST:PORT, not {url.scheme!r}")
    return _carried(text, url, "", url.scheme)


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


def _carried(text: str, url: SplitResult, driver: str, carrier: str) -> Address:
    if carrier not in CARRIERS or carrier == "sim":
        valid = [name for name in CARRIERS if name != "sim"]
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
