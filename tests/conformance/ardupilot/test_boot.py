"""What the autopilot does by itself after it is switched on."""

from __future__ import annotations

from typing import Any

import pytest

SOON = 0.35
"""Messages come four times a second: nothing is seen earlier than that."""


KINDS = ("copter", "rover")

RECORDED_RELAYS = {"SIM_PIN_MASK": 127, "RELAY1_PIN": 1, "RELAY2_FUNCTION": 1, "RELAY2_PIN": 2}
"""Of the recorded rover: its boot switches both off, which changes two pins."""


@pytest.fixture(scope="module")
def booted(bench: Any) -> dict[str, Any]:
    """A copter and a rover that have booted with all streams on, from before they were ready."""
    found = {}
    for kind in KINDS:
        relays = RECORDED_RELAYS if kind == "rover" else {}
        rig = bench(kind, warm=False, parameters=relays, features="all")
        rig.stream(4)
        rig.run(45.0)
        found[kind] = rig
    return found


def changes(rig: Any, message: str, *names: str) -> list[list[Any]]:
    found: list[list[Any]] = []
    for one in rig.of(message):
        values = [one.fields[name] for name in names]
        if not found or found[-1][1:] != values:
            found.append([one.at, *values])
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_parameters_are_announced_unasked_and_unlisted(kind: str, booted: Any, facts: Any) -> None:
    rig = booted[kind]
    asked = ("SR0_", "STAT_")  # a rover stores the rates that were asked for
    announced = [(one.at, one.fields["param_id"]) for one in rig.of("PARAM_VALUE")]
    announced = [(at, name) for at, name in announced if not name.startswith(asked)]
    recorded = [(at, name) for at, name in facts["boot"][kind]["parameters"] if not name.startswith(asked)]
    assert [name for _, name in announced] == [name for _, name in recorded]
    for (is_now, name), (was, _) in zip(announced, recorded, strict=True):
        assert abs(is_now - was) < SOON, f"{name} at {is_now:.2f} s, recorded at {was:.2f} s"
    assert {one.fields["param_index"] for one in rig.of("PARAM_VALUE")} == {65535}
    assert {one.fields["param_count"] for one in rig.of("PARAM_VALUE")} == {
        1390 if kind == "copter" else 1281 + 2
    }  # a second relay is listed with its pin and its default


@pytest.mark.parametrize("kind", KINDS)
def test_first_heartbeat_comes_one_second_after_boot(kind: str, booted: Any, facts: Any) -> None:
    first = booted[kind].of("HEARTBEAT")[0]
    assert first.at == pytest.approx(facts["boot"][kind]["first_heartbeat"], abs=0.1)


@pytest.mark.parametrize("kind", KINDS)
def test_estimator_flags_change_as_recorded(kind: str, booted: Any, facts: Any) -> None:
    flags = changes(booted[kind], "EKF_STATUS_REPORT", "flags")
    recorded = facts["boot"][kind]["ekf_flags"]
    assert [flag for _, flag in flags] == [flag for _, flag in recorded]
    for (is_now, flag), (was, _) in zip(flags[1:], recorded[1:], strict=True):
        assert abs(is_now - was) < SOON, flag


@pytest.mark.parametrize("kind", KINDS)
def test_health_words_change_as_recorded(kind: str, booted: Any, facts: Any) -> None:
    """The three words of SYS_STATUS, from the first that is streamed after nine seconds on."""
    names = [f"onboard_control_sensors_{word}" for word in ("present", "enabled", "health")]
    words = [row for row in changes(booted[kind], "SYS_STATUS", *names) if row[0] > 9.0]
    logging = 1 << 24  # whether the log is written depends on refused arming
    recorded = [row for row in facts["boot"][kind]["sensors"] if row[0] > 9.0]
    without = [[present, enabled & ~logging, healthy] for _, present, enabled, healthy in recorded]
    recorded_words = [
        words for place, words in enumerate(without) if place == 0 or without[place - 1] != words
    ]
    assert [row[1:] for row in words] == recorded_words


@pytest.mark.parametrize("kind", KINDS)
def test_position_comes_when_the_recorded_one_came(kind: str, booted: Any, facts: Any) -> None:
    rig, recorded = booted[kind], facts["boot"][kind]
    assert rig.of("LOCAL_POSITION_NED")[0].at == pytest.approx(recorded["local_position"], abs=SOON)
    assert rig.of("HOME_POSITION")[0].at == pytest.approx(recorded["home"], abs=SOON)
    assert rig.of("GPS_GLOBAL_ORIGIN")[0].at == pytest.approx(recorded["home"], abs=SOON)
    fix = next(one for one in rig.of("GPS_RAW_INT") if one.fields["fix_type"] >= 3)
    assert fix.at == pytest.approx(recorded["gps_fix"][-1][0], abs=SOON)


@pytest.mark.parametrize(("mode", "recorded"), [(0, "copter"), (4, "copter_guided")])
def test_copter_is_armable_when_the_recorded_one_was(
    mode: int, recorded: str, bench: Any, facts: Any
) -> None:
    """STABILIZE is healthy before there is a position, GUIDED only with one."""
    rig = bench(warm=False)
    rig.stream(4)
    rig.at(5.0, lambda: rig.send("SET_MODE", target_system=1, base_mode=1, custom_mode=mode))
    rig.run(44.0)
    prearm = 1 << 28
    healthy = next(
        one.at for one in rig.of("SYS_STATUS") if one.fields["onboard_control_sensors_health"] & prearm
    )
    assert healthy == pytest.approx(facts["boot"][recorded]["armable"], abs=1.1)


def test_the_autopilot_asks_for_the_time_every_ten_seconds(booted: Any, facts: Any) -> None:
    times = [one.at for one in booted["copter"].of("TIMESYNC")]
    assert times == pytest.approx(facts["boot"]["copter"]["time_requests"] + [40.0], abs=0.1)
    assert all(one.fields["tc1"] == 0 for one in booted["copter"].of("TIMESYNC"))


def test_a_warm_vehicle_is_ready_at_once(bench: Any) -> None:
    rig = bench()
    rig.stream(10)
    rig.run(0.5)
    assert rig.latest["EKF_STATUS_REPORT"]["flags"] == 831
    assert rig.vehicle.home is not None
    assert rig.mode(4) == 0
    assert rig.command(400, 1) == 0


def test_the_banner_is_text_and_the_recorded_one(bench: Any) -> None:
    copter, rover = bench().autopilot.banner, bench("rover").autopilot.banner
    assert copter.startswith(b"\n\nInit ArduCopter V4.5.6 (7ce11b41)\n")
    assert len(copter) == 170
    assert len(rover) == 169


def test_later_bytes_between_frames_go_to_links_that_carry_bytes(bench: Any) -> None:
    rig = bench(warm=False)
    sent: list[bytes] = []

    class Wire:
        name = "wire"

        def send(self, frame: Any) -> None: ...
        def receive(self, receiver: Any) -> None: ...
        def problem(self) -> str: ...
        def close(self) -> None: ...
        def send_bytes(self, data: bytes) -> None:
            sent.append(data)

    rig.autopilot.connect(Wire())
    rig.run(3.0)
    assert b"".join(sent) == b"Init Gyro**\n"


def test_a_restart_boots_in_place_and_keeps_mission_and_parameters(bench: Any) -> None:
    rig = bench()
    rig.run(1.0)
    rig.send(
        "PARAM_SET",
        target_system=1,
        target_component=1,
        param_id="WPNAV_SPEED",
        param_value=700.0,
        param_type=9,
    )
    rig.run(0.1)
    closed: list[str] = []
    rig.autopilot.on_reboot = lambda: closed.append("links")
    assert rig.command(246, 1) == 0
    assert closed == ["links"]
    rig.run(3.0)
    assert "ArduPilot Ready" in rig.texts()
    assert rig.mode(4) == 0
    assert rig.command(400, 1) == 4
    assert rig.vehicle.parameters["WPNAV_SPEED"] == 700.0
    rig.run(45.0)
    assert rig.command(400, 1) == 0


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("pause", [0.0, 0.13, 0.3])
def test_home_comes_after_a_restart_and_the_boot_is_counted(kind: str, pause: float, bench: Any) -> None:
    rig = bench(kind)
    rig.run(1.0 + pause)
    booted = rig.vehicle.parameters["STAT_BOOTCNT"]
    assert rig.command(246, 1) == 0
    assert rig.vehicle.parameters["STAT_BOOTCNT"] == booted + 1
    rig.run_until(lambda: rig.vehicle.home is not None, within=30.0)
    rig.run(12.0)
    assert [text for text in rig.texts() if text.startswith("Field Elevation Set")] == [
        "Field Elevation Set: 584m"
    ]
    assert rig.command(410) == 0
