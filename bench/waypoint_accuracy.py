"""How near a simulated ArduCopter comes to the corners of a cube: by its estimate, and in truth.

The distance from a corner in truth has two parts: the control error (estimate to set-point), which a law can
lower, and the error of the autopilot's estimate (truth to estimate), which it cannot. Both are the greatest
ones while a corner is held for a second. Flown with a consumer's satellite receiver and with RTK; with RTK a
corner counts as reached at a smaller distance by the estimate, which leaves the rest to the estimate's error.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from math import dist
from typing import NamedTuple

from volery.base.time import from_seconds
from volery.control.actuation import MeasuredState, MotionCommand
from volery.control.flight import PERIOD, ControlledFlight
from volery.control.manoeuvres import LoopSample, Waypoints, cube
from volery.run.assembly.vehicles import VehicleSettings, open_vehicles
from volery.run.go import ACTUATIONS, WAYS
from volery.vehicles import Drone

NAME = "ardupilot"
HOLD_S = 1.0
LIMIT_S = 900.0
SENSORS = ("consumer", "rtk")
WEATHER = (("none", "0,0,0", 0.05, (0.05, 0.025)), ("gusts of 5 m/s", "0,0,5", 0.3, (0.3, 0.25)))
"""Name, option ``wind``, required distance in m, and distance by the estimate by ``SENSORS``."""


class Distances(NamedTuple):
    """Distances in m at one moment: estimate to set-point, truth to estimate, truth to set-point."""

    control: float
    estimate: float
    truth: float


class _Observed(Waypoints):
    """Way points that note truth and estimate at each sample."""

    def __init__(self, points: Sequence[tuple[float, float, float]], tolerance: float) -> None:
        super().__init__(points, tolerance=tolerance, hold_s=HOLD_S)
        self.points = list(points)
        self.worst: list[Distances] = []
        self._recent: list[Distances] = []
        self.look = lambda goal: Distances(0.0, 0.0, 0.0)

    def step(self, measured: MeasuredState, sample_s: float) -> tuple[MotionCommand, Sequence[LoopSample]]:
        """Fly on, and note the distances of a corner that was held."""
        at = len(self.corners)
        result = super().step(measured, sample_s)
        self._recent.append(self.look(self.points[at]))
        if len(self.corners) > at:
            held = self._recent[-round(from_seconds(HOLD_S) / PERIOD) :]
            self.worst.append(Distances(*(max(column) for column in zip(*held, strict=True))))
            self._recent.clear()
        return result


def flown(by: str, sensors: str, wind: str, tolerance: float) -> list[Distances]:
    """Fly the cube and return the greatest distances at each corner."""
    url = f"sim:{NAME}?start=warm&attitude=50&rate=20&sensors={sensors}&wind={wind}"
    opened = open_vehicles({NAME: url}, {NAME: Drone}, VehicleSettings())
    fleet, drone, kernel = opened.fleet, opened.vehicles[0], opened.kernel
    assert fleet is not None
    assert isinstance(drone, Drone)
    frame, truth = fleet.frame, fleet.flights[NAME].truth
    points = _Observed(cube(4.0, 5.0), tolerance)

    def look(goal: tuple[float, float, float]) -> Distances:
        seen = drone.telemetry
        assert seen.position is not None
        assert seen.home is not None
        here, home = (
            frame.to_enu(one.latitude, one.longitude, one.altitude.metres)
            for one in (seen.position, seen.home)
        )
        north, east, up = goal
        aim = home[0] + east, home[1] + north, home[2] + up
        real = truth().position
        return Distances(dist(here, aim), dist(real, here), dist(real, aim))

    points.look = look
    try:
        with kernel.adopt("accuracy"):
            drone.wait_connected()
            drone.wait_ready()
            kernel.call_at(from_seconds(LIMIT_S), lambda: kernel.cancel(kernel.root, "too long"))
            ControlledFlight(drone, points, ACTUATIONS[by](drone)).run()
    finally:
        drone.close()
        opened.leave()
        kernel.close()
    return points.worst


def main() -> None:
    """Print one row for each flight: greatest distances over the ten corners."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--by", choices=WAYS, action="append", help="only this way")
    parser.add_argument("--sensors", choices=SENSORS, action="append", help="only these sensors")
    stated = parser.parse_args()
    print("greatest distances in m over ten corners, each held for 1 s")
    heads = f"{'wind':16}{'position by':14}{'commands':12}"
    print(f"{heads}{'control':>9}{'estimate':>10}{'truth':>8}  required")
    for name, wind, required, tolerances in WEATHER:
        for sensors in stated.sensors or SENSORS:
            for by in stated.by or WAYS:
                worst = flown(by, sensors, wind, tolerances[SENSORS.index(sensors)])
                control, estimate, truth = (max(column) for column in zip(*worst, strict=True))
                print(
                    f"{name:16}{sensors:14}{by:12}{control:9.3f}{estimate:10.3f}{truth:8.3f}  {required:g}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
