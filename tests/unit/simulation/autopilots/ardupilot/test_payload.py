"""Relays and the gripper: by command, by mission item and by a switch of the transmitter."""

from __future__ import annotations

from typing import Any

from volery.simulation.autopilots.ardupilot.servo_outputs import outputs_of

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
    assert said == ["Mission: 1 Gripper", "Gripper load grabbing", "Gripper Grabbed", "Gripper load grabbed"]
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
    assert [text for text in rig.texts() if "Gripper" in text] == ["Mission: 1 Gripper", "Gripper Released"]


def test_a_switch_moves_the_gripper(station: Any) -> None:
    rig = station("rover", parameters={"GRIP_ENABLE": 1, "RC9_OPTION": 19})
    rig.run(0.5)
    for pulse, said in ((1500, None), (1000, "Gripper load releasing"), (2000, "Gripper load grabbing")):
        count = len(rig.texts())
        rig.vehicle.rc.transmitter[8] = pulse
        rig.run(0.5)
        assert (said in rig.texts()[count:]) == (said is not None)


REPEAT_RELAY, SET_SERVO, REPEAT_SERVO = 182, 183, 184


def over_time(rig: Any, of: Any) -> list[Any]:
    """Return the values of *of* at the middle of four halves of a period of 1 s."""
    values = []
    rig.run(0.25)
    for _ in range(4):
        values.append(of())
        rig.run(0.5)
    return values


def test_a_repeated_relay_goes_on_and_off_and_ends_as_it_was(station: Any) -> None:
    rig = station("rover", parameters={"RELAY1_FUNCTION": 1})
    assert rig.command(REPEAT_RELAY, 0, 1, 1.0) == ACCEPTED
    assert over_time(rig, lambda: 0 in outputs_of(rig.vehicle).relays) == [True, False, False, False]
    assert rig.command(REPEAT_RELAY, 0, -1, 1.0) == ACCEPTED  # without end
    rig.run(20.0)
    assert over_time(rig, lambda: 0 in outputs_of(rig.vehicle).relays) in (
        [True, False] * 2,
        [False, True] * 2,
    )
    assert rig.command(RELAY, 0, 1) == ACCEPTED  # ends the repetition
    assert over_time(rig, lambda: 0 in outputs_of(rig.vehicle).relays) == [True] * 4
    assert rig.command(REPEAT_RELAY, 3, 1, 1.0) == FAILED


def test_a_repeated_servo_goes_to_its_pulse_and_back_to_the_trim(station: Any) -> None:
    rig = station("rover", parameters={"SERVO11_TRIM": 1400})
    assert rig.command(REPEAT_SERVO, 11, 1700, 2, 1.0) == ACCEPTED
    assert over_time(rig, lambda: outputs_of(rig.vehicle).servos[11]) == [1700, 1400, 1700, 1400]
    assert rig.command(REPEAT_SERVO, 11, 1700, 5, 1.0) == ACCEPTED
    assert rig.command(SET_SERVO, 11, 1200) == ACCEPTED  # ends the repetition
    assert over_time(rig, lambda: outputs_of(rig.vehicle).servos[11]) == [1200] * 4


def test_a_reboot_ends_a_repetition(station: Any) -> None:
    rig = station("rover", parameters={"RELAY1_FUNCTION": 1})
    assert rig.command(REPEAT_RELAY, 0, -1, 1.0) == ACCEPTED
    assert rig.command(246, 1) == ACCEPTED
    rig.run(0.1)
    assert over_time(rig, lambda: 0 in outputs_of(rig.vehicle).relays) == [False] * 4


def test_a_boot_switches_relays_to_their_defaults_and_keeps_the_other_pins(station: Any) -> None:
    pins = {"SIM_PIN_MASK": 0b1111, "RELAY1_FUNCTION": 1, "RELAY1_PIN": 1, "RELAY1_DEFAULT": 0}
    pins |= {"RELAY2_FUNCTION": 1, "RELAY2_PIN": 4, "RELAY2_DEFAULT": 1}
    pins |= {"RELAY3_FUNCTION": 1, "RELAY3_PIN": 2, "RELAY3_DEFAULT": 2}
    rig = station("rover", warm=False, parameters=pins)
    rig.run(3.0)
    assert rig.vehicle.parameters["SIM_PIN_MASK"] == 0b11101
    assert outputs_of(rig.vehicle).relays == {1}
