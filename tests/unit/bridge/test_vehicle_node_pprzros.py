"""A Paparazzi aircraft's link as pprzros's two topics."""

from __future__ import annotations

from typing import Any

import pytest

from volery.base.errors import UsageError
from volery.base.time import MS, S
from volery.bridge import serve_pprzros
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.links.frame import Frame
from volery.links.in_process_link import in_process_pair
from volery.links.pprzlink_codec import PPRZLINK
from volery.links.pprzros_messages import FROM_ROS, PPRZROS_TYPE, TO_ROS, to_frame, to_message
from volery.ros.graph import EmbeddedGraph
from volery.ros.messages import new
from volery.trace.events import Text

SETPOINT = Frame(
    "GUIDED_SETPOINT_NED", {"ac_id": 7, "flags": 0, "x": 1.5, "y": -2.0, "z": -10.0, "yaw": 0.25}, 0, 0
)
ALIVE = Frame("ALIVE", {"md5sum": (1, 2, 3)}, 7, 1)


class BridgeRig:
    """An aircraft, its node, and a node that listens and speaks."""

    def __init__(self) -> None:
        self.events: list[Any] = []
        self.kernel = VirtualKernel(record=self.events.append)
        link, self.aircraft = in_process_pair(self.kernel, MS, "craft", PPRZLINK)
        self.sent: list[Frame] = []
        self.aircraft.receive(self.sent.append)
        self.received: list[Any] = []
        self.graph = EmbeddedGraph(self.kernel)
        serve_pprzros(self.graph, link, "craft_1", ExecutionContext("pprzros"))
        self.kernel.spawn(self._control, "control", ExecutionContext("control"))

    def _control(self) -> None:
        node = self.graph.node("control")
        self.publisher = node.advertise(f"/craft_1/{FROM_ROS}", PPRZROS_TYPE)
        group = node.group()
        node.subscribe(f"/craft_1/{TO_ROS}", PPRZROS_TYPE, self.received.append, group=group)
        group.spin()

    def publish(self, message: Any) -> None:
        self.kernel.spawn(lambda: self.publisher.publish(message), "publish", ExecutionContext("control"))


def test_there_and_back() -> None:
    for frame in (SETPOINT, ALIVE):
        assert to_frame(to_message(frame, 5 * S)) == PPRZLINK.quantised(frame)


def test_what_a_message_says() -> None:
    message = to_message(SETPOINT, 5 * S + 7)
    assert (message.version, message.class_name, message.msg_name) == (2, "datalink", "GUIDED_SETPOINT_NED")
    assert (message.sender_id, message.receiver_id, message.len) == (0, 7, len(message.data))
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (5, 7)
    # check bytes of the frame as it would be on the wire
    wire = PPRZLINK.encode(SETPOINT, 0)
    assert message.checksum == wire[-2] << 8 | wire[-1]
    assert bytes(message.data) == wire[6:-2]


def test_what_the_aircraft_says_is_published() -> None:
    rig = BridgeRig()
    rig.kernel.run(S)
    rig.aircraft.send(ALIVE)
    rig.kernel.run(2 * S)
    (message,) = rig.received
    assert (message.msg_name, message.sender_id, message.comp_id) == ("ALIVE", 7, 1)
    assert to_frame(message).fields == {"md5sum": (1, 2, 3)}


def test_published_messages_are_sent_to_the_aircraft() -> None:
    rig = BridgeRig()
    rig.kernel.run(S)
    rig.publish(to_message(SETPOINT, 0))
    rig.kernel.run(2 * S)
    assert rig.sent == [PPRZLINK.quantised(SETPOINT)]


@pytest.mark.parametrize(
    ("message", "says"),
    [
        (new(PPRZROS_TYPE, msg_name="NO_SUCH"), "NO_SUCH"),
        (new(PPRZROS_TYPE, msg_name="GUIDED_SETPOINT_NED", data=[1, 2]), "of 2 bytes: it has another length"),
        (new(PPRZROS_TYPE), "no"),
    ],
)
def test_what_makes_no_sense_is_dropped_with_a_warning(message: Any, says: str) -> None:
    with pytest.raises(UsageError, match=says):
        to_frame(message)
    rig = BridgeRig()
    rig.kernel.run(S)
    rig.publish(message)
    rig.publish(to_message(SETPOINT, 0))
    rig.kernel.run(2 * S)
    assert len(rig.sent) == 1
    (warning,) = [event for event in rig.events if isinstance(event, Text)]
    assert warning.text.startswith("pprzros/from_ros: message dropped: ")
