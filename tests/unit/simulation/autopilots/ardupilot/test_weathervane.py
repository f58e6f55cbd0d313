"""Weathervaning: which side turns into the wind, when it turns, and who else commands the heading."""

from __future__ import annotations

from math import degrees
from typing import Any

import pytest

pytestmark = pytest.mark.optional

GUIDED, SET_MODE, ARM, TAKEOFF, CONDITION_YAW = 4, 176, 400, 22, 115
NOSE, NOSE_OR_TAIL, SIDE, TAIL = 1, 2, 3, 4
WIND = {"SIM_WIND_SPD": 10, "SIM_WIND_DIR": 100, "GUID_OPTIONS": 128, "WVANE_GAIN": 3}


@pytest.fixture
def hovering(station: Any) -> Any:
    """Makes a copter that has hovered in wind from 100 degrees for some seconds after its take-off."""

    def made(seconds: float = 20.0, **parameters: float) -> Any:
        rig = station(parameters={**WIND, **parameters})
        rig.beat()
        rig.run(0.5)
        assert rig.command(SET_MODE, 1, GUIDED) == 0
        assert rig.command(ARM, 1) == 0
        assert rig.command(TAKEOFF, 0, 0, 0, 0, 0, 0, 10.0) == 0
        rig.run_until(lambda: rig.height > 9.5)
        rig.run(seconds)
        return rig

    return made


def heading(rig: Any) -> float:
    """Return the heading [degrees], 0 to 360."""
    return degrees(rig.vehicle.estimate.attitude[2]) % 360.0


@pytest.mark.parametrize(
    ("side", "headings", "words"),
    [
        (NOSE, (100.0,), "nose in"),
        (NOSE_OR_TAIL, (100.0, 280.0), "nose or tail in"),
        (SIDE, (10.0, 190.0), "side in"),
        (TAIL, (280.0,), "tail in"),
    ],
)
def test_that_side_turns_into_the_wind(
    side: int, headings: tuple[float, ...], words: str, hovering: Any
) -> None:
    rig = hovering(WVANE_ENABLE=side)
    assert min(abs(heading(rig) - one) for one in headings) < 8.0
    assert rig.texts().count(f"Weathervane Active: {words}") == 1


@pytest.mark.parametrize(
    "parameters",
    [
        {"WVANE_ENABLE": 0},
        {"WVANE_ENABLE": -1},
        {"WVANE_ENABLE": NOSE, "GUID_OPTIONS": 0},
        {"WVANE_ENABLE": NOSE, "WVANE_GAIN": 0},
        {"WVANE_ENABLE": NOSE, "WVANE_HGT_MIN": 20},
        {"WVANE_ENABLE": NOSE, "WVANE_ANG_MIN": 45},
    ],
)
def test_it_does_not_turn(parameters: dict[str, float], hovering: Any) -> None:
    rig = hovering(8.0, **parameters)
    assert abs((heading(rig) + 180.0) % 360.0 - 180.0) < 3.0


def test_pitch_turns_a_tail_that_is_in_the_wind(hovering: Any) -> None:
    turned = []
    for options in (0, 1):
        rig = hovering(3.0, WVANE_ENABLE=NOSE, WVANE_OPTIONS=options, SIM_WIND_DIR=170)
        turned.append(heading(rig))
    assert turned[1] > turned[0] + 20.0


def test_the_pilot_takes_the_turn_over_and_the_command_before_comes_back(hovering: Any) -> None:
    rig = hovering(3.0, WVANE_ENABLE=0)
    assert rig.command(CONDITION_YAW, 40, 90, 1, 0) == 0
    rig.run(5.0)
    assert heading(rig) == pytest.approx(40.0, abs=3.0)
    rig.vehicle.set_parameter("WVANE_ENABLE", NOSE)
    rig.run(15.0)
    assert heading(rig) == pytest.approx(100.0, abs=8.0)
    rig.vehicle.rc.transmitter[3] = 1700
    rig.run(6.0)
    assert heading(rig) == pytest.approx(40.0, abs=3.0)


def test_a_quick_copter_does_not_turn(hovering: Any) -> None:
    rig = hovering(0.0, WVANE_ENABLE=0)
    for count in range(16):
        if count == 6:
            rig.vehicle.set_parameter("WVANE_ENABLE", NOSE)
        rig.send(
            "SET_POSITION_TARGET_LOCAL_NED",
            target_system=1,
            target_component=1,
            coordinate_frame=1,
            type_mask=0b110111000111,
            vx=5.0,
            **dict.fromkeys(("x", "y", "z", "vy", "vz", "afx", "afy", "afz", "yaw", "yaw_rate"), 0.0),
        )
        rig.run(0.5)
    assert not any("Weathervane" in text for text in rig.texts())
