"""Drone operations: PX4's sequences against a scripted PX4."""

from __future__ import annotations

from collections.abc import Callable
from math import pi
from typing import Any

import pytest

from rigs.missions import stabilize_by_idle_throttle
from volery.base.errors import (
    CapabilityError,
    Failsafe,
    LinkGarbled,
    NotArrived,
    Overridden,
    Refused,
    UsageError,
)
from volery.base.position import AMSL, AboveGround, AboveHome, Position
from volery.base.time import MS, S
from volery.kernel.waiting import sleep
from volery.trace.events import Operation, Text
from volery.vehicles import Capability, ChangeSpeed, Land, ReturnHome, TakeOff, Waypoint
from volery.vehicles.drivers.px4.modes import HOLD, LAND, MODES, OFFBOARD, RTL

Make = Callable[..., Any]
LATITUDE, LONGITUDE = 45.4671168, -73.7578362
SET_MODE, ARM, TAKEOFF, SPEED, GO = 176, 400, 22, 178, 192
NEAR = Position(45.4675168, LONGITUDE, AboveHome(12.0))  # 44 m north
SETPOINT, STICKS = "SET_POSITION_TARGET_LOCAL_NED", "MANUAL_CONTROL"


def up(drone: Any) -> None:
    drone.takeoff(10)


def modes_asked(autopilot: Any) -> list[str]:
    names = {(mode.main, mode.sub): name for name, mode in MODES.items()}
    asked = [f for f in autopilot.sent("COMMAND_LONG") if f["command"] == SET_MODE]
    return [names[int(f["param2"]), int(f["param3"])] for f in asked]


# -- by position


def test_a_mission_of_five_lines(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.goto(NEAR)
        drone.goto(Position(45.4675168, -73.7575, AMSL(50.0)), speed=4.0)
        drone.return_home()

    at.fly(mission)
    assert not at.craft.armed
    assert at.autopilot.commands() == [ARM, TAKEOFF, GO, GO, SPEED, GO, SET_MODE]
    operations = at.recorded(Operation)
    assert [(one.operation, one.outcome) for one in operations] == [
        ("takeoff", "ok"),
        ("goto", "ok"),
        ("goto", "ok"),
        ("return_home", "ok"),
    ]
    assert all(one.estimate_horizontal < 0.6 and one.estimate_vertical < 0.3 for one in operations[:3])


def test_altitudes_are_sent_as_amsl(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.goto(NEAR)

    at.fly(mission)
    climb = next(f for f in at.autopilot.sent("COMMAND_LONG") if f["command"] == TAKEOFF)
    levelled, went = at.autopilot.sent("COMMAND_INT")
    assert climb["param7"] == pytest.approx(42.575, abs=1e-3)
    assert (levelled["z"], levelled["frame"], levelled["param2"]) == (pytest.approx(42.575, abs=1e-3), 5, 1.0)
    assert (went["z"], went["x"]) == (pytest.approx(44.575, abs=1e-3), 454675168)


def test_a_takeoff_that_ends_short_is_levelled(bench: Make) -> None:
    at = bench()
    at.fly(up)
    assert at.craft.up == pytest.approx(10.0, abs=0.01)


def test_a_stated_speed_does_not_outlive_its_goto(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.goto(NEAR, speed=2.0)
        drone.goto(NEAR)

    at.fly(mission)
    speeds = [f["param2"] for f in at.autopilot.sent("COMMAND_LONG") if f["command"] == SPEED]
    assert speeds == [2.0, -1.0]


def test_hold_stops_it_where_it_is(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.set_velocity(north=3.0)
        sleep(at.kernel, 2 * S)
        drone.hold()

    at.fly(mission)
    assert at.craft.mode == HOLD
    assert at.craft.north > 4.0


def test_another_mode_in_flight_is_never_fought(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.after(0.5, lambda: at.autopilot.enter("POSCTL"))
        drone.goto(NEAR)

    with pytest.raises(
        Overridden, match=r"changed from AUTO.LOITER to POSCTL.*switch the vehicle to AUTO.LOITER"
    ):
        at.fly(mission)
    assert at.craft.mode == "POSCTL"


def test_what_px4_lacks_is_refused_before_anything_moves(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        assert not drone.capabilities
        drone.wait_connected()
        assert {Capability.TAKEOFF, Capability.MISSION, Capability.STABILIZE} <= drone.capabilities
        drone.goto(Position(LATITUDE, LONGITUDE, AboveGround(10.0)))

    with pytest.raises((CapabilityError, Refused)):
        at.fly(mission)
    assert at.autopilot.commands() == []


# -- arming and refusals


def test_it_waits_for_the_estimator(bench: Make) -> None:
    at = bench()
    at.craft.flags = 167
    at.after(42, lambda: setattr(at.craft, "flags", 831))
    at.fly(up)
    assert at.kernel.now() > 42 * S


@pytest.mark.parametrize("left", [OFFBOARD, LAND])
def test_on_the_ground_it_is_put_into_hold_to_become_ready(bench: Make, left: str) -> None:
    at = bench()
    at.craft.mode = left  # where a flight in OFFBOARD, or an order to land on the ground, leaves it
    at.fly(lambda drone: drone.wait_ready())
    assert at.craft.mode == HOLD


def test_reasons_of_a_refusal_to_arm_come_from_the_last_report_of_checks(bench: Make) -> None:
    at = bench()
    at.autopilot.refuse = {ARM: []}

    def mission(drone: Any) -> None:
        drone.wait_ready()
        hold = 1 << MODES[HOLD].state
        at.autopilot.report(
            ("check_modes_global_pos", 3, hold),
            ("check_modes_mission", 6, 1 << MODES["AUTO.MISSION"].state),
            ("check_modes_manual_control", 4, 0xFFFFFFFF),
        )
        drone.arm()

    with pytest.raises(Refused, match=r"TEMPORARILY_REJECTED.*no valid global position estimate") as caught:
        at.fly(mission)
    assert "mission" not in str(caught.value)
    assert "manual control" not in str(caught.value)


def test_an_unknown_warning_is_shown_as_its_number(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> list[str]:
        drone.wait_connected()
        at.autopilot.event("something_new", 3)
        at.autopilot.event("something_unimportant", 6)
        at.autopilot.event("commander_rc_lost", 4)
        sleep(at.kernel, S)
        return [said.text for said in drone.texts]

    first, second = at.fly(mission)
    assert first.startswith("event 0x01")
    assert second == "manual control lost"


def test_disarming_in_the_air_is_refused(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.disarm()

    with pytest.raises(Refused, match="Disarming denied! Not landed"):
        at.fly(mission)


def test_on_the_ground_a_mode_is_believed_only_when_it_is_seen(bench: Make) -> None:
    at = bench()
    at.autopilot.enter = lambda mode: None  # accepted, and nothing happens

    with pytest.raises(NotArrived, match="change to STABILIZED was not seen"):
        at.fly(lambda drone: (drone.wait_connected(), drone.manual_control(0, 0, 0, 0), drone.stabilize()))


# -- OFFBOARD


def test_a_velocity_is_streamed_while_the_program_is_busy_and_ends_in_hold(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.set_velocity(north=3.0, lasting=6.0)
        at.began = at.kernel.now()
        sleep(at.kernel, 20 * S)

    at.fly(mission)
    assert at.craft.mode == HOLD
    assert at.craft.status == 4
    assert 15.0 < at.craft.north < 22.0
    assert len(at.autopilot.since(SETPOINT, at.began)) > 50


def test_a_velocity_lasts_in_seconds_of_a_vehicle_that_is_thrice_as_fast(bench: Make) -> None:
    at = bench()
    at.autopilot.clock_rate = 3.0

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        sleep(at.kernel, 6 * S)
        drone.set_velocity(north=3.0, lasting=6.0)
        sleep(at.kernel, 20 * S)

    at.fly(mission)
    assert at.craft.mode == HOLD
    assert 5.0 < at.craft.north < 10.0  # for two of the program's seconds and until the mode is seen


def test_a_loop_of_velocities_asks_for_the_mode_once(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        for turn in range(40):
            drone.set_velocity(north=1.0 + turn / 10)
            sleep(at.kernel, 100 * MS)
        drone.land()

    at.fly(mission)
    assert modes_asked(at.autopilot) == [OFFBOARD, LAND]
    last = at.autopilot.sent(SETPOINT)[-1]
    assert (last["coordinate_frame"], last["type_mask"]) == (1, 0x05C7)
    settled = at.kernel.now()
    at.kernel.run(settled + 5 * S)
    assert not at.autopilot.since(SETPOINT, settled)


def test_it_goes_back_to_offboard_when_a_velocity_has_just_ended(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        for _ in range(6):
            drone.set_velocity(north=1.0, lasting=1.0)
            sleep(at.kernel, 1200 * MS)
        drone.land()

    at.fly(mission)
    assert not at.craft.armed


@pytest.mark.parametrize("taken", ["POSCTL", LAND, RTL, HOLD])
def test_the_stream_ends_when_a_pilot_changes_the_mode(bench: Make, taken: str) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.after(3.0, lambda: at.autopilot.enter(taken))
        for _ in range(100):
            drone.set_velocity(north=1.0)
            sleep(at.kernel, 100 * MS)

    with pytest.raises(Overridden, match=f"is in {taken}"):
        at.fly(mission)
    since = at.kernel.now()
    at.kernel.run(since + 10 * S)
    assert not at.autopilot.since(SETPOINT, since)
    assert at.craft.mode == taken


def test_a_pilot_who_held_an_offboard_flight_keeps_it_until_another_mode_was_chosen(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> list[str]:
        drone.takeoff(10)
        drone.set_velocity(north=1.0, lasting=30.0)
        at.autopilot.enter(HOLD)
        sleep(at.kernel, 3 * S)
        said = []
        for _ in range(2):
            with pytest.raises(Overridden) as caught:
                drone.goto(NEAR)
            said.append(str(caught.value))
        assert drone.come_to_rest() == "is left to the pilot or station in AUTO.LOITER"
        at.autopilot.enter("POSCTL")
        sleep(at.kernel, 2 * S)
        at.autopilot.enter(HOLD)
        sleep(at.kernel, 2 * S)
        drone.goto(NEAR)
        return said

    said = at.fly(mission)
    assert all("switch the vehicle to another mode and then to AUTO.LOITER" in words for words in said)
    assert at.craft.up == pytest.approx(12.0, abs=0.01)


def test_a_stream_that_was_missed_does_not_steal_the_aircraft_back(bench: Make) -> None:
    at = bench()
    at.autopilot.on_loss = RTL

    def cut(on: bool) -> None:
        at.autopilot.deaf = at.autopilot.mute = on

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.set_velocity(north=1.0, lasting=60.0)
        cut(True)
        sleep(at.kernel, 3 * S)
        cut(False)
        sleep(at.kernel, 5 * S)
        assert at.craft.mode == RTL
        drone.goto(NEAR)

    with pytest.raises(Failsafe, match=r"is in AUTO\.RTL \(status critical\)"):
        at.fly(mission)
    assert at.craft.mode == RTL


def test_a_short_silence_is_as_if_nothing_had_happened(bench: Make) -> None:
    at = bench()

    def cut(on: bool) -> None:
        at.autopilot.deaf = at.autopilot.mute = on

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.set_velocity(north=1.0, lasting=20.0)
        cut(True)
        sleep(at.kernel, 500 * MS)
        cut(False)
        sleep(at.kernel, 5 * S)
        assert at.craft.mode == OFFBOARD
        drone.land()

    at.fly(mission)


def test_a_turn_is_a_reposition_to_where_it_is(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.set_heading(90)

    at.fly(mission)
    assert at.craft.heading == pytest.approx(90, abs=0.1)
    assert at.craft.mode == HOLD
    turn = at.autopilot.sent("COMMAND_INT")[-1]
    assert turn["command"] == 192
    assert turn["param4"] == pytest.approx(pi / 2)
    assert (at.craft.north, at.craft.east) == pytest.approx((0.0, 0.0), abs=0.1)
    assert not at.autopilot.sent(SETPOINT)


# -- sticks


def test_stabilized_flight_without_a_position(bench: Make) -> None:
    at = bench()
    at.craft.placed = False
    at.craft.flags = 167

    def mission(drone: Any) -> None:
        drone.wait_connected()
        drone.manual_control(0, 0, 0, 0)
        drone.stabilize()
        at.craft.landed_state, at.craft.up = 2, 5.0
        sleep(at.kernel, 2 * S)
        drone.manual_control(0.2, 0, 0.6, 0)
        drone.altitude_hold()
        sleep(at.kernel, 2 * S)
        drone.land()

    at.fly(mission)
    assert not at.craft.armed
    assert modes_asked(at.autopilot) == ["STABILIZED", "ALTCTL", LAND]
    first = at.autopilot.sent(STICKS)[0]
    assert (first["target"], first["z"], first["x"]) == (3, 0, 0)
    assert {"x": 200, "z": 600} in [{"x": f["x"], "z": f["z"]} for f in at.autopilot.sent(STICKS)]


def test_ended_sticks_are_forgotten_before_it_arms_again(bench: Make) -> None:
    at = bench()
    at.autopilot.parameters["COM_RC_LOSS_T"] = 2.0

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.manual_control(1.0, 0, 0.5, 0)
        drone.altitude_hold()
        drone.come_to_rest()  # the sticks go on until it is down
        drone.come_to_rest()
        drone.takeoff(5)

    at.fly(mission)
    assert at.autopilot.sticks_at_arming == [False, False]


def test_land_ends_when_it_disarms_before_the_mode_changes(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.autopilot.ignore.add(SET_MODE)
        at.kernel.call_at(at.kernel.now() + S, lambda: at.autopilot.down(HOLD))
        drone.land()

    at.fly(mission)
    assert not at.craft.armed


def test_sticks_are_centred_before_a_mode_that_flies_by_itself_and_then_go_on(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.manual_control(1.0, 0, 0.5, 0)
        drone.altitude_hold()
        sleep(at.kernel, 2 * S)
        drone.goto(NEAR)
        at.arrived = at.kernel.now()
        sleep(at.kernel, 5 * S)

    at.fly(mission)
    assert at.craft.mode == HOLD
    after = at.autopilot.since(STICKS, at.arrived)
    assert len(after) > 50
    assert {(f["x"], f["y"], f["z"], f["r"]) for f in after} == {(0, 0, 500, 0)}


def test_manual_control_of_another_ends_ours(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.manual_control(0.5, 0, 0.5, 0)
        drone.altitude_hold()
        at.autopilot.enter("POSCTL")
        sleep(at.kernel, 3 * S)
        at.taken = at.kernel.now()
        sleep(at.kernel, 3 * S)

    at.fly(mission)
    assert not at.autopilot.since(STICKS, at.taken)


def test_stabilized_with_an_idle_throttle_in_the_air_is_refused(bench: Make) -> None:
    at = bench()

    with pytest.raises(UsageError, match="it would fall"):
        at.fly(stabilize_by_idle_throttle)


# -- missions


def test_items_of_a_mission(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.wait_ready()
        point = Position(LATITUDE + 1e-4, LONGITUDE, AboveHome(12.0))
        drone.upload_mission(
            [TakeOff(10), ChangeSpeed(3.0), Waypoint(point, 2.0, 90.0), Land(), ReturnHome()]
        )

    at.fly(mission)
    taken = at.autopilot.mission
    off, speed, point, land, home = (taken[number] for number in range(5))
    assert (off["command"], off["frame"], off["z"], off["x"]) == (22, 3, 10.0, 454671168)
    assert (speed["command"], speed["frame"], speed["param2"]) == (178, 2, 3.0)
    assert (point["command"], point["param1"], point["param4"]) == (16, 2.0, 90.0)
    assert (land["command"], land["x"]) == (21, 454672168)
    assert (home["command"], home["frame"]) == (20, 2)


def test_a_mission_ends_when_its_last_place_is_reached(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> str:
        drone.wait_ready()
        drone.upload_mission([TakeOff(10), Waypoint(NEAR)])
        for after, number in ((5, 0), (20, 1)):
            at.after(after, lambda number=number: at.autopilot.say("MISSION_ITEM_REACHED", seq=number))
        drone.start_mission(within=60)
        return str(drone.mode)

    assert at.fly(mission) == "AUTO.MISSION"
    assert modes_asked(at.autopilot) == ["AUTO.MISSION"]
    assert at.autopilot.sent("MISSION_SET_CURRENT")


# -- as newer versions do it

PX4_1_17 = 0x011100FF


def unsteady_home(at: Any) -> None:
    """As PX4 1.17 in the first two minutes of a flight: home's altitude is corrected by noise."""
    noise = (0.0, 1.4, -0.9, 1.1, -1.3, 0.4, -1.2, 1.3)
    handle = at.kernel.every(
        300 * MS,
        lambda: setattr(at.autopilot, "home_up", noise[at.kernel.now() // (300 * MS) % len(noise)]),
    )
    at.after(300, handle.cancel)


def test_it_flies_by_heights_above_a_home_whose_altitude_is_corrected_all_the_time(bench: Make) -> None:
    at = bench()
    at.autopilot.version = PX4_1_17
    began: list[int] = []

    def mission(drone: Any) -> float:
        at.after(45, lambda: unsteady_home(at))
        drone.takeoff(10)
        sleep(at.kernel, 40 * S)
        drone.goto(NEAR)
        height = float(drone.altitude.metres)
        began.append(at.kernel.now())
        drone.return_home()
        return height

    assert at.fly(mission) == pytest.approx(12.0, abs=0.5)
    assert not at.craft.armed
    (returned,) = [
        when
        for when, frame in zip(at.autopilot.times, at.autopilot.received, strict=True)
        if frame.name == "COMMAND_LONG"
        and frame.fields["command"] == SET_MODE
        and frame.fields["param3"] == 5
    ]
    assert returned - began[0] < S


def test_a_take_off_ends_although_home_rises_meanwhile(bench: Make) -> None:
    at = bench()
    at.autopilot.version = PX4_1_17

    def mission(drone: Any) -> float:
        at.after(5, lambda: setattr(at.autopilot, "home_up", 1.9))
        drone.takeoff(5)
        return float(drone.altitude.metres)

    assert at.fly(mission) == pytest.approx(5.0, abs=0.3)


def test_a_home_that_was_just_moved_is_waited_for_and_one_that_moves_on_is_not(bench: Make) -> None:
    at = bench()
    at.autopilot.version = PX4_1_17
    began: list[int] = []

    def wander() -> None:
        latitude, longitude, altitude = at.autopilot.home
        at.autopilot.home = (latitude + 500, longitude, altitude)

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        handle = at.kernel.every(S, wander)
        sleep(at.kernel, 3 * S)
        began.append(at.kernel.now())
        try:
            drone.return_home()
        finally:
            handle.cancel()

    at.fly(mission)
    returned = next(
        when
        for when, frame in zip(at.autopilot.times, at.autopilot.received, strict=True)
        if frame.name == "COMMAND_LONG"
        and frame.fields["command"] == SET_MODE
        and frame.fields["param3"] == 5
    )
    assert 2 * S < returned - began[0] < 5 * S


def test_a_mission_that_is_complete_when_its_return_begins_is_not_over(bench: Make) -> None:
    at = bench()
    at.autopilot.version = PX4_1_17

    def complete() -> None:
        at.autopilot.mission_state = 5
        at.craft.landed_state = 2

    def mission(drone: Any) -> None:
        drone.wait_ready()
        drone.upload_mission([TakeOff(10), Waypoint(NEAR), ReturnHome()])
        at.after(3, lambda: setattr(at.craft, "landed_state", 2))
        at.after(20, complete)
        at.after(21, lambda: at.autopilot.enter(RTL))
        drone.start_mission(within=120)
        assert not drone.armed

    at.fly(mission)


@pytest.mark.parametrize("later", [0.0, 1.2])
def test_a_mission_of_another_station_that_ends_in_the_air(bench: Make, later: float) -> None:
    """The heartbeat with the mode that follows may come before the report that it is complete."""
    at = bench()
    at.autopilot.version = PX4_1_17

    def mission(drone: Any) -> str:
        drone.wait_ready()
        at.after(3, lambda: setattr(at.craft, "landed_state", 2))
        at.after(20, lambda: at.autopilot.enter(HOLD))
        at.after(20 + later, lambda: setattr(at.autopilot, "mission_state", 5))
        drone.start_mission(within=120)
        return str(drone.mode)

    assert at.fly(mission) == HOLD


def test_a_pilot_who_holds_a_mission_has_taken_over(bench: Make) -> None:
    at = bench()
    at.autopilot.version = PX4_1_17

    def mission(drone: Any) -> None:
        drone.wait_ready()
        at.after(3, lambda: setattr(at.craft, "landed_state", 2))
        at.after(20, lambda: at.autopilot.enter(HOLD))
        drone.start_mission(within=120)

    with pytest.raises(Overridden, match=r"changed from AUTO\.MISSION to AUTO\.LOITER"):
        at.fly(mission)
    assert at.kernel.now() < 40 * S


def test_a_version_that_no_rule_covers_is_said_and_flown_by_the_newest(bench: Make) -> None:
    at = bench()
    at.autopilot.version = 0x021E00FF
    at.craft.flags = 1023
    at.fly(up)
    (said,) = [text.text for text in at.recorded(Text) if "not covered" in text.text]
    assert said.startswith("PX4 2.30.0 is not covered by this driver, which knows 1.13 to 1.18")


def test_a_turn_of_attitude_states_the_yaw_rate_alone(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.set_attitude(pitch=-5, lasting=1)

    at.fly(mission)
    # with all three rates PX4 would take them as a set-point of their own
    assert {fields["type_mask"] for fields in at.autopilot.sent("SET_ATTITUDE_TARGET")} == {0b011}


# -- who is there


def test_an_ardupilot_is_named(bench: Make) -> None:
    at = bench()
    at.autopilot.firmware = 3
    with pytest.raises(LinkGarbled, match="an ArduPilot answers here, not a PX4"):
        at.fly(lambda drone: drone.wait_connected(within=5))


def test_firmware_that_is_too_old_is_named(bench: Make) -> None:
    at = bench()
    at.autopilot.version = 0x010903FF

    def later(drone: Any) -> None:
        sleep(at.kernel, 3 * S)
        drone.takeoff(10)

    for mission in (up, later):
        with pytest.raises(CapabilityError, match=r"PX4 1\.9\.3 flies here.*1\.12 or newer"):
            at.fly(mission)
    assert at.autopilot.commands() == []


def test_what_it_will_do_if_its_commander_falls_silent(bench: Make) -> None:
    at = bench()
    driver = at.vehicle._driver
    at.autopilot.parameters = {
        "COM_OF_LOSS_T": 1.0,
        "COM_OBL_RC_ACT": 0.0,
        "COM_RC_LOSS_T": 0.5,
        "NAV_RCL_ACT": 2.0,
        "COM_DL_LOSS_T": 10.0,
    }
    at.kernel.run(2 * S)
    assert driver.on_link_loss() == ""
    at.autopilot.parameters["NAV_DLL_ACT"] = 0.0
    at.kernel.run(10 * S)
    assert driver.on_link_loss() == (
        "it does not react (NAV_DLL_ACT=0): it flies to its last target and stays there; "
        "a velocity ends after 1 s in POSCTL, where it sinks unless a pilot moves the sticks; "
        "0.5 s after the last sticks it returns home"
    )
