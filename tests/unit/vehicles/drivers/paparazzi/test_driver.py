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
from volery.links.frame import Frame
from volery.trace.events import Operation, Text
from volery.vehicles import Capability
from volery.vehicles.driver import Waypoint

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
    at.autopilot._setting, write = (
        lambda f: (order.append(f"setting {f['value']:g}"), write(f)),
        at.autopilot._setting,
    )
    at.autopilot._block, block = (
        lambda f: (order.append(f"block {f['block_id']}"), block(f)),
        at.autopilot._block,
    )
    at.fly(after_takeoff(lambda drone: drone.land()))
    assert order.index("block 13") < len(order) - 1 - order[::-1].index("setting 13")


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
    first = at.autopilot.sent("RC_UP")[0]
    assert tuple(first["channels"]) == (-127, -64, 127, 64, 127, 127, 0, 0, 0, 0, 0)
    assert len(at.autopilot.sent("RC_UP")) >= 30
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


@pytest.mark.parametrize("mode", ["KILL", "GUIDED", "HOME"])
def test_it_is_armed_by_way_of_nav(bench: Make, mode: str) -> None:
    """In GUIDED it lifts off as soon as its motors run: seen up to 3.2 m."""
    at = bench()
    at.craft.mode = mode
    at.fly(lambda drone: drone.arm())
    assert (at.craft.mode, at.craft.armed, at.craft.flying) == ("NAV", True, False)
    assert 19.0 not in at.autopilot.written("mode")
    assert at.autopilot.sent("BLOCK")[-1]["block_id"] == 3


def test_in_a_block_that_flies_it_is_armed_by_the_block_that_starts_motors(bench: Make) -> None:
    at = bench()
    at.craft.block = 5
    at.fly(lambda drone: drone.arm())
    assert at.craft.armed
    assert at.autopilot.written("kill_throttle") == []
    assert at.craft.block == 3


def test_far_from_home_it_is_not_armed_in_guided(bench: Make) -> None:
    at = bench()
    at.craft.mode, at.craft.north = "GUIDED", 170.0

    def mission(drone: Any) -> None:
        drone.wait_ready()
        drone.arm()

    with pytest.raises(Refused, match=r"it would lift off, in NAV fly home; takeoff\(height\) instead"):
        at.fly(mission)
    assert not at.craft.armed


def test_without_a_fix_it_is_not_armed(bench: Make) -> None:
    """The real one starts its motors, enters FAILSAFE and then KILL within a second."""
    at = bench()
    at.craft.fix = "NO_FIX"
    with pytest.raises(Refused, match=r"no 3D fix \(no_fix\): it would stop its motors again"):
        at.fly(lambda drone: drone.arm())
    assert at.autopilot.sent("SETTING") == []


def test_arming_that_ends_in_failsafe_is_no_success(bench: Make) -> None:
    at = bench()
    motors = at.autopilot._motors

    def fail(on: bool) -> None:
        motors(on)
        at.autopilot.enter("FAILSAFE")

    at.autopilot._motors = fail
    with pytest.raises(Overridden, match="changed from NAV to FAILSAFE"):
        at.fly(lambda drone: drone.arm())


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


@pytest.mark.parametrize("order", ["wait_ready", "arm", "land", "disarm", "takeoff"])
def test_nothing_is_written_to_an_aircraft_that_is_not_described(bench: Make, order: str) -> None:
    """Its values fit by chance: the real stock rotorcraft's auto2 showed 13, as the mode does."""
    at = bench()
    at.autopilot.fingerprint = (253, 79, 76, 36, 60, 136, 150, 84, 76, 127, 159, 82, 73, 123, 111, 33)
    at.craft.armed = order == "land"
    with pytest.raises((NotArrived, CapabilityError), match="give its own XML: aircraft=var/aircrafts/NAME"):
        at.fly(lambda drone: getattr(drone, order)(*([5.0] if order == "takeoff" else [])))
    assert at.autopilot.sent("SETTING") == []
    assert at.autopilot.sent("BLOCK") == []


def test_without_a_fingerprint_nothing_is_written(bench: Make) -> None:
    at = bench()
    at.autopilot.silenced = {"ALIVE"}
    with pytest.raises(NotArrived):
        at.fly(lambda drone: drone.arm())
    assert at.autopilot.sent("SETTING") == []


def generated(folder: Path) -> str:
    """XML of the structure that the build of an aircraft generates: kill_throttle has no short name."""
    (folder / "conf").mkdir()
    (folder / "settings.xml").write_text(
        """<settings target="sim"><dl_settings name="x">
        <dl_settings name="Telemetry"><dl_setting var="telemetry_mode_Main" max="9"/></dl_settings>
        <dl_settings name="gps"><dl_setting var="gps.mode" min="0" max="3" step="1"/></dl_settings>
        <dl_settings name="System">
          <dl_setting var="autopilot_mode_auto2" shortname="auto2" min="0" max="19" step="1"/>
          <dl_setting var="autopilot.kill_throttle" min="0" max="1" step="1" module="autopilot"/>
          <dl_setting var="autopilot.mode" shortname="mode" min="0" max="19" step="1" module="autopilot"/>
        </dl_settings></dl_settings></settings>"""
    )
    begin = ["Wait GPS", "Geo init", "Holding point", "Start Engine", "Takeoff", "Standby"]
    names = [*begin, *(f"tour {number}" for number in range(7)), "land here", "land", "flare", "landed"]
    blocks = "".join(f'<block no="{number}" name="{name}"/>' for number, name in enumerate(names))
    (folder / "flight_plan.xml").write_text(
        f"""<dump><flight_plan max_dist_from_home="150">
        <waypoints><waypoint name="HOME" x="0" y="0"/></waypoints>
        <blocks>{blocks}</blocks></flight_plan></dump>"""
    )
    (folder / "conf" / "conf_aircraft.xml").write_text('<conf><aircraft name="Bee"/></conf>')
    return str(folder)


OWN_NUMBERS = {0: "telemetry", 1: "gps", 2: "auto2", 3: "kill_throttle", 4: "mode"}


def test_an_aircraft_with_its_own_xml_flies_and_stops_its_motors(bench: Make, tmp_path: Path) -> None:
    at = bench(options={"aircraft": generated(tmp_path)})
    at.autopilot.numbers, at.autopilot.fingerprint = OWN_NUMBERS, tuple(range(16))

    def mission(drone: Any) -> None:
        drone.arm()
        drone.disarm()
        drone.takeoff(10)
        drone.goto(Position(LATITUDE + 250.0 / 111_106.0, LONGITUDE, AboveHome(12.0)))
        drone.land()

    at.fly(mission)
    assert at.autopilot.written("telemetry") + at.autopilot.written("gps") == []
    assert 19.0 in at.autopilot.written("mode")
    assert at.autopilot.written("kill_throttle")[0] == 0.0
    assert (at.craft.armed, at.craft.up) == (False, 0.0)


@pytest.mark.parametrize("setting", ["autopilot.kill_throttle", 'autopilot.mode" shortname="mode'])
def test_a_setting_that_is_missing_is_an_error_before_anything_is_sent(
    bench: Make, tmp_path: Path, setting: str
) -> None:
    folder = generated(tmp_path)
    file = tmp_path / "settings.xml"
    file.write_text(file.read_text().replace(setting, "unrelated").replace("gps.mode", "gps.state"))
    with pytest.raises(UsageError, match=r"no setting '(kill_throttle|mode)'"):
        bench(options={"aircraft": folder})


def test_a_generated_autopilot_with_modes_of_its_own_is_refused(bench: Make, tmp_path: Path) -> None:
    """Its number 5 is FAILSAFE: the numbers of the static autopilot would select something else."""
    folder = generated(tmp_path)
    file = tmp_path / "settings.xml"
    modes = 'values="DIRECT|Z_HOLD|MODULE|NAV|HOME|FAILSAFE|KILL" header="autopilot_generated"'
    file.write_text(file.read_text().replace("</settings>", f'<dl_setting var="ap" {modes}/></settings>'))
    with pytest.raises(UsageError, match=r"generated autopilot.*\(DIRECT, Z_HOLD, MODULE, NAV, HOME"):
        bench(options={"aircraft": folder})


def test_xml_of_another_aircraft_is_noticed(bench: Make, tmp_path: Path) -> None:
    at = bench(options={"aircraft": generated(tmp_path)})
    at.autopilot.numbers = dict.fromkeys(range(6), "gain")
    with pytest.raises((NotArrived, CapabilityError)):
        at.fly(lambda drone: drone.wait_ready())
    assert at.autopilot.sent("SETTING") == []
    assert "setting 4 of this aircraft is not 'mode'" in str(at.vehicle._driver.problem())


# -- a position that counts for nothing


@pytest.mark.parametrize("order", ["goto", "hold", "set_velocity", "set_heading", "return_home"])
def test_without_a_fix_nothing_is_flown_by_position(bench: Make, order: str) -> None:
    """The real one went 680 m away in a goto() without a fix; hold() was ok after 0.01 s."""
    at = bench()
    arguments: dict[str, tuple[Any, ...]] = {"goto": (NEAR,), "set_velocity": (1.0,), "set_heading": (90.0,)}

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.craft.fix = "NO_FIX"
        sleep(at.kernel, 2 * S)
        before = len(at.autopilot.sent("GUIDED_SETPOINT_NED"))
        with pytest.raises(
            Refused, match=r"no 3D fix \(no_fix\), its position counts for nothing; land\(\) needs"
        ):
            getattr(drone, order)(*arguments.get(order, ()))
        assert len(at.autopilot.sent("GUIDED_SETPOINT_NED")) == before

    at.fly(mission)


def test_a_fix_lost_on_the_way_is_an_error_within_two_seconds(bench: Make) -> None:
    at = bench()
    began: list[int] = []

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.autopilot._guided_setpoint_ned = lambda fields: None  # it does not arrive
        at.after(4.0, lambda: (setattr(at.craft, "fix", "NO_FIX"), began.append(at.kernel.now())))
        drone.goto(NEAR)

    with pytest.raises(NotArrived, match="it has no 3D fix"):
        at.fly(mission)
    ended = at.recorded(Operation)[-1].end
    assert ended - began[0] < 2 * S


def test_a_position_that_is_no_longer_sent_is_reported_within_seconds(bench: Make) -> None:
    """Another station may choose a telemetry mode without it, while all other messages go on."""
    at = bench()
    began: list[int] = []

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.autopilot._guided_setpoint_ned = lambda fields: None
        at.autopilot.silenced = {"ROTORCRAFT_FP", "ROTORCRAFT_NAV_STATUS"}
        began.append(at.kernel.now())
        drone.goto(NEAR)

    with pytest.raises(NotArrived, match=r"ROTORCRAFT_FP\) is not sent any more.*look at its telemetry mode"):
        at.fly(mission)
    assert at.recorded(Operation)[-1].end - began[0] < 6 * S


def test_it_lands_although_position_and_block_are_no_longer_sent(bench: Make) -> None:
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.autopilot.silenced = {"ROTORCRAFT_FP", "ROTORCRAFT_NAV_STATUS"}
        sleep(at.kernel, 5 * S)
        drone.land()

    at.fly(mission)
    assert (at.craft.armed, at.craft.up) == (False, 0.0)


# -- a failsafe that keeps its height, as of version 6.2


def keep_height(at: Any) -> None:
    sink = at.autopilot._sink
    at.autopilot._sink = lambda then: sink(then) if at.craft.mode != "FAILSAFE" else None


def test_a_failsafe_that_does_not_sink_is_landed_by_sticks(bench: Make) -> None:
    at = bench()
    keep_height(at)

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.craft.fix = "NO_FIX"
        sleep(at.kernel, 2 * S)
        drone.land()
        sleep(at.kernel, 3 * S)
        before = len(at.autopilot.sent("RC_UP"))
        sleep(at.kernel, 3 * S)
        assert len(at.autopilot.sent("RC_UP")) == before, "the sticks are not let go"

    at.fly(mission)
    assert (at.craft.armed, at.craft.up) == (False, 0.0)


def test_a_thrust_reported_while_it_swings_is_not_taken_for_its_weight(bench: Make) -> None:
    """On the ground 0.6 of a thrust 1.6 times its weight would never fall below the thrust of the descent."""
    at = bench()
    keep_height(at)

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.craft.fix, at.autopilot.swinging = "NO_FIX", 1.6
        sleep(at.kernel, 2 * S)
        drone.land()

    at.fly(mission)
    assert (at.craft.armed, at.craft.up) == (False, 0.0)


def test_neither_failsafe_nor_sticks_bring_it_down(bench: Make) -> None:
    at = bench()
    keep_height(at)

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.craft.fix = "NO_FIX"
        sleep(at.kernel, 2 * S)
        drone.land()

    at.autopilot.climbs_by_stick = False
    with pytest.raises(NotArrived, match=r"in ATTITUDE_DIRECT it does not sink: 10\.\d m above home"):
        at.fly(mission)


def test_a_failsafe_that_does_not_sink_is_told_and_the_plan_lands_once_there_is_a_fix(bench: Make) -> None:
    at = bench()
    keep_height(at)
    at.autopilot.sticks_by_datalink = False

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.craft.fix = "NO_FIX"
        sleep(at.kernel, 2 * S)
        with pytest.raises(NotArrived, match="FAILSAFE keeps its height, and sticks by datalink are not"):
            drone.land()
        at.craft.fix = "3D"
        sleep(at.kernel, 2 * S)
        drone.land()

    at.fly(mission)
    first, second = at.recorded(Operation)[-2:]
    assert first.end - first.start < 18 * S
    assert (second.outcome, at.craft.armed, at.craft.up) == ("ok", False, 0.0)


def test_a_fix_that_returns_while_it_lands_in_failsafe_lets_the_plan_land_it(bench: Make) -> None:
    at = bench()
    keep_height(at)

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.craft.fix = "NO_FIX"
        sleep(at.kernel, 2 * S)
        at.after(5.0, lambda: setattr(at.craft, "fix", "3D"))
        drone.land()

    at.fly(mission)
    assert (at.craft.armed, at.craft.up) == (False, 0.0)


@pytest.mark.parametrize("mode", ["FAILSAFE", "HOME"])
@pytest.mark.parametrize("order", ["land", "hold", "return_home", "come_to_rest"])
def test_an_order_of_safety_is_obeyed_out_of_a_failsafe(bench: Make, mode: str, order: str) -> None:
    at = bench()
    keep_height(at)

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.autopilot.enter(mode)
        sleep(at.kernel, 2 * S)
        with pytest.raises(Failsafe):
            drone.goto(NEAR)
        getattr(drone, order)()

    at.fly(mission)
    assert at.craft.mode == ("GUIDED" if order == "hold" else "NAV")
    assert at.craft.armed == (order == "hold")


def test_the_end_of_a_program_tells_what_does_not_sink(bench: Make) -> None:
    at = bench()
    keep_height(at)

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.craft.fix = "NO_FIX"
        at.autopilot.enter("FAILSAFE")
        at.autopilot.sticks_by_datalink = False
        sleep(at.kernel, 2 * S)
        drone.come_to_rest()

    with pytest.raises(NotArrived, match="FAILSAFE keeps its height"):
        at.fly(mission)
    assert at.kernel.now() < 90 * S


# -- what is sent once may be lost


@pytest.mark.parametrize("velocity", [(2.0, 0.0, 0.0, 0.0), (0.3, 0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0)])
@pytest.mark.parametrize("cut", [0.6, 15.0])
def test_the_end_of_a_velocity_is_sent_until_it_stands(
    bench: Make, velocity: tuple[float, ...], cut: float
) -> None:
    """One datagram that was lost let the real one fly on for ever."""
    at = bench()

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        at.after(2.8, lambda: setattr(at.autopilot, "deaf", True))
        at.after(2.8 + cut, lambda: setattr(at.autopilot, "deaf", False))
        drone.set_velocity(*velocity, lasting=3.0)
        sleep(at.kernel, round((6.0 + cut) * S))

    at.fly(mission)
    assert at.craft.velocity == (0.0, 0.0, 0.0)
    sent = len(at.autopilot.sent("GUIDED_SETPOINT_NED"))
    at.kernel.run(at.kernel.now() + 5 * S)
    assert len(at.autopilot.sent("GUIDED_SETPOINT_NED")) == sent, "it goes on sending for ever"


# -- on the ground with motors running


@pytest.mark.parametrize("order", ["land", "return_home"])
@pytest.mark.parametrize("mode", ["NAV", "GUIDED"])
def test_on_the_ground_landing_stops_the_motors(bench: Make, order: str, mode: str) -> None:
    """Block 'land here' runs through on the ground and leaves the motors on."""
    at = bench()
    at.craft.mode, at.craft.armed = mode, True

    def mission(drone: Any) -> None:
        drone.wait_ready()
        sleep(at.kernel, 6 * S)
        getattr(drone, order)()

    at.fly(mission)
    assert (at.craft.armed, at.craft.mode) == (False, mode)
    assert at.autopilot.sent("BLOCK") == []


def test_motors_are_not_stopped_because_of_an_old_status(bench: Make) -> None:
    """It has just lifted off; the status shows that up to 1.2 s later."""
    at = bench()
    at.craft.mode, at.craft.armed = "GUIDED", True

    def mission(drone: Any) -> None:
        drone.wait_connected()
        sleep(at.kernel, 6 * S)
        at.craft.flying, at.craft.up = True, 2.0
        with pytest.raises(NotArrived, match=r"it has lifted off meanwhile; land\(\) again"):
            drone.return_home()

    at.fly(mission)
    assert at.craft.armed
    assert at.autopilot.written("kill_throttle") == []


def test_an_aircraft_that_lifts_off_while_its_motors_are_stopped_is_landed(bench: Make) -> None:
    at = bench()
    at.craft.mode, at.craft.armed = "GUIDED", True

    def mission(drone: Any) -> None:
        drone.wait_ready()
        sleep(at.kernel, 6 * S)
        at.craft.flying, at.craft.up = True, 2.0
        drone.land()

    at.fly(mission)
    assert not at.craft.armed
    assert at.autopilot.sent("BLOCK")


def test_a_touch_down_far_from_home_stops_the_motors_though_it_seems_to_fly(bench: Make) -> None:
    """The real one takes 12 s to see that it has landed; another jumped to 1.4 m meanwhile."""
    at = bench()
    far = Position(LATITUDE + 170.0 / 111_106.0, LONGITUDE, AboveHome(12.0))
    at.autopilot.lands_late = True
    down: list[int] = []

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.goto(far)
        at.autopilot.on_ground = lambda: down.append(at.kernel.now())
        drone.land()

    at.fly(mission)
    assert (at.craft.armed, at.craft.up) == (False, 0.0)
    assert at.recorded(Operation)[-1].end - down[0] < 4 * S


def test_a_climb_that_overshoots_and_creeps_back_is_done(bench: Make) -> None:
    """The real one overshoots by 0.65 m and comes back at 1 cm/s: 13 s for the last 0.3 m."""
    at = bench()
    setpoint = at.autopilot._guided_setpoint_ned
    at.autopilot._guided_setpoint_ned = lambda fields: setpoint({**fields, "z": fields["z"] - 0.65})
    at.fly(up)
    assert at.craft.up == pytest.approx(10.65, abs=0.1)


# -- refusals


def test_a_refused_mode_is_told_at_once(bench: Make) -> None:
    """DL_VALUE has the value in force after 40 ms."""
    at = bench()
    at.autopilot._refuses = lambda mode: mode == 19

    with pytest.raises(Refused, match=r"refused to change to GUIDED \(it stays in NAV\)"):
        at.fly(up)
    climb = at.recorded(Operation)[-1]
    assert climb.end - climb.start < 25 * S
    assert len([value for value in at.autopilot.written("mode") if value == 19]) == 2


def test_one_old_value_is_no_refusal(bench: Make) -> None:
    """Values are also sent in turn: one may have been under way before the command arrived."""
    at = bench()
    answers: list[int] = []
    get = at.autopilot._get_setting

    def late(fields: dict[str, Any]) -> None:
        if fields["index"] == 5 and at.craft.mode == "GUIDED" and not answers:
            answers.append(1)
            at.autopilot.say("DL_VALUE", index=5, value=13.0)
        get(fields)

    at.autopilot._get_setting = late
    at.fly(up)
    assert answers


def test_an_aircraft_without_sticks_by_datalink_says_so(bench: Make) -> None:
    at = bench()
    at.autopilot.sticks_by_datalink = False

    def mission(drone: Any) -> None:
        drone.takeoff(10)
        drone.manual_control(0.0, 0.0, 0.5, 0.0)
        drone.altitude_hold()

    with pytest.raises(
        NotArrived, match=r"to take its sticks from the datalink was not seen within 4 s.*RC_UP"
    ):
        at.fly(mission)
    assert at.craft.mode == "GUIDED"


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
    at.after(1, lambda: at.autopilot.link.send(Frame("PPRZ_MODE", {}, 7, 0)))
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
