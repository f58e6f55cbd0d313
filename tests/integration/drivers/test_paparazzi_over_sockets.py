"""A whole flight of a Paparazzi over real UDP and over a pseudo terminal, as pprzlink bytes."""

from __future__ import annotations

import os
import tty
from typing import Any

import pytest

from rigs.sockets import HERE, flown, served
from volery.base.errors import LinkGarbled
from volery.kernel.virtual import VirtualKernel
from volery.kernel.wall import FollowingKernel
from volery.links.coded_link import CodedLink
from volery.links.pprzlink_codec import PPRZLINK
from volery.links.stream_links import SerialLink
from volery.links.udp_link import UdpLink
from volery.vehicles import Drone
from volery.vehicles.address import open_link, parse
from volery.vehicles.drivers.paparazzi import open_driver

pytestmark = pytest.mark.integration

PAPARAZZI = "paparazzi"


def test_udp_to_a_host_that_listens() -> None:
    kernel = FollowingKernel()
    with served(lambda own: UdpLink(own, HERE, 0, codec=PPRZLINK), PAPARAZZI, kernel) as theirs:
        address = parse(f"paparazzi+udp://{HERE}:{theirs.port}")
        flown(kernel, open_link(kernel, address, PPRZLINK), PAPARAZZI)


def test_udp_answering_at_the_uplink_port() -> None:
    """The aircraft speaks from one port and listens at another: here it does so with two links."""
    kernel = FollowingKernel()

    def aircraft(theirs: VirtualKernel) -> CodedLink:
        return UdpLink(theirs, HERE, 0, (HERE, ours.port), codec=PPRZLINK)

    deaf = UdpLink(kernel, HERE, 0, codec=PPRZLINK)
    ours = UdpLink(kernel, HERE, 0, codec=PPRZLINK, answers_to=deaf.port)
    received: list[str] = []
    deaf.receive(lambda frame: received.append(frame.name))
    with served(aircraft, PAPARAZZI, kernel):
        drone = Drone(kernel, "drone_1", open_driver(kernel, ours, "drone_1", {}))
        kernel.start()
        with kernel.adopt("script"):
            drone.wait_connected()
            assert drone.telemetry.changed.wait_for(lambda: "GET_SETTING" in received, 60 * 10**9)
        drone.close()
        deaf.close()
        assert kernel.close() == []


def test_a_serial_line() -> None:
    theirs, ours = os.openpty()
    tty.setraw(theirs)
    tty.setraw(ours)

    class Line(SerialLink):
        """The terminal's other end, which has no name."""

        def _open(self) -> Any:
            return _Master(theirs)

    kernel = FollowingKernel()
    address = parse(f"paparazzi+serial://{os.ttyname(ours)}")
    with served(lambda virtual: Line(virtual, "master", 115_200, "master", PPRZLINK), PAPARAZZI, kernel):
        flown(kernel, open_link(kernel, address, PPRZLINK), PAPARAZZI)
    os.close(ours)


class _Master:
    """The controlling end of a pseudo terminal."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor

    def fileno(self) -> int:
        return self._descriptor

    def read(self) -> bytes:
        return os.read(self._descriptor, 4096)

    def write(self, data: bytes) -> int:
        return os.write(self._descriptor, data)

    def close(self) -> None:
        os.close(self._descriptor)


def test_another_autopilot_than_the_one_meant() -> None:
    kernel = FollowingKernel()
    ours = UdpLink(kernel, HERE, 0, codec=PPRZLINK)
    with served(lambda theirs: UdpLink(theirs, HERE, 0, (HERE, ours.port)), "ardupilot", kernel):
        drone = Drone(kernel, "drone_1", open_driver(kernel, ours, "drone_1", {}))
        kernel.start()
        try:
            with (
                kernel.adopt("script"),
                pytest.raises(
                    LinkGarbled, match="MAVLink arrives, not pprzlink: an autopilot of another make"
                ),
            ):
                drone.wait_connected()
        finally:
            drone.close()
            assert kernel.close() == []
