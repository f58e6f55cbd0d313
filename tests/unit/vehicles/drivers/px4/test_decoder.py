"""What the driver makes of telemetry as PX4 1.14 sent it: extracts of recorded flights."""

from __future__ import annotations

import pytest

from rigs.recorded import Recorded, extract
from volery.kernel.virtual import VirtualKernel
from volery.links.frame import Frame
from volery.links.mavlink_codec import MavlinkParser, encode
from volery.vehicles.drivers.px4.decoder import KNOWN_EVENTS, PX4Decoder, event_id, event_text
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
    known = {number for number in recorded if not event_text(number).startswith("event")}
    assert event_id("commander_armed_by") == 0x0190CAF3
    assert event_id("check_modes_attitude") == 0x019F748F
    assert {f"{number:#010x}" for number in recorded - known} == {
        "0x01a893e0",  # begins a report of arming checks
        "0x011d3727",  # ends it
        "0x01125bef",  # beside the logger's text
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
