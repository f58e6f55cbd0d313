"""The fence on board, rally points, and messages that want an answer."""

from __future__ import annotations

from math import hypot, pi
from typing import Any

import pytest

from rigs.station import TARGET

ACCEPTED, REJECTED, UNSUPPORTED, FAILED = 0, 1, 3, 4
FENCE, RALLY = 1, 2
LATITUDE, LONGITUDE = -35.363261, 149.165230
NAK = 129


def point(command: int, north: float, east: float, first: float = 0.0, **fields: Any) -> dict[str, Any]:
    x = round((LATITUDE + north / 111_320.0) * 1e7)
    y = round((LONGITUDE + east / 90_780.0) * 1e7)
    return {"frame": 3, "command": command, "param1": first, "x": x, "y": y, "z": 20.0, **fields}


SQUARE = [point(5001, n, e, 4) for n, e in ((-50, -50), (-50, 50), (50, 50), (50, -50))]


def upload(rig: Any, kind: int, points: list[dict[str, Any]]) -> int:
    rig.received.clear()
    rig.send("MISSION_COUNT", **TARGET, count=len(points), mission_type=kind)
    for number, fields in enumerate(points):
        rig.run(0.05)
        if rig.of("MISSION_ACK"):
            break
        assert rig.latest["MISSION_REQUEST"]["mission_type"] == kind
        rig.send("MISSION_ITEM_INT", **TARGET, seq=number, mission_type=kind, **fields)
    rig.run(0.05)
    answer = rig.latest["MISSION_ACK"]
    assert answer["mission_type"] == kind
    return int(answer["type"])


@pytest.mark.parametrize(("kind", "points"), [(FENCE, SQUARE), (RALLY, [point(5100, 30, 0)])])
def test_points_are_stored_read_back_and_cleared(kind: int, points: list[Any], bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    assert upload(rig, kind, points) == ACCEPTED
    corners = sum(point["command"] in (5001, 5002) for point in points)
    name, total = ("FENCE_TOTAL", corners + 2) if kind == FENCE else ("RALLY_TOTAL", len(points))
    assert rig.vehicle.parameters[name] == total
    rig.send("MISSION_REQUEST_LIST", **TARGET, mission_type=kind)
    rig.run(0.05)
    assert rig.latest["MISSION_COUNT"]["count"] == len(points)
    last = len(points) - 1
    rig.send("MISSION_REQUEST_INT", **TARGET, seq=last, mission_type=kind)
    rig.run(0.05)
    read = rig.latest["MISSION_ITEM_INT"]
    assert (read["x"], read["y"], read["mission_type"]) == (points[last]["x"], points[last]["y"], kind)
    assert upload(rig, kind, []) == ACCEPTED
    assert rig.vehicle.parameters[name] == 0
    assert upload(rig, kind, points) == ACCEPTED
    rig.send("MISSION_CLEAR_ALL", **TARGET, mission_type=255)
    rig.run(0.05)
    assert not rig.vehicle.points[kind]


def test_a_fence_takes_its_own_items_only(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    assert upload(rig, FENCE, [point(16, 0, 0)]) == UNSUPPORTED
    rig.send("MISSION_REQUEST_LIST", **TARGET, mission_type=255)
    rig.run(0.05)
    assert rig.latest["MISSION_ACK"]["type"] == UNSUPPORTED


BREACHES: list[Any] = [
    ("circle", {"FENCE_RADIUS": 40, "FENCE_TYPE": 2}, [], (3.0, 0.0, 0.0)),
    ("ceiling", {"FENCE_ALT_MAX": 20, "FENCE_TYPE": 1}, [], (0.0, 0.0, -2.0)),
    ("polygon", {"FENCE_TYPE": 4}, SQUARE, (0.0, 4.0, 0.0)),
]


def fly_towards_the_fence(rig: Any, points: list[Any], velocity: tuple[float, float, float]) -> None:
    """Fly with a velocity in GUIDED, for 20 s or until the mode changes."""
    rig.run(0.5)
    if points:
        assert upload(rig, FENCE, points) == ACCEPTED
    assert rig.command(207, 1) == ACCEPTED
    rig.airborne()
    north, east, down = velocity
    given = {"vx": north, "vy": east, "vz": down}
    for _ in range(40):
        rig.send("SET_POSITION_TARGET_LOCAL_NED", **TARGET, coordinate_frame=1, type_mask=3527, **given)
        rig.run(0.5)
        if rig.vehicle.mode.name != "GUIDED":
            break
    rig.run(0.1)


@pytest.mark.parametrize(
    ("parameters", "points", "velocity"), [row[1:] for row in BREACHES], ids=[row[0] for row in BREACHES]
)
def test_beyond_the_fence_it_returns(
    parameters: dict[str, float], points: list[Any], velocity: tuple[float, float, float], bench: Any
) -> None:
    rig = bench(parameters={**parameters, "AVOID_ENABLE": 0})
    fly_towards_the_fence(rig, points, velocity)
    assert rig.vehicle.mode.name == "RTL"
    assert "Fence Breached" in rig.texts()
    assert rig.latest["HEARTBEAT"]["system_status"] in (4, 5)


@pytest.mark.parametrize("behaviour", [0, 1], ids=["slides", "stops"])
@pytest.mark.parametrize(("name", "parameters", "points", "velocity"), BREACHES)
def test_a_velocity_creeps_over_the_fence_in_spite_of_avoidance(
    name: str,
    parameters: dict[str, float],
    points: list[Any],
    velocity: tuple[float, float, float],
    behaviour: int,
    bench: Any,
) -> None:
    """Recorded: 6 m/s outwards cross a circle of 60 m after 14.9 s, the ceiling is crossed, too."""
    rig = bench(parameters={**parameters, "AVOID_BEHAVE": behaviour})
    fly_towards_the_fence(rig, points, velocity)
    assert rig.vehicle.mode.name == "RTL"
    assert "Fence Breached" in rig.texts()
    assert hypot(*rig.vehicle.estimate.velocity) < 1.0


def test_the_recorded_velocity_crosses_the_recorded_circle_in_the_recorded_time(bench: Any) -> None:
    rig = bench(parameters={"FENCE_ENABLE": 1, "FENCE_TYPE": 2, "FENCE_RADIUS": 60})
    rig.airborne()
    begun = rig.now
    while rig.vehicle.mode.name == "GUIDED" and rig.now < begun + 20.0:
        rig.send("SET_POSITION_TARGET_LOCAL_NED", **TARGET, coordinate_frame=1, type_mask=3527, vx=6.0)
        rig.run(0.1)
    assert rig.now - begun == pytest.approx(14.9, rel=0.15)
    assert rig.vehicle.mode.name == "RTL"


def test_a_guided_point_beyond_the_fence_is_ignored(bench: Any) -> None:
    rig = bench(parameters={"FENCE_ENABLE": 1, "FENCE_RADIUS": 60})
    rig.airborne()
    rig.send("SET_POSITION_TARGET_LOCAL_NED", **TARGET, coordinate_frame=1, type_mask=3576, x=80.0, z=-10.0)
    rig.run(5.0)
    assert abs(rig.vehicle.estimate.position[0]) < 1.0
    assert rig.vehicle.mode.name == "GUIDED"


def test_standing_outside_the_fence_forbids_arming(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    assert upload(rig, FENCE, [{**corner, "command": 5002} for corner in SQUARE]) == ACCEPTED
    assert rig.command(207, 1) == ACCEPTED
    assert rig.command(401) == ACCEPTED
    assert rig.texts()[-1] == "PreArm: vehicle outside fence"
    assert rig.command(400, 1) == FAILED


def test_the_checks_are_made_anew_on_request_but_not_armed(bench: Any) -> None:
    rig = bench(warm=False)
    rig.run(15.0)
    assert rig.command(401) == ACCEPTED
    assert rig.texts()[-1].startswith("PreArm: ")
    assert rig.command(400, 1, 21196) == ACCEPTED
    assert rig.command(401) == REJECTED


def test_guided_pauses_and_continues(bench: Any) -> None:
    rig = bench()
    rig.airborne()
    rig.send("SET_POSITION_TARGET_LOCAL_NED", **TARGET, coordinate_frame=1, type_mask=3576, x=60.0, z=-10.0)
    rig.run(4.0)
    assert rig.command(193, 0) == ACCEPTED
    rig.run(6.0)
    stopped = rig.vehicle.estimate.position[0]
    assert stopped < 45.0  # 1 m/s^2 from 8 m/s
    assert rig.command(193, 2) == 2
    assert rig.command(193, 1) == ACCEPTED
    rig.run(15.0)
    assert rig.vehicle.estimate.position[0] == pytest.approx(60.0, abs=1.0)


def test_a_mission_pauses_twice_and_continues_twice(bench: Any) -> None:
    rig = bench(parameters={"AUTO_OPTIONS": 3})
    rig.run(0.5)
    items = [point(16, 0, 0), {**point(22, 0, 0), "z": 10.0}, point(16, 200, 0)]
    assert upload(rig, 0, items) == ACCEPTED
    rig.mode(3)
    assert rig.command(400, 1) == ACCEPTED
    rig.run_until(lambda: rig.vehicle.mission.current == 2)
    rig.run(3.0)
    assert [rig.command(193, 0), rig.command(193, 0)] == [ACCEPTED, ACCEPTED]
    rig.run(6.0)
    stopped = rig.vehicle.estimate.position[0]
    rig.run(4.0)
    assert rig.vehicle.estimate.position[0] == pytest.approx(stopped, abs=0.5)  # and not back
    assert [rig.command(193, 1), rig.command(193, 1)] == [ACCEPTED, ACCEPTED]
    rig.run(5.0)
    assert hypot(*rig.vehicle.estimate.velocity) > 3.0


def test_a_mode_without_pause_says_so(bench: Any) -> None:
    rig = bench()
    rig.airborne()
    rig.mode(5)
    assert rig.command(193, 0) == FAILED
    assert rig.texts()[-1] == "Failed to pause"


def test_a_servo_takes_a_pulse_width_unless_it_is_a_motor(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    assert rig.command(183, 9, 1700) == ACCEPTED
    rig.command(512, 36)
    assert rig.latest["SERVO_OUTPUT_RAW"]["servo9_raw"] == 1700
    assert rig.command(183, 1, 1700) == FAILED


def test_a_part_of_the_mission_is_replaced(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    assert upload(rig, 0, [point(16, 1, 0), point(22, 0, 0), point(16, 20, 0), point(16, 40, 0)]) == ACCEPTED
    rig.send("MISSION_WRITE_PARTIAL_LIST", **TARGET, start_index=2, end_index=2)
    rig.run(0.05)
    assert rig.latest["MISSION_REQUEST"]["seq"] == 2
    rig.send("MISSION_ITEM_INT", **TARGET, seq=2, **point(16, 30, 0))
    rig.run(0.05)
    assert rig.latest["MISSION_ACK"]["type"] == ACCEPTED
    assert [item.x for item in rig.vehicle.mission.items[2:]] == [
        point(16, 30, 0)["x"],
        point(16, 40, 0)["x"],
    ]
    rig.send("MISSION_WRITE_PARTIAL_LIST", **TARGET, start_index=2, end_index=9)
    rig.run(0.05)
    assert rig.latest["MISSION_ACK"]["type"] == 1


def test_a_part_of_an_empty_mission_is_requested(bench: Any) -> None:
    """pymavlink's example of a partial write on a fresh vehicle: the original requests the items."""
    rig = bench()
    rig.run(0.5)
    rig.send("MISSION_CLEAR_ALL", **TARGET)
    rig.run(0.05)
    rig.send("MISSION_WRITE_PARTIAL_LIST", **TARGET, start_index=0, end_index=0)
    rig.run(0.05)
    assert rig.latest["MISSION_REQUEST"]["seq"] == 0
    rig.send("MISSION_ITEM_INT", **TARGET, seq=0, **point(16, 30, 0))
    rig.run(0.05)
    assert rig.latest["MISSION_ACK"]["type"] == ACCEPTED


def test_a_gripper_is_there_where_it_is_enabled(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    assert rig.command(211, 1, 1) == FAILED
    rig = bench(parameters={"GRIP_ENABLE": 1})
    rig.run(0.5)
    assert rig.command(211, 1, 1) == ACCEPTED
    rig.run(3.0)
    assert [text for text in rig.texts() if "Gripper" in text] == [
        "Gripper load grabbing",
        "Gripper load grabbed",
    ]
    assert rig.command(211, 1, 0) == ACCEPTED
    assert rig.command(211, 1, 7) == FAILED


ANSWERED: list[tuple[str, dict[str, Any], str]] = [
    ("AUTOPILOT_VERSION_REQUEST", {}, "AUTOPILOT_VERSION"),
    ("LOG_REQUEST_LIST", {"start": 0, "end": 65535}, "LOG_ENTRY"),
    (
        "FILE_TRANSFER_PROTOCOL",
        {"payload": [1, 0, 0, 4, 5, 0, 0, 0, 0, 0, 0, 0, *b"a.txt"]},
        "FILE_TRANSFER_PROTOCOL",
    ),
    ("FENCE_FETCH_POINT", {"idx": 0}, "STATUSTEXT"),
    ("RALLY_FETCH_POINT", {"idx": 0}, "STATUSTEXT"),
]


@pytest.mark.parametrize(("message", "fields", "answer"), ANSWERED, ids=[row[0] for row in ANSWERED])
def test_messages_that_want_an_answer_get_one(
    message: str, fields: dict[str, Any], answer: str, bench: Any
) -> None:
    rig = bench()
    rig.run(0.5)
    rig.received.clear()
    rig.send(message, **TARGET, **fields)
    rig.run(0.05)
    assert answer in rig.names()
    if answer == "FILE_TRANSFER_PROTOCOL":
        payload = rig.latest[answer]["payload"]
        assert (payload[0], payload[3], payload[5], payload[12]) == (2, NAK, 4, 10)


def test_the_deprecated_form_of_rally_points_is_stored_and_read_back(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    place = {"lat": -353612350, "lng": 1491610520, "alt": 100, "break_alt": 0, "land_dir": 0, "flags": 0}
    rig.send("RALLY_POINT", **TARGET, idx=0, count=2, **place)
    rig.run(0.05)
    assert rig.texts()[-1] == "Bad rally point message ID"
    rig.send("PARAM_SET", **TARGET, param_id="RALLY_TOTAL", param_value=2.0, param_type=2)
    rig.run(0.05)
    rig.send("RALLY_POINT", **TARGET, idx=0, count=1, **place)
    rig.run(0.05)
    assert rig.texts()[-1] == "Bad rally point message count"
    for index in (0, 1):
        rig.send("RALLY_POINT", **TARGET, idx=index, count=2, **{**place, "alt": 100 + index})
        rig.send("RALLY_FETCH_POINT", **TARGET, idx=index)
        rig.run(0.05)
        read = rig.latest["RALLY_POINT"]
        assert (read["idx"], read["count"], read["lat"], read["alt"]) == (index, 2, place["lat"], 100 + index)


ON_THE_GROUND: list[tuple[str, tuple[float, ...], int]] = [
    ("the first relay has a pin", (181, 0, 1), ACCEPTED),
    ("the second has none", (181, 1, 1), FAILED),
    ("a relay again and again", (182, 0, 3, 1), ACCEPTED),
    ("a servo again and again", (184, 9, 1700, 3, 1), ACCEPTED),
    ("a servo that is a motor", (184, 1, 1700, 3, 1), FAILED),
    ("calibration of the compass, which is not simulated", (42424, 0, 1, 1), FAILED),
    ("its end", (42426,), ACCEPTED),
    ("a place to look at", (201, 0, 0, 0, 0, LATITUDE, LONGITUDE, 0), ACCEPTED),
    ("no place on the globe", (201, 0, 0, 0, 0, 91.0, LONGITUDE, 0), FAILED),
    ("a motor test", (209, 1, 0, 5, 1), ACCEPTED),
    ("a motor that is not there: none turns", (209, 9, 0, 5, 1), ACCEPTED),
    ("calibration while a motor is tested, which arms", (42424, 0, 1, 1), FAILED),
]


def test_commands_of_ground_stations_are_answered(bench: Any) -> None:
    rig = bench(features="motor_test")
    rig.run(0.5)
    for what, command, result in ON_THE_GROUND:
        assert rig.command(*command) == result, what
    before = len(rig.texts())
    assert rig.command(42428) == ACCEPTED
    assert rig.texts()[before].startswith("ArduCopter V4.5.6")


def test_nothing_is_tested_or_calibrated_in_the_air(bench: Any) -> None:
    rig = bench(features="motor_test")
    rig.airborne()
    assert rig.command(209, 1, 0, 5, 1) == FAILED
    assert rig.texts()[-1] == "Motor Test: vehicle not landed"
    assert rig.command(42424, 0, 1, 1) == FAILED


def test_the_nose_follows_a_region_of_interest_until_another_target_or_its_end(bench: Any) -> None:
    """As in the original, where each target returns to the usual heading, here that of the flight."""
    rig = bench()
    rig.airborne()
    assert rig.command(195, 0, 0, 0, 0, LATITUDE, LONGITUDE + 0.001, 0) == ACCEPTED
    rig.run(6.0)
    assert rig.vehicle.estimate.attitude[2] == pytest.approx(pi / 2, abs=0.05)
    rig.send("SET_POSITION_TARGET_LOCAL_NED", **TARGET, coordinate_frame=1, type_mask=3576, x=90.8, z=-10.0)
    rig.run(6.0)
    assert rig.vehicle.estimate.attitude[2] == pytest.approx(0.0, abs=0.05)
    assert rig.command(195, 0, 0, 0, 0, LATITUDE, LONGITUDE + 0.001, 0) == ACCEPTED
    rig.run(25.0)
    assert rig.vehicle.estimate.attitude[2] == pytest.approx(3 * pi / 4, abs=0.1)
    assert rig.command(197) == ACCEPTED
    assert rig.vehicle.commanded.look_at is None


def test_without_a_position_it_takes_off_by_thrust(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    assert rig.mode(20) == ACCEPTED
    assert rig.command(400, 1) == ACCEPTED
    rig.run(2.5)
    assert rig.height < 0.2
    for _ in range(30):
        rig.send("SET_ATTITUDE_TARGET", **TARGET, type_mask=4, q=[1, 0, 0, 0], thrust=0.7)
        rig.run(0.2)
    assert rig.height > 2.0


def test_terrain_is_unknown_on_board(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    rig.send("TERRAIN_CHECK", lat=-353632610, lon=1491652300)
    rig.run(0.05)
    assert rig.latest["TERRAIN_REPORT"]["lat"] == -353632610
    assert rig.latest["TERRAIN_REPORT"]["spacing"] == 0


def test_an_interval_of_zero_restores_the_rate_of_the_stream(bench: Any) -> None:
    rig = bench("rover")
    rig.run(0.5)
    rig.stream(10)
    rig.command(511, 30, 1_000_000)
    rig.command(511, 30, 0)
    rig.command(510, 30)
    assert rig.latest["MESSAGE_INTERVAL"]["interval_us"] == 100_000
