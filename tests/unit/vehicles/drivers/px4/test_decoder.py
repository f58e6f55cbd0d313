"""What the driver makes of telemetry as PX4 1.14 sent it: extracts of recorded flights."""

from __future__ import annotations

import json
import lzma
import struct

import pytest

from rigs.recorded import Recorded, extract
from volery.kernel.virtual import VirtualKernel
from volery.links.frame import Frame
from volery.links.mavlink_codec import MavlinkParser, encode
from volery.vehicles.drivers.px4.decoder import PX4Decoder
from volery.vehicles.drivers.px4.events import (
    ALL_MODES,
    CHECKS,
    KNOWN_EVENTS,
    REPORT_BEGINS,
    REPORT_ENDS,
    EventTexts,
    FailingChecks,
    ReportedEvent,
    event_id,
    event_text,
    path_of_events,
    uncompressed,
)
from volery.vehicles.drivers.px4.modes import HOLD, MODES, mode_name
from volery.vehicles.firmware_versions import FirmwareVersion
from volery.vehicles.telemetry import Telemetry

ARM, REJECTED = 400, 1
FOLDER = "px4_telemetry"


class RecordedPx4(Recorded):
    """An answer that refuses to arm has the checks that fail said; other answers are not telemetry."""

    def hear(self, hearing: PX4Decoder, frame: Frame) -> None:
        if frame.name != "COMMAND_ACK":
            super().hear(hearing, frame)
        elif frame.fields["command"] == ARM and frame.fields["result"] == REJECTED:
            hearing.add_failing_checks()


RECORDED = RecordedPx4(FOLDER, PX4Decoder)
replayed, changes = RECORDED.replayed, RECORDED.changes


def texts(name: str) -> list[str]:
    said: list[str] = []
    for _, seen in replayed(name):
        new = [one.text for one in seen.texts]
        if new and (not said or said[-1] != new[-1] or len(new) > len(said)):
            said = [*said, new[-1]] if len(new) >= 50 else new
    return said


def test_a_mission_a_return_and_a_kill() -> None:
    states = changes("auto-gcs", "mode", "armed", "flying")
    assert states[:8] == [
        ("", False, False),
        ("AUTO.LOITER", False, False),
        ("AUTO.TAKEOFF", False, False),
        ("AUTO.MISSION", False, False),
        ("AUTO.MISSION", True, False),
        ("AUTO.MISSION", True, True),
        ("AUTO.RTL", True, True),
        ("AUTO.LOITER", True, True),
    ]
    assert ("POSCTL.ORBIT", True, True) in states
    assert ("AUTO.RTL", True, False) in states
    assert states[-1] == ("AUTO.LOITER", False, False)


def test_it_is_ready_only_once_it_has_a_position() -> None:
    ready = next(at for at, seen in replayed("auto-gcs") if seen.ready)
    placed = next(at for at, seen in replayed("auto-gcs") if seen.position is not None)
    assert 5 < placed < ready < 10
    *_, (_, seen) = replayed("auto-gcs")
    assert seen.home is not None
    assert seen.home.latitude == pytest.approx(45.467, abs=0.001)


@pytest.mark.parametrize(
    ("version", "flags", "located"),
    [
        ((1, 14, 0), 1023, False),
        ((1, 15, 4), 1023, False),
        ((1, 16, 0), 1023, True),  # at rest, with a position
        ((1, 17, 0), 1023, True),
        (None, 1023, True),
        ((1, 17, 0), 1023 - 16, False),
        ((1, 14, 0), 831, True),
    ],
)
def test_the_estimator_of_each_version(version: tuple[int, ...] | None, flags: int, located: bool) -> None:
    kernel = VirtualKernel()
    seen = Telemetry(kernel, "craft")
    seen.version = None if version is None else FirmwareVersion(*version)
    hearing = PX4Decoder(kernel, seen)
    hearing.handle_message("ESTIMATOR_STATUS", {"flags": flags})
    assert hearing._estimates_position is located


def test_px4_1_17_is_ready_at_rest_and_its_home_stays_where_it_is() -> None:
    seen_ready, home_since, heights, jumps = None, set(), [], []
    amsl = before = None
    for at, seen in replayed("guided-1.17"):
        seen_ready = at if seen.ready and seen_ready is None else seen_ready
        if seen.flying and at > 25:
            home_since.add(seen.home_ns)
            if 40 < at < 64 and seen.position.altitude.metres != amsl:  # it hovers at one height AMSL
                amsl = seen.position.altitude.metres
                heights.append(seen.above_home)
                jumps.append(abs(seen.above_home - (before or seen.above_home)))
                before = seen.above_home
            off = seen.position.altitude.metres - seen.home.altitude.metres - seen.above_home
            assert abs(off) < 0.01
    assert seen_ready is not None
    assert seen_ready < 4
    assert len(home_since) == 1  # a hundred corrections of its altitude are no other home
    assert max(heights) - min(heights) < 2.0
    assert max(jumps) < 0.8


def test_offboard_and_its_loss_with_each_action() -> None:
    states = changes("offboard-api", "mode", "failsafe")
    lost = [mode for mode, failsafe in states if failsafe]
    assert lost == ["POSCTL", "AUTO.RTL", "AUTO.LAND", "AUTO.LOITER"]
    for mode in lost:  # and back by itself, as soon as the stream had resumed
        assert states[states.index((mode, True)) + 1] == ("OFFBOARD", False)


def test_sticks_that_are_missed() -> None:
    states = changes("manual-gcs", "mode", "failsafe")
    assert ("AUTO.LOITER", True) in states
    assert ("AUTO.RTL", True) in states
    said = texts("manual-gcs")
    assert "manual control lost" in said
    assert "pilot took over using sticks" in said
    assert "Failsafe activated, entering Hold for 5 seconds" in said
    assert "Arming denied: throttle above center" in said


def test_why_it_would_not_arm_comes_from_the_report_before() -> None:
    early = texts("auto-gcs")
    assert "Arming check: no valid local position estimate" in early
    assert "Arming check: no valid attitude estimate" in early
    assert not any("offboard" in text for text in early)
    by_hand = [text for text in texts("manual-gcs") if text.startswith("Arming check")]
    assert set(by_hand) == {"Arming check: no manual control input"}


def test_no_text_comes_twice_and_none_with_a_tabulator() -> None:
    said = texts("auto-gcs")
    assert not any(text.endswith("\t") for text in said)
    assert said.count("Armed by external command") == 2
    assert "armed" not in said


def test_numbers_of_events_are_made_of_their_names() -> None:
    recorded = {
        fields["id"]
        for name in ("auto-gcs", "manual-gcs", "offboard-api")
        for _, kind, fields in extract(FOLDER, name)
        if kind == "EVENT"
    }
    recorded |= {fields["id"] for _, kind, fields in extract(FOLDER, "guided-1.17") if kind == "EVENT"}
    known = {number for number in recorded if not event_text(number).startswith("event")}
    assert event_id("commander_armed_by") == 0x0190CAF3
    assert event_id("check_modes_attitude") == 0x019F748F
    assert {f"{number:#010x}" for number in recorded - known} == {
        "0x01a893e0",  # begins a report of arming checks
        "0x011d3727",  # ends it
    }
    assert len(known & KNOWN_EVENTS.keys()) >= 15


def test_events_as_they_came_over_the_wire() -> None:
    raw = bytes.fromhex("fd1200007a03019a01008f749f0120080000f8ff0000223ed07e00146911")
    (frame,) = MavlinkParser().feed(raw)
    assert frame.name == "EVENT"
    assert (frame.fields["id"], frame.fields["sequence"], frame.fields["log_levels"]) == (
        0x019F748F,
        65528,
        0x22,
    )
    assert frame.fields["arguments"][:5] == (0x3E, 0xD0, 0x7E, 0, 20)
    assert encode(frame, 0x7A) == raw
    (sequence,) = MavlinkParser().feed(bytes.fromhex("fd0300002503019b0100f6ff01ee37"))
    assert (sequence.name, sequence.fields["sequence"]) == ("CURRENT_EVENT_SEQUENCE", 65526)


def test_all_checks_of_1_14_to_1_18_have_words() -> None:
    assert len(CHECKS) == 160
    assert event_text(event_id("check_estimator_gps_pdop_too_high")) == "estimator GPS pdop too high"
    assert event_text(event_id("commander_disarm_denied_not_landed")) == "disarming denied: not landed"
    assert event_text(0x01000001) == "event 0x01000001"


@pytest.mark.parametrize(
    ("number", "name"),
    [
        (0x02030000, "POSCTL.SLOW"),
        (0x0B040000, "AUTO.EXTERNAL1"),
        (0x12040000, "AUTO.EXTERNAL8"),
        (0x000A0000, "TERMINATION"),
        (0x000B0000, "ALTITUDE_CRUISE"),
        (0x000C0000, "MODE 0x000c0000"),
    ],
)
def test_modes_of_1_15_to_1_17(number: int, name: str) -> None:
    assert mode_name(number) == name


def report(*failing: ReportedEvent, can_arm: int) -> FailingChecks:
    checks = FailingChecks()
    summary = bytes(17) + struct.pack("<II", can_arm, can_arm)
    for event in (ReportedEvent(REPORT_BEGINS, 8, 0, summary), *failing, ReportedEvent(REPORT_ENDS, 8, 0)):
        checks.handle_event(event)
    return checks


def test_a_check_that_only_warns_is_no_reason() -> None:
    """As PX4 1.17 reports without a transmitter: the warning is for all modes, and it can arm in Hold."""
    hold = 1 << MODES[HOLD].state
    warning = ReportedEvent(event_id("check_modes_manual_control"), 4, ALL_MODES)
    low = ReportedEvent(event_id("check_battery_low"), 4, ALL_MODES)
    assert report(warning, low, can_arm=hold).reasons(HOLD) == []
    assert report(warning, low, can_arm=hold).lasting(HOLD) == []
    assert report(warning, low, can_arm=0).reasons(HOLD) == ["low battery"]
    assert report(warning, low, can_arm=0).lasting("MANUAL") == ["no manual control input"]
    missing = ReportedEvent(event_id("check_modes_mission"), 6, ALL_MODES)  # COM_ARM_MIS_REQ
    assert report(warning, missing, can_arm=0).lasting(HOLD) == ["no valid mission available"]
    station = ReportedEvent(event_id("check_rc_dl_no_dllink"), 3, ALL_MODES)
    assert report(station, can_arm=0).lasting(HOLD) == []  # heartbeats are lost on this very link


OWN_EVENTS = {
    "version": 2,
    "components": {
        "0": {"namespace": "common", "event_groups": {}, "enums": {}},
        "1": {
            "namespace": "px4",
            "enums": {
                "place_t": {"type": "uint8_t", "entries": {"3": {"name": "nest", "description": "the nest"}}},
                "group_t": {"type": "uint32_t", "is_bitfield": True, "entries": {}},
            },
            "event_groups": {
                "arming_check": {
                    "events": {
                        "17": {
                            "name": "check_own",
                            "message": r"Wind {3:.1m/s} at <param>{2}</param>, \<{4}",
                            "arguments": [
                                {"type": "group_t", "name": "modes"},
                                {"type": "place_t", "name": "place"},
                                {"type": "float", "name": "speed"},
                            ],
                        }
                    }
                }
            },
        },
    },
}


def test_texts_of_events_from_the_vehicles_own_file() -> None:
    packed = lzma.compress(json.dumps(OWN_EVENTS).encode())
    texts = EventTexts(uncompressed("/etc/extras/all_events.json.xz", packed))
    own = ReportedEvent(0x01000011, 3, ALL_MODES, struct.pack("<IBf", ALL_MODES, 3, 7.25).ljust(40, b"\0"))
    assert texts.text(own) == "Wind 7.2 m/s at the nest, <?"
    assert texts.text(ReportedEvent(0x01000012, 3, 0)) == ""
    checks = report(own, can_arm=0)
    assert checks.reasons(HOLD) == ["event 0x01000011"]
    assert not checks.knows(own)
    checks.texts = texts
    assert checks.knows(own)
    assert checks.reasons(HOLD) == ["Wind 7.2 m/s at the nest, <?"]


@pytest.mark.parametrize(
    "document",
    [
        b"",
        b"[]",
        b"{}",
        b'{"components": 3}',
        b'{"components": {"1": {"event_groups": {"x": {"events": 1}}}}}',
    ],
)
def test_what_is_no_file_of_events_is_refused(document: bytes) -> None:
    with pytest.raises(ValueError, match=r"no file of events|Expecting value"):
        EventTexts(document)


def test_where_the_file_of_events_is() -> None:
    kinds = [{"type": 1, "uri": "x"}, {"type": 4, "uri": "mftp://etc/extras/all_events.json.xz"}]
    general = json.dumps({"version": 1, "metadataTypes": kinds}).encode()
    assert path_of_events(general) == "/etc/extras/all_events.json.xz"
    assert path_of_events(general.replace(b"mftp", b"https")) == ""
    assert path_of_events(b"{") == ""
    with pytest.raises(ValueError, match=r"Corrupt|unsupported|format"):
        uncompressed("x.xz", b"no xz")
