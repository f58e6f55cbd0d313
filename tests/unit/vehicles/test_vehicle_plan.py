"""Plans as files: versions, numbers, jumps, places and other parameters, and files of other stations."""

from __future__ import annotations

import json
from math import nan
from pathlib import Path
from typing import Any

import pytest

from volery.base.errors import OutOfBounds, Refused, UsageError
from volery.base.position import AboveHome, Position
from volery.run.connect import attach, connect
from volery.vehicles import Rover
from volery.vehicles.drivers.mavlink.services import item_fields
from volery.vehicles.services import PlanItem
from volery.vehicles.vehicle_plan import Plan

NONE = (0.0, 0.0, 0.0, 0.0)
TAKEOFF, WAYPOINT, JUMP, DIGICAM = 22, 16, 177, 203


def entry(command: int, *params: float | None, frame: int = 3, **more: Any) -> dict[str, Any]:
    return {"type": "SimpleItem", "command": command, "frame": frame, "params": list(params), **more}


def document(*items: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {"fileType": "Plan", "version": 1, "mission": {"version": 2, "items": list(items)}, **more}


@pytest.fixture
def read(tmp_path: Path) -> Any:
    def read(content: Any) -> Plan:
        file = tmp_path / "some.plan"
        file.write_text(content if isinstance(content, str) else json.dumps(content))
        return Plan.read(file)

    return read


PLACE = (46.0825, -103.8995, 20.0)
UP = entry(TAKEOFF, 0, 0, 0, None, *PLACE)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (document(UP) | {"version": 3}, "a plan of version 3; 1 is read"),
        ({"fileType": "Plan", "version": 1, "mission": {"version": 1}}, "mission of version 1"),
        (document(geoFence={"version": 1, "polygon": []}), "a geofence of version 1"),
        (document(rallyPoints={"version": 3}), "a list of rally points of version 3"),
        (document(entry(WAYPOINT, 0, 0, 0, None, 46.0, -103.0, None)), "has a place and no altitude"),
        ('{"fileType": "Plan", "mission": {"items": [{"type": "SimpleItem", "command": 1e400, '
         '"frame": 3, "params": [0,0,0,null,46.0,-103.0,10]}]}}', "no plan of QGroundControl: OverflowError"),
        ('{"fileType": "Plan", "mission": {"items": [{"type": "SimpleItem", "command": 16, '
         f'"frame": 3, "params": [1{"0" * 400},0,0,null,46.0,-103.0,10]}}]}}}}', "OverflowError"),
        (document(entry(DIGICAM, *NONE, 1.5, 0, 0)), "parameter 5 = 1.5; MAVLink carries whole numbers"),
        (document(entry(70_000, *NONE, 0, 0, 0)), "MAVLink has no such command or frame"),
        (document(entry(1e308, *NONE, 0, 0, 0)), r"item 1 \(command 1e\+308, frame 3\): MAVLink has no such"),
        (document(UP, entry(JUMP, 9, 1, 0, 0, 0, 0, 0, frame=2, doJumpId=2)), "jumps to doJumpId 9"),
        (document(entry(WAYPOINT, *NONE, 128.0, 0.0, 5.0)), "latitude 128.0 is off the globe"),
        ("QGC WPL 110\n0\t1\t0\t16\n", "line 2: '0\\\\t1\\\\t0\\\\t16' is no item"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named(read: Any, content: Any, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        read(content)


def test_an_item_of_the_api_with_a_place_has_an_altitude() -> None:
    with pytest.raises(UsageError, match="has a place and no altitude"):
        Plan((PlanItem(WAYPOINT, 3, NONE, 46.0, -103.0, nan),))


def test_a_home_of_unknown_height_is_none(read: Any) -> None:
    plan = document(UP)
    plan["mission"]["plannedHomePosition"] = [46.0, -103.0, None]
    assert read(plan).home is None


def test_jumps_lead_to_ids_and_not_to_places(read: Any) -> None:
    ids = (1, 3, 4, 5)
    items = [entry(WAYPOINT, *NONE, *PLACE, doJumpId=one) for one in ids[:3]]
    plan = read(document(*items, entry(JUMP, 4, 2, 0, 0, 0, 0, 0, frame=2, doJumpId=5)))
    assert plan.mission[3].parameters[:2] == (3.0, 2.0)


def test_parameters_of_a_command_without_a_place_are_none(read: Any) -> None:
    """Found with DO_DIGICAM_CONTROL, whose shot became 10000000, and with 128 as flags of a gimbal."""
    plan = read(document(entry(DIGICAM, *NONE, 1, 7, 0, frame=2), entry(1000, *NONE, 128, 0, 1, frame=0)))
    fields = [item_fields(item, number, 0) for number, item in enumerate(plan.mission)]
    assert [(one["x"], one["y"]) for one in fields] == [(1, 7), (128, 0)]
    there = item_fields(PlanItem(WAYPOINT, 3, NONE, *PLACE), 0, 0)
    assert (there["x"], there["y"]) == (460_825_000, -1_038_995_000)
    start = read(document(entry(189, *NONE, 47.397, 8.5, 0, frame=2))).mission[0]  # a place that PX4 ignores
    assert (start.latitude, item_fields(start, 0, 0)["x"]) == (47.397, 47)
    local = item_fields(PlanItem(WAYPOINT, 1, NONE, 12.5, -3.0, 5.0), 0, 0)
    assert (local["x"], local["y"]) == (125_000, -30_000)


def test_a_file_of_mission_planner(read: Any) -> None:
    plan = read(
        "QGC WPL 110\n"
        "0\t1\t0\t16\t0\t0\t0\t0\t46.0825\t-103.8995\t900\t1\n"
        "1\t0\t3\t22\t0\t0\t0\t0\t46.0826\t-103.8995\t20\t1\n"
        "2\t0\t3\t203\t0\t0\t0\t0\t1\t7\t0\t1\n"
        "3\t0\t3\t177\t2\t1\t0\t0\t0\t0\t0\t1\n"
    )
    assert str(plan.home) == "46.0825000, -103.8995000, 900 m AMSL"
    assert [item.command for item in plan.mission] == [22, 203, 177]
    assert plan.mission[1].latitude == 1.0
    assert plan.mission[2].parameters[0] == 2.0


def test_a_place_of_return_and_frames_are_kept(tmp_path: Path) -> None:
    back = Position(46.0, -103.0, AboveHome(30.0))
    plan = Plan((PlanItem(WAYPOINT, 10, NONE, *PLACE),), breach_return=back, autopilot=3, vehicle=10)
    file = tmp_path / "kept.plan"
    plan.write(file)
    assert json.loads(file.read_text())["mission"]["items"][0]["AltitudeMode"] == 4
    found = Plan.read(file)
    assert (found.mission, found.breach_return, found.autopilot, found.vehicle) == (plan.mission, back, 3, 10)


def test_a_file_that_cannot_be_written_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "kept.plan"
    Plan().write(file)
    before = file.read_text()

    def full(path: Path, text: str) -> None:
        path.write_text(text[:10])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("volery.base.files.write_text", full)
    with pytest.raises(UsageError, match="No space left on device"):
        Plan((PlanItem(WAYPOINT, 3, NONE, *PLACE),)).write(file)
    assert file.read_text() == before
    assert list(tmp_path.iterdir()) == [file]


# -- on board


def test_a_refused_item_is_named_and_rally_points_are_bounded() -> None:
    up = PlanItem(TAKEOFF, 3, NONE, *PLACE)
    with connect("sim:ardupilot?start=warm") as drone:
        drone.wait_ready()
        with pytest.raises(Refused, match=r"does not take item 2, MAV_CMD_NAV_FOLLOW \(25\) in a mission"):
            drone.plan.upload(Plan((up, PlanItem(25, 3, NONE, *PLACE))), only="mission")
        far = Position(PLACE[0], PLACE[1], AboveHome(-1000.0))
        with pytest.raises(OutOfBounds, match="rally point 1"):
            drone.plan.upload(Plan(rally=(far,)), only="rally")


@pytest.mark.parametrize(
    ("autopilot", "kind", "head"),
    [("ardupilot", "drone", (3, 2)), ("ardupilot", "rover", (3, 10)), ("px4", "drone", (12, 2))],
)
def test_a_downloaded_plan_is_of_its_vehicle(autopilot: str, kind: str, head: tuple[int, int]) -> None:
    url = f"sim:{autopilot}?start=warm&kind={'rover' if kind == 'rover' else 'multirotor'}"
    with connect(url, Rover) if kind == "rover" else connect(url) as vehicle:
        vehicle.wait_ready()
        vehicle.plan.upload(Plan((PlanItem(WAYPOINT, 3, NONE, *PLACE),)), only="mission")
        found = vehicle.plan.download()
        assert (found.autopilot, found.vehicle) == head
        assert found.home is not None
        assert found.home.altitude.metres == pytest.approx(900.0, abs=5.0)


def test_attached_without_a_position_home_comes_with_the_mission() -> None:
    with attach("sim:ardupilot") as vehicle:
        assert vehicle.plan.download(only="mission").mission == ()
