from math import nan, pi
from types import SimpleNamespace
from typing import Any

import pytest

from volery.base.time import MS, S
from volery.bridge.plan_services import MissionServices, to_item, to_waypoint
from volery.ros import messages
from volery.trace.events import Text

WAYPOINT = "mavros_msgs/msg/Waypoint"
LOCAL, GLOBAL = "SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT"


def acknowledge(rig: Any, result: int = 0) -> None:
    rig.answers["COMMAND_LONG"] = lambda fields: rig.emit(
        "COMMAND_ACK", command=fields["command"], result=result
    )


def parameters(fields: dict[str, Any]) -> list[float]:
    return [fields[f"param{number}"] for number in range(1, 8)]


@pytest.mark.parametrize(
    ("service", "kind", "request_fields", "command", "expected"),
    [
        ("cmd/arming", "CommandBool", {"value": True}, 400, [1, 0, 0, 0, 0, 0, 0]),
        ("cmd/arming", "CommandBool", {"value": False}, 400, [0, 0, 0, 0, 0, 0, 0]),
        ("cmd/takeoff", "CommandTOL", {"altitude": 10.0, "yaw": 90.0}, 22, [0, 0, 0, 90, 0, 0, 10]),
        ("cmd/land", "CommandTOL", {"latitude": 1.5, "longitude": 2.5}, 21, [0, 0, 0, 0, 1.5, 2.5, 0]),
        ("cmd/set_home", "CommandHome", {"current_gps": True}, 179, [1, 0, 0, 0, 0, 0, 0]),
        ("cmd/command", "CommandLong", {"command": 178, "param2": 5.0}, 178, [0, 5, 0, 0, 0, 0, 0]),
    ],
)
def test_a_command_is_answered_with_its_acknowledgement(
    rig: Any, service: str, kind: str, request_fields: dict[str, Any], command: int, expected: list[float]
) -> None:
    rig.connect()
    acknowledge(rig)
    answer = rig.call(service, f"mavros_msgs/{kind}", **request_fields)
    assert (answer.success, answer.result) == (True, 0)
    [sent] = [fields for fields in rig.asked("COMMAND_LONG") if fields["command"] == command]
    assert parameters(sent) == expected
    assert (sent["target_system"], sent["target_component"]) == (1, 1)


def test_a_refusal_carries_the_result(rig: Any) -> None:
    rig.connect()
    acknowledge(rig, result=4)
    answer = rig.call("cmd/arming", "mavros_msgs/CommandBool", value=True)
    assert (answer.success, answer.result) == (False, 4)


def test_without_an_acknowledgement_it_fails_after_five_seconds(rig: Any) -> None:
    rig.connect()
    start = rig.kernel.now()
    for second in range(1, 9):  # the streams that it asks for are acknowledged, too
        rig.kernel.call_at(start + second * S, lambda: rig.emit("COMMAND_ACK", command=511, result=0))
    answer = rig.call("cmd/arming", "mavros_msgs/CommandBool", value=True)
    assert not answer.success
    assert 5000 * MS <= rig.kernel.now() - start <= 5200 * MS
    assert any("command 400: no acknowledgement within 5 s" in event.text for event in rig.of_texts())


def test_in_progress_is_not_the_end(rig: Any) -> None:
    rig.connect()

    def slowly(fields: dict[str, Any]) -> None:
        if fields["command"] == 400:
            rig.emit("COMMAND_ACK", command=511, result=4)  # of another command
            rig.emit("COMMAND_ACK", command=400, result=5)
            later = rig.kernel.now() + 3000 * MS
            rig.kernel.call_at(later, lambda: rig.emit("COMMAND_ACK", command=400, result=0))

    rig.answers["COMMAND_LONG"] = slowly
    assert rig.call("cmd/arming", "mavros_msgs/CommandBool", value=True).success


@pytest.mark.parametrize(
    ("request_fields", "sent", "base", "custom"),
    [
        ({"custom_mode": "GUIDED"}, True, 1, 4),
        ({"custom_mode": "rtl"}, True, 1, 6),
        ({"custom_mode": "CMODE(21)"}, True, 1, 21),
        ({"custom_mode": "21"}, True, 1, 21),
        ({"base_mode": 80}, True, 80, 0),
    ],
)
def test_set_mode(rig: Any, request_fields: dict[str, Any], sent: bool, base: int, custom: int) -> None:
    rig.connect()
    assert rig.call("set_mode", "mavros_msgs/SetMode", **request_fields).mode_sent == sent
    [fields] = rig.asked("SET_MODE")
    assert (fields["target_system"], fields["base_mode"], fields["custom_mode"]) == (1, base, custom)


def test_an_unknown_mode_is_not_sent(rig: Any) -> None:
    rig.connect()
    assert not rig.call("set_mode", "mavros_msgs/SetMode", custom_mode="GUIDE").mode_sent
    assert rig.asked("SET_MODE") == []
    assert any("did you mean 'GUIDED'" in event.text for event in rig.of_texts())


def test_before_the_first_heartbeat_no_mode_is_known(rig: Any) -> None:
    assert not rig.call("set_mode", "mavros_msgs/SetMode", custom_mode="OFFBOARD").mode_sent
    assert rig.asked("SET_MODE") == []
    assert any("no heartbeat of an autopilot yet" in event.text for event in rig.of_texts())


def test_command_int_and_stream_rate_are_sent_and_not_waited_for(rig: Any) -> None:
    rig.connect()
    fields = {"frame": 6, "command": 192, "x": 470000000, "y": -80000000, "z": 20.0, "param1": -1.0}
    assert rig.call("cmd/command_int", "mavros_msgs/CommandInt", **fields).success
    [sent] = rig.asked("COMMAND_INT")
    assert {name: sent[name] for name in fields} == fields
    rig.sent.clear()
    rig.call("set_stream_rate", "mavros_msgs/StreamRate", stream_id=10, message_rate=25, on_off=True)
    assert {"req_stream_id": 10, "req_message_rate": 25, "start_stop": 1} in [
        {key: one[key] for key in ("req_stream_id", "req_message_rate", "start_stop")}
        for one in rig.asked("REQUEST_DATA_STREAM")
    ]


def test_message_intervals_are_microseconds(rig: Any) -> None:
    rig.connect()
    acknowledge(rig)
    for rate, interval in ((50.0, 20_000.0), (0.0, 0.0), (-1.0, -1.0)):
        rig.sent.clear()
        assert rig.call(
            "set_message_interval", "mavros_msgs/MessageInterval", message_id=30, message_rate=rate
        ).success
        assert [30.0, interval] in [parameters(one)[:2] for one in rig.asked("COMMAND_LONG")]


def only(rig: Any, name: str) -> dict[str, Any]:
    rig.run(100 * MS)
    [fields] = rig.asked(name)
    return fields


def vector(x: float, y: float, z: float) -> dict[str, float]:
    return {"x": x, "y": y, "z": z}


def test_a_global_set_point(rig: Any) -> None:
    rig.connect()
    rig.publish(
        "setpoint_raw/global",
        "mavros_msgs/GlobalPositionTarget",
        coordinate_frame=5,
        type_mask=3576,
        latitude=47.3977418,
        longitude=8.5455939,
        altitude=500.0,
        velocity=vector(1.0, 2.0, 3.0),
        yaw=0.0,
        yaw_rate=0.5,
    )
    sent = only(rig, GLOBAL)
    assert (sent["coordinate_frame"], sent["type_mask"]) == (5, 3576)
    assert (sent["lat_int"], sent["lon_int"], sent["alt"]) == (473977418, 85455939, 500.0)
    assert (sent["vx"], sent["vy"], sent["vz"]) == (2.0, 1.0, -3.0)
    assert sent["yaw"] == pytest.approx(pi / 2)  # east
    assert sent["yaw_rate"] == -0.5


@pytest.mark.parametrize(
    ("frame", "position", "yaw"),
    [
        (1, (2.0, 1.0, -3.0), pi / 2),
        (7, (2.0, 1.0, -3.0), pi / 2),
        (8, (1.0, -2.0, -3.0), 0.0),
        (9, (1.0, -2.0, -3.0), 0.0),
    ],
)
def test_a_local_set_point_is_turned_by_its_frame(
    rig: Any, frame: int, position: tuple[float, float, float], yaw: float
) -> None:
    rig.connect()
    rig.publish(
        "setpoint_raw/local",
        "mavros_msgs/PositionTarget",
        coordinate_frame=frame,
        position=vector(1.0, 2.0, 3.0),
    )
    sent = only(rig, LOCAL)
    assert (sent["x"], sent["y"], sent["z"]) == position
    assert sent["yaw"] == pytest.approx(yaw)
    assert sent["coordinate_frame"] == frame


def test_a_position_above_the_ellipsoid_becomes_amsl(raised_rig: Any) -> None:
    rig = raised_rig
    rig.connect()
    pose = {"position": {"latitude": 47.0, "longitude": 8.0, "altitude": 547.0}}
    rig.publish("setpoint_position/global", "geographic_msgs/GeoPoseStamped", pose=pose)
    sent = only(rig, GLOBAL)
    assert (sent["alt"], sent["coordinate_frame"], sent["type_mask"]) == (500.0, 5, 0x9F8)
    assert sent["yaw"] == pytest.approx(pi / 2)


def test_a_local_position(rig: Any) -> None:
    rig.connect()
    rig.publish(
        "setpoint_position/local", "geometry_msgs/PoseStamped", pose={"position": vector(1.0, 2.0, 3.0)}
    )
    sent = only(rig, LOCAL)
    assert (sent["x"], sent["y"], sent["z"], sent["type_mask"]) == (2.0, 1.0, -3.0, 0x9F8)


def test_a_velocity(rig: Any) -> None:
    rig.connect()
    twist = {"linear": vector(1.0, 2.0, 0.5), "angular": vector(0.0, 0.0, 0.25)}
    rig.publish("setpoint_velocity/cmd_vel", "geometry_msgs/TwistStamped", twist=twist)
    sent = only(rig, LOCAL)
    assert (sent["vx"], sent["vy"], sent["vz"], sent["yaw_rate"]) == (2.0, 1.0, -0.5, -0.25)
    assert (sent["coordinate_frame"], sent["type_mask"]) == (1, 0x5C7)


def test_sticks(rig: Any) -> None:
    rig.connect()
    channels = [1500, 1400, 1600, 0, *[65535] * 14]
    rig.publish("rc/override", "mavros_msgs/OverrideRCIn", channels=channels)
    rig.publish(
        "manual_control/send", "mavros_msgs/ManualControl", x=100.0, y=-200.4, z=500.0, r=0.0, buttons=3
    )
    sent = only(rig, "RC_CHANNELS_OVERRIDE")
    assert [sent[f"chan{number}_raw"] for number in range(1, 19)] == channels
    assert rig.sent[-1].system == 255  # the only one from which ArduPilot takes sticks
    sent = only(rig, "MANUAL_CONTROL")
    assert (sent["x"], sent["y"], sent["z"], sent["buttons"], sent["target"]) == (100, -200, 500, 3, 1)


def test_a_set_point_that_makes_no_sense_is_dropped_with_a_warning(rig: Any) -> None:
    rig.connect()
    rig.publish("setpoint_raw/global", "mavros_msgs/GlobalPositionTarget", latitude=nan)
    rig.publish("manual_control/send", "mavros_msgs/ManualControl", x=1e6)
    rig.run(100 * MS)
    assert rig.asked(GLOBAL, "MANUAL_CONTROL") == []
    warned = [event.text.partition(":")[0] for event in rig.of_texts()]
    assert warned == ["/drone_1/setpoint_raw/global", "/drone_1/manual_control/send"]


def test_parameters_are_read_and_set_by_their_type(rig: Any) -> None:
    rig.connect()
    values = {"RTL_ALT": (1500.0, 6), "GUID_TIMEOUT": (3.0, 9)}

    def publish(name: str) -> None:
        value, kind = values[name]
        rig.emit("PARAM_VALUE", param_id="OTHER", param_value=9.0, param_type=9)
        rig.emit("PARAM_VALUE", param_id=name, param_value=value, param_type=kind)

    def store(fields: dict[str, Any]) -> None:
        values[fields["param_id"]] = (fields["param_value"], fields["param_type"])
        publish(fields["param_id"])

    rig.answers["PARAM_REQUEST_READ"] = lambda fields: (
        publish(fields["param_id"]) if fields["param_id"] in values else None
    )
    rig.answers["PARAM_SET"] = store
    answer = rig.call("param/get", "mavros_msgs/ParamGet", param_id="RTL_ALT")
    assert (answer.success, answer.value.integer, answer.value.real) == (True, 1500, 0.0)
    answer = rig.call("param/get", "mavros_msgs/ParamGet", param_id="GUID_TIMEOUT")
    assert (answer.success, answer.value.integer, answer.value.real) == (True, 0, 3.0)
    answer = rig.call("param/set", "mavros_msgs/ParamSet", param_id="RTL_ALT", value={"integer": 2000})
    assert (answer.success, answer.value.integer) == (True, 2000)
    answer = rig.call("param/set", "mavros_msgs/ParamSet", param_id="GUID_TIMEOUT", value={"real": 0.5})
    assert (answer.success, answer.value.real) == (True, 0.5)
    assert values == {"RTL_ALT": (2000.0, 6), "GUID_TIMEOUT": (0.5, 9)}
    assert not rig.call("param/get", "mavros_msgs/ParamGet", param_id="NO_SUCH").success
    assert not rig.call("param/set", "mavros_msgs/ParamSet", param_id="NO_SUCH").success


def waypoint(**fields: Any) -> Any:
    return messages.new("mavros_msgs/Waypoint", **fields)


def test_a_mission_is_pushed_pulled_and_cleared(rig: Any) -> None:
    rig.connect()
    stored: list[dict[str, Any]] = []
    expected = 0

    def count(fields: dict[str, Any]) -> None:
        nonlocal expected
        expected = fields["count"]
        stored.clear()
        rig.emit("MISSION_REQUEST", seq=0)

    def item(fields: dict[str, Any]) -> None:
        stored.append(fields)
        if len(stored) < expected:
            rig.emit("MISSION_REQUEST_INT", seq=len(stored))
        else:
            rig.emit("MISSION_ACK", type=0)

    rig.answers["MISSION_COUNT"] = count
    rig.answers["MISSION_ITEM_INT"] = item
    rig.answers["MISSION_REQUEST_LIST"] = lambda fields: rig.emit("MISSION_COUNT", count=len(stored))
    rig.answers["MISSION_REQUEST_INT"] = lambda fields: rig.emit("MISSION_ITEM_INT", **stored[fields["seq"]])
    rig.answers["MISSION_CLEAR_ALL"] = lambda fields: rig.emit("MISSION_ACK", type=0)
    route = [
        waypoint(frame=3, command=22, z_alt=10.0, is_current=True),
        waypoint(
            frame=3,
            command=16,
            x_lat=47.3977418,
            y_long=-8.5455939,
            z_alt=20.0,
            param1=2.0,
            autocontinue=True,
        ),
        waypoint(frame=1, command=16, x_lat=12.5, y_long=-2.25, z_alt=-5.0),
    ]
    shown = rig.listen("mission/waypoints", "mavros_msgs/WaypointList")
    pushed = rig.call("mission/push", "mavros_msgs/WaypointPush", waypoints=route)
    assert (pushed.success, pushed.wp_transfered) == (True, 3)
    assert [(one["seq"], one["x"], one["y"], one["z"]) for one in stored] == [
        (0, 0, 0, 10.0),
        (1, 473977418, -85455939, 20.0),
        (2, 125000, -22500, -5.0),
    ]
    pulled = rig.call("mission/pull", "mavros_msgs/WaypointPull")
    assert (pulled.success, pulled.wp_received) == (True, 3)
    assert [message.waypoints for message in shown] == [route, route]
    assert rig.call("mission/clear", "mavros_msgs/WaypointClear").success
    assert shown[-1].waypoints == []


def test_the_mission_is_read_by_itself_for_whoever_listens(rig: Any) -> None:
    rig.answers["MISSION_REQUEST_LIST"] = lambda fields: rig.emit("MISSION_COUNT", count=0)
    rig.heartbeat()
    rig.run(16 * S)
    assert "MISSION_REQUEST_LIST" not in [frame.name for frame in rig.sent]
    shown = rig.listen("mission/waypoints", "mavros_msgs/WaypointList")
    rig.run(S)
    assert [message.waypoints for message in shown] == [[]]
    assert [frame.fields["mission_type"] for frame in rig.sent if frame.name == "MISSION_REQUEST_LIST"] == [0]


@pytest.mark.parametrize("version_1", [False, True])
def test_a_whole_message_of_another_sender_is_passed_on(rig: Any, version_1: bool) -> None:
    rig.connect()
    usual, first = "fd09000005ff00000000000000000608c004032ec1", "fe0905ff0000000000000608c004034a0a"
    data = bytes.fromhex(first if version_1 else usual)
    payload, checksum = data[6 if version_1 else 10 : -2], int.from_bytes(data[-2:], "little")
    words = [int.from_bytes(payload[at : at + 8], "little") for at in (0, 8)]
    fields = {"magic": data[0], "len": 9, "seq": 5, "sysid": 255, "msgid": 0, "payload64": words}
    rig.publish("mavlink/to", "mavros_msgs/Mavlink", **fields, checksum=checksum ^ 1)
    rig.publish("mavlink/to", "mavros_msgs/Mavlink", **fields, checksum=checksum)
    rig.run(100 * MS)
    heartbeats = [frame for frame in rig.sent if frame.name == "HEARTBEAT"]
    assert [(frame.fields["type"], frame.component) for frame in heartbeats] == [(6, 0)]
    assert [text.text for text in rig.of_texts()] == [
        "/drone_1/mavlink/to: message dropped: MAVLink message 0 is unknown or its checksum is wrong"
    ]


def test_a_mission_that_is_refused_or_not_answered(rig: Any) -> None:
    rig.connect()
    rig.answers["MISSION_COUNT"] = lambda fields: rig.emit("MISSION_ACK", type=4)
    refused = rig.call("mission/push", "mavros_msgs/WaypointPush", waypoints=[waypoint()])
    assert (refused.success, refused.wp_transfered) == (False, 0)
    assert not rig.call("mission/push", "mavros_msgs/WaypointPush").success
    del rig.answers["MISSION_COUNT"]
    assert not rig.call("mission/push", "mavros_msgs/WaypointPush", waypoints=[waypoint()]).success
    assert not rig.call("mission/pull", "mavros_msgs/WaypointPull").success
    assert not rig.call("mission/clear", "mavros_msgs/WaypointClear").success
    assert len(rig.asked("MISSION_REQUEST_LIST")) == 3


def test_a_part_of_a_mission_is_pushed(rig: Any) -> None:
    rig.connect()
    stored = [to_item(waypoint(command=16, z_alt=float(one)), one) for one in range(4)]
    last = 0

    def begin(fields: Any) -> None:
        nonlocal last
        last = fields["end_index"]
        rig.emit("MISSION_REQUEST", seq=fields["start_index"])

    def item(fields: Any) -> None:
        stored[fields["seq"]] = fields
        if fields["seq"] == last:
            rig.emit("MISSION_ACK", type=0)
        else:
            rig.emit("MISSION_REQUEST_INT", seq=fields["seq"] + 1)

    rig.answers["MISSION_WRITE_PARTIAL_LIST"], rig.answers["MISSION_ITEM_INT"] = begin, item
    rig.answers["MISSION_REQUEST_LIST"] = lambda fields: rig.emit("MISSION_COUNT", count=len(stored))
    rig.answers["MISSION_REQUEST_INT"] = lambda fields: rig.emit("MISSION_ITEM_INT", **stored[fields["seq"]])
    shown = rig.listen("mission/waypoints", "mavros_msgs/WaypointList")
    part = [waypoint(command=16, z_alt=20.0), waypoint(command=16, z_alt=30.0)]
    pushed = rig.call("mission/push", "mavros_msgs/WaypointPush", start_index=1, waypoints=part)
    assert (pushed.success, pushed.wp_transfered) == (True, 2)
    assert [one["z"] for one in stored] == [0.0, 20.0, 30.0, 3.0]
    assert [one.z_alt for one in shown[-1].waypoints] == [0.0, 20.0, 30.0, 3.0]
    beyond = rig.call("mission/push", "mavros_msgs/WaypointPush", start_index=3, waypoints=part)
    assert (beyond.success, beyond.wp_transfered) == (False, 0)
    assert "items 3 to 4 do not exist: 4 are on board" in rig.of_texts()[-1].text


def test_a_part_of_a_mission_is_for_ardupilot_only(rig: Any) -> None:
    rig.heartbeat(autopilot=12)
    rig.run(200 * MS)
    pushed = rig.call("mission/push", "mavros_msgs/WaypointPush", start_index=1, waypoints=[waypoint()])
    assert not pushed.success
    assert "only ArduPilot stores a part of a list" in rig.of_texts()[-1].text


def test_the_current_waypoint(rig: Any) -> None:
    rig.connect()

    def set_current(fields: Any) -> None:
        rig.emit("MISSION_CURRENT", seq=0)  # on its way when it was asked
        rig.emit("MISSION_CURRENT", seq=min(fields["seq"], 3))

    rig.answers["MISSION_SET_CURRENT"] = set_current
    assert rig.call("mission/set_current", "mavros_msgs/WaypointSetCurrent", wp_seq=2).success
    assert not rig.call("mission/set_current", "mavros_msgs/WaypointSetCurrent", wp_seq=7).success


def test_the_current_waypoint_is_marked_whatever_was_pushed() -> None:
    published: list[Any] = []
    context: Any = SimpleNamespace(
        link=None, publish=lambda topic, message: published.append(message), warn=None, wanted=None
    )
    services = MissionServices(context)
    services.publish_list([messages.new(WAYPOINT, is_current=one == 1) for one in range(3)])
    services.translators()["MISSION_CURRENT"]({"seq": 2}, 0)
    flags = [[one.is_current for one in message.waypoints] for message in published]
    assert flags[-1] == [False, False, True]
    assert published[-1].current_seq == 2


def test_parameters_of_a_waypoint_without_a_place_go_out_as_they_are() -> None:
    shot = to_item(messages.new(WAYPOINT, command=203, frame=2, x_lat=1.0, y_long=7.0), 0)
    assert (shot["x"], shot["y"]) == (1, 7)
    assert to_waypoint(shot).x_lat == 1.0
    there = to_item(messages.new(WAYPOINT, command=16, frame=3, x_lat=46.0, y_long=-103.0), 0)
    assert (there["x"], there["y"]) == (460_000_000, -1_030_000_000)


def test_warnings_are_of_the_nodes_component(rig: Any) -> None:
    rig.connect()
    rig.call("set_mode", "mavros_msgs/SetMode", custom_mode="NONSENSE")
    assert {event.source for event in rig.events if isinstance(event, Text)} == {"mavros"}
