"""A node with a lifecycle that talks while it is active, and refuses to be configured without a name."""

import rclpy
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from std_msgs.msg import String


class Managed(LifecycleNode):
    def __init__(self):
        super().__init__("managed")
        self.declare_parameter("who", "")
        self.declare_parameters("limits", [("low", 1), ("high", 9.5), ("words", ["a", "b"])])
        self.voice = None
        self.timer = None
        self.count = 0

    def on_configure(self, state):
        if not self.get_parameter("who").value:
            return TransitionCallbackReturn.FAILURE
        self.voice = self.create_lifecycle_publisher(String, "voice", 10)
        self.timer = self.create_timer(0.02, self.talk)
        return super().on_configure(state)

    def on_cleanup(self, state):
        self.destroy_timer(self.timer)
        self.destroy_publisher(self.voice)
        raise RuntimeError("cannot be cleaned up")

    def talk(self):
        if self.voice.is_activated:
            self.count += 1
        self.voice.publish(String(data=f"{self.get_parameter('who').value} {self.count}"))


def main():
    rclpy.init()
    rclpy.spin(Managed())


if __name__ == "__main__":
    main()
