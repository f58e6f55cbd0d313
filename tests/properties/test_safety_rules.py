"""Rules of safety that hold for every driver, each before its simulated autopilot in virtual time."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from math import dist, hypot, isnan

import pytest
from hypothesis import HealthCheck, Phase, example, given, settings
from hypothesis import strategies as st

from volery.base.errors import VehicleError, VoleryError
from volery.testing.fault_trials import FAULTS, strike
from volery.testing.stage import SimulatedStage
from volery.trace.events import VehicleState
from volery.vehicles import Drone, Limits
from volery.vehicles.address import parse

every_driver = pytest.mark.parametrize("autopilot", ["ardupilot", "px4", "paparazzi", "dji"])

few = settings(
    max_examples=3,
    deadline=None,
    derandomize=True,
    phases=(Phase.explicit, Phase.generate),
    suppress_health_check=list(HealthCheck),
)
"""Each example is a whole flight."""

GOAL = (40.0, 10.0, 12.0)
"""North, east, up about home [m]."""

NEAR_M, STANDS_M_S, WITHIN_S = 5.0, 0.7, 240.0
DJI_LANDS_M = 20.0
"""Distance from home within which a DJI that is ordered to go home lands where it is [m]."""


class Flight:
    """One drone, what its program does, and its true state."""

    def __init__(self, autopilot: str, *, cold: bool = False) -> None:
        self.stage = SimulatedStage(parse(f"sim:{autopilot}?wire=bytes"), Drone, 1, cold=cold)
        self.drone: Drone = self.stage.drone

    @property
    def truth(self) -> VehicleState:
        return self.stage.fleet.autopilots[self.stage.name_of_vehicle].state()

    @property
    def speed(self) -> float:
        return hypot(self.truth.vx, self.truth.vy, self.truth.vz)

    def perform(self, program: Callable[[], object]) -> None:
        def body() -> None:
            self.drone.wait_connected()
            program()

        try:
            self.stage.perform(body)
        finally:
            self.stage.close()

    def until(self, holds: Callable[[], bool], otherwise: str) -> None:
        self.stage.until(holds, WITHIN_S, otherwise)

    def goto(self, speed: float | None = None) -> None:
        self.drone.goto(self.stage.at(*GOAL), speed=speed)

    def away_from_goal(self) -> float:
        north, east, up = GOAL
        return dist((self.truth.x, self.truth.y, self.truth.z), (east, north, up))


# --- an order of safety is never refused because of a state that it would end ---


def travelling(flight: Flight) -> None:
    flight.stage.later(0.0, flight.goto)
    flight.stage.sleep(3.0)


def moving(flight: Flight) -> None:
    flight.drone.set_velocity(3.0, 0.0, 0.0)
    flight.stage.sleep(2.0)


def out_of_bounds(flight: Flight) -> None:
    flight.goto()
    flight.drone.limits = Limits(farthest=10.0, highest=5.0)


def below_its_reserve(flight: Flight) -> None:
    flight.drone.limits = Limits(battery_reserve=0.999)


def climbing(flight: Flight) -> None:
    flight.stage.later(0.0, lambda: flight.drone.goto(flight.stage.at(0.0, 0.0, 40.0)))
    flight.stage.sleep(2.0)


STATES = (travelling, moving, out_of_bounds, below_its_reserve, climbing)
ORDERS = ("land", "hold", "return_home")


@every_driver
@few
@given(st.sampled_from(STATES), st.sampled_from(ORDERS))
@example(moving, "return_home")
def test_an_order_of_safety_is_obeyed_in_every_state_that_it_ends(
    autopilot: str, state: Callable[[Flight], None], order: str
) -> None:
    flight = Flight(autopilot)

    def program() -> None:
        flight.drone.takeoff(10)
        state(flight)
        getattr(flight.drone, order)()
        if order == "hold":
            assert flight.speed < STANDS_M_S
        else:
            assert not flight.truth.armed
            assert flight.truth.z < 1.0
        if order == "return_home":
            assert hypot(flight.truth.x, flight.truth.y) < (DJI_LANDS_M if autopilot == "dji" else NEAR_M)

    flight.perform(program)


@every_driver
@few
@given(st.sampled_from(["disarm", "land"]), st.floats(0.0, 3.0))
def test_motors_on_the_ground_are_stopped_by_either_order(autopilot: str, order: str, after: float) -> None:
    flight = Flight(autopilot)

    def program() -> None:
        flight.drone.wait_ready()
        flight.drone.hold()
        flight.drone.arm()
        flight.stage.sleep(after)
        getattr(flight.drone, order)()
        flight.until(lambda: not flight.truth.armed, "its motors are on")
        assert flight.truth.z < 1.0

    flight.perform(program)


# --- unknown is never a number ---


@every_driver
@few
@given(st.floats(0.0, 40.0))
def test_what_is_stated_is_near_the_truth_and_else_it_is_unknown(autopilot: str, uptime: float) -> None:
    flight = Flight(autopilot, cold=True)
    stage, drone = flight.stage, flight.drone

    def look() -> None:
        stage.sleep(uptime)
        truth = flight.truth
        battery = drone.battery
        assert isnan(battery.remaining) or abs(battery.remaining - truth.battery) < 0.05
        assert isnan(battery.volts) or battery.volts == pytest.approx(truth.volts, rel=0.05)
        assert isnan(battery.amperes) or battery.amperes >= 0.0
        assert all(isnan(one) or abs(one) < 2.0 for one in drone.velocity)
        try:
            there = drone.position
        except VehicleError:
            return
        origin = stage.fleet.frame
        assert dist(origin.to_enu(there.latitude, there.longitude, there.altitude.metres), (0, 0, 0)) < NEAR_M

    try:
        stage.perform(look)
    finally:
        stage.close()


# --- a position that is old or without a fix decides nothing ---


def without_satellites(flight: Flight) -> None:
    flight.stage.flight.block_gps()


def without_messages(flight: Flight) -> None:
    flight.stage.link_control.receives = False


@every_driver
@few
@given(st.sampled_from([without_satellites, without_messages]), st.floats(0.5, 8.0))
def test_nothing_arrives_by_a_position_that_is_none(
    autopilot: str, lose: Callable[[Flight], None], after: float
) -> None:
    flight = Flight(autopilot)

    def program() -> None:
        flight.drone.takeoff(10)
        flight.stage.later(after, lambda: lose(flight))
        try:
            flight.goto()
        except VoleryError as error:
            said = str(error)
        else:
            said = flight.drone.name
            assert flight.away_from_goal() < NEAR_M
        assert flight.drone.name in said

    flight.perform(program)


# --- what is sent once is repeated until it is seen ---

SENT = ("land", "hold", "return_home", "goto", "stop")


@every_driver
@few
@given(st.sampled_from(SENT), st.floats(0.05, 2.0))
def test_an_order_whose_first_messages_are_lost_takes_effect(autopilot: str, order: str, lost: float) -> None:
    flight = Flight(autopilot)
    wire = flight.stage.link_control

    def restore() -> None:
        wire.sends = True

    def program() -> None:
        flight.drone.takeoff(10)
        if order == "stop":
            flight.stage.later(3.0 - lost / 2.0, lambda: setattr(wire, "sends", False))
            flight.stage.later(3.0 + lost / 2.0, restore)
            flight.drone.set_velocity(3.0, 0.0, 0.0, lasting=3.0)
        else:
            wire.sends = False
            flight.stage.later(lost, restore)
            flight.goto() if order == "goto" else getattr(flight.drone, order)()
        if order == "goto":
            assert flight.away_from_goal() < NEAR_M
        elif order in ("hold", "stop"):
            flight.until(lambda: flight.speed < STANDS_M_S, "it flies on")
        else:
            flight.until(lambda: not flight.truth.armed, "it was never commanded")

    flight.perform(program)


# --- nothing leaves a vehicle with motors running without a report ---

PARTED = sorted(FAULTS.keys() - {"killed"})


@every_driver
@few
@given(st.sampled_from(PARTED), st.floats(0.0, 20.0))
def test_a_program_ends_on_the_ground_or_with_a_report(autopilot: str, fault: str, after: float) -> None:
    flight = Flight(autopilot)

    def program() -> None:
        drone = flight.drone
        flight.stage.later(after, lambda: strike(FAULTS[fault], flight.stage))
        with suppress(VoleryError):
            drone.takeoff(10)
            flight.goto()
        try:
            said = drone.come_to_rest()
        except VoleryError as error:
            said = f"{drone.name}: is left to itself" if drone.name in str(error) else ""
        if flight.truth.armed:
            assert "is left to" in said

    flight.perform(program)
