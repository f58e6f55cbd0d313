"""A vehicle crosses random fields of obstacles that only its lidar knows, at 2, 5 and 8 m/s.

The vehicle changes its velocity with 4 m/s^2 at most, 0.2 s after a scan of 360 beams with a range of 30 m;
its radius is 0.3 m. The reference of each field is the shortest path that keeps 1 m from the true obstacles.
Goals: no collision; at least 95 % arrive where that path exists, on at most 1.3 times its length, with a mean
speed of 0.6 of the commanded one.

    python bench/obstacle_fields.py [--fields 500] [--workers 2] [--speeds 2 5 8] [--first 0]
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from math import hypot, inf
from time import process_time
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.avoidance import Motion
from volery.autonomy.grid_path import WaysFrom
from volery.autonomy.laser_scan import scan_from_ranges
from volery.autonomy.navigator import Navigator
from volery.autonomy.planar_pose import Pose2

Array = NDArray[np.float64]
WIDE, TALL = 70.0, 40.0
START, GOAL = (4.0, 20.0), (66.0, 20.0)
RADIUS, ACCELERATION, DELAY, PERIOD, SIGHT = 0.3, 4.0, 0.2, 0.1, 30.0
BEAMS = np.radians(np.arange(0.0, 360.0))
ALONG = np.stack((np.cos(BEAMS), np.sin(BEAMS)), axis=1)
SIDE = 0.2


class Field(NamedTuple):
    """Circles (n, 3): x, y, radius [m]; walls (m, 4): both ends [m]."""

    circles: Array
    walls: Array

    def distance(self, places: Array) -> Array:
        """Return how far places (k, 2) are from the nearest obstacle [m]."""
        found = np.full(len(places), inf)
        for x, y, radius in self.circles:
            found = np.minimum(found, np.hypot(places[:, 0] - x, places[:, 1] - y) - radius)
        for wall in self.walls:
            side = wall[2:] - wall[:2]
            share = np.clip((places - wall[:2]) @ side / (side @ side), 0.0, 1.0)
            off = places - wall[:2] - share[:, None] * side
            found = np.minimum(found, np.hypot(off[:, 0], off[:, 1]))
        return found

    def ranges(self, x: float, y: float) -> Array:
        """Return where the beams of a lidar end [m]."""
        off = self.circles[:, :2] - (x, y)
        ahead = ALONG @ off.T
        inside = self.circles[:, 2] ** 2 - ((off * off).sum(axis=1) - ahead * ahead)
        met = np.where((inside > 0.0) & (ahead > 0.0), ahead - np.sqrt(np.maximum(inside, 0.0)), inf)
        side, start = self.walls[:, 2:] - self.walls[:, :2], self.walls[:, :2] - (x, y)
        with np.errstate(divide="ignore", invalid="ignore"):
            across = ALONG[:, :1] * side[:, 1] - ALONG[:, 1:] * side[:, 0]
            length = (start[:, 0] * side[:, 1] - start[:, 1] * side[:, 0]) / across
            share = (start[:, 0] * ALONG[:, 1:] - start[:, 1] * ALONG[:, :1]) / across
            hit = np.where((length > 0.0) & (share >= 0.0) & (share <= 1.0), length, inf)
        nearest: Array = np.minimum(met.min(axis=1), hit.min(axis=1))
        return nearest


def field(seed: int) -> Field:
    """Return a random field: trees, buildings and walls, none at start and goal."""
    random = np.random.default_rng(seed)
    circles, walls = [], [(0, 0, WIDE, 0), (WIDE, 0, WIDE, TALL), (WIDE, TALL, 0, TALL), (0, TALL, 0, 0)]
    for _ in range(int(random.integers(20, 100))):
        x, y, radius = random.uniform(0, WIDE), random.uniform(0, TALL), random.uniform(0.15, 1.5)
        circles.append((x, y, radius))
    for _ in range(int(random.integers(0, 12))):
        x, y, turn = random.uniform(5, WIDE - 5), random.uniform(0, TALL), random.uniform(0, np.pi)
        long, wide = random.uniform(2, 12), random.uniform(0.1, 4)
        axes = np.array(((np.cos(turn), np.sin(turn)), (-np.sin(turn), np.cos(turn)))) * ((long,), (wide,))
        corners = [
            np.array((x, y)) + a * axes[0] / 2 + b * axes[1] / 2
            for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1))
        ]
        walls += [(*one, *other) for one, other in zip(corners, corners[1:] + corners[:1], strict=True)]
    free = [c for c in circles if min(hypot(c[0] - x, c[1] - y) for x, y in (START, GOAL)) > c[2] + 2.5]
    made = Field(np.array(free, dtype=float).reshape(-1, 3), np.array(walls, dtype=float))
    if made.distance(np.array((START, GOAL))).min() < 2.0:
        return field(seed + 1_000_000)
    return made


@cache
def reference(seed: int) -> float:
    """Return the length of the shortest path 1 m from all obstacles [m]; infinity without one."""
    obstacles = field(seed)
    rows, columns = int(TALL / SIDE), int(WIDE / SIDE)
    row, column = np.indices((rows, columns))
    centres = SIDE * (np.stack((column.ravel(), row.ravel()), axis=1).astype(np.float64) + 0.5)
    ways = WaysFrom(obstacles.distance(centres).reshape(rows, columns), SIDE, _cell(START), 1.0, _cell(GOAL))
    way = ways.straightened(ways.to(_cell(GOAL)))
    if not len(way):
        return inf
    return float(np.hypot(*np.diff(way * SIDE, axis=0).T).sum())


def _cell(place: tuple[float, float]) -> tuple[int, int]:
    return int(place[1] / SIDE), int(place[0] / SIDE)


class Crossing(NamedTuple):
    """How a crossing went: seconds, metres, nearest obstacle, last word, computing time."""

    seed: int
    speed: float
    arrived: bool
    time: float
    length: float
    nearest: float
    word: str
    shortest: float
    computed: float


def cross(seed: int, speed: float) -> Crossing:
    """Cross a field."""
    obstacles = field(seed)
    motion = Motion(RADIUS, speed, ACCELERATION, margin=0.2, delay=DELAY, period=PERIOD, sight=SIGHT)
    navigator = Navigator(motion, GOAL, resolution=SIDE)
    noise = np.random.default_rng(seed + 7)
    place, velocity, step = np.array(START), np.zeros(2), 0.02
    commands = [np.zeros(2)] * round(DELAY / step)
    length, places, ticks, computed = 0.0, [place], 0, 0.0
    every = round(PERIOD / step)
    while not navigator.arrived and ticks * step < 60.0 + 4.0 * WIDE / speed:
        if ticks % every == 0:
            seen = obstacles.ranges(*place) + noise.normal(0.0, 0.01, len(BEAMS))
            scan = scan_from_ranges(ticks * 20_000_000, BEAMS, seen, 0.05, SIGHT)
            begin = process_time()
            command = navigator.update(scan.time, Pose2(*place), scan, velocity)
            computed += process_time() - begin
        commands.append(command)
        change = commands.pop(0) - velocity
        size = hypot(*change)
        after = velocity + change * min(1.0, ACCELERATION * step / max(size, 1e-12))
        moved = 0.5 * step * (velocity + after)
        place, velocity, length, ticks = place + moved, after, length + hypot(*moved), ticks + 1
        places.append(place)
    time, nearest = ticks * step, float(obstacles.distance(np.array(places)).min())
    shortest = reference(seed)
    return Crossing(
        seed,
        speed,
        navigator.arrived,
        time,
        length,
        nearest,
        navigator.word,
        shortest,
        computed / ticks * every,
    )


def main() -> None:
    """Print collisions, arrivals, lengths and speeds."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fields", type=int, default=500)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--speeds", type=float, nargs="+", default=[2.0, 5.0, 8.0])
    chosen = parser.parse_args()
    seeds = range(chosen.first, chosen.first + chosen.fields)
    cross(seeds[0], 8.0)  # compiles, once
    with ProcessPoolExecutor(chosen.workers) as pool:
        for speed in chosen.speeds:
            found = list(pool.map(cross, seeds, [speed] * len(seeds), chunksize=4))
            possible = [one for one in found if one.shortest < inf]
            there = [one for one in possible if one.arrived]
            longer = [one.length / one.shortest for one in there]
            hits = sum(one.nearest < RADIUS for one in found)
            print(
                f"{speed:g} m/s: {len(found)} fields, {hits} collisions "
                f"(nearest {min(one.nearest for one in found):.2f} m from the centre); a path exists in "
                f"{len(possible)}: {len(there) / len(possible):.1%} arrived, "
                f"{np.mean(longer):.2f} times its length (95 %: {np.percentile(longer, 95):.2f}), "
                "mean speed "
                f"{np.mean([one.length / one.time for one in there]) / speed:.2f} of the commanded; "
                f"{1000.0 * np.mean([one.computed for one in found]):.1f} ms a decision",
                flush=True,
            )
            for one in possible:
                if not one.arrived:
                    print(f"  seed {one.seed}: {one.word}")


if __name__ == "__main__":
    main()
