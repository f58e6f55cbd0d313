"""Camera mount: its modes, targets, limits and outputs, and who points it."""

from __future__ import annotations

from math import degrees
from typing import Any

import pytest

from volery.base.frames import quaternion_to_euler
from volery.simulation.autopilots.ardupilot.mount import mount_state
from volery.simulation.autopilots.ardupilot.servo_outputs import outputs_of

REQUEST_MESSAGE, ATTITUDE_STATUS, MANAGER_STATUS, MANAGER_INFORMATION = 512, 285, 281, 280
CONFIGURE, CONTROL, PITCHYAW, MANAGE, ROI, ROI_NONE, ROI_SYSTEM = 204, 205, 1000, 1001, 195, 197, 198
RETRACT, NEUTRAL, BY_MESSAGE, BY_PILOT, AT_POINT, AT_SYSTEM, AT_HOME = range(7)
MOUNT = {
    "MNT1_TYPE": 1,
    "MNT1_PITCH_MIN": -45,
    "MNT1_PITCH_MAX": 45,
    "RC6_OPTION": 213,
    "SERVO9_FUNCTION": 8,
    "SERVO10_FUNCTION": 7,
    "SERVO11_FUNCTION": 6,
    "SERVO12_FUNCTION": 9,
}
NAN = float("nan")


@pytest.fixture
def rig(station: Any) -> Any:
    """A copter with a mount, its stick in the middle."""
    found = station(parameters=MOUNT)
    found.vehicle.rc.transmitter[5] = 1500
    found.run(0.5)
    return found


def angles(rig: Any) -> tuple[float, float, float]:
    """Return roll, pitch and yaw [degrees] as they are reported."""
    rig.run(0.3)
    assert rig.command(REQUEST_MESSAGE, ATTITUDE_STATUS) == 0
    roll, pitch, yaw = quaternion_to_euler(rig.latest["GIMBAL_DEVICE_ATTITUDE_STATUS"]["q"])
    return degrees(roll), degrees(pitch), degrees(yaw)


def test_there_is_none_until_a_boot_with_its_parameter(station: Any) -> None:
    rig = station()
    rig.run(0.3)
    rig.vehicle.set_parameter("MNT1_TYPE", 1.0)
    assert rig.command(CONTROL, 0, 0, 0, 0, 0, 0, NEUTRAL) == 4
    assert rig.command(REQUEST_MESSAGE, ATTITUDE_STATUS) == 0
    assert "GIMBAL_DEVICE_ATTITUDE_STATUS" not in rig.latest
    rig.vehicle.restart()
    rig.run(3.0)
    assert rig.command(CONTROL, 0, 0, 0, 0, 0, 0, NEUTRAL) == 0
    assert angles(rig) == (0.0, 0.0, 0.0)


def test_the_pilot_points_it_by_angle_and_by_rate(rig: Any) -> None:
    assert angles(rig) == pytest.approx((0.0, 0.0, 0.0), abs=0.01)
    rig.vehicle.rc.transmitter[5] = 1700
    assert angles(rig)[1] == pytest.approx(18.0, abs=0.1)
    assert outputs_of(rig.vehicle).servos[10] == pytest.approx(1660, abs=2)
    rig.vehicle.set_parameter("MNT1_RC_RATE", 10.0)
    before = angles(rig)[1]
    rig.run(2.0)
    assert angles(rig)[1] == pytest.approx(before + 4.0 * 2.3, abs=0.6)
    rig.run(10.0)
    assert angles(rig)[1] == pytest.approx(45.0, abs=0.01)


def test_a_mission_item_points_it(station: Any) -> None:
    rig = station("rover", parameters=MOUNT)
    rig.beat()
    rig.run(0.5)
    rig.listed(PITCHYAW, param1=-30.0, param2=20.0)
    assert rig.command(176, 1, 10) == 0
    assert rig.command(400, 1) == 0
    rig.run(2.0)
    assert angles(rig) == pytest.approx((0.0, -30.0, 20.0), abs=0.01)


def test_a_moved_stick_takes_it_over_from_a_message(rig: Any) -> None:
    assert rig.command(CONTROL, -20, 5, 30, 0, 0, 0, BY_MESSAGE) == 0
    assert angles(rig) == pytest.approx((5.0, -20.0, 30.0), abs=0.01)
    rig.vehicle.rc.transmitter[5] = 1508
    assert angles(rig)[1] == pytest.approx(-20.0, abs=0.01)
    rig.vehicle.rc.transmitter[5] = 1520
    assert angles(rig)[1] == pytest.approx(1.8, abs=0.01)


def test_retracted_and_neutral_angles_are_parameters(rig: Any) -> None:
    rig.vehicle.set_parameter("MNT1_RETRACT_Y", -33.0)
    assert rig.command(CONFIGURE, RETRACT) == 0
    assert angles(rig)[1] == pytest.approx(-33.0, abs=0.01)
    assert outputs_of(rig.vehicle).servos[12] == 1100
    assert rig.command(CONFIGURE, NEUTRAL) == 0
    assert angles(rig) == (0.0, 0.0, 0.0)
    assert outputs_of(rig.vehicle).servos[12] == 1900


def test_a_place_keeps_its_direction_as_the_nose_turns(rig: Any) -> None:
    north, height = rig.vehicle.estimate.position[0], rig.vehicle.height
    latitude, longitude, _ = rig.vehicle.flight.from_ned((north + 30.0, 0.0, 0.0))
    place = (round(latitude * 1e7), round(longitude * 1e7))
    assert rig.command(CONTROL, 0, 0, 0, 30.0 + height, *place, AT_POINT) == 0
    _, pitch, yaw = angles(rig)
    assert pitch == pytest.approx(45.0, abs=2.0)
    assert yaw == pytest.approx(-degrees(rig.vehicle.estimate.attitude[2]), abs=3.0)


def test_a_region_of_interest_is_for_the_mount_or_for_the_nose(rig: Any) -> None:
    assert rig.command(ROI, 0, 0, 0, 0, 46.001, 7.0, 0.0) == 0
    assert mount_state(rig.vehicle).mode == AT_POINT
    assert rig.vehicle.commanded.look_at is None
    assert rig.command(ROI_NONE) == 0
    assert mount_state(rig.vehicle).mode == BY_PILOT  # MNT1_DEFLT_MODE
    rig.vehicle.set_parameter("SERVO11_FUNCTION", 0.0)
    assert rig.command(ROI, 0, 0, 0, 0, 46.001, 7.0, 0.0) == 0
    assert rig.vehicle.commanded.look_at is not None
    rig.run(0.5)
    assert rig.vehicle.commanded.yaw is not None
    assert rig.command(ROI_NONE) == 0
    rig.run(0.5)
    assert rig.vehicle.commanded.yaw is None  # along the path again


def test_it_follows_the_positions_of_another_system(rig: Any) -> None:
    assert rig.command(ROI_SYSTEM, 77) == 0
    here = rig.vehicle.estimate.geodetic
    fields = {
        "lat": round(here[0] * 1e7), "lon": round(here[1] * 1e7), "alt": round((here[2] + 50.0) * 1000.0)
    }  # fmt: skip
    rig.send(
        "GLOBAL_POSITION_INT", system=77, time_boot_ms=0, relative_alt=0, vx=0, vy=0, vz=0, hdg=0, **fields
    )
    assert angles(rig)[1] > 80.0


def test_the_gimbal_manager_takes_angles_rates_and_flags(rig: Any) -> None:
    assert rig.command(PITCHYAW, -30, 10, 0, 0, 0, 0, 0) == 0
    assert angles(rig)[1:] == pytest.approx((-30.0, 10.0), abs=0.01)
    assert rig.command(PITCHYAW, NAN, NAN, 4.0, 0.0, 0, 0, 1) == 0
    rig.run(1.0)
    assert -27.0 < angles(rig)[1] < -22.0
    assert rig.command(PITCHYAW, NAN, NAN, NAN, NAN) == 4
    assert rig.command(PITCHYAW, 0, 0, 0, 0, 2) == 0
    assert mount_state(rig.vehicle).mode == NEUTRAL
    assert rig.command(PITCHYAW, 0, 0, 0, 0, 0, 0, 3) == 4


def manager(rig: Any) -> tuple[int, int]:
    assert rig.command(REQUEST_MESSAGE, MANAGER_STATUS) == 0
    status = rig.latest["GIMBAL_MANAGER_STATUS"]
    return status["primary_control_sysid"], status["primary_control_compid"]


def test_the_gimbal_manager_says_who_is_in_control(rig: Any) -> None:
    assert manager(rig) == (0, 0)
    assert rig.command(MANAGE, 37, 38) == 0
    assert rig.command(MANAGE, -1) == 0
    assert rig.command(MANAGE, -3) == 0  # not in control: cannot give it back
    assert manager(rig) == (37, 38)
    assert rig.command(MANAGE, -2) == 0
    assert manager(rig)[0] not in (0, 37)
    assert rig.command(MANAGE, -3) == 0
    assert manager(rig) == (0, 0)
    assert rig.command(MANAGE, 256) == 4
    assert rig.command(REQUEST_MESSAGE, MANAGER_INFORMATION) == 0
    assert rig.latest["GIMBAL_MANAGER_INFORMATION"]["pitch_max"] == pytest.approx(0.785, abs=0.001)


@pytest.mark.parametrize(
    ("parameters", "text"),
    [
        ((91, 0, 0, 0, 0, 0, BY_MESSAGE), "Mount: invalid angle targets"),
        ((1, 1, 0, 0, 0, 0, AT_POINT), "Mount: GPS_POINT target invalid"),
        ((0, 0, 0, 0, 0, 0, 87), None),
    ],
)
def test_targets_that_are_refused(parameters: Any, text: str | None, rig: Any) -> None:
    assert rig.command(CONTROL, *parameters) == 4
    assert (text is None) or text in rig.texts()


def test_outputs_compensate_the_lean_and_the_report_does_not(rig: Any) -> None:
    for command in ((176, 1, 4), (400, 1), (22, 0, 0, 0, 0, 0, 0, 12.0)):
        assert rig.command(*command) == 0
    rig.run_until(lambda: rig.vehicle.height > 11.0, 60.0)
    rig.vehicle.manoeuvre.go_to((60.0, 0.0, -12.0))
    rig.run_until(lambda: rig.vehicle.estimate.attitude[1] < -0.1, 20.0)
    rig.run(0.1)
    lean = degrees(rig.vehicle.estimate.attitude[1])
    turned = (outputs_of(rig.vehicle).servos[10] - 1500) / 800 * 90.0
    assert turned == pytest.approx(-lean, abs=3.0)
    assert angles(rig)[1] == pytest.approx(0.0, abs=0.01)
