"""The messages of ``pipe`` over topics of the graph, between a run and components that others started.

JSON in ``std_msgs/String``: nothing that arrives from the graph is executed or unpickled. ``Ready`` is
repeated until ``Begin`` arrives, so no message depends on who joined the graph first.
"""

from __future__ import annotations

import json
from typing import Any, NamedTuple

from volery.base.errors import UsageError
from volery.ros.graph.interface import QoS
from volery.ros.messages import RosMessage, new
from volery.run.distributed.pipe import Begin, EndingBegun, Ready, StartFailed, Stop
from volery.trace.events import Call, Failure, Milestone, Operation, Text

TO_RUN = "/volery/to_run"
TO_COMPONENTS = "/volery/to_components"
MESSAGE_TYPE = "std_msgs/msg/String"
QUEUE = QoS(depth=1000)

_KINDS = {
    kind.__name__: kind
    for kind in (Ready, StartFailed, EndingBegun, Begin, Stop, Call, Operation, Milestone, Text, Failure)
}
"""What is sent. Other events of a component's process are not: messages would be sent twice."""


class Sent(NamedTuple):
    """A message, and the component that it comes from; empty for the run."""

    sender: str
    content: Any


def is_sent(thing: object) -> bool:
    """Return whether *thing* goes over the graph."""
    return type(thing).__name__ in _KINDS


def to_message(sender: str, content: Any) -> RosMessage:
    """Return the message of the graph."""
    text = json.dumps({"from": sender, "kind": type(content).__name__, "fields": list(content)})
    made: RosMessage = new(MESSAGE_TYPE, data=text)
    return made


def from_message(message: Any) -> Sent:
    """Return what ``to_message`` was given.

    Raises:
        UsageError: The text is something else.
    """
    try:
        found = json.loads(message.data)
        return Sent(str(found["from"]), _KINDS[found["kind"]](*found["fields"]))
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise UsageError(f"not a message of a deployed component: {error}") from error
