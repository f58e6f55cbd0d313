"""What addresses of vehicles in virtual time describe."""

from __future__ import annotations

from pathlib import Path

import pytest

from volery.base.errors import UsageError
from volery.model.environment import FirmwareProgram
from volery.run.assembly.simulated_vehicles import parse_simulated
from volery.vehicles.address import parse


def described(url, kind="multirotor"):
    return parse_simulated(parse(url), "drone", kind)


def test_a_firmware_address_has_the_usual_program_of_the_kind():
    assert described("firmware:ardupilot").vehicle.firmware == FirmwareProgram("arducopter")
    assert described("firmware:ardupilot", "rover").vehicle.firmware == FirmwareProgram("ardurover")
    assert described("firmware:ardupilot?kind=rover").vehicle.firmware == FirmwareProgram("ardurover")
    assert described("firmware:px4").vehicle.firmware == FirmwareProgram("px4")
    assert described("sim:px4").vehicle.firmware is None


def test_a_firmware_address_has_options_of_its_own_and_those_of_the_world():
    wanted = described(
        "firmware:px4?program=/opt/px4&file=a.params,b.params&repeatable=1&parameters=A:1,B:2"
        "&start=warm&heading=90&wind=5,270,1&wire=bytes&drop=0.1&system=7"
    )
    flown = wanted.vehicle
    assert flown.firmware == FirmwareProgram(
        "/opt/px4", (Path("a.params"), Path("b.params")), repeatable=True
    )
    assert (flown.autopilot, flown.parameters) == ("px4", {"A": 1.0, "B": 2.0})
    assert (flown.started, flown.heading_deg) == ("warm", 90.0)
    assert (wanted.wind.speed_m_s, wanted.system) == (5.0, 7)
    assert wanted.faults is not None
    assert wanted.faults.drop == 0.1
    assert described("firmware:px4").vehicle.started == "cold"


@pytest.mark.parametrize(
    ("url", "said"),
    [
        ("firmware:px4?version=1.14", "no option 'version'"),
        ("firmware:px4?features=all", "no option 'features'"),
        ("firmware:px4?repeatable=yes", "repeatable='yes'; there is 0 or 1"),
        ("sim:px4?program=px4", "no option 'program'"),
    ],
)
def test_options_of_the_other_scheme_are_refused(url, said):
    with pytest.raises(UsageError, match=said):
        described(url)
