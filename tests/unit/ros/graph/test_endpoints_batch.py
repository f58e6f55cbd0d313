"""Messages that are published as one batch: their number, order and refusals."""

from __future__ import annotations

from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.ros.graph.embedded_graph import EmbeddedGraph
from volery.ros.messages import new
from volery.trace.events import Charge

FLOAT = "std_msgs/msg/Float64"


def test_a_batch_is_one_charge_and_a_refused_message_does_not_hold_up_the_others():
    kernel = VirtualKernel()
    events, received, refused = [], [], []
    kernel.record = events.append
    graph = EmbeddedGraph(kernel)

    def run():
        node = graph.node("bridge", "/", context=ExecutionContext("bridge"))
        publishers = [node.advertise(name, FLOAT) for name in ("a", "b", "c")]
        for name in ("a", "b", "c"):
            node.subscribe(name, FLOAT, lambda message: received.append(message.data))
        values = (1.0, "no number", 3.0)
        messages = [(one, new(FLOAT, data=value)) for one, value in zip(publishers, values, strict=True)]
        node.publish_all(messages, lambda index, error: refused.append((index, str(error))))
        node.spin_available()

    kernel.spawn(run, "bridge", ExecutionContext("bridge"))
    kernel.run(10**9)
    kinds = [one.kind for one in events if isinstance(one, Charge) and "publish" in one.kind]
    assert kinds == ["ros:publish*3"]
    assert received == [1.0, 3.0]
    assert [index for index, _ in refused] == [1]
