"""Maps as files: a picture of cells with the YAML file of ROS's map_server and nav2."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from pathlib import Path as FilePath
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.base.errors import ModelError, UsageError
from volery.model.fields import NUMBER, TEXT, ListOf, OneOf, Record, read_child
from volery.model.reading import ModelReading, Vocabulary
from volery.model.text import Problems, TextNode, parse

MOST_CELLS = 25_000_000
UNKNOWN_SHADE = 205
"""What map_saver writes where nothing is known; by the threshold that nav2's states it would be free."""
_WHITE = 255.0
_MOST_PERCENT = 100.0


@dataclass(frozen=True, slots=True)
class MapText:
    """The YAML file of a map. Keys of other programs are ignored."""

    image: Annotated[str, TEXT, ""]
    resolution: Annotated[float, NUMBER, ""]
    origin: Annotated[tuple[float, ...], ListOf(NUMBER), ""]
    negate: Annotated[int, OneOf((0, 1)), ""] = 0
    occupied_thresh: Annotated[float, NUMBER, ""] = 0.65
    free_thresh: Annotated[float, NUMBER, ""] = 0.25
    mode: Annotated[str, OneOf(("trinary", "scale", "raw")), ""] = "trinary"


MAP = Record(MapText)
"""Syntax of the YAML file."""


class MapPicture(NamedTuple):
    """A map.

    Args:
        resolution: Side of a cell [m].
        origin: Pose of the south-western corner: x, y [m] and yaw [rad].
        occupied: Cells that are occupied (rows, columns), the first row in the south.
        free: Cells that are free; the others are unknown.
    """

    resolution: float
    origin: tuple[float, float, float]
    occupied: NDArray[np.bool_]
    free: NDArray[np.bool_]


def read_map(file: FilePath) -> MapPicture:
    """Return the map of a YAML file.

    Raises:
        UsageError: There is no such file, or what it or its picture says is not a map.
    """
    try:
        node = parse_map(file)
        problems = Problems(lambda path: None)
        vocabulary = Vocabulary({}, frozenset())
        right, stated = read_child(MAP, node, (), ModelReading(node, problems, vocabulary, file.parent, node))
        problems.raise_if_any()
        assert right, "what is wrong has been raised"
        return picture_of(stated, file.parent / stated.image)
    except ModelError as error:
        raise UsageError(str(error)) from None
    except ValueError as error:
        raise UsageError(f"{file}: {error}") from None


def parse_map(file: FilePath) -> TextNode:
    """Return the tree of a map's YAML file, without the keys of other programs.

    Raises:
        ValueError: It cannot be read.
        ModelError: It is not YAML.
    """
    try:
        tree = parse(file.read_text(encoding="utf-8"), str(file))
    except OSError as error:
        raise ValueError(f"it cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ValueError("this is not YAML; give the YAML file of the picture") from None
    known = {key: below for key, below in tree.items.items() if key in MapText.__annotations__}
    return TextNode(known, tree.where)


def picture_of(stated: MapText, picture: FilePath) -> MapPicture:
    """Return the map of a file and its picture. Raise ``ValueError`` if they cannot be used."""
    if not (isfinite(stated.resolution) and 0.001 <= stated.resolution <= 10.0):
        raise ValueError(f"a resolution of {stated.resolution} m a cell; give one from 0.001 to 10")
    if len(stated.origin) != 3 or not all(map(isfinite, stated.origin)):
        raise ValueError("its origin is three numbers: x, y and yaw of the lower left corner")
    shades = _read_shades(picture)[::-1]  # the first row of a picture is the northern one
    west, south, yaw = stated.origin
    if stated.mode == "raw":
        share, known = shades / _MOST_PERCENT, shades <= _MOST_PERCENT
    else:
        share = (shades if stated.negate else _WHITE - shades) / _WHITE
        known = (shades != UNKNOWN_SHADE) | (stated.mode == "scale")
    return MapPicture(
        stated.resolution,
        (west, south, yaw),
        known & (share > stated.occupied_thresh),
        known & (share < stated.free_thresh),
    )


def _read_shades(picture: FilePath) -> NDArray[np.float64]:
    """Return the shades of a picture (rows, columns), 0 black to 255 white; what is transparent is white."""
    from PIL import Image  # noqa: PLC0415  # only who reads a map needs it

    try:
        with Image.open(picture) as image:
            if image.width * image.height > MOST_CELLS:
                size = f"{image.width} x {image.height} cells"
                raise ValueError(f"{picture.name} has {size}, {MOST_CELLS} at most; give a coarser one")
            if image.mode.startswith("I"):
                return np.asarray(image, dtype=np.float64) / 257.0
            if "A" in image.mode or "transparency" in image.info:
                white = Image.new("RGBA", image.size, "white")
                return np.asarray(Image.alpha_composite(white, image.convert("RGBA")).convert("L"), float)
            return np.asarray(image.convert("L"), dtype=np.float64)
    except Image.DecompressionBombError:
        raise ValueError(f"{picture.name} has more than {MOST_CELLS} cells; give a coarser one") from None
    except OSError as error:
        what = "there is no such picture" if not picture.exists() else "this is no picture (PGM, PNG)"
        raise ValueError(f"{picture.name}: {what}") from error
