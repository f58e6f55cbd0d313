"""Flight logs become tables of numbers; damaged ones as far as they can be read."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from rigs.flight_log_files import dataflash, tlog, ulog
from volery.base.errors import UsageError
from volery.links.flight_logs import DATAFLASH, TLOG, ULOG, columns_of, log_format, read_flight_log
from volery.links.frame import Frame
from volery.links.mavlink_codec import encode

BEAT = Frame("HEARTBEAT", {"type": 2, "autopilot": 3, "custom_mode": 4, "mavlink_version": 3}, 1, 1)


def attitude(yaw: float, system: int = 1) -> Frame:
    return Frame("ATTITUDE", {"time_boot_ms": 1, "yaw": yaw}, system, 1)


@pytest.fixture
def copter(tmp_path: Path) -> Path:
    rows = [(0.1 * step, 90.0, 9.0 * step) for step in range(20)]
    return dataflash(tmp_path / "00000001.BIN", {"ATT": ("DesYaw,Yaw", rows), "CTUN": ("Alt", [(0.0, 1.5)])})


@pytest.fixture
def px4(tmp_path: Path) -> Path:
    rows = [(0.1 * step, 1.0, 0.0, 0.0, 0.5 * step) for step in range(20)]
    return ulog(tmp_path / "log.ulg", {"vehicle_attitude": ("float[4] q", rows)})


@pytest.fixture
def station(tmp_path: Path) -> Path:
    frames = [(0.0, BEAT), *((0.1 * step, attitude(0.1 * step)) for step in range(1, 20))]
    turn = Frame("COMMAND_LONG", {"target_system": 1, "command": 115, "param1": 90.0}, 255, 190)
    return tlog(tmp_path / "flight.tlog", [*frames, (2.5, turn)])


def test_formats_are_recognised_by_content(copter: Path, px4: Path, station: Path) -> None:
    assert [log_format(one) for one in (copter, px4, station)] == [DATAFLASH, ULOG, TLOG]


def test_a_dataflash_log(copter: Path) -> None:
    tables = read_flight_log(copter)
    assert tables["ATT"]["Yaw"].tolist() == [9.0 * step for step in range(20)]
    assert tables["ATT"]["time"] == pytest.approx(np.arange(20) * 0.1)
    assert tables["CTUN"]["Alt"].tolist() == [1.5]
    assert set(read_flight_log(copter, {"CTUN"})) == {"CTUN"}


def test_a_ulog(px4: Path) -> None:
    table = read_flight_log(px4)["vehicle_attitude"]
    assert table["q[3]"].tolist() == [0.5 * step for step in range(20)]
    assert table["time"] == pytest.approx(np.arange(20) * 0.1)


def test_a_tlog_keeps_the_station_apart(station: Path) -> None:
    tables = read_flight_log(station)
    assert tables["ATTITUDE"]["yaw"] == pytest.approx(0.1 * np.arange(1, 20))
    assert tables["station.COMMAND_LONG"]["param1"].tolist() == [90.0]
    assert "ATTITUDE.yaw" in list(columns_of(tables))
    assert "ATTITUDE.time" not in list(columns_of(tables))


def test_a_tlog_keeps_components_and_vehicles_apart(tmp_path: Path) -> None:
    """A gimbal states an autopilot before the aircraft does; a second aircraft has the same components."""
    beats = [Frame("HEARTBEAT", {**BEAT.fields}, *sender) for sender in ((1, 154), (1, 1), (2, 1), (2, 154))]
    frames = [(0.01 * number, beat) for number, beat in enumerate(beats)]
    for step in range(10):
        for number, (system, component) in enumerate([(1, 1), (1, 154), (2, 1), (2, 154), (255, 190)]):
            of = Frame("ATTITUDE", {"time_boot_ms": 1, "pitch": float(number)}, system, component)
            frames.append((0.1 * step + 0.1, of))
    path = tlog(tmp_path / "two.tlog", frames)
    named = ["", "component154.", "vehicle2.", "vehicle2.component154.", "station."]
    tables = read_flight_log(path)
    pitches = {name: set(table["pitch"]) for name, table in tables.items() if name.endswith("ATTITUDE")}
    assert pitches == {f"{prefix}ATTITUDE": {float(number)} for number, prefix in enumerate(named)}
    assert set(read_flight_log(path, {"ATTITUDE"})) == {"ATTITUDE", "vehicle2.ATTITUDE"}


def test_the_links_of_a_tlog_of_mavproxy_are_kept_apart(tmp_path: Path) -> None:
    records = [(1_000_000 + 20_000 * step, encode(attitude(0.01 * step), step)) for step in range(200)]
    records.append((1_000_000, encode(BEAT, 199)))
    both = [(at, 0, data) for at, data in records] + [(at + 1_500_000, 1, data) for at, data in records]
    path = tmp_path / "two.tlog"
    stamped = sorted(both, key=lambda one: one[0])
    path.write_bytes(b"".join(struct.pack(">Q", at & ~3 | link) + data for at, link, data in stamped))
    tables = read_flight_log(path)
    assert set(tables) == {"HEARTBEAT", "ATTITUDE", "link1.HEARTBEAT", "link1.ATTITUDE"}
    assert tables["ATTITUDE"]["yaw"] == pytest.approx(0.01 * np.arange(200))
    assert tables["link1.ATTITUDE"]["time"][0] == pytest.approx(1.5, abs=1e-4)


def test_instances_are_those_that_the_units_of_a_dataflash_log_mark(tmp_path: Path) -> None:
    """XKF1 has its number in C, BAT in Inst; the I of ISO is no instance, and MODE has none."""
    columns = {"XKF1": ("QBf", "TimeUS,C,Yaw", "s#d"), "BAT": ("QBf", "TimeUS,Inst,Volt", "s#v")}
    columns |= {"ISO": ("QBf", "TimeUS,I,X", "s--")}
    out = _defined(128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")
    out += _defined(129, 44, b"FMTU", b"QBNN", b"TimeUS,FmtType,UnitIds,MultIds")
    for kind, (name, (form, names, units)) in enumerate(columns.items(), 130):
        out += _defined(kind, 16, name.encode(), form.encode(), names.encode())
        out += b"\xa3\x95\x81" + struct.pack("<QB16s16s", 1, kind, units.encode(), b"F--")
    for step in range(5):
        for kind in range(130, 133):
            for number in range(3):
                out += struct.pack("<2sBQBf", b"\xa3\x95", kind, step, number, 10.0 * number)
    path = tmp_path / "cores.bin"
    path.write_bytes(out)
    tables = read_flight_log(path)
    for name, column in (("XKF1", "Yaw"), ("BAT", "Volt")):
        for number, table in enumerate((name, f"{name}[1]", f"{name}[2]")):
            assert set(tables[table][column]) == {10.0 * number}
    assert len(tables["ISO"]["X"]) == 15
    assert "ISO[1]" not in tables


def test_a_dataflash_log_of_before_2015_has_its_times_in_milliseconds(tmp_path: Path) -> None:
    out = _defined(128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")
    out += _defined(129, 11, b"ATT", b"If", b"TimeMS,Roll")
    out += _defined(130, 15, b"GPS", b"IfI", b"TimeMS,Alt,T")  # its TimeMS is that of the week
    for step in range(5):
        out += b"\xa3\x95\x81" + struct.pack("<If", 1000 + 100 * step, step)
        out += b"\xa3\x95\x82" + struct.pack("<IfI", 345_600_000, step, 1000 + 100 * step)
    path = tmp_path / "old.bin"
    path.write_bytes(out)
    tables = read_flight_log(path)
    for name, column in (("ATT", "Roll"), ("GPS", "Alt")):
        assert tables[name]["time"] == pytest.approx(1.0 + 0.1 * np.arange(5))
        assert tables[name][column].tolist() == [0, 1, 2, 3, 4]


def test_a_log_that_was_cut_is_read_up_to_the_cut(copter: Path, px4: Path, station: Path) -> None:
    for path, table in ((copter, "ATT"), (px4, "vehicle_attitude"), (station, "ATTITUDE")):
        whole = read_flight_log(path)[table]
        path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])
        part = read_flight_log(path)[table]
        assert 3 < len(part["time"]) <= len(whole["time"])


def test_damage_inside_a_log_does_not_end_it(copter: Path, capfd: pytest.CaptureFixture[str]) -> None:
    data = bytearray(copter.read_bytes())
    data[400:410] = bytes(10)
    copter.write_bytes(data + bytes(20) + data)
    assert len(read_flight_log(copter)["ATT"]["time"]) >= 30
    assert capfd.readouterr() == ("", "")  # the index in C has a line for each damaged byte


@pytest.mark.parametrize("length", [0, 2])
def test_a_definition_of_a_message_without_length_is_refused_and_not_read_for_ever(
    copter: Path, length: int
) -> None:
    data = bytearray(copter.read_bytes())
    second = data.index(b"\xa3\x95\x80", 5)
    data[second + 4] = length
    copter.write_bytes(data)
    with pytest.raises(UsageError, match=f"at byte {second} it defines a message of {length} bytes"):
        read_flight_log(copter)


def _defined(kind: int, length: int, name: bytes, form: bytes, columns: bytes) -> bytes:
    return struct.pack("<3sBB4s16s64s", b"\xa3\x95\x80", kind, length, name, form, columns)


def test_a_definition_inside_a_damaged_one_is_not_read_for_ever(tmp_path: Path) -> None:
    """Found by fuzzing: pymavlink refuses the outer definition and takes the inner one."""
    inner = _defined(1, 0, b"ATT", b"", b"")
    unknown, outer = b"\xa3\x95\x02", b"\xa3\x95\x80"
    path = tmp_path / "log.bin"
    path.write_bytes(unknown + outer + inner + b"\xa3\x95\x01" + bytes(8))
    with pytest.raises(UsageError, match="holds no message"):
        read_flight_log(path)


UNKNOWN, SHORT = b"XYZ, 1, 2\n", b"ATT, 5\n"
MADE_OF_TEXT = (
    b"FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\nFMT, 129, 15, ATT, Qf, TimeUS,Roll\n"
)
MADE_OF_BYTES = _defined(128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")
MADE_OF_BYTES += _defined(129, 15, b"ATT", b"Qf", b"TimeUS,Roll")
MADE_OF_BYTES += _defined(130, 5, b"BAD", b"Qf", b"TimeUS,X")  # shorter than its fields


@pytest.mark.parametrize(
    ("definitions", "unreadable", "message"),
    [
        (MADE_OF_TEXT, UNKNOWN, b"ATT, 5000000, 1.5\n"),
        (MADE_OF_TEXT, SHORT, b"ATT, 5000000, 1.5\n"),
        (MADE_OF_BYTES, b"\xa3\x95\x82\0\0", b"\xa3\x95\x81" + struct.pack("<Qf", 5_000_000, 1.5)),
    ],
)
def test_any_number_of_unreadable_messages_is_passed_over(
    tmp_path: Path, definitions: bytes, unreadable: bytes, message: bytes
) -> None:
    path = tmp_path / "log.bin"
    path.write_bytes(definitions + 3000 * unreadable + message + bytes(600))
    table = read_flight_log(path)["ATT"]
    assert list(table["time"]) == [5.0]
    assert list(table["Roll"]) == [1.5]


def test_a_format_that_does_not_exist_ends_the_log_there(copter: Path) -> None:
    data = copter.read_bytes()
    copter.write_bytes(
        data.replace(b"Qff", b"tff", 1) if b"Qff" in data else data.replace(b"BBnNZ", b"FMTnN")
    )
    with pytest.raises(UsageError, match="holds no message"):
        read_flight_log(copter, ["NONE"])


SEEKS_BEFORE_THE_FILE = (
    b"ULog\x01\x12\x35\x01@B\xd0\xd0\x0f" + bytes(5) + b"(\0B" + bytes(5) + b"\x80" + bytes(10)
)
SEEKS_BEFORE_THE_FILE += b"\xff" + bytes(4)
"""Found by fuzzing: flags with the offset of appended data at -2^31."""


def test_a_ulog_that_ends_inside_damaged_definitions_is_refused_and_not_read_for_ever(px4: Path) -> None:
    whole = px4.read_bytes()
    first = 16 + 3 + 40
    px4.write_bytes(whole[:first] + b"\xff\xff\x00" + whole[first:-40])
    with pytest.raises(UsageError, match=f"at byte {first} it defines a message of 65535 bytes"):
        read_flight_log(px4)


def test_damage_inside_the_definitions_of_a_ulog_does_not_end_it(tmp_path: Path) -> None:
    rows = [(0.1 * step, 1.0, 0.0, 0.0, 0.0) for step in range(1000)]
    path = ulog(tmp_path / "log.ulg", {"vehicle_attitude": ("float[4] q", rows)})
    whole = path.read_bytes()
    first = 16 + 3 + 40
    path.write_bytes(whole[:first] + bytes(5) + whole[first:])
    assert len(read_flight_log(path)["vehicle_attitude"]["time"]) == 1000


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "is empty"),
        (b"time,yaw\n0.0,1.0\n", "no flight log"),
        (b"ULog\x01\x12\x35\x01" + bytes(8), "holds no message|damaged ULog"),
        (b"\xa3\x95\x80", "holds no message"),
        (SEEKS_BEFORE_THE_FILE, "damaged ULog"),
    ],
)
def test_what_is_no_log_is_refused_by_name(tmp_path: Path, content: bytes, said: str) -> None:
    path = tmp_path / "wrong.log"
    path.write_bytes(content)
    with pytest.raises(UsageError, match=said) as error:
        read_flight_log(path)
    assert "wrong.log" in str(error.value)


def test_a_missing_file_and_missing_messages_are_named(tmp_path: Path, copter: Path) -> None:
    with pytest.raises(UsageError, match="nowhere"):
        read_flight_log(tmp_path / "nowhere.bin")
    with pytest.raises(UsageError, match="no message among GPS"):
        read_flight_log(copter, {"GPS"})
