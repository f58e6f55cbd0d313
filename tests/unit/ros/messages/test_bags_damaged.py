"""Recordings of others: damaged, compressed beyond measure, with hostile names and definitions."""

from __future__ import annotations

import bz2
from io import BytesIO
from pathlib import Path
from random import Random

import lz4.frame
import pytest
import zstandard
from mcap.writer import CompressionType, Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagWriter
from rosbags.typesys import Stores, get_typestore
from typer.testing import CliRunner

from volery.base.errors import UsageError
from volery.cli.main import application
from volery.ros.messages import bags, containers
from volery.ros.messages import new as message_of
from volery.ros.messages.bags import create_bag, open_bag
from volery.ros.messages.containers import decompressed
from volery.ros.messages.store import define

CHUNK = 700
MESSAGES = 60
WORD = "a word"


def recorded(
    path: Path, compression: CompressionType, definition: str = "string data\n", kind: str = "x_msgs/msg/Word"
) -> bytes:
    """Write an MCAP file of many small chunks and return its bytes."""
    stream = BytesIO()
    writer = Writer(stream, chunk_size=CHUNK, compression=compression)
    writer.start(profile="ros2")
    schema = writer.register_schema(kind, "ros2msg", definition.encode())
    channel = writer.register_channel("/words", "cdr", schema)
    text = WORD.encode() + b"\0"
    payload = b"\0\1\0\0" + len(text).to_bytes(4, "little") + text
    for number in range(MESSAGES):
        writer.add_message(channel, number * 1000, payload, number * 1000)
    writer.finish()
    path.write_bytes(stream.getvalue())
    return stream.getvalue()


@pytest.mark.parametrize("compression", list(CompressionType))
def test_a_spoiled_recording_is_salvaged_or_refused_with_its_name(
    tmp_path: Path, compression: CompressionType
) -> None:
    file = tmp_path / "spoiled.mcap"
    whole = recorded(file, compression)
    random = Random(7)
    counts = []
    for _ in range(150):
        spoiled = bytearray(whole)
        for _ in range(random.randint(1, 3)):
            spoiled[random.randrange(8, len(spoiled))] ^= 1 << random.randrange(8)
        if random.random() < 0.3:
            del spoiled[random.randrange(8, len(spoiled)) :]
        file.write_bytes(spoiled)
        try:
            counts.append(len(list(open_bag(file).messages())))
        except UsageError as error:
            assert str(file) in str(error)  # noqa: PT017
    assert max(counts) >= MESSAGES - 2 * CHUNK // 40
    assert max(counts) <= MESSAGES


@pytest.mark.parametrize("compression", [CompressionType.LZ4, CompressionType.ZSTD])
def test_one_flipped_bit_in_a_chunk_loses_that_chunk_only_and_is_reported(
    tmp_path: Path, compression: CompressionType
) -> None:
    file = tmp_path / "flipped.mcap"
    whole = bytearray(recorded(file, compression))
    magic = b"\x04\x22\x4d\x18" if compression == CompressionType.LZ4 else b"\x28\xb5\x2f\xfd"
    second = whole.index(magic, whole.index(magic) + 4)
    whole[second + 20] ^= 1
    file.write_bytes(whole)
    bag = open_bag(file)
    read = list(bag.messages())
    assert MESSAGES / 2 < len(read) < MESSAGES
    assert [one.at for one in read] == sorted({one.at for one in read})
    assert bag.damage or not bag.complete


def test_the_bare_magic_is_no_recording(tmp_path: Path) -> None:
    file = tmp_path / "bare.mcap"
    file.write_bytes(b"\x89MCAP0\r\n")
    with pytest.raises(UsageError, match=r"bare\.mcap: nothing of it can be read"):
        open_bag(file)


@pytest.mark.parametrize(
    ("kind", "compress"),
    [("bz2", bz2.compress), ("lz4", lz4.frame.compress), ("zstd", zstandard.compress)],
)
def test_a_chunk_is_decompressed_up_to_a_limit(
    monkeypatch: pytest.MonkeyPatch, kind: str, compress: type
) -> None:
    data = bytes(100_000)
    assert decompressed(kind, compress(data)) == data
    monkeypatch.setattr(containers, "MAX_CHUNK", 99_999)
    with pytest.raises(ValueError, match="more than 99999 bytes"):
        decompressed(kind, compress(data))
    with pytest.raises(ValueError, match="damaged"):
        decompressed(kind, b"no such data")


def test_a_recording_whose_chunks_exceed_the_limit_is_not_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(containers, "MAX_CHUNK", 100)
    file = tmp_path / "bomb.mcap"
    recorded(file, CompressionType.ZSTD)
    bag = open_bag(file)
    assert list(bag.messages()) == []
    assert "bomb.mcap is damaged and left out" in bag.damage[0]


def test_what_is_salvaged_is_limited_in_total(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "bomb.mcap"
    whole = recorded(file, CompressionType.ZSTD)
    file.write_bytes(whole[: len(whole) * 3 // 4])
    salvaged = len(list(open_bag(file).messages()))
    assert salvaged > 20
    monkeypatch.setattr(bags, "MAX_SALVAGED", 200)
    bag = open_bag(file)
    assert 0 < len(list(bag.messages())) < salvaged
    assert "bomb.mcap is damaged; only its first" in bag.damage[0]


@pytest.mark.parametrize("field", [b"topic=", b"conn=", b"time=", b"op=", b"compression=", b"size="])
@pytest.mark.parametrize("new", [b"?", b"="])
def test_a_record_of_a_rosbag_without_a_field_is_left_out(tmp_path: Path, field: bytes, new: bytes) -> None:
    file = tmp_path / "spoiled.bag"
    with create_bag(file) as bag:
        bag.write("/words", 1, message_of("std_msgs/String", data=WORD))
        bag.write("/numbers", 2, message_of("std_msgs/Int32", data=5))
    whole = file.read_bytes()
    place, found = whole.find(field), 0
    while place >= 0:
        file.write_bytes(whole[:place] + new + whole[place + 1 :])
        try:
            found = max(found, len(list(open_bag(file).messages())))
        except UsageError as error:
            assert str(file) in str(error)  # noqa: PT017
        place = whole.find(field, place + 1)
    assert found <= 2


def test_a_type_that_contains_itself_is_named(tmp_path: Path) -> None:
    file = tmp_path / "recursive.mcap"
    definition = "x_msgs/Loop again\n" + "=" * 80 + "\nMSG: x_msgs/Loop\nx_msgs/Loop r\n"
    recorded(file, CompressionType.NONE, definition, "x_msgs/msg/Holder")
    bag = open_bag(file)
    assert list(bag.messages()) == []
    assert "/words" in str(bag.damage) or "/words" in bag.unreadable


def test_a_type_whose_name_begins_with_a_digit_is_named(tmp_path: Path) -> None:
    file = tmp_path / "digit.mcap"
    recorded(file, CompressionType.NONE, kind="5_msgs/msg/Word")
    bag = open_bag(file)
    assert "5_msgs/msg/Word is not known" in bag.unreadable["/words"]
    with pytest.raises(UsageError, match="5_msgs/msg/Word: not a name"):
        define("5_msgs/msg/Word", "string data\n")


def test_a_type_whose_name_is_none_is_reported_once_and_not_for_each_message(tmp_path: Path) -> None:
    file = tmp_path / "name.mcap"
    recorded(file, CompressionType.NONE, kind="x_msgs/m/Word")
    bag = open_bag(file)
    assert "x_msgs/m/Word is not known" in bag.unreadable["/words"]
    assert (list(bag.messages()), bag.damage) == ([], [])


def split_folder(path: Path, storage: StoragePlugin) -> list[int]:
    """Write a folder of two files and without ``metadata.yaml``; return the times of its messages."""
    times = []
    for part in range(2):
        one = path.with_name(f"part{part}")
        with RosbagWriter(one, version=9, storage_plugin=storage) as writer:
            given = writer.add_connection(
                "/words", "std_msgs/msg/String", typestore=get_typestore(Stores.ROS2_JAZZY)
            )
            for number in range(4):
                times.append(part * 100 + number)
                writer.write(given, times[-1], b"\0\1\0\0\2\0\0\0a\0")
        path.mkdir(exist_ok=True)
        (data,) = (file for file in one.iterdir() if file.suffix in (".mcap", ".db3"))
        data.rename(path / f"bag_{part}{data.suffix}")
    return times


@pytest.mark.parametrize("storage", list(StoragePlugin))
def test_a_folder_without_metadata_is_read_from_all_of_its_files(
    tmp_path: Path, storage: StoragePlugin
) -> None:
    folder = tmp_path / "bag"
    times = split_folder(folder, storage)
    bag = open_bag(folder)
    assert bag.complete
    assert (bag.start, bag.end, [topic.messages for topic in bag.topics]) == (times[0], times[-1], [8])
    assert [one.at for one in bag.messages()] == times
    assert "metadata.yaml" in bag.remark
    assert (
        CliRunner()
        .invoke(application(), ["ros", "bag", "convert", str(folder), str(tmp_path / "b")])
        .exit_code
        == 0
    )

    for text in ("", "rosbag2_bagfile_information: 7", "\0\0", "a: [" * 2000):
        (folder / "metadata.yaml").write_text(text)
        bag = open_bag(folder)
        assert [one.at for one in bag.messages()] == times
        assert not bag.complete  # it may have had more files
    (folder / "metadata.yaml").unlink()

    second = sorted(one for one in folder.iterdir())[1]
    second.write_bytes(second.read_bytes()[:200])
    bag = open_bag(folder)
    assert [one.at for one in bag.messages()] == times[:4]
    assert not bag.complete
    (folder / "bag_0.mcap").unlink(missing_ok=True)
    (folder / "bag_0.db3").unlink(missing_ok=True)
    with pytest.raises(UsageError, match=f"{folder} is no rosbag 2 that can be read: .*{second.name}"):
        open_bag(folder)
