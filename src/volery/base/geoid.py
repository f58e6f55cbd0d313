"""EGM96: how far mean sea level is above the WGS-84 ellipsoid, from a grid of a quarter of a degree.

Source: Lemoine et al., The Development of the Joint NASA GSFC and NIMA Geopotential Model EGM96,
NASA/TP-1998-206861; public domain. ``egm96.xz`` is made by ``scripts/egm96_grid.py`` from the 5' grid:
whole decimetres, bicubic in between. Against that grid it errs by at most 0.19 m, by 0.06 m at 99 % of
all places and by 0.025 m root mean square; EGM96 itself errs by 0.5 to 1 m.

Between metres above mean sea level (the geoid) and metres above the WGS-84 ellipsoid.

Law: ellipsoidal = AMSL + N, where N is how far the geoid is above the ellipsoid at that place. Receivers and
autopilots say AMSL, MAVROS says ellipsoidal; both sides must mean the same N, and by default it is EGM96's.
"""

from __future__ import annotations

import lzma
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from math import floor, isfinite

import numpy as np
import numpy.typing as npt

from volery.base.errors import UsageError

PER_DEGREE = 4
ROWS, COLUMNS = 180 * PER_DEGREE + 1, 360 * PER_DEGREE
"""From the south pole to the north pole, and eastwards from 180 degrees west."""
DECIMETRE = 0.1
GRID_FILE = "egm96.xz"


def pack(decimetres: npt.NDArray[np.int16]) -> bytes:
    """A grid as the file has it: differences of differences, low bytes before high bytes, compressed."""
    steps = np.diff(np.diff(decimetres, axis=1, prepend=np.int16(0)), axis=0, prepend=np.int16(0))
    octets = np.frombuffer(steps.astype("<i2").tobytes(), np.uint8).reshape(-1, 2)
    return lzma.compress(octets.T.tobytes(), preset=9)


def unpack(data: bytes) -> npt.NDArray[np.int16]:
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
    return Egm96Grid(unpack(files("volery.base").joinpath(GRID_FILE).read_bytes()))


LOWEST_SEPARATION, HIGHEST_SEPARATION = -107.0, 86.0
"""The separations there are on Earth, metres (EGM96)."""

EGM96_NAME = "egm96"


class Geoid(ABC):
    """Mean sea level, everywhere."""

    @abstractmethod
    def separation(self, latitude: float, longitude: float) -> float:
        """Metres of the geoid above the ellipsoid there; degrees. 0 where there is no such place."""

    def to_ellipsoidal(self, latitude: float, longitude: float, amsl: float) -> float:
        """Metres AMSL as metres above the ellipsoid."""
        return amsl + self.separation(latitude, longitude)

    def to_amsl(self, latitude: float, longitude: float, ellipsoidal: float) -> float:
        """Metres above the ellipsoid as metres AMSL."""
        return ellipsoidal - self.separation(latitude, longitude)


@dataclass(frozen=True, slots=True)
class LevelGeoid(Geoid):
    """The same N everywhere, ``metres``: where one knows it better, or wants none.

    N varies by up to 0.1 m a kilometre, so within 10 km of where it was taken it is right within 1 m.
    """

    metres: float = 0.0

    def __post_init__(self) -> None:
        if not LOWEST_SEPARATION <= self.metres <= HIGHEST_SEPARATION:
            raise UsageError(
                f"a geoid {self.metres:g} m above the ellipsoid: on Earth it is {LOWEST_SEPARATION:g} to "
                f"{HIGHEST_SEPARATION:g} m"
            )

    def separation(self, latitude: float, longitude: float) -> float:
        """See ``Geoid``."""
        return self.metres


class Egm96(Geoid):
    """EGM96 as ``base.egm96`` keeps it; see there for its error. Read when it is first asked."""

    def separation(self, latitude: float, longitude: float) -> float:
        """See ``Geoid``."""
        return _grid().height(latitude, longitude)

    def __repr__(self) -> str:
        return "Egm96()"


@cache
def _grid() -> Egm96Grid:
    return read_grid()


EGM96: Geoid = Egm96()
SEA_LEVEL: Geoid = LevelGeoid()
"""The ellipsoid itself is sea level."""


def parse_geoid(text: str) -> Geoid:
    """``egm96``, or metres of a ``LevelGeoid``. Raises ``UsageError``."""
    if text == EGM96_NAME:
        return EGM96
    try:
        return LevelGeoid(float(text))
    except ValueError:
        raise UsageError(
            f"geoid={text!r}: it is {EGM96_NAME}, or a number of metres above the ellipsoid"
        ) from None
