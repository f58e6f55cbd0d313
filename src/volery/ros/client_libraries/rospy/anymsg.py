"""``rospy.AnyMsg``: messages of whatever type a topic carries, as ROS 1's bytes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from volery.base.time import MS, Ns
from volery.ros.client_libraries.rospy.session import Session
from volery.ros.graph import QoS, Subscription
from volery.ros.messages import ros1_type, to_ros1
from volery.ros.messages.message import Message

_LOOK: Ns = 100 * MS
"""How often a topic is looked for that nobody publishes yet."""


class AnyMsg:
    """A message as its bytes, ``_buff``; ``_connection_header`` says of which type and topic."""

    _type = "*"
    _md5sum = "*"

    def __init__(self, message: Message, topic: str) -> None:
        kind = ros1_type(message.__msgtype__)
        self._buff = to_ros1(message)
        self._connection_header = {
            "topic": topic, "type": kind.name, "md5sum": kind.md5, "message_definition": kind.text
        }  # fmt: skip


class AnySubscription:
    """Subscribes once the type of *topic* is known: at once, or when somebody else has stated it."""

    def __init__(self, session: Session, topic: str, callback: Callable[[Any], None], qos: QoS) -> None:
        self._session, self.topic, self._qos = session, topic, qos
        self._callback = callback
        self._made: Subscription | None = None
        self._open = True
        session.beside(self._look, f"type of {topic}")

    def _look(self) -> None:
        node = self._session.node
        while self._open and not node.closed:
            kind = next((one.type for one in self._session.graph.topics() if one.name == self.topic), "")
            if kind:
                group = self._session.spin_beside(self.topic, f"callback of {self.topic}")
                self._made = node.subscribe(self.topic, kind, self._hear, self._qos, group)
                return
            node.sleep(_LOOK)

    def _hear(self, message: Any) -> None:
        self._callback(AnyMsg(message, self.topic))

    def publishers(self) -> int:
        """How many publishers it is connected to."""
        return 0 if self._made is None else self._made.publishers()

    def close(self) -> None:
        """Receive no longer."""
        self._open = False
        if self._made is not None:
            self._made.close()
