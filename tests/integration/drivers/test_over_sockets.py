"""A whole flight over real sockets: the simulated autopilot in a thread with a clock of its own."""

from __future__ import annotations

import pytest

from rigs.sockets import HERE, PACE, flown, served
from volery.kernel.wall import WallKernel
from volery.links.stream_links import TcpServer
from volery.links.udp_link import UdpLink
from volery.vehicles.address import open_link, parse

pytestmark = pytest.mark.integration

AUTOPILOTS = ("ardupilot", "px4")


@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_tcp(autopilot: str) -> None:
    with served(lambda kernel: TcpServer(kernel, HERE, 0), autopilot) as server:
        kernel = WallKernel(speed=PACE)
        address = parse(f"{autopilot}+tcp://{HERE}:{server.port}")
        flown(kernel, open_link(kernel, address), autopilot)


@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_udp(autopilot: str) -> None:
    kernel = WallKernel(speed=PACE)
    ours = UdpLink(kernel, HERE, 0)  # as udp://:PORT does, on a port that is free
    with served(lambda theirs: UdpLink(theirs, HERE, 0, (HERE, ours.port)), autopilot):
        flown(kernel, ours, autopilot)
