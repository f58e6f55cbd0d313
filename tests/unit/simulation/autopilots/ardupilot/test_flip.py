"""FLIP: one turn about an axis that the sticks choose, then the mode before."""

from __future__ import annotations

from math import degrees
from typing import Any

import pytest

pytestmark = pytest.mark.optional

ARM, MODE, TAKEOFF, AUX = 400, 176, 22, 218
ALT_HOLD, GUIDED, LOITER, FLIP = 2, 4, 5, 14


@pytest.fixture
def flying(station: Any) -> Any:
    """Makes a copter that hovers in ALT_HOLD at 20 m."""

    def made(height: float = 20.0) -> Any:
        rig = station()
        rig.run(0.5)
        assert rig.command(MODE, 1.0, GUIDED) == 0
        assert rig.command(ARM, 1.0) == 0
        assert rig.command(TAKEOFF, 0, 0, 0, 0, 0, 0, height) == 0
        rig.run(20.0)
        rig.vehicle.rc.transmitter[2] = 1500
        assert rig.command(MODE, 1.0, ALT_HOLD) == 0
        rig.run(1.0)
        return rig

    return made


@pytest.mark.parametrize(
    ("channel", "pulse", "axis", "first"),
    [(0, 1500, 0, 1), (0, 1450, 0, -1), (1, 1700, 1, 1), (1, 1300, 1, -1)],
)
def test_it_turns_once_about_the_axis_of_the_stick(
    channel: int, pulse: int, axis: int, first: int, flying: Any
) -> None:
    rig = flying()
    rig.vehicle.rc.transmitter[channel] = pulse
    assert rig.command(MODE, 1.0, FLIP) == 0
    assert rig.latest["HEARTBEAT"]["custom_mode"] in (ALT_HOLD, FLIP)
    rig.vehicle.rc.transmitter[channel] = 1500
    turned, start, fastest, lowest = 0.0, rig.now, 0.0, rig.height
    while rig.vehicle.mode.number == FLIP:
        rig.run(0.01)
        rate = degrees(rig.vehicle.estimate.rates[axis])
        turned += 0.01 * rate
        fastest, lowest = max(fastest, abs(rate)), min(lowest, rig.height)
    assert rig.now - start < 2.5
    assert turned == pytest.approx(360.0 * first, abs=25.0)
    assert 320.0 < fastest < 480.0
    assert rig.vehicle.mode.number == ALT_HOLD
    rig.run(8.0)
    assert max(map(abs, rig.vehicle.estimate.attitude[:2])) < 0.05
    assert lowest > 10.0
    assert rig.vehicle.armed


def test_a_full_stick_ends_it(flying: Any) -> None:
    rig = flying()
    assert rig.command(MODE, 1.0, FLIP) == 0
    rig.vehicle.rc.transmitter[0] = 2000
    rig.run(0.1)
    assert rig.vehicle.mode.number == ALT_HOLD


def test_a_switch_starts_it(flying: Any) -> None:
    rig = flying()
    assert rig.command(AUX, 2, 2) == 0
    assert rig.vehicle.mode.number == FLIP


def test_it_is_refused_on_the_ground_and_from_modes_with_a_position(station: Any, flying: Any) -> None:
    standing = station()
    standing.run(0.5)
    assert standing.command(MODE, 1.0, FLIP) != 0
    assert standing.texts()[-1] == "Mode change to FLIP failed: init failed"
    rig = flying()
    assert rig.command(MODE, 1.0, LOITER) == 0
    assert rig.command(MODE, 1.0, FLIP) != 0
    assert rig.vehicle.mode.number == LOITER
