"""Whose ROS names the node of a simulated vehicle has, and where the pilot's transmitter rests."""

from __future__ import annotations

import json
import subprocess
import sys

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

FLIES_OFFBOARD = """
import rclpy
from math import nan
from px4_msgs.msg import (
    OffboardControlMode, TrajectorySetpoint, VehicleCommand, VehicleCommandAck, VehicleLocalPosition,
    VehicleStatus,
)
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
rclpy.init()
node = rclpy.create_node("pilot")
qos = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.BEST_EFFORT, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
modes = node.create_publisher(OffboardControlMode, "/fmu/in/offboard_control_mode", qos)
setpoints = node.create_publisher(TrajectorySetpoint, "/fmu/in/trajectory_setpoint", qos)
commands = node.create_publisher(VehicleCommand, "/fmu/in/vehicle_command", qos)
seen = {"ticks": 0, "acknowledged": [], "states": []}

def on_status(message):
    if message.nav_state not in seen["states"]:
        seen["states"].append(message.nav_state)

node.create_subscription(VehicleStatus, "/fmu/out/vehicle_status_v1", on_status, qos)
node.create_subscription(
    VehicleCommandAck, "/fmu/out/vehicle_command_ack",
    lambda message: seen["acknowledged"].append((message.command, message.result)), qos
)
node.create_subscription(
    VehicleLocalPosition, "/fmu/out/vehicle_local_position_v1",
    lambda message: seen.update(place=(round(message.x), round(message.y), round(message.z))), qos
)

def command(number, first=0.0, second=0.0):
    commands.publish(VehicleCommand(command=number, param1=first, param2=second, target_system=1))

def tick():
    seen["ticks"] += 1
    if seen["ticks"] < 160:  # 16 s, then the stream ends
        modes.publish(OffboardControlMode(position=True))
        setpoints.publish(TrajectorySetpoint(position=[4.0, 0.0, -3.0], yaw=0.0))
    if seen["ticks"] == 5:
        command(176, 1.0, 6.0)
        command(400, 1.0)
    if seen["ticks"] == 150:
        print("at", seen["place"], seen["acknowledged"])
    if seen["ticks"] == 240:
        print("states", seen["states"][-2:])

node.create_timer(0.1, tick)
rclpy.spin(node)
"""

TAKES_OFF_BY_DDS = """
import rclpy, time
from ardupilot_msgs.msg import GlobalPosition
from ardupilot_msgs.srv import ArmMotors, ModeSwitch, Takeoff
from geometry_msgs.msg import PoseStamped
from rclpy.qos import qos_profile_sensor_data
rclpy.init()
node = rclpy.create_node("pilot")

def call(kind, name, **fields):
    client = node.create_client(kind, name)
    client.wait_for_service()
    future = client.call_async(kind.Request(**fields))
    rclpy.spin_until_future_complete(node, future)
    return future.result()

call(ModeSwitch, "/ap/mode_switch", mode=4)
while not call(ArmMotors, "/ap/arm_motors", arm=True).result:
    time.sleep(1.0)
    call(ModeSwitch, "/ap/mode_switch", mode=4)
print("takes off", call(Takeoff, "/ap/experimental/takeoff", alt=5.0).status)
time.sleep(8.0)
goals = node.create_publisher(GlobalPosition, "/ap/cmd_gps_pose", qos_profile_sensor_data)
goal = GlobalPosition(coordinate_frame=6, latitude=47.0, longitude=8.0001, altitude=5.0)
goal.header.frame_id = "map"
goals.publish(goal)
seen = []
node.create_subscription(PoseStamped, "/ap/pose/filtered", seen.append, qos_profile_sensor_data)
for _ in range(200):
    rclpy.spin_once(node)
    time.sleep(0.05)
place = seen[-1].pose.position
print("there", abs(place.x - 7.6) < 1.0, abs(place.y) < 1.0, abs(place.z - 5.0) < 1.0)
"""


@pytest.fixture
def model(tmp_path):
    """Return the folder of a model with one script and one vehicle."""

    def write(names, script=ARMS, language="rospy", autopilot="ardupilot"):
        (tmp_path / "pilot.py").write_text(script)
        places = {"pad": {"east": "0 m", "north": "0 m"}}
        vehicle = {
            "kind": "multirotor",
            "autopilot": autopilot,
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
    with pytest.raises(ModelError, match=r"its node can have ardupilot, ardupilot-4\.5, mavros or roscopter"):
        simulate(model("pprzros"))


def test_sensors_are_best_effort_for_rclpy_as_mavros_2_s_are(model, capsys):
    assert simulate(model("mavros", WATCHES, "rclpy")).completed
    said = capsys.readouterr().err
    assert "[('local_position/pose', False), ('state', False), ('state', True)]" in said


def test_px4_s_own_names_fly_and_offboard_ends_with_its_stream(model, capsys):
    """After COM_OF_LOSS_T the vehicle returns by its failsafe, as it has neither sticks nor a link."""
    made = model("px4", FLIES_OFFBOARD, "rclpy", "px4")
    done = simulate(made, Options(out=None), overrides=["run.duration=25 s"])
    assert done.completed
    assert done.record.unserved == []
    said = capsys.readouterr().err
    assert "at (4, 0, -3)" in said
    assert "(400, 0)" in said
    assert "states [14, " in said


def test_ardupilot_s_own_names_fly(model, capsys):
    made = model("ardupilot", TAKES_OFF_BY_DDS, "rclpy")
    done = simulate(made, Options(out=None), overrides=["run.duration=45 s"])
    assert done.completed
    assert done.record.unserved == []
    said = capsys.readouterr().err
    assert "takes off True" in said
    assert "there True True True" in said  # 0.0001 degrees east of home


def test_px4_s_names_are_refused_for_another_autopilot(model):
    with pytest.raises(ModelError, match="px4's names do not fit ardupilot: its node can have ardupilot,"):
        simulate(model("px4"))


def test_a_setpoint_that_was_published_before_a_request_is_sent_before_it(model, capfd):
    """The other way round the take-off would be given up for a goal of a copter that still stands."""
    simulate(model("mavros", TAKES_OFF), Options(out=None), overrides=["run.duration=25 s"])
    assert "height 3" in capfd.readouterr().err


COMPILES = """
from pathlib import Path
from types import SimpleNamespace
from volery.ros.client_libraries.rclcpp import generate_headers
from volery.run.assembly.cpp import compile_all
system = SimpleNamespace(vehicles=(SimpleNamespace(names="mavros"), SimpleNamespace(names="px4-1.15")))
compile_all(system, (), "code")
name = "px4_msgs/msg/airspeed_validated.hpp"
print(generate_headers([name], Path("."))[name])
"""


def test_components_in_cpp_are_compiled_with_the_messages_of_the_firmware() -> None:
    done = subprocess.run([sys.executable, "-c", COMPILES], capture_output=True, text=True, check=False)
    assert "selected_airspeed_index" in done.stdout, done.stderr
    assert "airspeed_source" not in done.stdout
