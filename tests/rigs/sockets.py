"""A simulated drone behind a real socket or line, in a thread with a clock of its own; and a flight to it.

The side that flies takes its time from the drone: both see equally much pass, however busy the machine is.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from rigs.airstrip import FRAME, at
from volery.base.time import HOUR, MS
from volery.kernel.virtual import VirtualKernel
from volery.kernel.wall import FollowingKernel
from volery.links.coded_link import CodedLink
from volery.simulation.autopilots.fleet_autopilot import firmwares
from volery.simulation.autopilots.flight_stack.flight import make_world
from volery.simulation.world.body_specs import Multirotor
from volery.vehicles import Drone
from volery.vehicles.driver import drivers

HERE = "127.0.0.1"
PACE = 20.0
"""Times faster than the wall clock, at most."""
TICK = 10 * MS


@contextmanager
def served(
    listen: Callable[[VirtualKernel], CodedLink], autopilot: str, follower: FollowingKernel | None = None
) -> Iterator[Any]:
    """The link of a simulated drone, made by *listen*; *follower* is given its time."""
    kernel = VirtualKernel(pace=PACE)
    if follower is not None:
        kernel.every(TICK, lambda: follower.advance(TICK))
    _, (flight,) = make_world(kernel.now, [Multirotor()], seed=7, frame=FRAME)
    served_one = firmwares.load(autopilot).create(kernel, flight, warm=True)
    link = listen(kernel)
    served_one.connect(link)
    thread = threading.Thread(target=kernel.run, args=(HOUR,), daemon=True)
    thread.start()
    try:
        yield link
    finally:
        kernel.post(lambda: kernel.cancel(kernel.root, "end"))
        thread.join(60)
        link.close()
        assert not thread.is_alive()


def flown(kernel: FollowingKernel, link: CodedLink, autopilot: str) -> None:
    """There and back."""
    open_driver = drivers.load(autopilot).on_link
    assert open_driver is not None
    drone = Drone(kernel, "drone_1", open_driver(kernel, link, "drone_1", {}))
    kernel.start()
    try:
        with kernel.adopt("script"):
            drone.takeoff(5)
            drone.goto(at(0.0, 15.0, 5.0))
            assert drone.altitude.metres == pytest.approx(5.0, abs=0.6)
            drone.land()
            assert not drone.armed
    finally:
        drone.close()
        assert kernel.close() == []
