"""A firmware is a core and the features of the list: what is off is not there, what is on acts in order."""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Any

import pytest

import volery.simulation.autopilots.ardupilot
from volery.base.errors import UsageError
from volery.run.assembly.simulated_vehicles import parse_simulated
from volery.simulation.autopilots.ardupilot import FIRMWARE
from volery.simulation.autopilots.ardupilot.copter import arming_problems
from volery.simulation.autopilots.ardupilot.feature import (
    ArmingCheck,
    Feature,
    FeatureSet,
    Kept,
    MissionCommand,
)
from volery.simulation.autopilots.ardupilot.features import OPTIONAL, ORDER, absent, features_of
from volery.simulation.autopilots.fleet_autopilot import firmwares
from volery.vehicles.address import parse

PACKAGE = Path(volery.simulation.autopilots.ardupilot.__file__).parent
AIRFRAME_CONFIGURATION, MODE, MOTOR_TEST, SWITCH = 2520, 176, 209, 218
UNSUPPORTED, FAILED = 3, 4


def imported(path: Path) -> set[str]:
    """Names of the package's modules that a module imports anywhere in it."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            parts = [node.module.rpartition(".")[2], *(name.name for name in node.names)]
            found |= {part for part in parts if (PACKAGE / f"{part}.py").exists()}
    return found


def test_nothing_that_is_on_by_default_imports_what_is_off() -> None:
    on = [path for path in PACKAGE.glob("*.py") if path.stem not in OPTIONAL]
    assert {path.stem: imported(path) & set(OPTIONAL) for path in on} == {path.stem: set() for path in on}


def test_each_entry_of_the_list_is_a_module_with_a_feature() -> None:
    assert len({entry.name for entry in ORDER}) == len(ORDER)
    every = {kind: features_of(kind, OPTIONAL) for kind in ("COPTER", "ROVER")}
    assert len(every["COPTER"]) == len(ORDER)
    assert len(features_of("COPTER", ())) == len(ORDER) - len(OPTIONAL)


@pytest.mark.parametrize("kind", ["multirotor", "rover"])
def test_parameters_of_a_feature_that_is_off_are_absent_and_no_others(kind: str) -> None:
    full = FIRMWARE.with_features("all").kinds[kind].rules.parameters
    usual = FIRMWARE.kinds[kind].rules.parameters
    names, all_names = ([one.name for one in table.defaults()] for table in (usual, full))
    missing = [name for name in all_names if name not in names]
    assert missing == [name for name in all_names if absent(name, ())]
    assert {absent(name, ()) for name in missing} <= set(OPTIONAL)
    assert [name for name in all_names if name in names] == names
    prefixes = tuple(prefix for entry in ORDER for prefix in entry.prefixes)
    assert all(name.startswith(prefixes) for name in missing)
    assert set(usual.supported) <= set(names)


def test_an_unknown_feature_is_refused_with_the_names_that_there_are() -> None:
    with pytest.raises(UsageError, match=r"no feature 'winsh'; off by default: airspeed, all, .*winch"):
        FIRMWARE.with_features("landing_gear,winsh")
    with pytest.raises(UsageError, match="a simulated px4 has no features that are off by default: 'all'"):
        firmwares.load("px4").with_features("all")


def test_versions_and_features_are_chosen_in_any_order() -> None:
    old = FIRMWARE.of_version("4.5").with_features("winch").kinds["multirotor"]
    assert FIRMWARE.with_features("winch").of_version("4.5").kinds["multirotor"] is old
    table, newest = old.rules.parameters, FIRMWARE.with_features("winch").kinds["multirotor"].rules.parameters
    assert newest.renamed
    assert not table.renamed
    assert "WINCH_TYPE" in {one.name for one in table.defaults()}


def test_an_address_names_features() -> None:
    address = parse("sim:ardupilot?features=winch,flip")
    assert parse_simulated(address, "drone").vehicle.features == "winch,flip"


def test_a_parameter_of_a_feature_that_is_off_names_the_feature(station: Any) -> None:
    with pytest.raises(UsageError, match="no parameter 'WINCH_TYPE'; features=winch or features=all adds it"):
        station(parameters={"WINCH_TYPE": 1})
    with pytest.raises(UsageError, match="no parameter 'WINCH_TIPE'"):
        station(parameters={"WINCH_TIPE": 1}, features="winch")


def test_what_is_off_is_refused_as_by_a_firmware_without_it(station: Any) -> None:
    rig = station()
    rig.run(0.5)
    assert rig.command(AIRFRAME_CONFIGURATION, -1, 1) == UNSUPPORTED
    assert rig.command(MOTOR_TEST, 1, 0, 5, 1) == UNSUPPORTED
    assert rig.command(MODE, 1, 18) == FAILED
    assert rig.texts()[-1] == "No such mode 18"
    assert rig.command(SWITCH, 29, 2) == FAILED
    assert rig.texts()[-1] == "Invalid channel option (29)"
    rig.listed(94)
    assert rig.latest["MISSION_ACK"]["type"] == UNSUPPORTED
    assert not [key for key in rig.vehicle.kept if "winch" in str(getattr(key, "__module__", ""))]


def test_features_act_in_the_order_of_the_list(station: Any) -> None:
    said: list[str] = []

    def feature(name: str) -> Feature:
        return Feature(
            messages={"PING": lambda _vehicle, _fields, _sender: said.append(f"{name} heard")},
            on_tick=lambda _vehicle: said.append(f"{name} ticked"),
            checks=(ArmingCheck(f"{name} fails", lambda _vehicle: True),),
            items={1: MissionCommand(name)},
            telemetry={"A": lambda _vehicle: {"by": "a"}} if name == "a" else {},
            amends={"A": lambda _vehicle, fields: {"by": fields["by"] + name}},
            extends={"A": lambda _vehicle: [{"by": name}]},
        )

    build = FeatureSet([feature("a"), feature("b")], arming_problems, ("armed", "disarmed"))
    vehicle = station().vehicle
    build.messages["PING"](vehicle, {}, 1)
    for work in build.ticks:
        work(vehicle)
    assert said == ["a heard", "b heard", "a ticked", "b ticked"]
    assert [check.text for check in build.checks] == ["a fails", "b fails"]
    assert build.items[1].name == "b"
    assert build.telemetry["A"](vehicle) == [{"by": "aab"}, {"by": "a"}, {"by": "b"}]


def test_state_is_kept_until_the_next_boot(station: Any) -> None:
    counts = Kept[list[int]](list)
    vehicle = station().vehicle
    counts(vehicle).append(1)
    assert counts(vehicle) == [1]
    assert counts(station().vehicle) == []
    vehicle.boot(0)
    assert counts(vehicle) == []
