"""Missions: the talk of an upload and a download as recorded, and how they are flown."""

from __future__ import annotations

from math import nan
from typing import Any

import pytest

from rigs.station import TARGET

ACCEPTED, ERROR, UNSUPPORTED_FRAME, UNSUPPORTED, INVALID_PARAM3, INVALID_SEQUENCE = 0, 1, 2, 3, 8, 13
WAYPOINT, LOITER_TIME, LAND, TAKEOFF, DELAY, JUMP, SPEED = 16, 19, 21, 22, 93, 177, 178
HERE = {"latitude": -35.363261, "longitude": 149.165230}


def item(
    command: int, north: float = 0.0, east: float = 0.0, height: float = 10.0, **fields: Any
) -> dict[str, Any]:
    """An item at metres north and east of home; without either it has no place."""
    placed = bool(north or east)
    return {
        "frame": 6,
        "command": command,
        "autocontinue": 1,
        "x": round((HERE["latitude"] + north / 111_320.0) * 1e7) if placed else 0,
        "y": round((HERE["longitude"] + east / 90_780.0) * 1e7) if placed else 0,
        "z": height,
        **fields,
    }


HOME = item(WAYPOINT, 0.001, 0.0, 584.0)


def upload(rig: Any, items: list[dict[str, Any]]) -> int:
    """Answer each request with its item; the type of the final acknowledgement."""
    rig.received.clear()
    rig.send("MISSION_COUNT", target_system=1, target_component=1, count=len(items))
    answered = -1
    for _ in range(200):
        rig.run(0.01)
        if rig.of("MISSION_ACK"):
            return int(rig.of("MISSION_ACK")[-1].fields["type"])
        wanted = [one.fields["seq"] for one in rig.of("MISSION_REQUEST")]
        if wanted and wanted[-1] > answered:
            answered = wanted[-1]
            rig.send("MISSION_ITEM_INT", target_system=1, target_component=1, seq=answered, **items[answered])
    raise AssertionError("the upload does not end")


def as_given(recorded: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Recorded items without what ``upload`` adds."""
    added = {"seq", "target_system", "target_component"}
    return [{name: value for name, value in one.items() if name not in added} for one in recorded]


def start(rig: Any) -> None:
    rig.beat()
    assert rig.mode(4) == 0
    assert rig.command(400, 1) == 0
    assert rig.mode(3) == 0
    assert rig.command(300) == 0


def test_the_recorded_mission_is_asked_for_and_read_back_alike(bench: Any, facts: Any) -> None:
    rig, recorded = bench(), facts["mission"]
    rig.run(0.5)
    assert upload(rig, as_given(recorded["uploaded"])) == ACCEPTED
    rig.run(0.1)
    assert "Flight plan received" in rig.texts()
    assert [one.fields["param_value"] for one in rig.of("PARAM_VALUE")] == [1, 2, 3, 4, 5, 6]
    rig.received.clear()
    rig.send("MISSION_REQUEST_LIST", target_system=1, target_component=1)
    rig.run(0.05)
    assert rig.latest["MISSION_COUNT"]["count"] == 6
    for sequence, expected in enumerate(recorded["downloaded"]):
        rig.send("MISSION_REQUEST_INT", target_system=1, target_component=1, seq=sequence)
        rig.run(0.05)
        got = rig.latest["MISSION_ITEM_INT"]
        kept = set(expected) - ({"x", "y", "z"} if sequence == 0 else set())
        assert {name: got[name] for name in kept} == {name: expected[name] for name in kept}
    home = rig.vehicle.home
    rig.send("MISSION_REQUEST_INT", target_system=1, target_component=1, seq=0)
    rig.run(0.05)
    assert rig.latest["MISSION_ITEM_INT"]["z"] == pytest.approx(home.amsl, abs=0.01)


def test_items_are_asked_for_in_the_old_form(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    upload(rig, [HOME, item(TAKEOFF), item(WAYPOINT, 20.0)])
    assert {one.name for one in rig.received if "REQUEST" in one.name} == {"MISSION_REQUEST"}


def test_the_old_form_of_items_is_understood_and_answered_in_degrees(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    rig.send("MISSION_COUNT", target_system=1, target_component=1, count=2)
    rig.run(0.05)
    for sequence in range(2):
        rig.send(
            "MISSION_ITEM",
            target_system=1,
            target_component=1,
            seq=sequence,
            frame=3,
            command=16,
            x=-35.36,
            y=149.16,
            z=9.0,
        )
        rig.run(0.05)
    assert rig.latest["MISSION_ACK"]["type"] == ACCEPTED
    rig.send("MISSION_REQUEST", target_system=1, target_component=1, seq=1)
    rig.run(0.05)
    assert rig.latest["MISSION_ITEM"]["x"] == pytest.approx(-35.36, abs=1e-5)


BAD = [
    ("a radius that is no number", item(18, 5.0, param3=float("nan")), 8),
    ("a hold without end", item(WAYPOINT, 5.0, param1=float("inf")), 6),
    ("an altitude beyond the air", item(WAYPOINT, 5.0, height=90_000.0), 12),
    ("a command that is none", item(9999, 5.0), UNSUPPORTED),
    ("a frame that is none", item(WAYPOINT, 5.0, frame=77), UNSUPPORTED_FRAME),
    ("a latitude off the globe", item(WAYPOINT, x=910_000_000), 10),
    ("a longitude off the globe", item(WAYPOINT, y=1_810_000_000), 11),
]


@pytest.mark.parametrize(("bad", "result"), [row[1:] for row in BAD], ids=[row[0] for row in BAD])
def test_bad_items_end_the_upload(bad: dict[str, Any], result: int, bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    assert upload(rig, [HOME, bad, item(WAYPOINT, 5.0)]) == result


def test_protocol_errors_are_answered(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    rig.send("MISSION_ITEM_INT", target_system=1, target_component=1, seq=0, **HOME)
    rig.run(0.05)
    assert rig.latest["MISSION_ACK"]["type"] == ERROR
    rig.send("MISSION_COUNT", target_system=1, target_component=1, count=3)
    rig.run(0.05)
    rig.send("MISSION_ITEM_INT", target_system=1, target_component=1, seq=2, **HOME)
    rig.run(0.05)
    assert rig.latest["MISSION_ACK"]["type"] == INVALID_SEQUENCE
    rig.send("MISSION_REQUEST_INT", target_system=1, target_component=1, seq=9)
    rig.run(0.05)
    assert rig.latest["MISSION_ACK"]["type"] == INVALID_SEQUENCE


def test_an_upload_that_stops_is_asked_for_again_and_given_up(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    rig.send("MISSION_COUNT", target_system=1, target_component=1, count=3)
    rig.run(12.0)
    assert len(rig.of("MISSION_REQUEST")) == pytest.approx(8, abs=1)
    assert "Mission upload timeout" in rig.texts()


def test_clearing_and_other_kinds_of_plan(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    upload(rig, [HOME, item(TAKEOFF)])
    rig.received.clear()
    rig.send("MISSION_CLEAR_ALL", target_system=1, target_component=1)
    rig.run(0.05)
    assert rig.names() == ["MISSION_ACK", "PARAM_VALUE"]
    rig.send("MISSION_REQUEST_LIST", target_system=1, target_component=1, mission_type=1)
    rig.run(0.05)
    assert rig.latest["MISSION_COUNT"] == {
        "target_system": 255,
        "target_component": 190,
        "count": 0,
        "mission_type": 1,
        "opaque_id": 0,  # newer than pymavlink's definition, and not sent by ArduPilot
    }


def test_the_recorded_mission_is_flown_as_recorded(bench: Any, facts: Any) -> None:
    rig, recorded = bench(), facts["mission"]
    rig.run(0.5)
    upload(rig, as_given(recorded["uploaded"]))
    rig.send(
        "PARAM_SET",
        target_system=1,
        target_component=1,
        param_id="WPNAV_SPEED",
        param_value=600.0,
        param_type=9,
    )
    rig.stream(10)
    rig.received.clear()
    start(rig)
    begun = rig.now
    took = rig.run_until(lambda: not rig.vehicle.armed, within=200.0)
    assert took == pytest.approx(recorded["seconds"], rel=0.2)
    rig.run(0.5)
    events = [one for one in rig.received if one.name in ("STATUSTEXT", "MISSION_ITEM_REACHED")]
    events = [(one.at - begun, one.name, one.fields.get("text", one.fields.get("seq"))) for one in events]
    events = [one for one in events if one[1] != "STATUSTEXT" or "ission" in one[2]]
    assert [one[1:] for one in events] == [tuple(one[1:]) for one in recorded["events"]]
    for (is_now, *_), (was, *_) in zip(events, recorded["events"], strict=True):
        assert abs(is_now - was) <= 1.0 + 0.2 * was
    states: list[list[int]] = []
    for one in rig.of("MISSION_CURRENT"):
        state = [one.fields[name] for name in ("seq", "total", "mission_state", "mission_mode")]
        if state not in states[-1:]:
            states.append(state)
    flown = [state for state in recorded["states"] if state[2] in (3, 5)]
    assert [state for state in states if state[2] in (3, 5)] == flown


def test_actions_conditions_and_jumps(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    items = [
        HOME,
        item(TAKEOFF, height=8.0),
        item(SPEED, param1=1.0, param2=3.0),
        item(WAYPOINT, 25.0, height=8.0),
        item(WAYPOINT, 25.0, 20.0, height=8.0),
        item(JUMP, param1=3.0, param2=1.0),
        item(DELAY, param1=3.0),
        item(LAND),
    ]
    assert upload(rig, items) == ACCEPTED
    start(rig)
    rig.run_until(lambda: not rig.vehicle.armed, within=200.0)
    rig.run(0.5)
    reached = [one.fields["seq"] for one in rig.of("MISSION_ITEM_REACHED")]
    assert reached == [2, 3, 4, 3, 4, 6, 7]  # the speed of item 2 in the place of the take-off
    assert "Mission: 2 ChangeSpeed" in rig.texts()
    assert "Mission: 5 Jump 1/1" in rig.texts()


@pytest.mark.parametrize(
    ("condition", "earliest"),
    [(item(112, param1=4.0), 4.0), (item(114, param1=10.0), 4.5)],
    ids=["a time", "a distance"],
)
def test_a_condition_holds_the_action_after_it_not_the_leg(
    condition: dict[str, Any], earliest: float, bench: Any
) -> None:
    rig = bench()
    rig.run(0.5)
    action = item(115, param1=90.0)
    upload(
        rig,
        [HOME, item(TAKEOFF, height=5.0), condition, action, item(WAYPOINT, 40.0, height=5.0), item(LAND)],
    )
    start(rig)
    rig.run_until(lambda: rig.vehicle.mission.current == 4)
    assert rig.vehicle.commanded.yaw is None
    begun = rig.now
    rig.run_until(lambda: rig.vehicle.commanded.yaw is not None)
    assert rig.vehicle.mission.current == 4
    assert earliest <= rig.now - begun < 12.0
    rig.run_until(lambda: not rig.vehicle.armed)


def test_a_mission_that_is_flown_is_not_cleared_but_may_be_replaced(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    upload(rig, [HOME, item(TAKEOFF, height=5.0), item(WAYPOINT, 30.0, height=5.0), item(LAND)])
    start(rig)
    rig.run_until(lambda: rig.vehicle.mission.current == 2)
    rig.send("MISSION_CLEAR_ALL", target_system=1, target_component=1)
    rig.run(0.1)
    assert rig.latest["MISSION_ACK"]["type"] == ERROR
    assert len(rig.vehicle.mission) == 4
    upload(
        rig, [HOME, item(TAKEOFF), item(WAYPOINT, 5.0), item(WAYPOINT, 30.0, 20.0, height=5.0), item(LAND)]
    )
    rig.run_until(lambda: not rig.vehicle.armed)
    assert rig.vehicle.estimate.position[0] == pytest.approx(30.0, abs=2.0)
    assert rig.vehicle.estimate.position[1] == pytest.approx(20.0, abs=2.0)


def test_after_the_last_waypoint_it_stays(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    upload(rig, [HOME, item(TAKEOFF, height=5.0), item(WAYPOINT, 10.0, height=5.0)])
    start(rig)
    rig.run(40.0)
    assert rig.vehicle.armed
    assert rig.vehicle.mission.complete
    assert rig.height == pytest.approx(5.0, abs=0.5)
    assert rig.vehicle.estimate.position[0] == pytest.approx(10.0, abs=1.5)
    assert rig.vehicle.mission.current == 2


def test_another_item_can_be_chosen_in_flight(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    upload(
        rig,
        [
            HOME,
            item(TAKEOFF, height=5.0),
            item(WAYPOINT, 60.0, height=5.0),
            item(WAYPOINT, 0.5, 15.0, height=5.0),
        ],
    )
    start(rig)
    rig.run_until(lambda: rig.vehicle.mission.current == 2)
    rig.send("MISSION_SET_CURRENT", target_system=1, target_component=1, seq=3)
    rig.run(0.2)
    assert rig.latest["MISSION_CURRENT"]["seq"] == 3
    rig.run(15.0)
    assert rig.vehicle.estimate.position[1] == pytest.approx(15.0, abs=1.5)
    assert rig.command(224, 9) == 2


def test_on_the_ground_auto_wants_a_take_off_first(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    upload(rig, [HOME, item(WAYPOINT, 10.0)])
    rig.mode(4)
    rig.command(400, 1)
    assert rig.mode(3) == 4
    assert "Auto: Missing Takeoff Cmd" in rig.texts()


@pytest.mark.parametrize("first", [item(TAKEOFF, height=5.0), item(DELAY, param1=1.0)])
def test_without_a_mission_start_it_waits_on_the_ground(first: dict[str, Any], bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    upload(rig, [HOME, item(SPEED, param2=3.0), first, item(TAKEOFF, height=5.0), item(WAYPOINT, 10.0)])
    rig.mode(4)
    rig.command(400, 1)
    assert rig.mode(3) == 0
    rig.run(4.0)
    assert rig.height < 0.3
    assert rig.vehicle.armed


def test_auto_options_let_it_take_off_at_once(bench: Any) -> None:
    rig = bench(parameters={"AUTO_OPTIONS": 3})
    rig.run(0.5)
    upload(rig, [HOME, item(TAKEOFF, height=5.0)])
    assert rig.mode(3) == 0
    assert rig.command(400, 1) == 0
    rig.run(12.0)
    assert rig.height == pytest.approx(5.0, abs=0.5)


def test_turns_are_flown_about_their_centre(bench: Any) -> None:
    rig = bench(parameters={"CIRCLE_RATE": 40.0})
    rig.run(0.5)
    upload(rig, [HOME, item(TAKEOFF, height=6.0), item(18, 12.0, height=6.0, param1=1.0), item(LAND)])
    start(rig)
    rig.run_until(
        lambda: 18 in [one.command for one in rig.vehicle.mission.items] and rig.vehicle.mission.current == 2
    )
    farthest = 0.0
    while rig.vehicle.mission.current == 2:
        rig.run(0.5)
        farthest = max(farthest, rig.vehicle.estimate.position[0])
        assert rig.now < 90.0
    assert farthest == pytest.approx(22.0, abs=3.0)


def test_an_item_with_current_two_is_a_guided_target(bench: Any) -> None:
    rig = bench()
    rig.airborne(5.0)
    target = item(WAYPOINT, 12.0, height=7.0)
    rig.send(
        "MISSION_ITEM_INT",
        target_system=1,
        target_component=1,
        seq=0,
        current=2,
        **{**target, "autocontinue": 0},
    )
    rig.run(12.0)
    assert rig.latest["MISSION_ACK"]["type"] == ACCEPTED
    assert rig.vehicle.estimate.position[0] == pytest.approx(12.0, abs=1.5)
    assert rig.height == pytest.approx(7.0, abs=0.6)


def test_a_mission_that_is_only_a_take_off_ends_in_the_air(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    rig.command(511, 245, 200_000)
    assert upload(rig, [HOME, item(TAKEOFF)]) == 0
    start(rig)
    rig.run(25.0)
    assert rig.latest["EXTENDED_SYS_STATE"]["landed_state"] == 2


def test_a_take_off_to_below_the_ground_climbs_a_metre(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    assert upload(rig, [HOME, item(TAKEOFF, height=-10.0), item(DELAY, param1=30.0)]) == 0
    start(rig)
    rig.run(15.0)
    assert rig.vehicle.armed
    assert rig.height == pytest.approx(1.0, abs=0.4)


@pytest.mark.parametrize("command", [189, 201, 195])
def test_items_at_a_place_keep_their_frame(command: int, bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    assert upload(rig, [HOME, item(command, frame=3)]) == 0
    rig.send("MISSION_REQUEST_INT", target_system=1, target_component=1, seq=1)
    rig.run(0.05)
    assert rig.latest["MISSION_ITEM_INT"]["frame"] == 3


@pytest.mark.parametrize("command", [92, 94, 218, 222])
def test_items_without_effect_do_not_refuse_the_mission(command: int, bench: Any) -> None:
    rig = bench(features="guided_items,payload_place")
    rig.run(0.5)
    assert upload(rig, [HOME, item(command, frame=3)]) == 0
    rig.send("MISSION_REQUEST_INT", target_system=1, target_component=1, seq=1)
    rig.run(0.05)
    assert rig.latest["MISSION_ITEM_INT"]["command"] == command


def test_the_fields_of_a_camera_item_are_no_degrees(bench: Any) -> None:
    """MISSION_ITEM of DO_DIGICAM_CONTROL: 1 for a picture, 7 as its number, in any frame."""
    rig = bench()
    rig.run(0.5)
    for frame in (0, 2, 3):
        rig.send("MISSION_COUNT", **TARGET, count=2)
        rig.run(0.1)
        rig.send("MISSION_ITEM", **TARGET, seq=0, command=16, x=47.0, y=8.0)
        rig.run(0.1)
        rig.send("MISSION_ITEM", **TARGET, seq=1, command=203, frame=frame, x=1.0, y=7.0)
        rig.run(0.1)
        assert (rig.vehicle.mission[0].x, rig.vehicle.mission[1].x, rig.vehicle.mission[1].y) == (
            470_000_000,
            1,
            7,
        )
        rig.send("MISSION_REQUEST", **TARGET, seq=1)
        rig.run(0.1)
        assert (rig.latest["MISSION_ITEM"]["x"], rig.latest["MISSION_ITEM"]["y"]) == (1.0, 7.0)


def test_items_of_cameras_and_gimbals_are_taken(bench: Any) -> None:
    """As in AP_Mission of 4.5 to 4.8; of their parameters none may be NaN."""
    rig = bench()
    rig.run(0.5)
    commands = (202, 531, 532, 534, 1000, 2000, 2001, 2500, 2501)
    assert upload(rig, [HOME, *(item(command, frame=2) for command in commands)]) == 0
    assert upload(rig, [HOME, item(1000, frame=2, param1=-30.0, param3=nan)]) == INVALID_PARAM3
