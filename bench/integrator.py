"""Integrators of a flying body by error and cost, against a fine reference: `python bench/integrator.py`.

One quadrotor climbs on unequal motor commands for two seconds, so that it rolls and yaws in still air; above
the ground its equations are smooth. Rotors follow their exact law and the battery's voltage holds over a step
in all methods, as in a flight, so that the errors contain that of the voltage. The error is the distance from
the state that the classical Runge-Kutta method reaches in steps of 16 us; the cost is the number of slopes a
second, and the time of the compiled loop as a ratio to Runge-Kutta at 500 Hz. Below stand the errors of the
sensors: an integrator's error matters once it is no longer far below theirs.
"""

from __future__ import annotations

from collections.abc import Callable
from math import dist
from statistics import median
from time import process_time
from typing import Any

from volery.base.elementary import exp
from volery.base.frames import LocalFrame
from volery.base.numeric_code import NumericCode, numeric
from volery.simulation.world.body_specs import Multirotor
from volery.simulation.world.dynamics import electrical_power, multirotor_slope, turn_rotors, volts_amps
from volery.simulation.world.sensors import declared_sigma
from volery.simulation.world.state_layout import (
    ADVANCED,
    MOTION,
    P_ROTOR_DECAY,
    S_AMPS,
    S_ATTITUDE,
    S_CHARGE,
    S_POSITION,
    S_ROTORS,
    S_VOLTS,
    W_SLOPE,
    W_STATE,
    W_THROTTLE,
    Array,
)
from volery.simulation.world.world import World

SECONDS = 2.0
REFERENCE_HZ = 64_000
THROTTLES = 0.62, 0.625, 0.63, 0.622
ROUNDS = 15
SPEC = Multirotor(at=(0.0, 0.0, 0.0))


@numeric
def load_battery(row: Array, step: float) -> None:
    """Compute the voltage that holds over a step, and draw its charge."""
    row[S_VOLTS], row[S_AMPS] = volts_amps(row, electrical_power(row))
    row[S_CHARGE] += step * row[S_AMPS]


def euler(row: Array, step: float, steps: int) -> int:
    """The explicit method of Euler: one slope a step."""
    for _ in range(steps):
        load_battery(row, step)
        for i in range(ADVANCED):
            row[W_STATE + i] = row[i]
        multirotor_slope(row)
        for i in range(MOTION):
            row[i] += step * row[W_SLOPE + i]
        turn_rotors(row, 0, W_STATE)
        turn_rotors(row, W_STATE, 0)
    return 1


def midpoint(row: Array, step: float, steps: int) -> int:
    """The midpoint method (Runge 1895): two slopes a step."""
    for _ in range(steps):
        load_battery(row, step)
        for i in range(ADVANCED):
            row[W_STATE + i] = row[i]
        multirotor_slope(row)
        for i in range(MOTION):
            row[W_STATE + i] = row[i] + 0.5 * step * row[W_SLOPE + i]
        turn_rotors(row, 0, W_STATE)
        multirotor_slope(row)
        for i in range(MOTION):
            row[i] += step * row[W_SLOPE + i]
        turn_rotors(row, W_STATE, 0)
    return 1


def runge_kutta(row: Array, step: float, steps: int) -> int:
    """The classical method of Kutta (1901): four slopes a step."""
    start = row[:MOTION].copy()
    for _ in range(steps):
        load_battery(row, step)
        for i in range(ADVANCED):
            row[W_STATE + i] = row[i]
        for i in range(MOTION):
            start[i] = row[i]
        for stage in range(4):
            multirotor_slope(row)
            weight = 1.0 if stage in (0, 3) else 2.0
            ahead = 0.5 * step if stage < 2 else step
            for i in range(MOTION):
                row[i] += step / 6.0 * weight * row[W_SLOPE + i]
                row[W_STATE + i] = start[i] + ahead * row[W_SLOPE + i]
            if stage == 0:
                turn_rotors(row, 0, W_STATE)
            elif stage == 2:
                turn_rotors(row, W_STATE, W_STATE)
        for i in range(4):
            row[S_ROTORS + i] = row[W_STATE + S_ROTORS + i]
    return 1


METHODS: dict[str, tuple[Callable[..., Any], int]] = {
    "Runge-Kutta": (runge_kutta, 4),
    "midpoint": (midpoint, 2),
    "Euler": (euler, 1),
}


ARGUMENTS = ("float64[::1]", "float64", "int64")


def start() -> Array:
    """Return the row of a quadrotor 100 m above the ground, its rotors at their speed in hover."""
    world = World(lambda: 0, [SPEC], frame=LocalFrame(47.4, 8.5, 488.0))
    row: Array = world.arrays.rows[0].copy()
    row[S_POSITION + 2] = 100.0
    row[S_ROTORS : S_ROTORS + 4] = 500.0
    row[W_THROTTLE : W_THROTTLE + 4] = THROTTLES
    return row


def flown(method: Callable[..., Any], rate: int) -> tuple[Array, float]:
    """Return the row after the flight, and the processor time of the loop [s]."""
    row = start()
    row[P_ROTOR_DECAY] = exp(-0.5 / rate / SPEC.rotor_lag)
    began = process_time()
    method(row, 1.0 / rate, round(SECONDS * rate))
    return row, process_time() - began


def main() -> None:
    compiled = {
        name: (
            NumericCode(name, lambda _, method=method: method, (), ARGUMENTS).by_numba(cache=False),
            slopes,
        )
        for name, (method, slopes) in METHODS.items()
    }
    for method, _ in compiled.values():
        flown(method, 10)
    exact, _ = flown(compiled["Runge-Kutta"][0], REFERENCE_HZ)
    rows = [(name, rate) for name in METHODS for rate in (1000, 500, 250, 125)]
    times: dict[tuple[str, int], list[float]] = {row: [] for row in rows}
    for _ in range(ROUNDS):
        for name, rate in rows:
            times[name, rate].append(flown(compiled[name][0], rate)[1])
    usual = median(times["Runge-Kutta", 500])
    print(f"{'method':12}{'Hz':>6}{'slopes/s':>10}{'position [m]':>15}{'attitude [rad]':>16}{'time':>8}")
    for name, rate in rows:
        method, slopes = compiled[name]
        end, _ = flown(method, rate)
        off = dist(end[S_POSITION : S_POSITION + 3], exact[S_POSITION : S_POSITION + 3])
        turned = 2.0 * dist(end[S_ATTITUDE : S_ATTITUDE + 4], exact[S_ATTITUDE : S_ATTITUDE + 4])
        took = median(times[name, rate]) / usual
        print(f"{name:12}{rate:6}{slopes * rate:10}{off:15.1e}{turned:16.1e}{took:7.2f}x")
    for sensors in ("consumer", "rtk"):
        sigma = declared_sigma(sensors).horizontal
        print(f"declared sigma of horizontal position, {sensors} sensors: {sigma:.2g} m")


if __name__ == "__main__":
    main()
