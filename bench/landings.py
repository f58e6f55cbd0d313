"""Landings on a marker with real code, by the camera of a simulated ArduPilot and PX4: how far off, by truth.

The flights of ``examples/landing`` over wind, light, distance of the approach, yaw of the marker and seed;
then those that must not end on the pad: no marker, a covered one, no light. The goal is a mean of less than
0.10 m, 0.25 m at most, none lost; what lands elsewhere says why. Each offset is given where the drone touches
the ground and where it rests, and both by autopilot and wind.

    python bench/landings.py [--flights 20] [--workers 2]
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from math import hypot
from multiprocessing import get_context
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from volery import Options, simulate
from volery.model.system_loader import load
from volery.run.assembly.model_checks import vocabulary

MODEL = Path(__file__).parents[1] / "examples" / "landing"
LEGS_M = 0.16
"""Height of the centre of a drone whose legs are as good as on the ground [m]."""
AUTOPILOTS = {"ardupilot": 0.5, "px4": 0.0}
"""Autopilots and the damping with which they land."""
SHEET = (
    "{sheet: {corners: [{east: 20 m, north: 9 m}, {east: 21 m, north: 9 m}, {east: 21 m, north: 11 m}, "
    "{east: 20 m, north: 11 m}], ceiling: 5 cm}}"
)


class Flight(NamedTuple):
    """What is flown: group and words for the table, changes of the model, seed, whether it lands."""

    group: str
    words: str
    changes: tuple[str, ...]
    seed: int
    lands: bool = True


def _flown_by(autopilot: str) -> tuple[str, ...]:
    """Return the changes of the model for an autopilot."""
    return (
        f"environment.vehicles.drone.autopilot={autopilot}",
        f"components.MarkerLanding.parameters.damping={AUTOPILOTS[autopilot]}",
    )


def flights(count: int) -> list[Flight]:
    """Return the flights that should land, the autopilots in turn."""
    random = Random(1)
    found = []
    for number in range(count):
        autopilot = tuple(AUTOPILOTS)[number % 2]
        light = ("day", "dusk")[number // 2 % 2]
        wind, gusts = random.choice(((0.0, 0.0), (3.0, 0.5), (6.0, 1.0)))
        east, north = random.uniform(-2.0, 2.0), random.uniform(-2.0, 2.0)
        yaw, direction = random.uniform(0.0, 360.0), random.uniform(0.0, 360.0)
        changes = (
            *_flown_by(autopilot),
            f"environment.light={light}",
            f"environment.wind={{speed: {wind} m/s, gusts: {gusts} m/s, direction: {direction:.0f} deg}}",
            f"environment.places.beside={{east: {20.0 + east:.2f} m, north: {10.0 + north:.2f} m}}",
            "components.MarkerLanding.parameters.approach=beside",
            f"environment.markers.pad.yaw={yaw:.0f} deg",
        )
        words = f"{autopilot}, {light}, wind {wind:g} m/s, approach {east:+.1f} {north:+.1f} m, yaw {yaw:.0f}"
        found.append(Flight(f"{autopilot}, wind {wind:g} m/s", words, changes, number + 1))
    return found


def refusals() -> list[Flight]:
    """Return the flights that should come home instead."""
    cases = {
        "no marker": "environment.markers={}",
        "half covered": f"environment.buildings={SHEET}",
        "night": "environment.light=night",
    }
    return [
        Flight(
            autopilot,
            f"{autopilot}, {words}",
            (*_flown_by(autopilot), change),
            1,
            False,
        )
        for autopilot, (words, change) in product(AUTOPILOTS, cases.items())
    ]


class Landed(NamedTuple):
    """True distances from the pad [m] at touch-down and at rest, or the error that kept the drone from it."""

    touched: float
    rests: float
    error: str


def fly(flight: Flight) -> Landed:
    """Fly one."""
    system = load(MODEL, vocabulary(), overrides=flight.changes)
    pad = system.environment.places["pad"]
    with TemporaryDirectory() as folder:
        run = simulate(system, Options(seed=flight.seed, out=Path(folder) / "run"))
        states = run.arrays("drone")
    flown = int(np.argmax(states["z"]))
    down = flown + int(np.argmax(states["z"][flown:] < LEGS_M))
    touched = hypot(states["x"][down] - pad.east_m, states["y"][down] - pad.north_m)
    return Landed(touched, run.observables.get("drone.landing_offset", -1.0), str(run.error or ""))


def summary(offsets: list[float]) -> str:
    """Return mean and greatest offset in words."""
    return f"mean {sum(offsets) / len(offsets):.3f} m, worst {max(offsets):.3f} m"


def main() -> None:
    """Fly, and print each flight and the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--flights", type=int, default=20)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    planned = [*flights(options.flights), *refusals()]
    with ProcessPoolExecutor(options.workers, get_context("spawn")) as pool:
        results = []
        for flight, landed in zip(planned, pool.map(fly, planned), strict=True):
            figures = f"touches {landed.touched:.3f} m, rests {landed.rests:.3f} m"
            print(f"{flight.words:64} {landed.error or figures}", flush=True)
            results.append((flight, landed))
    right = [(flight.group, landed) for flight, landed in results if flight.lands and not landed.error]
    wrong = [flight.words for flight, landed in results if flight.lands == bool(landed.error)]
    print(f"{len(right)} landings; goal: mean 0.10 m, worst 0.25 m")
    for group in (*sorted({one for one, _ in right}), "all"):
        landings = [landed for one, landed in right if group in (one, "all")]
        touched, rests = [one.touched for one in landings], [one.rests for one in landings]
        print(f"{group:28} {len(landings):4} {summary(touched)} at touch-down, {summary(rests)} at rest")
    print(f"other than they should: {', '.join(wrong) or 'none'}")


if __name__ == "__main__":
    main()
