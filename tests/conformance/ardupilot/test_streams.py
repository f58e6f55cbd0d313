"""What is sent, how often, and who asked for it."""

from __future__ import annotations

from typing import Any

import pytest

NOT_SENT = {"TERRAIN_REQUEST"}
"""Recorded, not sent here: see docs/ardupilot-behaviour.md."""

FAILED = 4
REGULAR = {"HEARTBEAT", "TIMESYNC"}


def test_nothing_is_streamed_unasked(bench: Any, facts: Any) -> None:
    rig = bench(warm=False)
    rig.run(60.0)
    assert set(rig.names()) - {"TIMESYNC", "GPS_GLOBAL_ORIGIN", "HOME_POSITION"} == set(facts["unasked"])


@pytest.mark.parametrize(
    ("kind", "rate", "recorded"),
    [("copter", 4, "copter"), ("copter", 10, "copter_10"), ("rover", 4, "rover")],
)
def test_all_streams_are_the_recorded_ones_at_the_rate_asked(
    kind: str, rate: int, recorded: str, bench: Any, facts: Any
) -> None:
    rig = bench(kind)
    rig.beat()
    rig.stream(rate)
    if kind == "copter":
        rig.airborne(5.0)
        flying_to = {"lat_int": -353630000, "lon_int": 1491652300, "alt": 5.0}
    else:
        assert rig.mode(15) == 0
        assert rig.command(400, 1) == 0
        flying_to = {"lat_int": -353630000, "lon_int": 1491652300}
    rig.send(
        "SET_POSITION_TARGET_GLOBAL_INT",
        target_system=1,
        target_component=1,
        coordinate_frame=6,
        type_mask=3576,
        **flying_to,
    )
    rig.received.clear()
    rig.run(10.0)
    expected = set(facts["rates"][recorded]) - NOT_SENT - REGULAR
    assert expected <= set(rig.names())
    for name in expected:
        assert len(rig.of(name)) == pytest.approx(10.0 * rate, abs=2), name
    extra = set(rig.names()) - expected - REGULAR - {"PARAM_VALUE", "STATUSTEXT"}
    assert extra <= {"POSITION_TARGET_GLOBAL_INT", "NAV_CONTROLLER_OUTPUT"}


GROUPS = {
    1: {"RAW_IMU", "SCALED_IMU2", "SCALED_IMU3", "SCALED_PRESSURE", "SCALED_PRESSURE2"},
    2: {"SYS_STATUS", "POWER_STATUS", "MEMINFO", "NAV_CONTROLLER_OUTPUT", "MISSION_CURRENT", "GPS_RAW_INT"},
    3: {"SERVO_OUTPUT_RAW", "RC_CHANNELS"},
    6: {"GLOBAL_POSITION_INT", "LOCAL_POSITION_NED"},
    10: {"ATTITUDE", "SIMSTATE", "AHRS2"},
    11: {"VFR_HUD"},
}


@pytest.mark.parametrize("group", GROUPS)
def test_a_stream_group_holds_its_messages(group: int, bench: Any) -> None:
    rig = bench()
    rig.run(0.1)
    rig.stream(5, group)
    rig.run(1.5)
    assert set(rig.names()) - REGULAR - {"GPS_GLOBAL_ORIGIN", "HOME_POSITION", "STATUSTEXT"} == GROUPS[group]


def test_all_streams_do_not_include_the_landed_state(bench: Any) -> None:
    rig = bench()
    rig.stream(4)
    rig.run(2.0)
    assert "EXTENDED_SYS_STATE" not in rig.names()
    assert rig.command(511, 245, 500_000) == 0
    rig.run(2.0)
    assert len(rig.of("EXTENDED_SYS_STATE")) == pytest.approx(4, abs=1)


def test_an_interval_overrules_the_stream_for_one_message(bench: Any) -> None:
    rig = bench()
    rig.stream(4)
    assert rig.command(511, 30, 50_000) == 0
    rig.run(1.0)
    rig.received.clear()
    rig.run(5.0)
    assert len(rig.of("ATTITUDE")) == pytest.approx(100, abs=2)
    assert len(rig.of("VFR_HUD")) == pytest.approx(20, abs=1)
    assert rig.command(511, 30, -1) == 0
    rig.received.clear()
    rig.run(2.0)
    assert not rig.of("ATTITUDE")
    rig.command(510, 74)
    assert rig.latest["MESSAGE_INTERVAL"] == {"message_id": 74, "interval_us": 250_000}
    assert rig.command(510, 30) == 0
    assert rig.latest["MESSAGE_INTERVAL"] == {"message_id": 30, "interval_us": -1}
    assert rig.command(510, 145) == FAILED
    assert rig.latest["MESSAGE_INTERVAL"] == {"message_id": 145, "interval_us": 0}
    rig.received.clear()
    assert rig.command(510, 70_000) == FAILED
    assert not rig.of("MESSAGE_INTERVAL")


def test_an_interval_asked_for_at_boot_is_acknowledged_and_lost(bench: Any) -> None:
    rig = bench(warm=False)
    assert rig.command(511, 30, 50_000) == 0
    rig.run(10.0)
    assert not rig.of("ATTITUDE")


def test_streams_asked_for_at_boot_begin_when_it_is_ready(bench: Any) -> None:
    rig = bench(warm=False)
    rig.stream(4)
    rig.run(5.0)
    assert rig.of("ATTITUDE")[0].at == pytest.approx(2.5, abs=0.3)


def test_streams_stop_when_asked(bench: Any) -> None:
    rig = bench()
    rig.stream(4)
    rig.run(1.0)
    rig.stream(0)
    rig.run(0.1)
    rig.received.clear()
    rig.run(3.0)
    assert set(rig.names()) <= {"HEARTBEAT", "TIMESYNC"}


@pytest.mark.parametrize(
    ("number", "result", "message"),
    [
        (148, 0, "AUTOPILOT_VERSION"),
        (242, 0, "HOME_POSITION"),
        (245, 0, "EXTENDED_SYS_STATE"),
        (11111, 4, None),
    ],
)
def test_one_message_on_request(number: int, result: int, message: str | None, bench: Any) -> None:
    rig = bench()
    rig.run(0.5)
    rig.received.clear()
    assert rig.command(512, number) == result
    assert message is None or rig.names() == ["COMMAND_ACK", message]


def test_an_interval_for_an_unknown_message_is_denied_with_words(bench: Any) -> None:
    rig = bench()
    assert rig.command(511, 140, 100_000) == 2
    assert rig.texts()[-1] == "No ap_message for mavlink id (140)"


def test_links_have_their_own_streams_and_hear_the_same_words(bench: Any) -> None:
    rig = bench()
    second = rig.another_link()
    frames: list[str] = []
    second.receive(lambda frame: frames.append(frame.name))
    rig.stream(10)
    rig.run(2.0)
    assert "ATTITUDE" in rig.names()
    assert set(frames) <= {"HEARTBEAT", "GPS_GLOBAL_ORIGIN", "HOME_POSITION", "TIMESYNC"}
    rig.mode(4)
    rig.command(400, 1)
    rig.run(0.2)
    assert "STATUSTEXT" in frames


def test_a_closed_link_leaves_the_vehicle_flying(bench: Any) -> None:
    rig = bench()
    rig.airborne(5.0)
    link = rig.autopilot.endpoint.channels[0].link
    rig.autopilot.disconnect(link)
    rig.run(10.0)
    assert rig.height == pytest.approx(5.0, abs=0.5)
    rig.autopilot.connect(link)
    rig.received.clear()
    rig.run(2.0)
    assert rig.of("HEARTBEAT")


def test_time_and_ping_are_answered(bench: Any) -> None:
    rig = bench()
    rig.run(1.0)
    rig.send("TIMESYNC", tc1=0, ts1=123)
    rig.send("PING", time_usec=5, seq=9, target_system=0, target_component=0)
    rig.run(0.1)
    assert rig.latest["TIMESYNC"]["ts1"] == 123
    assert rig.latest["TIMESYNC"]["tc1"] > 60_000_000_000
    assert rig.latest["PING"] == {"time_usec": 5, "seq": 9, "target_system": 255, "target_component": 190}
