"""Relays and the gripper: by command, by mission item and by a switch of the transmitter."""

from __future__ import annotations

from typing import Any

ACCEPTED, FAILED = 0, 4
AUTO, RELAY, GRIPPER, REQUEST_MESSAGE, RELAY_STATUS = 10, 181, 211, 512, 376


def relays(rig: Any) -> tuple[int, int]:
    """Return which relays there are and which are on."""
    assert rig.command(REQUEST_MESSAGE, RELAY_STATUS) == ACCEPTED
    status = rig.latest["RELAY_STATUS"]
    return status["present"], status["on"]


def test_a_relay_is_switched_and_its_pin_with_it(station: Any) -> None:
    rig = station("rover", parameters={"RELAY1_FUNCTION": 1, "RELAY2_FUNCTION": 1, "RELAY1_PIN": 3})
    rig.run(0.5)
    assert relays(rig) == (3, 0)
    assert rig.command(RELAY, 0, 1) == ACCEPTED
    assert relays(rig) == (3, 1)
    assert rig.vehicle.parameters["SIM_PIN_MASK"] == 8.0
    assert rig.command(RELAY, 1, 1) == ACCEPTED
    assert relays(rig) == (3, 3)
    assert rig.command(RELAY, 0, 2) == ACCEPTED  # the opposite of its state
    assert relays(rig) == (3, 2)
    assert rig.vehicle.parameters["SIM_PIN_MASK"] == 0.0
    assert rig.command(RELAY, 2, 1) == FAILED


def test_a_mission_grabs_releases_and_switches(station: Any) -> None:
    rig = station("rover", parameters={"GRIP_ENABLE": 1, "RELAY1_FUNCTION": 1})
    rig.beat()
    rig.run(0.5)
    rig.listed(GRIPPER, param2=1.0)
    assert rig.command(176, 1, AUTO) == ACCEPTED
    assert rig.command(400, 1) == ACCEPTED
    rig.run(4.0)
    said = [text for text in rig.texts() if "ripper" in text]
    assert said == ["Gripper load grabbing", "Gripper Grabbed", "Gripper load grabbed"]
    assert rig.command(400, 0) == ACCEPTED
    rig.listed(RELAY, param1=0.0, param2=1.0)
    assert rig.command(400, 1) == ACCEPTED
    rig.run(1.0)
    assert relays(rig) == (1, 1)


def test_without_a_gripper_a_mission_still_reports_the_item(station: Any) -> None:
    rig = station("rover")
    rig.beat()
    rig.run(0.5)
    rig.listed(GRIPPER, param2=0.0)
    assert rig.command(176, 1, AUTO) == ACCEPTED
    assert rig.command(400, 1) == ACCEPTED
    rig.run(4.0)
    assert [text for text in rig.texts() if "Gripper" in text] == ["Gripper Released"]


def test_a_switch_moves_the_gripper(station: Any) -> None:
    rig = station("rover", parameters={"GRIP_ENABLE": 1, "RC9_OPTION": 19})
    rig.run(0.5)
    for pulse, said in ((1500, None), (1000, "Gripper load releasing"), (2000, "Gripper load grabbing")):
        count = len(rig.texts())
        rig.vehicle.rc.transmitter[8] = pulse
        rig.run(0.5)
        assert (said in rig.texts()[count:]) == (said is not None)
