from __future__ import annotations

import numpy as np
import pytest
from shapely import LineString, Polygon, affinity

from volery.autonomy.survey import survey_lines
from volery.base.errors import UsageError

SQUARE = [(0.0, 0.0), (40.0, 0.0), (40.0, 30.0), (0.0, 30.0)]
U = [(0, 0), (60, 0), (60, 40), (40, 40), (40, 12), (20, 12), (20, 40), (0, 40)]
COMB = [(0, 0), (70, 0), (70, 30), (60, 30), (60, 8), (50, 8), (50, 30), (30, 30), (30, 8), (20, 8)]
COMB += [(20, 30), (0, 30)]
SPIRAL = [(0, 0), (50, 0), (50, 50), (0, 50), (0, 20), (30, 20), (30, 30), (10, 30), (10, 40), (40, 40)]
SPIRAL += [(40, 10), (0, 10)]
HOLE = [[(12.0, 9.0), (28.0, 9.0), (28.0, 21.0), (12.0, 21.0)]]


def shape(corners: list[tuple[float, float]]) -> list[tuple[float, float]]:
    return [(float(x), float(y)) for x, y in corners]


def test_a_rectangle_is_flown_along_its_longer_side() -> None:
    points = survey_lines(SQUARE, 10.0)
    assert points == [
        pytest.approx(point)
        for point in ((0.0, 5.0), (40.0, 5.0), (40.0, 15.0), (0.0, 15.0), (0.0, 25.0), (40.0, 25.0))
    ]


def test_a_heading_turns_the_lines() -> None:
    points = np.array(survey_lines(SQUARE, 10.0, heading=0.0))
    assert points[0][0] == pytest.approx(points[1][0])
    assert abs(points[1][1] - points[0][1]) == pytest.approx(30.0)


@pytest.mark.parametrize("heading", [None, 0.0, 0.4, 1.3, np.pi / 2.0, 2.5])
@pytest.mark.parametrize(
    ("corners", "holes"), [(SQUARE, []), (SQUARE, HOLE), (U, []), (COMB, []), (SPIRAL, [])]
)
def test_all_is_seen_and_the_way_never_leaves(
    corners: list[tuple[float, float]], holes: list[list[tuple[float, float]]], heading: float | None
) -> None:
    area = Polygon(corners, holes)
    points = survey_lines(shape(corners), 4.0, heading, holes)
    way = LineString(points)
    assert area.buffer(1e-5).covers(way)
    unseen = area.difference(way.buffer(2.05, cap_style="square")).area
    assert unseen < 0.04 * area.area
    assert way.length < 2.2 * area.area / 4.0


def test_a_concave_polygon_is_not_flown_over_what_is_outside() -> None:
    points = survey_lines(shape(U), 5.0, heading=np.pi / 2.0)
    straight = LineString(((10.0, 35.0), (50.0, 35.0)))
    assert not Polygon(U).covers(straight)
    assert Polygon(U).buffer(1e-5).covers(LineString(points))


def test_a_turned_polygon_gives_the_turned_pattern() -> None:
    turned = affinity.rotate(Polygon(U), 30.0, origin=(0.0, 0.0))
    corners = list(turned.exterior.coords)[:-1]
    assert LineString(survey_lines(corners, 4.0, heading=-np.pi / 6.0)).length == pytest.approx(
        LineString(survey_lines(shape(U), 4.0, heading=0.0)).length
    )


def test_a_spacing_wider_than_the_area_gives_one_line() -> None:
    assert len(survey_lines(SQUARE, 100.0)) == 2


def test_wrong_areas_are_named() -> None:
    with pytest.raises(UsageError, match="sides do not cross"):
        survey_lines([(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)], 1.0)
    with pytest.raises(UsageError, match="sides do not cross"):
        survey_lines([(0.0, 0.0), (1.0, 1.0)], 1.0)
    with pytest.raises(UsageError, match="holes inside"):
        survey_lines(SQUARE, 1.0, holes=[[(35.0, 10.0), (50.0, 10.0), (50.0, 20.0)]])
    for spacing in (0.0, float("nan")):
        with pytest.raises(UsageError, match="above 0 m"):
            survey_lines(SQUARE, spacing)
