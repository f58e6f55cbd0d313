"""Whole missions, from arming to disarm: physics at 500 Hz, telemetry at 10 Hz, the default trace on.

The reference is real time. One drone flies the five-line mission; twenty fly it at once in one world. Also
printed: messages over the links per second of computing, and how much trace a simulated hour makes.

    python bench/missions.py [--quick]
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any
from unittest.mock import patch

import volery
from volery.links import in_process_link

sys.path.insert(0, str(Path(__file__).parent.parent / "examples"))
from mission import HOME, mission

TARGETS = {1: 300.0, 20: 25.0}


@dataclass
class Stretch:
    """From the first arming to the last disarm: seconds of computing and seconds simulated."""

    computing: list[float] = field(default_factory=list)
    simulated: list[float] = field(default_factory=list)
    frames: int = 0

    def mark(self) -> None:
        self.computing.append(process_time())
        self.simulated.append(volery.now())

    def fly(self, drone: volery.Drone) -> None:
        drone.wait_ready()
        self.mark()
        mission(drone)
        self.mark()

    def factor(self) -> float:
        return (max(self.simulated) - min(self.simulated)) / (max(self.computing) - min(self.computing))


def flight(drones: int) -> tuple[float, float, float]:
    """Times real time, frames per second of computing, megabytes of trace per simulated hour."""
    stretch = Stretch()
    urls = [
        f"sim:ardupilot?start=warm&home={HOME.latitude + 0.0001 * k},{HOME.longitude},900"
        for k in range(drones)
    ]

    original = in_process_link.InProcessLink.send

    def counted(self: in_process_link.InProcessLink, frame: Any) -> None:
        stretch.frames += 1
        original(self, frame)

    counting = patch.object(in_process_link.InProcessLink, "send", counted)
    with counting, tempfile.TemporaryDirectory() as folder:
        run = volery.fly(stretch.fly, urls, volery.Options(seed=1, out=Path(folder)))
        size = (Path(folder) / "trace.mcap").stat().st_size / 1e6
    assert run.completed, run.record.outcome.reason
    computing = max(stretch.computing) - min(stretch.computing)
    return stretch.factor(), stretch.frames / computing, size / run.record.sim_s * 3600


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--quick", action="store_true", help="one round instead of five")
    rounds = 1 if options.parse_args().quick else 5
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})  # one core
    flight(1)  # compile, load
    for drones, target in TARGETS.items():
        results = [flight(drones) for _ in range(rounds)]
        factor, frames, hourly = (median(column) for column in zip(*results, strict=True))
        print(
            f"{drones:3d} drones: {factor:6.0f} x real time (target {target:.0f}), "
            f"{frames:8.0f} messages/s, {hourly:5.0f} MB of trace per simulated hour"
        )


if __name__ == "__main__":
    main()
