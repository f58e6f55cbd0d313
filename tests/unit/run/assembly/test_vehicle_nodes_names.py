"""Whose ROS names the node of a simulated vehicle has, and where the pilot's transmitter rests."""

from __future__ import annotations

import json

import pytest

from volery.base.errors import ModelError
from volery.run.result import Options
from volery.run.simulate import simulate

ARMS = """
import rospy
from roscopter.msg import RC
from std_srvs.srv import Empty
rospy.init_node("pilot")
print("switch at %d" % rospy.wait_for_message("rc", RC).channel[5])
sticks = rospy.Publisher("send_rc", RC, queue_size=1)
rospy.ServiceProxy("arm", Empty)()
for _ in range(30):
    sticks.publish([1500, 1500, 1700, 1500, 0, 0, 0, 0])
    rospy.sleep(0.1)
"""

WATCHES = """
import rclpy
from collections import Counter
from rclpy.qos import qos_profile_sensor_data
from geometry_msgs.msg import PoseStamped
from mavros_msgs.msg import State
rclpy.init()
node = rclpy.create_node("pilot")
received = Counter()
for name, kind in (("local_position/pose", PoseStamped), ("state", State)):
    for qos in (10, qos_profile_sensor_data):
        node.create_subscription(kind, name, lambda _, key=(name, qos == 10): received.update([key]), qos)
node.create_timer(4.0, lambda: print(sorted(received)))
rclpy.spin(node)
"""

TAKES_OFF = """
import rospy
from geometry_msgs.msg import PoseStamped
from mavros_msgs.srv import CommandBool, CommandTOL, SetMode
rospy.init_node("pilot")
goals = rospy.Publisher("setpoint_position/local", PoseStamped, queue_size=10)
goal = PoseStamped()
goal.pose.position.z = 3.0
goal.pose.orientation.w = 1
rospy.sleep(8)
rospy.ServiceProxy("set_mode", SetMode)(custom_mode="GUIDED")
arm, takeoff = rospy.ServiceProxy("cmd/arming", CommandBool), rospy.ServiceProxy("cmd/takeoff", CommandTOL)
arm(True)
goals.publish(goal)
takeoff(altitude=3.0)
rospy.sleep(12)
print("height %.0f" % rospy.wait_for_message("local_position/pose", PoseStamped).pose.position.z)
"""


@pytest.fixture
def model(tmp_path):
    """Return the folder of a model with one script and one vehicle."""

    def write(names, script=ARMS, language="rospy"):
        (tmp_path / "pilot.py").write_text(script)
        places = {"pad": {"east": "0 m", "north": "0 m"}}
        vehicle = {
            "kind": "multirotor",
            "autopilot": "ardupilot",
            "at": "pad",
            "names": names,
            "transmitter": {6: 1500},
        }
        text = {
            "volery": 1,
            "name": "names",
            "components": {"Pilot": {"language": language, "path": "pilot.py", "active": True}},
            "application": {"pilot": {"is": "Pilot", "namespace": "/quad"}},
            "platform": {"processors": {"pc": {"is": "intel-i5-3470", "frequency": "3000 MHz"}}},
            "allocations": {"only": {"pilot": "pc", "quad": "pc"}},
            "environment": {
                "origin": {"latitude": 47.0, "longitude": 8.0, "amsl": "400 m"},
                "places": places,
                "vehicles": {"quad": vehicle},
            },
            "run": {"duration": "5 s"},
        }
        (tmp_path / "model.yaml").write_text(json.dumps(text))
        return tmp_path

    return write


def test_a_vehicle_has_roscopter_s_names_with_send_rc_and_a_switch(model, tmp_path, capsys):
    done = simulate(model("roscopter"), Options(out=tmp_path / "run"))
    assert done.completed
    assert done.record.unserved == []
    assert done.arrays("quad")["z"].max() > 1.0
    assert "switch at 1500" in capsys.readouterr().err


def test_names_of_another_protocol_are_refused(model):
    with pytest.raises(ModelError, match="its node can have mavros or roscopter"):
        simulate(model("pprzros"))


def test_sensors_are_best_effort_for_rclpy_as_mavros_2_s_are(model, capsys):
    assert simulate(model("mavros", WATCHES, "rclpy")).completed
    said = capsys.readouterr().err
    assert "[('local_position/pose', False), ('state', False), ('state', True)]" in said


def test_a_setpoint_that_was_published_before_a_request_is_sent_before_it(model, capfd):
    """The other way round the take-off would be given up for a goal of a copter that still stands."""
    simulate(model("mavros", TAKES_OFF), Options(out=None), overrides=["run.duration=25 s"])
    assert "height 3" in capfd.readouterr().err
