"""A whole flight over real sockets: the simulated autopilot in a thread with a clock of its own."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from volery.autopilots.simulated.autopilot import Autopilot
from volery.autopilots.simulated.flight import make_world
from volery.base.frames import LocalFrame
from volery.base.position import AboveHome, Position
from volery.base.registry import Registry
from volery.base.time import HOUR
from volery.kernel.virtual import VirtualKernel
from volery.kernel.wall import WallKernel
from volery.links.coded import CodedLink
from volery.links.tcp import TcpServer
from volery.links.udp import UdpLink
from volery.vehicles import Drone, drivers
from volery.vehicles.address import parse
from volery.vehicles.carriers import open_link
from volery.world.specs import Multirotor

pytestmark = pytest.mark.integration

HERE = "127.0.0.1"
PACE = 20.0
AUTOPILOTS = ("ardupilot", "px4")
FRAME = LocalFrame(46.0825, -103.8995, 900.0)
dialects: Registry[Any] = Registry("volery.autopilots", "autopilot")


@contextmanager
def served(listen: Callable[[VirtualKernel], CodedLink], autopilot: str = "ardupilot") -> Iterator[CodedLink]:
    """A simulated drone behind a socket, in its own thread, at twenty times the pace of the wall clock."""
    kernel = VirtualKernel(pace=PACE)
    _, (flight,) = make_world(kernel.now, [Multirotor()], seed=7, frame=FRAME)
    served_one = Autopilot(kernel, flight, dialects.load(autopilot), warm=True)
    link = listen(kernel)
    served_one.connect(link)
    thread = threading.Thread(target=kernel.run, args=(HOUR,), daemon=True)
    thread.start()
    try:
        yield link
    finally:
        kernel.post(lambda: kernel.cancel(kernel.root, "end"))
        thread.join(10)
        link.close()
        assert not thread.is_alive()


def flown(kernel: WallKernel, link: CodedLink, autopilot: str = "ardupilot") -> None:
    """There and back."""
    open_driver = drivers.load(autopilot).on_link
    assert open_driver is not None
    drone = Drone(kernel, "drone_1", open_driver(kernel, link, "drone_1", {}))
    latitude, longitude, _ = FRAME.from_enu((0.0, 15.0, 0.0))
    kernel.start()
    try:
        with kernel.adopt("script"):
            drone.takeoff(5)
            drone.goto(Position(latitude, longitude, AboveHome(5)))
            assert drone.altitude.metres == pytest.approx(5.0, abs=0.6)
            drone.land()
            assert not drone.armed
    finally:
        drone.close()
        assert kernel.close() == []


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
