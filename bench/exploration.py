"""Floors that a drone has never seen, explored with real code in virtual time: how much is known, how well.

For each seed a floor of 30 x 40 m is drawn: rooms beside crossing corridors, so that there are loops, doors
of 1.6 m to 2.2 m for a drone that is 0.85 m wide, and what stands in rooms. The drone of
``examples/mapping`` explores it, once with the odometry of an autopilot that has satellites, and once with
that of a drone without: its heading drifts by 2 degrees a minute, its ways are 3 % too long, and every 10 s
it is silent for 0.5 s. The autopilot itself holds its velocity by a receiver in both.

By truth: the share of the free floor that the map has as free; collisions; the absolute trajectory error of
the scans in the map, aligned as by ``evo_ape -a``, and by that program itself where it is installed (``pip
install evo``); the same of the poses by which the drone flew; the share of occupied cells whose centre is
within 0.10 m of a wall, after the same alignment. Goals: more than 95 %, none, less than 0.10 m, more than
95 %.

    python bench/exploration.py [--seeds 1 2 3] [--rows satellites reckoned] [--workers 1] [--out DIR]

With --out a picture of each map over its floor is kept, and both trajectories.
"""

from __future__ import annotations

import argparse
import subprocess
from concurrent.futures import ProcessPoolExecutor
from itertools import combinations, product
from multiprocessing import get_context
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import distance_transform_edt, label

from volery import Options, RunSession
from volery.model.system_loader import load
from volery.ros.messages import from_cdr
from volery.ros.messages.message import nanoseconds
from volery.run.assembly.model_checks import vocabulary
from volery.trace.events import Published, VehicleState

Array = NDArray[np.float64]
Cells = NDArray[np.bool_]

MODEL = Path(__file__).parents[1] / "examples" / "mapping"
SIDE = 0.05
"""Side of a cell of a floor plan [m]."""
WIDE, TALL = 30.0, 40.0
WALL = 0.15
DOORS = (1.6, 2.2)
NEAR = 0.10
TOPICS = ("/map", "/path", "/slam_out_pose")
LIDAR = "{lidar: {beams: 360, range: 12 m, rate: 5 Hz}}"
ODOMETRY = {
    "satellites": "odometry",
    "reckoned": "{odometry: {drift: 2 deg/min, scale: 3 %}}",
}
LONGEST = 1800
"""Time after which a flight ends whatever it knows [s]."""


# -- floors


class Room(NamedTuple):
    """A rectangle: its corners [m]."""

    west: float
    south: float
    east: float
    north: float

    @property
    def shorter(self) -> float:
        """Its shorter side [m]."""
        return min(self.east - self.west, self.north - self.south)


def split(room: Room, random: np.random.Generator) -> list[Room]:
    """Return the rooms into which a block is divided, each with sides of 3 m and more."""
    west, south, east, north = room
    long, short = max(east - west, north - south), room.shorter
    if long < 6.5 or (long < 9.0 and short < 7.0 and random.random() < 0.5):
        return [room]
    at = random.uniform(0.4, 0.6) * long
    if east - west > north - south:
        halves = Room(west, south, west + at, north), Room(west + at, south, east, north)
    else:
        halves = Room(west, south, east, south + at), Room(west, south + at, east, north)
    return [part for half in halves for part in split(half, random)]


def shared(one: Room, other: Room) -> tuple[bool, float, float, float] | None:
    """Return the wall between two rectangles: whether it goes north, where it is, and its ends [m]."""
    for at, to in ((one.east, other.west), (one.west, other.east)):
        low, high = max(one.south, other.south), min(one.north, other.north)
        if at == to and high > low:
            return True, at, low, high
    for at, to in ((one.north, other.south), (one.south, other.north)):
        low, high = max(one.west, other.west), min(one.east, other.east)
        if at == to and high > low:
            return False, at, low, high
    return None


class Floor(NamedTuple):
    """A floor: its walls (rows, columns), the first row in the south, and where the drone begins [m]."""

    walls: Cells
    start: tuple[float, float]

    @property
    def free(self) -> Cells:
        """What can be reached from the start."""
        numbers, _ = label(~self.walls)
        row, column = (int(value / SIDE) for value in reversed(self.start))
        found: Cells = numbers == numbers[row, column]
        return found


class Drawing:
    """The cells of a floor as it is drawn: walls (rows, columns), the first row in the south."""

    def __init__(self) -> None:
        self.walls = np.zeros((round(TALL / SIDE), round(WIDE / SIDE)), dtype=bool)

    def fill(self, room: Room, wall: bool = True) -> None:
        """Make a rectangle a wall, or free."""
        west, south, east, north = (max(round(value / SIDE), 0) for value in room)
        self.walls[south:north, west:east] = wall

    def surround(self, room: Room, inside: float, outside: float) -> None:
        """Draw the walls of a rectangle, so far to its inside and outside [m]."""
        west, south, east, north = room
        out, into = outside, inside
        self.fill(Room(west - out, south - out, west + into, north + out))
        self.fill(Room(east - into, south - out, east + out, north + out))
        self.fill(Room(west - out, south - out, east + out, south + into))
        self.fill(Room(west - out, north - into, east + out, north + out))

    def door(self, one: Room, other: Room, random: np.random.Generator) -> bool:
        """Open a door between two rectangles; return whether their wall is long enough."""
        between = shared(one, other)
        width = random.uniform(*DOORS)
        if between is None or between[3] - between[2] < width + 0.8:
            return False
        upright, at, low, high = between
        first = random.uniform(low + 0.4, high - 0.4 - width)
        last = first + width
        ends = (at - WALL, first, at + WALL, last) if upright else (first, at - WALL, last, at + WALL)
        self.fill(Room(*ends), wall=False)
        return True


def corridors(size: float, random: np.random.Generator) -> list[float]:
    """Return where two corridors through a floor of a size begin and end [m], with both ends of the floor."""
    ends = [0.0]
    for share in (1.0 / 3.0, 2.0 / 3.0):
        middle, half = size * share + random.uniform(-2.0, 2.0), random.uniform(0.9, 1.3)
        ends += [middle - half, middle + half]
    return [round(end / SIDE) * SIDE for end in (*ends, size)]


def floor(seed: int) -> Floor:
    """Return the floor of a seed."""
    random, drawing = np.random.default_rng(seed), Drawing()
    across, along = corridors(WIDE, random), corridors(TALL, random)
    blocks = [
        Room(across[i], along[j], across[i + 1], along[j + 1]) for i, j in product((0, 2, 4), (0, 2, 4))
    ]
    rooms = [room for block in blocks for room in split(block, random)]
    passages = [Room(across[i], 0.0, across[i + 1], TALL) for i in (1, 3)]
    passages += [Room(0.0, along[j], WIDE, along[j + 1]) for j in (1, 3)]
    half = 0.5 * WALL
    for room in rooms:
        drawing.surround(room, half, half)
    for west, south, east, north in passages:
        drawing.fill(Room(west + half, south + half, east - half, north - half), wall=False)
    drawing.surround(Room(0.0, 0.0, WIDE, TALL), WALL, 0.0)
    reached = [room for room in rooms if sum(drawing.door(room, one, random) for one in passages)]
    for one, other in combinations(rooms, 2):
        wanted = (one not in reached) != (other not in reached) or random.random() < 0.25
        if wanted and drawing.door(one, other, random):
            reached += [room for room in (one, other) if room not in reached]
    for room in rooms:
        if room.shorter > 4.5:
            wide, deep = random.uniform(0.4, 1.2, 2)
            west = random.uniform(room.west + 1.5, room.east - 1.5 - wide)
            south = random.uniform(room.south + 1.5, room.north - 1.5 - deep)
            drawing.fill(Room(west, south, west + wide, south + deep))
    return Floor(drawing.walls, (0.5 * (across[1] + across[2]), 0.5 * (along[1] + along[2])))


def write_plan(made: Floor, folder: Path) -> Path:
    """Write a floor as the files of map_server, with the start as its origin; return the YAML file."""
    Image.fromarray(np.where(made.walls[::-1], 0, 254).astype(np.uint8)).save(folder / "floor.png")
    file = folder / "floor.yaml"
    file.write_text(
        f"image: floor.png\nresolution: {SIDE}\norigin: [{-made.start[0]:.6f}, {-made.start[1]:.6f}, 0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n",
        encoding="utf-8",
    )
    return file


# -- flights


class Flight(NamedTuple):
    """What is flown."""

    seed: int
    row: str
    fidelity: str
    out: Path | None


class Flown(NamedTuple):
    """What came of it; see the module's text.

    Args:
        known: Share of the free floor that is known.
        hits: Number of collisions.
        error: Absolute trajectory error of the scans in the map, root of the mean square [m].
        evo: The same by ``evo_ape``; NaN where it is not installed.
        live: The same of the poses by which it flew, as they came.
        walls: Share of the occupied cells that are where there are walls.
        seconds: Simulated time from the start to the landing.
        metres: Way that it flew.
        cpu: Processor time [s].
        word: What went wrong, if anything.
    """

    known: float
    hits: int
    error: float
    evo: float
    live: float
    walls: float
    seconds: float
    metres: float
    cpu: float
    word: str


def changes(flight: Flight, plan: Path) -> tuple[str, ...]:
    """Return how the model differs from the example."""
    gaps = [
        f"gap_{at}: {{kind: sensor-silent, vehicle: drone, sensor: odometry, at: {at} s, duration: 0.5 s}}"
        for at in range(10, LONGEST, 10)
    ]
    return (
        f"files_from=[{plan.parent}]",
        f"environment.floor_plan={{file: {plan}, height: 3 m}}",
        f"environment.vehicles.drone.added_sensors=[{LIDAR}, {ODOMETRY[flight.row]}]",
        "environment.vehicles.drone.battery=60 Ah",
        f"environment.faults={{{', '.join(gaps if flight.row == 'reckoned' else ())}}}",
        f"run.duration={LONGEST} s",
    )


class Witness:
    """Tap that keeps what is judged: true places, the poses as they came, the last map and path."""

    def __init__(self) -> None:
        self.truth: list[tuple[float, float, float]] = []
        self.live: list[bytes] = []
        self.last: dict[str, Published] = {}

    def __call__(self, event: Any) -> None:
        """Take an event."""
        if isinstance(event, VehicleState):
            self.truth.append((event.at / 1e9, event.x, event.y))
        elif event.topic in TOPICS:
            self.last[event.topic] = event
            if event.topic == "/slam_out_pose":
                self.live.append(event.data)

    def message(self, topic: str) -> Any:
        """Return the last message of a topic."""
        event = self.last[topic]
        return from_cdr(event.type, event.data)

    def poses(self) -> Array:
        """Return time [s], x, y [m] of the poses by which the drone flew (n, 3)."""
        kind = self.last["/slam_out_pose"].type
        return np.array([_row(from_cdr(kind, data)) for data in self.live])


def fly(flight: Flight) -> Flown:
    """Fly one."""
    began = process_time()
    with TemporaryDirectory() as temporary:
        folder = Path(temporary) if flight.out is None else flight.out / f"{flight.row}-{flight.seed}"
        folder.mkdir(parents=True, exist_ok=True)
        made, witness = floor(flight.seed), Witness()
        system = load(MODEL, vocabulary(), overrides=changes(flight, write_plan(made, folder)))
        session = RunSession(system, Options(flight.fidelity, flight.seed, record=",".join(TOPICS)))
        try:
            session.tap(witness, Published, VehicleState)
            run = session.run()
        finally:
            session.leave()
        flown = judge(made, witness, folder)
    seen = run.observables
    return flown._replace(
        hits=int(seen.get("drone.collisions", 0)),
        seconds=seen.get("note.map.done.time_max", float("nan")),
        cpu=process_time() - began,
        word=str(run.error or ""),
    )


def judge(made: Floor, witness: Witness, folder: Path) -> Flown:
    """Compare what a run has published with the truth."""
    truth = np.array(witness.truth)
    path = np.array([_row(one) for one in witness.message("/path").poses])
    true = _at(truth, path[:, 0])
    turn, shift = alignment(path[:, 1:], true)
    grid = GridOnFloor(witness.message("/map"), made, turn, shift)
    grid.draw(folder / "map.png")
    poses = witness.poses()
    there = _at(truth, poses[:, 0])
    return Flown(
        grid.known(),
        0,
        _rms(path[:, 1:] @ turn.T + shift - true),
        by_evo(path, true, folder),
        _strayed(poses[:, 1:], there),
        grid.right(),
        0.0,
        float(np.hypot(*np.diff(truth[:, 1:], axis=0).T).sum()),
        0.0,
        "",
    )


def _row(pose: Any) -> tuple[float, float, float]:
    place = pose.pose.position
    return nanoseconds(pose.header.stamp) / 1e9, place.x, place.y


def _at(truth: Array, times: Array) -> Array:
    return np.stack([np.interp(times, truth[:, 0], truth[:, axis]) for axis in (1, 2)], axis=1)


def _rms(off: Array) -> float:
    return float(np.sqrt((off * off).sum(axis=1).mean()))


def _strayed(places: Array, true: Array) -> float:
    turn, shift = alignment(places, true)
    return _rms(places @ turn.T + shift - true)


def alignment(places: Array, true: Array) -> tuple[Array, Array]:
    """Return turn (2, 2) and shift (2,) [m] that bring places (n, 2) nearest to others (Umeyama 1991)."""
    middle, true_middle = places.mean(axis=0), true.mean(axis=0)
    left, _, right = np.linalg.svd((true - true_middle).T @ (places - middle))
    turn = left @ np.diag((1.0, np.linalg.det(left) * np.linalg.det(right))) @ right
    return turn, true_middle - turn @ middle


class GridOnFloor:
    """A map (``nav_msgs/OccupancyGrid``) that is laid over the true floor.

    Args:
        message: The map.
        made: The floor.
        turn: Turn (2, 2) from the axes of the map to the true ones.
        shift: Shift after it (2,) [m].
    """

    def __init__(self, message: Any, made: Floor, turn: Array, shift: Array) -> None:
        info = message.info
        self._cells = np.asarray(message.data, dtype=np.int16).reshape(info.height, info.width)
        self._side, self._made, self._turn, self._shift = info.resolution, made, turn, shift
        self._corner = np.array((info.origin.position.x, info.origin.position.y))
        self._away = distance_transform_edt(~made.walls) * SIDE

    def _on_floor(self) -> NDArray[np.int16]:
        """Return what the map has at each cell of the floor, -1 where it has nothing."""
        rows, columns = np.indices(self._made.walls.shape)
        true = (np.stack((columns.ravel(), rows.ravel()), axis=1) + 0.5) * SIDE - self._made.start
        there = np.floor(((true - self._shift) @ self._turn - self._corner) / self._side).astype(int)
        inside = (there >= 0).all(axis=1) & (there < np.array(self._cells.shape[::-1])).all(axis=1)
        found = np.full(len(there), -1, dtype=np.int16)
        found[inside] = self._cells[there[inside, 1], there[inside, 0]]
        return found.reshape(self._made.walls.shape)

    def known(self) -> float:
        """Return the share of the free floor that is free in the map."""
        found = self._on_floor()[self._made.free]
        return float(((found >= 0) & (found <= 25)).mean())

    def right(self) -> float:
        """Return the share of the occupied cells that are near a wall."""
        rows, columns = np.nonzero(self._cells >= 65)
        centres = (np.stack((columns, rows), axis=1) + 0.5) * self._side + self._corner
        places = np.floor((centres @ self._turn.T + self._shift + self._made.start) / SIDE).astype(int)
        inside = (places >= 0).all(axis=1) & (places < np.array(self._away.shape[::-1])).all(axis=1)
        off = np.full(len(places), np.inf)
        off[inside] = self._away[places[inside, 1], places[inside, 0]]
        return float((off <= NEAR).mean())

    def draw(self, file: Path) -> None:
        """Draw it: white is free, grey not known, black a wall, red a wrong one, blue one not seen."""
        found = self._on_floor()
        picture = np.full((*found.shape, 3), 190, dtype=np.uint8)
        picture[(found >= 0) & (found <= 25)] = 255
        picture[self._made.walls] = (150, 180, 220)
        picture[(found >= 65) & (self._away <= NEAR)] = 0
        picture[(found >= 65) & (self._away > NEAR)] = (220, 30, 30)
        Image.fromarray(picture[::-1]).save(file)


def by_evo(path: Array, true: Array, folder: Path) -> float:
    """Return the error of a path (n, 3) of time [s], x, y [m] by ``evo_ape``; NaN if it is not installed."""
    if which("evo_ape") is None:
        return float("nan")
    for name, places in ("truth", true), ("slam", path[:, 1:]):
        rows = [
            f"{time:.9f} {x:.6f} {y:.6f} 0 0 0 0 1" for time, (x, y) in zip(path[:, 0], places, strict=True)
        ]
        (folder / f"{name}.tum").write_text("\n".join(rows) + "\n", encoding="utf-8")
    command = ("evo_ape", "tum", folder / "truth.tum", folder / "slam.tum", "-a")
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return float(next(line.split()[1] for line in text.splitlines() if line.split()[:1] == ["rmse"]))


HEADINGS = (
    "odometry", "seed", "known", "hits", "error (evo)", "as it flew", "walls", "flight", "way", "computing"
)  # fmt: skip


def summary(flown: list[Flown]) -> str:
    """Return the worst figures of some flights beside the goals."""
    good = [
        one for one in flown if one.known > 0.95 and one.hits == 0 and one.error < 0.10 and one.walls > 0.95
    ]
    return (
        f"{len(flown)} floors; least known {min(one.known for one in flown):.1%} (goal 95 %), "
        f"{sum(one.hits for one in flown)} collisions (0), "
        f"greatest error {max(one.error for one in flown):.3f} m (0.10), "
        f"least share of right walls {min(one.walls for one in flown):.1%} (95 %); "
        f"{len(good)} floors meet all"
    )


def main() -> None:
    """Fly, and print the rows as they come and the summary."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, nargs="*", default=list(range(1, 21)))
    parser.add_argument("--rows", nargs="*", default=list(ODOMETRY), choices=list(ODOMETRY))
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--fidelity", default="times", choices=("times", "code"))
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    out = options.out.absolute() if options.out else None
    flights = [Flight(seed, row, options.fidelity, out) for seed, row in product(options.seeds, options.rows)]
    print(f"| {' | '.join(HEADINGS)} |\n|{'---|' * len(HEADINGS)}")
    results: list[tuple[Flight, Flown]] = []
    with ProcessPoolExecutor(options.workers, get_context("spawn")) as pool:
        for flight, one in zip(flights, pool.map(fly, flights), strict=True):
            results.append((flight, one))
            cells = (
                flight.row, str(flight.seed), f"{one.known:.1%}", str(one.hits),
                f"{one.error:.3f} m ({one.evo:.3f})", f"{one.live:.3f} m", f"{one.walls:.1%}",
                f"{one.seconds:.0f} s", f"{one.metres:.0f} m", f"{one.cpu:.0f} s {one.word}".strip(),
            )  # fmt: skip
            print(f"| {' | '.join(cells)} |", flush=True)
    for row in options.rows:
        print(f"{row}: {summary([one for flight, one in results if flight.row == row])}")


if __name__ == "__main__":
    main()
