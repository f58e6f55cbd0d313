"""Parameters: listed, read, set, kept; and which of them change what the vehicle does."""

from __future__ import annotations

import re
from collections.abc import Callable
from math import cos, radians
from pathlib import Path
from typing import Any

import pytest

import volery.simulation.autopilots
from rigs.effects import ZEROS, without_effect
from rigs.station import TARGET
from volery.base.errors import UsageError
from volery.simulation.autopilots.ardupilot import FIRMWARE
from volery.simulation.autopilots.ardupilot.parameter_checks import (
    COPTER_PARAMETERS,
    SOURCE_PARAMETERS,
    WHEEL_ENCODER,
)

REAL32, INT8 = 9, 2


def listed(rig: Any) -> list[dict[str, Any]]:
    rig.send("PARAM_REQUEST_LIST", target_system=1, target_component=1)
    rig.run(3.0)
    return [one.fields for one in rig.of("PARAM_VALUE") if one.fields["param_index"] != 65535]


@pytest.mark.parametrize(("kind", "count"), [("copter", 1390), ("rover", 1281)])
def test_the_whole_list_comes_in_order_within_a_second(kind: str, count: int, bench: Any) -> None:
    rig = bench(kind, features="all")
    rig.run(0.5)
    begun = rig.now
    found = listed(rig)
    assert [fields["param_index"] for fields in found] == list(range(count))
    assert {fields["param_count"] for fields in found} == {count}
    assert len({fields["param_id"] for fields in found}) == count
    assert rig.of("PARAM_VALUE")[-1].at - begun < 1.0


@pytest.mark.parametrize(
    ("name", "kind", "value"),
    [
        ("FORMAT_VERSION", 4, 120.0),
        ("FS_GCS_ENABLE", 2, 0.0),
        ("FS_GCS_TIMEOUT", 9, 5.0),
        ("SYSID_MYGCS", 4, 255.0),
        ("RC_OVERRIDE_TIME", 9, 3.0),
        ("INS_GYR_ID", 6, 2752772.0),
        ("ATC_INPUT_TC", 9, 0.15000000596046448),
    ],
)
def test_values_and_types_are_the_recorded_ones(name: str, kind: int, value: float, bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    begun = rig.now
    rig.send("PARAM_REQUEST_READ", target_system=1, target_component=1, param_id=name, param_index=-1)
    rig.run(0.2)
    answer = rig.of("PARAM_VALUE")[-1]
    assert answer.fields["param_id"] == name
    assert answer.fields["param_type"] == kind
    assert answer.fields["param_value"] == value
    assert answer.fields["param_index"] == 65535
    assert answer.at - begun < 0.11


def test_reading_by_index_answers_with_the_index(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    rig.send("PARAM_REQUEST_READ", target_system=1, target_component=1, param_index=2)
    rig.run(0.2)
    assert rig.latest["PARAM_VALUE"]["param_id"] == "SYSID_MYGCS"
    assert rig.latest["PARAM_VALUE"]["param_index"] == 2


def test_an_unknown_parameter_is_not_answered(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    rig.received.clear()
    rig.send("PARAM_REQUEST_READ", target_system=1, target_component=1, param_id="NO_SUCH", param_index=-1)
    rig.send("PARAM_REQUEST_READ", target_system=1, target_component=1, param_index=5000)
    rig.send(
        "PARAM_SET",
        target_system=1,
        target_component=1,
        param_id="NO_SUCH",
        param_value=1.0,
        param_type=REAL32,
    )
    rig.run(0.3)
    assert not rig.of("PARAM_VALUE")


@pytest.mark.parametrize(("given", "kept"), [(3.0, 3.0), (3.4, 3.0), (700.0, 127.0), (-700.0, -128.0)])
def test_a_value_is_kept_in_the_parameters_own_type(given: float, kept: float, bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    rig.send(
        "PARAM_SET",
        target_system=1,
        target_component=1,
        param_id="FS_GCS_ENABLE",
        param_value=given,
        param_type=INT8,
    )
    rig.run(0.05)
    assert rig.latest["PARAM_VALUE"]["param_value"] == kept


def test_numbers_that_are_none_are_not_taken(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    rig.received.clear()
    rig.send(
        "PARAM_SET",
        target_system=1,
        target_component=1,
        param_id="WPNAV_SPEED",
        param_value=float("nan"),
        param_type=REAL32,
    )
    rig.run(0.1)
    assert not rig.of("PARAM_VALUE")


def test_listing_says_who_it_is(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    listed(rig)
    assert rig.texts()[0] == "ArduCopter V4.5.6 (7ce11b41)"
    assert rig.texts()[2] == "Frame: QUAD/PLUS"


def test_a_parameter_that_does_not_exist_is_an_error_with_a_hint(bench: Any) -> None:
    with pytest.raises(UsageError, match=r"WPNAV_SPED.*WPNAV_SPEED"):
        bench(parameters={"WPNAV_SPED": 500})


def test_supported_parameters_exist_and_are_read_and_no_others_are() -> None:
    """The table of supported parameters lists what the code of the firmware reads."""
    room = Path(volery.simulation.autopilots.__file__).parent
    shared = [*room.glob("*.py"), *room.glob("manoeuvres/*.py"), *room.glob("mavlink/*.py")]
    paths = sorted([*shared, *room.glob("ardupilot/*.py")])
    source = "".join(path.read_text(encoding="utf-8") for path in paths)
    kinds = FIRMWARE.with_features("all").kinds
    read = set(re.findall(r'(?:parameters|\bp)\["([A-Z0-9_]+)"', source))
    read |= set(re.findall(r'"(BATT_(?:LOW|CRT)_(?:VOLT|MAH)|BATT_FS_(?:LOW|CRT)_ACT)"', source))
    read |= {
        "RCMAP_ROLL",
        "RCMAP_PITCH",
        "RCMAP_THROTTLE",
        "RCMAP_YAW",
        "DISARM_DELAY",
        "GUID_TIMEOUT",
        "LOIT_BRK_DELAY",
    }
    read |= {
        f"RC{channel}_{part}" for channel in range(1, 17) for part in ("MIN", "TRIM", "MAX", "DZ", "REVERSED")
    }
    read |= {f"RC{channel}_OPTION" for channel in range(5, 17)} | {"FLTMODE_CH", "MODE_CH"}
    read |= {f"{modes}{position}" for modes in ("FLTMODE", "MODE") for position in range(1, 7)}
    read |= {*SOURCE_PARAMETERS, *COPTER_PARAMETERS, WHEEL_ENCODER}
    read |= {f"BTN_{part}{number}" for part in ("PIN", "FUNC", "OPTIONS") for number in range(1, 5)}
    read |= {
        f"SERVO{channel}_{part}"
        for channel in range(1, 17)
        for part in ("FUNCTION", "MIN", "TRIM", "MAX", "REVERSED")
    }
    read |= {f"RELAY{number}_{part}" for number in range(1, 7) for part in ("FUNCTION", "PIN", "DEFAULT")}
    read |= {f"SERIAL{port}_{part}" for port in range(1, 8) for part in ("OPTIONS", "PROTOCOL")}
    read |= {f"MNT1_{axis}_{end}" for axis in ("ROLL", "PITCH", "YAW") for end in ("MIN", "MAX")}
    read |= {f"MNT1_{place}_{axis}" for place in ("RETRACT", "NEUTRAL") for axis in "XYZ"}
    stated = set(kinds["multirotor"].rules.parameters.supported) | set(
        kinds["rover"].rules.parameters.supported
    )
    assert stated == read
    for firmware in kinds.values():
        names = {parameter.name for parameter in firmware.rules.parameters.defaults()}
        assert set(firmware.rules.parameters.supported) <= names


def set_to(rig: Any, name: str, value: float) -> float:
    """Set a parameter and return the value that is reported."""
    rig.send("PARAM_SET", **TARGET, param_id=name, param_value=value, param_type=9)
    rig.run(0.05)
    assert rig.latest["PARAM_VALUE"]["param_id"] == name
    return float(rig.latest["PARAM_VALUE"]["param_value"])


def test_a_simulation_parameter_without_effect_is_refused(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    before = rig.vehicle.parameters["SIM_WIND_TURB"]
    assert set_to(rig, "SIM_WIND_TURB", before + 5.0) == before
    assert rig.texts()[-1] == "Param write denied (SIM_WIND_TURB)"
    assert set_to(rig, "SIM_RC_FAIL", 1.0) == 1.0


def test_wind_by_parameter_leans_the_copter_into_it(bench: Any) -> None:
    rig = bench()
    rig.airborne()
    set_to(rig, "SIM_WIND_DIR", 0.0)
    set_to(rig, "SIM_WIND_SPD", 8.0)
    rig.run(8.0)
    _, pitch, yaw = rig.vehicle.estimate.attitude
    assert -pitch * cos(yaw) > radians(3.0)  # nose down towards the north


def test_satellites_and_motors_fail_by_parameter(bench: Any) -> None:
    rig = bench()
    rig.airborne()
    assert set_to(rig, "SIM_GPS_DISABLE", 1.0) == 1.0
    rig.run_until(lambda: rig.vehicle.mode.name == "LAND", within=20.0)
    assert set_to(rig, "SIM_GPS_DISABLE", 0.0) == 0.0
    set_to(rig, "SIM_ENGINE_MUL", 0.0)
    rig.run(3.0)
    assert rig.flight.truth().position[2] < 3.0


@pytest.mark.parametrize("features", ["", pytest.param("all", marks=pytest.mark.optional)])
@pytest.mark.parametrize("kind", ["copter", "rover"])
def test_what_has_no_effect_is_refused(kind: str, features: str, bench: Any) -> None:
    """Each parameter is set to another value: only those that change what the vehicle does keep it."""
    rig = bench(kind, features=features)
    rig.run(0.5)
    kept = set()
    table = rig.autopilot.firmware.rules.parameters
    for name, *_ in table.defaults():
        now = rig.vehicle.parameters[name]
        rig.send("PARAM_SET", **TARGET, param_id=name, param_value=0.0 if now else 1.0, param_type=9)
        rig.run(0.006)
        if rig.vehicle.parameters[name] != now:
            kept.add(name)
            rig.vehicle.parameters.set(name, now)
    assert kept == set(table.supported)


def test_calibration_and_storage_do_what_they_say_or_nothing(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    for given in ((42424, 0), (42425, 0), (241, 0), (241, 0, 0, 0, 0, 1), (245, 0)):
        assert rig.command(*given) != 0
    assert rig.command(241, 1) == rig.command(241, 0, 0, 1) == 0
    set_to(rig, "RTL_ALT", 3000.0)
    assert rig.command(245, 2) == 0
    assert rig.texts()[-1] == "All parameters reset, reboot board"
    assert rig.vehicle.parameters["RTL_ALT"] == 3000.0
    rig.command(246, 1)
    assert rig.vehicle.parameters["RTL_ALT"] == 1500.0


def at_rest(rig: Any) -> None:
    """Nothing is done before."""


def having(**parameters: float) -> Callable[[Any], None]:
    """Parameters are set before."""

    def prepare(rig: Any) -> None:
        for name, value in parameters.items():
            assert rig.vehicle.set_parameter(name, value)

    return prepare


def armed(rig: Any) -> None:
    """It is armed in GUIDED."""
    assert rig.command(176, 1, 15 if rig.autopilot.firmware.kind == "rover" else 4) == 0
    assert rig.command(400, 1) == 0


def with_a_region(rig: Any) -> None:
    """The nose points to a place."""
    rig.command(195, 0, 0, 0, 0, -35.0, 149.0, 600.0)


EXAMPLES = {
    181: ((0.0, 1.0), at_rest),
    185: ((1.0,), armed),
    197: (ZEROS, with_a_region),
    216: ((1.0,), having(SPRAY_ENABLE=1.0, SERVO9_FUNCTION=22.0)),
    218: ((4.0, 2.0), at_rest),
    511: ((30.0, 10_000.0), at_rest),
    2520: ((-1.0, 1.0), having(LGR_ENABLE=1.0, SERVO10_FUNCTION=29.0)),
    42007: ((2.0,), at_rest),
}
ACCEPTED_WITHOUT_EFFECT = {
    202: "AP_Camera: configuring is accepted by every backend, also where there is none",
    203: "AP_Camera: control is accepted without a camera, too",
    401: "reports what forbids arming, and nothing does; accepted, as recorded",
    2001: "AP_Camera: the end of pictures is accepted without a camera, too",
    42426: "AP_Compass: cancelling is accepted where no calibration is under way",
}
"""With the source: ArduPilot's libraries at 64a9c7877b, and the recordings."""


@pytest.mark.parametrize("features", ["", pytest.param("all", marks=pytest.mark.optional)])
@pytest.mark.parametrize("kind", ["copter", "rover"])
def test_a_command_without_effect_is_refused(kind: str, features: str, bench: Any) -> None:
    def ready() -> Any:
        rig = bench(kind, features=features)
        rig.send("HEARTBEAT", type=6, autopilot=8)
        rig.run(1.52)
        return rig

    assert without_effect(ready, {"PARAM_VALUE"}, EXAMPLES) == set(ACCEPTED_WITHOUT_EFFECT)
