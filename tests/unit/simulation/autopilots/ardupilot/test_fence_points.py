"""The fence by the deprecated FENCE_POINT, and lists that cannot be a fence."""

from __future__ import annotations

from typing import Any

import pytest

from rigs.station import TARGET
from volery.simulation.autopilots.ardupilot.fence_points import refuse_points
from volery.simulation.autopilots.onboard_mission import GLOBAL, MissionItem

FENCE = 1
CORNERS = [(1.0, 1.0), (2.0, 1.0), (2.0, 2.0), (1.0, 2.0)]


def fetched(rig: Any, index: int) -> tuple[float, float]:
    rig.send("FENCE_FETCH_POINT", **TARGET, idx=index)
    rig.run(0.05)
    point = rig.latest["FENCE_POINT"]
    assert point["idx"] == index
    return point["lat"], point["lng"]


@pytest.mark.parametrize("order", [(0, 1, 2, 3, 4, 5), (4, 3, 2, 1, 0, 5), (1, 2, 3, 4, 5, 0)])
def test_a_polygon_by_single_points(order: tuple[int, ...], station: Any) -> None:
    rig = station("rover")
    rig.run(0.5)
    rig.vehicle.set_parameter("FENCE_TOTAL", 6)
    rig.run(0.5)
    sent = [(1.5, 1.5), *CORNERS, CORNERS[0]]
    for index in order:
        rig.send("FENCE_POINT", **TARGET, idx=index, count=6, lat=sent[index][0], lng=sent[index][1])
        rig.run(0.05)
    assert [fetched(rig, index) for index in range(6)] == [pytest.approx(place, abs=2e-7) for place in sent]
    assert [point.command for point in rig.vehicle.points[FENCE]] == [5000, 5001, 5001, 5001, 5001]
    assert {point.param1 for point in rig.vehicle.points[FENCE][1:]} == {4.0}
    rig.vehicle.set_parameter("FENCE_TOTAL", 0)
    rig.run(0.5)
    assert not rig.vehicle.points[FENCE]


@pytest.mark.parametrize(
    ("total", "fields", "text"),
    [
        (0, {"idx": 0, "count": 0}, "Invalid fence point, index past total (0 >= 0)"),
        (0, {"idx": 0, "count": 1}, "Invalid fence point, bad count (1 vs 0)"),
        (1, {"idx": 0, "count": 1}, "Invalid FENCE_TOTAL"),
        (5, {"idx": 0, "count": 5, "lat": 91.0}, "Invalid fence point, bad lat or lng"),
    ],
)
def test_points_that_are_refused(total: int, fields: dict[str, Any], text: str, station: Any) -> None:
    rig = station("rover")
    rig.run(0.5)
    rig.vehicle.set_parameter("FENCE_TOTAL", total)
    rig.send("FENCE_POINT", **TARGET, **{"lat": 1.0, "lng": 1.0, **fields})
    rig.run(0.05)
    assert rig.texts()[-1] == text
    assert not rig.vehicle.points.get(FENCE)


def test_without_a_return_point_the_middle_is_sent(station: Any) -> None:
    rig = station("rover")
    rig.run(0.5)
    corner = MissionItem(5001, GLOBAL, param1=4.0)
    rig.vehicle.points[FENCE] = [corner._replace(x=int(n * 1e7), y=int(e * 1e7)) for n, e in CORNERS]
    rig.vehicle.set_parameter("FENCE_TOTAL", 6)
    assert fetched(rig, 0) == pytest.approx((1.5, 1.5), abs=2e-7)


def item(command: int, first: float = 3.0) -> MissionItem:
    return MissionItem(command, GLOBAL, param1=first)


@pytest.mark.parametrize(
    ("points", "text"),
    [
        ([item(5001)] * 3 + [item(5000)], ""),
        ([item(5001)] * 2, "Incorrect item count"),
        ([item(5001), item(5002)], "Received incorrect vertex type (want=98 got=97)"),
        ([item(5001), item(5000)], "Received incorrect type (want=98 got=95)"),
        ([item(5001), item(5001, 4.0)], "Unexpected vertex count want=3 got=4"),
        ([item(5000), item(5000)], "Multiple return points"),
        ([item(5004, 0.0)], "Non-positive circle radius"),
    ],
)
def test_a_list_as_a_whole(points: list[MissionItem], text: str, station: Any) -> None:
    rig = station("rover")
    rig.run(0.5)
    assert refuse_points(rig.vehicle, FENCE, points) is bool(text)
    rig.run(0.05)
    assert not text or rig.texts()[-1] == text
