"""EGM96: how far mean sea level is above the WGS-84 ellipsoid, from a grid of a quarter of a degree.

Source: Lemoine et al., The Development of the Joint NASA GSFC and NIMA Geopotential Model EGM96,
NASA/TP-1998-206861; public domain. ``egm96.xz`` is made by ``scripts/egm96_grid.py`` from the 5' grid:
whole decimetres, bicubic in between. Against that grid it errs by at most 0.19 m, by 0.06 m at 99 % of
all places and by 0.025 m root mean square; EGM96 itself errs by 0.5 to 1 m.
"""

from __future__ import annotations

import lzma
from importlib.resources import files
from math import floor, isfinite

import numpy as np
import numpy.typing as npt

PER_DEGREE = 4
ROWS, COLUMNS = 180 * PER_DEGREE + 1, 360 * PER_DEGREE
"""From the south pole to the north pole, and eastwards from 180 degrees west."""
DECIMETRE = 0.1
FILE = "egm96.xz"


def packed(decimetres: npt.NDArray[np.int16]) -> bytes:
    """A grid as the file has it: differences of differences, low bytes before high bytes, compressed."""
    steps = np.diff(np.diff(decimetres, axis=1, prepend=np.int16(0)), axis=0, prepend=np.int16(0))
    octets = np.frombuffer(steps.astype("<i2").tobytes(), np.uint8).reshape(-1, 2)
    return lzma.compress(octets.T.tobytes(), preset=9)


def unpacked(data: bytes) -> npt.NDArray[np.int16]:
    """The other way round."""
    octets = np.frombuffer(lzma.decompress(data), np.uint8).reshape(2, -1)
    steps = np.ascontiguousarray(octets.T).view("<i2").reshape(ROWS, COLUMNS)
    return np.cumsum(np.cumsum(steps, axis=0, dtype=np.int16), axis=1, dtype=np.int16)


class Egm96Grid:
    """Heights of the geoid, at places between the grid's too."""

    def __init__(self, decimetres: npt.NDArray[np.int16]) -> None:
        self._decimetres = decimetres

    def height(self, latitude: float, longitude: float) -> float:
        """Metres above the ellipsoid, by Catmull and Rom's cubics; 0 for a place that is none."""
        if not (isfinite(longitude) and abs(latitude) <= 90.0):
            return 0.0
        up, along = (latitude + 90.0) * PER_DEGREE, (longitude + 180.0) * PER_DEGREE
        row, column = min(floor(up), ROWS - 2), floor(along)
        across = _weights(along - column)
        columns = [(column + step) % COLUMNS for step in (-1, 0, 1, 2)]
        height = 0.0
        for step, weight in zip((-1, 0, 1, 2), _weights(up - row), strict=True):
            line = self._decimetres[min(max(row + step, 0), ROWS - 1)]
            height += weight * sum(w * int(line[at]) for w, at in zip(across, columns, strict=True))
        return height * DECIMETRE


def _weights(f: float) -> tuple[float, float, float, float]:
    """Of four neighbours, for a place at *f* (0..1) between the middle two."""
    return (
        -0.5 * f * (1.0 - f) ** 2,
        1.0 - 2.5 * f * f + 1.5 * f**3,
        0.5 * f + 2.0 * f * f - 1.5 * f**3,
        0.5 * f * f * (f - 1.0),
    )


def read_grid() -> Egm96Grid:
    """The grid of the package."""
    return Egm96Grid(unpacked(files("volery.base").joinpath(FILE).read_bytes()))
