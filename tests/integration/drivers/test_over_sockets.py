"""A whole flight over real sockets: the simulated autopilot in a thread with a clock of its own."""

from __future__ import annotations

import threading

import pytest

from rigs.airstrip import at
from rigs.sockets import HERE, flown, served
from volery.base.errors import Overridden, VoleryError
from volery.base.time import S
from volery.kernel.wall import FollowingKernel
from volery.links.stream_links import TcpServer
from volery.links.udp_link import UdpLink
from volery.run.connect import connect
from volery.vehicles.address import open_link, parse

pytestmark = pytest.mark.integration

AUTOPILOTS = ("ardupilot", "px4")


@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_tcp(autopilot: str) -> None:
    kernel = FollowingKernel()
    with served(lambda theirs: TcpServer(theirs, HERE, 0), autopilot, kernel) as server:
        address = parse(f"{autopilot}+tcp://{HERE}:{server.port}")
        flown(kernel, open_link(kernel, address), autopilot)


@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_udp(autopilot: str) -> None:
    kernel = FollowingKernel()
    ours = UdpLink(kernel, HERE, 0)  # as udp://:PORT does, on a port that is free
    with served(lambda theirs: UdpLink(theirs, HERE, 0, (HERE, ours.port)), autopilot, kernel):
        flown(kernel, ours, autopilot)


def test_threads_of_a_script() -> None:
    """One thread flies, another one lands it: that aborts the first, as between tasks."""
    ended: list[object] = []

    def go_far() -> None:
        try:
            drone.goto(at(0.0, 200.0, 5.0))
        except VoleryError as error:
            ended.append(error)

    with (
        served(lambda kernel: TcpServer(kernel, HERE, 0), "ardupilot") as server,
        connect(f"ardupilot+tcp://{HERE}:{server.port}") as drone,
    ):
        for target in (lambda: drone.takeoff(5), go_far):
            thread = threading.Thread(target=target)
            thread.start()
            if target is not go_far:
                thread.join()
        drone.telemetry.changed.wait_for(lambda: max(map(abs, drone.telemetry.velocity)) > 3.0, 30 * S)
        lander = threading.Thread(target=drone.land)
        lander.start()
        thread.join()
        lander.join()
        assert not drone.armed
    assert [type(error) for error in ended] == [Overridden]
    assert "land() by Thread-" in str(ended[0])
