"""The five-line mission phase by phase: simulated against flown by the real firmware in its own simulator.

The reference is what was recorded of ArduCopter 4.5.6 (SITL), PX4 1.14 (SIH, mean of 90 flights) and
Paparazzi after v6.2 (NPS, `ardrone2`, mean of eight), with the same mission file and without wind. The ratio
is simulated over recorded; PX4's is the mean of four seeds for each flight, with the noise of SIH's sensors.
A figure marked with * is more than 5 per cent (times) or 10 per cent (others) off. Those of PX4 and Paparazzi
are computed from the traces that `volery fly` wrote of the firmware, by the functions that compute the
simulated ones. The simulated PX4 is recorded as a real vehicle is: armed since the heartbeat that says so, up
to a second late.
SIH starts its random numbers with the same seed, so flights that begin at the same time after the boot have
the same noise; each of the 90 had a seed of its own.

    python bench/phases.py [ardupilot|px4|paparazzi ...]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from math import dist, hypot, isnan, nan, sqrt
from pathlib import Path
from statistics import fmean, stdev
from typing import NamedTuple, cast

import volery
from volery import AboveHome, Position
from volery.base.frames import LocalFrame
from volery.base.time import MS
from volery.run.assembly.observed_vehicles import ObservedVehicles
from volery.trace.events import Event, Operation, VehicleState
from volery.trace.stream import Stream

sys.path.insert(0, str(Path(__file__).parent.parent / "examples"))
from mission import HOME, mission

SENSORS = {"px4": "sih", "paparazzi": "rtk"}
"""The sensors nearest to those of the simulator that was recorded: SIH's noise is larger than that of the
default ones, the receiver of NPS has none."""

VERSIONS = {"ardupilot": "4.5", "px4": "1.14"}
"""The version that was recorded, of an autopilot that is simulated in several."""

FLIGHTS = {"ardupilot": 1, "px4": 360, "paparazzi": 8}
"""Number of simulated flights whose mean is compared, with seeds from 1 on. Noise of SIH's sensors
makes times of single flights differ by some seconds. Four for each that was recorded of PX4 add an eighth to
the error of a ratio; as many as recorded would add two fifths."""

ARMED_AFTER_S = {"px4": 16.2}
"""Time from the start of the firmware to arming in the recorded flights, where the estimator still converges:
EKF2 aligns its heading after 6.5 s. Other vehicles have been running."""

OBSERVED = frozenset({"px4"})
"""Autopilots whose recorded figures were computed from what telemetry reported."""

MEAN_AGE = 50 * MS
"""Mean age of a recorded position: half a period of the telemetry. Beside a real vehicle the recorder's clock
has any phase; in virtual time both clocks would tick together, and each position would be a period old."""

WINDOW = 10
"""States over which a velocity is taken."""

NEAR_M = 1.0
LIFTED_M, NEARLY_UP_M = 0.3, 9.5
TIME_TOLERANCE, TOLERANCE = 0.05, 0.10


class Figure(NamedTuple):
    """One recorded figure and how it is computed from a simulated flight of what was flown."""

    name: str
    unit: str
    recorded: float
    of: Callable[[Flight], float]
    flown: Callable[[volery.Drone], None] = mission
    error: float = nan
    """Standard error of the recorded mean, where it is known."""


class Compared(NamedTuple):
    """A recorded figure beside the simulated one."""

    figure: Figure
    simulated: float
    error: float
    """Standard error of the simulated mean; NaN for a single flight."""

    @property
    def ratio(self) -> float:
        """Simulated over recorded."""
        return self.simulated / self.figure.recorded

    @property
    def tolerance(self) -> float:
        """The aim: how far the ratio may be from 1."""
        return TIME_TOLERANCE if self.figure.unit == "s" else TOLERANCE

    @property
    def within(self) -> bool:
        """Whether the ratio is within the aim: 5 per cent for times, 10 per cent for others."""
        return abs(self.ratio - 1.0) <= self.tolerance


def level_leg(drone: volery.Drone) -> None:
    """Fly 50 m north at one height and stay there, as recorded of ArduCopter."""
    drone.takeoff(10)
    drone.goto(Position(HOME.latitude + 50.0 / 111_200.0, HOME.longitude, AboveHome(10)))
    volery.sleep(4)
    drone.land()


class Flight:
    """A simulated flight: operations, and the states that the autopilot reports, 5 Hz, metres about home."""

    def __init__(
        self, autopilot: str, seed: int = 1, flown: Callable[[volery.Drone], None] = mission
    ) -> None:
        sensors = SENSORS.get(autopilot, "consumer")
        armed_after = ARMED_AFTER_S.get(autopilot, 0.0)
        url = f"sim:{autopilot}?start={'cold' if armed_after else 'warm'}&sensors={sensors}"
        url += f"&version={VERSIONS[autopilot]}" if autopilot in VERSIONS else ""
        observed, origin = autopilot in OBSERVED, [HOME]
        events: list[Event] = []

        def recorded(drone: volery.Drone) -> None:
            cast("Stream", drone.kernel.record).tap(events.append)
            if observed:
                drone.wait_ready()
                volery.sleep(armed_after - drone.kernel.now() / 1e9)
                drone.kernel.call_at(drone.kernel.now() + MEAN_AGE, lambda: observe(drone))
            flown(drone)

        def observe(drone: volery.Drone) -> None:
            origin.append(drone.position)
            ObservedVehicles(drone.kernel, [drone]).sample()

        run = volery.fly(recorded, url, volery.Options(seed=seed))
        assert run.completed, run.record.outcome.reason
        (self.record,) = run.record.vehicles.values()
        self.operations = [one for one in events if isinstance(one, Operation)]
        states = as_estimated(
            [one for one in events if isinstance(one, VehicleState) and isnan(one.x) == observed]
        )
        first = next(number for number, one in enumerate(states) if one.armed)
        last = max(number for number, one in enumerate(states) if one.armed)
        self.states = states[first : last + 2]
        frame = LocalFrame(origin[-1].latitude, origin[-1].longitude, origin[-1].altitude.metres)
        self.goals = [
            frame.to_enu(latitude, longitude, amsl)
            for latitude, longitude, amsl in (
                (46.0828, -103.8990, 940.0),
                (46.0828, -103.8962, 940.0),
                (46.0820, -103.8964, 920.0),
            )
        ]

    def operation(self, name: str, number: int = 0) -> Operation:
        """Return the operation of that name and number, from 0."""
        return [one for one in self.operations if one.operation == name][number]

    def duration(self, name: str, number: int = 0) -> float:
        """Return the duration of an operation, s."""
        one = self.operation(name, number)
        return (one.end - one.start) / 1e9

    def armed(self) -> float:
        """Return the time from arming to disarming, s."""
        return (self.states[-1].at - self.states[0].at) / 1e9

    def when(self, holds: Callable[[VehicleState], bool]) -> float:
        """Return the time after arming at which a state first holds, s."""
        return next(((one.at - self.states[0].at) / 1e9 for one in self.states if holds(one)), nan)

    def rises_to(self, height: float) -> float:
        """Return the time after arming at which a height is reached, s."""
        ground = self.states[0].z
        return self.when(lambda one: one.z - ground >= height)

    def near(self, number: int) -> float:
        """Return the time after arming at which a goal is first within a metre, s."""
        started = self.operation("goto", number).start
        return self.when(lambda one: one.at >= started and dist(one[2:5], self.goals[number]) < NEAR_M)

    def overshoot(self) -> float:
        """Return the mean distance flown past the goals along the legs, m."""
        start, past = (0.0, 0.0, 0.0), []
        for number, goal in enumerate(self.goals):
            operation = self.operation("goto", number)
            leg = goal[0] - start[0], goal[1] - start[1]
            length = hypot(*leg)
            flown = (one for one in self.states if operation.start <= one.at <= operation.end)
            past.append(
                max(((one.x - goal[0]) * leg[0] + (one.y - goal[1]) * leg[1]) / length for one in flown)
            )
            start = goal
        return sum(past) / len(past)

    def level_overshoot(self) -> float:
        """Return how far it came north of a goal 50 m north of home, m."""
        return max(one.y for one in self.states) - 50.0

    def greatest(self, value: Callable[[VehicleState], float]) -> float:
        """Return the greatest value of a state."""
        return max(value(one) for one in self.states)

    def distance(self) -> float:
        """Return the distance flown, m."""
        return sum(dist(a[2:5], b[2:5]) for a, b in zip(self.states, self.states[1:], strict=False))

    def energy(self) -> float:
        """Return the energy drawn from the battery, kJ."""
        pairs = zip(self.states, self.states[1:], strict=False)
        return sum(a.volts * a.amperes * (b.at - a.at) for a, b in pairs) / 1e12


def as_estimated(states: Sequence[VehicleState]) -> Sequence[VehicleState]:
    """Return states with the positions that the autopilot reports and their velocity over ``WINDOW``."""
    reported = [one._replace(x=one.estimated_x, y=one.estimated_y, z=one.estimated_z) for one in states]
    seconds = WINDOW * (states[1].at - states[0].at) / 1e9
    moved = zip(reported, reported[WINDOW:], reported[WINDOW // 2 :], strict=False)
    return [
        now._replace(vx=(b.x - a.x) / seconds, vy=(b.y - a.y) / seconds, vz=(b.z - a.z) / seconds)
        for a, b, now in moved
    ] + reported[-WINDOW // 2 :]


def speed(one: VehicleState) -> float:
    """Return the speed over ground, m/s."""
    return hypot(one.vx, one.vy)


def legs(*recorded: tuple[float, float]) -> Sequence[Figure]:
    """Return the figures of three legs, each the duration of its goto(), with its standard error."""
    return [
        Figure(
            f"leg {number + 1}",
            "s",
            seconds,
            lambda flight, number=number: flight.duration("goto", number),
            error=error,
        )
        for number, (seconds, error) in enumerate(recorded)
    ]


RECORDED: Mapping[str, Sequence[Figure]] = {
    "ardupilot": (
        Figure("arming to 0.3 m up", "s", 4.1, lambda flight: flight.rises_to(LIFTED_M)),
        Figure(
            "0.3 m to 9.5 m",
            "s",
            5.4,
            lambda flight: flight.rises_to(NEARLY_UP_M) - flight.rises_to(LIFTED_M),
        ),
        *legs((14.51, nan), (28.62, nan), (17.79, nan)),
        Figure("land from 20 m", "s", 31.19, lambda flight: flight.duration("land")),
        Figure("armed in all", "s", 101.1, Flight.armed),
        Figure("distance", "m", 401.0, Flight.distance),
        Figure("greatest speed", "m/s", 10.24, lambda flight: flight.greatest(speed)),
        Figure("overshoot of a level leg of 50 m", "m", 0.76, Flight.level_overshoot, level_leg),
        Figure("energy", "kJ", 35.0, Flight.energy),
    ),
    "px4": (
        Figure("9.5 m up", "s", 11.47, lambda flight: flight.rises_to(NEARLY_UP_M), error=0.07),
        Figure("goal 1 within 1 m", "s", 26.86, lambda flight: flight.near(0), error=0.13),
        Figure(
            "leg 2, from 1 m to 1 m", "s", 51.30, lambda flight: flight.near(1) - flight.near(0), error=0.29
        ),
        Figure(
            "leg 3, from 1 m to 1 m", "s", 31.81, lambda flight: flight.near(2) - flight.near(1), error=0.21
        ),
        Figure(
            "goal 3 within 1 m to LAND",
            "s",
            8.81,
            lambda flight: (flight.operation("land").start - flight.states[0].at) / 1e9 - flight.near(2),
            error=0.21,
        ),
        Figure("LAND to disarmed", "s", 27.84, lambda flight: flight.duration("land"), error=0.2),
        Figure("armed in all", "s", 146.62, Flight.armed, error=0.41),
        Figure("distance", "m", 406.6, Flight.distance, error=0.11),
        Figure("greatest speed", "m/s", 5.1, lambda flight: flight.greatest(speed), error=0.006),
        Figure(
            "greatest climb", "m/s", 2.74, lambda flight: flight.greatest(lambda one: one.vz), error=0.009
        ),
        Figure(
            "greatest sink", "m/s", 1.55, lambda flight: flight.greatest(lambda one: -one.vz), error=0.007
        ),
        Figure("overshoot", "m", 0.92, Flight.overshoot, error=0.014),
    ),
    "paparazzi": (
        *legs((25.26, 0.05), (50.81, 0.04), (25.59, 0.05)),
        Figure("land from 20 m", "s", 27.51, lambda flight: flight.duration("land"), error=0.07),
        Figure("armed in all", "s", 136.62, Flight.armed, error=0.02),
        Figure("distance", "m", 430.2, Flight.distance, error=0.06),
        Figure("greatest speed", "m/s", 7.17, lambda flight: flight.greatest(speed), error=0.09),
        Figure("greatest climb", "m/s", 3.38, lambda flight: flight.greatest(lambda one: one.vz), error=0.04),
        Figure("greatest sink", "m/s", 3.10, lambda flight: flight.greatest(lambda one: -one.vz), error=0.05),
        Figure("overshoot", "m", 2.21, Flight.overshoot, error=0.005),
    ),
}
"""PX4's simulator measures no current; Paparazzi's reports a current that its model does not depend on."""


def compare(autopilot: str, flights: int) -> Sequence[Compared]:
    """Fly so many times on a simulated autopilot; return each recorded figure beside the simulated one."""
    figures = RECORDED[autopilot]
    simulated = {
        (flown, seed): Flight(autopilot, seed, flown)
        for flown in dict.fromkeys(figure.flown for figure in figures)
        for seed in range(1, flights + 1)
    }
    compared = []
    for figure in figures:
        seen = [figure.of(one) for (flown, _), one in simulated.items() if flown is figure.flown]
        error = stdev(seen) / sqrt(len(seen)) if len(seen) > 1 else nan
        compared.append(Compared(figure, fmean(seen), error))
    return compared


def with_error(text: str, error: float) -> str:
    """Return a mean with its standard error, if that is known."""
    return text if isnan(error) else f"{text} ± {error:.2f}"


def main() -> None:
    """Print one table for each autopilot."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("autopilots", nargs="*", default=list(RECORDED))
    for autopilot in options.parse_args().autopilots:
        print(f"| {autopilot} | recorded | simulated | ratio |\n|---|---|---|---|")
        for one in compare(autopilot, FLIGHTS[autopilot]):
            name, unit, recorded, error = (*one.figure[:3], one.figure.error)
            print(
                f"| {name} | {with_error(f'{recorded:g}', error)} {unit} | "
                f"{with_error(f'{one.simulated:.2f}', one.error)} {unit} | "
                f"{one.ratio:.2f}{'' if one.within else ' *'} |"
            )
        print()


if __name__ == "__main__":
    main()
