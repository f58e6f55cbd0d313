"""The rover: sticks, points, speeds, missions and the way home."""

from __future__ import annotations

from math import atan2, cos, degrees, hypot, radians, sin
from typing import Any

import pytest

MANUAL, HOLD, AUTO, RTL, GUIDED = 0, 4, 10, 11, 15


def armed(bench: Any, mode: int) -> Any:
    rig = bench("rover")
    rig.beat()
    rig.run(0.5)
    assert rig.mode(mode) == 0
    assert rig.command(400, 1) == 0
    return rig


def speed(rig: Any) -> float:
    north, east, _ = rig.vehicle.estimate.velocity
    return hypot(north, east)


def test_words_of_arming_and_disarming(bench: Any, facts: Any) -> None:
    rig = armed(bench, HOLD)
    assert rig.command(400, 0) == 0
    assert rig.texts() == facts["rover"]["words"]


def test_sticks_drive_and_steer(bench: Any) -> None:
    rig = armed(bench, MANUAL)
    rig.hold_sticks(4.0, 1500, 0, 1700, 0)
    ahead = speed(rig)
    assert ahead > 1.5
    heading = rig.vehicle.estimate.attitude[2]
    rig.hold_sticks(1.0, 1700, 0, 1700, 0)
    assert rig.vehicle.estimate.rates[2] > 0.3
    assert rig.vehicle.estimate.attitude[2] != heading
    rig.hold_sticks(4.0, 1500, 0, 1500, 0)
    assert speed(rig) < 0.2 * ahead
    rig.hold_sticks(3.0, 1500, 0, 1300, 0)
    north, east, _ = rig.vehicle.estimate.velocity
    heading = rig.vehicle.estimate.attitude[2]
    assert north * cos(heading) + east * sin(heading) < -0.5


def test_a_point_is_reached_in_the_recorded_time(bench: Any, facts: Any) -> None:
    recorded = facts["rover"]
    rig = armed(bench, GUIDED)
    home = rig.vehicle.home.ned
    rig.send(
        "SET_POSITION_TARGET_LOCAL_NED",
        target_system=1,
        target_component=1,
        coordinate_frame=1,
        type_mask=3580,
        x=home[0] + 50.0 - recorded["start"][0],
        y=home[1],
    )
    rig.run_until(lambda: bool(rig.of("MISSION_ITEM_REACHED")), within=30.0)
    assert rig.of("MISSION_ITEM_REACHED")[0].fields["seq"] == recorded["reached"][1]
    assert rig.now == pytest.approx(0.6 + recorded["reached"][0], rel=0.35)
    rig.run(4.0)
    assert speed(rig) < 0.2


def test_a_speed_with_a_turn_rate_expires_with_words(bench: Any, facts: Any) -> None:
    rig = armed(bench, GUIDED)
    last = 0.0
    for _ in range(40):
        rig.send(
            "SET_POSITION_TARGET_LOCAL_NED",
            target_system=1,
            target_component=1,
            coordinate_frame=9,
            type_mask=1479,
            vx=2.0,
            yaw_rate=0.3,
        )
        last = rig.now
        rig.run(0.2)
    assert speed(rig) == pytest.approx(2.0, abs=0.3)
    assert rig.vehicle.estimate.rates[2] == pytest.approx(0.3, abs=0.1)
    rig.run_until(lambda: "target not received last 3secs, stopping" in rig.texts())
    assert rig.now - last == pytest.approx(facts["rover"]["stale_after"], abs=0.3)
    rig.run(3.0)
    assert speed(rig) < 0.2


def test_a_heading_and_a_speed_by_command(bench: Any) -> None:
    rig = armed(bench, GUIDED)
    assert rig.command(213, 90.0, 2.0) == 0
    rig.run(2.8)
    assert rig.vehicle.estimate.attitude[2] == pytest.approx(radians(90.0), abs=0.4)


def test_it_drives_home(bench: Any, facts: Any) -> None:
    rig = armed(bench, GUIDED)
    rig.send(
        "SET_POSITION_TARGET_LOCAL_NED",
        target_system=1,
        target_component=1,
        coordinate_frame=1,
        type_mask=3580,
        x=50.0,
        y=14.0,
    )
    rig.run(25.0)
    assert rig.mode(RTL) == 0
    home = rig.vehicle.home.ned

    def away() -> float:
        north, east, _ = rig.vehicle.estimate.position
        return hypot(north - home[0], east - home[1])

    begun = rig.now
    rig.run_until(lambda: away() < 3.0, within=40.0)
    assert rig.now - begun == pytest.approx(facts["rover"]["home_within_3_m"], rel=0.35)
    rig.run(5.0)
    assert speed(rig) < 0.2


def test_it_does_not_take_off(bench: Any) -> None:
    rig = armed(bench, GUIDED)
    assert rig.command(22, 0, 0, 0, 0, 0, 0, 10) == 3


def test_hold_stands_as_standby(bench: Any) -> None:
    rig = armed(bench, HOLD)
    rig.run(1.5)
    assert rig.latest["HEARTBEAT"]["system_status"] == 3
    assert rig.vehicle.estimate.motor_pwm[2] == 1500


def upload(rig: Any, *points: tuple[float, float]) -> None:
    """Upload a mission of waypoints, north and east of the rover [m]; the first stands for home."""
    latitude, longitude, _ = rig.vehicle.estimate.geodetic
    rig.send("MISSION_COUNT", target_system=1, target_component=1, count=len(points))
    for sequence, (north, east) in enumerate(points):
        rig.run(0.05)
        rig.send(
            "MISSION_ITEM_INT",
            target_system=1,
            target_component=1,
            seq=sequence,
            frame=6,
            command=16,
            x=round((latitude + north / 111_320.0) * 1e7),
            y=round((longitude + east / 90_780.0) * 1e7),
        )
    rig.run(0.2)


def test_a_mission_is_driven_and_driven_again_from_its_start(bench: Any) -> None:
    rig = bench("rover")
    rig.beat()
    rig.run(0.5)
    upload(rig, (0.0, 0.0), (20.0, 0.0), (20.0, 15.0))
    assert rig.mode(AUTO) == 0
    assert rig.command(400, 1) == 0
    rig.run(30.0)
    assert [one.fields["seq"] for one in rig.of("MISSION_ITEM_REACHED")] == [1, 2]
    assert "Mission: 1 WP" in rig.texts()
    assert rig.vehicle.estimate.position[1] == pytest.approx(15.0, abs=2.5)
    rig.mode(HOLD)
    rig.mode(AUTO)
    rig.run(30.0)
    assert [one.fields["seq"] for one in rig.of("MISSION_ITEM_REACHED")] == [1, 2, 1, 2]


@pytest.mark.parametrize(
    ("after", "mode", "target"), [(0, AUTO, False), (1, AUTO, True), (2, 1, False), (3, MANUAL, False)]
)
def test_what_follows_a_mission(after: int, mode: int, target: bool, bench: Any) -> None:
    rig = bench("rover", parameters={"MIS_DONE_BEHAVE": after})
    rig.beat()
    rig.run(0.5)
    upload(rig, (0.0, 0.0), (5.0, 0.0))
    rig.mode(AUTO)
    rig.command(400, 1)
    rig.run_until(lambda: "Mission Complete" in rig.texts())
    rig.run(0.5)
    assert rig.vehicle.mode.number == mode
    assert (rig.vehicle.manoeuvre.target is not None) == target


def test_rates_that_were_asked_for_are_stored(bench: Any) -> None:
    rig = bench("rover")
    rig.run(0.3)
    rig.received.clear()
    rig.stream(4)
    rig.run(0.05)
    stored = {one.fields["param_id"]: one.fields["param_value"] for one in rig.of("PARAM_VALUE")}
    assert stored["SR0_EXTRA1"] == 4.0
    assert len(stored) == 9


def test_a_velocity_turns_it_to_its_direction(bench: Any) -> None:
    rig = armed(bench, GUIDED)
    for _ in range(20):
        rig.send(
            "SET_POSITION_TARGET_LOCAL_NED",
            target_system=1,
            target_component=1,
            coordinate_frame=1,
            type_mask=3527,
            vx=1.0,
            vy=1.0,
        )
        rig.run(0.5)
    north, east, _ = rig.vehicle.estimate.velocity
    assert hypot(north, east) == pytest.approx(1.414, abs=0.2)
    assert degrees(atan2(east, north)) == pytest.approx(45.0, abs=5.0)


def test_relative_headings_add_to_the_one_asked_for_last(bench: Any) -> None:
    rig = bench("rover")
    rig.run(0.5)
    rig.mode(15)
    rig.command(400, 1)
    rig.command(213, 90, 1, 0)
    for _ in range(5):
        rig.command(213, 5, 1, 1)
    assert degrees(rig.vehicle.manoeuvre.asked_heading) == pytest.approx(115.0, abs=0.01)


def test_the_end_of_a_return_is_said(bench: Any) -> None:
    rig = bench("rover")
    rig.beat()
    rig.run(0.5)
    rig.command(400, 1)
    assert rig.mode(11) == 0
    rig.run(8.0)
    assert rig.texts()[-1] == "Reached destination"


def test_after_the_mission_it_shows_no_target(bench: Any) -> None:
    rig = bench("rover")
    rig.run(0.5)
    rig.command(511, 87, 200_000)
    latitude, longitude, _ = rig.vehicle.estimate.geodetic
    rig.send("MISSION_COUNT", target_system=1, target_component=1, count=2)
    for sequence in range(2):
        rig.run(0.05)
        place = {"x": round((latitude + 1e-4 * sequence) * 1e7), "y": round(longitude * 1e7)}
        rig.send(
            "MISSION_ITEM_INT",
            target_system=1,
            target_component=1,
            seq=sequence,
            frame=6,
            command=16,
            **place,
        )
    rig.run(0.2)
    rig.mode(AUTO)
    rig.command(400, 1)
    rig.run_until(lambda: "Mission Complete" in rig.texts())
    assert rig.of("POSITION_TARGET_GLOBAL_INT")
    rig.run(0.3)
    rig.received.clear()
    rig.run(2.0)
    assert not rig.of("POSITION_TARGET_GLOBAL_INT")
