"""Localisation in a known map: where was a scan taken, by the odometry since the last one and by the map.

The walls of an occupancy grid become points on lines; each scan is aligned with them from where odometry
expects it, and if it is less sure of that, searched for before. The result weighs both, as a Kalman filter
does. A scan that does not fit leaves the pose to odometry, and the vehicle is lost until one fits again.
"""

from __future__ import annotations

from math import pi, sqrt
from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter
from scipy.spatial import cKDTree

from volery.autonomy.laser_scan import LaserScan2
from volery.autonomy.occupancy_grid import OccupancyGrid
from volery.autonomy.planar_pose import Array, Pose2
from volery.autonomy.scan_matching import LocalMap, Match
from volery.autonomy.slam import SlamSettings
from volery.base.errors import UsageError

FITS, LOST, UNIQUE = 0.4, 0.25, 0.6
"""Part of a scan on the map from which on a place near the guess is found, below which it is lost, and from
which on one is found on the whole map."""
FARTHEST = 3.0
"""Distance [m] within which a lost vehicle is searched for; farther away, ``find`` is for it."""
UNSURE = 0.1
"""Standard deviation [m] from which on a scan is searched for before it is aligned."""
JUMP = 0.5
"""Step [m] or turn [rad] of the pose that is a reset, not a correction."""

_NEAR, _LEAST = 0.3, 4  # [m], number of neighbours through which a line is laid
_FLAT = 0.8  # of a cell: deviation of a wall's cells from its line
_SPARSE = 160  # points of a scan that are enough for a search of the whole map
_MAP_ERROR, _MAP_TURN = 0.02, 0.004  # [m, rad] of what fits best; by the cells, this part of their side:
_CELLS = 0.3
_BLIND = np.array((0.3, 0.3, 0.2))  # standard deviations of a motion without odometry


class Located(NamedTuple):
    """Where the vehicle is on the map.

    Args:
        pose: Its pose.
        covariance: Of x, y [m] and yaw [rad], (3, 3).
        share: Part of the last scan that lies on the map.
        resets: How often the pose has jumped since the start, as when it was found again.
        word: Why the place is not known; empty: it is.
    """

    pose: Pose2
    covariance: Array
    share: float
    resets: int
    word: str


def walls_of(grid: OccupancyGrid) -> LocalMap:
    """Return the walls of a grid as points on lines: its occupied cells beside free ones.

    Raises:
        UsageError: The grid has no walls.
    """
    occupied, free = grid.occupied, grid.free.astype(np.float64)
    lean = np.zeros((*occupied.shape, 2))  # towards what is free: rows, columns
    padded = np.pad(free, 1)
    for row in (-1, 0, 1):
        for column in (-1, 0, 1):
            part = padded[1 + row : 1 + row + occupied.shape[0], 1 + column : 1 + column + occupied.shape[1]]
            lean[..., 0] += row * part
            lean[..., 1] += column * part
    beside = occupied & (uniform_filter(free, 3, mode="constant") > 0.0)
    cells = np.argwhere(beside)
    if not len(cells):
        raise UsageError("the map has no walls beside free cells; make one with `volery map`")
    points = grid.centres(cells)
    away = lean[beside][:, ::-1]
    length = np.sqrt((away * away).sum(axis=1))
    away /= np.where(length > 0.0, length, 1.0)[:, None]
    return LocalMap(*_on_lines(points, away, grid.resolution))


def _on_lines(points: Array, away: Array, resolution: float) -> tuple[Array, Array]:
    """Move the cells of walls onto the lines through their neighbours on the same side.

    Args:
        points: Centres of the cells (n, 2) [m].
        away: Unit vectors from the wall (n, 2).
        resolution: Side of a cell [m].

    Returns:
        Points and normals (n, 2); the normal is zero where there is no line.
    """
    reach = max(_NEAR, 3.0 * resolution)
    tree = cKDTree(points)
    moved, normals = points.copy(), np.zeros_like(points)
    for number, near in enumerate(tree.query_ball_point(points, reach)):
        chosen = np.sort(np.asarray(near))
        chosen = chosen[away[chosen] @ away[number] > 0.3]
        if len(chosen) < _LEAST:
            continue
        off = points[chosen] - points[chosen].mean(axis=0)
        (xx, xy), (_, yy) = off.T @ off / len(chosen)
        half = 0.5 * (xx - yy)
        mixed = sqrt(half * half + xy * xy)
        across = max(0.5 * (xx + yy) - mixed, 0.0)
        if sqrt(across) > _FLAT * resolution or mixed <= across:
            continue
        normal = np.array((xy, -(half + mixed)) if half > 0.0 else (half - mixed, xy))
        size = sqrt(float(normal @ normal))
        if size == 0.0:
            continue
        normal /= size
        normals[number] = normal
        moved[number] += normal * float(normal @ (points[chosen].mean(axis=0) - points[number]))
    return moved, normals


class Localiser:
    """Where a vehicle is on a map, scan after scan.

    Args:
        grid: The map, as of ``OccupancyGrid.load``.
        start: Pose at the beginning; ``find`` returns it where it is not known.
        spread: Standard deviations of the start: x, y [m], yaw [rad].
        settings: How wrong the odometry is.

    Example::

        localiser = Localiser(OccupancyGrid.load(Path("hall.yaml")), Pose2(0.0, 0.0, 0.0))
        here = localiser.add(odometry, scan_of(message))  # at each scan
        here = localiser.predict(odometry)  # between two
    """

    def __init__(
        self,
        grid: OccupancyGrid,
        start: Pose2,
        spread: tuple[float, float, float] = (0.5, 0.5, 0.2),
        settings: SlamSettings = SlamSettings(),  # noqa: B008  # it is immutable
    ) -> None:
        self._walls = walls_of(grid)
        self._settings = settings
        error = max(_MAP_ERROR, _CELLS * grid.resolution)
        self._map_error = np.diag((error * error, error * error, _MAP_TURN * _MAP_TURN))
        self._odometry: Pose2 | None = None
        self._pose = start
        self._covariance: Array = np.diag(np.square(np.array(spread, dtype=np.float64)))
        self._share, self._resets, self._word = 0.0, 0, "no scan has been matched yet"
        self._begun = False

    def predict(self, odometry: Pose2 | None) -> Located:
        """Return where the vehicle is by the odometry since the last scan; None: it is not known."""
        pose, covariance = self._expected(odometry)
        return Located(pose, covariance, self._share, self._resets, self._word)

    def add(self, odometry: Pose2 | None, scan: LaserScan2) -> Located:
        """Take the next scan; return where it was taken.

        Args:
            odometry: Pose by the vehicle's odometry when it was; None: it is not known.
            scan: The scan in the vehicle's frame.
        """
        pose, covariance = self._expected(odometry)
        self._odometry = odometry
        if len(scan.points) < _LEAST:
            self._pose, self._covariance, self._share = pose, covariance, 0.0
            self._word = "the scan has met nothing"
            return self.predict(odometry)
        match = self._match(scan.points, pose, np.sqrt(np.diag(covariance)))
        self._share = match.share
        if match.share < (FITS if self._word else LOST):
            self._pose, self._covariance = pose, covariance
            self._word = f"{100.0 * match.share:.0f} % of the scan fit the map"
            return self.predict(odometry)
        step = pose.to(match.pose)
        if self._begun and max(step.distance, abs(step.yaw)) > JUMP:
            self._resets += 1
        self._begun, self._pose, self._word = True, match.pose, ""
        both = np.linalg.inv(covariance) + match.information
        self._covariance = np.asarray(np.linalg.inv(both) + self._map_error, dtype=np.float64)
        return self.predict(odometry)

    def find(self, scan: LaserScan2) -> Match | None:
        """Return where on the whole map a scan fits best; None: nowhere. It takes seconds on large maps.

        Where the map looks the same in several places, one of them is returned.
        """
        points = scan.points[:: max(1, len(scan.points) // _SPARSE)]
        if len(points) < _LEAST:
            return None
        low, high = self._walls.extent
        x, y = 0.5 * (low + high)
        middle = Pose2(float(x), float(y), 0.0)
        found = self._walls.search(points, middle, 0.5 * float((high - low).max()), pi, UNIQUE)
        if found is None:
            return None
        match = self._walls.align(scan.points, found.pose, np.array((0.3, 0.3, 0.1)))
        return match if match.share >= UNIQUE else None

    # -- parts

    def _expected(self, odometry: Pose2 | None) -> tuple[Pose2, Array]:
        """Return pose and covariance by the odometry since the last scan."""
        if odometry is None or self._odometry is None:
            spread = _BLIND if self._begun else np.zeros(3)
            return self._pose, self._covariance + np.diag(spread * spread)
        motion = self._odometry.to(odometry)
        pose, settings, way = self._pose.after(motion), self._settings, motion.distance
        shift = settings.shift + settings.slip * way
        turn = settings.turn + settings.skid * abs(motion.yaw) + settings.drift * way
        carried = np.eye(3)
        carried[0, 2], carried[1, 2] = self._pose.y - pose.y, pose.x - self._pose.x
        noise = np.diag((shift * shift, shift * shift, turn * turn))
        return pose, carried @ self._covariance @ carried.T + noise

    def _match(self, points: Array, guess: Pose2, spread: Array) -> Match:
        """Return where a scan fits near a guess, whose standard deviations are given."""
        near = None
        if not self._word and max(spread[0], spread[1]) < UNSURE and spread[2] < UNSURE:
            near = self._walls.align(points, guess, spread)
            if near.share >= FITS:
                return near
        reach = min(3.0 * float(max(spread[0], spread[1])) + 0.2, FARTHEST)
        match = self._walls.search(points, guess, reach, min(3.0 * float(spread[2]) + 0.05, pi))
        if match is None:
            return near or Match(guess, 0.0, np.zeros((3, 3)))
        wide = self._walls.align(points, match.pose, np.maximum(spread, 0.05), 0.6)
        return near if near is not None and near.share >= wide.share else wide
