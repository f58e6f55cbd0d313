"""Plain rclpy, with nothing of ours: sets a parameter of a node once it is there; prints its value before.

Arguments: node, parameter, value.
"""

import sys
import time

import rclpy
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient

LIMIT_S = 200


def main(of, name, value):
    rclpy.init()
    node = rclpy.create_node("tuner")
    client = AsyncParameterClient(node, of)
    if not client.wait_for_services(LIMIT_S):
        raise SystemExit(f"no node {of}")

    def result(future):
        rclpy.spin_until_future_complete(node, future, timeout_sec=LIMIT_S)
        return future.result()

    end = time.monotonic() + LIMIT_S
    while not (found := result(client.get_parameters([name])).values) or not found[0].type:
        if time.monotonic() > end:
            raise SystemExit(f"{of} has no parameter {name}")
    sys.stdout.write(f"{found[0].double_value}\n")
    wanted = Parameter(name, Parameter.Type.DOUBLE, float(value))
    (answer,) = result(client.set_parameters([wanted])).results
    if not answer.successful:
        raise SystemExit(answer.reason)
    rclpy.shutdown()


main(*sys.argv[1:])
