"""The grid of EGM96: heights of the geoid at points a quarter of a degree apart, and between them."""

from __future__ import annotations

import lzma
from math import floor, isfinite
from struct import Struct

import numpy as np
import numpy.typing as npt

PER_DEGREE = 4
ROWS, COLUMNS = 180 * PER_DEGREE + 1, 360 * PER_DEGREE
"""Rows from the south pole to the north pole, columns eastwards from 180 degrees west."""
DECIMETRE = 0.1


BAND = 60
"""Rows that are compressed together: 15 degrees of latitude, since a run flies in one place."""
_BANDS = -(-ROWS // BAND)
_SIZES = Struct(f"<{_BANDS}I")


def pack(decimetres: npt.NDArray[np.int16]) -> bytes:
    """Return the file of a grid: the sizes of its bands, then the bands from the south pole northwards."""
    bands = [_packed(decimetres[row : row + BAND]) for row in range(0, ROWS, BAND)]
    return _SIZES.pack(*map(len, bands)) + b"".join(bands)


def _packed(band: npt.NDArray[np.int16]) -> bytes:
    """Compress a band: second differences, low bytes before high bytes."""
    steps = np.diff(np.diff(band, axis=1, prepend=np.int16(0)), axis=0, prepend=np.int16(0))
    octets = np.frombuffer(steps.astype("<i2").tobytes(), np.uint8).reshape(-1, 2)
    return lzma.compress(octets.T.tobytes(), preset=9)


def _unpacked(data: bytes) -> npt.NDArray[np.int16]:
    octets = np.frombuffer(lzma.decompress(data), np.uint8).reshape(2, -1)
    steps = np.ascontiguousarray(octets.T).view("<i2").reshape(-1, COLUMNS)
    return np.cumsum(np.cumsum(steps, axis=0, dtype=np.int16), axis=1, dtype=np.int16)


_Posts = tuple[tuple[int, ...], ...]


class Egm96Grid:
    """Heights of the geoid, interpolated between the points of the grid.

    Args:
        data: The file's content; a band is decompressed when a place in it is read.
    """

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._bands: dict[int, npt.NDArray[np.int16]] = {}
        self._cells: dict[tuple[int, int], _Posts] = {}

    def height(self, latitude: float, longitude: float) -> float:
        """Return metres above the ellipsoid by Catmull-Rom cubics; 0 for coordinates off the globe."""
        if not (isfinite(longitude) and abs(latitude) <= 90.0):
            return 0.0
        up, along = (latitude + 90.0) * PER_DEGREE, (longitude + 180.0) * PER_DEGREE
        row, column = min(floor(up), ROWS - 2), floor(along)
        posts = self._cells.get((row, column)) or self._cell(row, column)
        a, b, c, d = _weights(along - column)
        height = 0.0
        for weight, (p, q, r, s) in zip(_weights(up - row), posts, strict=True):
            height += weight * (a * p + b * q + c * r + d * s)
        return height * DECIMETRE

    def _cell(self, row: int, column: int) -> _Posts:
        """Return the four by four points around a cell of the grid."""
        rows = [min(max(row + step, 0), ROWS - 1) for step in (-1, 0, 1, 2)]
        columns = [(column + step) % COLUMNS for step in (-1, 0, 1, 2)]
        found = self._cells[row, column] = tuple(
            tuple(int(self._band(row // BAND)[row % BAND, other]) for other in columns) for row in rows
        )
        return found

    def _band(self, number: int) -> npt.NDArray[np.int16]:
        band = self._bands.get(number)
        if band is None:
            sizes = _SIZES.unpack_from(self._data)
            start = _SIZES.size + sum(sizes[:number])
            band = self._bands[number] = _unpacked(self._data[start : start + sizes[number]])
        return band


def _weights(f: float) -> tuple[float, float, float, float]:
    """Return the weights of four neighbours for a point at *f* (0..1) between the middle two."""
    return (
        -0.5 * f * (1.0 - f) * (1.0 - f),
        1.0 - 2.5 * f * f + 1.5 * f * f * f,
        0.5 * f + 2.0 * f * f - 1.5 * f * f * f,
        0.5 * f * f * (f - 1.0),
    )
