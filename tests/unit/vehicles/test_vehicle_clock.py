"""Whose clock counts a duration: the vehicle's where it runs faster or slower, else the program's."""

from __future__ import annotations

import pytest

from volery.base.time import MS, S
from volery.vehicles.vehicle_clock import Moment, VehicleClock


def reported(rate: float, until: int, *, booted: int = 0) -> VehicleClock:
    """A clock that was reported ten times a second from the start to *until*, ns."""
    clock = VehicleClock()
    for now in range(0, until + 1, 100 * MS):
        clock.note(booted + round(rate * now), now)
    return clock


def ahead(clock: VehicleClock, now: int) -> Moment:
    return Moment(now, clock.time(now))


@pytest.mark.parametrize("rate", [0.5, 3.0, 10.0])
def test_a_short_duration_goes_by_what_was_seen_before(rate: float) -> None:
    clock = reported(rate, 20 * S, booted=100 * S)
    since = ahead(clock, 20 * S)
    clock.note(100 * S + round(rate * 21 * S), 21 * S)
    assert clock.elapsed(since, 21 * S) == round(rate * S)


@pytest.mark.parametrize("rate", [0.9, 1.0, 1.2])
def test_clocks_that_agree_within_a_quarter_leave_it_to_the_program(rate: float) -> None:
    clock = reported(rate, 30 * S)
    assert clock.elapsed(Moment(0, 0), 30 * S) == 30 * S
    assert clock.elapsed(Moment(29 * S, clock.time(29 * S)), 30 * S) == S


def test_nothing_is_compared_before_five_seconds() -> None:
    clock = reported(3.0, 4 * S)
    assert clock.elapsed(Moment(0, 0), 4 * S) == 4 * S
    clock = reported(3.0, 5 * S)
    assert clock.elapsed(Moment(0, 0), 5 * S) == 15 * S


def test_a_clock_that_became_as_fast_as_the_programs_counts_no_more() -> None:
    clock = reported(3.0, 20 * S)
    for now in range(20 * S, 41 * S, 100 * MS):
        clock.note(60 * S + now - 20 * S, now)
    since = ahead(clock, 40 * S)
    clock.note(83 * S, 42 * S)  # a second ahead of the program within two: a message came late before
    assert clock.elapsed(since, 42 * S) == 2 * S


def test_a_message_that_was_overtaken_is_ignored_and_a_reboot_starts_anew() -> None:
    clock = reported(3.0, 20 * S)
    clock.note(59 * S, 20 * S + MS)
    assert clock.time(20 * S) == 60 * S
    before = ahead(clock, 20 * S)
    clock.note(S, 21 * S)
    assert clock.time(21 * S) == S
    assert clock.elapsed(before, 21 * S) == S  # of the program: the vehicle's began anew
    assert clock.elapsed(ahead(clock, 21 * S), 23 * S) == 2 * S


def test_what_was_held_back_on_the_way_is_no_point_of_comparison() -> None:
    clock = reported(1.0, 20 * S)
    clock.note(21 * S, 31 * S, fresh=False)  # ten seconds late
    for now in range(31 * S, 45 * S, 100 * MS):
        clock.note(now, now)
    since = ahead(clock, 44 * S)
    clock.note(47 * S, 46 * S)
    assert clock.elapsed(since, 46 * S) == 2 * S


def test_without_a_report_the_program_counts() -> None:
    clock = VehicleClock()
    assert clock.time(S) == -1
    assert clock.elapsed(Moment(0, -1), 9 * S) == 9 * S
