"""Real firmware of a vehicle in a model; what is wrong with it names its line."""

from __future__ import annotations

import pytest

from volery.base.errors import ModelError
from volery.model.environment import FirmwareProgram

STATED = "autopilot: ardupilot"


def vehicle_with(workshop, written, *overrides):
    workshop.change("kind: multirotor, autopilot: ardupilot", f"kind: multirotor, {written}")
    return workshop.load(None, None, *overrides).vehicles[0]


def test_a_name_alone_is_a_simulated_autopilot(workshop):
    vehicle = vehicle_with(workshop, STATED)
    assert (vehicle.autopilot, vehicle.firmware) == ("ardupilot", None)
    vehicle = vehicle_with(workshop, STATED, "environment.vehicles.drone_1.autopilot={is: ardupilot}")
    assert (vehicle.autopilot, vehicle.firmware) == ("ardupilot", None)


def test_a_name_without_a_slash_is_kept(workshop):
    vehicle = vehicle_with(workshop, "autopilot: {is: ardupilot, firmware: arducopter}")
    assert (vehicle.autopilot, vehicle.firmware) == ("ardupilot", FirmwareProgram("arducopter"))


def test_paths_are_relative_to_the_model(workshop):
    (workshop.folder / "slow.parm").write_text("WPNAV_SPEED 300\n")
    vehicle = vehicle_with(
        workshop,
        "autopilot: {is: ardupilot, firmware: bin/copter, parameters: slow.parm, repeatable: true}",
    )
    assert vehicle.firmware == FirmwareProgram(
        str(workshop.folder / "bin/copter"), (workshop.folder / "slow.parm",), repeatable=True
    )


def test_an_option_puts_a_vehicle_on_real_firmware(workshop):
    vehicle = vehicle_with(workshop, STATED, "environment.vehicles.drone_1.autopilot.firmware=/opt/copter")
    assert (vehicle.autopilot, vehicle.firmware) == ("ardupilot", FirmwareProgram("/opt/copter"))


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ("autopilot: {firmware: arducopter}", "autopilot.is: this key is missing"),
        ("autopilot: {is: ardupliot, firmware: arducopter}", "autopilot.is: no autopilot named 'ardupliot'"),
        ("autopilot: {is: ardupilot, firmware: true}", "autopilot.firmware: text is expected, not True"),
        ("autopilot: {is: ardupilot, repeatable: true}", "autopilot.repeatable: this is of a program"),
        (
            "autopilot: {is: ardupilot, programme: x}",
            "unknown key; valid here: firmware, is, parameters or repeatable",
        ),
        (
            "autopilot: {is: ardupilot, firmware: x, parameters: [slow.parm]}",
            "autopilot.parameters.0: there is no file 'slow.parm' beside the model",
        ),
        (
            "autopilot: {is: ardupilot, firmware: x, parameters: ../slow.parm}",
            "autopilot.parameters: '../slow.parm' is outside the folder of the model",
        ),
        (
            "autopilot: {is: ardupilot, firmware: arducopter}, version: '4.5'",
            "version: arducopter has a version of its own; leave it out",
        ),
        (
            "autopilot: {is: ardupilot, firmware: arducopter}, features: all",
            "features: arducopter has features of its own; leave them out",
        ),
    ],
)
def test_what_is_wrong_is_blamed_on_its_line(workshop, written, said):
    with pytest.raises(ModelError) as raised:
        vehicle_with(workshop, written)
    assert f"model.yaml:{workshop.line_of(written)}: environment.vehicles.drone_1." in str(raised.value)
    assert said in str(raised.value)
