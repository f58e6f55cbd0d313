"""A large fleet in one world: `python bench/fleet.py [DRONES] [SECONDS]`.

All drones take off and hover until the given simulated time, 1000 drones and 60 s by default. Printed are
processor time per drone and simulated second, as a ratio to a fleet of 20 in the same run, and the largest
memory of the process.
"""

from __future__ import annotations

import resource
import sys
from time import process_time

import volery

SMALL = 20
NORTH, EAST, AMSL_M = 46.0825, -103.8995, 900


def hovering(drones: int, seconds: float) -> float:
    """Return the processor time of a hover, ms per drone and simulated second."""

    def mission(drone: volery.Drone) -> None:
        drone.takeoff(10)
        volery.sleep(max(0.0, seconds - volery.now()))

    urls = [
        f"sim:ardupilot?start=warm&home={NORTH + 0.0001 * place},{EAST},{AMSL_M}" for place in range(drones)
    ]
    start = process_time()
    run = volery.fly(mission, urls, volery.Options(seed=1))
    if not run.completed:
        sys.exit(f"fleet: {run.record.outcome.reason}")
    return (process_time() - start) / drones / run.record.sim_s * 1e3


def main() -> None:
    drones = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 60.0
    hovering(1, 1.0)  # warm
    small = hovering(SMALL, seconds)
    large = hovering(drones, seconds)
    megabytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{SMALL:6} drones: {small:.2f} ms of processor time a drone and simulated second")
    print(f"{drones:6} drones: {large:.2f} ms, {large / small:.2f} x; {megabytes:.0f} MB")


if __name__ == "__main__":
    main()
