"""Drone operations on a Paparazzi: blocks, settings and set-points, each seen on slow telemetry."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, radians
from pathlib import Path
from typing import Any

import pytest

from rigs.missions import stabilize_by_idle_throttle
from volery.base.errors import (
    CapabilityError,
    Failsafe,
    LinkLost,
    LinkSilent,
    NotArrived,
    Overridden,
    Refused,
    UsageError,
)
from volery.base.position import AMSL, AboveGround, AboveHome, Position
from volery.base.time import S
from volery.kernel.waiting import sleep
from volery.trace.events import Operation, Text
from volery.vehicles import Capability
from volery.vehicles.mission import Waypoint

Make = Callable[..., Any]
LATITUDE, LONGITUDE, AMSL_M = 43.4622222, 1.2733333, 185.0
METRES_NORTH = 30.0
NEAR = Position(LATITUDE + METRES_NORTH / 111_106.0, LONGITUDE, AboveHome(12.0))


def up(drone: Any) -> None:
    drone.takeoff(10)


def after_takeoff(then: Callable[[Any], Any]) -> Callable[[Any], Any]:
    def mission(drone: Any) -> Any:
        drone.takeoff(10)
        return then(drone)

    return mission


def test_a_mission_of_five_lines(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.goto(NEAR)
        drone.goto(Position(LATITUDE, LONGITUDE + 0.0002, AMSL(AMSL_M + 8.0)))
        drone.return_home()

    at.fly(mission)
    assert not at.craft.armed
    assert (at.craft.north, at.craft.east) == pytest.approx((0.0, 0.0), abs=0.05)
    operations = at.recorded(Operation)
    assert [(one.operation, one.outcome) for one in operations] == [
        ("takeoff", "ok"),
        ("goto", "ok"),
        ("goto", "ok"),
        ("return_home", "ok"),
    ]
    assert all(one.estimate_horizontal < 0.5 and one.estimate_vertical < 0.3 for one in operations[:3])


def test_a_take_off_starts_motors_and_lifts_by_blocks_then_climbs_by_set_point(bench: Make) -> None:
    at = bench()
    at.craft.north, at.craft.east, at.craft.psi = 3.0, -2.0, 1.25
    at.fly(up)
    blocks = [fields["block_id"] for fields in at.autopilot.sent("BLOCK")]
    assert blocks[0] == 3
    assert set(blocks[1:]) == {4}
    setpoint = at.autopilot.sent("GUIDED_SETPOINT_NED")[-1]
    assert setpoint["flags"] == 0
    assert (setpoint["x"], setpoint["y"], setpoint["z"]) == pytest.approx((3.0, -2.0, -10.0), abs=0.05)
    assert setpoint["yaw"] == pytest.approx(1.25, abs=0.001)
    assert at.craft.mode == "GUIDED"


def test_set_points_are_metres_about_the_origin_whatever_the_altitude_is_above(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.goto(NEAR)
        drone.goto(Position(LATITUDE, LONGITUDE + 0.0002, AMSL(AMSL_M + 8.0)))

    at.fly(mission)
    sent = [tuple(fields[name] for name in "xyz") for fields in at.autopilot.sent("GUIDED_SETPOINT_NED")]
    east = 0.0002 * 111_320.0 * cos(radians(LATITUDE))
    assert any(one == pytest.approx((30.0, 0.0, -12.0), abs=0.2) for one in sent)
    assert sent[-1] == pytest.approx((0.0, east, -8.0), abs=0.2)


def test_the_heading_last_asked_for_is_kept(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.set_heading(270.0)
        drone.goto(NEAR)

    at.fly(mission)
    assert at.autopilot.sent("GUIDED_SETPOINT_NED")[-1]["yaw"] == pytest.approx(radians(270.0), abs=1e-6)


def test_a_velocity_is_repeated_and_then_ends(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.set_velocity(2.0, -1.0, 0.5, 10.0, lasting=2.0)
        sleep(at.kernel, 4 * S)

    at.fly(mission)
    sent = [fields for fields in at.autopilot.sent("GUIDED_SETPOINT_NED") if fields["flags"] == 0xE0]
    first = sent[0]
    assert (first["x"], first["y"], first["z"]) == (2.0, -1.0, -0.5)
    assert first["yaw"] == pytest.approx(radians(10.0))
    assert len(sent) >= 8
    assert (sent[-1]["x"], sent[-1]["y"], sent[-1]["z"]) == (0.0, 0.0, 0.0)
    assert at.craft.velocity == (0.0, 0.0, 0.0)


def test_it_lands_where_it_is_and_stops_its_motors(bench: Make) -> None:
    at = bench()
    at.fly(after_takeoff(lambda drone: drone.land()))
    assert (at.craft.armed, at.craft.up) == (False, 0.0)
    assert at.autopilot.sent("BLOCK")[-1]["block_id"] == 13


def test_the_landing_block_is_entered_before_nav(bench: Make) -> None:
    """In NAV the block that it was left in would be flown meanwhile: here Standby, somewhere else."""
    at = bench()
    order: list[str] = []
    at.autopilot.enter, enter = lambda mode: (order.append(mode), enter(mode)), at.autopilot.enter
    at.autopilot._block, block = (
        lambda f: (order.append(f"block {f['block_id']}"), block(f)),
        at.autopilot._block,
    )
    at.fly(after_takeoff(lambda drone: drone.land()))
    assert order.index("block 13") < len(order) - 1 - order[::-1].index("NAV")


def test_far_from_home_it_lands_and_takes_off_without_the_plan(bench: Make) -> None:
    """In NAV it would go home by itself."""
    at = bench()
    far = Position(LATITUDE + 250.0 / 111_106.0, LONGITUDE, AboveHome(12.0))
    heights: list[float] = []

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.goto(far)
        drone.land()
        heights.append(at.craft.up)
        drone.takeoff(7)
        heights.append(at.craft.up)
        drone.return_home()

    at.fly(mission)
    assert heights == pytest.approx([0.0, 7.0], abs=0.05)
    assert (at.craft.north, at.craft.east, at.craft.up) == pytest.approx((0.0, 0.0, 0.0), abs=0.05)
    assert not at.craft.armed
    assert {fields["flags"] for fields in at.autopilot.sent("GUIDED_SETPOINT_NED")} == {0, 0x40}


def test_without_a_fix_it_lands_all_the_same(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.craft.fix = "NO_FIX"
        sleep(at.kernel, 2 * S)
        drone.land()

    at.fly(mission)
    assert (at.craft.armed, at.craft.mode) == (False, "KILL")
    assert at.autopilot.written("mode")[-1] == 1.0
    assert at.autopilot.sent("EMERGENCY_CMD")[-1]["cmd"] == 2


def test_hold_brakes_and_stays(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.set_velocity(3.0, lasting=30.0)
        sleep(at.kernel, 2 * S)
        drone.hold()

    at.fly(mission)
    last = at.autopilot.sent("GUIDED_SETPOINT_NED")[-1]
    assert last["flags"] == 0
    assert last["x"] == pytest.approx(at.craft.north, abs=1.0)


# -- sticks


def test_sticks_are_a_transmitter_in_the_third_position(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.manual_control(0.5, -1.0, 0.5, 1.0)
        drone.altitude_hold()
        sleep(at.kernel, 3 * S)
        drone.manual_control(0.0, 0.0, 0.5, 0.0)
        drone.goto(NEAR)

    at.fly(mission)
    first = at.autopilot.sent("RC_4CH")[0]
    assert {name: first[name] for name in ("mode", "throttle", "roll", "pitch", "yaw")} == {
        "mode": 2,
        "throttle": 64,
        "roll": -127,
        "pitch": -64,
        "yaw": 127,
    }
    assert len(at.autopilot.sent("RC_4CH")) >= 30
    assert 6.0 in at.autopilot.written("auto2")
    assert at.craft.mode == "GUIDED"


def test_from_the_ground_it_is_armed_and_flown_by_hand_without_gps(bench: Make) -> None:
    at = bench()
    at.craft.fix, at.craft.placed = "NO_FIX", False

    def mission(drone: Any) -> str:
        drone.manual_control(0.0, 0.0, 0.0, 0.0)
        drone.stabilize()
        return str(drone.mode)

    assert at.fly(mission) == "ATTITUDE_DIRECT"
    assert at.craft.armed


def test_an_idle_throttle_in_the_air_is_refused(bench: Make) -> None:
    at = bench()

    with pytest.raises(UsageError, match="the motors would idle and it would fall"):
        at.fly(stabilize_by_idle_throttle)


# -- what goes wrong


def test_it_waits_for_a_fix_and_an_origin(bench: Make) -> None:
    at = bench()
    at.craft.fix, at.craft.placed, at.craft.block = "NO_FIX", False, 0
    at.after(20, lambda: setattr(at.craft, "fix", "3D"))
    at.after(30, lambda: (setattr(at.craft, "placed", True), setattr(at.craft, "block", 1)))
    at.after(40, lambda: setattr(at.craft, "block", 2))

    def mission(drone: Any) -> int:
        drone.wait_ready()
        return int(at.kernel.now())

    assert 40 * S < at.fly(mission) < 48 * S


def test_a_time_out_tells_what_the_aircraft_shows(bench: Make) -> None:
    at = bench()
    at.craft.arming = "PITCH_NOT_CENTERED"
    with pytest.raises(NotArrived) as raised:
        at.fly(up)
    said = str(raised.value)
    assert "to start the motors was not seen within 15 s" in said
    assert "look at its arming status" in said
    assert any(event.text == "arming status: pitch not centered" for event in at.recorded(Text))


def test_with_unaligned_attitude_it_is_not_ready(bench: Make) -> None:
    at = bench()
    at.craft.arming = "AHRS_NOT_ALLIGNED"
    with pytest.raises(NotArrived, match="arming status: ahrs not alligned"):
        at.fly(up)
    assert at.autopilot.sent("BLOCK") == []


def test_arming_is_refused_in_the_words_of_the_arming_status(bench: Make) -> None:
    at = bench()
    at.craft.arming = "AHRS_NOT_ALLIGNED"
    with pytest.raises(Refused, match=r"AHRS_NOT_ALLIGNED.: arming status: ahrs not alligned"):
        at.fly(lambda drone: drone.arm())


def test_from_kill_it_is_armed_by_way_of_guided(bench: Make) -> None:
    at = bench()
    at.craft.mode = "KILL"
    at.fly(lambda drone: drone.arm())
    assert (at.craft.mode, at.craft.armed) == ("GUIDED", True)


def test_a_transmitter_that_is_on_decides(bench: Make) -> None:
    at = bench()
    at.craft.mode, at.autopilot.transmitter = "ATTITUDE_DIRECT", True
    at.autopilot.locked = {"auto2"}
    with pytest.raises(NotArrived, match=r"put its mode switch into the third position .AUTO2."):
        at.fly(up)


def test_a_disarm_in_the_air_is_not_even_sent(bench: Make) -> None:
    at = bench()
    with pytest.raises(Refused, match="a Paparazzi stops its motors in the air, too"):
        at.fly(after_takeoff(lambda drone: drone.disarm()))
    assert at.craft.armed


def test_kill_stops_the_motors_anywhere(bench: Make) -> None:
    at = bench()
    at.fly(after_takeoff(lambda drone: drone.kill(sure=True)))
    assert not at.craft.armed
    assert at.autopilot.sent("EMERGENCY_CMD")[0]["cmd"] == 0


def test_another_station_takes_over(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.after(0.2, lambda: at.autopilot.enter("HOVER_Z_HOLD"))
        drone.land()

    with pytest.raises(Overridden, match="HOVER_Z_HOLD"):
        at.fly(mission)


def test_mode_home_without_a_command_is_a_failsafe(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.autopilot.enter("HOME")
        sleep(at.kernel, S)
        drone.goto(NEAR)

    with pytest.raises(Failsafe, match="is in HOME"):
        at.fly(mission)


def test_a_silent_aircraft_is_a_lost_link(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.autopilot.mute = True
        at.autopilot.deaf = True
        drone.goto(NEAR)

    with pytest.raises(LinkLost, match="no message was received for"):
        at.fly(mission)


def test_lost_commands_are_sent_again(bench: Make) -> None:
    at = bench()
    at.autopilot.deaf = True
    at.after(12, lambda: setattr(at.autopilot, "deaf", False))
    at.fly(up)
    assert at.craft.up == pytest.approx(10.0, abs=0.1)


# -- settings by number


def test_settings_of_another_number_are_never_written(bench: Make) -> None:
    """Setting 3 of this aircraft is something else: it must not be given a mode's number."""
    at = bench()
    at.autopilot.numbers = {0: "gain", 1: "gain 2", 2: "gain 3", 3: "gain 4"}
    with pytest.raises((NotArrived, CapabilityError)):
        at.fly(lambda drone: drone.wait_ready())
    assert at.autopilot.sent("SETTING") == []
    problem = str(at.vehicle._driver.problem())
    assert "is not 'mode' as in the stock rotorcraft: it is 1 while it is in NAV" in problem
    assert "aircraft=var/aircrafts/NAME" in problem


def test_an_aircraft_with_its_own_numbers(bench: Make, tmp_path: Path) -> None:
    (tmp_path / "settings.xml").write_text(
        "<settings><dl_settings><dl_setting var='x'/><dl_setting var='mode'/>"
        "<dl_setting var='kill_throttle'/><dl_setting var='auto2'/></dl_settings></settings>"
    )
    (tmp_path / "aircraft.xml").write_text("<conf><aircraft ac_id='7' name='Bee'/></conf>")
    at = bench(options={"aircraft": str(tmp_path)})
    at.autopilot.numbers = {0: "x", 1: "mode", 2: "kill_throttle", 3: "auto2"}
    at.fly(after_takeoff(lambda drone: drone.land()))
    assert at.autopilot.written("x") == []
    assert 19.0 in at.autopilot.written("mode")


def test_another_aircraft_than_the_one_meant(bench: Make) -> None:
    at = bench(options={"system": "12"})
    with pytest.raises(Exception, match="aircraft 7 answers here, not 12"):
        at.fly(lambda drone: drone.wait_connected())


def test_a_silent_link(bench: Make) -> None:
    at = bench()
    at.autopilot.mute = True
    with pytest.raises(LinkSilent, match="no message of a Paparazzi aircraft was received"):
        at.fly(lambda drone: drone.wait_connected())


def test_another_kind_of_aircraft(bench: Make) -> None:
    at = bench()
    at.autopilot.mute = True
    at.after(
        1,
        lambda: at.autopilot.link.send(
            at.autopilot.received[0]._replace(name="PPRZ_MODE", fields={}, system=7)
        ),
    )
    with pytest.raises(CapabilityError, match="is a plane, not a drone"):
        at.fly(lambda drone: drone.wait_connected())


# -- what it can


def test_what_it_cannot_is_said_before_anything_moves(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        assert Capability.SPEED not in drone.capabilities
        with pytest.raises(CapabilityError, match="cannot go at a stated speed"):
            drone.goto(NEAR, speed=3.0)
        with pytest.raises(CapabilityError, match="cannot fly an uploaded mission"):
            drone.upload_mission([Waypoint(NEAR)])
        with pytest.raises(CapabilityError, match="cannot keep an altitude above ground"):
            drone.goto(Position(LATITUDE, LONGITUDE, AboveGround(5.0)))

    at.fly(mission)


def test_what_it_does_if_its_commander_falls_silent(bench: Make) -> None:
    at = bench()
    at.fly(lambda drone: drone.wait_ready())
    line = at.vehicle.on_link_loss
    assert "a velocity goes on without end" in line
    assert "further than 150 m from home it turns back" in line


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"rate": "5"}, "the paparazzi driver has no option 'rate'"),
        ({"takeoff": "Take off"}, "no block 'Take off' (did you mean 'Takeoff'?)"),
        ({"aircraft": "/nowhere/at/all"}, "no XML of an aircraft there"),
        ({"system": "0"}, "system='0' is no system id"),
    ],
)
def test_options_that_make_no_sense(bench: Make, options: dict[str, str], says: str) -> None:
    with pytest.raises(UsageError) as raised:
        bench(options=options)
    assert says in str(raised.value)
