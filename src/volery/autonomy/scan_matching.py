"""Where was a planar scan taken? Search over a likelihood field, then alignment of points with lines.

* The search tries every pose of a window on a grid and is exact: bounds from maxima over blocks of cells cut
  off what cannot win (Olson, ICRA 2009; Hess, Kohler, Rapp and Andor, ICRA 2016). What fits worse than the
  guess cannot, so a bound is left as soon as it is below that.
* The alignment minimises the distances of points from the lines that scans have seen, with a robust weight
  and the odometry as a prior (Censi, ICRA 2008, of whose metric this is the Gauss-Newton form). The prior is
  what holds the pose along a corridor.

Both are compiled, use no library of trigonometry but ``base.elementary``, and give the same bits everywhere.
"""

from __future__ import annotations

from collections.abc import Callable
from math import ceil, sqrt
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.planar_pose import Array, Pose2
from volery.base.elementary import sine_cosine
from volery.base.metered_work import done
from volery.base.numeric_code import NumericCode, numeric

RESOLUTION = 0.05
"""Side of a cell of the likelihood field [m]."""
LEVELS = 6
"""Levels of the field: blocks of 1 to 32 cells."""

_REACH = 0.17  # [m] from a point to where it has no likelihood: noise of a beam and of its direction
_SIDE = 0.25  # [m] side of the cells in which the nearest line is looked for
_DISTANCES = (0.5, 0.5, 0.4, 0.4, 0.3, 0.3, 0.2, 0.2, 0.15, 0.15, 0.1, 0.1, 0.1, 0.1, 0.1)
"""Farthest line [m] that a point is paired with, for each iteration of the alignment."""
_NOISE = 0.03  # [m] standard deviation of a point's distance from its line
_NEIGHBOURS = 4  # points on each side through which a line is laid
_TIE = 1e-6  # of a likelihood: what rounding may take from a bound
_BATCH = 64  # points between two checks whether a block can still hold a match
_APART = 0.35  # [m] a neighbour farther than this is on another surface
_FLAT = 0.03  # [m] deviation from the line up to which it is one


class Match(NamedTuple):
    """Where a scan fits.

    Args:
        pose: Pose of the scan in the frame of the local map.
        share: Part of its points that lie on what the map shows, 0 to 1.
        information: Inverse of the covariance of x, y [m] and yaw [rad], (3, 3), of the points alone.
    """

    pose: Pose2
    share: float
    information: Array


def normals_of(points: Array) -> Array:
    """Return the unit normals (n, 2) of the lines through each point of a scan and its neighbours.

    Args:
        points: Points (n, 2) in the order of the beams [m].

    A normal is zero where the neighbours are too few, too far or not on a line.
    """
    count = len(points)
    done("normals", points=count)
    index = np.arange(count)[:, None] + np.arange(-_NEIGHBOURS, _NEIGHBOURS + 1)[None, :]
    inside = (index >= 0) & (index < count)
    near = points[np.clip(index, 0, count - 1)] if count else np.zeros((0, 2 * _NEIGHBOURS + 1, 2))
    off = near - points[:, None, :]
    used = inside & ((off * off).sum(axis=2) < _APART * _APART)
    number = np.maximum(used.sum(axis=1), 1)
    mean = (off * used[:, :, None]).sum(axis=1) / number[:, None]
    off = (off - mean[:, None, :]) * used[:, :, None]
    xx, yy = (off * off).sum(axis=1).T
    xy = (off[:, :, 0] * off[:, :, 1]).sum(axis=1)
    half = 0.5 * (xx - yy)
    mixed = np.sqrt(half * half + xy * xy)
    across = np.maximum(0.5 * (xx + yy) - mixed, 0.0)
    normal = np.stack(
        (np.where(half > 0.0, xy, half - mixed), np.where(half > 0.0, -(half + mixed), xy)), axis=1
    )
    length = np.sqrt((normal * normal).sum(axis=1))
    good = (
        (used.sum(axis=1) >= 4) & (np.sqrt(across / number) < _FLAT) & (length > 0.0) & (mixed > 2.0 * across)
    )
    return np.where(good[:, None], normal / np.where(length > 0.0, length, 1.0)[:, None], 0.0)


class LocalMap:
    """Points and lines that some scans have seen, in which another scan is looked for.

    Args:
        points: Points (n, 2) [m].
        normals: Their normals (n, 2), as of ``normals_of``.
    """

    def __init__(self, points: Array, normals: Array) -> None:
        margin = _REACH + RESOLUTION * (1 << LEVELS)
        low = points.min(axis=0) - margin
        size = np.ceil((points.max(axis=0) + margin - low) / RESOLUTION).astype(np.int64)
        self._origin = low
        self._points = np.ascontiguousarray(points)
        self._size = size
        self._levels: NDArray[np.float32] | None = None
        lines = np.hstack((points, normals))[(normals != 0.0).any(axis=1)]
        columns, rows = (np.ceil((size * RESOLUTION) / _SIDE)).astype(np.int64) + 1
        cells = ((lines[:, 1] - low[1]) / _SIDE).astype(np.int64) * columns
        cells += ((lines[:, 0] - low[0]) / _SIDE).astype(np.int64)
        self._lines = np.ascontiguousarray(lines[np.argsort(cells, kind="stable")])
        self._starts = np.zeros(columns * rows + 1, dtype=np.int64)
        np.cumsum(np.bincount(cells, minlength=columns * rows), out=self._starts[1:])
        self._lattice = np.array((low[0], low[1], _SIDE, columns, rows), dtype=np.float64)
        done("local_map", points=len(points), cells=float(columns * rows))

    @property
    def extent(self) -> tuple[Array, Array]:
        """The corners in the south-west and in the north-east of all points [m]."""
        return self._points.min(axis=0), self._points.max(axis=0)

    def _pyramid(self) -> NDArray[np.float32]:
        """Return the likelihood field, and for each level k its maxima over 2^k by 2^k cells north-east."""
        if self._levels is None:
            columns, rows = self._size
            levels = np.zeros((LEVELS, rows, columns), dtype=np.float32)
            spread_likelihood.bind(levels[0], self._points, self._origin)()
            for level in range(1, LEVELS):
                step, below, here = 1 << (level - 1), levels[level - 1], levels[level]
                here[:] = below
                np.maximum(here[:-step], below[step:], out=here[:-step])
                wide = here.copy()
                np.maximum(here[:, :-step], wide[:, step:], out=here[:, :-step])
            self._levels = levels
            done("field", points=len(self._points), cells=float(columns * rows))
        return self._levels

    def search(
        self, points: Array, guess: Pose2, reach: float, turn: float, least: float = 0.0
    ) -> Match | None:
        """Return the best pose of a scan in a window about a guess, on the grid; None below a share.

        Args:
            points: The scan's points (n, 2) in its own frame [m].
            guess: Centre of the window.
            reach: Half of the window's side [m].
            turn: Half of the window's range of yaw [rad].
            least: Mean likelihood of the points below which there is no match.
        """
        levels = self._pyramid()
        farthest = sqrt(float((points * points).sum(axis=1).max(initial=1.0)))
        step = max(RESOLUTION / farthest, 0.004)
        yaws = guess.yaw + step * np.arange(-ceil(turn / step), ceil(turn / step) + 1)
        cells = ceil(reach / RESOLUTION)
        level = min(LEVELS - 1, max(0, int(np.log2(max(cells, 1))) - 1))
        block = 1 << level
        steps = (2 * cells + block) // block
        bounds = np.zeros(len(yaws) * steps * steps)
        window = np.array((guess.x, guess.y, cells, level, steps, least, 0.0), dtype=np.float64)
        scan = np.ascontiguousarray(points)
        places = np.zeros((len(scan), 2), dtype=np.int64)
        bound_blocks.bind(levels, self._origin, scan, yaws, window, places, bounds)()
        order = np.argsort(-bounds, kind="stable")
        found = np.array((0.0, 0.0, 0.0, least, 0.0))
        stack = np.zeros((8 * LEVELS, 4))
        search_blocks.bind(levels, self._origin, scan, yaws, window, bounds, order, stack, found)()
        done("search", looks=window[6] + len(scan) * found[4], blocks=len(bounds))
        if found[3] <= least:
            return None
        return Match(Pose2(*found[:3]), float(found[3]), np.zeros((3, 3)))

    def align(self, points: Array, guess: Pose2, prior: Array, scale: float = 1.0) -> Match:
        """Return the pose near a guess at which the points of a scan lie on lines.

        Args:
            points: The scan's points (n, 2) in its own frame [m].
            guess: The pose to begin with; it is also the mean of the prior.
            prior: Standard deviations of the guess: along x and y of the map [m], yaw [rad]. (3,)
            scale: Factor on the distances within which points are paired.
        """
        pose = np.array(guess, dtype=np.float64)
        result = np.zeros(12)
        distances = scale * np.array(_DISTANCES)
        weights = 1.0 / (prior * prior)
        align_lines.bind(
            self._lines,
            self._starts,
            self._lattice,
            np.ascontiguousarray(points),
            distances,
            weights,
            pose,
            result,
        )()
        done("align", points=result[10], lines=result[11])
        return Match(Pose2(*map(float, pose)), float(result[9]), result[:9].reshape(3, 3).copy())


@numeric
def _mean_likelihood(  # noqa: PLR0917  # numbers and arrays of a kernel
    level: NDArray[np.float32],
    origin: Array,
    points: Array,
    east: float,
    north: float,
    sine: float,
    cosine: float,
) -> float:
    """Return the mean of a field at the points of a scan, whose position is a corner of a cell [m]."""
    total = 0.0
    rows, columns = level.shape
    for index in range(len(points)):
        x, y = points[index, 0], points[index, 1]
        column = int(np.floor((east + cosine * x - sine * y - origin[0]) / RESOLUTION))
        row = int(np.floor((north + sine * x + cosine * y - origin[1]) / RESOLUTION))
        if 0 <= column < columns and 0 <= row < rows:
            total += level[row, column]
    return total / len(points)


@numeric
def _align_once(  # noqa: PLR0917  # likewise
    lines: Array,
    starts: NDArray[np.int64],
    lattice: Array,
    points: Array,
    far: float,
    pose: Array,
    sums: Array,
) -> None:
    """Add up the normal equations of the distances from lines: H (6), b (3), weight of what is paired.

    The last two sums go on: points, and lines that were looked at.
    """
    sine, cosine = sine_cosine(pose[2])
    columns, rows = int(lattice[3]), int(lattice[4])
    sums[:10] = 0.0
    sums[10] += len(points)
    for index in range(len(points)):
        x = cosine * points[index, 0] - sine * points[index, 1]
        y = sine * points[index, 0] + cosine * points[index, 1]
        east, north = pose[0] + x, pose[1] + y
        column = int(np.floor((east - lattice[0]) / lattice[2]))
        row = int(np.floor((north - lattice[1]) / lattice[2]))
        around = ceil(far / lattice[2])
        nearest, best = -1, far * far
        for line in range(max(row - around, 0), min(row + around, rows - 1) + 1):
            first = max(column - around, 0)
            last = min(column + around, columns - 1)
            if first > last:
                continue
            sums[11] += starts[line * columns + last + 1] - starts[line * columns + first]
            for at in range(starts[line * columns + first], starts[line * columns + last + 1]):
                off_x, off_y = lines[at, 0] - east, lines[at, 1] - north
                square = off_x * off_x + off_y * off_y
                if square < best:
                    nearest, best = at, square
        if nearest < 0:
            continue
        normal_x, normal_y = lines[nearest, 2], lines[nearest, 3]
        off = normal_x * (east - lines[nearest, 0]) + normal_y * (north - lines[nearest, 1])
        turn = normal_y * x - normal_x * y
        ratio = off / (2.0 * _NOISE)
        weight = 1.0 / (1.0 + ratio * ratio)
        sums[9] += weight
        weight /= _NOISE * _NOISE
        sums[0] += weight * normal_x * normal_x
        sums[1] += weight * normal_x * normal_y
        sums[2] += weight * normal_x * turn
        sums[3] += weight * normal_y * normal_y
        sums[4] += weight * normal_y * turn
        sums[5] += weight * turn * turn
        sums[6] += weight * normal_x * off
        sums[7] += weight * normal_y * off
        sums[8] += weight * turn * off


@numeric
def _step(sums: Array, prior: Array, pose: Array, guess: tuple[float, float, float]) -> float:
    """Move a pose to the minimum of the normal equations and the prior; return how far [m, rad]."""
    a, d, f = sums[0] + prior[0], sums[3] + prior[1], sums[5] + prior[2]
    b, c, e = sums[1], sums[2], sums[4]
    p = -(sums[6] + prior[0] * (pose[0] - guess[0]))
    q = -(sums[7] + prior[1] * (pose[1] - guess[1]))
    r = -(sums[8] + prior[2] * (pose[2] - guess[2]))
    l21, l31 = b / a, c / a
    d2 = d - l21 * b
    l32 = (e - l21 * c) / d2
    d3 = f - l31 * c - l32 * l32 * d2
    q -= l21 * p
    r -= l31 * p + l32 * q
    yaw = r / d3
    y = q / d2 - l32 * yaw
    x = p / a - l21 * y - l31 * yaw
    pose[0] += x
    pose[1] += y
    pose[2] += yaw
    return float(abs(x) + abs(y) + abs(yaw))


def _compose_spread(digest: str) -> Callable[..., int]:
    def spread_likelihood(field: NDArray[np.float32], points: Array, origin: Array) -> int:
        rows, columns = field.shape
        around = ceil(_REACH / RESOLUTION)
        for index in range(len(points)):
            x, y = (points[index, 0] - origin[0]) / RESOLUTION, (points[index, 1] - origin[1]) / RESOLUTION
            column, row = int(np.floor(x)), int(np.floor(y))
            for line in range(max(row - around, 0), min(row + around, rows - 1) + 1):
                for cell in range(max(column - around, 0), min(column + around, columns - 1) + 1):
                    off_x, off_y = (cell + 0.5 - x) * RESOLUTION, (line + 0.5 - y) * RESOLUTION
                    square = off_x * off_x + off_y * off_y
                    near = 1.0 - square / (_REACH * _REACH)
                    if near > 0.0:  # the biweight kernel: nearly normal, with an end
                        field[line, cell] = max(field[line, cell], near * near)
        return 1 if digest else 0

    return spread_likelihood


def _compose_bounds(digest: str) -> Callable[..., int]:
    def bound_blocks(  # noqa: PLR0917  # a kernel's arrays
        levels: NDArray[np.float32], origin: Array, points: Array, yaws: Array, window: Array,
        places: NDArray[np.int64], bounds: Array,
    ) -> int:  # fmt: skip
        cells, level, steps = int(window[2]), int(window[3]), int(window[4])
        size, count = 1 << level, len(points)
        sine, cosine = sine_cosine(yaws[len(yaws) // 2])
        here = _mean_likelihood(levels[0], origin, points, window[0], window[1], sine, cosine)
        enough = max(window[5], here - _TIE) * count  # the guess is one of the poses that are tried
        window[6] = 0.0
        field = levels[level]
        rows, columns = field.shape
        east, north = window[0] - cells * RESOLUTION, window[1] - cells * RESOLUTION
        for turn in range(len(yaws)):
            sine, cosine = sine_cosine(yaws[turn])
            for index in range(count):
                x, y = points[index, 0], points[index, 1]
                places[index, 0] = int(np.floor((north + sine * x + cosine * y - origin[1]) / RESOLUTION))
                places[index, 1] = int(np.floor((east + cosine * x - sine * y - origin[0]) / RESOLUTION))
            for block in range(steps * steps):
                up, right = block // steps * size, block % steps * size
                total, index = 0.0, 0
                while index < count and total + (count - index) > enough:
                    for at in range(index, min(index + _BATCH, count)):
                        row, column = places[at, 0] + up, places[at, 1] + right
                        if 0 <= column < columns and 0 <= row < rows:
                            total += field[row, column]
                    index += _BATCH
                bounds[turn * steps * steps + block] = (total + max(count - index, 0)) / count
                window[6] += min(index, count)
        return 1 if digest else 0

    return bound_blocks


def _compose_search(digest: str) -> Callable[..., int]:
    def search_blocks(  # noqa: PLR0913, PLR0917  # a kernel's arrays
        levels: NDArray[np.float32], origin: Array, points: Array, yaws: Array, window: Array, bounds: Array,
        order: NDArray[np.int64], stack: Array, found: Array,
    ) -> int:  # fmt: skip
        cells, top, steps = int(window[2]), int(window[3]), int(window[4])
        for which in range(len(order)):
            if bounds[order[which]] <= found[3]:
                break
            column = order[which] % steps
            line = order[which] // steps % steps
            yaw = yaws[order[which] // (steps * steps)]
            sine, cosine = sine_cosine(yaw)
            stack[0, 0], stack[0, 1] = column * (1 << top) - cells, line * (1 << top) - cells
            stack[0, 2], stack[0, 3] = top, bounds[order[which]]
            depth = 1
            while depth > 0:
                depth -= 1
                east, north, level, bound = (
                    stack[depth, 0],
                    stack[depth, 1],
                    int(stack[depth, 2]),
                    stack[depth, 3],
                )
                if bound <= found[3]:
                    continue
                if level == 0:
                    found[0], found[1] = window[0] + east * RESOLUTION, window[1] + north * RESOLUTION
                    found[2], found[3] = yaw, bound
                    continue
                half = 0.5 * (1 << level)
                for part in range(4):
                    to_east, to_north = east + half * (part % 2), north + half * (part // 2)
                    stack[depth, 0], stack[depth, 1], stack[depth, 2] = to_east, to_north, level - 1
                    stack[depth, 3] = _mean_likelihood(
                        levels[level - 1], origin, points,
                        window[0] + to_east * RESOLUTION, window[1] + to_north * RESOLUTION, sine, cosine,
                    )  # fmt: skip
                    found[4] += 1.0
                    if stack[depth, 3] > found[3]:
                        depth += 1
        return 1 if digest else 0

    return search_blocks


def _compose_align(digest: str) -> Callable[..., int]:
    def align_lines(  # noqa: PLR0917  # a kernel's arrays
        lines: Array, starts: NDArray[np.int64], lattice: Array, points: Array, distances: Array,
        prior: Array, pose: Array, result: Array,
    ) -> int:  # fmt: skip
        guess = (pose[0], pose[1], pose[2])
        for iteration in range(len(distances)):
            _align_once(lines, starts, lattice, points, distances[iteration], pose, result)
            if _step(result, prior, pose, guess) < 1e-5 and distances[iteration] == distances[-1]:
                break
        _align_once(lines, starts, lattice, points, distances[-1], pose, result)
        a, b, c, d, e, f = result[0], result[1], result[2], result[3], result[4], result[5]
        result[0], result[1], result[2] = a, b, c
        result[3], result[4], result[5] = b, d, e
        result[6], result[7], result[8] = c, e, f
        result[9] /= len(points)
        return 1 if digest else 0

    return align_lines


_SOURCES = (Path(__file__),)
_F, _I, _G = "float64", "int64", "float32"
spread_likelihood = NumericCode(
    "spread_likelihood", _compose_spread, _SOURCES, (f"{_G}[:,::1]", f"{_F}[:,::1]", f"{_F}[::1]")
)
"""Raise a field of likelihood near each point."""
bound_blocks = NumericCode(
    "bound_blocks",
    _compose_bounds,
    _SOURCES,
    (
        f"{_G}[:,:,::1]", f"{_F}[::1]", f"{_F}[:,::1]", f"{_F}[::1]", f"{_F}[::1]", f"{_I}[:,::1]",
        f"{_F}[::1]",
    ),
)  # fmt: skip
"""Bound the likelihood of a scan in every block of a window, for every yaw."""
search_blocks = NumericCode(
    "search_blocks",
    _compose_search,
    _SOURCES,
    (
        f"{_G}[:,:,::1]", f"{_F}[::1]", f"{_F}[:,::1]", f"{_F}[::1]", f"{_F}[::1]", f"{_F}[::1]",
        f"{_I}[::1]", f"{_F}[:,::1]", f"{_F}[::1]",
    ),
)  # fmt: skip
"""Find the pose with the highest likelihood, best blocks first."""
align_lines = NumericCode(
    "align_lines",
    _compose_align,
    _SOURCES,
    (
        f"{_F}[:,::1]", f"{_I}[::1]", f"{_F}[::1]", f"{_F}[:,::1]", f"{_F}[::1]", f"{_F}[::1]",
        f"{_F}[::1]", f"{_F}[::1]",
    ),
)  # fmt: skip
"""Move a pose until the points lie on lines."""
