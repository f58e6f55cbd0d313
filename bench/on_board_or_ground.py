"""Mapping on the drone's computer or on the ground behind a radio: load, traffic, age of poses, and the map.

The model is ``examples/mapping`` under fidelity ``code``, in variants of the computer on board, of the radio
and of what goes over it. The map that the component has at its end is compared with the floor plan: the part
of the free floor that is known, and the part of the walls in it that are where they are, to 0.2 m. Scans
count from the first pose to the last.

    python bench/on_board_or_ground.py [--workers 2] [--seconds 90] [variant ...]

With --seconds the runs end then; without, when the drone has landed again.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import binary_dilation

from volery import Options, simulate
from volery.model.system_loader import load
from volery.ros.messages import from_cdr
from volery.run.assembly.model_checks import vocabulary
from volery.trace.events import Published
from volery.trace.reader import read

MODEL = Path(__file__).parents[1] / "examples" / "mapping"
ORIGIN_M, SIDE_M = -5.0, 0.1
"""Corner of the floor plan in both axes, and side of its cells [m]."""
SCANS = "/drone/scan"
HEADINGS = (
    "where", "load", "radio", "scan to pose, median / p95", "scans lost", "floor known", "walls right",
    "done", "hits", "age of pictures, number",
)  # fmt: skip


class Variant(NamedTuple):
    """Where the map is made."""

    allocation: str
    changes: tuple[str, ...] = ()
    scenario: str | None = None


def over(radio: str, scenario: str | None = None) -> Variant:
    """Return the map on the ground behind a radio of a bandwidth."""
    return Variant("ground", (f"platform.networks.radio.bandwidth={radio}",), scenario)


SLOW_ODOMETRY = (
    "environment.vehicles.drone.added_sensors="
    "[{lidar: {beams: 360, range: 12 m, rate: 5 Hz}},"
    " {odometry: {drift: 2 deg/min, scale: 3 %, rate: 20 Hz}}]"
)

VARIANTS = {
    "on board, 1500 MHz": Variant("on_board"),
    "on board, 600 MHz": Variant("on_board", ("platform.processors.onboard.frequency=600 MHz",)),
    "ground, 10 Mbit/s": over("10 Mbit/s"),
    "ground, 250 kbit/s": over("250 kbit/s"),
    "ground, 250 kbit/s, odometry at 20 Hz": Variant(
        "ground", ("platform.networks.radio.bandwidth=250 kbit/s", SLOW_ODOMETRY)
    ),
    "ground, 57.6 kbit/s": over("57.6 kbit/s"),
    "ground and pictures, 10 Mbit/s": over("10 Mbit/s", "pictures"),
    "ground and pictures, 250 kbit/s": over("250 kbit/s", "pictures"),
}


def known(message: Any, plan: NDArray[np.bool_]) -> tuple[float, float]:
    """Return the part of the free floor that a map knows, and of its walls that are where they are."""
    info = message.info
    cells = np.asarray(message.data, dtype=np.int16).reshape(info.height, info.width)
    wide = binary_dilation(plan, iterations=2)

    def on_plan(marked: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        rows, columns = np.nonzero(marked)
        north = info.origin.position.y + (rows + 0.5) * info.resolution
        east = info.origin.position.x + (columns + 0.5) * info.resolution
        up, right = ((value - ORIGIN_M) // SIDE_M for value in (north, east))
        inside = (up >= 0) & (right >= 0) & (up < plan.shape[0]) & (right < plan.shape[1])
        return up[inside].astype(int), right[inside].astype(int)

    seen = np.zeros_like(plan)
    seen[on_plan((cells >= 0) & (cells < 50))] = True
    walls = wide[on_plan(cells >= 65)]
    return float((seen & ~wide).sum() / (~wide).sum()), float(walls.mean()) if len(walls) else 0.0


def fly(name: str, seconds: int) -> str:
    """Fly a variant, for some seconds or (0) to its end; return its row."""
    variant = VARIANTS[name]
    ends = (f"run.duration={seconds} s", "run.until=null") if seconds else ()
    system = load(MODEL, vocabulary(), variant.scenario, variant.allocation, (*variant.changes, *ends))
    scans, stamps, poses, ages, last = [], [], [], [], None
    with TemporaryDirectory() as folder:
        run = simulate(system, Options(out=Path(folder) / "run", record="/map"))
        for event in read(Path(folder) / "run" / "trace.mcap").events:
            if not isinstance(event, Published):
                continue
            if event.topic == SCANS:
                scans.append(event.at)
            elif event.topic in ("/slam_out_pose", "/picture_age", "/map"):
                message = from_cdr(event.type, event.data)
                if event.topic == "/slam_out_pose":
                    stamp = message.header.stamp
                    stamps.append(stamp.sec * 1_000_000_000 + stamp.nanosec)
                    poses.append((event.at - stamps[-1]) / 1e6)
                elif event.topic == "/picture_age":
                    ages.append(1e3 * message.data)
                else:
                    last = message
    plan = np.asarray(Image.open(MODEL / "hall.png").convert("L"))[::-1] < 128
    floor, walls = known(last, plan) if last is not None else (0.0, 0.0)
    seen = run.observables
    where = "onboard" if variant.allocation == "on_board" else "ground"
    during = [at for at in scans if stamps and stamps[0] <= at <= stamps[-1]]
    lost = f"{max(0.0, 1.0 - len(poses) / len(during)):.0%} of {len(during)}" if during else "all"
    age = f"{np.median(poses):.0f} / {np.quantile(poses, 0.95):.0f} ms" if poses else "-"
    picture = f"{np.median(ages):.0f} ms, {len(ages)}" if ages else "-"
    error = f"; {run.error}" if run.error else ""
    cells = (
        name,
        f"{100 * seen.get('mapping.utilisation', 0.0):.0f} % of a core of {where}",
        f"{100 * seen.get('radio.utilisation', 0.0):.0f} %",
        age,
        lost,
        f"{100 * floor:.0f} %",
        f"{100 * walls:.0f} %",
        f"{seen.get('note.map.done.time_max', float('nan')):.0f} s",
        f"{seen.get('drone.collisions', 0):.0f}",
        f"{picture}{error}",
    )
    return f"| {' | '.join(cells)} |"


def main() -> None:
    """Fly, and print the rows as they come."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seconds", type=int, default=0, help="end of each run in virtual time")
    parser.add_argument("variants", nargs="*", metavar="variant", help="by default all")
    options = parser.parse_args()
    print(f"| {' | '.join(HEADINGS)} |\n|{'---|' * len(HEADINGS)}")
    with ProcessPoolExecutor(options.workers, get_context("spawn")) as pool:
        for row in pool.map(partial(fly, seconds=options.seconds), options.variants or VARIANTS):
            print(row, flush=True)


if __name__ == "__main__":
    main()
