"""The pilot's sticks: who may move them, how long they count, and what the recorded vehicle did with them."""

from __future__ import annotations

from math import degrees, hypot
from typing import Any

import pytest

STABILIZE, ALT_HOLD, LOITER = 0, 2, 5
MIDDLE = (1500, 1500, 1500, 1500)


def hover(rig: Any, mode: int) -> None:
    """In the air in that mode, sticks in the middle."""
    rig.airborne()
    for _ in range(5):
        rig.sticks(*MIDDLE)
        rig.run(0.1)
    assert rig.mode(mode) == 0
    rig.hold_sticks(1.0, *MIDDLE)


def test_every_recorded_deflection_gets_the_recorded_response(bench: Any, facts: Any) -> None:
    rig = bench()
    hover(rig, ALT_HOLD)
    mode = ALT_HOLD
    for one in facts["sticks"]["responses"]:
        if one["mode"] == STABILIZE:
            continue  # flown by a pilot who watched: see the next test
        if one["mode"] != mode:
            mode = one["mode"]
            rig.mode(mode)
        rig.hold_sticks(one["seconds"], *one["pulses"])
        if mode == LOITER:
            continue  # leans as its speed asks for
        estimate = rig.vehicle.estimate
        assert estimate.attitude[0] == pytest.approx(one["roll"], abs=0.03), one
        assert estimate.attitude[1] == pytest.approx(one["pitch"], abs=0.03), one
        if one["pulses"][3] != 1500:
            assert estimate.rates[2] == pytest.approx(one["yaw_rate"], rel=0.2), one
        assert -estimate.velocity[2] == pytest.approx(one["climb"], abs=0.12), one


@pytest.mark.parametrize(
    ("pulses", "roll", "pitch"),
    [
        ((1500, 1400), 0.0, -5.0),
        ((1500, 1600), 0.0, 5.0),
        ((1600, 1500), 5.0, 0.0),
        ((1400, 1500), -5.0, 0.0),
    ],
)
def test_stabilize_leans_as_recorded(pulses: tuple[int, int], roll: float, pitch: float, bench: Any) -> None:
    rig = bench()
    hover(rig, ALT_HOLD)
    rig.mode(STABILIZE)
    rig.hold_sticks(1.5, *pulses, 1500, 1500)
    attitude = rig.vehicle.estimate.attitude
    assert degrees(attitude[0]) == pytest.approx(roll, abs=1.5)
    assert degrees(attitude[1]) == pytest.approx(pitch, abs=1.5)


def test_a_yaw_stick_turns_as_recorded(bench: Any) -> None:
    """100 us for three seconds: 101 degrees."""
    rig = bench()
    hover(rig, ALT_HOLD)
    before = degrees(rig.vehicle.estimate.attitude[2])
    rig.hold_sticks(3.0, 1500, 1500, 1500, 1600)
    rig.hold_sticks(2.0, *MIDDLE)
    turned = (degrees(rig.vehicle.estimate.attitude[2]) - before) % 360.0
    assert turned == pytest.approx(101.0, abs=15.0)


def test_overrides_fall_back_to_a_transmitter_with_the_throttle_closed(bench: Any, facts: Any) -> None:
    rig = bench()
    rig.stream(20)
    hover(rig, ALT_HOLD)
    rig.hold_sticks(1.0, 1600, 1500, 1500, 1500)
    last = rig.now - 0.1
    rig.run_until(lambda: rig.latest["RC_CHANNELS"]["chan1_raw"] != 1600)
    assert rig.now - last == pytest.approx(facts["sticks"]["override_timeout"], abs=0.2)
    recorded = facts["sticks"]["transmitter"]
    assert [rig.latest["RC_CHANNELS"][f"chan{number}_raw"] for number in range(1, 17)] == recorded
    rig.run(1.5)
    assert rig.vehicle.estimate.velocity[2] > 1.0  # the throttle stick at its end: ALT_HOLD descends


def test_only_the_station_with_id_255_may_override(bench: Any) -> None:
    rig = bench()
    rig.stream(10)
    rig.sticks(1700, 1500, 1500, 1500, system=254)
    rig.run(0.3)
    assert rig.latest["RC_CHANNELS"]["chan1_raw"] == 1500
    rig.sticks(1700, 1500, 1500, 1500)
    rig.run(0.3)
    assert rig.latest["RC_CHANNELS"]["chan1_raw"] == 1700


def test_zero_releases_a_channel_and_65535_leaves_it(bench: Any) -> None:
    rig = bench()
    rig.stream(10)
    rig.sticks(1700, 1700, 1700, 1700)
    rig.run(0.2)
    rig.sticks(0, 65535, 1600, 65535)
    rig.run(0.2)
    channels = rig.latest["RC_CHANNELS"]
    assert [channels[f"chan{number}_raw"] for number in range(1, 5)] == [1500, 1700, 1600, 1700]


def test_manual_control_moves_the_same_sticks(bench: Any) -> None:
    rig = bench()
    rig.stream(10)
    rig.send("MANUAL_CONTROL", target=1, x=1000, y=-1000, z=250, r=500)
    rig.run(0.3)
    channels = rig.latest["RC_CHANNELS"]
    assert [channels[f"chan{number}_raw"] for number in range(1, 5)] == [1000, 1000, 1250, 1750]
    rig.send("MANUAL_CONTROL", target=7, x=0, y=0, z=0, r=0)
    rig.run(0.3)
    assert rig.latest["RC_CHANNELS"]["chan4_raw"] == 1750


def test_stabilize_takes_off_and_falls_with_the_throttle_closed(bench: Any) -> None:
    rig = bench()
    rig.beat()
    rig.sticks(1500, 1500, 1000, 1500)
    rig.run(0.2)
    assert rig.mode(STABILIZE) == 0
    assert rig.command(400, 1) == 0
    rig.hold_sticks(2.5, 1500, 1500, 1000, 1500)
    assert rig.vehicle.estimate.motor_pwm[0] > 1000
    rig.hold_sticks(4.0, 1500, 1500, 1650, 1500)
    assert rig.height > 1.0
    rig.hold_sticks(0.5, 1500, 1500, 1000, 1500)
    assert rig.vehicle.estimate.throttle == 0.0


def test_altitude_hold_lands_by_stick_and_disarms_itself(bench: Any, facts: Any) -> None:
    rig = bench()
    rig.airborne(3.0)
    for _ in range(5):
        rig.sticks(*MIDDLE)
        rig.run(0.1)
    rig.mode(ALT_HOLD)
    while rig.height > 0.15:
        rig.hold_sticks(0.2, 1500, 1500, 1350, 1500)
    start = rig.now
    while rig.vehicle.armed and rig.now - start < 30.0:
        rig.hold_sticks(0.2, 1500, 1500, 1000, 1500)
    touched = next(one for one in rig.of("STATUSTEXT") if one.fields["text"].startswith("SIM Hit ground"))
    assert rig.now - touched.at == pytest.approx(facts["sticks"]["disarm_after_touch_down"], rel=0.2)


def test_loiter_moves_by_stick_and_stops_by_itself(bench: Any) -> None:
    """Recorded: pitch 1300 for four seconds gives 2.8 m/s; let go, it stands five seconds later."""
    rig = bench()
    hover(rig, LOITER)
    rig.hold_sticks(4.0, 1500, 1300, 1500, 1500)
    north, east, _ = rig.vehicle.estimate.velocity
    assert hypot(north, east) == pytest.approx(2.8, rel=0.4)
    height = rig.height
    rig.hold_sticks(5.0, *MIDDLE)
    north, east, _ = rig.vehicle.estimate.velocity
    assert hypot(north, east) < 0.4
    assert rig.height == pytest.approx(height, abs=0.5)
