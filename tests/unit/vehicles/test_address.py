from __future__ import annotations

import pytest

from volery.base.errors import UsageError
from volery.vehicles.address import Address, open_link, parse, parse_listen, system_option


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("sim:ardupilot", Address("ardupilot", "sim")),
        ("ardupilot+tcp://127.0.0.1:5760", Address("ardupilot", "tcp", "127.0.0.1", 5760)),
        ("ardupilot+udp://:14550", Address("ardupilot", "udp", "", 14550)),
        ("ardupilot+tcp://[::1]:5760", Address("ardupilot", "tcp", "::1", 5760)),
        ("mavros+graph:///drone_1", Address("mavros", "graph", path="/drone_1")),
    ],
)
def test_addresses(text: str, address: Address) -> None:
    assert parse(text) == address
    assert str(parse(text)) == text


def test_options() -> None:
    address = parse("ardupilot+serial:///dev/ttyUSB0?baud=921600&rate=5")
    assert (address.path, address.number("baud", 57600)) == ("/dev/ttyUSB0", 921600.0)
    assert address.number("system", 1) == 1
    assert parse("sim:ardupilot?home=46.08,-103.9,900").numbers("home", 3) == (46.08, -103.9, 900.0)
    assert parse("sim:ardupilot").numbers("home", 3) is None
    address.only("baud", "rate")
    with pytest.raises(UsageError, match="no option 'rate'; there is baud"):
        address.only("baud")
    with pytest.raises(UsageError, match="'many' is not a number"):
        parse("ardupilot+serial:///dev/ttyUSB0?baud=many").number("baud", 1)
    with pytest.raises(UsageError, match="3 numbers between commas"):
        parse("sim:ardupilot?home=46.08").numbers("home", 3)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "is not an address"),
        ("drone", "is not an address"),
        ("tcp://127.0.0.1:5760", "does not say which driver"),
        ("ardupilot+tpc://127.0.0.1:5760", "did you mean 'tcp'"),
        ("ardupilot+sim://", "no transport 'sim'"),
        ("ardupilot+tcp://127.0.0.1", "lacks the port"),
        ("ardupilot+tcp://:5760", "lacks the host"),
        ("ardupilot+tcp://127.0.0.1:5760/x", "means nothing"),
        ("ardupilot+tcp://127.0.0.1:99999", "Port out of range"),
        ("ardupilot+tcp://127.0.0.1:5760?rate", "name=value"),
        ("ardupilot+serial://", "lacks the device"),
        ("ardupilot+serial://dev/ttyUSB0", "serial:///dev/ttyUSB0"),
        ("mavros+graph://drone_1", "graph:///drone_1"),
        ("sim:", "which autopilot"),
        ("ardupilot+tcp://[::1:5760", "Invalid IPv6"),
    ],
)
def test_what_is_no_address_says_why(text: str, says: str) -> None:
    with pytest.raises(UsageError, match=says):
        parse(text)


def test_addresses_to_listen_at() -> None:
    assert parse_listen("udp://:14550") == Address("", "udp", "", 14550)
    with pytest.raises(UsageError, match="not 'serial'"):
        parse_listen("serial:///dev/ttyUSB0")


@pytest.mark.parametrize("host", ["a" * 300, "..", ".", "x..y"])
def test_a_host_that_no_name_server_takes_is_refused(host: str) -> None:
    with pytest.raises(UsageError, match="no name of a host"):
        parse(f"ardupilot+tcp://{host}:5760")


@pytest.mark.parametrize("baud", ["inf", "1e400", "nan", "-inf", "9" * 100_000])
def test_a_baud_rate_that_is_not_finite_is_refused(baud: str) -> None:
    with pytest.raises(UsageError, match="baud="):
        open_link(None, parse(f"ardupilot+serial:///dev/null?baud={baud}"))  # type: ignore[arg-type]


@pytest.mark.parametrize("system", ["²", "9" * 5000, "0", "256"])
def test_a_system_id_that_is_none_is_refused(system: str) -> None:
    with pytest.raises(UsageError, match="no system id"):
        system_option({"system": system})
