"""Physics against RotorPy and against plain C at the same step rate, in one run: `python bench/physics.py`.

Both integrate one quadrotor of six degrees of freedom with motor lag and drag from constant motor commands,
in steps of 2 ms; RotorPy with its own integrator (solve_ivp, RK45) one step a call as its users do, ours with
midpoints, battery, contact and sensors included, long calls and calls of one step. Vehicles with estimator
and control are compared with `plain_body.c`: the same equations of motion under three loops, without sensors,
estimator and ground, compiled here by the C compiler with -O2. Rounds alternate; medians are shown.
"""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from statistics import median
from time import perf_counter

import numpy as np

from volery.base.frames import LocalFrame
from volery.base.time import S
from volery.simulation.autopilots.flight_stack.flight import Control, Flight, Setpoint, make_world
from volery.simulation.world.body_specs import Multirotor
from volery.simulation.world.state_layout import U_THROTTLE
from volery.simulation.world.world import STEP, World

HERE = LocalFrame(47.3977, 8.5456, 488.0)
ROUNDS = 5
STEPS_PER_SECOND = S // STEP
WANTED = 200.0


class Clock:
    """A time that is set by hand."""

    def __init__(self) -> None:
        self.now = 0

    def __call__(self) -> int:
        return self.now


def seconds_for(work: Callable[[], object]) -> float:
    start = perf_counter()
    work()
    return perf_counter() - start


def rotorpy_steps(steps: int) -> float:
    """Steps a second of RotorPy's Hummingbird hovering on constant motor speeds."""
    from rotorpy.vehicles.hummingbird_params import quad_params  # noqa: PLC0415  # in the bench group alone
    from rotorpy.vehicles.multirotor import Multirotor as Theirs  # noqa: PLC0415  # the same

    vehicle = Theirs(quad_params, control_abstraction="cmd_motor_speeds")
    hover = float(np.sqrt(quad_params["mass"] * 9.81 / (4 * quad_params["k_eta"])))
    state = dict(vehicle.initial_state)
    state["rotor_speeds"] = np.full(4, hover)
    control = {"cmd_motor_speeds": np.full(4, hover)}

    def work() -> None:
        current = state
        for _ in range(steps):
            current = vehicle.step(current, control, STEP / S)

    return steps / seconds_for(work)


def free_world(bodies: int) -> tuple[Clock, World]:
    """Bodies that fly on constant motor commands, without any autopilot."""
    clock = Clock()
    world = World(clock, [Multirotor(at=(10.0 * index, 0.0, 0.0)) for index in range(bodies)], frame=HERE)
    for index in range(bodies):
        world.set_input(index, U_THROTTLE, 0.62, 0.62, 0.62, 0.62)
        world.advance_to_now(index)
    clock.now = S
    for index in range(bodies):
        world.advance_to_now(index)
    return clock, world


def our_steps(bodies: int, simulated: int, per_call: int) -> float:
    """Body-steps a second of our bodies, *per_call* grid steps between reads."""
    clock, world = free_world(bodies)
    calls = simulated * STEPS_PER_SECOND // per_call

    def work() -> None:
        for _ in range(calls):
            clock.now += per_call * STEP
            for index in range(bodies):
                world.advance_to_now(index)

    return calls * per_call * bodies / seconds_for(work)


def flying(vehicles: int) -> tuple[Clock, list[Flight]]:
    """Vehicles with estimator and inner loops, on their way to a point."""
    clock = Clock()
    specs = [Multirotor(at=(10.0 * index, 0.0, 0.0)) for index in range(vehicles)]
    _, flights = make_world(clock, specs, seed=7, frame=HERE)
    for flight in flights:
        flight.set_origin()
        flight.drive(Setpoint(Control.IDLE))
    clock.now = 2 * S
    for flight in flights:
        flight.estimate()
        flight.drive(Setpoint(Control.POSITION, position=(500.0, 0.0, -20.0)))
    clock.now = 5 * S
    for flight in flights:
        flight.estimate()
    return clock, flights


def flight_steps(vehicles: int, simulated: int, per_call: int) -> float:
    """Vehicle-steps a second of vehicles with sensors, estimator and control, *per_call* between reads."""
    clock, flights = flying(vehicles)
    calls = simulated * STEPS_PER_SECOND // per_call

    def fly() -> None:
        for _ in range(calls):
            clock.now += per_call * STEP
            for flight in flights:
                flight.estimate()

    return calls * per_call * vehicles / seconds_for(fly)


def read_cost() -> float:
    """Microseconds of a read between two grid steps."""
    _, (flight,) = flying(1)

    def read() -> None:
        for _ in range(10_000):
            flight.estimate()

    return seconds_for(read) / 10_000 * 1e6


class PlainC:
    """The bodies of ``plain_body.c``."""

    def __init__(self, folder: str) -> None:
        library = f"{folder}/plain_body.so"
        source = str(Path(__file__).parent / "plain_body.c")
        subprocess.run(["cc", "-O2", "-shared", "-fPIC", "-o", library, source, "-lm"], check=True)
        self._advance = ctypes.CDLL(library)["advance"]
        self._advance.argtypes = [*[ctypes.c_void_p] * 3, *[ctypes.c_long] * 2]

    def steps(self, bodies: int, simulated: int, per_call: int) -> float:
        """Body-steps a second of bodies that fly to a point 50 m away and stay there."""
        states = np.zeros((bodies, 19))
        states[:, 6] = 1.0
        states[:, 13:17] = 650.0
        goals = np.tile((50.0, 0.0, 20.0), (bodies, 1))
        memories = np.zeros((bodies, 3))
        arrays = [array.ctypes.data for array in (states, goals, memories)]
        calls = simulated * STEPS_PER_SECOND // per_call

        def fly() -> None:
            for _ in range(calls):
                self._advance(*arrays, bodies, per_call)

        rate = calls * per_call * bodies / seconds_for(fly)
        assert abs(states[0, 0] - 50.0) < 1.0 or simulated < 30, "the plain body has not reached its point"
        return rate


def main() -> None:
    our_steps(1, 1, 50)
    flight_steps(1, 1, 50)
    rotorpy_steps(20)
    rates: dict[str, list[float]] = {}
    with tempfile.TemporaryDirectory() as folder:
        plain = PlainC(folder)
        for _ in range(ROUNDS):
            for name, reached in (
                ("RotorPy, one body, RK45, one step a call", rotorpy_steps(300)),
                ("one body, 50 steps a call", our_steps(1, 100, 50)),
                ("one body, one step a call", our_steps(1, 10, 1)),
                ("100 bodies, 50 steps a call", our_steps(100, 4, 50)),
                ("plain C, one body, 50 steps a call", plain.steps(1, 100, 50)),
                ("one vehicle, 50 steps a call", flight_steps(1, 40, 50)),
                ("one vehicle, 5 steps a call", flight_steps(1, 20, 5)),
                ("plain C, 100 bodies, 50 steps a call", plain.steps(100, 4, 50)),
                ("100 vehicles, 50 steps a call", flight_steps(100, 2, 50)),
                ("100 vehicles, 5 steps a call", flight_steps(100, 1, 5)),
            ):
                rates.setdefault(name, []).append(reached)
    rate = {name: median(values) for name, values in rates.items()}
    theirs = rate["RotorPy, one body, RK45, one step a call"]
    print(f"{'':44}{'body-steps/s':>14}{'x RotorPy':>12}{'x plain C':>12}")
    for name, value in rate.items():
        against = (
            "plain C, 100 bodies, 50 steps a call" if "100" in name else "plain C, one body, 50 steps a call"
        )
        print(f"{name:44}{value:14,.0f}{value / theirs:12.1f}{value / rate[against]:12.2f}")
    ours = rate["one body, 50 steps a call"]
    print(f"one body at least {WANTED:.0f} x RotorPy: {'met' if ours >= WANTED * theirs else 'NOT met'}")
    print(f"a read between two grid steps: {read_cost():.2f} us")


if __name__ == "__main__":
    main()
