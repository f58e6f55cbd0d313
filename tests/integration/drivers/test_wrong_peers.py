"""Errors for a drone URL at which something else answers, over real sockets."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress

import pytest
from pymavlink.dialects.v10 import ardupilotmega as mavlink_1
from pymavlink.dialects.v20 import ardupilotmega as mavlink_2

from volery.base.errors import LinkError, LinkGarbled, LinkSilent, UsageError
from volery.kernel.wall import WallKernel
from volery.vehicles import Drone
from volery.vehicles.address import open_link, parse
from volery.vehicles.drivers.ardupilot import open_driver

pytestmark = pytest.mark.integration

HERE = "127.0.0.1"


def said_to_the_user(url: str, within: float = 1.5) -> LinkError:
    """The error of one who waits for the autopilot at *url*."""
    kernel = WallKernel()
    address = parse(url)
    drone = Drone(kernel, "drone_1", open_driver(kernel, open_link(kernel, address), "drone_1", {}))
    kernel.start()
    try:
        with kernel.adopt("script"), pytest.raises(LinkError) as caught:
            drone.wait_connected(within)
    finally:
        drone.close()
        assert kernel.close() == []
    return caught.value


@contextmanager
def peer(speak: Callable[[socket.socket], None]) -> Iterator[str]:
    """A server that answers each client, until the context ends."""
    with closing(socket.create_server((HERE, 0))) as listener:
        over = threading.Event()

        def serve() -> None:
            with suppress(OSError):
                connected, _ = listener.accept()
                with connected:
                    while not over.is_set():
                        speak(connected)
                        over.wait(0.1)

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        try:
            yield f"ardupilot+tcp://{HERE}:{listener.getsockname()[1]}"
        finally:
            over.set()
            thread.join(300)


def test_no_listener() -> None:
    with socket.create_server((HERE, 0)) as listener:
        port = listener.getsockname()[1]
    error = said_to_the_user(f"ardupilot+tcp://{HERE}:{port}", within=1.0)
    assert isinstance(error, LinkSilent)
    assert f"drone_1: nothing listens at tcp {HERE}:{port} (connection refused)" in str(error)


def test_a_listener_that_says_nothing() -> None:
    with peer(lambda to: None) as url:
        error = said_to_the_user(url, within=1.0)
    assert isinstance(error, LinkSilent)
    assert "no message of an ArduPilot was received" in str(error)


def test_text() -> None:
    with peer(lambda to: to.sendall(b"SSH-2.0-OpenSSH_9.6\r\n")) as url:
        error = said_to_the_user(url)
    assert isinstance(error, LinkGarbled)
    assert "only text arrives: 'SSH-2.0-OpenSSH_9.6'" in str(error)


def test_garbage() -> None:
    with peer(lambda to: to.sendall(bytes(range(128, 250)))) as url:
        error = said_to_the_user(url)
    assert isinstance(error, LinkGarbled)
    assert "bytes arrive but no MAVLink" in str(error)


def test_mavlink_1() -> None:
    sender = mavlink_1.MAVLink(None, srcSystem=1, srcComponent=1)
    beat = bytes(mavlink_1.MAVLink_heartbeat_message(2, 3, 81, 0, 4, 3).pack(sender))
    with peer(lambda to: to.sendall(beat)) as url:
        error = said_to_the_user(url)
    assert isinstance(error, LinkGarbled)
    assert "MAVLink 1 only: set SERIALx_PROTOCOL=2" in str(error)


def test_another_autopilot() -> None:
    sender = mavlink_2.MAVLink(None, srcSystem=1, srcComponent=1)
    beat = bytes(mavlink_2.MAVLink_heartbeat_message(2, 12, 81, 65536, 3, 3).pack(sender))
    with peer(lambda to: to.sendall(beat)) as url:
        error = said_to_the_user(url)
    assert "a PX4 answers here, not an ArduPilot" in str(error)


def test_a_baud_rate_that_is_none() -> None:
    with pytest.raises(UsageError, match="baud=0 is no baud rate"):
        open_link(WallKernel(), parse("ardupilot+serial:///dev/ttyUSB0?baud=0"))


def test_a_carrier_of_no_bytes() -> None:
    with pytest.raises(UsageError, match="graph carries no bytes"):
        open_link(WallKernel(), parse("mavros+graph:///drone_1"))
