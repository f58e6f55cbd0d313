"""The way to a goal among obstacles that only a lidar knows: map, path, and the velocity to command now.

Scans become an occupancy grid, in which a path is planned anew twice a second; what is not known counts as
free. The vehicle heads for a point ahead on the path, slower before corners; commanded is the nearest
velocity that is safe by the last scan (``avoidance``). The path finds the way, the scan alone keeps it safe.
"""

from __future__ import annotations

from collections import deque
from math import ceil, isfinite, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_closing

from volery.autonomy.avoidance import Motion, safe_velocity
from volery.autonomy.grid_path import COMFORT, Cell, WaysFrom, clearance_of
from volery.autonomy.laser_scan import LaserScan2
from volery.autonomy.occupancy_grid import OccupancyGrid
from volery.autonomy.planar_pose import Array, Pose2
from volery.autonomy.trajectory import TrajectoryLimits, arcs_of, corner_speed
from volery.base.errors import UsageError
from volery.base.metered_work import done
from volery.base.time import MS, Ns, S, to_seconds

_REPLAN: Ns = 500 * MS
_STUCK = 0.3  # [m] that the vehicle goes while its scan does not change in the least, until the scan is stuck
_AROUND = 5.0  # [m] by which a path may leave what is mapped
_SPARE = 0.1  # [m] that a path keeps beyond what a safe velocity needs
_NOTICED = 3.0
"""Distance [m] up to which one scan closes a cautious way: farther away an old yaw lays its points wrong."""
_ROUNDING = 1e-9  # of a cell
_DEVIATION = 0.4  # [m] of the vehicle from a corner of the path: with it the speed in corners rises
_LOYAL = 1.2  # times the cost of the best path, up to which a vehicle stays on its path
_EASY = 0.85  # of the acceleration is planned with: the rest keeps the vehicle on the path


class Window(NamedTuple):
    """A part of the plane in cells of a side: its corner [m] and that side [m]."""

    west: float
    south: float
    side: float

    def cell(self, x: float, y: float) -> tuple[int, int]:
        """Return row and column of the cell of a place in the window."""
        return int((y - self.south) / self.side), int((x - self.west) / self.side)

    def centres(self, cells: NDArray[np.int64]) -> Array:
        """Return the centres (n, 2) [m] of cells (n, 2) given as rows and columns."""
        places: Array = (cells[:, ::-1] + 0.5) * self.side + np.array((self.west, self.south))
        return places


class Navigator:
    """Leads a vehicle to a goal.

    Args:
        motion: What the vehicle can do.
        goal: Where to go in the map (x, y) [m], or None to stay. It may be set anew at any time.
        resolution: Side of a cell of the map [m].
        silence: Age of the last scan from which on the vehicle brakes [ns].
        cautious: Whether paths keep their distance from what is not known, too.

    ``word`` says what it does, or why it does not go on; ``fault`` is what is wrong with scan, pose or
    velocity, empty if nothing is; ``way`` is the path (n, 2) [m]; ``grid`` is the map,
    which may be replaced by that of ``slam``.

    Example::

        navigator = Navigator(Motion(radius=0.35, speed=3.0, acceleration=3.0, sight=20.0), goal=(30.0, 4.0))
        while not navigator.arrived:
            east, north = navigator.update(now, pose, scan, velocity)
            drone.set_velocity(north, east)
    """

    def __init__(
        self,
        motion: Motion,
        goal: tuple[float, float] | None = None,
        resolution: float = 0.1,
        silence: Ns = S // 2,
        cautious: bool = False,
    ) -> None:
        self.motion, self.silence, self.cautious = motion, silence, cautious
        self.grid = OccupancyGrid(resolution)
        self.word = self.fault = "no scan yet"
        self.arrived = False
        self.near = max(2.0 * resolution, 0.3)
        """Distance [m] from the goal within which it is reached."""
        self.way: Array = np.zeros((0, 2))
        self._goal = goal
        self._speeds: list[float] = []
        self._planned: Ns | None = None
        self.no_way = ""
        """Why there is no way to the goal, as of the last plan; empty if there is one."""
        self._now: Ns | None = None
        self._scanned: Ns | None = None
        self._points: Array = np.zeros((0, 2))  # of the last scan, as it came
        self._gone = 0.0  # [m] since they changed
        self._seen: Array = np.zeros((0, 2))  # points of the last scan in the map
        self._commands: deque[tuple[Ns, Array]] = deque()

    @property
    def least(self) -> float:
        """Distance [m] that the path keeps from what is in the way."""
        return max(self.motion.room + _SPARE, 0.5 * self.grid.resolution) + 0.71 * self.grid.resolution

    @property
    def goal(self) -> tuple[float, float] | None:
        """Where to go in the map [m]."""
        return self._goal

    @goal.setter
    def goal(self, goal: tuple[float, float] | None) -> None:
        if goal is not None and not all(map(isfinite, goal)):
            raise UsageError(f"a goal at {goal}; give finite metres")
        if goal != self._goal:
            self._goal, self._planned, self.arrived, self.no_way = goal, None, False, ""
            self.way = np.zeros((0, 2))

    def update(self, time: Ns, pose: Pose2, scan: LaserScan2 | None, velocity: Array) -> Array:
        """Return the velocity to command.

        Args:
            time: Now [ns]; at most a ``period`` of the motion after the update before.
            pose: Where the vehicle is in the map.
            scan: The last scan, taken at this pose; None or the one before if there is no new one.
            velocity: Present velocity in the axes of the map (2,) [m/s].

        Returns:
            The velocity in the axes of the map (2,) [m/s]; zero to brake, and ``word`` says why.
        """
        velocity = np.asarray(velocity, dtype=np.float64)
        command = self._decide(time, pose, scan, velocity)
        done("navigation")
        self._commands.append((time, command))
        return command

    def _decide(self, time: Ns, pose: Pose2, scan: LaserScan2 | None, velocity: Array) -> Array:
        self.fault = self._check(time, pose, scan, velocity)
        if self.fault or self._goal is None:
            return self._brake(self.fault or "no goal")
        place = np.array((pose.x, pose.y))
        left = self._goal - place
        if sqrt(float((left * left).sum())) < self.near:
            self.arrived = True
            return self._brake("arrived")
        if self._planned is None or time - self._planned >= _REPLAN:
            self._planned = time
            self.no_way = self._plan(place, self._goal)
        if self.no_way:
            return self._brake(self.no_way)
        wanted = self._wanted(place, velocity)
        command = safe_velocity(self._seen - place, velocity, wanted, self.motion, self._pending(time))
        self.word = "on the way" if command.any() else "brakes: no velocity towards the path is safe"
        return command

    def _check(self, time: Ns, pose: Pose2, scan: LaserScan2 | None, velocity: Array) -> str:
        """Take a new scan; return why the vehicle must brake whatever the goal."""
        if not (np.isfinite(pose).all() and np.isfinite(velocity).all()):
            return "pose or velocity is not a number"
        if self._now is None or time < self._now:  # a clock that jumped back: what it dated says nothing
            self._commands.clear()
            self._now, self._planned, self._scanned = time, None, None
        self._gone += sqrt(float((velocity * velocity).sum())) * to_seconds(time - self._now)
        self._now = time
        if scan is not None and scan.time != self._scanned:
            fault = self._doubt(time, pose, scan)
            if fault:
                return fault
            self._scanned = scan.time
            self._seen = pose.of(scan.points)
            self.grid.insert(pose, scan)
        if self._scanned is None:
            return "no scan yet"
        if time - self._scanned > self.silence:
            return f"no scan for more than {to_seconds(self.silence):g} s"
        return ""

    def _brake(self, word: str) -> Array:
        self.word = word
        return np.zeros(2)

    def _doubt(self, time: Ns, pose: Pose2, scan: LaserScan2) -> str:
        """Return why a new scan is not to be believed."""
        late = to_seconds(time - scan.time)
        if abs(late) > to_seconds(self.silence):
            return f"the scan is {abs(late):.0f} s {'old' if late > 0.0 else 'ahead of the clock'}"
        if not len(scan.points) and not len(scan.open_ends):
            return "the scan says nothing: no beam is a number within the limits of the sensor"
        if not len(scan.points) and self._is_something_near(pose):
            return "the scan is all maximum where the map has obstacles"
        if not len(scan.points) or not np.array_equal(scan.points, self._points):
            self._points, self._gone = scan.points, 0.0
        if self._gone > _STUCK:
            return "the scan does not change although the vehicle moves: it is stuck"
        return ""

    def _is_something_near(self, pose: Pose2) -> bool:
        off = self.grid.centres(np.argwhere(self.grid.occupied)) - (pose.x, pose.y)
        reach = 0.5 * min(self.motion.sight, 20.0)
        return bool(((off * off).sum(axis=1) < reach * reach).any())

    def _pending(self, time: Ns) -> list[tuple[float, Array]]:
        """Return the commands that take effect within the delay, and for how long each [s]."""
        delay = round(self.motion.delay * S)
        while len(self._commands) > 1 and self._commands[1][0] + delay <= time:
            self._commands.popleft()
        ends = [*[issued + delay for issued, _ in self._commands][1:], time + delay]
        begins = [time, *ends]
        return [
            (to_seconds(end - begin), command)
            for begin, end, (_, command) in zip(begins, ends, self._commands, strict=False)
        ]

    def _plan(self, place: Array, goal: tuple[float, float]) -> str:
        """Plan the path to the goal; return why there is none."""
        ways, window = self.ways_from(place, goal=goal)
        to = window.cell(*goal)
        kept = self._cost_of_way(place, ways, window)
        if kept < np.inf and kept <= _LOYAL * ways.cost[to]:
            return ""
        self.way, self._speeds = np.zeros((0, 2)), []
        room = float(ways.clearance[to])
        if room < self.least:
            return f"no way: the goal is {room:.1f} m from an obstacle, and paths keep {self.least:.1f} m"
        here = float(ways.clearance[ways.start])
        if ways.cost[to] == np.inf and here < self.least:
            ways = self._out_of_gap(ways, to)
        cells = ways.straightened(ways.to(to))
        if not len(cells):
            return f"no way to ({goal[0]:.1f}, {goal[1]:.1f}) m is {self.least:.1f} m from all obstacles"
        self.way = np.vstack((place, window.centres(cells[1:-1]), goal))
        limits = TrajectoryLimits(self.motion.fastest, _EASY * self.motion.acceleration, _DEVIATION)
        self._speeds = [corner_speed(arc, limits) for arc in arcs_of(self.way, _DEVIATION)]
        self._speeds[-1] = 0.0
        return ""

    def ways_from(self, place: Array, goal: tuple[float, float] | None = None) -> tuple[WaysFrom, Window]:
        """Return the ways from a place (2,) [m], only that to the goal if there is one.

        They lead through a window that holds the map, the place and the goal. A cautious one's window is the
        map, if that holds both.
        """
        grid, side = self.grid, self.grid.resolution
        rows, columns = grid.log_odds.shape
        around = 0.0 if self.cautious else _AROUND
        corner = np.array((grid.west, grid.south))
        held = np.array(
            (place, *(() if goal is None else (goal,)), corner, corner + side * np.array((columns, rows)))
        )
        left, below = np.ceil((corner - held.min(axis=0) + around) / side - _ROUNDING).astype(int)
        window = Window(grid.west - left * side, grid.south - below * side, side)
        tall, wide = np.ceil((held.max(axis=0) + around - window[:2])[::-1] / side - _ROUNDING).astype(int)
        blocked = np.full((tall, wide), self.cautious)
        mapped = ~self.free if self.cautious else grid.occupied
        blocked[below : below + rows, left : left + columns] = mapped
        done("plan", points=len(self._seen), cells=blocked.size)
        off = self._seen - place
        near = (off * off).sum(axis=1) < _NOTICED * _NOTICED
        for x, y in self._seen[near] if self.cautious else self._seen:
            blocked[window.cell(x, y)] = True
        to = None if goal is None else window.cell(*goal)
        ways = WaysFrom(clearance_of(blocked, side), side, window.cell(*place), self.least, to)
        if goal is None and not (ways.cost[ways.clearance >= self.least] < np.inf).any():
            ways = self._out_of_gap(ways, None)
        return ways, window

    def _out_of_gap(self, ways: WaysFrom, to: Cell | None) -> WaysFrom:
        """Return the ways from a place in a gap that is too narrow to be chosen, through gaps as narrow.

        Narrower by a cell: else there is no way on from where the gap is widest.
        """
        side = self.grid.resolution
        least = max(float(ways.clearance[ways.start]) - side, (1.0 + _ROUNDING) * side)
        return WaysFrom(ways.clearance, side, ways.start, least, to)

    @property
    def free(self) -> NDArray[np.bool_]:
        """Which cells of the map are free (rows, columns), those between the beams of a scan as well."""
        grid = self.grid
        done("closing", cells=grid.log_odds.size)
        closed: NDArray[np.bool_] = binary_closing(grid.free, np.ones((3, 3), dtype=bool))
        return closed & ~grid.occupied

    def _progress(self, place: Array) -> tuple[int, float, Array]:
        """Return the nearest leg of the path, how far along the path that is, and where its legs end [m]."""
        sides = np.diff(self.way, axis=0)
        lengths = np.sqrt((sides * sides).sum(axis=1))
        share = np.clip(((place - self.way[:-1]) * sides).sum(axis=1) / (lengths * lengths), 0.0, 1.0)
        off = self.way[:-1] + share[:, None] * sides - place
        at = int((off * off).sum(axis=1).argmin())
        ends = np.cumsum(lengths)
        along = float(ends[at] - (1.0 - share[at]) * lengths[at])
        return at, along, ends

    def _cost_of_way(self, place: Array, ways: WaysFrom, window: Window) -> float:
        """Return the cost of what is left of the path, as of ``WaysFrom``; infinity if it comes too near.

        It may be nearer by a cell than a new one: else ways would change with each cell that a scan corrects.
        """
        if not len(self.way):
            return np.inf
        _, along, ends = self._progress(place)
        count = ceil(2.0 * (ends[-1] - along) / window.side) + 1
        lengths = np.linspace(along, ends[-1], count)
        places = [np.interp(lengths, [0.0, *ends], self.way[:, axis]) for axis in (1, 0)]
        corner = (window.south, window.west)
        cells = [
            np.clip((value - low) / window.side, 0, size - 1).astype(int)
            for value, low, size in zip(places, corner, ways.clearance.shape, strict=True)
        ]
        rooms = ways.clearance[tuple(cells)]
        if rooms.min() < self.least - window.side:
            return np.inf
        weights = 1.0 + 2.0 * np.maximum(0.0, 1.0 - rooms / COMFORT)
        return float(weights.mean() * (ends[-1] - along))

    def _wanted(self, place: Array, velocity: Array) -> Array:
        """Return the velocity towards a point ahead on the path, as fast as corners and goal allow."""
        at, along, ends = self._progress(place)
        sides = np.diff(self.way, axis=0)
        lengths = np.diff(ends, prepend=0.0)
        present = sqrt(float((velocity * velocity).sum()))
        speed = self.motion.fastest
        for end, corner in zip(ends[at:], self._speeds[at + 1 :], strict=True):
            room = corner * corner / (2.0 * _EASY * self.motion.acceleration) + float(end) - along
            lag = self.motion.delay * _EASY * self.motion.acceleration
            speed = min(speed, sqrt(lag * lag + 2.0 * _EASY * self.motion.acceleration * room) - lag)
        ahead = min(along + 0.6 + 0.4 * present, float(ends[-1]))
        leg = min(int(np.searchsorted(ends, ahead)), len(sides) - 1)
        target = self.way[leg + 1] - (ends[leg] - ahead) * sides[leg] / lengths[leg]
        towards = target - place
        distance = sqrt(float((towards * towards).sum()))
        return towards * (max(speed, 0.1) / distance) if distance > 0.0 else np.zeros(2)
