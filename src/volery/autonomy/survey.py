"""Survey patterns: parallel lines over a polygon, such that a camera or a lidar sees all of it.

Lines that a concave side or a hole cuts become pieces; pieces one beside the other are flown to and fro, and
where the pattern goes on elsewhere, the shortest way inside of the polygon leads there (boustrophedon cells:
Choset 2000; shortest ways over a visibility graph).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse.csgraph import dijkstra
from shapely import LineString, MultiLineString, Polygon, affinity

from volery.base.errors import UsageError

Point = tuple[float, float]
Piece = tuple[Point, Point]

_TOUCH = 1e-6  # [m] by which a way along a side may be outside of it, by rounding


def survey_lines(
    corners: Sequence[Point],
    spacing: float,
    heading: float | None = None,
    holes: Sequence[Sequence[Point]] = (),
) -> list[Point]:
    """Return the way points of a survey, to and fro over a polygon; the way never leaves it.

    Beside a slanted side the ends of two lines differ; what lies between them there is seen from the nearer
    one only if the sensor sees as far ahead as across.

    Args:
        corners: Corners (east, north) of a simple polygon [m]; it may be concave.
        spacing: Distance between two lines [m]: what is seen across, less the overlap.
        heading: Direction of the lines, clockwise from north [rad]; None for the one with the fewest turns.
        holes: Polygons inside of it that are not flown over.

    Raises:
        UsageError: The polygon is not simple, a hole is not inside of it, or the spacing is not above 0.

    Example::

        survey_lines([(0.0, 0.0), (40.0, 0.0), (40.0, 30.0), (0.0, 30.0)], spacing=10.0)
    """
    area = Polygon(corners, holes) if len(corners) >= 3 else Polygon()
    if not area.is_valid or area.area == 0.0:
        raise UsageError("a survey needs a polygon whose sides do not cross, and holes inside of it")
    if not spacing > 0.0:
        raise UsageError(f"lines {spacing} m apart; give a distance above 0 m")
    turn = (_longest_side(area) if heading is None else heading) - np.pi / 2.0
    level = affinity.rotate(area, turn, origin=(0.0, 0.0), use_radians=True)
    inside = _Inside(level)
    points: list[Point] = []
    for piece in _in_order(_runs(level, spacing)):
        points += inside.way(points[-1], piece[0])[1:-1] if points else []
        points += piece
    back = affinity.rotate(LineString(points), -turn, origin=(0.0, 0.0), use_radians=True)
    return [(float(x), float(y)) for x, y in back.coords]


def _longest_side(area: Polygon) -> float:
    """Return the heading of the longer side of the smallest rectangle around a polygon [rad]."""
    around = shapely.get_coordinates(area.minimum_rotated_rectangle)
    sides = np.diff(around, axis=0)
    east, north = sides[int((sides * sides).sum(axis=1).argmax())]
    return float(np.arctan2(east, north))


def _runs(area: Polygon, spacing: float) -> list[list[Piece]]:
    """Return the pieces of lines along x, in runs: each piece has the one before it alone beside it."""
    west, south, east, north = area.bounds
    count = max(1, int(np.ceil((north - south) / spacing - 1e-9)))
    first = 0.5 * (south + north) - 0.5 * (count - 1) * spacing
    runs: list[list[Piece]] = []
    open_runs: list[list[Piece]] = []
    for line in range(count):
        y = first + line * spacing
        cut = area.intersection(LineString(((west - 1.0, y), (east + 1.0, y))))
        parts = cut.geoms if isinstance(cut, MultiLineString) else [cut]
        ends = sorted((part.bounds[0], part.bounds[2]) for part in parts if part.length > _TOUCH)
        pieces: list[Piece] = [((low, y), (high, y)) for low, high in ends]
        beside = [[run for run in open_runs if _overlap(run[-1], piece)] for piece in pieces]
        followed = []
        for piece, before in zip(pieces, beside, strict=True):
            alone = len(before) == 1 and sum(before[0] in others for others in beside) == 1
            run = before[0] if alone else []
            if not alone:
                runs.append(run)
            run.append(piece)
            followed.append(run)
        open_runs = followed
    return runs


def _overlap(one: Piece, other: Piece) -> bool:
    return one[0][0] < other[1][0] and other[0][0] < one[1][0]


def _in_order(runs: list[list[Piece]]) -> list[Piece]:
    """Return all pieces in the order and direction in which they are flown: the nearest run is the next."""
    order: list[Piece] = []
    left = list(runs)
    while left:
        ways = [
            to_and_fro
            for run in left
            for upwards in (run, run[::-1])
            for to_and_fro in (_alternating(upwards, False), _alternating(upwards, True))
        ]
        at = order[-1][1] if order else ways[0][0][0]
        away = [np.hypot(way[0][0][0] - at[0], way[0][0][1] - at[1]) for way in ways]
        best = int(np.argmin(away))
        order += ways[best]
        del left[best // 4]
    return order


def _alternating(run: list[Piece], back: bool) -> list[Piece]:
    return [piece[::-1] if (index % 2 == 1) != back else piece for index, piece in enumerate(run)]


class _Inside:
    """Shortest ways inside of a polygon."""

    def __init__(self, area: Polygon) -> None:
        self._area = area.buffer(_TOUCH, join_style="mitre")
        shapely.prepare(self._area)
        self._corners = np.unique(shapely.get_coordinates(area), axis=0)
        self._lengths = self._seen(self._corners, self._corners)

    def _seen(self, places: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distances between places that see one another (n, m) [m], infinity between others."""
        pairs = np.stack(np.broadcast_arrays(places[:, None], others[None]), axis=2)
        lines = shapely.linestrings(pairs.reshape(-1, 2, 2))
        seen = np.where(shapely.covers(self._area, lines), shapely.length(lines), np.inf)
        return seen.reshape(len(places), len(others))

    def way(self, start: Point, goal: Point) -> list[Point]:
        """Return the corners of the way between two places in the polygon, both included."""
        if self._area.covers(LineString((start, goal))):
            return [start, goal]
        ends = np.array((start, goal))
        count = len(self._corners)
        lengths = np.full((count + 2, count + 2), np.inf)
        lengths[:count, :count] = self._lengths
        lengths[count:, :count] = self._seen(ends, self._corners)
        lengths[:count, count:] = lengths[count:, :count].T
        _, before = dijkstra(lengths, indices=count, return_predecessors=True)
        at, way = count + 1, [goal]
        while at != count:
            at = int(before[at])
            east, north = ends[0] if at == count else self._corners[at]
            way.append((float(east), float(north)))
        return way[::-1]
