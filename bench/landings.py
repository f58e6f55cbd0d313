"""Landings on a marker with real code, by the camera of a simulated ArduPilot and PX4: how far off, by truth.

The flights of ``examples/landing`` over wind, light, distance of the approach, yaw of the marker and seed;
then those that must not end on the pad: no marker, a covered one, no light. The goal is a mean of less than
0.10 m, 0.25 m at most, none lost; what lands elsewhere says why.

    python bench/landings.py [--flights 20] [--workers 2]
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from random import Random
from typing import NamedTuple

from volery import Options, simulate
from volery.model.system_loader import load
from volery.run.assembly.model_checks import vocabulary

MODEL = Path(__file__).parents[1] / "examples" / "landing"
AUTOPILOTS = ("ardupilot", "px4")
SHEET = (
    "{sheet: {corners: [{east: 20 m, north: 9 m}, {east: 21 m, north: 9 m}, {east: 21 m, north: 11 m}, "
    "{east: 20 m, north: 11 m}], ceiling: 5 cm}}"
)


class Flight(NamedTuple):
    """What is flown: words for the table, changes of the model, the seed, and whether it should land."""

    words: str
    changes: tuple[str, ...]
    seed: int
    lands: bool = True


def flights(count: int) -> list[Flight]:
    """Return the flights that should land, the autopilots in turn."""
    random = Random(1)
    found = []
    for number in range(count):
        autopilot = AUTOPILOTS[number % 2]
        light = ("day", "dusk")[number // 2 % 2]
        wind, gusts = random.choice(((0.0, 0.0), (3.0, 0.5), (6.0, 1.0)))
        east, north = random.uniform(-2.0, 2.0), random.uniform(-2.0, 2.0)
        yaw, direction = random.uniform(0.0, 360.0), random.uniform(0.0, 360.0)
        changes = (
            f"environment.vehicles.drone.autopilot={autopilot}",
            f"environment.light={light}",
            f"environment.wind={{speed: {wind} m/s, gusts: {gusts} m/s, direction: {direction:.0f} deg}}",
            f"environment.places.beside={{east: {20.0 + east:.2f} m, north: {10.0 + north:.2f} m}}",
            "components.MarkerLanding.parameters.approach=beside",
            f"environment.markers.pad.yaw={yaw:.0f} deg",
        )
        words = f"{autopilot}, {light}, wind {wind:g} m/s, approach {east:+.1f} {north:+.1f} m, yaw {yaw:.0f}"
        found.append(Flight(words, changes, number + 1))
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
            f"{autopilot}, {words}", (f"environment.vehicles.drone.autopilot={autopilot}", change), 1, False
        )
        for autopilot, (words, change) in product(AUTOPILOTS, cases.items())
    ]


def fly(flight: Flight) -> tuple[float, str]:
    """Return the true distance from the pad [m], or the error that kept the drone from it."""
    system = load(MODEL, vocabulary(), overrides=flight.changes)
    run = simulate(system, Options(seed=flight.seed, record="summary"))
    return run.observables.get("drone.landing_offset", -1.0), str(run.error or "")


def main() -> None:
    """Fly, and print each flight and the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--flights", type=int, default=20)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    planned = [*flights(options.flights), *refusals()]
    with ProcessPoolExecutor(options.workers, get_context("spawn")) as pool:
        results = []
        for flight, (offset, error) in zip(planned, pool.map(fly, planned), strict=True):
            print(f"{flight.words:64} {error or f'{offset:.3f} m'}", flush=True)
            results.append((flight, offset, error))
    landed = [offset for flight, offset, error in results if flight.lands and not error]
    wrong = [flight.words for flight, _, error in results if flight.lands == bool(error)]
    mean, worst = sum(landed) / len(landed), max(landed)
    print(f"{len(landed)} landings: mean {mean:.3f} m, worst {worst:.3f} m; goal 0.10 m and 0.25 m")
    print(f"other than they should: {', '.join(wrong) or 'none'}")


if __name__ == "__main__":
    main()
