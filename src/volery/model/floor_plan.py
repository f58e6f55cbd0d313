"""Floor plans: a picture of occupied cells with the YAML of ROS's map_server, as walls.

Occupied cells are covered by rectangles, of which the largest at each place is taken. They may overlap.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from math import isfinite
from pathlib import Path as FilePath
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from volery.base import units
from volery.base.elementary import sine_cosine
from volery.base.errors import ModelError
from volery.model.components import check_inside
from volery.model.fields import (
    NUMBER,
    TEXT,
    ListOf,
    OneOf,
    Quantity,
    Record,
    Schema,
    Shorter,
    Syntax,
    WrongValueError,
    read_child,
)
from volery.model.reading import Reading
from volery.model.text import Node, Path, parse

MOST_CELLS = 25_000_000
MOST_WALLS = 20_000
_WHITE = 255.0

Corners = tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True)
class FloorPlanText:
    """Walls in a picture, by the YAML file of ROS's map_server. Written as its name, or as a mapping."""

    file: Annotated[str, TEXT, "The YAML file: `image`, `resolution`, `origin`, `negate`, `occupied_thresh`."]
    height_m: Annotated[float, Quantity(units.LENGTH, above=0), "Height of the walls."] = 3.0


@dataclass(frozen=True, slots=True)
class FloorPlan:
    """Walls of one height that stand on the ground: rectangles, as corners (east, north) about the origin."""

    name: str
    height_m: float
    walls: tuple[Corners, ...]


@dataclass(frozen=True, slots=True)
class _MapFile:
    """The YAML file of a map. Keys of other programs are ignored."""

    image: Annotated[str, TEXT, ""]
    resolution: Annotated[float, NUMBER, ""]
    origin: Annotated[tuple[float, ...], ListOf(NUMBER), ""]
    negate: Annotated[int, OneOf((0, 1)), ""] = 0
    occupied_thresh: Annotated[float, NUMBER, ""] = 0.65
    mode: Annotated[str, OneOf(("trinary", "scale")), ""] = "trinary"


class _FloorPlan(Syntax):
    """The name of a map's YAML file, or a mapping."""

    written_as = Shorter(Record(FloorPlanText), key="file")

    def read(self, node: Node, path: Path, reading: Reading) -> FloorPlan:
        """See ``Syntax``."""
        stated: FloorPlanText = self.written_as.read(node, path, reading)
        check_inside(reading, path, stated.file)
        file = reading.folder / stated.file
        try:
            tree = parse(file.read_text(encoding="utf-8"), str(file))
        except OSError as error:
            raise WrongValueError(f"no floor plan {stated.file}: {error.strerror}") from None
        except UnicodeDecodeError:
            raise WrongValueError(f"{stated.file} is not YAML; give the YAML file of the picture") from None
        except ModelError as error:
            reading.problems.add(path, str(error), node.where)
            raise WrongValueError("") from None
        known = {key: below for key, below in tree.items.items() if key in _MapFile.__annotations__}
        right, plan = read_child(Record(_MapFile), Node(known, tree.where), path, reading)
        if not right:
            raise WrongValueError("")
        check_inside(reading, path, str(FilePath(stated.file).parent / plan.image))
        try:
            walls = tuple(_walls(plan, file.parent / plan.image))
        except ValueError as error:
            raise WrongValueError(f"{stated.file}: {error}") from None
        return FloorPlan(file.stem, stated.height_m, walls)

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return self.written_as.schema(definitions)


FLOOR_PLAN = _FloorPlan()


def _walls(plan: _MapFile, picture: FilePath) -> Iterator[Corners]:
    """Yield the corners of each wall, in metres. Raise ``ValueError`` if the plan cannot be used."""
    if not (isfinite(plan.resolution) and 0.001 <= plan.resolution <= 10.0):
        raise ValueError(f"a resolution of {plan.resolution} m a cell; give one from 0.001 to 10")
    if len(plan.origin) != 3 or not all(map(isfinite, plan.origin)):
        raise ValueError("its origin is three numbers: x, y and yaw of the lower left corner")
    shades = _read_shades(picture)
    occupied = (shades if plan.negate else _WHITE - shades) > plan.occupied_thresh * _WHITE
    if not occupied.any():
        raise ValueError(f"no cell of {picture.name} is occupied: are negate and occupied_thresh right?")
    west, south, yaw = plan.origin
    sine, cosine = sine_cosine(yaw)
    found = list(
        islice(cover(occupied[::-1]), MOST_WALLS + 1)
    )  # the first row of a picture is the northern one
    if len(found) > MOST_WALLS:
        raise ValueError(
            f"more than {MOST_WALLS} rectangles cover what is occupied in {picture.name}: remove its "
            "speckles, or give a coarser picture"
        )
    for left, bottom, right, top in found:
        scaled = [
            (plan.resolution * x, plan.resolution * y)
            for x, y in ((left, bottom), (right, bottom), (right, top), (left, top))
        ]
        yield tuple((west + cosine * x - sine * y, south + sine * x + cosine * y) for x, y in scaled)


def _read_shades(picture: FilePath) -> NDArray[np.float64]:
    """Return the shades of a picture (rows, columns), 0 black to 255 white; what is transparent is white."""
    from PIL import Image  # noqa: PLC0415  # only a model with a floor plan needs it

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


def cover(occupied: NDArray[np.bool_]) -> Iterator[tuple[int, int, int, int]]:
    """Yield rectangles that cover the occupied cells and no others.

    Args:
        occupied: By row and column.

    Returns:
        First column, first row, end of columns, end of rows.
    """
    left = occupied.copy()
    for row, column in zip(*(axis.tolist() for axis in np.nonzero(occupied)), strict=True):
        if left[row, column]:
            end_column = column + _run(occupied[row, column:])
            lines = row + _run(np.all(occupied[row:, column:end_column], axis=1))
            end_row = row + _run(occupied[row:, column])
            columns = column + _run(np.all(occupied[row:end_row, column:], axis=0))
            flat, tall = left[row:lines, column:end_column], left[row:end_row, column:columns]
            if np.count_nonzero(tall) > np.count_nonzero(flat):
                tall[:] = False
                yield column, row, columns, end_row
            else:
                flat[:] = False
                yield column, row, end_column, lines


def _run(cells: NDArray[np.bool_]) -> int:
    """Return how many cells from the first one on are occupied."""
    return len(cells) if cells.all() else int(cells.argmin())
