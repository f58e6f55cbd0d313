"""What stands in the world: buildings, walls and bridges as upright prisms, and volumes closed to flight.

A solid is a prism over a simple polygon, between two heights. Bodies collide with its sides and its
underside and stand on its top; a ray ends at any of them. No-fly volumes stop nothing; they are here for
those who plan. A lattice of square cells lists the solids near each place, so that a question costs the same
among a thousand walls as among ten.

The compiled step carries the arrays of a ``Scene`` in ``Bodies``; the numeric functions here take them.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import ceil, inf, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.base.errors import UsageError
from volery.base.frames import Vector
from volery.base.numeric_code import numeric
from volery.simulation.world.environment_models import HALF_CURVATURE, Terrain, ground_height
from volery.simulation.world.state_layout import Array

DAY_LUX, DUSK_LUX = 10_000.0, 50.0
"""Illuminance of an overcast day; of the end of civil twilight, or of a lit street."""
MARGIN = 3.0
"""A solid is listed in the cells within this distance [m]: at least the reach of any body."""
_CELLS = 256  # along the longer side of the lattice, at most
_SMALLEST = 4.0  # [m] side of a cell, at least
_STEP = 0.5  # [m] what begins less above the ground stands on it: the ground follows the globe
_BOXED = 32  # edges in a row share a bounding box: a polygon of thousands of corners is searched by boxes
_ROUNDING = 1.0 + 1e-9  # on a distance: an edge that is as near as another one but for rounding is looked at
_SPARE = 0.01  # [m] by which a ray passes a box whose edges it cannot meet
_LEAST_SHARE = 1e-4  # of a ray's reach: it looks for the ground in steps of at least as much
_HALVINGS = 40  # that find where between two steps a ray meets the ground
_ON_TOP = 0.02  # [m] a body's centre below a top by less is on the solid, not beside it

# Columns of a solid's row.
WEST, SOUTH, EAST, NORTH, FLOOR, CEILING, FIRST_EDGE, END_EDGE, FIRST_BOX = range(9)
# Columns of the lattice.
_LEFT, _BOTTOM, _SIDE, _COLUMNS, _ROWS = range(5)


class Solid(NamedTuple):
    """An upright prism.

    Args:
        name: Name for messages.
        corners: Corners of a simple polygon (east, north) about the world's origin [m], in either order.
        floor: Lower end about the world's origin, up [m].
        ceiling: Upper end, up [m]; may be infinite.
    """

    name: str
    corners: tuple[tuple[float, float], ...]
    floor: float = 0.0
    ceiling: float = inf


class Marker(NamedTuple):
    """A square fiducial marker that lies level, in a white margin of a quarter of its side.

    Args:
        name: Name for messages.
        cells: Its cells (n, n) from the upper left, black border included: 0 black, 1 white.
        at: Its centre east, north, up about the world's origin [m].
        size: Side of the black square [m].
        yaw: Direction of its upper edge, clockwise from north [rad].
    """

    name: str
    cells: NDArray[np.uint8]
    at: Vector
    size: float
    yaw: float = 0.0


class Cylinder(NamedTuple):
    """The upright cylinder of a body [m]: axis, heights of lower end, centre and upper end, radius."""

    east: float
    north: float
    low: float
    centre: float
    high: float
    reach: float


class Ray(NamedTuple):
    """A starting point [m] and a unit vector, both east, north, up."""

    east: float
    north: float
    up: float
    to_east: float
    to_north: float
    to_up: float


class SceneArrays(NamedTuple):
    """A scene for the compiled step.

    ``solids`` (solids, 9): bounds west, south, east, north, then floor, ceiling, first edge, end of edges,
    first box. ``edges`` (edges and boxes, 4): both ends (east, north) of every edge; then of every ``_BOXED``
    edges of a solid in a row the bounds west, south, east, north. ``cells``: for each cell where its list
    begins, and the end of the last; then the lists. ``lattice``: west and south edge, side of a cell [m],
    columns, rows.
    """

    solids: Array
    edges: Array
    cells: NDArray[np.int64]
    lattice: Array


class Scene:
    """The ground, the solids and the no-fly volumes of a world.

    Args:
        solids: What stands in the world.
        no_fly: Volumes that vehicles should not enter.
        terrain: The ground.
        markers: What lies on the ground and on roofs for cameras to see.
        lux: Illuminance.

    Raises:
        UsageError: A polygon has fewer than three corners, or a ceiling is not above its floor.
    """

    def __init__(
        self,
        solids: Sequence[Solid] = (),
        no_fly: Sequence[Solid] = (),
        terrain: Terrain | None = None,
        markers: Sequence[Marker] = (),
        lux: float = DAY_LUX,
    ) -> None:
        for solid in (*solids, *no_fly):
            if len(solid.corners) < 3 or not solid.floor < solid.ceiling:
                raise UsageError(f"{solid.name}: give at least three corners and a ceiling above the floor")
        self.solids = tuple(solids)
        self.no_fly = tuple(no_fly)
        self.terrain = terrain or Terrain()
        self.markers = tuple(markers)
        self.lux = lux
        self.arrays = _arrays(self.solids)

    def cast(self, origins: Array, directions: Array, reach: float) -> Array:
        """Return how far each ray goes until it meets a solid.

        Args:
            origins: Starting points (rays, 3): east, north, up [m].
            directions: Unit vectors (rays, 3): east, north, up.
            reach: Length after which a ray ends [m].

        Returns:
            Distances (rays,) [m]; infinity for a ray that meets nothing within *reach*. A ray that begins
            inside a solid has distance 0.
        """
        found = np.empty(len(origins))
        for index, (start, along) in enumerate(zip(origins, directions, strict=True)):
            found[index] = cast_ray(self.arrays, Ray(*start, *along), reach)
        return found

    def standing_height(self, east: float, north: float) -> float:
        """Return the height of the ground at a place, or of the top of what stands there [m].

        Solids that stand on one another count; a bridge that spans the place does not.
        """
        top = self.terrain.height(east, north)
        over = [solid for index, solid in enumerate(self.solids) if is_over(self.arrays, index, east, north)]
        for solid in sorted(over, key=lambda one: one.floor):
            if solid.floor <= top + _STEP < solid.ceiling:
                top = solid.ceiling
        return top


def _arrays(solids: Sequence[Solid]) -> SceneArrays:
    if not solids:
        return SceneArrays(np.zeros((0, 9)), np.zeros((0, 4)), np.zeros(1, dtype=np.int64), np.zeros(5))
    rows = np.zeros((len(solids), 9))
    edges: list[tuple[float, ...]] = []
    for row, solid in zip(rows, solids, strict=True):
        corners = np.array(solid.corners)
        row[WEST : NORTH + 1] = *corners.min(axis=0), *corners.max(axis=0)
        row[FLOOR], row[CEILING], row[FIRST_EDGE] = solid.floor, solid.ceiling, len(edges)
        edges += [(*one, *other) for one, other in pairwise((*solid.corners, solid.corners[0]))]
        row[END_EDGE] = len(edges)
    boxes: list[tuple[float, ...]] = []
    for row in rows:
        row[FIRST_BOX] = len(edges) + len(boxes)
        for first in range(int(row[FIRST_EDGE]), int(row[END_EDGE]), _BOXED):
            ends = np.array(edges[first : min(first + _BOXED, int(row[END_EDGE]))]).reshape(-1, 2)
            boxes.append((*ends.min(axis=0), *ends.max(axis=0)))
    west, south = rows[:, WEST].min() - MARGIN, rows[:, SOUTH].min() - MARGIN
    wide, high = rows[:, EAST].max() + MARGIN - west, rows[:, NORTH].max() + MARGIN - south
    side = max(_SMALLEST, max(wide, high) / _CELLS)
    columns, lines = ceil(wide / side), ceil(high / side)
    near: list[list[int]] = [[] for _ in range(columns * lines)]
    for index, row in enumerate(rows):
        first, last = (
            int((row[edge] + off - west) / side) for edge, off in ((WEST, -MARGIN), (EAST, MARGIN))
        )
        low, top = (
            int((row[edge] + off - south) / side) for edge, off in ((SOUTH, -MARGIN), (NORTH, MARGIN))
        )
        for line in range(low, min(top, lines - 1) + 1):
            for column in range(first, min(last, columns - 1) + 1):
                near[line * columns + column].append(index)
    starts = np.cumsum([len(near) + 1, *map(len, near)])
    cells = np.array([*starts, *(index for one in near for index in one)], dtype=np.int64)
    return SceneArrays(
        rows,
        np.array([*edges, *boxes], dtype=np.float64),
        cells,
        np.array((west, south, side, columns, lines)),
    )


@numeric
def _cell(scene: SceneArrays, east: float, north: float) -> int:
    """Return the cell of a place, -1 outside of the lattice."""
    lattice = scene.lattice
    if lattice[_COLUMNS] == 0.0:
        return -1
    column = (east - lattice[_LEFT]) / lattice[_SIDE]
    line = (north - lattice[_BOTTOM]) / lattice[_SIDE]
    if not (0.0 <= column < lattice[_COLUMNS] and 0.0 <= line < lattice[_ROWS]):
        return -1
    return int(line) * int(lattice[_COLUMNS]) + int(column)


@numeric
def is_over(scene: SceneArrays, solid: int, east: float, north: float) -> bool:
    """Return whether a place is inside the polygon of a solid, by the even-odd rule."""
    solids, edges = scene.solids, scene.edges
    if not (
        solids[solid, WEST] <= east <= solids[solid, EAST]
        and solids[solid, SOUTH] <= north <= solids[solid, NORTH]
    ):
        return False
    inside = False
    end, box = int(solids[solid, END_EDGE]), int(solids[solid, FIRST_BOX])
    for first in range(int(solids[solid, FIRST_EDGE]), end, _BOXED):
        if edges[box, 1] <= north < edges[box, 3]:
            for edge in range(first, min(first + _BOXED, end)):
                x, y, to_x, to_y = edges[edge, 0], edges[edge, 1], edges[edge, 2], edges[edge, 3]
                if (y > north) != (to_y > north) and east < x + (to_x - x) * (north - y) / (to_y - y):
                    inside = not inside
        box += 1
    return inside


@numeric
def top_below(scene: SceneArrays, east: float, north: float, up: float) -> float:
    """Return the height of the highest top of a solid at or below a point [m]; minus infinity without one."""
    highest = -inf
    cell = _cell(scene, east, north)
    if cell < 0:
        return highest
    for at in range(scene.cells[cell], scene.cells[cell + 1]):
        solid = scene.cells[at]
        top = scene.solids[solid, CEILING]
        if highest < top <= up and is_over(scene, solid, east, north):
            highest = top
    return highest


@numeric
def _distance(east: float, north: float) -> float:
    return sqrt(east * east + north * north)


@numeric
def _nearest_side(scene: SceneArrays, solid: int, east: float, north: float) -> tuple[float, float, float]:
    """Return distance and direction (east, north) from the nearest point of a solid's sides to a place."""
    edges = scene.edges
    start, end = int(scene.solids[solid, FIRST_EDGE]), int(scene.solids[solid, END_EDGE])
    box = int(scene.solids[solid, FIRST_BOX])
    nearest, toward_east, toward_north = inf, 0.0, 0.0
    most = inf  # no nearest point is farther than a corner
    if end - start > _BOXED:
        for first in range(start, end, _BOXED):
            most = min(most, _distance(east - edges[first, 0], north - edges[first, 1]))
    for first in range(start, end, _BOXED):
        beside = max(edges[box, 0] - east, east - edges[box, 2], 0.0)
        beyond = max(edges[box, 1] - north, north - edges[box, 3], 0.0)
        box += 1
        if _distance(beside, beyond) > min(nearest, most) * _ROUNDING:
            continue
        for edge in range(first, min(first + _BOXED, end)):
            x, y = edges[edge, 0], edges[edge, 1]
            dx, dy = edges[edge, 2] - x, edges[edge, 3] - y
            square = dx * dx + dy * dy
            along = 0.0
            if square > 0.0:
                along = min(max(((east - x) * dx + (north - y) * dy) / square, 0.0), 1.0)
            off_east, off_north = east - x - along * dx, north - y - along * dy
            distance = _distance(off_east, off_north)
            if distance < nearest:
                nearest, toward_east, toward_north = distance, off_east, off_north
    return nearest, toward_east, toward_north


@numeric
def contact(scene: SceneArrays, body: Cylinder) -> tuple[int, float, float, float, float]:
    """Return where a body touches a side or an underside: the deepest contact.

    Args:
        scene: The solids.
        body: The body; its radius is at most ``MARGIN``.

    Returns:
        The solid (-1: none), the depth [m], and the unit vector east, north, up out of the solid. Who is on
        top of a solid touches its ground: see ``top_below``.
    """
    touched, deepest, out_east, out_north, out_up = -1, 0.0, 0.0, 0.0, 0.0
    east, north, reach = body.east, body.north, body.reach
    cell = _cell(scene, east, north)
    if cell < 0:
        return touched, deepest, out_east, out_north, out_up
    for at in range(scene.cells[cell], scene.cells[cell + 1]):
        solid = scene.cells[at]
        row = scene.solids[solid]
        if body.high <= row[FLOOR] or body.low >= row[CEILING] or body.centre > row[CEILING] - _ON_TOP:
            continue
        if (
            east + reach <= row[WEST] or east - reach >= row[EAST]
            or north + reach <= row[SOUTH] or north - reach >= row[NORTH]
        ):  # fmt: skip
            continue
        distance, off_east, off_north = _nearest_side(scene, solid, east, north)
        inside = is_over(scene, solid, east, north)
        depth = reach + distance if inside else reach - distance
        if depth <= deepest or distance == 0.0:  # on a side there is no direction out; a step later there is
            continue
        below = body.high - row[FLOOR]
        if below < depth and body.centre < row[FLOOR]:
            depth, off_east, off_north, up = below, 0.0, 0.0, -1.0
        else:
            scale = (-1.0 if inside else 1.0) / distance
            off_east, off_north, up = scale * off_east, scale * off_north, 0.0
        if depth > deepest:
            touched, deepest, out_east, out_north, out_up = solid, depth, off_east, off_north, up
    return touched, deepest, out_east, out_north, out_up


@numeric
def _is_apart(scene: SceneArrays, box: int, ray: Ray) -> bool:
    """Return whether the line of a ray, seen from above, passes a box with room to spare."""
    edges = scene.edges
    wide, high = 0.5 * (edges[box, 2] - edges[box, 0]), 0.5 * (edges[box, 3] - edges[box, 1])
    x, y = edges[box, 0] + wide - ray.east, edges[box, 1] + high - ray.north
    room = wide * abs(ray.to_north) + high * abs(ray.to_east) + _SPARE
    return bool(abs(x * ray.to_north - y * ray.to_east) > room)


@numeric
def _meet(scene: SceneArrays, solid: int, ray: Ray, reach: float) -> float:
    """Return how far a ray goes until it meets one solid [m]; infinity if it does not within *reach*."""
    row, edges = scene.solids[solid], scene.edges
    if row[FLOOR] <= ray.up <= row[CEILING] and is_over(scene, solid, ray.east, ray.north):
        return 0.0
    nearest = inf
    end, box = int(row[END_EDGE]), int(row[FIRST_BOX])
    for first in range(int(row[FIRST_EDGE]), end, _BOXED):
        apart = _is_apart(scene, box, ray)
        box += 1
        if apart:
            continue
        for edge in range(first, min(first + _BOXED, end)):
            x, y = edges[edge, 0] - ray.east, edges[edge, 1] - ray.north
            dx, dy = edges[edge, 2] - edges[edge, 0], edges[edge, 3] - edges[edge, 1]
            across = ray.to_east * dy - ray.to_north * dx
            if across == 0.0:
                continue
            length = (x * dy - y * dx) / across
            along = (x * ray.to_north - y * ray.to_east) / across
            height = ray.up + length * ray.to_up
            if 0.0 <= length < nearest and 0.0 <= along <= 1.0 and row[FLOOR] <= height <= row[CEILING]:
                nearest = length
    if ray.to_up != 0.0:
        for level in (row[FLOOR], row[CEILING]):
            length = (level - ray.up) / ray.to_up
            east, north = ray.east + length * ray.to_east, ray.north + length * ray.to_north
            if 0.0 <= length < nearest and is_over(scene, solid, east, north):
                nearest = length
    return nearest if nearest <= reach else inf


@numeric
def _crossing(at: float, to: float, end: float) -> tuple[float, float]:
    """Return where a ray from *at* with the slope *to* is between 0 and *end*, as two lengths."""
    if to == 0.0:
        return (-inf, inf) if 0.0 <= at < end else (inf, -inf)
    one, other = -at / to, (end - at) / to
    return min(one, other), max(one, other)


@numeric
def cast_ray(scene: SceneArrays, ray: Ray, reach: float) -> float:
    """Return how far a ray goes until it meets a solid [m]; infinity if it meets none within *reach*.

    It walks from cell to cell (Amanatides and Woo, Eurographics 1987).
    """
    lattice = scene.lattice
    side, columns, lines = lattice[_SIDE], int(lattice[_COLUMNS]), int(lattice[_ROWS])
    x, y = ray.east - lattice[_LEFT], ray.north - lattice[_BOTTOM]
    enter_x, leave_x = _crossing(x, ray.to_east, side * columns)
    enter_y, leave_y = _crossing(y, ray.to_north, side * lines)
    enter, leave = max(enter_x, enter_y, 0.0), min(leave_x, leave_y, reach)
    nearest = inf
    if columns == 0 or enter > leave:
        return nearest
    column = min(max(int((x + enter * ray.to_east) / side), 0), columns - 1)
    line = min(max(int((y + enter * ray.to_north) / side), 0), lines - 1)
    step_x, step_y = (1 if ray.to_east > 0.0 else -1), (1 if ray.to_north > 0.0 else -1)
    each_x = side / abs(ray.to_east) if ray.to_east != 0.0 else inf
    each_y = side / abs(ray.to_north) if ray.to_north != 0.0 else inf
    next_x = (side * (column + max(step_x, 0)) - x) / ray.to_east if ray.to_east != 0.0 else inf
    next_y = (side * (line + max(step_y, 0)) - y) / ray.to_north if ray.to_north != 0.0 else inf
    while 0 <= column < columns and 0 <= line < lines:
        cell = line * columns + column
        for at in range(scene.cells[cell], scene.cells[cell + 1]):
            nearest = min(nearest, _meet(scene, scene.cells[at], ray, reach))
        if min(nearest, leave) <= min(next_x, next_y):
            break
        if next_x < next_y:
            column, next_x = column + step_x, next_x + each_x
        else:
            line, next_y = line + step_y, next_y + each_y
    return nearest


@numeric
def _clearance(heights: Array, grid: Array, ray: Ray, length: float) -> float:
    """Return the height of a point of a ray over the ground [m]."""
    east, north = ray.east + length * ray.to_east, ray.north + length * ray.to_north
    return ray.up + length * ray.to_up - ground_height(heights, grid, east, north)


@numeric
def _level_distance(above: float, ray: Ray) -> float:
    """Return how far a ray from *above* level ground [m] goes until it meets it: it curves with the globe."""
    square = (ray.to_east * ray.to_east + ray.to_north * ray.to_north) * HALF_CURVATURE
    slope = ray.to_up + 2.0 * HALF_CURVATURE * (ray.east * ray.to_east + ray.north * ray.to_north)
    root = slope * slope - 4.0 * square * above
    return 2.0 * above / (sqrt(root) - slope) if slope < 0.0 <= root else inf


@numeric
def ground_distance(heights: Array, grid: Array, ray: Ray, reach: float) -> float:
    """Return how far a ray goes until it meets the ground [m]; infinity if it does not within *reach*.

    Over posts of heights it looks four times between two of them: a narrower ridge is missed.
    """
    above = _clearance(heights, grid, ray, 0.0)
    if above <= 0.0:
        return 0.0
    if heights.size == 1:
        length = _level_distance(above, ray)
        return length if length <= reach else inf
    across = sqrt(ray.to_east * ray.to_east + ray.to_north * ray.to_north)
    step = max(0.25 * grid[2] / across if across > 0.0 else reach, reach * _LEAST_SHARE)
    far = 0.0
    while far < reach:
        near, far = far, min(far + step, reach)
        if _clearance(heights, grid, ray, far) <= 0.0:
            for _ in range(_HALVINGS):
                middle = 0.5 * (near + far)
                if _clearance(heights, grid, ray, middle) > 0.0:
                    near = middle
                else:
                    far = middle
            return far
    return inf
