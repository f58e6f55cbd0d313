"""The proximity sensor: which messages count, its reports, its health, and the sensor of the fence."""

from __future__ import annotations

from math import cos, nan, radians, sin
from pathlib import Path
from typing import Any

import pytest
from pymavlink import DFReader

from volery.simulation.autopilots.ardupilot.dataflash import encode
from volery.simulation.autopilots.ardupilot.feature import build_of
from volery.simulation.autopilots.ardupilot.proximity import edges
from volery.simulation.autopilots.ardupilot.versions import V4_5

ARM, REQUEST, PREARM = 400, 512, 401
BY_MESSAGES = {"PRX1_TYPE": 2, "ARMING_CHECK": 1}
PROXIMITY = 1 << 26


@pytest.fixture
def sensing(station: Any) -> Any:
    """Makes a copter with a proximity sensor."""

    def made(**parameters: float) -> Any:
        rig = station(parameters={**BY_MESSAGES, **parameters})
        rig.run(0.5)
        return rig

    return made


def measure(rig: Any, cm: int, orientation: int = 0, stamp: int | None = None) -> None:
    """Send one distance."""
    fields = {"min_distance": 10, "max_distance": 1000, "current_distance": cm, "orientation": orientation}
    stamp = round(rig.now * 1000) if stamp is None else stamp
    rig.send("DISTANCE_SENSOR", time_boot_ms=stamp, type=0, id=1, covariance=255, **fields)
    rig.run(0.1)


def point(rig: Any, x: float, y: float, z: float, **fields: Any) -> None:
    """Send one obstacle, twice, as the second message makes the first count."""
    given = {"frame": 12, "min_distance": 0.0, "max_distance": 20.0, "sensor_type": 0, "obstacle_id": 65_535}
    for _ in range(2):
        stamp = round(rig.now * 1000)
        rig.send("OBSTACLE_DISTANCE_3D", time_boot_ms=stamp, x=x, y=y, z=z, **{**given, **fields})
        rig.run(0.1)


def sectors(rig: Any, distances: dict[int, int], **fields: Any) -> None:
    """Send a ring of distances [cm] by place."""
    ring = [distances.get(place, 65_535) for place in range(72)]
    given = {"min_distance": 20, "max_distance": 1000, "increment": 5, "sensor_type": 0, "frame": 12}
    offset = {"angle_offset": 0.0, "increment_f": 0.0, **fields}
    rig.send("OBSTACLE_DISTANCE", time_usec=0, distances=ring, **{**given, **offset})
    rig.run(0.05)


def reported(rig: Any) -> dict[int, int]:
    """Return the distances [cm] that are reported now, by orientation."""
    rig.received.clear()
    assert rig.command(REQUEST, 132) == 0
    return {one.fields["orientation"]: one.fields["current_distance"] for one in rig.of("DISTANCE_SENSOR")}


def test_distances_with_one_time_stamp_count_when_the_next_comes(sensing: Any) -> None:
    rig = sensing()
    measure(rig, 300, 0)
    assert reported(rig) == {}
    measure(rig, 400, 2)
    assert reported(rig) == {0: 300}
    measure(rig, 300, 4)
    assert reported(rig) == {0: 300, 2: 400}
    assert rig.latest["DISTANCE_SENSOR"]["id"] == 12


def test_a_distance_out_of_range_does_not_count(sensing: Any) -> None:
    rig = sensing(PRX1_MIN=1.0, PRX1_MAX=8.0)
    for orientation, cm in enumerate((5, 1200, 90, 850, 700)):
        measure(rig, cm, orientation)
    measure(rig, 200, 7)
    assert reported(rig) == {4: 700}


def test_a_distance_is_forgotten_after_a_second(sensing: Any) -> None:
    rig = sensing()
    measure(rig, 300)
    measure(rig, 300)
    rig.run(0.8)
    assert reported(rig) == {0: 300}
    rig.run(0.3)
    assert reported(rig) == {}


@pytest.mark.parametrize("angle", range(0, 360, 15))
def test_a_point_counts_in_its_direction(angle: int, sensing: Any) -> None:
    rig = sensing()
    point(rig, 15.0 * cos(radians(angle)), 15.0 * sin(radians(angle)), 0.0)
    assert reported(rig) == {int((angle + 22.5) / 45) % 8: pytest.approx(1500, abs=1)}


@pytest.mark.parametrize(
    ("x", "z", "fields"),
    [
        (5.0, 3.0, {}),
        (5.0, 0.0, {"frame": 1}),
        (25.0, 0.0, {}),
        (nan, 0.0, {}),
        (5.0, 0.0, {"max_distance": nan}),
        (0.0, 0.0, {}),
    ],
    ids=["above", "another frame", "too far", "no number", "no number as limit", "here"],
)
def test_a_point_that_does_not_count(x: float, z: float, fields: dict[str, Any], sensing: Any) -> None:
    rig = sensing()
    point(rig, x, 0.0, z, **fields)
    assert reported(rig) == {}


def test_the_nearest_distance_of_a_direction_counts(sensing: Any) -> None:
    rig = sensing()
    sectors(rig, {0: 500, 3: 400, 18: 600, 36: 10, 40: 2000})
    assert reported(rig) == {0: 400, 2: 600}
    sectors(rig, {18: 700})
    assert reported(rig) == {2: 700}


@pytest.mark.parametrize(
    ("parameters", "fields", "direction"),
    [
        ({}, {"angle_offset": 45.0}, 3),
        ({"PRX1_YAW_CORR": -45}, {}, 1),
        ({"PRX1_ORIENT": 1}, {}, 6),
        ({}, {"increment_f": 2.5}, 1),
    ],
)
def test_angles_of_a_ring(
    parameters: dict[str, float], fields: dict[str, float], direction: int, sensing: Any
) -> None:
    rig = sensing(**parameters)
    sectors(rig, {18: 600}, **fields)
    assert reported(rig) == {direction: 600}


@pytest.mark.parametrize("fields", [{"increment": 0}, {"angle_offset": nan}, {"increment_f": nan}])
def test_a_ring_without_angles_is_ignored(fields: dict[str, Any], sensing: Any) -> None:
    rig = sensing()
    sectors(rig, {0: 500}, **fields)
    assert reported(rig) == {}


def test_a_distance_above(sensing: Any) -> None:
    rig = sensing()
    measure(rig, 250, 24)
    assert reported(rig) == {24: 250}
    rig.run(0.6)
    assert reported(rig) == {}


def test_a_silent_sensor_forbids_arming(sensing: Any) -> None:
    rig = sensing()
    assert rig.command(PREARM) is not None
    assert "PreArm: PRX1: No Data" in rig.texts()
    rig.command(REQUEST, 1)
    assert not rig.latest["SYS_STATUS"]["onboard_control_sensors_health"] & PROXIMITY
    rig.received.clear()
    measure(rig, 300)
    rig.command(PREARM)
    assert "PreArm: PRX1: No Data" not in rig.texts()
    rig.command(REQUEST, 1)
    assert rig.latest["SYS_STATUS"]["onboard_control_sensors_health"] & PROXIMITY


def test_an_obstacle_beside_the_copter_forbids_arming(sensing: Any) -> None:
    rig = sensing()
    measure(rig, 50, 2)
    measure(rig, 50, 2)
    rig.command(PREARM)
    assert "PreArm: Proximity 90 deg, 0.50m (want > 0.6m)" in rig.texts()


def test_without_a_sensor_messages_do_not_count(station: Any) -> None:
    rig = station()
    rig.run(0.5)
    rig.vehicle.set_parameter("PRX1_TYPE", 2)  # from the next boot on
    for _ in range(3):
        measure(rig, 50)
        point(rig, 5.0, 0.0, 0.0)
        sectors(rig, {0: 500})
    assert reported(rig) == {}
    rig.command(REQUEST, 1)
    assert rig.latest["SYS_STATUS"]["onboard_control_sensors_health"] & PROXIMITY  # as recorded


def test_the_sensor_of_the_fence(station: Any) -> None:
    rig = station("rover", parameters={"PRX1_TYPE": 10})
    rig.run(0.5)
    assert reported(rig) == {}
    corners = [
        rig.home.from_ned((north, east, 0.0)) for north, east in ((30, 20), (30, -20), (-10, -20), (-10, 20))
    ]
    target = {"target_system": 1, "target_component": 1, "mission_type": 1}
    rig.send("MISSION_COUNT", **target, count=4)
    for number, (latitude, longitude, _) in enumerate(corners):
        rig.run(0.05)
        place = {"x": round(latitude * 1e7), "y": round(longitude * 1e7), "z": 0.0}
        blank = dict.fromkeys(("param2", "param3", "param4"), 0.0)
        item = {"command": 5001, "param1": 4.0, "frame": 3, "current": 0, "autocontinue": 1}
        rig.send("MISSION_ITEM_INT", **target, seq=number, **item, **blank, **place)
    rig.run(0.5)
    found = reported(rig)
    assert {0, 2, 4, 6} < set(found)
    assert [found[one] for one in (0, 2, 4, 6)] == pytest.approx([3000, 2000, 1000, 2000], abs=60)


def test_the_boundary_goes_on_beside_an_obstacle(sensing: Any) -> None:
    rig = sensing()
    assert edges(rig.vehicle) == []
    measure(rig, 300)
    measure(rig, 300)
    (start, _), _, (_, end) = sorted(edges(rig.vehicle), key=lambda edge: edge[0][1])
    far = 3.0 * cos(radians(67.5)), 3.0 * sin(radians(67.5))
    assert start == pytest.approx((far[0], -far[1]))
    assert end == pytest.approx(far)


def test_the_log_on_board_has_the_distances(station: Any, tmp_path: Path) -> None:
    given = {"PRX_LOG_RAW": 1, "PRX_FILT": 0, "ARMING_CHECK": 0}
    rig = station(parameters={**BY_MESSAGES, **given}, logging=True)
    rig.run(0.5)
    assert rig.command(ARM, 1.0) == 0
    for _ in range(5):
        measure(rig, 300, 2)
    rig.run(0.3)
    assert rig.command(ARM, 0.0) == 0
    rig.run(0.3)
    file = tmp_path / "1.bin"
    file.write_bytes(encode(rig.vehicle.logs[0], V4_5, build_of(rig.vehicle).log_forms))
    found: dict[str, Any] = {}
    log = DFReader.DFReader_binary(str(file))
    while (message := log.recv_msg()) is not None:
        found[message.get_type()] = message
    last = found["PRX"]
    assert (last.Layer, last.He, last.D90, last.D0) == (2, 2, 3.0, 10.0)
    assert (last.CAn, last.CDis) == (90.0, 3.0)
    assert (found["PRXR"].D90, found["PRXR"].D0) == (3.0, 10.0)
