"""Which command gets which answer, and modes as the heartbeat shows them."""

from __future__ import annotations

from typing import Any

import pytest

ACCEPTED, DENIED, UNSUPPORTED, FAILED, SILENCE = 0, 2, 3, 4, None

ON_THE_GROUND = [
    ("unknown command", (31999,), UNSUPPORTED),
    ("reposition in the long form", (192, 0, 1, 0, 0, -35.0, 149.0, 600.0), UNSUPPORTED),
    ("take-off, disarmed", (22, 0, 0, 0, 0, 0, 0, 10), FAILED),
    ("mode that does not exist", (176, 1, 77), FAILED),
    ("mode without its flag", (176, 0, 4), DENIED),
    ("arm with a value that is none", (400, 2), UNSUPPORTED),
    ("disarm, disarmed", (400, 0), ACCEPTED),
    ("mission start, disarmed", (300,), FAILED),
    ("land", (21,), ACCEPTED),
    ("return", (20,), ACCEPTED),
    ("loiter", (17,), ACCEPTED),
    ("speed", (178, 1, 5), ACCEPTED),
    ("speed of nothing", (178, 1, 0), FAILED),
    ("yaw", (115, 90, 0, 1, 0), ACCEPTED),
    ("yaw beyond the circle", (115, 400, 0, 1, 0), FAILED),
    ("home here", (179, 1), ACCEPTED),
    ("home at zero means here", (179, 0, 0, 0, 0, 0, 0, 5), ACCEPTED),
    ("home off the globe", (179, 0, 0, 0, 0, 95, 10, 5), DENIED),
    ("calibration", (241, 1), ACCEPTED),
    ("termination without its value", (185, 0), FAILED),
    ("reboot with an unknown value", (246, 7), UNSUPPORTED),
]


@pytest.mark.parametrize(
    ("command", "result"), [row[1:] for row in ON_THE_GROUND], ids=[row[0] for row in ON_THE_GROUND]
)
def test_commands_on_the_ground(command: tuple[float, ...], result: int | None, bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    assert rig.command(int(command[0]), *command[1:]) == result


def test_another_system_is_not_answered(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    assert rig.command(400, 1, target_system=7) is SILENCE
    assert not rig.vehicle.armed


def test_set_mode_is_acknowledged_as_command_11(bench: Any) -> None:
    rig = bench()
    rig.send("SET_MODE", target_system=1, base_mode=1, custom_mode=4)
    rig.run(0.1)
    assert rig.latest["COMMAND_ACK"] == {
        "command": 11,
        "result": 0,
        "progress": 0,
        "result_param2": 0,
        "target_system": 255,
        "target_component": 190,
    }
    assert rig.latest["HEARTBEAT"]["custom_mode"] == 4


def test_an_answer_comes_within_milliseconds_before_what_it_changes(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    rig.received.clear()
    sent = rig.now
    rig.command(176, 1, 4)
    assert [one.name for one in rig.received[:2]] == ["COMMAND_ACK", "HEARTBEAT"]
    assert rig.received[0].at - sent < 0.01


def test_words_of_a_refusal_come_after_the_answer(bench: Any) -> None:
    rig = bench(warm=False)
    rig.run(25.0)
    rig.mode(4)
    rig.received.clear()
    assert rig.command(400, 1) == FAILED
    assert [one.name for one in rig.received if one.name != "HEARTBEAT"] == ["COMMAND_ACK", "STATUSTEXT"]
    assert rig.texts() == ["Arm: Need Position Estimate"]


REFUSALS = [
    ("LAND", 9, (), "Arm: LAND mode not armable"),
    ("RTL", 6, (), "Arm: RTL mode not armable"),
    ("AUTO without a mission", 3, (), "Arm: Mode requires mission"),
    ("STABILIZE with the throttle open", 0, (1500, 1500, 1600, 1500), "Arm: Throttle too high"),
    ("ALT_HOLD with the throttle high", 2, (1500, 1500, 1700, 1500), "Arm: Throttle too high"),
]


@pytest.mark.parametrize(
    ("mode", "sticks", "words"), [row[1:] for row in REFUSALS], ids=[row[0] for row in REFUSALS]
)
def test_arming_is_refused_in_the_firmwares_words(
    mode: int, sticks: tuple[int, ...], words: str, bench: Any
) -> None:
    rig = bench()
    rig.run(0.5)
    rig.mode(mode)
    rig.sticks(*sticks)
    assert rig.command(400, 1) == FAILED
    assert words in rig.texts()
    assert not rig.vehicle.armed


@pytest.mark.parametrize(
    ("mode", "pulses", "text"),
    [
        (4, (1500, 1500, 1700, 1500), "Throttle (RC3) is not neutral"),
        (5, (1500, 1500, 1500, 1500), "Throttle (RC3) is not neutral"),
        (5, (1500, 1500, 1700, 1500), "Throttle too high"),
        (4, (1700, 1500, 1000, 1500), "Roll (RC1) is not neutral"),
        (4, (1500, 1500, 1000, 1500), ""),
    ],
)
def test_sticks_that_do_not_rest_forbid_arming(
    mode: int, pulses: tuple[int, ...], text: str, bench: Any
) -> None:
    """In LOITER with the throttle in the middle, as recorded; the others by the same check."""
    rig = bench()
    rig.run(0.5)
    rig.mode(mode)
    rig.sticks(*pulses)
    assert rig.command(400, 1) == (FAILED if text else ACCEPTED)
    assert rig.texts()[-1] == (f"Arm: {text}" if text else "Arming motors")


@pytest.mark.parametrize("magic", [21196, 2989])
def test_force_arms_without_checks(magic: int, bench: Any) -> None:
    rig = bench(warm=False)
    rig.run(5.0)
    assert rig.command(400, 1) == FAILED
    assert rig.command(400, 1, magic) == ACCEPTED


def test_disarming_in_the_air_takes_force(bench: Any) -> None:
    rig = bench()
    rig.airborne(5.0)
    assert rig.command(400, 0) == FAILED
    assert rig.command(400, 0, 2989) == FAILED
    assert rig.command(22, 0, 0, 0, 0, 0, 0, 10) == FAILED
    assert rig.command(400, 1) == ACCEPTED
    assert rig.command(400, 0, 21196) == ACCEPTED
    assert not rig.vehicle.armed


@pytest.mark.parametrize(("mode", "result"), [(0, FAILED), (2, FAILED), (4, ACCEPTED), (5, ACCEPTED)])
def test_take_off_is_accepted_in_guided_and_loiter_only(mode: int, result: int, bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    rig.mode(mode)
    assert rig.command(400, 1) == ACCEPTED
    texts = len(rig.texts())
    assert rig.command(22, 0, 0, 0, 0, 0, 0, 10) == result
    assert len(rig.texts()) == texts


def test_take_off_in_the_int_form_wants_the_relative_frame(bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    rig.mode(4)
    rig.command(400, 1)
    assert rig.command_int(22, frame=0, z=600.0) == DENIED
    assert rig.command_int(22, frame=3, z=10.0) == ACCEPTED


@pytest.mark.parametrize("kind", ["copter", "rover"])
def test_modes_show_the_recorded_bits(kind: str, bench: Any, facts: Any) -> None:
    rig = bench(kind)
    rig.run(1.0)
    seen = set()
    for number in rig.autopilot.vehicle.rules.modes:
        for armed in (False, True):
            rig.vehicle.arming.armed = False
            rig.mode(number)
            rig.vehicle.arming.armed = armed
            rig.vehicle.output.send_message("HEARTBEAT")
            rig.run(0.01)
            seen.add((rig.latest["HEARTBEAT"]["custom_mode"], rig.latest["HEARTBEAT"]["base_mode"]))
    rig.vehicle.arming.armed = False
    recorded = {tuple(pair) for pair in facts["modes"][kind]} - {(16, 65)}
    assert recorded <= seen


OTHER_MODES = {"copter": (8, 10, 12, 13, 26), "rover": (2, 6, 8, 9)}


@pytest.mark.parametrize(
    ("kind", "mode"), [(kind, mode) for kind, modes in OTHER_MODES.items() for mode in modes]
)
def test_modes_that_are_not_there_are_refused_as_unknown_ones(kind: str, mode: int, bench: Any) -> None:
    rig = bench(kind)
    rig.run(0.5)
    assert rig.mode(mode) == FAILED
    assert rig.texts()[-1] == f"No such mode {mode}"


def test_without_a_position_an_armed_copter_may_not_enter_guided(bench: Any) -> None:
    rig = bench(warm=False)
    rig.run(30.0)
    assert rig.mode(4) == ACCEPTED
    assert rig.mode(0) == ACCEPTED
    assert rig.command(400, 1) == ACCEPTED
    assert rig.mode(4) == FAILED
    assert rig.texts()[-1] == "Mode change to GUIDED failed: requires position"


def test_several_vehicles_have_their_own_system_ids(bench: Any) -> None:
    rig = bench(system=5)
    rig.run(1.5)
    assert rig.command(400, 1, 21196, target_system=1) is SILENCE
    assert rig.command(400, 1, 21196, target_system=5) == ACCEPTED
    assert rig.vehicle.parameters["SYSID_THISMAV"] == 5


@pytest.mark.parametrize(
    ("mode", "name", "before"),
    [
        (14, "FLIP", None),
        (15, "AUTOTUNE", None),
        (22, "FLOWHOLD", None),
        (23, "FOLLOW", "Set FOLL_ENABLE = 1"),
        (25, "SYSTEMID", "No axis selected, SID_AXIS = 0"),
        (28, "TURTLE", None),
    ],
)
def test_modes_that_need_more_are_refused_by_name(
    mode: int, name: str, before: str | None, bench: Any
) -> None:
    rig = bench(features="flip,follow")
    rig.run(0.5)
    assert rig.mode(mode) == FAILED
    assert rig.texts() == [*([before] if before else []), f"Mode change to {name} failed: init failed"]
