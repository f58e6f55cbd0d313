"""A whole flight of a Paparazzi over real UDP and over a pseudo terminal, as pprzlink bytes."""

from __future__ import annotations

import os
import threading
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from volery.autopilots.simulated.autopilot import Autopilot
from volery.autopilots.simulated.flight import make_world
from volery.base.errors import LinkGarbled
from volery.base.frames import LocalFrame
from volery.base.position import AboveHome, Position
from volery.base.registry import Registry
from volery.base.time import HOUR
from volery.drivers.paparazzi import open_driver
from volery.kernel.virtual import VirtualKernel
from volery.kernel.wall import WallKernel
from volery.links.coded import CodedLink
from volery.links.pprzlink import PPRZLINK
from volery.links.serial_line import SerialLine
from volery.links.udp import UdpLink
from volery.vehicles import Drone
from volery.vehicles.address import parse
from volery.vehicles.carriers import open_link
from volery.world.specs import Multirotor

pytestmark = pytest.mark.integration

HERE = "127.0.0.1"
PACE = 20.0
FRAME = LocalFrame(46.0825, -103.8995, 900.0)
dialects: Registry[Any] = Registry("volery.autopilots", "autopilot")


@contextmanager
def served(listen: Callable[[VirtualKernel], CodedLink], autopilot: str = "paparazzi") -> Iterator[CodedLink]:
    """A simulated drone behind a carrier, in its own thread, at twenty times the pace of the wall clock."""
    kernel = VirtualKernel(pace=PACE)
    _, (flight,) = make_world(kernel.now, [Multirotor()], seed=7, frame=FRAME)
    pilot = Autopilot(kernel, flight, dialects.load(autopilot), warm=True)
    link = listen(kernel)
    pilot.connect(link)
    thread = threading.Thread(target=kernel.run, args=(HOUR,), daemon=True)
    thread.start()
    try:
        yield link
    finally:
        kernel.post(lambda: kernel.cancel(kernel.root, "end"))
        thread.join(10)
        link.close()
        assert not thread.is_alive()


def flown(kernel: WallKernel, link: CodedLink) -> None:
    """There and back."""
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


def test_udp_to_a_host_that_listens() -> None:
    with served(lambda kernel: UdpLink(kernel, HERE, 0, codec=PPRZLINK)) as theirs:
        kernel = WallKernel(speed=PACE)
        port = theirs.port  # type: ignore[attr-defined]  # a UdpLink's
        flown(kernel, open_link(kernel, parse(f"paparazzi+udp://{HERE}:{port}"), PPRZLINK))


def test_udp_answering_at_the_uplink_port() -> None:
    """The aircraft speaks from one port and listens at another: here it does so with two links."""
    kernel = WallKernel(speed=PACE)

    def aircraft(theirs: VirtualKernel) -> CodedLink:
        return UdpLink(theirs, HERE, 0, (HERE, ours.port), codec=PPRZLINK)

    deaf = UdpLink(kernel, HERE, 0, codec=PPRZLINK)
    ours = UdpLink(kernel, HERE, 0, codec=PPRZLINK, answers_to=deaf.port)
    heard: list[str] = []
    deaf.receive(lambda frame: heard.append(frame.name))
    with served(aircraft):
        drone = Drone(kernel, "drone_1", open_driver(kernel, ours, "drone_1", {}))
        kernel.start()
        with kernel.adopt("script"):
            drone.wait_heard()
            assert drone.telemetry.changed.wait_for(lambda: "GET_SETTING" in heard, 60 * 10**9)
        drone.close()
        deaf.close()
        assert kernel.close() == []


def test_a_serial_line() -> None:
    theirs, ours = os.openpty()
    tty.setraw(theirs)
    tty.setraw(ours)

    class Line(SerialLine):
        """The terminal's other end, which has no name."""

        def _open(self) -> Any:
            return _Master(theirs)

    kernel = WallKernel(speed=PACE)
    address = parse(f"paparazzi+serial://{os.ttyname(ours)}")
    with served(lambda virtual: Line(virtual, "master", 115_200, "master", PPRZLINK)):
        flown(kernel, open_link(kernel, address, PPRZLINK))
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
    kernel = WallKernel(speed=PACE)
    ours = UdpLink(kernel, HERE, 0, codec=PPRZLINK)
    with served(lambda theirs: UdpLink(theirs, HERE, 0, (HERE, ours.port)), "ardupilot"):
        drone = Drone(kernel, "drone_1", open_driver(kernel, ours, "drone_1", {}))
        kernel.start()
        try:
            with (
                kernel.adopt("script"),
                pytest.raises(
                    LinkGarbled, match="MAVLink arrives, not pprzlink: an autopilot of another make"
                ),
            ):
                drone.wait_heard()
        finally:
            drone.close()
            assert kernel.close() == []
