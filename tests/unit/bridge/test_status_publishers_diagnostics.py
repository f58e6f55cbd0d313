"""``/diagnostics``: how the vehicle is, in MAVROS's statuses."""

from typing import Any

import pytest

from volery.base.time import MS, S

from .conftest import BridgeRig

OK, WARN, ERROR, STALE = range(4)
WELL = {
    "onboard_control_sensors_present": 0x3F,
    "onboard_control_sensors_enabled": 0x2F,
    "onboard_control_sensors_health": 0x2F,
    "load": 123,
    "voltage_battery": 12600,
    "current_battery": 1500,
    "battery_remaining": 87,
    "drop_rate_comm": 0,
    "errors_comm": 0,
    "errors_count1": 0,
    "errors_count2": 0,
    "errors_count3": 0,
    "errors_count4": 0,
}


@pytest.fixture
def received(rig: BridgeRig) -> list[Any]:
    messages: list[Any] = []
    rig.user.subscribe("/diagnostics", "diagnostic_msgs/DiagnosticArray", messages.append)
    return messages


def last(received: list[Any]) -> dict[str, tuple[int, str]]:
    return {one.name.partition(": ")[2]: (one.level, one.message) for one in received[-1].status}


def values(received: list[Any], name: str) -> dict[str, str]:
    [status] = [one for one in received[-1].status if one.name == f"drone_1/mavros: {name}"]
    return {one.key: one.value for one in status.values}


def test_missing_data_is_stale(rig: BridgeRig, received: list[Any]) -> None:
    rig.connect()
    found = last(received)
    assert found["FCU connection"] == (OK, "connected")
    assert found["Heartbeat"] == (OK, "Normal")
    assert found["System"] == found["Battery"] == (STALE, "no SYS_STATUS yet")
    assert found["GPS"] == (STALE, "no GPS_RAW_INT yet")


def test_a_healthy_vehicle(rig: BridgeRig, received: list[Any]) -> None:
    rig.connect()
    rig.emit("SYS_STATUS", **WELL)
    rig.emit("GPS_RAW_INT", fix_type=3, satellites_visible=11, eph=80)
    rig.connect()
    assert {level for level, _ in last(received).values()} == {OK}
    assert values(received, "Battery") == {"Voltage": "12.60", "Current": "15.0", "Remaining": "87"}
    assert values(received, "GPS")["Satellites visible"] == "11"
    assert values(received, "System")["CPU Load (%)"] == "12.3"
    assert values(received, "Heartbeat")["Mode"] == "STABILIZE"


def test_problems_are_reported(rig: BridgeRig, received: list[Any]) -> None:
    rig.connect()
    ill = {**WELL, "onboard_control_sensors_health": 0x0F, "battery_remaining": 12}
    rig.emit("SYS_STATUS", **ill)
    rig.emit("GPS_RAW_INT", fix_type=1, satellites_visible=4, eph=65535)
    rig.run(200 * MS)
    rig.heartbeat(system_status=5)
    rig.run(200 * MS)
    found = last(received)
    assert found["System"] == (ERROR, "sensors are not well: 0x00000020")
    assert found["Battery"] == (WARN, "below 20 %")
    assert found["GPS"] == (WARN, "No fix")
    assert found["Heartbeat"] == (ERROR, "critical")


def test_an_autopilot_that_stops_sending(rig: BridgeRig, received: list[Any]) -> None:
    rig.connect()
    rig.run(12 * S)
    assert last(received) == {"FCU connection": (ERROR, "not connected")}
