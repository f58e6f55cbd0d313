"""Signed links: what pymavlink signs is received, and nothing that is forged, replayed or unsigned."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect

from volery.base.errors import UsageError
from volery.links.frame import Frame
from volery.links.mavlink_codec import MavlinkParser, SignedMavlink, encode, read_key
from volery.links.pprzlink_codec import PPRZLINK
from volery.vehicles.address import listen, parse_listen

KEY = bytes(range(32))
BEAT = Frame("HEARTBEAT", {"type": 2, "autopilot": 3, "mavlink_version": 3}, 1, 1)
AWAY = Frame("GLOBAL_POSITION_INT", {"lat": 1, "lon": 2}, 1, 1)
RADIO = Frame("RADIO_STATUS", {"rssi": 5}, 51, 68)


def pymavlink(key: bytes) -> dialect.MAVLink:
    """Return pymavlink's end of a signed link."""
    made = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    made.signing.secret_key = key
    made.signing.sign_outgoing = True
    made.signing.timestamp = SignedMavlink(key)._signing.timestamp
    return made


def names(codec: SignedMavlink, *portions: bytes) -> list[str]:
    parser = codec.parser()
    return [frame.name for portion in portions for frame in parser.feed(portion)]


def test_pymavlink_accepts_what_is_signed_here_and_refuses_it_under_another_key() -> None:
    raw = SignedMavlink(KEY).encode(BEAT, 7)
    (message,) = pymavlink(KEY).parse_buffer(raw)
    assert (message.get_type(), message.get_seq()) == ("HEARTBEAT", 7)
    with pytest.raises(dialect.MAVError, match="signature"):
        pymavlink(b"x" * 32).parse_buffer(raw)


def test_what_pymavlink_signs_is_received_in_order() -> None:
    theirs = pymavlink(KEY)
    beat = dialect.MAVLink_heartbeat_message(2, 3, 0, 0, 0, 3)
    raw = [bytes(beat.pack(theirs)) for _ in range(5)]
    assert names(SignedMavlink(KEY), b"".join(raw)) == ["HEARTBEAT"] * 5


def test_forged_replayed_and_unsigned_frames_are_refused() -> None:
    ours, theirs = SignedMavlink(KEY), SignedMavlink(KEY)
    parser = ours.parser()
    first, second = (theirs.encode(BEAT, number) for number in range(2))
    assert len(parser.feed(second)) == 1
    refused = {
        "replayed": second,
        "older than the last": first,
        "unsigned": encode(AWAY, 2),
        "another key": SignedMavlink(b"x" * 32).encode(AWAY, 2),
        "zero signature": theirs.encode(AWAY, 2)[:-6] + bytes(6),
        "version 1": dialect.MAVLink_heartbeat_message(2, 3, 0, 0, 0, 3).pack(
            dialect.MAVLink(None, 1, 1), force_mavlink1=True
        ),
    }
    for what, raw in refused.items():
        assert parser.feed(bytes(raw)) == [], what
    assert parser.statistics.refused == len(refused)
    assert len(parser.feed(theirs.encode(BEAT, 3))) == 1


def test_a_replay_over_another_connection_of_the_link_is_refused() -> None:
    ours, raw = SignedMavlink(KEY), SignedMavlink(KEY).encode(BEAT, 0)
    assert names(ours, raw) == ["HEARTBEAT"]
    assert names(ours, raw) == []


def test_a_frame_recorded_long_ago_is_refused() -> None:
    old = SignedMavlink(KEY)
    old._signing.timestamp -= 2 * 60 * 100_000
    raw = dialect.MAVLink_heartbeat_message(2, 3, 0, 0, 0, 3)
    theirs = pymavlink(KEY)
    theirs.signing.timestamp = old._signing.timestamp
    assert names(SignedMavlink(KEY), bytes(raw.pack(theirs))) == []


def test_a_forged_frame_of_the_far_future_does_not_silence_its_sender() -> None:
    ours, forger = SignedMavlink(KEY), SignedMavlink(b"x" * 32)
    forger._signing.timestamp = (1 << 48) - 2
    sender = SignedMavlink(KEY)
    assert names(ours, forger.encode(BEAT, 0), sender.encode(BEAT, 0)) == ["HEARTBEAT"]
    forger._signing.timestamp = (1 << 48) - 2
    assert names(ours, forger.encode(BEAT, 1), sender.encode(BEAT, 1)) == ["HEARTBEAT"]


def test_the_radio_at_this_end_need_not_sign() -> None:
    assert names(SignedMavlink(KEY), encode(RADIO, 0)) == ["RADIO_STATUS"]


def test_what_is_refused_is_said() -> None:
    parser = SignedMavlink(KEY).parser()
    parser.feed(encode(BEAT, 0))
    assert parser.problem() == "1 frames were refused: they are not signed with the key of this link"


def test_a_key_is_read_from_a_file_of_its_owner(tmp_path: Path) -> None:
    file = tmp_path / "key"
    file.write_text(KEY.hex() + "\n")
    file.chmod(0o600)
    assert read_key(file) == KEY
    file.chmod(0o644)
    with pytest.raises(UsageError, match="chmod 600"):
        read_key(file)
    file.chmod(0o600)
    for wrong in ("", "00" * 31, "zz" * 32, "00" * 100_000):
        file.write_text(wrong)
        with pytest.raises(UsageError, match="holds no signing key"):
            read_key(file)
    with pytest.raises(UsageError, match="cannot read the signing key"):
        read_key(tmp_path / "none")


def test_signing_is_for_mavlink_only(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="pprzlink has no signatures"):
        listen(None, parse_listen(f"udp://:1?signing={tmp_path}"), codec=PPRZLINK)  # type: ignore[arg-type]


@given(st.data())
def test_no_change_of_a_signed_frame_passes_and_the_next_one_is_received(data: st.DataObject) -> None:
    theirs, parser = SignedMavlink(KEY), SignedMavlink(KEY).parser()
    raw = bytearray(theirs.encode(AWAY, 1))
    at = data.draw(st.integers(0, len(raw) - 1))
    raw[at] ^= data.draw(st.integers(1, 255))
    assert parser.feed(bytes(raw)) == []
    beats = [parser.feed(theirs.encode(BEAT, number)) for number in range(2, 24)]
    assert [frame.name for frame in beats[-1]] == ["HEARTBEAT"]  # a false length takes some frames with it


@given(st.binary(max_size=300), st.binary(min_size=32, max_size=32).filter(lambda key: key != KEY))
def test_nothing_that_was_signed_under_another_key_passes(junk: bytes, key: bytes) -> None:
    assert names(SignedMavlink(KEY), junk, SignedMavlink(key).encode(AWAY, 1), encode(AWAY, 2)) == []


def test_a_link_without_a_key_counts_signed_frames() -> None:
    parser = MavlinkParser()
    raw = SignedMavlink(KEY).encode(BEAT, 7)
    assert [frame.name for frame in parser.feed(raw + encode(BEAT, 8))] == ["HEARTBEAT"] * 2
    assert (parser.statistics.signed, parser.statistics.frames) == (1, 2)
