"""Recordings, written and read back, whole and cut short."""

from __future__ import annotations

from pathlib import Path

import pytest

from volery.base.errors import UsageError
from volery.base.time import MS
from volery.ros import messages
from volery.ros.messages.bags import BagTopic, create_bag, open_bag

WORDS, FIXES = "/words", "/drone_1/fix"
KINDS = pytest.mark.parametrize("name", ["flight.bag", "flight"])


def record(path: Path, count: int = 10, *, padding: int = 0) -> Path:
    with create_bag(path) as bag:
        for number in range(count):
            at = number * 100 * MS
            bag.write(WORDS, at, messages.new("std_msgs/String", data=f"word {number}" + " " * padding))
            fix = messages.new("sensor_msgs/NavSatFix", latitude=43.0 + number, altitude=12.5)
            fix.header.frame_id = "gps"
            bag.write(FIXES, at + 1, fix)
    return path


@KINDS
def test_what_is_written_is_read(tmp_path: Path, name: str) -> None:
    bag = open_bag(record(tmp_path / name))
    assert bag.topics == (
        BagTopic(FIXES, "sensor_msgs/msg/NavSatFix", 10),
        BagTopic(WORDS, "std_msgs/msg/String", 10),
    )
    assert (bag.start, bag.end, bag.complete) == (0, 900 * MS + 1, True)
    read = list(bag.messages())
    assert [one.at for one in read] == sorted(one.at for one in read)
    assert read[0].message == messages.new("std_msgs/String", data="word 0")
    assert (read[-1].topic, read[-1].message.latitude, read[-1].message.header.frame_id) == (FIXES, 52, "gps")
    assert [one.message.data for one in bag.messages([WORDS])] == [f"word {number}" for number in range(10)]


@KINDS
def test_an_older_one_is_replaced(tmp_path: Path, name: str) -> None:
    record(tmp_path / name, 5)
    assert open_bag(record(tmp_path / name, 2)).topics[0].messages == 2


def test_a_rosbag_1_that_was_cut_short(tmp_path: Path) -> None:
    whole = record(tmp_path / "whole.bag", 3000).read_bytes()
    cut = tmp_path / "cut.bag"
    cut.write_bytes(whole[: len(whole) * 2 // 3])
    bag = open_bag(cut)
    assert not bag.complete
    read = [one.message.data for one in bag.messages([WORDS])]
    assert read == [f"word {number}" for number in range(len(read))]
    assert 1000 < len(read) < 3000


def test_an_mcap_that_was_cut_short(tmp_path: Path) -> None:
    (file,) = record(tmp_path / "whole", 3000, padding=1000).glob("*.mcap")
    whole = file.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: len(whole) * 2 // 3])
    bag = open_bag(cut)
    assert not bag.complete
    assert 500 < len(list(bag.messages([WORDS]))) < 3000


def test_a_rosbag_2_whose_writer_was_killed(tmp_path: Path) -> None:
    record(tmp_path / "flight")
    (tmp_path / "flight/metadata.yaml").unlink()
    bag = open_bag(tmp_path / "flight")
    assert (bag.complete, len(list(bag.messages()))) == (True, 20)  # the file has its end
    (file,) = (tmp_path / "flight").glob("*.mcap")
    file.write_bytes(file.read_bytes()[:-20])
    bag = open_bag(tmp_path / "flight")
    assert (bag.complete, len(list(bag.messages()))) == (False, 20)


def test_unknown_types_are_defined_from_the_recording(tmp_path: Path) -> None:
    from rosbags.rosbag1 import Writer

    path = tmp_path / "odd.bag"
    with Writer(path) as writer:
        connection = writer.add_connection(
            "/odd", "odd_msgs/msg/Pair", msgdef="int32 kOne=1\nint32 one\nint32 two\n", md5sum="0" * 32
        )
        writer.write(connection, 5, b"\1\0\0\0\2\0\0\0")
    (read,) = open_bag(path).messages()
    assert (read.message.one, read.message.two) == (1, 2)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("missing.bag", None, "no recording"),
        ("words.txt", b"hello", "a .bag or .mcap file"),
        ("empty.bag", b"", "nothing of it can be read"),
        ("noise.mcap", bytes(range(256)) * 9, "nothing of it can be read"),
        ("noise.db3", bytes(range(256)) * 9, "no rosbag 2 that can be read"),
    ],
)
def test_what_is_no_recording(tmp_path: Path, name: str, content: bytes | None, said: str) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(UsageError, match=said):
        open_bag(path)


def test_a_folder_that_cannot_be_written(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot be written"):
        create_bag(tmp_path / "nowhere/flight.bag")


def test_one_topic_one_type(tmp_path: Path) -> None:
    with create_bag(tmp_path / "flight.bag") as bag:
        bag.write(WORDS, 0, messages.new("std_msgs/String"))
        with pytest.raises(UsageError, match="carries std_msgs/msg/String, not std_msgs/msg/Int32"):
            bag.write(WORDS, 1, messages.new("std_msgs/Int32"))
