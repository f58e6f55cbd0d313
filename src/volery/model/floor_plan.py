"""Floor plans: a picture of occupied cells with the YAML of ROS's map_server, as walls.

Occupied cells are covered by rectangles, of which the largest at each place is taken. They may overlap.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path as FilePath
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from volery.base import units
from volery.base.elementary import sine_cosine
from volery.base.errors import ModelError
from volery.model.components import check_inside
from volery.model.fields import (
    TEXT,
    QuantityField,
    Record,
    Schema,
    Shorter,
    Syntax,
    WrongValueError,
    read_child,
)
from volery.model.map_file import MAP, MapPicture, parse_map, picture_of
from volery.model.reading import ModelReading
from volery.model.text import Path, TextNode

MOST_WALLS = 20_000

Corners = tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True)
class FloorPlanText:
    """Walls in a picture, by the YAML file of ROS's map_server. Written as its name, or as a mapping."""

    file: Annotated[str, TEXT, "The YAML file: `image`, `resolution`, `origin`, `negate`, `occupied_thresh`."]
    height_m: Annotated[float, QuantityField(units.LENGTH, above=0), "Height of the walls."] = 3.0


@dataclass(frozen=True, slots=True)
class FloorPlan:
    """Walls of one height that stand on the ground: rectangles, as corners (east, north) about the origin."""

    name: str
    height_m: float
    walls: tuple[Corners, ...]


class _FloorPlan(Syntax):
    """The name of a map's YAML file, or a mapping."""

    written_as = Shorter(Record(FloorPlanText), key="file")

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> FloorPlan:
        """See ``Syntax``."""
        stated: FloorPlanText = self.written_as.read(node, path, reading)
        check_inside(reading, path, stated.file)
        file = reading.folder / stated.file
        try:
            tree = parse_map(file)
        except ValueError as error:
            raise WrongValueError(f"{stated.file}: {error}") from None
        except ModelError as error:
            reading.problems.add(path, str(error), node.where)
            raise WrongValueError("") from None
        right, plan = read_child(MAP, tree, path, reading)
        if not right:
            raise WrongValueError("")
        check_inside(reading, path, str(FilePath(stated.file).parent / plan.image))
        try:
            walls = tuple(_walls(picture_of(plan, file.parent / plan.image), plan.image))
        except ValueError as error:
            raise WrongValueError(f"{stated.file}: {error}") from None
        return FloorPlan(file.stem, stated.height_m, walls)

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return self.written_as.schema(definitions)


FLOOR_PLAN = _FloorPlan()


def _walls(plan: MapPicture, name: str) -> Iterator[Corners]:
    """Yield the corners of each wall, in metres. Raise ``ValueError`` if the plan cannot be used."""
    if not plan.occupied.any():
        raise ValueError(f"no cell of {name} is occupied: are negate and occupied_thresh right?")
    west, south, yaw = plan.origin
    sine, cosine = sine_cosine(yaw)
    found = list(islice(cover(plan.occupied), MOST_WALLS + 1))
    if len(found) > MOST_WALLS:
        raise ValueError(
            f"more than {MOST_WALLS} rectangles cover what is occupied in {name}: remove its "
            "speckles, or give a coarser picture"
        )
    for left, bottom, right, top in found:
        scaled = [
            (plan.resolution * x, plan.resolution * y)
            for x, y in ((left, bottom), (right, bottom), (right, top), (left, top))
        ]
        yield tuple((west + cosine * x - sine * y, south + sine * x + cosine * y) for x, y in scaled)


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
