"""Physics alone against RotorPy at the same step rate, in one run: `python bench/physics.py`.

Both integrate one quadrotor of six degrees of freedom with motor lag and drag from constant motor commands,
in steps of 2 ms; RotorPy with its own integrator (solve_ivp, RK45) one step a call as its users do, ours with
RK4, battery, contact and sensors included, long calls and calls of one step. Rounds alternate; medians are
shown.
"""

from __future__ import annotations

from collections.abc import Callable
from statistics import median
from time import perf_counter

from volery.base.frames import LocalFrame
from volery.base.time import MS, S
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
    import numpy as np  # noqa: PLC0415  # only this bench needs it
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


def flight_cost(vehicles: int, simulated: int) -> tuple[float, float]:
    """Wall milliseconds a simulated second (read ten times), and microseconds a read in between."""
    clock, flights = flying(vehicles)

    def fly() -> None:
        for _ in range(10 * simulated):
            clock.now += 100 * MS
            for flight in flights:
                flight.estimate()

    def read() -> None:
        for _ in range(1000):
            for flight in flights:
                flight.estimate()

    return seconds_for(fly) / simulated * 1e3, seconds_for(read) / (1000 * vehicles) * 1e6


def main() -> None:
    our_steps(1, 1, 50)
    flight_cost(1, 1)
    rotorpy_steps(20)
    theirs, ours, single, hundred = [], [], [], []
    for _ in range(ROUNDS):
        theirs.append(rotorpy_steps(300))
        ours.append(our_steps(1, 100, 50))
        single.append(our_steps(1, 10, 1))
        hundred.append(our_steps(100, 4, 50))
    reference = median(theirs)
    print(f"{'':44}{'body-steps/s':>14}{'x RotorPy':>12}")
    print(f"{'RotorPy, one body, RK45, one step a call':44}{reference:14,.0f}{1.0:12.1f}")
    for name, rates in (
        ("one body, RK4, 50 steps a call", ours),
        ("one body, RK4, one step a call", single),
        ("100 bodies, RK4, 50 steps a call", hundred),
    ):
        print(f"{name:44}{median(rates):14,.0f}{median(rates) / reference:12.1f}")
    verdict = "met" if median(ours) >= WANTED * reference else "NOT met"
    print(f"one body at least {WANTED:.0f} x RotorPy: {verdict}")
    for vehicles in (1, 20):
        cost, read = flight_cost(vehicles, 20)
        pace = 1e3 / cost
        print(f"{vehicles} flying with estimator and control, read ten times a second:")
        print(
            f"  {cost:.2f} ms a simulated second ({pace:,.0f} x real time); a read in between {read:.2f} us"
        )


if __name__ == "__main__":
    main()
