"""Grey pictures of the world: a rasteriser in compiled code, with lens, motion blur, exposure and noise.

* A depth buffer says which surface each sight line meets; where on it is solved for the line itself, so that
  the edges of markers are exact under any lens. A pixel of a marker is the mean over its footprint.
* The ground is level at a given height. It, the tops of solids and their sides have a texture.
* Motion blur is along the image motion of each pixel during the exposure (Longuet-Higgins and Prazdny, Proc.
  R. Soc. Lond. B 208, 1980). All rows are exposed at once.
* Noise follows EMVA 1288: of the photons and of reading. Light that the longest exposure does not gather is
  made up by gain, which amplifies the noise as well.
* Not modelled: shadows, reflections, glare, defocus, raindrops, vignetting.

A camera's axes are those of REP 103's optical frames: right, down, ahead.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import sqrt
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon, constrained_delaunay_triangles, get_parts

from volery.base.elementary import sine_cosine
from volery.base.errors import UsageError
from volery.base.frames import Vector
from volery.base.numeric_code import NumericCode, numeric
from volery.simulation.world.arithmetic import clip, gaussian, random_word
from volery.simulation.world.scene import DAY_LUX, Marker, Solid
from volery.simulation.world.state_layout import Array

Picture = NDArray[np.uint8]

_ARITHMETIC = Path(__file__).with_name("arithmetic.py")
_NEAR = 0.02  # [m] what is nearer in front of the camera is not drawn
_TALLEST = 500.0  # [m] solids without an upper end are drawn up to here
_MARGIN = 0.25  # white margin around a marker, share of its side
_ON_SURFACE = 0.03  # [m] a marker is drawn on the surface that is as far below or above it, at most
_SKY, _WALL, _TOP, _GROUND = 0.75, 0.5, 0.35, 0.3  # reflectance; the sky's is what it shines like
_BLACK, _WHITE = 0.04, 0.85
_SUN = (0.36, -0.48, 0.8)  # unit vector to the sun: east, north, up
_AMBIENT = 0.45
_TILE = 256  # texels along a side of the texture
_FINE, _COARSE, _PLASTER = 0.02, 0.7, 0.03  # [m] side of a texel; the last: of sides
_MOST_SAMPLES = 24  # along the motion of a pixel
_FULL_LUX_S = 10_000.0 * 0.0005  # exposure of a white surface that nearly saturates a pixel at gain 1
_WELL = 10_000.0  # [electrons] that saturate a pixel at gain 1
_READ = 5.0  # [electrons] standard deviation of reading a pixel

# Columns of a triangle, of a marker, and of the settings of a picture.
_REFLECTANCE, _LEVEL, _ALONG, _TRIANGLE = 9, 10, 11, 13
_COS, _SIN, _SIDE, _CELLS, _FIRST_CELL, _MARKER = 3, 4, 5, 6, 7, 8
_VELOCITY, _RATES = 0, 3
_FOCAL, _CENTRE_X, _CENTRE_Y, _HEIGHT, _TIME, _GAIN, _SIGNAL, _SETTINGS = range(8)


@dataclass(frozen=True)
class Lens:
    """A pinhole with radial and tangential distortion (Brown, Photogrammetric Engineering 32, 1966).

    Args:
        width: Columns of the picture.
        height: Rows of the picture.
        focal: Focal length [pixels].
        distortion: k1, k2, p1, p2, k3 of OpenCV and of ROS's ``plumb_bob``.

    Raises:
        UsageError: The distortion folds the picture over itself.
    """

    width: int = 320
    height: int = 240
    focal: float = 240.0
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if self.width < 8 or self.height < 8 or self.focal <= 0.0:
            raise UsageError(f"{self}: give at least 8 x 8 pixels and a focal length above 0")
        self.sight_lines()

    @property
    def centre(self) -> tuple[float, float]:
        """Column and row of the optical axis [pixels]."""
        return 0.5 * (self.width - 1), 0.5 * (self.height - 1)

    def sight_lines(self) -> Array:
        """Return where each pixel's sight line meets the plane one ahead: right, down (height, width, 2)."""
        k1, k2, p1, p2, k3 = self.distortion
        (column, row), f = self.centre, self.focal
        seen = np.meshgrid((np.arange(self.width) - column) / f, (np.arange(self.height) - row) / f)
        x, y = seen
        before = np.full_like(x, np.inf)
        if any(self.distortion):
            for _ in range(40):
                square = x * x + y * y
                radial = 1.0 + square * (k1 + square * (k2 + square * k3))
                if radial.min() < 0.2:
                    break
                off_x = 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x)
                off_y = p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y
                before = x
                x, y = (seen[0] - off_x) / radial, (seen[1] - off_y) / radial
            if not np.isfinite(x).all() or np.abs(x - before).max() * f > 0.01:
                raise UsageError(f"a distortion of {self.distortion} folds the picture; give smaller factors")
        return np.ascontiguousarray(np.stack((x, y), axis=2))


@dataclass(frozen=True)
class Exposure:
    """How a camera adapts to the light.

    Args:
        longest: Longest exposure [s]. A brighter scene is exposed for a shorter time.
        most_gain: Greatest gain, once the exposure is the longest one.
    """

    longest: float = 0.008
    most_gain: float = 16.0

    def __post_init__(self) -> None:
        if self.longest <= 0.0 or self.most_gain < 1.0:
            raise UsageError(f"{self}: give an exposure above 0 and a gain of at least 1")

    def at(self, lux: float) -> tuple[float, float]:
        """Return exposure [s] and gain at an illuminance [lux]."""
        needed = _FULL_LUX_S / max(lux, 1e-3)
        time = min(needed, self.longest)
        return time, min(needed / time, self.most_gain)


class CameraView(NamedTuple):
    """Where a camera is and how it moves.

    Args:
        at: Its place east, north, up [m].
        axes: Rows east, north, up of its axes right, down, ahead (3, 3).
        velocity: Velocity right, down, ahead [m/s].
        rates: Rates about right, down, ahead [rad/s].
    """

    at: Vector
    axes: Array
    velocity: Vector = (0.0, 0.0, 0.0)
    rates: Vector = (0.0, 0.0, 0.0)


class Rasteriser:
    """Draws what one camera sees.

    Args:
        lens: Its lens.
        solids: What stands in the world.
        markers: What lies on the ground and on roofs.
        exposure: How it adapts to the light.
        noise: Key of its noise; ``None``: without noise.
    """

    def __init__(
        self,
        lens: Lens,
        solids: Sequence[Solid] = (),
        markers: Sequence[Marker] = (),
        exposure: Exposure | None = None,
        noise: np.uint64 | None = None,
    ) -> None:
        self.lens, self.exposure = lens, exposure or Exposure()
        lines = lens.sight_lines()
        reach = [int(np.abs(lines[:, :, axis]).max() * lens.focal) + 2 for axis in range(2)]
        self._settings = np.zeros(_SETTINGS)
        self._settings[:3] = lens.focal, *reach
        self._pose, self._motion = np.zeros(12), np.zeros(6)
        self._step = np.zeros(1, dtype=np.int64)
        triangles = _triangles(solids)
        buffer = (2 * reach[1] + 1, 2 * reach[0] + 1)
        cells = np.concatenate(
            [marker.cells.reshape(-1) for marker in markers] or [np.zeros(0, dtype=np.uint8)]
        )
        self._picture = np.zeros((lens.height, lens.width), dtype=np.uint8)
        self._draw = draw_picture.bind(
            triangles, _rows(markers), np.ascontiguousarray(cells, dtype=np.uint8), _texture(), lines,
            self._pose, self._motion, self._settings,
            np.array([0 if noise is None else noise], dtype=np.uint64), self._step,
            np.zeros((len(triangles), 3)), np.zeros((8, 3)), np.zeros(len(markers), dtype=np.int64),
            np.zeros(buffer), np.zeros(buffer, dtype=np.int64), np.zeros((lens.height, lens.width)),
            np.zeros((lens.height, lens.width, 2)), self._picture,
        )  # fmt: skip
        self._noisy = noise is not None

    def draw(self, view: CameraView, ground: float, lux: float = DAY_LUX, k: int = 0) -> Picture:
        """Return a new picture (height, width).

        Args:
            view: The camera.
            ground: Height of the ground, up [m].
            lux: Illuminance.
            k: Counter of the noise, such as the grid step.
        """
        time, gain = self.exposure.at(lux)
        self._pose[:3], self._pose[3:] = view.at, np.asarray(view.axes).reshape(-1)
        self._motion[:] = *view.velocity, *view.rates
        self._settings[_HEIGHT:] = ground, time, gain, lux * time * gain / _FULL_LUX_S
        if not self._noisy:
            self._settings[_GAIN] = 0.0
        self._step[0] = k
        self._draw()
        return self._picture.copy()


def _triangles(solids: Sequence[Solid]) -> Array:
    """Return the triangles of solids (triangles, 13).

    Corners anticlockwise, reflectance, level or not, unit vector (east, north) along which the texture lies.
    """
    rows: list[tuple[float, ...]] = []
    for solid in solids:
        low, top = solid.floor, min(solid.ceiling, max(solid.floor, 0.0) + _TALLEST)
        corners = list(solid.corners)
        ring = (*corners, corners[0])
        if sum(x * to_y - to_x * y for (x, y), (to_x, to_y) in pairwise(ring)) < 0.0:
            corners.reverse()
        for (x, y), (to_x, to_y) in pairwise((*corners, corners[0])):
            length = sqrt((to_x - x) * (to_x - x) + (to_y - y) * (to_y - y))
            if length == 0.0:
                continue
            lit = max(0.0, ((to_y - y) * _SUN[0] - (to_x - x) * _SUN[1]) / length)
            shade = _WALL * (_AMBIENT + (1.0 - _AMBIENT) * lit)
            a, b = (x, y, low), (to_x, to_y, low)
            c, d = (to_x, to_y, top), (x, y, top)
            along = (to_x - x) / length, (to_y - y) / length
            rows += [(*a, *b, *c, shade, 0.0, *along), (*a, *c, *d, shade, 0.0, *along)]
        for part in get_parts(constrained_delaunay_triangles(Polygon(corners).buffer(0.0))):
            one, two, three = part.exterior.coords[:3]
            across = (two[0] - one[0]) * (three[1] - one[1]) - (two[1] - one[1]) * (three[0] - one[0])
            if across < 0.0:
                two, three = three, two
            rows.append((*one[:2], top, *two[:2], top, *three[:2], top, _TOP, 1.0, 0.0, 0.0))
            if low > 0.0:
                rows.append((*one[:2], low, *three[:2], low, *two[:2], low, _WALL * _AMBIENT, 0.0, 1.0, 0.0))
    return np.array(rows, dtype=np.float64).reshape(-1, _TRIANGLE)


def _rows(markers: Sequence[Marker]) -> Array:
    rows, first = np.zeros((len(markers), _MARKER)), 0
    for row, marker in zip(rows, markers, strict=True):
        if marker.cells.ndim != 2 or marker.cells.shape[0] != marker.cells.shape[1] or marker.size <= 0.0:
            raise UsageError(f"marker {marker.name}: give square cells and a side above 0 m")
        sine, cosine = sine_cosine(marker.yaw)
        row[:] = *marker.at, cosine, sine, marker.size, len(marker.cells), first
        first += marker.cells.size
    return rows


def _texture() -> NDArray[np.float64]:
    """Return a texture that repeats (256, 256), of mean 1: noise of five octaves."""
    total = np.zeros((_TILE, _TILE))
    for octave in range(3, 8):
        count = 1 << octave
        with np.errstate(over="ignore"):  # hashes wrap around
            words = [int(random_word(np.uint64(octave), 1, at)) >> 40 for at in range(count * count)]
        values = np.array(words, dtype=np.float64).reshape(count, count) / (1 << 24) - 0.5
        for axis in range(2):
            place = np.arange(_TILE) * count / _TILE
            before = place.astype(np.int64)
            share = (place - before).reshape((-1, 1) if axis == 0 else (1, -1))
            low, high = values.take(before, axis), values.take((before + 1) % count, axis)
            values = low + (high - low) * share
        total += values
    return 1.0 + 0.15 * total


@numeric
def _clip_near(corners: Array, settings: Array) -> int:
    """Project a triangle; return the number of corners, 0 to 4, of what is in front of the camera.

    ``corners`` (8, 3): in rows 0 to 2 the triangle right, down, ahead [m]; from row 4 on columns and rows of
    the buffer in return.
    """
    count = 0
    for index in range(3):
        other = index + 1 if index < 2 else 0
        z, to_z = corners[index, 2], corners[other, 2]
        if z >= _NEAR:
            corners[4 + count, 0] = settings[_CENTRE_X] + settings[_FOCAL] * corners[index, 0] / z
            corners[4 + count, 1] = settings[_CENTRE_Y] + settings[_FOCAL] * corners[index, 1] / z
            count += 1
        if (z >= _NEAR) != (to_z >= _NEAR):
            share = (_NEAR - z) / (to_z - z)
            x = corners[index, 0] + share * (corners[other, 0] - corners[index, 0])
            y = corners[index, 1] + share * (corners[other, 1] - corners[index, 1])
            corners[4 + count, 0] = settings[_CENTRE_X] + settings[_FOCAL] * x / _NEAR
            corners[4 + count, 1] = settings[_CENTRE_Y] + settings[_FOCAL] * y / _NEAR
            count += 1
    return count


@numeric
def _fill(  # noqa: PLR0917  # see draw_picture
    corners: Array, count: int, plane: Array, index: int, settings: Array,
    depth: Array, surface: NDArray[np.int64],
) -> None:  # fmt: skip
    """Enter a convex polygon into the depth buffer, which holds the inverse of the distance ahead [1/m]."""
    low, high = corners[4, 1], corners[4, 1]
    for at in range(5, 4 + count):
        low, high = min(low, corners[at, 1]), max(high, corners[at, 1])
    if high < 0.0 or low > depth.shape[0] - 1:
        return
    step = plane[index, 0] / settings[_FOCAL]
    for row in range(int(max(low, 0.0) + 0.999999), int(min(high, depth.shape[0] - 1.0)) + 1):
        left, right = 1e9, -1e9
        for at in range(4, 4 + count):
            to = at + 1 if at < 3 + count else 4
            y, to_y = corners[at, 1], corners[to, 1]
            if (y <= row) != (to_y <= row):
                x = corners[at, 0] + (row - y) * (corners[to, 0] - corners[at, 0]) / (to_y - y)
                left, right = min(left, x), max(right, x)
        if right < 0.0 or left > depth.shape[1] - 1:
            continue
        first, last = int(max(left, 0.0) + 0.999999), int(min(right, depth.shape[1] - 1.0))
        x, y = (
            (first - settings[_CENTRE_X]) / settings[_FOCAL],
            (row - settings[_CENTRE_Y]) / settings[_FOCAL],
        )
        inverse = plane[index, 0] * x + plane[index, 1] * y + plane[index, 2]
        for column in range(first, last + 1):
            if inverse > depth[row, column]:
                depth[row, column] = inverse
                surface[row, column] = index
            inverse += step


@numeric
def _rasterise(  # noqa: PLR0917  # see draw_picture
    triangles: Array, pose: Array, settings: Array, planes: Array, corners: Array,
    depth: Array, surface: NDArray[np.int64],
) -> None:  # fmt: skip
    """Find the nearest triangle on each sight line of the buffer."""
    for row in range(depth.shape[0]):
        for column in range(depth.shape[1]):
            depth[row, column] = 0.0
            surface[row, column] = -1
    for index in range(triangles.shape[0]):
        ahead = False
        for corner in range(3):
            x = triangles[index, 3 * corner] - pose[0]
            y = triangles[index, 3 * corner + 1] - pose[1]
            z = triangles[index, 3 * corner + 2] - pose[2]
            for axis in range(3):
                corners[corner, axis] = pose[3 + axis] * x + pose[6 + axis] * y + pose[9 + axis] * z
            ahead = ahead or corners[corner, 2] >= _NEAR
        if not ahead:
            continue
        ax, ay, az = (
            corners[1, 0] - corners[0, 0], corners[1, 1] - corners[0, 1], corners[1, 2] - corners[0, 2],
        )  # fmt: skip
        bx, by, bz = (
            corners[2, 0] - corners[0, 0], corners[2, 1] - corners[0, 1], corners[2, 2] - corners[0, 2],
        )  # fmt: skip
        nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        facing = nx * corners[0, 0] + ny * corners[0, 1] + nz * corners[0, 2]
        if facing >= -1e-12:  # seen from behind, or from its edge
            continue
        planes[index, 0], planes[index, 1], planes[index, 2] = nx / facing, ny / facing, nz / facing
        count = _clip_near(corners, settings)
        if count >= 3:
            _fill(corners, count, planes, index, settings, depth, surface)


@numeric
def _textured(texture: Array, east: float, north: float, side: float) -> float:
    """Return the texture at a place, its texels *side* wide [m]; linear between them."""
    x, y = east / side, north / side
    column, row = int(x) if x >= 0.0 else int(x) - 1, int(y) if y >= 0.0 else int(y) - 1
    x, y = x - column, y - row
    left, right = column & (_TILE - 1), (column + 1) & (_TILE - 1)
    low, high = row & (_TILE - 1), (row + 1) & (_TILE - 1)
    below = texture[low, left] + x * (texture[low, right] - texture[low, left])
    above = texture[high, left] + x * (texture[high, right] - texture[high, left])
    mixed: float = below + y * (above - below)
    return mixed


@numeric
def _plaster(texture: Array, along: Array, east: float, north: float, up: float, scale: float) -> float:
    """Return the factor of the texture at a place [m] of a side, seen at a scale [pixels/m]."""
    value = _textured(texture, along[0] * east + along[1] * north, up, _PLASTER) - 1.0
    factor: float = 1.0 + value * min(1.0, _PLASTER * scale)
    return factor


@numeric
def _marked(  # noqa: PLR0917  # numbers
    markers: Array, cells: NDArray[np.uint8], at: int, across: float, up: float, wide: float, tall: float
) -> tuple[float, float]:
    """Return share and reflectance of a marker in the footprint of a pixel.

    Args:
        markers: The markers.
        cells: Cells of all markers.
        at: Index of the marker.
        across: Place of the pixel from the marker's centre to its right [m].
        up: The same towards its upper edge [m].
        wide: Width of the footprint [m].
        tall: The same upwards [m].
    """
    count, first = int(markers[at, _CELLS]), int(markers[at, _FIRST_CELL])
    cell = markers[at, _SIDE] / count
    edge = _MARGIN * count  # of the white margin, in cells
    half = 0.5 * count
    left, right = (across - 0.5 * wide) / cell + half, (across + 0.5 * wide) / cell + half
    above, below = half - (up + 0.5 * tall) / cell, half - (up - 0.5 * tall) / cell
    whole = (right - left) * (below - above)
    left, right = max(left, -edge), min(right, count + edge)
    above, below = max(above, -edge), min(below, count + edge)
    if right <= left or below <= above:
        return 0.0, 0.0
    covered = (right - left) * (below - above)
    black = 0.0
    for row in range(int(max(above, 0.0)), min(int(max(below, 0.0)), count - 1) + 1):
        high = min(below, row + 1.0) - max(above, np.float64(row))
        for column in range(int(max(left, 0.0)), min(int(max(right, 0.0)), count - 1) + 1):
            if cells[first + row * count + column] == 0:
                width = min(right, column + 1.0) - max(left, np.float64(column))
                black += max(high, 0.0) * max(width, 0.0)
    return covered / whole, (_WHITE * (covered - black) + _BLACK * black) / covered


def _compose(digest: str) -> Callable[..., int]:
    def draw_picture(  # noqa: PLR0913, PLR0917  # arrays of the scene, of the camera, and to work in
        triangles: Array, markers: Array, cells: NDArray[np.uint8], texture: Array, lines: Array,
        pose: Array, motion: Array, settings: Array, keys: NDArray[np.uint64], step: NDArray[np.int64],
        planes: Array, corners: Array, near: NDArray[np.int64],
        depth: Array, surface: NDArray[np.int64], light: Array, flow: Array, picture: Picture,
    ) -> int:  # fmt: skip
        _rasterise(triangles, pose, settings, planes, corners, depth, surface)
        _shade(
            triangles, markers, cells, texture, lines, pose, motion, settings, planes, near, depth, surface,
            light, flow,
        )  # fmt: skip
        _expose(light, flow, settings, keys[0], step[0], picture)
        return 1 if digest else 0

    return draw_picture


@numeric
def _near_markers(markers: Array, pose: Array, settings: Array, near: NDArray[np.int64]) -> int:
    """List the markers that may be larger than a pixel, and return their number."""
    count = 0
    for at in range(markers.shape[0]):
        x, y, z = markers[at, 0] - pose[0], markers[at, 1] - pose[1], markers[at, 2] - pose[2]
        reach = 2.0 * markers[at, _SIDE] * settings[_FOCAL]
        if x * x + y * y + z * z < reach * reach:
            near[count] = at
            count += 1
    return count


@numeric
def _shade(  # noqa: PLR0913, PLR0917  # see draw_picture
    triangles: Array, markers: Array, cells: NDArray[np.uint8], texture: Array, lines: Array,
    pose: Array, motion: Array, settings: Array, planes: Array, near: NDArray[np.int64],
    depth: Array, surface: NDArray[np.int64], light: Array, flow: Array,
) -> None:  # fmt: skip
    """Work out the light on each pixel, and how far its picture moves during the exposure [pixels]."""
    focal, time = settings[_FOCAL], settings[_TIME]
    above = pose[2] - settings[_HEIGHT]
    listed = _near_markers(markers, pose, settings, near)
    lit = _AMBIENT + (1.0 - _AMBIENT) * _SUN[2]
    for row in range(light.shape[0]):
        for column in range(light.shape[1]):
            x, y = lines[row, column, 0], lines[row, column, 1]
            to_east = pose[3] * x + pose[4] * y + pose[5]
            to_north = pose[6] * x + pose[7] * y + pose[8]
            to_up = pose[9] * x + pose[10] * y + pose[11]
            index = surface[
                int(settings[_CENTRE_Y] + focal * y + 0.5), int(settings[_CENTRE_X] + focal * x + 0.5)
            ]
            a, b, c = 0.0, 0.0, 0.0
            if index >= 0:
                a, b, c = planes[index, 0], planes[index, 1], planes[index, 2]
            inverse = a * x + b * y + c
            level, value = False, _SKY
            if above > 0.0 and -to_up / above > inverse:
                a, b, c = -pose[9] / above, -pose[10] / above, -pose[11] / above
                inverse = -to_up / above
                level, value = True, _GROUND * lit
            elif inverse > 0.0:
                level, value = triangles[index, _LEVEL] != 0.0, triangles[index, _REFLECTANCE]
                value *= (
                    lit
                    if level
                    else _plaster(
                        texture,
                        triangles[index, _ALONG:],
                        pose[0] + to_east / inverse,
                        pose[1] + to_north / inverse,
                        pose[2] + to_up / inverse,
                        focal * inverse,
                    )
                )
            if level:
                distance = 1.0 / inverse
                east, north = pose[0] + to_east * distance, pose[1] + to_north * distance
                pixel = distance / focal
                coarse = _textured(texture, east, north, _COARSE) - 1.0
                fine = _textured(texture, east, north, _FINE) - 1.0
                value *= 1.0 + coarse * min(1.0, _COARSE / pixel) + fine * min(1.0, _FINE / pixel)
                for place in range(listed):
                    at = near[place]
                    off_east, off_north = east - markers[at, 0], north - markers[at, 1]
                    most = markers[at, _SIDE] * (1.0 + 2.0 * _MARGIN) + 8.0 * pixel
                    up = pose[2] + to_up * distance
                    if (
                        abs(off_east) > most
                        or abs(off_north) > most
                        or abs(up - markers[at, 2]) > _ON_SURFACE
                    ):
                        continue
                    # a step of one pixel across and down, on the surface
                    by_x = a * distance * pixel
                    by_y = b * distance * pixel
                    x_east, x_north = pose[3] * pixel - to_east * by_x, pose[6] * pixel - to_north * by_x
                    y_east, y_north = pose[4] * pixel - to_east * by_y, pose[7] * pixel - to_north * by_y
                    cosine, sine = markers[at, _COS], markers[at, _SIN]
                    right_x, right_y = cosine * x_east - sine * x_north, cosine * y_east - sine * y_north
                    up_x, up_y = sine * x_east + cosine * x_north, sine * y_east + cosine * y_north
                    share, grey = _marked(
                        markers, cells, at,
                        cosine * off_east - sine * off_north, sine * off_east + cosine * off_north,
                        sqrt(right_x * right_x + right_y * right_y), sqrt(up_x * up_x + up_y * up_y),
                    )  # fmt: skip
                    value += share * (grey * lit - value)
            light[row, column] = value
            inverse = max(inverse, 0.0)
            flow[row, column, 0] = (
                focal * time
                * ((x * motion[2] - motion[0]) * inverse
                   + x * y * motion[3] - (1.0 + x * x) * motion[4] + y * motion[5])
            )  # fmt: skip
            flow[row, column, 1] = (
                focal * time
                * ((y * motion[2] - motion[1]) * inverse
                   + (1.0 + y * y) * motion[3] - x * y * motion[4] - x * motion[5])
            )  # fmt: skip


@numeric
def _between(light: Array, x: float, y: float) -> float:
    """Return the light between pixels; beyond the edge it is the edge's."""
    x, y = clip(x, 0.0, light.shape[1] - 1.001), clip(y, 0.0, light.shape[0] - 1.001)
    column, row = int(x), int(y)
    x, y = x - column, y - row
    upper = light[row, column] + x * (light[row, column + 1] - light[row, column])
    lower = light[row + 1, column] + x * (light[row + 1, column + 1] - light[row + 1, column])
    mixed: float = upper + y * (lower - upper)
    return mixed


@numeric
def _expose(light: Array, flow: Array, settings: Array, key: np.uint64, k: int, picture: Picture) -> None:
    """Gather the light of each pixel along its motion, and read it with noise."""
    signal, gain = settings[_SIGNAL], settings[_GAIN]
    for row in range(light.shape[0]):
        for column in range(light.shape[1]):
            by_x, by_y = flow[row, column, 0], flow[row, column, 1]
            length = max(abs(by_x), abs(by_y))
            value = light[row, column]
            if length > 0.2:
                samples = min(int(length) + 2, _MOST_SAMPLES)
                value = 0.0
                for sample in range(samples):
                    share = (sample + 0.5) / samples - 0.5
                    value += _between(light, column + share * by_x, row + share * by_y)
                value /= samples
            value *= signal
            if gain > 0.0:
                share = gain / _WELL  # of an electron in a full pixel
                variance = max(value, 0.0) * share + _READ * _READ * share * share
                value += sqrt(variance) * gaussian(key, row * light.shape[1] + column, k)
            picture[row, column] = int(clip(255.0 * value + 0.5, 0.0, 255.0))


draw_picture = NumericCode(
    "draw_picture",
    _compose,
    [Path(__file__), _ARITHMETIC],
    (
        "float64[:,::1]", "float64[:,::1]", "uint8[::1]", "float64[:,::1]", "float64[:,:,::1]",
        "float64[::1]", "float64[::1]", "float64[::1]", "uint64[::1]", "int64[::1]",
        "float64[:,::1]", "float64[:,::1]", "int64[::1]",
        "float64[:,::1]", "int64[:,::1]", "float64[:,::1]", "float64[:,:,::1]", "uint8[:,::1]",
    ),
)  # fmt: skip
"""Draw a picture: see ``Rasteriser``."""
