"""What differs between two variants, in terms of the model."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from volery.model.differences import differences
from volery.model.system_loader import load
from volery.run.assembly.model_checks import vocabulary

DELIVERY = Path(__file__).parents[3] / "examples" / "delivery"


@pytest.fixture(scope="module")
def delivery():
    return load(DELIVERY, vocabulary())


def changed(delivery, *overrides):
    return [str(one) for one in differences(delivery, load(DELIVERY, vocabulary(), overrides=overrides))]


def test_nothing_differs_from_itself(delivery):
    assert differences(delivery, load(DELIVERY, vocabulary())) == ()


def test_an_allocation_differs_by_its_frequencies(delivery):
    found = differences(delivery, load(DELIVERY, vocabulary(), allocation="slow"))
    assert [one.name for one in found] == [f"onboard_{one}" for one in ("1", "2", "depot", "north", "east")]
    assert str(found[0]) == "processor onboard_1: frequency 1500 MHz → 600 MHz"


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("application.landing_1.active.priority=9", "instance landing_1: activity.priority 8 → 9"),
        (
            "components.DroneControl.active.period=50 ms",
            "component DroneControl: activity.period 100 ms → 50 ms",
        ),
        (
            "environment.vehicles.drone_1.battery=8 Ah",
            "environment: vehicles.drone_1.battery.capacity 10 Ah → 8 Ah",
        ),
        ("platform.networks.radio.loss=1 %", "network radio: loss 0.005 → 0.01"),
        ("requirements.battery_1=null", "requirement battery_1: removed"),
        ("allocations.fast.planner=onboard_1", "instance planner: processor ground → onboard_1"),
        ("environment.places.store.east=25 m", None),
        (
            "application.drone_control_1.landing=landing_2.service",
            "instance drone_control_1: connections.landing landing_1.service → landing_2.service",
        ),
    ],
)
def test_one_change(delivery, override, expected):
    found = changed(delivery, override)
    if expected is None:
        expected = "environment: places.store 20 m east, -30 m north, store → 25 m east, -30 m north, store"
    assert expected in found
    assert len(found) <= 6, found


def test_what_follows_from_a_component_is_one_difference(delivery):
    found = changed(delivery, "components.PrecisionLanding.parameters.gain=0.5")
    assert found == ["component PrecisionLanding: parameters.gain 0.7 → 0.5"]


def test_files_are_compared_by_their_names(tmp_path):
    override = "environment.vehicles.drone_1.body={fmu: one.fmu}"
    systems = []
    for name in ("here", "there"):
        folder = tmp_path / name
        shutil.copytree(DELIVERY.with_name("starter"), folder)
        (folder / "one.fmu").touch()
        (folder / "two.fmu").touch()
        systems.append(load(folder, vocabulary(), overrides=(override,)))
    assert differences(*systems) == ()
    other = load(folder, vocabulary(), overrides=(override, "environment.vehicles.drone_1.body.fmu=two.fmu"))
    found = [str(one) for one in differences(systems[0], other)]
    assert found == ["environment: vehicles.drone_1.body.file one.fmu → two.fmu"]
