"""What every MAVLink driver finds out: the firmware's version, what it does in silence, who else is there."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from volery.base.errors import CapabilityError, LinkGarbled, UsageError
from volery.base.time import MS, S
from volery.kernel.virtual import VirtualKernel
from volery.kernel.waiting import sleep
from volery.links.frame import Frame
from volery.links.in_process_link import in_process_pair
from volery.vehicles import Rover
from volery.vehicles.drivers.ardupilot import open_driver
from volery.vehicles.drivers.ardupilot.modes import on_link_loss
from volery.vehicles.drivers.mavlink.client import parameter_value

Make = Callable[..., Any]
ARM = 400


def test_firmware_that_is_too_old_is_refused_before_anything_moves(bench: Make) -> None:
    at = bench()
    at.autopilot.version = 0x030602FF

    def later(drone: Any) -> None:
        sleep(at.kernel, 3 * S)
        drone.takeoff(10)

    for mission in (lambda drone: drone.takeoff(10), later):
        with pytest.raises(CapabilityError, match=r"craft_1: ArduPilot 3\.6\.2 flies here.*4\.0 or newer"):
            at.fly(mission)
    assert ARM not in at.autopilot.commands()


def test_one_that_does_not_tell_its_version_is_flown(bench: Make) -> None:
    at = bench()
    at.autopilot.version = 0
    at.fly(lambda drone: drone.takeoff(10))
    assert at.craft.armed


def test_parameters_are_asked_for_until_they_come(bench: Make) -> None:
    at = bench()
    driver = at.vehicle._driver
    at.kernel.run(3 * S)
    assert driver.on_link_loss() == ""
    at.autopilot.parameters = {"FS_GCS_ENABLE": 0.0, "GUID_TIMEOUT": 3.0, "SYSID_MYGCS": 255.0}
    at.kernel.run(15 * S)
    assert driver.on_link_loss() == (
        "it does not react (FS_GCS_ENABLE=0): it flies to its last target and stays there; "
        "a velocity ends after 3 s"
    )
    asked = [fields["param_id"] for fields in at.autopilot.sent("PARAM_REQUEST_READ")]
    assert 2 <= asked.count("GUID_TIMEOUT") <= 5
    assert asked.count("FS_OPTIONS") == 5  # this one has none
    at.kernel.run(60 * S)
    assert len(at.autopilot.sent("PARAM_REQUEST_READ")) == len(asked)


@pytest.mark.parametrize("newer", [False, True])
def test_the_station_that_counts_is_known_in_a_second_by_either_name(bench: Make, newer: bool) -> None:
    """Before 4.7 one name, since then two others, and an error for what there is not."""
    at = bench()
    driver = at.vehicle._driver
    common = {"FS_GCS_ENABLE": 1.0, "FS_GCS_TIMEOUT": 5.0, "FS_OPTIONS": 0.0, "GUID_TIMEOUT": 3.0}
    fence = {"FENCE_ENABLE": 0.0, "FENCE_TYPE": 7.0, "FENCE_RADIUS": 100.0, "FENCE_ALT_MAX": 100.0}
    own = {"MAV_GCS_SYSID": 240.0, "MAV_GCS_SYSID_HI": 250.0} if newer else {"SYSID_MYGCS": 240.0}
    at.autopilot.parameters = common | fence | own
    at.kernel.run(S + 500 * MS)
    which = "systems 240 to 250" if newer else "system 240"
    assert f"it listens for {which}, not for this program" in driver.on_link_loss()
    assert "not for" not in on_link_loss(
        "drone", common | own | {"MAV_GCS_SYSID_HI": 255.0, "SYSID_MYGCS": 255}
    )


def test_an_error_for_a_parameter_is_its_answer(bench: Make) -> None:
    at = bench()
    driver = at.vehicle._driver
    at.autopilot.parameters = {"FS_GCS_ENABLE": 0.0}
    names = driver._backend._requested_parameters
    at.kernel.run(S + 500 * MS)
    for name in names():
        at.autopilot.say("PARAM_ERROR", param_id=name, param_index=-1, error=1)
    at.kernel.run(2 * S)
    assert driver.on_link_loss().startswith("it does not react (FS_GCS_ENABLE=0)")


def test_parameters_that_another_station_reads_are_nothing_to_us(bench: Make) -> None:
    at = bench(Rover)
    at.kernel.run(2 * S)
    for number in range(50):
        at.autopilot.say("PARAM_VALUE", param_id=f"OTHER_{number}", param_value=1.0, param_type=9)
    at.kernel.run(3 * S)
    assert not at.vehicle._driver._backend._parameters


def test_failsafes_in_words() -> None:
    words = on_link_loss(
        "drone", {"FS_GCS_ENABLE": 1, "FS_GCS_TIMEOUT": 5, "SYSID_MYGCS": 255, "FS_OPTIONS": 2}
    )
    assert words == "5 s after the last heartbeat it returns home (RTL); a mission goes on"
    words = on_link_loss(
        "rover", {"FS_GCS_ENABLE": 1, "FS_GCS_TIMEOUT": 5, "FS_ACTION": 2, "SYSID_MYGCS": 254}
    )
    assert words == (
        "5 s after the last heartbeat it stops (HOLD) (it listens for system 254, not for this program)"
    )
    assert on_link_loss("submarine", {}) == ""


def test_whole_numbers_of_px4_lie_in_the_bytes_of_a_float() -> None:
    two = {"param_value": 2.802596928649634e-45, "param_type": 6}
    assert parameter_value(two, bytewise=True) == 2.0
    assert parameter_value({"param_value": 2.0, "param_type": 6}, bytewise=False) == 2.0
    assert parameter_value({"param_value": 0.5, "param_type": 9}, bytewise=True) == 0.5


def test_a_px4_is_named(bench: Make) -> None:
    at = bench()
    at.autopilot.mute = True
    fields = {"type": 2, "autopilot": 12, "base_mode": 81, "custom_mode": 0, "system_status": 3}

    def beat() -> None:
        at.autopilot.mute = False
        at.autopilot.say("HEARTBEAT", **fields)
        at.autopilot.mute = True

    at.kernel.every(S, beat)
    with pytest.raises(LinkGarbled, match="a PX4 answers here, not an ArduPilot"):
        at.fly(lambda drone: drone.wait_connected(within=5))


@pytest.mark.parametrize(("system", "component"), [(7, 1), (1, 190)])
def test_frames_of_another_component_are_nothing_to_us(bench: Make, system: int, component: int) -> None:
    at = bench()
    at.kernel.run(2 * S)
    seen = at.vehicle._driver.telemetry
    before, link = seen.position, at.autopilot.link
    away = {"lat": 470000000, "lon": 80000000, "alt": 500000, "relative_alt": 10000, "hdg": 0}
    rest = dict.fromkeys(("time_boot_ms", "vx", "vy", "vz"), 0)
    link.send(Frame("GLOBAL_POSITION_INT", away | rest, system, component))
    at.autopilot.mute = True
    at.kernel.run(2100 * MS)
    assert seen.position == before
    link.send(Frame("GLOBAL_POSITION_INT", away | rest, 1, 1))
    at.kernel.run(2200 * MS)
    assert seen.position != before


def test_options_are_checked() -> None:
    kernel = VirtualKernel()
    ours, _ = in_process_pair(kernel)
    for options, wrong in (
        ({"rat": "5"}, "the ardupilot driver has no option 'rat'"),
        ({"rate": "fast"}, "rate='fast' is no rate"),
        ({"system": "0"}, "system='0' is no system id"),
        ({"texts": "some"}, "there is recorded or unrecorded"),
    ):
        with pytest.raises(UsageError, match=wrong):
            open_driver(kernel, ours, "craft_1", options)
