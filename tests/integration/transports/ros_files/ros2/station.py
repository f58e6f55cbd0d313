"""Reads and sets another node's parameters and leads it through its life, as the command line does."""

import rclpy
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetAvailableTransitions, GetState
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    GetParameterTypes,
    ListParameters,
    SetParameters,
)
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import String


class Station(Node):
    def __init__(self):
        super().__init__("station")
        self.listeners = self.declare_parameter("listeners", 1).value
        self.told = self.create_publisher(String, "told", 100)
        self.voices = []
        self.create_subscription(String, "voice", lambda one: self.voices.append(one.data), 10)

    def ask(self, kind, name, **fields):
        client = self.create_client(kind, f"managed/{name}")
        client.wait_for_service()
        future = client.call_async(kind.Request(**fields))
        rclpy.spin_until_future_complete(self, future)
        return future.result()

    def tell(self, what, value):
        self.told.publish(String(data=f"{what}: {value}"))

    def parameters(self):
        names = ["limits.low", "limits.high", "limits.words"]
        for prefixes, depth in (([], 0), (["limits"], 1), ([], 1), (["nothing"], 0)):
            result = self.ask(ListParameters, "list_parameters", prefixes=prefixes, depth=depth).result
            self.tell(
                "listed", sorted(one for one in result.names if not one.startswith(("use_sim", "start_type")))
            )
        low, high, words = self.ask(GetParameters, "get_parameters", names=names).values
        self.tell("got", (low.integer_value, high.double_value, list(words.string_array_value)))
        self.tell("unknown", list(self.ask(GetParameters, "get_parameters", names=["x"]).values))
        types = self.ask(GetParameterTypes, "get_parameter_types", names=names).types
        self.tell("types", [int(one) for one in types])
        found = self.ask(DescribeParameters, "describe_parameters", names=names[:1]).descriptors
        self.tell("described", [(one.name, one.type, one.read_only) for one in found])
        wanted = [
            Parameter("limits.low", value=2),
            Parameter("limits.high", value="no"),
            Parameter("y", value=1),
        ]
        wanted = [one.to_parameter_msg() for one in wanted]
        for result in self.ask(SetParameters, "set_parameters", parameters=wanted).results:
            self.tell("set", (result.successful, "undeclared" in result.reason, "expected" in result.reason))

    def change(self, transition):
        asked = Transition(id=transition) if isinstance(transition, int) else Transition(label=transition)
        changed = self.ask(ChangeState, "change_state", transition=asked).success
        state = self.ask(GetState, "get_state").current_state
        self.tell(transition, (changed, state.id, state.label))

    def lifecycle(self):
        self.change("configure")
        self.ask(
            SetParameters, "set_parameters", parameters=[Parameter("who", value="Ada").to_parameter_msg()]
        )
        self.change(Transition.TRANSITION_CONFIGURE)
        self.change("nonsense")
        offered = self.ask(GetAvailableTransitions, "get_available_transitions").available_transitions
        self.tell(
            "offered",
            sorted((one.transition.id, one.transition.label, one.goal_state.label) for one in offered),
        )
        self.change("activate")
        while "Ada 3" not in self.voices:
            rclpy.spin_once(self, timeout_sec=0.1)
        self.change("deactivate")
        self.tell("heard", self.voices[0].split()[0])
        self.change("cleanup")
        self.change(Transition.TRANSITION_UNCONFIGURED_SHUTDOWN)


def main():
    rclpy.init()
    station = Station()
    while station.told.get_subscription_count() < station.listeners:
        rclpy.spin_once(station, timeout_sec=0.05)
    station.parameters()
    station.lifecycle()
    rclpy.spin(station)


if __name__ == "__main__":
    main()
