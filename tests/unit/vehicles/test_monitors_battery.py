"""When a battery ends travelling, and when it ends the flight."""

from __future__ import annotations

from math import inf, nan

import pytest

from volery.base.errors import CriticalBattery, LowBattery
from volery.base.time import S
from volery.kernel.virtual import VirtualKernel
from volery.testing.stage import SimulatedStage
from volery.vehicles import Battery, Drone, Limits
from volery.vehicles.address import parse
from volery.vehicles.monitors import (
    ASSUMED_ENDURANCE_S,
    BatteryMonitor,
    count_cells,
    landing_time,
)
from volery.vehicles.telemetry import Telemetry


class Reported:
    """Telemetry of a drone whose battery is reported as stated."""

    def __init__(self, remaining: float = nan, volts: float = 12.0, height: float = 10.0) -> None:
        self.seen = Telemetry(VirtualKernel(), "craft_1")
        self.seen.kind, self.seen.armed, self.seen.flying = "drone", True, True
        self.seen.above_home = height
        self.seen.last_message_ns = 0
        self.monitor = BatteryMonitor(self.seen)
        self.report(remaining, volts)

    def report(self, remaining: float, volts: float = 12.0) -> None:
        self.seen.battery = Battery(remaining, volts, 10.0)

    def check(self, at_s: float, limits: Limits | None = None, *, travels: bool = True) -> LowBattery | None:
        return self.monitor.check(
            "go", round(at_s * S), limits or Limits(battery_reserve=0.2), travels=travels
        )


def test_a_battery_that_sags_for_a_moment_is_not_empty() -> None:
    drone = Reported(0.19)
    assert drone.check(0) is None
    assert drone.check(2) is None
    drone.report(0.21)
    assert drone.check(3) is None
    drone.report(0.18)
    assert drone.check(4) is None
    error = drone.check(7)
    assert isinstance(error, LowBattery)
    assert not isinstance(error, CriticalBattery)
    assert "at 18%, below the reserve of 20%" in str(error)


def test_one_that_does_not_travel_may_be_below_the_reserve() -> None:
    drone = Reported(0.18)
    assert drone.check(0, travels=False) is None
    assert drone.check(60, travels=False) is None


def test_a_battery_that_is_not_measured_ends_nothing() -> None:
    drone = Reported(nan, nan)
    assert drone.check(0) is None
    assert drone.check(10) is None


def test_the_time_of_a_landing_is_that_of_the_slowest_firmware() -> None:
    assert landing_time(10.0) == pytest.approx(20.0 + 5.0)
    assert landing_time(40.0) == pytest.approx(20.0 + 20.0 + 5.0)
    assert landing_time(-3.0) == pytest.approx(5.0)
    assert landing_time(nan) == landing_time(10.0)


@pytest.mark.parametrize(("height", "share"), [(5.0, 0.07), (10.0, 0.103), (100.0, 0.303)])
def test_the_higher_it_is_the_earlier_it_lands(height: float, share: float) -> None:
    drone = Reported(0.5, height=height)
    assert drone.monitor.share_to_land(Limits()) == pytest.approx(share, abs=1e-3)
    drone.report(share - 0.01)
    assert drone.check(0) is None
    error = drone.check(1.1)
    assert isinstance(error, CriticalBattery)
    assert "suffices for a landing only, with 2% left (Limits.landing_reserve)" in str(error)


def test_consumption_is_measured_in_flight() -> None:
    drone = Reported(1.0)
    assert drone.monitor.consumption == pytest.approx(1.0 / ASSUMED_ENDURANCE_S)
    for second in range(90):
        drone.report(int(100.0 - second / 20.0) / 100.0)  # half an hour on a charge, in whole percent
        assert drone.check(second) is None
    assert drone.monitor.consumption == pytest.approx(1.0 / 2000.0, rel=0.05)
    assert drone.monitor.share_to_land(Limits()) == pytest.approx(0.035, abs=1e-3)


def test_a_failing_battery_is_no_consumption() -> None:
    drone = Reported(0.9)
    drone.check(0)
    drone.check(30)
    drone.report(0.5)
    drone.check(31)
    assert drone.monitor.consumption == pytest.approx(1.0 / ASSUMED_ENDURANCE_S)


def test_what_has_landed_or_shall_never_be_landed_is_left_alone() -> None:
    drone = Reported(0.01)
    never = Limits(battery_reserve=0.0, landing_reserve=0.0)
    assert drone.check(0, never) is None
    assert drone.check(5, never) is None
    drone.seen.flying = False
    assert drone.check(10, travels=False) is None
    assert drone.check(15, travels=False) is None


@pytest.mark.parametrize(
    ("volts", "cells"),
    [
        (12.6, 3),
        (11.4, 3),
        (16.8, 4),
        (22.2, 6),
        (25.2, 6),
        (50.4, 0),
        (3.9, 1),
        (13.05, 0),
        (0.0, 0),
        (inf, 0),
    ],
)
def test_cells_are_counted_by_the_voltage_at_rest(volts: float, cells: int) -> None:
    assert count_cells(volts) == cells


def test_a_battery_of_which_only_the_voltage_is_known() -> None:
    drone = Reported(nan, 12.4)
    drone.seen.armed = drone.seen.flying = False
    stock = Limits()
    assert drone.check(0, stock) is None  # three cells
    drone.seen.armed = drone.seen.flying = True
    drone.report(nan, 10.9)
    assert drone.check(1, stock) is None
    drone.report(nan, 10.7)
    assert drone.check(2, stock) is None
    error = drone.check(5.1, stock)
    assert "at 3.57 V per cell, below 3.6 V; return_home()" in str(error)
    drone.report(nan, 10.4)
    drone.check(6, stock)
    error = drone.check(7.1, stock)
    assert isinstance(error, CriticalBattery)
    assert "at 3.47 V per cell" in str(error)


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4", "paparazzi", "dji"])
def test_a_drone_that_is_left_hovering_lands_with_its_reserve(autopilot: str) -> None:
    """By truth; a DJI by its own failsafe, since a node's loop that is not run monitors nothing."""
    stage = SimulatedStage(parse(f"sim:{autopilot}"), Drone, 3)

    def truth() -> tuple[bool, float]:
        state = stage.fleet.autopilots[stage.name_of_vehicle].state()
        return state.armed, state.battery

    def flight() -> None:
        stage.drone.takeoff(10)
        stage.flight.set_charge(0.16)
        stage.sleep(90.0)

    stage.perform(flight)
    armed, left = truth()
    assert not armed
    assert left >= 0.01  # the reserve of 2 %, less the percent in which it is reported
    if autopilot != "dji":
        landed = [event for event in stage.events if getattr(event, "operation", "") == "land"]
        assert [event.outcome for event in landed] == ["ok"]
    stage.close()


def test_the_simulated_battery_of_px4_does_not_end_a_flight() -> None:
    """In its first 30 s it loses half of its charge, and then nothing."""
    drone = Reported(1.0, height=20.0)
    for second in range(120):
        drone.report(max(0.5, 1.0 - second / 60.0))
        assert drone.check(second) is None, second


def test_a_battery_that_lasts_for_two_minutes_does() -> None:
    drone = Reported(1.0, height=20.0)
    found = []
    for second in range(110):
        drone.report(1.0 - second / 120.0)
        found.append(drone.check(second))
    assert isinstance(next(error for error in found if error is not None), CriticalBattery)
