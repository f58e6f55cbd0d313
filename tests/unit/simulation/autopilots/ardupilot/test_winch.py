"""Winch: let go, turned at a rate, by a length of line, and by the pilot."""

from __future__ import annotations

from typing import Any

import pytest

from volery.simulation.autopilots.ardupilot.servo_outputs import outputs_of
from volery.simulation.autopilots.ardupilot.winch import winch_of

pytestmark = pytest.mark.optional

DO_WINCH, ARM, AUX_FUNCTION = 42_600, 400, 218
WINCH = {"WINCH_TYPE": 1, "SERVO9_FUNCTION": 88, "RC9_OPTION": 45}
RELAXED, BY_LENGTH, BY_RATE = 0, 1, 2


def output(rig: Any) -> int | None:
    pulse: int | None = outputs_of(rig.vehicle).servos.get(9)
    return pulse


def test_it_is_let_go_at_the_start_unless_it_shall_hold(station: Any) -> None:
    rig = station(parameters=WINCH)
    rig.run(0.3)
    assert output(rig) == 0
    rig = station(parameters=WINCH | {"WINCH_OPTIONS": 0})
    rig.run(0.3)
    assert output(rig) == 1500


def test_a_rate_is_reached_with_limited_acceleration_and_kept(station: Any) -> None:
    rig = station(parameters=WINCH)
    assert rig.command(DO_WINCH, 1, BY_RATE, 0, 9.0) == 0
    rig.run(0.2)
    early = output(rig)
    assert early is not None
    assert 1500 < early < 1900
    rig.run(1.0)
    assert output(rig) == 1900
    assert rig.command(DO_WINCH, 1, RELAXED) == 0
    rig.run(0.2)
    assert output(rig) == 0


def test_a_length_is_paid_out_and_hauled_in(station: Any) -> None:
    rig = station(parameters=WINCH)
    assert rig.command(DO_WINCH, 1, BY_LENGTH, 2.0) == 0
    rig.run(1.0)
    assert output(rig) == 1900
    rig.run(9.0)
    assert output(rig) == 1500
    assert winch_of(rig.vehicle).length == pytest.approx(2.0, abs=0.01)
    assert rig.command(DO_WINCH, 1, BY_LENGTH, -0.5) == 0
    rig.run(0.5)
    assert (output(rig) or 0) < 1500
    reports = [text for text in rig.texts() if text.startswith("Winch")]
    assert reports == ["Winch: lowering  2.0m to  2.0m", "Winch: raising  0.5m to  1.5m"]


def test_the_pilots_channel_takes_over_once_it_moves(station: Any) -> None:
    rig = station(parameters=WINCH)
    rig.vehicle.rc.transmitter[8] = 1500
    rig.run(0.3)
    assert output(rig) == 0
    rig.vehicle.rc.transmitter[8] = 1520  # within the dead zone
    rig.run(0.3)
    assert output(rig) == 0
    rig.vehicle.rc.transmitter[8] = 1100
    rig.run(1.5)
    assert output(rig) == 1100
    assert rig.command(DO_WINCH, 1, RELAXED) == 0
    rig.run(0.3)
    assert output(rig) == 0


def test_a_switch_holds_the_line(station: Any) -> None:
    rig = station(parameters=WINCH)
    assert rig.command(AUX_FUNCTION, 44, 2) == 0
    rig.run(0.3)
    assert output(rig) == 1500
    assert rig.command(AUX_FUNCTION, 44, 0) == 0
    rig.run(0.3)
    assert output(rig) == 0


def test_orders_that_are_refused(station: Any) -> None:
    assert station().command(DO_WINCH, 1, BY_RATE) == 4
    assert station(parameters=WINCH).command(DO_WINCH, 1, 3) == 4
    assert station("rover").command(DO_WINCH, 1, BY_RATE) == 3


def test_a_winch_without_an_output_is_not_armed(station: Any) -> None:
    rig = station(parameters=WINCH | {"SERVO9_FUNCTION": 0})
    assert rig.command(ARM, 1) == 4
    assert "winch unhealthy" in " ".join(rig.texts())
