"""The topics below fmu/in: the rules of OFFBOARD, commands and their acknowledgements."""

from math import nan
from typing import Any

import pytest

from volery.base.time import MS, S
from volery.bridge import MAVLINK_SCHEMES
from volery.ros.messages import new

MODE = "fmu/in/offboard_control_mode", "px4_msgs/OffboardControlMode"
TRAJECTORY = "fmu/in/trajectory_setpoint", "px4_msgs/TrajectorySetpoint"
COMMAND = "fmu/in/vehicle_command", "px4_msgs/VehicleCommand"
ABSENT = [nan, nan, nan]


@pytest.fixture
def px4(rig_of: Any) -> Any:
    made = rig_of(names=MAVLINK_SCHEMES["px4"])
    made.heartbeat(autopilot=12)
    made.run(50 * MS)
    made.sent.clear()
    return made


def position_setpoint(rig: Any, north: float, east: float, down: float) -> None:
    fields = {"position": [north, east, down], "velocity": ABSENT, "acceleration": ABSENT}
    rig.publish(*TRAJECTORY, **fields, yaw=0.5, yawspeed=nan)


def test_the_stream_keeps_offboard_alive_before_the_first_setpoint(px4: Any) -> None:
    px4.publish(*MODE, position=True)
    px4.run(10 * MS)
    [sent] = px4.asked("SET_POSITION_TARGET_LOCAL_NED")
    assert sent["type_mask"] & 0b111000 == 0
    assert (sent["vx"], sent["vy"], sent["vz"]) == (0.0, 0.0, 0.0)


def test_a_setpoint_alone_is_not_sent(px4: Any) -> None:
    position_setpoint(px4, 1.0, 2.0, -3.0)
    px4.run(10 * MS)
    assert px4.asked("SET_POSITION_TARGET_LOCAL_NED") == []
    px4.publish(*MODE, position=True)
    px4.run(10 * MS)
    [sent] = px4.asked("SET_POSITION_TARGET_LOCAL_NED")
    assert (sent["x"], sent["y"], sent["z"], sent["yaw"]) == (1.0, 2.0, -3.0, 0.5)
    assert sent["type_mask"] == 0b1001_1111_1000  # velocity, acceleration and yaw rate are ignored
    px4.run(S)
    px4.sent.clear()
    position_setpoint(px4, 4.0, 5.0, -6.0)  # the stream has ended
    px4.run(10 * MS)
    assert px4.asked("SET_POSITION_TARGET_LOCAL_NED") == []


def test_the_mode_says_which_setpoints_count(px4: Any) -> None:
    px4.publish(*MODE, attitude=True)
    position_setpoint(px4, 1.0, 2.0, -3.0)
    px4.run(10 * MS)
    px4.sent.clear()
    level = [1.0, 0.0, 0.0, 0.0]
    kind = "px4_msgs/VehicleAttitudeSetpoint"
    px4.publish("fmu/in/vehicle_attitude_setpoint_v1", kind, q_d=level, thrust_body=[0.0, 0.0, -0.6])
    px4.run(10 * MS)
    assert px4.asked("SET_POSITION_TARGET_LOCAL_NED") == []
    [sent] = px4.asked("SET_ATTITUDE_TARGET")
    assert sent["thrust"] == pytest.approx(0.6)
    assert sent["type_mask"] == 0b111
    px4.publish(*MODE, body_rate=True)
    px4.publish(
        "fmu/in/vehicle_rates_setpoint",
        "px4_msgs/VehicleRatesSetpoint",
        roll=0.1,
        thrust_body=[0.0, 0.0, -0.5],
    )
    px4.run(10 * MS)
    last = px4.asked("SET_ATTITUDE_TARGET")[-1]
    assert last["type_mask"] == 0b1000_0000
    assert last["body_roll_rate"] == pytest.approx(0.1)


def test_motors_are_refused_by_name_and_once(px4: Any) -> None:
    for _ in range(3):
        px4.publish("fmu/in/actuator_motors", "px4_msgs/ActuatorMotors")
        px4.publish(*MODE, direct_actuator=True)
    px4.run(10 * MS)
    warnings = [event.text for event in px4.of_texts()]
    assert len(warnings) == 2
    assert px4.sent == []
    assert any("actuator_motors" in text for text in warnings)
    assert any("direct_actuator" in text for text in warnings)


def test_a_command_is_sent_once_and_its_acknowledgement_published(px4: Any) -> None:
    received = px4.listen("fmu/out/vehicle_command_ack", "px4_msgs/VehicleCommandAck")
    px4.publish(*COMMAND, command=400, param1=1.0, target_system=1, target_component=1)
    px4.run(10 * MS)
    [sent] = px4.asked("COMMAND_LONG")
    assert (sent["command"], sent["param1"], sent["target_system"]) == (400, 1.0, 1)
    px4.emit("COMMAND_ACK", command=511, result=0)  # of a request of the node's own
    px4.emit("COMMAND_ACK", command=400, result=1)
    px4.run(10 * MS)
    assert [(one.command, one.result) for one in received] == [(400, 1)]


def test_two_acknowledgements_at_once_are_both_published(px4: Any) -> None:
    received = px4.listen("fmu/out/vehicle_command_ack", "px4_msgs/VehicleCommandAck")
    for command in (176, 400):
        px4.publish(*COMMAND, command=command)
    px4.run(10 * MS)
    for command in (176, 400):
        px4.emit("COMMAND_ACK", command=command, result=0)
    px4.run(10 * MS)
    assert [one.command for one in received] == [176, 400]


def test_a_place_keeps_its_digits(px4: Any) -> None:
    px4.publish(*COMMAND, command=192, param5=47.3977418, param6=8.5455939, param7=500.0)
    px4.publish(*COMMAND, command=22, param5=nan, param6=nan, param7=500.0)
    px4.run(10 * MS)
    [placed], [unplaced] = px4.asked("COMMAND_INT"), px4.asked("COMMAND_LONG")
    assert (placed["x"], placed["y"], placed["z"]) == (473977418, 85455939, 500.0)
    assert unplaced["command"] == 22


def test_a_navigation_state_is_set_as_a_mode(px4: Any) -> None:
    px4.publish(*COMMAND, command=100_001, param1=18.0)
    px4.publish(*COMMAND, command=100_000)
    px4.publish(*COMMAND, command=100_001, param1=99.0)
    px4.run(10 * MS)
    [sent] = px4.asked("COMMAND_LONG")
    assert (sent["command"], sent["param2"], sent["param3"]) == (176, 4.0, 6.0)
    texts = [event.text for event in px4.of_texts()]
    assert "100000 is a command within PX4" in texts[0]
    assert "99 is no navigation state" in texts[1]


def test_a_command_for_another_vehicle_is_ignored_with_a_warning(px4: Any) -> None:
    for _ in range(2):
        px4.publish(*COMMAND, command=400, param1=1.0, target_system=3)
    px4.run(10 * MS)
    assert px4.asked("COMMAND_LONG") == []
    [warning] = px4.of_texts()
    assert "target_system 3" in warning.text


def test_the_service_answers_with_the_acknowledgement(px4: Any) -> None:
    px4.answers["COMMAND_LONG"] = lambda sent: px4.emit("COMMAND_ACK", command=sent["command"], result=2)
    asked = new("px4_msgs/VehicleCommand", command=21)
    answer = px4.call("fmu/vehicle_command", "px4_msgs/VehicleCommand", request=asked)
    assert (answer.reply.command, answer.reply.result) == (21, 2)


def test_the_service_waits_for_the_firmware(rig_of: Any) -> None:
    rig = rig_of(names=MAVLINK_SCHEMES["px4"])
    rig.answers["COMMAND_LONG"] = lambda sent: rig.emit("COMMAND_ACK", command=sent["command"], result=0)
    rig.kernel.call_at(S, lambda: rig.heartbeat(autopilot=12))
    asked = new("px4_msgs/VehicleCommand", command=21)
    answer = rig.call("fmu/vehicle_command", "px4_msgs/VehicleCommand", request=asked)
    assert (answer.reply.command, answer.reply.result) == (21, 0)
    assert rig.kernel.now() >= S


def test_sticks_are_sent_unless_marked_as_not_valid(px4: Any) -> None:
    kind = "px4_msgs/ManualControlSetpoint"
    chosen = px4.listen("fmu/out/manual_control_setpoint", kind)
    sticks = {"roll": 0.5, "pitch": -0.25, "yaw": 1.5, "throttle": 0.0}
    px4.publish("fmu/in/manual_control_input", kind, valid=False, **sticks)
    px4.publish("fmu/in/manual_control_input", kind, valid=True, **sticks)
    px4.run(10 * MS)
    [sent] = px4.asked("MANUAL_CONTROL")
    assert (sent["x"], sent["y"], sent["z"], sent["r"]) == (-250, 500, 500, 1000)
    [shown] = chosen
    assert (shown.valid, shown.roll, shown.pitch) == (True, 0.5, -0.25)


def test_an_external_estimate_keeps_its_frames_and_variances(px4: Any) -> None:
    topic, kind = "fmu/in/vehicle_visual_odometry", "px4_msgs/VehicleOdometry"
    estimate = {
        "position": [1.0, 2.0, -3.0],
        "q": [1.0, 0.0, 0.0, 0.0],
        "velocity": [0.5, 0.0, 0.0],
        "position_variance": [0.25, 0.5, 0.75],
    }
    px4.publish(
        topic, kind, timestamp_sample=5_000_000, pose_frame=1, velocity_frame=3, quality=90, **estimate
    )
    px4.publish(topic, kind, pose_frame=3, velocity_frame=3, **estimate)
    px4.run(10 * MS)
    [sent] = px4.asked("ODOMETRY")
    assert (sent["frame_id"], sent["child_frame_id"], sent["time_usec"]) == (1, 12, 5_000_000)
    assert (sent["x"], sent["y"], sent["z"], sent["vx"]) == (1.0, 2.0, -3.0, 0.5)
    assert [sent["pose_covariance"][place] for place in (0, 6, 11)] == [0.25, 0.5, 0.75]
    [warning] = px4.of_texts()
    assert "pose_frame 3" in warning.text
