"""What the ROS 2 documentation does with parameters: a default, what was given, a description, a refusal."""

import rclpy
import rclpy.node
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.parameter import Parameter
from std_msgs.msg import String


class Minimal(rclpy.node.Node):
    def __init__(self):
        super().__init__("parameters")
        self.declare_parameter("listeners", 1)
        described = ParameterDescriptor(description="to whom it is said")
        self.declare_parameter("my_parameter", "world", described)
        self.declare_parameters("", [("gains.p", 1.5), ("gains.i", 0.1), ("names", ["a", "b"])])
        self.told = self.create_publisher(String, "told", 100)
        self.add_on_set_parameters_callback(self.judge)
        self.rounds = 0
        self.timer = self.create_timer(0.05, self.tell)

    def judge(self, parameters):
        for one in parameters:
            if one.name == "gains.p" and one.value < 0.0:
                return SetParametersResult(successful=False, reason="below zero")
        return SetParametersResult(successful=True)

    def say(self, text):
        self.told.publish(String(data=str(text)))

    def tell(self):
        if self.told.get_subscription_count() < self.get_parameter("listeners").value:
            return
        mine = self.get_parameter("my_parameter").get_parameter_value().string_value
        self.get_logger().info(f"hello {mine}")
        self.say(f"hello {mine}")
        self.set_parameters([Parameter("my_parameter", Parameter.Type.STRING, "world")])
        self.rounds += 1
        if self.rounds == 2:
            self.examine()
            self.timer.cancel()

    def examine(self):
        self.say(self.describe_parameter("my_parameter").description)
        result = self.set_parameters([Parameter("gains.p", value=-1.0), Parameter("gains.i", value=0.5)])
        self.say([(one.successful, one.reason) for one in result])
        result = self.set_parameters_atomically(
            [Parameter("gains.i", value=0.7), Parameter("gains.p", value=-1.0)]
        )
        self.say((result.successful, result.reason))
        self.say({name: one.value for name, one in sorted(self.get_parameters_by_prefix("gains").items())})
        result = self.set_parameters([Parameter("gains.p", value="much")])
        self.say((result[0].successful, result[0].reason))
        try:
            self.get_parameter("nobody")
        except ParameterNotDeclaredException:
            self.say("nobody is not declared")
        self.say(self.get_parameter("names").value)
        self.say(self.has_parameter("gains.d"))


def main():
    rclpy.init()
    node = Minimal()
    rclpy.spin(node)


if __name__ == "__main__":
    main()
