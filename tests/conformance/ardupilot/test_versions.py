"""What differs between 4.5 and 4.8: recorded of 4.5.6 and of 4.8.0-dev, and nothing else differs."""

from __future__ import annotations

from math import radians
from typing import Any

import pytest

from rigs.station import TARGET
from volery.base.errors import UsageError
from volery.simulation.autopilots.ardupilot import FIRMWARE
from volery.simulation.autopilots.ardupilot.versions import RENAMED_IN_4_7

NAMES = (
    ("SYSID_MYGCS", "MAV_GCS_SYSID", 255.0, 255.0),
    ("SYSID_THISMAV", "MAV_SYSID", 1.0, 1.0),
    ("WPNAV_SPEED", "WP_SPD", 1000.0, 10.0),
    ("RTL_ALT", "RTL_ALT_M", 1500.0, 15.0),
    ("LAND_SPEED", "LAND_SPD_MS", 50.0, 0.5),
    ("ARMING_CHECK", "ARMING_SKIPCHK", 1.0, 0.0),
    ("ANGLE_MAX", "ATC_ANGLE_MAX", 3000.0, 30.0),
    ("PILOT_SPEED_UP", "PILOT_SPD_UP", 250.0, 2.5),
)
"""Names and values of both versions, as recorded."""
DOES_NOT_EXIST, VALUE_OUT_OF_RANGE, PERMISSION_DENIED = 1, 2, 3


@pytest.fixture(params=["4.5", "4.8"])
def rig(request: Any, bench: Any) -> Any:
    class Versioned(bench):  # type: ignore[misc]
        firmware = FIRMWARE.of_version(request.param)
        version = request.param

    made = Versioned()
    made.beat()
    made.run(1.0)
    return made


def answered(rig: Any, message: str, **fields: Any) -> list[Any]:
    before = len(rig.received)
    rig.send(message, **TARGET, **fields)
    rig.run(0.2)
    return [one for one in rig.received[before:] if one.name in ("PARAM_VALUE", "PARAM_ERROR")]


def read(rig: Any, name: str) -> float | None:
    """The value of a parameter; ``None`` if it does not exist, which only 4.8 says."""
    found = answered(rig, "PARAM_REQUEST_READ", param_id=name, param_index=-1)
    if found and found[0].name == "PARAM_VALUE":
        return float(found[0].fields["param_value"])
    errors = [(one.fields["param_id"], one.fields["param_index"], one.fields["error"]) for one in found]
    assert errors == ([] if rig.version == "4.5" else [(name, -1, DOES_NOT_EXIST)])
    return None


def test_each_version_has_its_own_names_and_units(rig: Any) -> None:
    for old, new, centimetres, metres in NAMES:
        there, gone, value = (old, new, centimetres) if rig.version == "4.5" else (new, old, metres)
        assert read(rig, there) == value
        assert read(rig, gone) is None
    assert read(rig, "NO_SUCH_PARAM") is None
    rig.send("PARAM_REQUEST_LIST", **TARGET)
    rig.run(2.0)
    listed = {one.fields["param_id"] for one in rig.of("PARAM_VALUE")}
    shown = set(RENAMED_IN_4_7) if rig.version == "4.5" else {one.name for one in RENAMED_IN_4_7.values()}
    other = {one.name for one in RENAMED_IN_4_7.values()} if rig.version == "4.5" else set(RENAMED_IN_4_7)
    assert len(listed & shown) > 100
    assert not listed & other


def test_what_a_parameter_does_is_the_same_under_both_names(rig: Any) -> None:
    for old, new, value, internal in (
        ("WPNAV_SPEED", "WP_SPD", 3.0, 300.0),
        ("RTL_ALT", "RTL_ALT_M", 22.0, 2200.0),
        ("ARMING_CHECK", "ARMING_SKIPCHK", -1.0, 0.0),
        ("ARMING_CHECK", "ARMING_SKIPCHK", 5.0, 1.0),
        ("SIM_GPS_DISABLE", "SIM_GPS1_ENABLE", 0.0, 1.0),
    ):
        name, sent = (old, internal) if rig.version == "4.5" else (new, value)
        answered(rig, "PARAM_SET", param_id=name, param_value=sent, param_type=9)
        assert read(rig, name) == sent
        assert rig.vehicle.parameters[old] == internal
    assert rig.vehicle.tuning.speed == 3.0


def test_a_parameter_that_cannot_be_set_is_reported_by_the_newer_one(rig: Any) -> None:
    newer = rig.version == "4.8"
    for name, value, error, kept in (
        ("NO_SUCH_PARAM", 1.0, DOES_NOT_EXIST, 0),
        ("FS_OPTIONS", float("nan"), VALUE_OUT_OF_RANGE, 0),
        ("SIM_WIND_TURB", 3.0, PERMISSION_DENIED, 1),
    ):
        found = answered(rig, "PARAM_SET", param_id=name, param_value=value, param_type=9)
        errors = [one.fields["error"] for one in found if one.name == "PARAM_ERROR"]
        assert errors == ([error] if newer else [])
        assert len(found) - len(errors) == kept


@pytest.mark.parametrize(("mask", "flies"), [(0b011, "4.5"), (0b111, "both"), (0, "both")])
def test_body_rates_count_all_or_none_from_4_6_on(rig: Any, mask: int, flies: str) -> None:
    """Recorded of 4.8.0-dev: with the yaw rate alone the copter stays where it is."""
    assert rig.mode(4) == 0
    assert rig.command(400, 1) == 0
    assert rig.command(22, 0, 0, 0, 0, 0, 0, 10) == 0
    rig.run_until(lambda: rig.height > 9.5)
    rig.run(3.0)
    for _ in range(30):
        rig.send(
            "SET_ATTITUDE_TARGET", **TARGET, type_mask=mask, q=(0.9961947, 0.0, -0.0871557, 0.0), thrust=0.5
        )
        rig.run(0.1)
    pitch = rig.vehicle.estimate.attitude[1]
    assert (pitch < radians(-5.0)) == (flies in ("both", rig.version))


def test_each_version_states_itself(rig: Any) -> None:
    assert rig.command(512, 148) == 0
    rig.run(0.1)
    stated = rig.latest["AUTOPILOT_VERSION"]
    number, commit = {"4.5": (67_438_335, b"7ce11b41"), "4.8": (67_633_152, b"64a9c787")}[rig.version]
    assert (stated["flight_sw_version"], bytes(stated["flight_custom_version"])) == (number, commit)
    assert rig.command(42428) == 0
    rig.run(0.1)
    title = {"4.5": "V4.5.6", "4.8": "V4.8.0-dev"}[rig.version]
    assert rig.texts()[-3] == f"ArduCopter {title} ({commit.decode()})"


def test_a_parameter_by_its_former_name_is_refused_with_the_new_one(bench: Any) -> None:
    class Newest(bench):  # type: ignore[misc]
        firmware = FIRMWARE

    with pytest.raises(UsageError, match="no parameter 'WPNAV_SPEED'; it is WP_SPD now"):
        Newest(parameters={"WPNAV_SPEED": 500.0})
    assert Newest(parameters={"RTL_ALT_M": 20.0}).vehicle.parameters["RTL_ALT"] == 2000.0
    with pytest.raises(UsageError, match="MAV_SYSID has no effect"):
        Newest(parameters={"MAV_SYSID": 7.0})
