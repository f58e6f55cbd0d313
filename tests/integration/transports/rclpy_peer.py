"""Plain rclpy, with nothing of ours: sends each type to our node, compares what comes back; prints JSON.

Its arguments are the names of the types.
"""

import importlib
import json
import sys
import time
from array import array

import numpy
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter_client import AsyncParameterClient
from std_msgs.msg import String
from std_srvs.srv import SetBool

LIMIT_S = 200


def fill(message, number=1):
    """No field keeps its default, as far as types allow."""
    for offset, (name, kind) in enumerate(message.get_fields_and_field_types().items()):
        value = getattr(message, name)
        if hasattr(value, "get_fields_and_field_types"):
            fill(value, number + offset)
        elif isinstance(value, bool):
            setattr(message, name, True)
        elif isinstance(value, (int, float)):
            setattr(message, name, type(value)(number + offset))
        elif isinstance(value, bytes):
            setattr(message, name, b"\7")
        elif isinstance(value, str):
            setattr(message, name, f"text {number} ü")
        elif isinstance(value, array):
            value.extend(array(value.typecode, [1, 2, 3]))
        elif isinstance(value, numpy.ndarray):
            value[:] = numpy.arange(len(value))
        elif kind == "sequence<string>":
            setattr(message, name, ["a", "ü"])
    return message


def spin_until(executor, holds, what):
    end = time.monotonic() + LIMIT_S
    while not holds():
        if time.monotonic() > end:
            raise SystemExit(f"not in time: {what}")
        executor.spin_once(timeout_sec=0.1)


def main(names):
    rclpy.init()
    node = rclpy.create_node("peer")
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    sent, came, publishers = {}, {}, {}
    for name in names:
        package, _, label = name.split("/")
        cls = getattr(importlib.import_module(f"{package}.msg"), label)
        sent[name] = fill(cls())
        node.create_subscription(cls, f"/back/{name}", lambda one, name=name: came.update({name: one}), 10)
        publishers[name] = node.create_publisher(cls, f"/there/{name}", 10)
    ends = [*publishers.items()]
    spin_until(
        executor,
        lambda: all(p.get_subscription_count() and node.count_publishers(f"/back/{n}") for n, p in ends),
        "all connect",
    )
    for name, publisher in publishers.items():
        publisher.publish(sent[name])
    spin_until(executor, lambda: len(came) == len(names), "all come back")
    found = {"changed": [n for n in names if came[n] != sent[n]]}

    client = node.create_client(SetBool, "/drone_1/arm")
    spin_until(executor, client.service_is_ready, "our service")
    future = client.call_async(SetBool.Request(data=True))
    spin_until(executor, future.done, "our answer")
    found["answer"] = [future.result().success, future.result().message]

    def serve(request, response):
        response.success, response.message = request.data, "by rclpy"
        return response

    node.create_service(SetBool, "/theirs", serve)
    reports = []
    node.create_subscription(String, "/report", lambda one: reports.append(one.data), 10)
    order = node.create_publisher(String, "/order", 10)
    spin_until(
        executor, lambda: order.get_subscription_count() and node.count_publishers("/report"), "the order"
    )
    time.sleep(1)  # for our side to discover the service
    order.publish(String(data="call"))
    spin_until(executor, lambda: reports, "the report of our call")
    found["report"] = reports

    parameters = AsyncParameterClient(node, "/drone_1/mavros")
    spin_until(executor, parameters.services_are_ready, "our parameters")
    asked = parameters.get_parameters(["rate"])
    spin_until(executor, asked.done, "our parameter")
    found["rate"] = asked.result().values[0].integer_value
    spin_until(executor, lambda: "mavros" in node.get_node_names(), "our node's name")
    found["nodes"] = sorted(
        f"{space.rstrip('/')}/{name}" for name, space in node.get_node_names_and_namespaces()
    )
    found["topics"] = dict(node.get_topic_names_and_types())
    found["served"] = [n for n, _ in node.get_service_names_and_types_by_node("mavros", "/drone_1")]
    json.dump(found, sys.stdout)
    rclpy.shutdown()


if __name__ == "__main__":
    main(sys.argv[1:])
