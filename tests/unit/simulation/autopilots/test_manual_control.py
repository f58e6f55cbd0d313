"""RC channels: pulse widths to stick positions, overrides and their expiry."""

from __future__ import annotations

import pytest

from volery.base.time import MS, S
from volery.simulation.autopilots.manual_control import ChannelRange, ReceivedChannels, StickMap

STICK = ChannelRange(1000, 1500, 2000, 20)
THROTTLE = ChannelRange(1000, 1500, 2000, 30)


@pytest.mark.parametrize(
    ("pulse", "deflection"),
    [(1500, 0.0), (1520, 0.0), (1480, 0.0), (2000, 1.0), (1000, -1.0), (1760, 0.5), (2200, 1.0), (800, -1.0)],
)
def test_a_stick_has_a_dead_zone_and_ends(pulse: int, deflection: float) -> None:
    assert STICK.deflection(pulse) == pytest.approx(deflection)
    assert STICK._replace(reversed=True).deflection(pulse) == pytest.approx(-deflection)


@pytest.mark.parametrize(
    ("pulse", "share"), [(900, 0.0), (1000, 0.0), (1030, 0.0), (1515, 0.5), (2000, 1.0), (2100, 1.0)]
)
def test_a_throttle_begins_above_its_dead_zone(pulse: int, share: float) -> None:
    assert THROTTLE.share(pulse) == pytest.approx(share)


def test_a_reversed_throttle_is_closed_at_its_high_end() -> None:
    reversed_throttle = THROTTLE._replace(reversed=True)
    assert reversed_throttle.share(2000) == 0.0
    assert reversed_throttle.share(1000) == 1.0


@pytest.mark.parametrize("travel", [ChannelRange(1500, 1500, 1500, 20), ChannelRange(2000, 1500, 1000, 20)])
def test_a_channel_range_of_zero_width_gives_zero(travel: ChannelRange) -> None:
    assert travel.share(1500) == 0.0
    assert travel.deflection(1500) == 0.0


def test_an_override_holds_until_it_is_released() -> None:
    sticks = ReceivedChannels([1500, 1500, 1000])
    sticks.override(3, 1700, 0)
    assert sticks.pulses() == [1500, 1500, 1700]
    assert sticks[3] == 1700
    sticks.override(3, 0, 0)
    assert sticks.pulses() == [1500, 1500, 1000]
    assert not sticks.overridden


def test_an_override_that_is_not_repeated_expires_alone() -> None:
    sticks = ReceivedChannels([1500, 1500, 1000])
    sticks.override(1, 1600, 0)
    sticks.override(2, 1600, 2 * S)
    assert not sticks.expire(3 * S, 3 * S)
    assert sticks.expire(3 * S + MS, 3 * S)
    assert sticks.pulses() == [1500, 1600, 1000]


def test_channels_that_do_not_exist_are_not_overridden() -> None:
    sticks = ReceivedChannels([1500])
    sticks.override(0, 1700, 0)
    sticks.override(2, 1700, 0)
    assert sticks.pulses() == [1500]


def test_a_stick_map_selects_the_channel_of_each_stick() -> None:
    sticks = ReceivedChannels([1000, 2000, 1500, 1500])
    pilot = StickMap(roll=2, pitch=1, throttle=3, yaw=4, travels=(STICK, STICK, THROTTLE, STICK)).read(sticks)
    assert (pilot.roll, pilot.pitch, pilot.yaw) == (1.0, -1.0, 0.0)
    assert pilot.throttle == pytest.approx(0.4845, abs=1e-4)
