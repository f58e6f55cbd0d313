import itertools
import math

import pytest

from volery.base.errors import UsageError
from volery.base.time import S
from volery.simulation.world.body_specs import BatteryPack, Multirotor, WheeledRover
from volery.simulation.world.dynamics import battery_current, cell_voltage
from volery.simulation.world.state_layout import U_THROTTLE
from volery.simulation.world.world import STEP, World


def test_open_circuit_voltage_falls_without_a_jump():
    volts = [cell_voltage(left / 1000.0) for left in range(1001)]
    steps = [after - before for before, after in itertools.pairwise(volts)]
    assert volts[0] == pytest.approx(3.0)
    assert volts[-1] == pytest.approx(4.2)
    assert all(0.0 < step < 0.0105 for step in steps)


def test_open_circuit_voltage_is_that_of_a_measured_cell():
    """Chen and Rincon-Mora, IEEE Trans. Energy Conversion 21 (2006), eq. 2."""
    for percent in range(5, 101):
        s = percent / 100.0
        measured = -1.031 * math.exp(-35.0 * s) + 3.685 + 0.2156 * s - 0.1178 * s**2 + 0.3201 * s**3
        assert cell_voltage(s) == pytest.approx(measured, abs=0.1)


def test_current_gives_the_power_at_the_terminals():
    for power in (0.0, 10.0, 150.0, 600.0):
        amps = battery_current(12.6, 0.02, power)
        assert (12.6 - 0.02 * amps) * amps == pytest.approx(power, abs=1e-9)


def test_beyond_its_largest_power_the_battery_browns_out():
    assert battery_current(12.0, 0.1, 1e9) == pytest.approx(60.0)


def own_ocv(left):
    """Rest voltage of a cell through the points of the law's table."""
    table = [(0.0, 3.0), (0.05, 3.52), (0.1, 3.67), (0.2, 3.73), (0.5, 3.84), (0.9, 4.06), (1.0, 4.2)]
    for (s0, v0), (s1, v1) in itertools.pairwise(table):
        if left <= s1:
            return v0 + (v1 - v0) * (left - s0) / (s1 - s0)
    return 4.2


def test_charge_removed_is_that_of_rotors_and_computer(clock, frame):
    """Against an integration of its own: powers from rotor speeds, currents from the circuit, trapezoids."""
    spec = Multirotor(sensors="perfect", battery=BatteryPack(capacity_ah=0.5))
    world = World(clock, [spec], frame=frame)
    truth = world.truth(0)
    charge, energy, payload, now = 0.0, 0.0, 0.0, None
    computer = 5.0
    world.payload_power(0, computer)
    steps = 15 * S // STEP
    for step in range(steps):
        if step % 1500 == 0:
            throttle = (0.45, 0.5, 0.4, 0.55, 0.48)[step // 1500]
            world.set_input(0, U_THROTTLE, *(throttle,) * 4)
        clock.now += STEP
        before, truth = truth, world.truth(0)
        if now is None:  # the first interval still has the inputs of the start
            charge, energy, now = truth.charge_as, truth.energy_j, 0.0
        amps, watts = [], []
        start = computer if step > 1 else 0.0  # the current at a step's start is that of the inputs before it
        for state, drawn, extra in (
            (before, charge, start),
            (truth, charge + truth.amps * STEP / S, computer),
        ):
            shaft = spec.torque_coefficient * sum(speed**3 for speed in state.rotors)
            power = shaft / spec.efficiency + spec.idle_power + extra
            volts = own_ocv(1.0 - drawn / (0.5 * 3600.0)) * spec.battery.cells
            root = math.sqrt(volts**2 - 4.0 * spec.battery.resistance_ohm * power)
            amps.append((volts - root) / (2.0 * spec.battery.resistance_ohm))
            watts.append(power)
        if step > 0:
            charge += 0.5 * sum(amps) * STEP / S
            energy += 0.5 * sum(watts) * STEP / S
            payload += computer * STEP / S
    assert truth.charge_as == pytest.approx(charge, rel=1e-6)
    assert truth.energy_j == pytest.approx(energy, rel=1e-6)
    assert truth.payload_j == pytest.approx(payload, rel=1e-3)
    assert truth.battery_left == pytest.approx(1.0 - charge / 1800.0, rel=1e-6)


def test_a_full_rotor_slows_down_as_the_battery_sags(clock, frame):
    spec = Multirotor(sensors="perfect", battery=BatteryPack(capacity_ah=1.3))
    world = World(clock, [spec], frame=frame)
    world.set_input(0, U_THROTTLE, 1.0, 1.0, 1.0, 1.0)
    clock.wait(1)
    first = world.truth(0)
    clock.wait(20)
    second = world.truth(0)
    assert second.volts < first.volts < 12.6
    assert second.rotors[0] < first.rotors[0]
    assert second.rotors[0] == pytest.approx(spec.top_speed * second.volts / 12.6, rel=1e-3)


def test_driving_costs_more_than_standing(clock, frame):
    world = World(clock, [WheeledRover(sensors="perfect", idle_power=5.0)] * 2, frame=frame)
    world.set_input(0, U_THROTTLE, 0.0, 0.2)
    clock.wait(30)
    driving, standing = world.truth(0), world.truth(1)
    assert standing.energy_j == pytest.approx(30.0 * 5.0, rel=1e-9)
    assert driving.energy_j > 3.0 * standing.energy_j


@pytest.mark.parametrize(
    "values", [{"capacity_ah": 0.0}, {"cells": 0}, {"resistance_ohm": -1.0}, {"left": 0.0}]
)
def test_an_impossible_battery_is_refused(values):
    with pytest.raises(UsageError, match="battery"):
        BatteryPack(**values)


def test_a_cell_breaks_down_once_it_is_empty():
    assert cell_voltage(-0.01) < 2.5
    assert cell_voltage(-1.0) == 0.0
    assert battery_current(0.0, 0.01, 50.0) == 0.0


def test_an_empty_battery_stops_the_rotors(clock, frame):
    world = World(clock, [Multirotor(sensors="perfect", battery=BatteryPack(capacity_ah=0.05))], frame=frame)
    world.set_input(0, U_THROTTLE, 0.7, 0.7, 0.7, 0.7)
    clock.wait(3)
    assert world.truth(0).position[2] > 2.0
    clock.wait(30)
    truth = world.truth(0)
    assert truth.battery_left == 0.0
    assert truth.on_ground
    assert max(truth.rotors) < 20.0


@pytest.mark.parametrize(
    ("spec", "values", "name"),
    [
        (Multirotor, {"mass": 0.0}, "multirotor: mass"),
        (Multirotor, {"inertia": (0.02, 0.0, 0.04)}, "multirotor: inertia"),
        (WheeledRover, {"wheelbase": -1.0}, "rover: wheelbase"),
    ],
)
def test_an_impossible_body_is_refused(spec, values, name):
    with pytest.raises(UsageError, match=name):
        spec(**values)


def test_a_payload_cannot_give_power(clock, frame):
    world = World(clock, [Multirotor()], frame=frame)
    with pytest.raises(UsageError, match="payload"):
        world.payload_power(0, -1.0)
