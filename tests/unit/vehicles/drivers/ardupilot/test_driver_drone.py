"""Drone operations: the ArduPilot driver's sequences and the executor that runs them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import degrees
from typing import Any

import pytest

from rigs.missions import stabilize_by_idle_throttle
from volery.base.errors import (
    CapabilityError,
    Failsafe,
    LinkLost,
    NotArrived,
    OffTrack,
    OutOfBounds,
    Overridden,
    Refused,
    UsageError,
)
from volery.base.frames import quaternion_to_euler
from volery.base.position import AMSL, AboveGround, AboveHome, Ellipsoidal, Position
from volery.base.time import S
from volery.kernel.task import ExecutionContext
from volery.kernel.waiting import sleep
from volery.trace.events import LinkState, Operation, Text
from volery.vehicles import ChangeSpeed, Fence, Limits, ReturnHome, TakeOff, Waypoint, Zone
from volery.vehicles.driver import Step

Make = Callable[..., Any]
LATITUDE, LONGITUDE = -35.363261, 149.16523
ARM, TAKEOFF, SET_MODE, CHECKS, SPEED, YAW, START = 400, 22, 176, 401, 178, 115, 300
NEAR = Position(-35.3628, LONGITUDE, AboveHome(10.0))  # 51 m north


def up(drone: Any) -> None:
    drone.takeoff(10)


def test_a_mission_of_five_lines(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.goto(NEAR)
        drone.goto(Position(-35.3628, 149.1655, AMSL(596.0)), speed=4.0)
        drone.return_home()

    at.fly(mission)
    assert not at.craft.armed
    assert at.autopilot.commands() == [SET_MODE, ARM, TAKEOFF, SPEED, SET_MODE]
    operations = at.recorded(Operation)
    assert [(one.operation, one.outcome) for one in operations] == [
        ("takeoff", "ok"),
        ("goto", "ok"),
        ("goto", "ok"),
        ("return_home", "ok"),
    ]
    assert all(one.estimate_horizontal < 0.7 and one.estimate_vertical < 0.4 for one in operations[1:3])


def test_guided_targets_name_their_altitude(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.goto(NEAR)
        drone.goto(Position(-35.3628, LONGITUDE, AMSL(600.0)))

    at.fly(mission)
    first, *_, last = at.autopilot.sent("SET_POSITION_TARGET_GLOBAL_INT")
    assert (first["coordinate_frame"], first["alt"], first["type_mask"]) == (6, 10.0, 0x0DF8)
    assert (last["coordinate_frame"], last["alt"], last["lat_int"]) == (5, 600.0, -353628000)


def test_heartbeats_of_a_ground_station_with_the_id_that_may_send_manual_control(bench: Make) -> None:
    at = bench()
    at.kernel.run(10 * S)
    beats = [frame for frame in at.autopilot.received if frame.name == "HEARTBEAT"]
    assert len(beats) == 10  # the eleventh is on its way
    assert {(frame.system, frame.component, frame.fields["type"]) for frame in beats} == {(255, 190, 6)}


def test_streams_that_do_not_come_are_asked_for_again(bench: Make) -> None:
    at = bench()
    asked = at.autopilot
    asked.ignore = {511}
    at.kernel.run(2 * S)
    before = len(asked.sent("COMMAND_LONG"))
    asked.ignore = set()
    at.kernel.run(8 * S)
    assert before >= 6
    assert len(asked.streams) == 8
    settled = len(asked.sent("COMMAND_LONG"))
    at.kernel.run(30 * S)
    assert len(asked.sent("COMMAND_LONG")) == settled


def test_state_as_reported_by_the_autopilot(bench: Make) -> None:
    at = bench()

    def look(drone: Any) -> None:
        drone.takeoff(10)
        sleep(at.kernel, 2 * S)
        assert drone.armed
        assert drone.flying
        assert not drone.landed
        assert (drone.mode, drone.status) == ("GUIDED", "active")
        assert drone.altitude == AboveHome(10.0)
        assert drone.home.altitude == AMSL(584.0)
        assert drone.position.altitude == AMSL(594.0)
        assert drone.battery == (0.87, 12.6, 1.5)
        assert drone.ready

    at.fly(look)


# -- readiness and refusal


def test_takeoff_waits_until_it_is_ready(bench: Make) -> None:
    at = bench()
    at.craft.ekf = 167
    at.after(42, lambda: setattr(at.craft, "ekf", 831))
    at.fly(up)
    assert at.autopilot.commands()[-3:] == [SET_MODE, ARM, TAKEOFF]
    assert at.kernel.now() > 42 * S


def test_one_that_never_becomes_ready_is_quoted(bench: Make) -> None:
    at = bench()
    at.craft.health = 0

    def explain(command: int, fields: Any) -> None:
        if command == CHECKS:
            at.autopilot.text("PreArm: Compass not healthy", 2)

    at.autopilot.on_command = explain
    with pytest.raises(
        NotArrived, match=r"ready.*within 30 s.*PreArm: Compass not healthy.*arming checks fail"
    ):
        at.fly(lambda drone: drone.wait_ready(within=30))


def test_a_refusal_to_arm_quotes_the_texts_that_follow_it(bench: Make) -> None:
    at = bench()
    at.autopilot.refuse = {ARM: ["Arm: Gyros inconsistent", "Arm: Need Position Estimate"]}
    with pytest.raises(Refused, match="Arm: Gyros inconsistent; Arm: Need Position Estimate") as caught:
        at.fly(up)
    assert "refused to arm (FAILED)" in str(caught.value)
    assert at.recorded(Operation)[0].outcome == "Refused"


def test_a_refusal_without_a_reason(bench: Make) -> None:
    at = bench()
    at.autopilot.refuse = {TAKEOFF: []}
    with pytest.raises(Refused, match=r"refused to climb to 10 m \(FAILED\): gave no reason"):
        at.fly(up)


def test_an_answer_that_never_comes(bench: Make) -> None:
    at = bench()
    at.autopilot.ignore = {SET_MODE}
    with pytest.raises(NotArrived, match=r"change to GUIDED was not seen within 5 s.*never answered"):
        at.fly(up)
    assert at.autopilot.commands().count(SET_MODE) >= 4


def test_a_text_in_chunks_is_put_together(bench: Make) -> None:
    at = bench()
    long = "PreArm: the first part of a text that is longer than fifty characters"
    at.kernel.run(2 * S)
    at.autopilot.say("STATUSTEXT", severity=2, text=long[:50], id=7, chunk_seq=0)
    at.autopilot.say("STATUSTEXT", severity=2, text=long[50:], id=7, chunk_seq=1)
    at.kernel.run(3 * S)
    assert [said.text for said in at.recorded(Text) if said.severity == 2] == [long]


# -- undone before lift-off: started over; in the air: never fought


def test_a_takeoff_that_is_undone_before_lift_off_is_started_over(bench: Make) -> None:
    at = bench()
    undone: list[int] = []

    def meddle(command: int, fields: Any) -> None:
        if command == TAKEOFF and len(undone) < 2:
            undone.append(1)
            at.after(0.5, lambda: at.autopilot.enter("STABILIZE"))

    at.autopilot.on_command = meddle
    at.fly(up)
    assert at.autopilot.commands() == [SET_MODE, ARM, TAKEOFF, SET_MODE, TAKEOFF, SET_MODE, TAKEOFF]


def test_a_disarm_before_lift_off_is_started_over_at_most_three_times(bench: Make) -> None:
    at = bench()

    def disarm(command: int, fields: Any) -> None:
        if command == TAKEOFF:
            at.after(0.5, lambda: setattr(at.craft, "armed", False))

    at.autopilot.on_command = disarm
    at.autopilot.climb_s = 60
    with pytest.raises(
        Overridden, match="was disarmed in GUIDED before lift-off, each time it was started over"
    ):
        at.fly(up)
    assert at.autopilot.commands().count(TAKEOFF) == 4


def test_a_pilot_who_takes_over_in_the_air_is_not_fought(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.autopilot.ignore = {SET_MODE}
        at.craft.velocity = (5.0, 0.0, 0.0)  # it never stands
        at.after(5, lambda: at.autopilot.enter("LOITER"))
        with pytest.raises(Overridden, match=r"changed from GUIDED to LOITER \(status active\).*to GUIDED"):
            drone.goto(NEAR)
        before = len(at.autopilot.received)
        with pytest.raises(Overridden, match=r"is in LOITER.*switch the vehicle to GUIDED"):
            drone.goto(NEAR)
        with pytest.raises(Overridden):
            drone.land()
        assert drone.come_to_rest() == "is left to the pilot or station in LOITER"
        assert not [f for f in at.autopilot.received[before:] if f.name not in {"HEARTBEAT"}]

    at.fly(mission)


def test_a_vehicle_that_is_handed_back_is_flown_again(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.autopilot.enter("LOITER")
        sleep(at.kernel, S)
        with pytest.raises(Overridden):
            drone.goto(NEAR)
        at.autopilot.enter("GUIDED")
        sleep(at.kernel, S)
        drone.goto(NEAR)

    at.fly(mission)


def test_a_failsafe_is_distinguished_and_quoted(bench: Make) -> None:
    at = bench()

    def strike() -> None:
        at.craft.status = 5
        at.autopilot.enter("RTL")
        at.autopilot.text("GCS Failsafe", 4)

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.craft.velocity = (5.0, 0.0, 0.0)
        at.after(3, strike)
        with pytest.raises(Failsafe, match=r"from GUIDED to RTL \(status critical\).*'GCS Failsafe'"):
            drone.goto(NEAR)
        with pytest.raises(Failsafe):
            drone.goto(NEAR)

    at.fly(mission)


def test_a_failsafe_that_stopped_it_is_ended_by_an_order_of_safety(bench: Make) -> None:
    """As FS_GCS_ENABLE 7 does; ``land`` was refused on 4.8, and nothing else would have ended the hover."""
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.craft.status = 5
        at.autopilot.enter("BRAKE")
        sleep(at.kernel, S)
        with pytest.raises(Failsafe, match="is in BRAKE"):
            drone.goto(NEAR)
        at.craft.status = 4  # the ground station is back
        sleep(at.kernel, 2 * S)
        drone.land()

    at.fly(mission)
    assert (at.craft.mode, at.craft.armed) == ("LAND", False)


def test_brake_of_another_station_is_no_failsafe(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.autopilot.enter("BRAKE")
        sleep(at.kernel, S)
        with pytest.raises(Overridden, match="is in BRAKE"):
            drone.land()

    at.fly(mission)


def test_guided_is_not_commanded_over_a_failsafe_that_took_our_own_mode(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.manual_control(0, 0, 0.5, 0)
        drone.altitude_hold()
        at.craft.status = 5
        at.autopilot.enter("ALT_HOLD")
        sleep(at.kernel, S)
        with pytest.raises(Failsafe, match="is in a failsafe, in ALT_HOLD"):
            drone.goto(NEAR)
        at.autopilot.received.clear()
        sleep(at.kernel, S)
        assert at.autopilot.sent("RC_CHANNELS_OVERRIDE")[-1]["chan3_raw"] == 1500  # else it would sink

    at.fly(mission)
    assert at.craft.mode == "ALT_HOLD"


def test_a_disarm_in_the_air_ends_the_call(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.craft.velocity = (5.0, 0.0, 0.0)
        at.after(3, lambda: setattr(at.craft, "armed", False))
        drone.goto(NEAR)

    with pytest.raises(Overridden, match="was disarmed in GUIDED"):
        at.fly(mission)


# -- the link


def test_a_link_that_falls_silent_in_flight(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.craft.velocity = (5.0, 0.0, 0.0)
        at.after(3, lambda: setattr(at.autopilot, "mute", True))
        drone.goto(NEAR)

    with pytest.raises(
        LinkLost, match=r"no message was received for 5\.\d s.*last: at -35.*mode GUIDED, armed"
    ):
        at.fly(mission)
    assert [state.state for state in at.recorded(LinkState)] == ["silent"]


def test_a_link_that_returns_in_flight_is_as_if_nothing_had_happened(bench: Make) -> None:
    at = bench()

    def silence(yes: bool) -> None:
        at.autopilot.mute = at.autopilot.deaf = yes

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        silence(True)
        at.after(4, lambda: silence(False))
        drone.goto(NEAR)

    at.fly(mission)
    assert [state.state for state in at.recorded(LinkState)] == ["silent", "back"]
    assert at.craft.north == pytest.approx(51.1, abs=0.2)


def test_nothing_is_done_to_a_vehicle_whose_link_is_lost(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> str:
        drone.takeoff(10)
        at.autopilot.mute = True
        sleep(at.kernel, 10 * S)
        at.after(10, lambda: setattr(at.autopilot, "mute", False))
        return str(drone.come_to_rest())

    assert at.fly(mission) == "landed"


# -- bounds


@pytest.mark.parametrize(
    ("goal", "says"),
    [
        (Position(-35.3628, LONGITUDE, AboveHome(-5)), "underground"),
        (
            Position(-35.3628, LONGITUDE, AMSL(10)),
            r"underground.*did you mean AboveHome\(10\)\? Home is 584 m",
        ),
        (Position(-35.3628, LONGITUDE, AboveHome(150)), "150 m above home asked, but the limit is 120 m"),
        (Position(-35.3628, LONGITUDE, AboveHome(640)), r"did you mean AMSL\(640\)\? Home is 584 m AMSL"),
        (Position(-35.3628, LONGITUDE, AMSL(800)), "216.0 m above home"),
        (Position(-35.2, LONGITUDE, AboveHome(10)), "18.1 km from home, but the limit is 10 km"),
        (Position(-35.3628, 149.1660, AboveHome(10)), "goal is outside the fence"),
        (Position(-35.3610, LONGITUDE, AboveHome(10)), "no-fly zone 'school'"),
    ],
)
def test_goals_out_of_bounds_are_refused_before_anything_moves(
    bench: Make, goal: Position, says: str
) -> None:
    school = Zone(
        "school", ((-35.3620, 149.1648), (-35.3620, 149.1656), (-35.3615, 149.1656), (-35.3615, 149.1648))
    )
    inside = ((-36.0, 149.164), (-36.0, 149.1658), (-35.0, 149.1658), (-35.0, 149.164))
    at = bench(fence=Fence(polygon=inside, no_fly=(school,)))

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.autopilot.received.clear()
        with pytest.raises(OutOfBounds, match=says):
            drone.goto(goal)
        assert not at.autopilot.sent("SET_POSITION_TARGET_GLOBAL_INT")

    at.fly(mission)


def test_a_velocity_that_would_leave_the_fence(bench: Make) -> None:
    at = bench(fence=Fence(ceiling=AboveHome(12)))

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.set_velocity(up=0.5)
        with pytest.raises(OutOfBounds, match="above the fence's ceiling"):
            drone.set_velocity(up=1.0)
        drone.set_velocity(up=-5.0)  # the ground stops it

    at.fly(mission)


def test_a_takeoff_into_a_no_fly_zone(bench: Make) -> None:
    over = Zone("balloon", ((-36, 149), (-36, 150), (-35, 150), (-35, 149)), floor=AboveHome(5))
    at = bench(fence=Fence(no_fly=(over,)))
    with pytest.raises(OutOfBounds, match="no-fly zone 'balloon'"):
        at.fly(up)
    assert not at.craft.armed


def test_a_takeoff_higher_than_the_limit(bench: Make) -> None:
    with pytest.raises(OutOfBounds, match="130 m above home asked, but the limit is 120"):
        bench().fly(lambda drone: drone.takeoff(130))
    bench(limits=Limits(highest=200)).fly(lambda drone: drone.takeoff(130))


def test_coordinates_off_the_globe() -> None:
    with pytest.raises(UsageError, match=r"latitude 465.4 is off the globe"):
        Position(465.4, 0.0, AMSL(0))


@pytest.mark.parametrize("altitude", [Ellipsoidal(600), AboveGround(20)])
def test_altitudes_that_it_cannot_fly_to(bench: Make, altitude: Any) -> None:
    def mission(drone: Any) -> None:
        drone.takeoff(10)
        with pytest.raises(CapabilityError):
            drone.goto(Position(-35.3628, LONGITUDE, altitude))

    bench().fly(mission)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda drone: drone.takeoff(-1), "above 0"),
        (lambda drone: drone.manual_control(2, 0, 0.5, 0), "pitch=2; it goes from -1 to 1"),
        (lambda drone: drone.manual_control(0, 0, -0.5, 0), "throttle=-0.5; it goes from 0 to 1"),
        (lambda drone: drone.upload_mission([]), "empty mission"),
    ],
)
def test_calls_that_make_no_sense(bench: Make, call: Callable[[Any], None], says: str) -> None:
    with pytest.raises(UsageError, match=says):
        bench().fly(call)


def test_on_the_ground_one_cannot_go(bench: Make) -> None:
    with pytest.raises(Refused, match=r"on the ground; takeoff\(height\) first"):
        bench().fly(lambda drone: (drone.wait_ready(), drone.goto(NEAR)))


def test_in_the_air_one_cannot_take_off(bench: Make) -> None:
    with pytest.raises(Refused, match=r"it flies already, 10.0 m above home"):
        bench().fly(lambda drone: (drone.takeoff(10), drone.takeoff(12)))


def test_two_tasks_do_not_command_one_vehicle(bench: Make) -> None:
    at = bench()
    errors: list[str] = []

    def second() -> None:
        try:
            at.vehicle.disarm()
        except UsageError as error:
            errors.append(str(error))

    at.kernel.run(2 * S)
    at.kernel.call_at(4 * S, lambda: at.kernel.spawn(second, "second", ExecutionContext("second")))
    at.fly(up)
    assert errors == ["craft_1: disarm: mission has takeoff under way"]


# -- velocities, sticks


def test_a_velocity_lasts_and_then_it_stops(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.set_velocity(north=3.0, up=-1.0, yaw_rate=10.0, lasting=2.0)
        sleep(at.kernel, 5 * S)

    at.fly(mission)
    sent = at.autopilot.sent("SET_POSITION_TARGET_LOCAL_NED")
    assert len(sent) == 11  # at once and each 200 ms for 2 s, and the stop
    assert (sent[0]["vx"], sent[0]["vz"], sent[0]["type_mask"]) == (3.0, 1.0, 0x05C7)
    assert sent[0]["yaw_rate"] == pytest.approx(0.1745, abs=1e-4)
    assert (sent[-1]["vx"], sent[-1]["vz"]) == (0.0, 0.0)


def test_a_velocity_lasts_in_seconds_of_a_vehicle_that_is_thrice_as_fast(bench: Make) -> None:
    at = bench()
    at.autopilot.clock_rate, at.autopilot.follows = 3.0, True

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        sleep(at.kernel, 6 * S)
        drone.set_velocity(north=3.0, lasting=6.0)
        sleep(at.kernel, 9 * S)

    at.fly(mission)
    sent = at.autopilot.sent("SET_POSITION_TARGET_LOCAL_NED")
    assert len(sent) == 11  # each 200 ms for 2 s of the program, and the stop
    assert sent[-1]["vx"] == 0.0


def test_hold_stops_and_stays(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.craft.velocity = (4.0, 0.0, 0.0)
        sleep(at.kernel, S)
        at.after(3, lambda: setattr(at.craft, "velocity", (0.0, 0.0, 0.0)))
        drone.hold()

    at.fly(mission)
    assert len(at.autopilot.sent("SET_POSITION_TARGET_LOCAL_NED")) >= 15
    assert at.autopilot.sent("SET_POSITION_TARGET_GLOBAL_INT")[-1]["alt"] == 10.0


def test_turning(bench: Make) -> None:
    at = bench()
    at.fly(lambda drone: (drone.takeoff(10), drone.set_heading(-90)))
    assert at.craft.heading == 270.0


def test_sticks_are_refreshed_and_let_go_once_guided_is_seen(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.manual_control(pitch=0.5, roll=-0.2, throttle=0.6, yaw=0.1)
        drone.altitude_hold()
        sleep(at.kernel, 10 * S)
        held = at.autopilot.sent("RC_CHANNELS_OVERRIDE")
        assert len(held) >= 50
        assert [held[-1][f"chan{number}_raw"] for number in range(1, 6)] == [1400, 1250, 1600, 1550, 65535]
        drone.goto(NEAR)

    at.fly(mission)
    assert [
        at.autopilot.sent("RC_CHANNELS_OVERRIDE")[-1][f"chan{number}_raw"] for number in (1, 2, 3, 4)
    ] == [0] * 4
    frames = [frame.name for frame in at.autopilot.received]
    guided = max(i for i, f in enumerate(at.autopilot.received) if f.fields.get("command") == SET_MODE)
    assert "RC_CHANNELS_OVERRIDE" in frames[guided:]  # let go after the change, not before


def test_sticks_are_let_go_when_a_pilot_takes_over(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.manual_control(0, 0, 0.5, 0)
        drone.altitude_hold()
        sleep(at.kernel, S)
        at.autopilot.enter("LOITER")
        sleep(at.kernel, S)
        at.autopilot.received.clear()
        sleep(at.kernel, 3 * S)
        assert not at.autopilot.sent("RC_CHANNELS_OVERRIDE")
        with pytest.raises(Overridden):
            drone.manual_control(0, 0, 0.5, 0)

    at.fly(mission)


def test_stabilize_with_an_idle_throttle_in_the_air_is_refused(bench: Make) -> None:
    at = bench()

    with pytest.raises(UsageError, match="the motors would idle and it would fall"):
        at.fly(stabilize_by_idle_throttle)
    assert at.craft.mode == "GUIDED"


def test_stabilize_from_the_ground_arms_with_the_sticks_held(bench: Make) -> None:
    at = bench()
    at.fly(lambda drone: (drone.manual_control(0, 0, 0, 0), drone.stabilize()))
    assert at.autopilot.sent("RC_CHANNELS_OVERRIDE")[0]["chan3_raw"] == 1000
    assert (at.craft.mode, at.craft.armed) == ("STABILIZE", True)
    assert at.autopilot.commands() == [ARM]


# -- missions


def test_a_mission_is_uploaded_and_carried_out(bench: Make) -> None:
    at = bench()
    items = [TakeOff(10), ChangeSpeed(4), Waypoint(NEAR, stay_s=2, heading=90), ReturnHome()]

    def on_command(command: int, fields: Any) -> None:
        if command == START:
            at.after(2, lambda: at.autopilot.craft.__setattr__("landed_state", 2))
            at.after(30, lambda: at.autopilot.craft.__setattr__("landed_state", 1))
            at.after(31, lambda: setattr(at.craft, "armed", False))

    at.autopilot.on_command = on_command
    at.fly(lambda drone: (drone.wait_ready(), drone.upload_mission(items), drone.start_mission()))
    uploaded = [at.autopilot.mission[number] for number in range(6)]
    assert [item["command"] for item in uploaded] == [16, 22, 178, 115, 16, 20]
    assert (uploaded[4]["frame"], uploaded[4]["x"], uploaded[4]["z"]) == (3, -353628000, 10.0)
    assert at.autopilot.commands()[-5:] == [SET_MODE, ARM, SET_MODE, START][-5:]


def test_a_mission_that_ends_in_the_air_ends_at_its_last_point(bench: Make) -> None:
    at = bench()

    def on_command(command: int, fields: Any) -> None:
        if command == START:
            at.after(5, lambda: at.autopilot.say("MISSION_ITEM_REACHED", seq=1))
            at.after(9, lambda: at.autopilot.say("MISSION_ITEM_REACHED", seq=2))

    at.autopilot.on_command = on_command
    at.fly(
        lambda drone: (
            drone.wait_ready(),
            drone.upload_mission([TakeOff(10), Waypoint(NEAR)]),
            drone.start_mission(),
        )
    )
    assert at.craft.armed


def test_a_mission_out_of_bounds_names_the_item(bench: Make) -> None:
    far = Waypoint(Position(-35.2, LONGITUDE, AboveHome(10)))
    with pytest.raises(OutOfBounds, match=r"mission item 2 \(Waypoint\): .*18\.1 km"):
        bench().fly(lambda drone: (drone.wait_ready(), drone.upload_mission([TakeOff(10), far])))


# -- the end


def test_the_end_of_a_program_lands_it(bench: Make) -> None:
    at = bench()
    assert at.fly(lambda drone: (drone.takeoff(10), drone.come_to_rest())[1]) == "landed"
    assert not at.craft.armed


def test_the_end_of_a_program_disarms_it_on_the_ground(bench: Make) -> None:
    at = bench()
    assert at.fly(lambda drone: (drone.arm(), drone.come_to_rest())[1]) == "was disarmed on the ground"
    assert not at.craft.armed


@pytest.mark.parametrize("interruption", [KeyboardInterrupt, SystemExit])
def test_one_that_armed_at_the_moment_of_an_interruption_is_disarmed(
    bench: Make, interruption: type[BaseException]
) -> None:
    """The heartbeat that shows it comes after the program has begun to end."""
    at = bench()

    def mission(drone: Any) -> str:
        drone.wait_ready()
        send = drone._driver.arm()[0].send

        def interrupted() -> None:
            send()
            raise interruption

        drone._driver.arm = lambda: [Step(ask="arm", send=interrupted, done=lambda _: False, within=S)]
        with pytest.raises(interruption):
            drone.arm()
        assert not drone._driver.telemetry.armed
        return str(drone.come_to_rest())

    assert at.fly(mission) == "was disarmed on the ground"
    assert not at.craft.armed


def test_at_the_end_of_a_program_sticks_are_held_until_it_lands(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> str:
        drone.takeoff(10)
        drone.manual_control(0, 0, 0.5, 0)
        drone.stabilize()
        at.autopilot.received.clear()
        return str(drone.come_to_rest())

    assert at.fly(mission) == "landed"
    order = [f.name if f.name != "COMMAND_LONG" else str(f.fields["command"]) for f in at.autopilot.received]
    released = [n for n, f in enumerate(at.autopilot.received) if f.fields.get("chan3_raw") == 0]
    assert order.index(str(SET_MODE)) < released[0]


def test_the_end_of_a_program_whose_task_has_not_gone_yet(bench: Make) -> None:
    """The safety task may land it although the operation that is being ended has not unwound."""
    at = bench()
    scope = at.kernel.root.child("users")
    at.kernel.spawn(
        lambda: (at.vehicle.takeoff(10), at.vehicle.goto(NEAR)), "user", ExecutionContext("user"), scope
    )
    at.craft.velocity = (5.0, 0.0, 0.0)
    at.kernel.run(20 * S)
    at.kernel.cancel(scope, "end")
    assert at.fly(lambda drone: drone.come_to_rest()) == "landed"
    assert [one.outcome for one in at.recorded(Operation)][-2:] == ["Cancelled", "ok"]


def test_true_errors_are_recorded_where_the_truth_is_known(bench: Make) -> None:
    at = bench(truth=lambda: Position(-35.3628, LONGITUDE, AMSL(595.5)))
    at.fly(lambda drone: (drone.takeoff(10), drone.goto(NEAR)))
    goto = at.recorded(Operation)[-1]
    assert goto.true_horizontal == pytest.approx(0.0, abs=1e-6)
    assert goto.true_vertical == pytest.approx(1.5)


def test_an_attitude_states_all_body_rates_or_none(bench: Make) -> None:
    """ArduCopter from 4.6 on stops if only one is stated; 4.5 takes all three as well."""
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.set_attitude(pitch=-5, yaw_rate=20, lasting=1)
        sleep(at.kernel, 2 * S)
        drone.set_attitude(pitch=-5, heading=90, lasting=1)

    at.fly(mission)
    sent = {
        (fields["type_mask"], fields.get("body_roll_rate", 0.0), round(fields["body_yaw_rate"], 3))
        for fields in at.autopilot.sent("SET_ATTITUDE_TARGET")
    }
    assert sent == {(0b000, 0.0, 0.349), (0b111, 0.0, 0.0)}


@pytest.mark.parametrize(("version", "turned"), [(0x04060300, 0.0), (0x04080000, 16.0)])
def test_the_heading_beside_a_yaw_rate_is_integrated_where_it_is_not_fed_forward(
    bench: Make, version: int, turned: float
) -> None:
    """ArduCopter from 4.7 on turns from the heading of the last message; the measured one draws it back."""
    at = bench()
    at.autopilot.version = version

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.set_attitude(pitch=-5, yaw_rate=8, lasting=2)
        sleep(at.kernel, 4 * S)
        drone.set_attitude(pitch=-5, yaw_rate=-90, lasting=2)
        sleep(at.kernel, 2 * S)

    at.fly(mission)
    stated = [
        (fields["body_yaw_rate"] > 0, degrees(quaternion_to_euler(fields["q"])[2]))
        for fields in at.autopilot.sent("SET_ATTITUDE_TARGET")
    ]
    clockwise = [heading for right, heading in stated if right]
    back = [heading for right, heading in stated if not right]
    assert clockwise[-1] - clockwise[0] == pytest.approx(turned, abs=2.0)
    assert min(back) - back[0] == pytest.approx(-20.0 if turned else 0.0, abs=0.1)


def test_an_attitude_that_is_not_followed_is_an_error(bench: Make) -> None:
    """As ArduCopter 4.6 did with a single body rate: it held its place, and nothing was said."""
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.set_attitude(pitch=-10, lasting=6)
        sleep(at.kernel, 5 * S)
        drone.set_attitude(pitch=-10, lasting=6)

    with pytest.raises(
        OffTrack, match=r"does not follow its set-points: in 3 s a lean of .* it was commanded to hold"
    ):
        at.fly(mission)


def test_options_of_the_driver(bench: Make) -> None:
    at = bench(options={"rate": "5", "attitude": "2"})
    at.kernel.run(2 * S)
    asked = {f["param1"]: f["param2"] for f in at.autopilot.sent("COMMAND_LONG")}
    assert asked[33] == 200_000.0
    assert asked[30] == 500_000.0
    for wrong in ({"rate": "0"}, {"system": "0"}, {"speed": "3"}):
        with pytest.raises(UsageError):
            bench(options=wrong)


def test_a_mode_that_is_refused_leaves_the_one_before_ours(bench: Make) -> None:
    """Flown by hand, GUIDED refused: the program still has it, and brings it down in the end."""
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.manual_control(0, 0, 0.5, 0)
        drone.altitude_hold()
        obeys, at.autopilot.refuse = at.autopilot.refuse, {SET_MODE: ["Mode change to GUIDED failed"]}
        with pytest.raises(Refused, match="failed"):
            drone.goto(NEAR)
        at.autopilot.refuse = obeys
        assert drone.mode == "ALT_HOLD"
        drone.manual_control(0, 0, 0.5, 0)
        assert drone.come_to_rest() == "landed"

    at.fly(mission)


def test_a_turn_ends_when_the_heading_stays_and_not_when_it_first_passes(bench: Make) -> None:
    at = bench()

    def swing(command: int, _: dict[str, Any]) -> None:
        if command == YAW:
            for seconds, heading in ((0.0, 90.0), (0.6, 104.0), (1.2, 82.0), (1.8, 90.0)):
                at.after(seconds, partial(setattr, at.craft, "heading", heading))

    def mission(drone: Any) -> float:
        drone.takeoff(10)
        at.autopilot.on_command = swing
        began = at.kernel.now()
        drone.set_heading(90)
        return float(at.kernel.now() - began) / S

    assert at.fly(mission) > 2.5
