"""Commands, parameters, streams, boot, sticks: who answers what."""

from __future__ import annotations

import re
import struct
from itertools import pairwise
from math import nan
from pathlib import Path
from typing import Any

import pytest

import volery.simulation.autopilots
from rigs.effects import ZEROS, without_effect
from rigs.station import TARGET
from volery import AMSL, Drone, Options, Position, fly
from volery.links.mavlink_messages import to_bytewise
from volery.simulation.autopilots.autopilot_parameters import REAL32
from volery.simulation.autopilots.onboard_mission import MissionItem
from volery.simulation.autopilots.px4 import FIRMWARE, event_interface
from volery.simulation.autopilots.px4.firmware import USES

ACCEPTED, REJECTED, DENIED, UNSUPPORTED, FAILED = 0, 1, 2, 3, 4
NOT_SENT = {
    "LINK_NODE_STATUS",
    "OPEN_DRONE_ID_LOCATION",
    "OPEN_DRONE_ID_SYSTEM",
    "TIME_ESTIMATE_TO_TARGET",
    "UTM_GLOBAL_POSITION",
}

ON_THE_GROUND = [
    ("unknown command", (31999,), UNSUPPORTED),
    ("unknown message", (512, 999), DENIED),
    ("interval of an unknown message", (511, 999, 100000), FAILED),
    ("loiter", (17,), UNSUPPORTED),
    ("yaw", (115, 90, 20, 1), UNSUPPORTED),
    ("pause", (193, 0), UNSUPPORTED),
    ("guided", (92, 1), UNSUPPORTED),
    ("reboot", (246, 1), DENIED),
    ("a mode that is none", (176, 1, 99), ACCEPTED),
    ("a mode without its flag", (176, 0, 4, 3), ACCEPTED),
    ("OFFBOARD without a stream", (176, 1, 6), ACCEPTED),
    ("disarm, disarmed", (400, 0), ACCEPTED),
    ("version", (520, 1), ACCEPTED),
    ("mission start without a mission", (300,), DENIED),
    ("home here", (179, 1), ACCEPTED),
    ("get home", (410,), ACCEPTED),
    ("store parameters", (245, 1), ACCEPTED),
    ("run the arming checks", (401,), ACCEPTED),
    ("region of interest without a place", (195,), DENIED),
    ("no region of interest", (197,), ACCEPTED),
]


@pytest.mark.parametrize(
    ("command", "result"), [row[1:] for row in ON_THE_GROUND], ids=[row[0] for row in ON_THE_GROUND]
)
def test_commands_on_the_ground(command: tuple[float, ...], result: int, bench: Any) -> None:
    rig = bench()
    rig.ready()
    assert rig.command(int(command[0]), *command[1:]) == result


@pytest.mark.parametrize("wrong", [{"target_system": 7}, {"target_component": 42}, {"target_system": 0}])
def test_a_wrong_target_is_refused(wrong: dict[str, int], bench: Any) -> None:
    rig = bench()
    rig.ready()
    assert rig.command(400, 1, **wrong) == FAILED
    assert not rig.vehicle.armed


def test_component_0_is_served(bench: Any) -> None:
    rig = bench()
    rig.ready()
    assert rig.command(400, 1, target_component=0) == ACCEPTED


def test_set_mode_is_acknowledged_as_command_176(bench: Any) -> None:
    rig = bench()
    rig.ready()
    rig.send("SET_MODE", target_system=1, base_mode=1, custom_mode=0x04040000)
    rig.run(0.05)
    assert (rig.latest["COMMAND_ACK"]["command"], rig.latest["COMMAND_ACK"]["result"]) == (176, ACCEPTED)


def test_an_accepted_mode_shows_at_the_next_heartbeat_only(bench: Any) -> None:
    rig = bench()
    rig.ready()
    beats = len(rig.of("HEARTBEAT"))
    assert rig.mode(4, 4) == ACCEPTED
    assert rig.latest["HEARTBEAT"]["custom_mode"] != 0x04040000 or len(rig.of("HEARTBEAT")) == beats + 1
    rig.run(1.0)
    assert rig.latest["HEARTBEAT"]["custom_mode"] == 0x04040000
    times = [one.at for one in rig.of("HEARTBEAT")]
    assert all(after - before == pytest.approx(1.0) for before, after in pairwise(times))


def test_every_recorded_mode_has_its_bits(facts: dict[str, Any]) -> None:
    modes = FIRMWARE.kinds["multirotor"].rules.modes
    for number, base in facts["modes"]:
        unstreamed = number == 0x00060000 and base == 1
        assert unstreamed or modes[number].base_mode == base & ~128


def test_why_arming_is_refused_only_events_say(bench: Any) -> None:
    rig = bench()
    rig.ready()
    assert rig.mode(3) == ACCEPTED
    start = rig.now
    assert rig.command(400, 1) == REJECTED
    rig.run(3.0)
    assert rig.texts(start) == []
    assert not rig.vehicle.armed


def test_cold_it_may_be_armed_when_the_recorded_one_could(facts: dict[str, Any], bench: Any) -> None:
    rig = bench(warm=False)
    recorded = facts["boot"]["offboard-api"]
    rig.run(recorded["armable"] - 1.0)
    assert rig.command(400, 1) == REJECTED
    rig.run(1.5)
    assert rig.command(400, 1) == ACCEPTED
    assert rig.of("HEARTBEAT")[0].at == pytest.approx(recorded["first_heartbeat"], abs=0.15)
    for name, at in recorded["first"].items():
        assert rig.of(name)[0].at == pytest.approx(at, abs=0.3)


def test_the_reports_of_a_boot_are_the_recorded_ones(facts: dict[str, Any], bench: Any) -> None:
    rig = bench(warm=False)
    rig.run(9.0)
    ours = [
        [one.fields["id"], one.fields["log_levels"], bytes(one.fields["arguments"]).rstrip(b"\0").hex()]
        for one in rig.of("EVENT")
    ]
    recorded = facts["boot"]["auto-gcs"]["events"]
    assert ours == [event[1:] for event in recorded]
    for one, event in zip(rig.of("EVENT"), recorded, strict=True):
        assert one.at == pytest.approx(event[0], abs=0.15)


def test_words_wait_for_a_ground_station(bench: Any) -> None:
    rig = bench(beats=False)
    rig.ready()
    assert rig.command(400, 1) == ACCEPTED
    rig.run(1.0)
    assert rig.texts() == []
    assert event_interface.ARMED.id in rig.events()
    rig.beat()
    rig.run(1.1)
    assert rig.texts() == ["Armed by external command\t"]


@pytest.mark.parametrize("use", ["onboard", "station"])
def test_each_kind_of_link_gets_the_recorded_streams(use: str, facts: dict[str, Any], bench: Any) -> None:
    rig = bench(use=use)
    rig.run(2.0)
    start = rig.now
    rig.run(20.0)
    for name, rate in facts["streams"][use].items():
        if name in NOT_SENT or name in (
            "MISSION_CURRENT",
            "POSITION_TARGET_GLOBAL_INT",
            "ORBIT_EXECUTION_STATUS",
        ):
            continue
        count = len([one for one in rig.of(name) if one.at > start])
        assert count == pytest.approx(rate * 20.0, rel=0.03, abs=1.01), name


def test_parameters_are_listed_as_recorded(facts: dict[str, Any], bench: Any) -> None:
    rig, recorded = bench(), facts["parameters"]
    rig.ready()
    rig.send("PARAM_REQUEST_LIST", target_system=1, target_component=1)
    rig.run(1.5)
    values = rig.of("PARAM_VALUE")
    assert [[one.fields["param_id"], one.fields["param_index"]] for one in values[:3]] == recorded["first"]
    assert len(values) == recorded["count"] + 1
    assert sorted({one.fields["param_type"] for one in values}) == recorded["types"]
    assert values[-1].at - values[0].at == pytest.approx(recorded["seconds"], abs=0.1)


def whole(number: int) -> float:
    """An integer as its bytes in the place of a real number."""
    (value,) = struct.unpack("<f", struct.pack("<i", number))
    return float(value)


def test_integers_travel_as_bytes_and_types_must_match(bench: Any) -> None:
    rig = bench()
    rig.ready()

    def tell(name: str, kind: int, value: float) -> int:
        before = len(rig.of("PARAM_VALUE"))
        rig.send(
            "PARAM_SET",
            target_system=1,
            target_component=1,
            param_id=name,
            param_type=kind,
            param_value=value,
        )
        rig.run(0.1)
        return len(rig.of("PARAM_VALUE")) - before

    assert tell("COM_OBL_RC_ACT", 6, whole(4)) == 1
    assert rig.vehicle.parameters["COM_OBL_RC_ACT"] == 4.0
    assert rig.latest["PARAM_VALUE"]["param_value"] == whole(4)
    assert tell("COM_OBL_RC_ACT", 9, 3.0) == 0
    assert tell("NO_SUCH_NAME", 9, 3.0) == 0
    assert rig.vehicle.parameters["COM_OBL_RC_ACT"] == 4.0


def test_supported_parameters_exist_and_are_read_and_no_others_are() -> None:
    room = Path(volery.simulation.autopilots.__file__).parent / "px4"
    source = "".join(path.read_text(encoding="utf-8") for path in sorted(room.glob("*.py")))
    read = set(re.findall(r'(?:parameters|\bp)\["([A-Z0-9_]+)"', source))
    read |= set(re.findall(r'seconds_parameter\("([A-Z0-9_]+)"', source))
    read |= {"BAT_LOW_THR", "BAT_CRIT_THR", "BAT_EMERGEN_THR"}
    firmwares = [one for version in FIRMWARE.versions.values() for one in version.values()]
    assert set().union(*(one.rules.parameters.supported for one in firmwares)) - {"PD_GRIPPER_EN"} == read
    for firmware in firmwares:
        assert set(firmware.rules.parameters.supported) <= {
            parameter.name for parameter in firmware.rules.parameters.defaults()
        }
    assert REAL32 == 9


# --- sticks -----------------------------------------------------------------------------------


def test_posctl_needs_sticks_and_a_throttle_that_is_not_high(bench: Any) -> None:
    rig = bench()
    rig.ready()
    rig.mode(3)
    assert rig.command(400, 1) == REJECTED
    rig.sticks(z=1000)
    rig.run(0.5)
    assert rig.command(400, 1) == REJECTED
    assert rig.texts()[-1] == "Arming denied: throttle above center\t"
    rig.sticks(z=500)
    rig.run(0.5)
    assert rig.command(400, 1) == ACCEPTED


@pytest.mark.parametrize("main", [1, 2, 3, 7])
def test_a_mode_of_sticks_is_refused_until_they_are_taken_in(main: int, bench: Any) -> None:
    """Observed: refused with the first sample, 4 of 4 times, and accepted 0.3 s later."""
    rig = bench()
    rig.airborne()
    rig.sticks()
    rig.run(0.02)
    assert rig.mode(main) == REJECTED
    assert "currently not available" in rig.texts()[-1]
    rig.run(0.3)
    assert rig.mode(main) == ACCEPTED


def test_a_reposition_beyond_the_geofence_is_accepted_and_not_flown(bench: Any) -> None:
    """Observed with GF_MAX_HOR_DIST 100 and GF_ACTION 3: two texts and two events as it begins."""
    rig = bench(parameters={"GF_ACTION": 3, "GF_MAX_HOR_DIST": 100.0})
    rig.airborne()
    latitude, longitude, amsl = rig.vehicle.estimate.geodetic
    there = {"x": round((latitude + 3e-3) * 1e7), "y": round(longitude * 1e7), "z": amsl, "param4": nan}
    since = rig.now
    assert rig.command_int(192, param1=-1, param2=1, **there) == ACCEPTED
    rig.run(0.3)
    assert rig.texts(since)[:2] == [
        "Maximum distance from home reached (100.00000)\t",
        "Reposition is outside geofence\t",
    ]
    assert rig.events(since)[:2] == [0x0115F1B8, 0x01CDEBC4]
    rig.run(5.0)
    assert abs(rig.ned[0]) < 2.0
    inside = {**there, "x": round((latitude + 5e-4) * 1e7)}
    assert rig.command_int(192, param1=-1, param2=1, **inside) == ACCEPTED
    rig.run(8.0)
    assert rig.ned[0] > 20.0


def upload(rig: Any, kind: int, items: list[dict[str, Any]]) -> int:
    """Upload a list of points, and return the MAV_MISSION_RESULT."""
    rig.send("MISSION_COUNT", target_system=1, target_component=1, count=len(items), mission_type=kind)
    for sequence, item in enumerate(items):
        rig.run(0.05)
        rig.send(
            "MISSION_ITEM_INT",
            **{
                "target_system": 1,
                "target_component": 1,
                "seq": sequence,
                "frame": 5,
                "current": 0,
                "autocontinue": 1,
                "param1": 0.0,
                "param2": 0.0,
                "param3": 0.0,
                "param4": 0.0,
                "z": 0.0,
                "mission_type": kind,
                **item,
            },
        )
    rig.run(0.1)
    result: int = rig.latest["MISSION_ACK"]["type"]
    return result


def test_a_fence_is_stored_and_a_reposition_beyond_it_is_not_flown(bench: Any) -> None:
    """Observed: the upload of a fence is accepted, where the simulated one refused it."""
    rig = bench()
    rig.airborne()
    latitude, longitude, amsl = rig.vehicle.estimate.geodetic
    corners = [(-3e-4, -3e-4), (3e-4, -3e-4), (3e-4, 3e-4), (-3e-4, 3e-4)]
    polygon = [
        {
            "command": 5001,
            "param1": 4.0,
            "x": round((latitude + north) * 1e7),
            "y": round((longitude + east) * 1e7),
        }
        for north, east in corners
    ]
    assert upload(rig, 1, polygon) == 0
    assert upload(rig, 2, [{"command": 5100, "x": polygon[0]["x"], "y": polygon[0]["y"], "z": 50.0}]) == 0
    assert upload(rig, 1, [{"command": 16, "x": 0, "y": 0}]) != 0
    rig.send("MISSION_REQUEST_LIST", target_system=1, target_component=1, mission_type=1)
    rig.run(0.1)
    assert (rig.latest["MISSION_COUNT"]["count"], rig.latest["MISSION_COUNT"]["mission_type"]) == (4, 1)
    rig.send("MISSION_REQUEST_INT", target_system=1, target_component=1, seq=1, mission_type=1)
    rig.run(0.1)
    item = rig.latest["MISSION_ITEM_INT"]
    assert (item["seq"], item["command"], item["mission_type"]) == (1, 5001, 0)  # as the original: no type
    there = {"y": round(longitude * 1e7), "z": amsl, "param4": nan}
    for north, flown in ((6e-4, False), (2e-4, True)):
        target = round((latitude + north) * 1e7)
        assert rig.command_int(192, param1=-1, param2=1, x=target, **there) == ACCEPTED
        rig.run(9.0)
        assert (rig.ned[0] > 15.0) == flown
    assert "Reposition is outside geofence\t" in rig.texts()


def test_a_required_mission_refuses_arming_and_says_so_in_an_event(bench: Any) -> None:
    """Observed with COM_ARM_MIS_REQ 1: the check is only of level Info, names all modes, and blocks."""
    rig = bench(parameters={"COM_ARM_MIS_REQ": 1}, warm=False)
    rig.run(12.0)
    assert rig.command(400, 1) == REJECTED
    check = [one.fields for one in rig.of("EVENT") if one.fields["id"] == event_interface.NO_MISSION.id][-1]
    assert check["log_levels"] & 0xF == 6
    assert bytes(check["arguments"][:4]) == b"\xff\xff\xff\xff"


def test_events_that_were_missed_are_sent_again(bench: Any) -> None:
    """A client of a vehicle that already runs asks for the report of its arming checks."""
    rig = bench(warm=False)
    rig.run(12.0)
    first = rig.of("EVENT")[0].fields["sequence"]
    sent = len(rig.of("EVENT"))
    rig.send(
        "REQUEST_EVENT",
        target_system=1,
        target_component=1,
        first_sequence=(first - 2) % 65_536,
        last_sequence=(first + 3) % 65_536,
    )
    rig.run(0.1)
    again = [one.fields["sequence"] for one in rig.of("EVENT")[sent:]]
    missing = [one.fields["sequence"] for one in rig.of("RESPONSE_EVENT_ERROR")]
    kept = {
        one.fields["sequence"] for one in rig.of("EVENT")[max(0, sent - event_interface.KEPT_EVENTS) : sent]
    }
    asked = [(first + step) % 65_536 for step in range(-2, 4)]
    assert again == [sequence for sequence in asked if sequence in kept]
    assert missing == [sequence for sequence in asked if sequence not in kept]


def test_without_a_position_the_home_is_missing_too(bench: Any) -> None:
    rig = bench(warm=False)
    rig.flight.block_gps()
    rig.run(15.0)
    found = set(rig.events())
    assert {0x01D31BB9, 0x0198C273, 0x0105C2D9, 0x01013630} <= found


def test_it_has_no_current_sensor(bench: Any) -> None:
    """Recorded in all of 2005 SYS_STATUS and 267 BATTERY_STATUS."""
    rig = bench()
    rig.airborne()
    assert rig.latest["SYS_STATUS"]["current_battery"] == -100
    assert rig.latest["BATTERY_STATUS"]["current_battery"] == -100
    assert rig.latest["BATTERY_STATUS"]["current_consumed"] == 0


def test_a_target_on_the_other_side_of_the_earth_is_accepted_and_flown_to(bench: Any) -> None:
    """Seen on PX4 1.14, whose commander does not look at coordinates."""
    rig = bench()
    rig.airborne()
    far = {"x": 460825000, "y": -1038995000, "z": 500.0}
    assert rig.command_int(192, param1=-1, param2=1, frame=5, **far) == ACCEPTED
    rig.run(15.0)
    assert rig.ned[1] < -20.0


def test_an_orbit_is_accepted_on_the_ground(bench: Any) -> None:
    rig = bench()
    rig.ready()
    assert rig.command(34, 10, 2) == ACCEPTED


def test_a_mission_whose_first_waypoint_is_far_is_stored_and_not_started(bench: Any) -> None:
    """Seen on PX4 1.14 (MIS_DIST_1WP): the upload is accepted, the start denied with this text."""
    rig = bench()
    rig.ready()
    latitude, longitude, _ = rig.vehicle.estimate.geodetic
    place = {"command": 16, "frame": 6, "y": round(longitude * 1e7), "z": 20.0}
    assert upload(rig, 0, [{**place, "x": round((latitude + 0.02) * 1e7)}]) == ACCEPTED
    assert rig.command(300) == DENIED
    rig.run(0.2)
    assert "Mission start denied! No valid mission\t" in rig.texts()
    assert upload(rig, 0, [{**place, "x": round((latitude + 0.001) * 1e7)}]) == ACCEPTED
    assert rig.command(300) == ACCEPTED
    rig.run(0.5)
    assert rig.vehicle.armed


def test_the_receiver_is_present_once_the_estimator_uses_it(bench: Any) -> None:
    """Seen on PX4 1.14: clients that wait for a global position by this bit arm 2 s later."""
    rig = bench(warm=False)
    present, enabled = "onboard_control_sensors_present", "onboard_control_sensors_enabled"
    rig.run(5.0)
    assert "GLOBAL_POSITION_INT" not in rig.latest
    assert not (rig.latest["SYS_STATUS"][present] | rig.latest["SYS_STATUS"][enabled]) & 0x20
    rig.run(5.0)
    assert "GLOBAL_POSITION_INT" in rig.latest
    assert rig.latest["SYS_STATUS"][present] & rig.latest["SYS_STATUS"][enabled] & 0x20


def in_posctl(rig: Any) -> None:
    rig.ready()
    rig.sticks()
    rig.run(0.5)
    rig.mode(3)
    assert rig.command(400, 1) == ACCEPTED
    rig.run(1.5)
    rig.sticks(z=1000)
    rig.run_until(lambda: rig.height > 8.0)
    rig.sticks()
    rig.run(3.0)


def test_in_altctl_a_third_of_the_stick_is_a_sixth_of_the_climb(bench: Any) -> None:
    """Dead zone and expo curve of ALTCTL, as in PX4's FlightTaskManualAltitude."""
    rig = bench()
    in_posctl(rig)
    assert rig.mode(2) == ACCEPTED
    rig.sticks(z=500 - 50 - 150)  # a third of the way beyond the dead zone
    rig.run(3.0)
    sink = rig.vehicle.estimate.velocity[2]
    assert sink == pytest.approx(1.5 * (0.6 / 27.0 + 0.4 / 3.0), rel=0.2)


def test_lost_sticks_hold_then_return_and_only_movement_brings_the_pilot_back(bench: Any) -> None:
    rig = bench()
    in_posctl(rig)
    rig.stop_stream()
    last = rig.now
    rig.run(2.0)
    text = "Failsafe activated, entering Hold for 5 seconds\t"
    assert rig.said_at(text, last) - last == pytest.approx(0.65, abs=0.12)
    assert rig.vehicle.mode.name == "AUTO.LOITER"
    rig.run(4.5)
    assert rig.vehicle.mode.name == "AUTO.RTL"
    rig.sticks()
    rig.run(1.0)
    assert rig.vehicle.mode.name == "AUTO.RTL"
    rig.sticks(x=1000)
    rig.run(0.5)
    assert rig.vehicle.mode.name == "POSCTL"
    assert event_interface.PILOT_TOOK_OVER.id in rig.events(last)


def test_in_hold_moving_the_sticks_takes_over_but_not_in_offboard(bench: Any) -> None:
    rig = bench()
    in_posctl(rig)
    rig.mode(4, 3)
    rig.run(1.0)
    rig.sticks(x=800)
    rig.run(0.5)
    assert rig.vehicle.mode.name == "POSCTL"
    assert rig.texts()[-1] == "Pilot took over using sticks\t"


def test_disarming_in_the_air_needs_force(bench: Any) -> None:
    rig = bench()
    rig.airborne()
    assert rig.command(400, 0) == REJECTED
    assert rig.texts()[-1] == "Disarming denied! Not landed\t"
    assert rig.command(400, 0, 21196) == ACCEPTED
    assert not rig.vehicle.armed


def test_reposition_without_its_flag_is_refused_and_flown(bench: Any) -> None:
    rig = bench()
    rig.airborne()
    latitude, longitude, amsl = rig.vehicle.estimate.geodetic
    place = {"x": round((latitude + 1e-4) * 1e7), "y": round(longitude * 1e7), "z": amsl, "param4": nan}
    assert rig.command_int(192, param1=-1, **place) == UNSUPPORTED
    before = rig.ned[0]
    rig.run(5.0)
    assert rig.ned[0] > before + 3.0


def test_the_place_of_no_degrees_is_a_place() -> None:
    """The original takes only NaN for a place that is not given; models begin at 0, 0 by default."""
    ends = []

    def back(drone: Drone) -> None:
        drone.takeoff(5)
        drone.goto(Position(0.0, 0.0, AMSL(5.0)))
        ends.append(drone.position)

    fly(back, "sim:px4?start=warm&home=0.0003,0,0", Options(seed=1))
    assert ends[0].latitude == pytest.approx(0.0, abs=2e-5)


def test_where_it_was_sent_it_shows_within_a_second(facts: dict[str, Any], bench: Any) -> None:
    """By that a program knows that nobody else has sent it elsewhere; asking for Hold again does not."""
    recorded = facts["target"]
    for asked, shown in zip(recorded["asked"], recorded["shown"], strict=True):
        assert shown == pytest.approx(asked, abs=1.0)  # 1e-7 degrees, and metres
    rig = bench()
    rig.airborne()
    latitude, longitude, amsl = rig.vehicle.estimate.geodetic
    north = round((latitude + 1e-3) * 1e7)
    place = {"x": north, "y": round(longitude * 1e7), "z": amsl, "param4": nan}
    assert rig.command_int(192, param1=-1, param2=1, **place) == ACCEPTED
    rig.run(max(1.1, recorded["after"]))
    assert rig.latest["POSITION_TARGET_GLOBAL_INT"]["lat_int"] == pytest.approx(north, abs=1)
    assert rig.mode(4, 3) == ACCEPTED
    rig.run(2.0)
    assert rig.latest["POSITION_TARGET_GLOBAL_INT"]["lat_int"] == pytest.approx(north, abs=1)


def test_an_upload_that_stops_is_requested_again_and_given_up(bench: Any) -> None:
    rig = bench()
    rig.ready()
    rig.received.clear()
    rig.send("MISSION_COUNT", target_system=1, target_component=1, count=3)
    rig.run(4.5)
    assert len(rig.of("MISSION_REQUEST")) == pytest.approx(18, abs=2)
    assert "Operation timeout\t" not in rig.texts()
    rig.run(1.0)
    assert rig.texts()[-1] == "Operation timeout\t"
    assert event_interface.MISSION_TIMEOUT.id in rig.events()
    assert not rig.of("MISSION_ACK")


def test_a_mission_that_is_started_names_what_has_armed(bench: Any) -> None:
    rig = bench()
    rig.ready()
    latitude, longitude, _ = rig.vehicle.estimate.geodetic
    item = MissionItem(22, 3, x=round(latitude * 1e7), y=round(longitude * 1e7), z=10.0)
    rig.vehicle.mission.replace([item])
    rig.run(0.2)  # examined
    rig.command(300)
    rig.run(0.5)
    assert "Armed by mission start\t" in rig.texts()


@pytest.mark.parametrize("kind", ["copter", "rover"])
def test_a_parameter_without_effect_is_refused(kind: str, today: Any) -> None:
    """Each is set to another value: only those that change what the vehicle does keep it."""
    rig = today(kind)
    rig.run(0.5)
    parameters, kept = rig.vehicle.parameters, set()
    for own, type_, *_ in rig.autopilot.firmware.rules.parameters.defaults():
        name, now = parameters.name(own), parameters[own]
        wanted = to_bytewise(type_, 0.0 if now else 1.0)
        rig.send("PARAM_SET", **TARGET, param_id=name, param_value=wanted, param_type=type_)
        rig.run(0.008)
        if parameters[own] != now:
            kept.add(own)
            parameters.set(name, now)
    assert kept == set(rig.autopilot.firmware.rules.parameters.supported)


def test_each_version_has_its_own_parameters(bench: Any, today: Any) -> None:
    """Compared with the lists of the recorded ones: 877 of 1.14.0, 874 of 1.17.0."""
    then, now = bench().vehicle.parameters, today().vehicle.parameters
    assert (len(then), len(now)) == (877, 873)  # a calibration of the recorded one is left out, and one added
    assert [one.name for one in now] == sorted(one.name for one in now)
    for gone, instead in (("MPC_HOLD_DZ", "MAN_DEADZONE"), ("PD_GRIPPER_EN", None), ("RC1_DZ", None)):
        assert then.find(gone) is not None
        assert now.find(gone) is None
        assert instead is None or now.find(instead) is not None
    assert (then["COM_LOW_BAT_ACT"], now["COM_LOW_BAT_ACT"]) == (2.0, 3.0)
    assert (then["MPC_YAWRAUTO_MAX"], now["MPC_YAWRAUTO_MAX"]) == (45.0, 60.0)


def at_rest(rig: Any) -> None:
    """Nothing is done before."""


def with_a_region(rig: Any) -> None:
    """The nose points to a place."""
    rig.command(195, 0, 0, 0, 0, 46.0, -103.0, 950.0)


EXAMPLES = {
    176: ((1.0, 4.0, 5.0), at_rest),
    197: (ZEROS, with_a_region),
    511: ((148.0, 10_000.0), at_rest),
    512: ((148.0,), at_rest),
}
ACCEPTED_WITHOUT_EFFECT = {
    211: "the gripper moves a servo, which nothing shows; 1.17 accepts it without PD_GRIPPER_EN, as seen",
    245: "parameters are always saved; 1.14 and 1.17 accept it, as recorded",
    519: "the answer, PROTOCOL_VERSION, is in no dialect that stations read; accepted, as recorded",
}


@pytest.mark.parametrize("kind", ["copter", "rover"])
def test_a_command_without_effect_is_refused(kind: str, today: Any) -> None:
    def ready() -> Any:
        rig = today(kind, beats=False)
        rig.send("HEARTBEAT", type=6, autopilot=8)
        rig.run(1.52)
        return rig

    unasked = set().union(*USES.values()) - {"HOME_POSITION"}
    assert without_effect(ready, unasked, EXAMPLES) == set(ACCEPTED_WITHOUT_EFFECT)
