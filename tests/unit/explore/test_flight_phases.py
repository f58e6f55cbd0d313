"""Phases of a flight, from states and operations."""

from __future__ import annotations

import pytest

from volery.base.time import S
from volery.explore.flight_phases import flight_phases
from volery.trace.events import Operation, VehicleState


def state(second, height, along=0.0, up=0.0, armed=True, vehicle="drone_1"):
    position, still = (0.0, 0.0, height), (1.0, 0.0, 0.0, 0.0)
    estimate = (*position, 1.0, 12.0, 1.0)
    return VehicleState(second * S, vehicle, *position, *still, along, 0.0, up, *estimate, armed, "GUIDED")


def flight(vehicle="drone_1"):
    """Return a flight: armed at 2 s, up until 10 s, still until 20 s, along until 50 s, down until 60 s."""
    yield from (state(at, 0.1, armed=at >= 2, vehicle=vehicle) for at in range(4))
    yield from (state(at, 2.0 * (at - 3), up=2.0, vehicle=vehicle) for at in range(4, 10))
    yield from (state(at, 14.0, vehicle=vehicle) for at in range(10, 20))
    yield from (state(at, 14.0, along=8.0, vehicle=vehicle) for at in range(20, 50))
    yield from (state(at, 1.4 * (60 - at), up=-1.4, vehicle=vehicle) for at in range(50, 60))
    yield from (state(at, 0.1, armed=at < 63, vehicle=vehicle) for at in range(60, 65))


def seconds(phases):
    return {name: {vehicle: at / S for vehicle, at in times.items()} for name, times in phases.items()}


def test_states_show_the_phases_of_a_flight():
    assert seconds(flight_phases(flight())) == {
        "arming": {"drone_1": 2.0},
        "take-off": {"drone_1": 7.0},
        "cruise": {"drone_1": 34.5},
        "hover": {"drone_1": 14.5},
        "landing": {"drone_1": 55.0},
        "ground contact": {"drone_1": 60.0},
    }


def test_a_rover_drives_and_halts_whatever_the_height_of_the_ground():
    driven = [state(at, 0.1 * at, along=3.0, vehicle="rover_1") for at in range(10)]
    halted = [state(at, 0.9, vehicle="rover_1") for at in range(10, 15)]
    found = seconds(flight_phases([*driven, *halted, *flight()], {"rover_1"}))
    assert found["drive"] == {"rover_1": 4.5}
    assert found["halt"] == {"rover_1": 12.0}
    assert found["arming"] == {"rover_1": 0.0, "drone_1": 2.0}
    assert found["cruise"] == {"drone_1": 34.5}


def test_other_operations_are_phases_under_their_names():
    def operation(name, start, end):
        return Operation(start * S, end * S, "drone_1", name, "", "ok", "", 0.0, 0.0, 0.0, 0.0)

    events = [operation("goto", 20, 50), operation("rotate", 12, 13), operation("rotate", 14, 18)]
    found = seconds(flight_phases([*flight(), *events]))
    assert found["rotate"] == {"drone_1": 16.0}
    assert "goto" not in found


@pytest.mark.parametrize("last", [30, 8])
def test_a_run_that_ends_in_the_air_has_no_landing(last):
    found = flight_phases([one for one in flight() if one.at < last * S])
    assert {"landing", "ground contact"}.isdisjoint(found)
    assert found["arming"] == {"drone_1": 2 * S}


def test_what_is_never_armed_has_no_phase():
    assert flight_phases([state(at, 0.0, armed=False) for at in range(5)]) == {}
