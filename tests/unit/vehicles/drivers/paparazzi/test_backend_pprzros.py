"""The same driver over pprzros's topics on the embedded graph, behind a bridge, with a scripted aircraft."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from rigs.missions import carried_out
from volery.base.errors import LinkSilent, UsageError
from volery.base.position import AboveHome, Position
from volery.base.time import MS, S
from volery.bridge import serve_pprzros
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.kernel.waiting import sleep
from volery.links.frame import Frame
from volery.links.in_process_link import in_process_pair
from volery.links.pprzlink_codec import PPRZLINK
from volery.links.pprzros_messages import PPRZROS_TYPE, to_message
from volery.ros.graph import EmbeddedGraph
from volery.ros.messages import new
from volery.trace.events import Operation
from volery.vehicles import Drone
from volery.vehicles.drivers.paparazzi import open_pprzros

LATITUDE, LONGITUDE = 43.4622222, 1.2733333
NEAR = Position(LATITUDE + 0.0003, LONGITUDE, AboveHome(12.0))


class OnGraph:
    """A scripted aircraft, the bridge's node, and a node that commands."""

    def __init__(self, peer: Any, *, bridged: bool = True) -> None:
        self.events: list[Any] = []
        self.kernel = VirtualKernel(record=self.events.append)
        link, theirs = in_process_pair(self.kernel, MS, "radio", PPRZLINK)
        self.aircraft = peer(self.kernel, theirs)
        self.graph = EmbeddedGraph(self.kernel, route=self._route)
        if bridged:
            serve_pprzros(self.graph, link, "bee", ExecutionContext("bridge"))

    def _route(self, one: Any, other: Any) -> Any:
        return lambda size, sure, deliver, lost: self.kernel.call_at(self.kernel.now() + MS, deliver)

    def fly(self, mission: Callable[[Any], Any], **options: str) -> Any:
        def body() -> Any:
            node = self.graph.node("control")
            driver = open_pprzros(self.kernel, node, "bee", {"namespace": "/bee", **options})
            return mission(Drone(self.kernel, "bee", driver))

        return carried_out(self.kernel, body)


@pytest.fixture
def peer(bench: Any) -> Any:
    return bench.peer


def test_a_mission(peer: Any) -> None:
    at = OnGraph(peer)

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.goto(NEAR)
        drone.return_home()

    at.fly(mission)
    craft = at.aircraft.craft
    assert (craft.armed, craft.up) == (False, 0.0)
    outcomes = [(one.operation, one.outcome) for one in at.events if isinstance(one, Operation)]
    assert outcomes == [("takeoff", "ok"), ("goto", "ok"), ("return_home", "ok")]


def test_a_velocity_ends_although_the_component_does_something_else(peer: Any) -> None:
    """Paparazzi itself would fly on for ever."""
    at = OnGraph(peer)

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.set_velocity(2.0, lasting=2.0)
        sleep(at.kernel, 5 * S)

    at.fly(mission)
    assert at.aircraft.craft.velocity == (0.0, 0.0, 0.0)


def test_sticks_go_on_although_the_component_does_something_else(peer: Any) -> None:
    at = OnGraph(peer)

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.manual_control(0.0, 0.0, 0.5, 0.0)
        drone.altitude_hold()
        before = len(at.aircraft.sent("RC_UP"))
        sleep(at.kernel, 5 * S)
        assert len(at.aircraft.sent("RC_UP")) >= before + 40

    at.fly(mission)


def test_no_bridge(peer: Any) -> None:
    at = OnGraph(peer, bridged=False)
    with pytest.raises(LinkSilent, match="no node publishes /bee/pprzros/to_ros; start pprzros"):
        at.fly(lambda drone: drone.wait_connected())


def test_a_bridge_that_publishes_nonsense(peer: Any) -> None:
    at = OnGraph(peer, bridged=False)

    def babble() -> None:
        node = at.graph.node("babbler")
        publisher = node.advertise("/bee/pprzros/to_ros", PPRZROS_TYPE)
        for _ in range(20):
            sleep(at.kernel, S)
            publisher.publish(new(PPRZROS_TYPE, msg_name="NO_SUCH_MESSAGE", sender_id=7, data=[1, 2, 3]))

    at.kernel.spawn(babble, "babbler", ExecutionContext("babbler"))
    with pytest.raises(LinkSilent, match="cannot be decoded: pprzlink has no message 'NO_SUCH_MESSAGE'"):
        at.fly(lambda drone: drone.wait_connected())


def test_the_root_is_where_pprzros_itself_is(peer: Any) -> None:
    at = OnGraph(peer, bridged=False)
    received: list[Any] = []

    def bridge() -> None:
        node = at.graph.node("pprzros")
        publisher = node.advertise("/pprzros/to_ros", PPRZROS_TYPE)
        node.subscribe("/pprzros/from_ros", PPRZROS_TYPE, received.append, group=(group := node.group()))
        status = Frame("ROTORCRAFT_STATUS", {"ap_mode": 13}, 7, 0)
        while not received:
            sleep(at.kernel, S)
            publisher.publish(to_message(status, at.kernel.now()))
            group.spin_once(0)

    at.kernel.spawn(bridge, "bridge", ExecutionContext("bridge"))
    at.fly(lambda drone: drone.wait_connected(), namespace="/")
    assert received[0].msg_name == "PING"


def test_options_that_make_no_sense(peer: Any) -> None:
    at = OnGraph(peer)
    with pytest.raises(UsageError, match="the paparazzi driver has no option 'uplink'"):
        at.fly(lambda drone: drone.wait_connected(), uplink="4243")
