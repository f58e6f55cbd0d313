"""Run in an environment with rclpy: a node of ours that a plain rclpy node in another process talks to.

It repeats each message of each type under ``/back``, serves and calls a service, and ends with its input.
"""

from __future__ import annotations

import sys
from functools import partial
from typing import Any

from volery.kernel.task import ExecutionContext
from volery.kernel.wall import WallKernel
from volery.ros.graph import QoS
from volery.ros.messages import request, service, types
from volery.ros.transports.ros2 import carried, ros2_graph
from volery.testing.transport_topic_checks import PUBLISHED

SET_BOOL = "std_srvs/srv/SetBool"


def main() -> None:
    kernel = WallKernel()
    with kernel.adopt("ours"):
        graph = ros2_graph(kernel)
        node = graph.node("mavros", "/drone_1")
        node.set_parameter("~rate", 10)
        names = [one for one in types() if one.split("/")[0] in PUBLISHED and carried(one)]
        for name in names:
            back = node.advertise(f"/back/{name}", name, QoS(depth=20))
            node.subscribe(f"/there/{name}", name, back.publish)
        kind = service(SET_BOOL)
        node.serve("arm", SET_BOOL, lambda asked: kind.response(asked.data, "by volery"))
        client = node.client("/theirs", SET_BOOL)
        aside = node.group()
        report = node.advertise("/report", "std_msgs/msg/String")

        def order(message: Any) -> None:
            answer = client.call(request(SET_BOOL, data=True), 10_000_000_000)
            message.data = f"{answer.success} {answer.message}"
            report.publish(message)

        node.subscribe("/order", "std_msgs/msg/String", order, group=aside)
        for spin in (node.spin, aside.spin):
            kernel.spawn(spin, "spins", ExecutionContext("mavros"))
        sys.stdout.write("\n".join(["ready", *names, ""]))
        sys.stdout.flush()
        node_wait = partial(sys.stdin.read, 1)
        node_wait()
        graph.close()


if __name__ == "__main__":
    main()
