"""Camera: pictures by command, message, switch, mission item, time and distance, and their reports."""

from __future__ import annotations

from itertools import pairwise
from math import hypot
from typing import Any

import pytest

from volery.simulation.autopilots.ardupilot.servo_outputs import outputs_of

REQUEST_MESSAGE, FEEDBACK, AUX_FUNCTION = 512, 180, 218
CONFIGURE, CONTROL, TRIGGER_DISTANCE, START, STOP = 202, 203, 206, 2000, 2001
CAMERA = {"CAM1_TYPE": 1, "SERVO9_FUNCTION": 10}
PRESSED, RELEASED = 1300, 1100


@pytest.fixture
def rig(station: Any) -> Any:
    """A copter whose camera has a servo."""
    found = station(parameters=CAMERA)
    found.run(0.5)
    return found


def pictures(rig: Any) -> list[int]:
    return [one.fields["img_idx"] for one in rig.of("CAMERA_FEEDBACK")]


def test_a_command_presses_the_trigger_and_reports_the_place(rig: Any) -> None:
    assert outputs_of(rig.vehicle).servos[9] == RELEASED
    assert rig.command(CONTROL, 0, 0, 0, 0, 1) == 0
    assert outputs_of(rig.vehicle).servos[9] == PRESSED
    report = rig.latest["CAMERA_FEEDBACK"]
    assert report["img_idx"] == 1
    assert report["lat"] == pytest.approx(rig.vehicle.estimate.geodetic[0] * 1e7, abs=20)
    rig.run(0.3)
    assert outputs_of(rig.vehicle).servos[9] == RELEASED
    assert rig.command_int(CONTROL, x=1, y=0, z=0.0, frame=0) == 0
    assert rig.command(CONTROL, 0, 0, 0, 0, 0) == 0  # no shooting command
    assert pictures(rig) == [1, 2]


def test_a_switch_and_the_old_message_take_pictures(rig: Any) -> None:
    assert rig.command(AUX_FUNCTION, 9, 2) == 0
    rig.run(0.5)
    old = {"zoom_pos": 0, "zoom_step": 0, "focus_lock": 0, "command_id": 0, "extra_param": 0}
    rig.send(
        "DIGICAM_CONTROL", target_system=1, target_component=1, session=0, shot=1, extra_value=0.0, **old
    )
    rig.run(0.2)
    assert pictures(rig) == [1, 2]


def test_one_that_comes_too_early_is_taken_later(station: Any) -> None:
    rig = station(parameters=CAMERA | {"CAM1_INTRVAL_MIN": 2.0})
    rig.run(0.5)
    for _ in range(3):
        assert rig.command(CONTROL, 0, 0, 0, 0, 1) == 0
    rig.run(1.0)
    assert pictures(rig) == [1]
    rig.run(3.0)
    assert pictures(rig) == [1, 2]


def test_pictures_by_time_end_after_their_number_or_when_stopped(rig: Any) -> None:
    assert rig.command(START, 0, 0.5, 3) == 0
    rig.run(4.0)
    assert pictures(rig) == [1, 2, 3]
    assert rig.command(START, 1, 1.0, 0) == 0
    rig.run(3.0)
    assert len(pictures(rig)) > 4
    assert rig.command(STOP) == 0
    count = len(pictures(rig))
    rig.run(3.0)
    assert len(pictures(rig)) == count


def test_orders_that_are_refused(rig: Any, station: Any) -> None:
    assert rig.command(START, 2, 0, 1) == 4
    assert rig.command(START, -1, 0, 1) == 3
    assert rig.command(STOP, 2) == 3
    without = station()
    without.run(0.3)
    assert without.command(START, 0, 0, 1) == 4
    assert without.command(CONTROL, 0, 0, 0, 0, 1) == 0
    assert pictures(without) == []


def test_the_last_report_is_sent_on_request_and_is_empty_before(rig: Any) -> None:
    assert rig.command(REQUEST_MESSAGE, FEEDBACK) == 0
    assert rig.latest["CAMERA_FEEDBACK"]["img_idx"] == 0


def test_pictures_by_distance(station: Any) -> None:
    rig = station("rover", parameters=CAMERA | {"CAM1_SERVO_ON": 1900})
    rig.run(0.5)
    for command in ((176, 1, 0), (400, 1), (TRIGGER_DISTANCE, 5.0, 0, 1)):
        assert rig.command(*command) == 0
    assert pictures(rig) == [1]
    rig.vehicle.rc.transmitter[2] = 1600
    rig.run(12.0)
    places = [
        (one.fields["lat"] * 0.0111319, one.fields["lng"] * 0.00773) for one in rig.of("CAMERA_FEEDBACK")
    ]
    assert len(places) > 3
    for before, after in pairwise(places[1:]):
        assert 4.8 < hypot(after[0] - before[0], after[1] - before[1]) < 6.5
    count = len(places)
    rig.vehicle.set_parameter("CAM_AUTO_ONLY", 1.0)
    rig.run(4.0)
    assert len(pictures(rig)) == count
    assert rig.command(TRIGGER_DISTANCE, 0.0) == 0
    assert rig.vehicle.parameters["CAM1_TRIGG_DIST"] == 0.0


@pytest.mark.parametrize(("command", "fields"), [(CONTROL, {"x": 1}), (START, {"param3": 1.0})])
def test_a_mission_item_takes_a_picture(command: int, fields: dict[str, Any], station: Any) -> None:
    rig = station("rover", parameters=CAMERA)
    rig.beat()
    rig.run(0.5)
    rig.listed(command, **fields)
    assert rig.command(176, 1, 10) == 0
    assert rig.command(400, 1) == 0
    rig.run(2.0)
    assert pictures(rig) == [1]


def test_components_of_the_vehicle_get_the_commands(station: Any) -> None:
    rig = station(parameters={"CAM1_TYPE": 5})
    rig.run(0.3)
    assert rig.command(CONTROL, 1, 1, 0, 0, 0, 37) == 0
    assert not rig.of("COMMAND_LONG")  # no component has been received
    rig.send("HEARTBEAT", system=1, type=30, autopilot=8)
    rig.run(0.1)
    assert rig.command(CONTROL, 1, 1, 0, 0, 0, 37) == 0
    assert rig.command(CONTROL, 0, 0, 0, 0, 1) == 0
    assert rig.command(CONFIGURE, 1, 1, 0, 0, 12, 38) == 0
    sent = [
        (one.fields["command"], one.fields["param5"], one.fields["param6"]) for one in rig.of("COMMAND_LONG")
    ]
    assert sent == [(CONTROL, 0.0, 37.0), (CONTROL, 1.0, 0.0), (CONFIGURE, 12.0, 38.0)]
    assert pictures(rig) == [1]
