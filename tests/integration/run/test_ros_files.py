"""Files written for ROS, unmodified, as components of a model in virtual time."""

from __future__ import annotations

from pathlib import Path

import pytest

from volery.base.errors import ModelError
from volery.base.time import S
from volery.run.result import Options
from volery.run.simulate import simulate
from volery.trace.events import Failure, Published, Text
from volery.trace.reader import read

pytestmark = pytest.mark.integration

MODEL = """
volery: 1
name: wheels
components:
  Encoder: {language: rclpy, path: encoder.py, active: true}
  Odometer: {language: rospy, path: odometer.py, active: true}
application:
  encoder: {is: Encoder}
  odometer: {is: Odometer}
platform:
  processors:
    pc: {is: intel-i5-3470, frequency: 3000 MHz}
allocations:
  only: {encoder: pc, odometer: pc}
run: {duration: 10 s}
"""

ENCODER = """
import time
import rclpy
from rclpy.node import Node
from robot_msgs.msg import Wheels
from robot_msgs.srv import Reset


class Encoder(Node):
    def __init__(self):
        super().__init__("encoder")
        self.turns = 0.0
        self.publisher = self.create_publisher(Wheels, "wheels", 10)
        self.create_service(Reset, "reset", self.reset)
        self.create_timer(0.5, self.tick)

    def tick(self):
        self.turns += 0.25
        message = Wheels(left=self.turns, right=-self.turns)
        message.header.stamp = self.get_clock().now().to_msg()
        self.publisher.publish(message)

    def reset(self, request, response):
        response.turns, self.turns = self.turns, request.turns
        return response


def main():
    time.sleep(1.0)
    rclpy.init()
    node = Encoder()
    try:
        rclpy.spin(node)
    finally:
        node.destroy_node()


if __name__ == "__main__":
    main()
"""

ODOMETER = """
import rospy
from robot_msgs.msg import Wheels
from robot_msgs.srv import Reset

heard = []


def hear(message):
    heard.append(message.left - message.right)
    if len(heard) == 4:
        was = rospy.ServiceProxy("reset", Reset)(turns=0.0).turns
        rospy.loginfo("heard %s until %.1f s, reset at %.2f", heard, rospy.get_time(), was)


rospy.init_node("odometer")
rospy.Subscriber("wheels", Wheels, hear)
rospy.spin()
"""


@pytest.fixture
def workspace(tmp_path: Path) -> Path:
    package = tmp_path / "robot_msgs"
    (package / "msg").mkdir(parents=True)
    (package / "srv").mkdir()
    (package / "package.xml").write_text("<package><name>robot_msgs</name></package>")
    (package / "msg/Wheels.msg").write_text("std_msgs/Header header\nfloat64 left\nfloat64 right\n")
    (package / "srv/Reset.srv").write_text("float64 turns\n---\nfloat64 turns\n")
    (tmp_path / "model.yaml").write_text(MODEL)
    (tmp_path / "encoder.py").write_text(ENCODER)
    (tmp_path / "odometer.py").write_text(ODOMETER)
    return tmp_path


def test_rclpy_and_rospy_talk_in_types_of_their_own(workspace: Path) -> None:
    run = simulate(workspace / "model.yaml", Options("code", out=workspace / "out"))
    assert run.completed, run.error
    texts = [event.text for event in read(workspace / "out/trace.mcap").events if isinstance(event, Text)]
    assert texts == ["heard [0.5, 1.0, 1.5, 2.0] until 3.0 s, reset at 1.00"]


def test_an_interface_that_is_no_definition(workspace: Path) -> None:
    (workspace / "robot_msgs/srv/Reset.srv").write_text("float64 turns\n")
    with pytest.raises(ModelError, match=r"encoder.py:1: robot_msgs/srv/Reset: .* one line '---'"):
        simulate(workspace / "model.yaml", Options("code", out=workspace / "out"))


STOPPING = """
import rospy
from geometry_msgs.msg import Twist

rospy.init_node("odometer")
commands = rospy.Publisher("cmd_vel", Twist, queue_size=1)


def stop():
    commands.publish(Twist())
    rospy.loginfo("stopped, over: %s", rospy.is_shutdown())


rospy.on_shutdown(stop)
rospy.on_shutdown(lambda: rospy.loginfo("good-bye"))
rate = rospy.Rate(1)
while not rospy.is_shutdown():
    commands.publish(Twist())
    rate.sleep()
"""
LEAVING = """
import rclpy

rclpy.init()
node = rclpy.create_node("encoder")
rclpy.get_default_context().on_shutdown(lambda: node.get_logger().info("rclpy, too"))
rclpy.spin(node)
"""


def test_shutdown_hooks_are_called_when_the_run_ends(workspace: Path) -> None:
    (workspace / "odometer.py").write_text(STOPPING)
    (workspace / "encoder.py").write_text(LEAVING)
    run = simulate(workspace / "model.yaml", Options("code", out=workspace / "out"))
    assert run.completed, run.error
    events = read(workspace / "out/trace.mcap").events
    assert [event.text for event in events if isinstance(event, Text)] == [
        "rclpy, too",
        "stopped, over: True",
        "good-bye",
    ]
    assert [event.at // S for event in events if isinstance(event, Published)] == [*range(10), 10]


@pytest.mark.parametrize(
    ("hook", "said"),
    [
        ("time.sleep(60)", "was not through 5 s after the end of the run"),
        ("{}['x']", "shutdown hook raised KeyError: 'x' (line 3)"),
    ],
)
def test_a_hook_that_hangs_or_fails_is_named(workspace: Path, hook: str, said: str) -> None:
    text = f"import rospy, time\nrospy.init_node('o')\nrospy.on_shutdown(lambda: {hook})\nrospy.spin()\n"
    (workspace / "odometer.py").write_text(text)
    (workspace / "encoder.py").write_text(LEAVING)
    run = simulate(workspace / "model.yaml", Options("code", out=workspace / "out"))
    assert run.record.sim_s < 16.0
    events = read(workspace / "out/trace.mcap").events
    assert [(event.who, event.what) for event in events if isinstance(event, Failure)] == [("odometer", said)]
