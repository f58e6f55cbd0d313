"""What is written is what is read, byte for byte the same each time, and whatever happens to the file."""

import gc
import hashlib
import struct
import warnings
from io import BytesIO
from pathlib import Path
from zlib import crc32

import pytest
from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from rosbags.highlevel import AnyReader
from zstandard import ZstdDecompressor

from volery.base.errors import UsageError
from volery.base.time import MS, S
from volery.testing.sample_run import sample_events, sample_scenery, sample_setup
from volery.trace.attachments import (
    RunSetup,
    scenery_from_json,
    setup_from_json,
    to_json,
)
from volery.trace.events import Event, Failure, Published, Slice, Text
from volery.trace.mcap_writer import Attachment, McapWriter
from volery.trace.reader import OpenTrace, read

_MAP = Attachment("world.json", "application/json", to_json(sample_scenery()))


def write_sample(path: Path, seconds: float = 20.0, seed: int = 7) -> list[Event]:
    writer = McapWriter(path, sample_setup(seed), [_MAP], lambda name: "string data\n")
    events = list(sample_events(seed, seconds))
    for event in events:
        writer(event)
    writer.close()
    return events


def test_reads_back_what_was_written(tmp_path: Path) -> None:
    path = tmp_path / "trace.mcap"
    events = write_sample(path)
    trace = read(path)
    assert [repr(event) for event in trace.events] == [repr(event) for event in events]
    assert trace.complete
    assert trace.lost == ""
    assert trace.setup == sample_setup()
    assert scenery_from_json(trace.attachments["world.json"].data) == sample_scenery()
    assert trace.metadata["volery"] == {"schema": "volery-trace/1", "seed": "7"}


def test_same_run_same_bytes_other_seed_other_bytes(tmp_path: Path) -> None:
    digests = []
    for name, seed in (("a", 7), ("b", 7), ("c", 8)):
        write_sample(tmp_path / name, 5.0, seed)
        digests.append(hashlib.sha256((tmp_path / name).read_bytes()).hexdigest())
    assert digests[0] == digests[1]
    assert digests[0] != digests[2]


def test_the_mcap_library_reads_it_through_its_index(tmp_path: Path) -> None:
    path = tmp_path / "trace.mcap"
    events = write_sample(path)
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count == len(events)
        assert summary.statistics.message_start_time == 0
        assert reader.get_header().profile == "ros2"
        assert reader.get_header().library == "volery"
        strings = list(
            reader.iter_messages(topics=["/drone_1/state"], starting_at=5 * S, ending_before=8 * S)
        )
        assert [message.log_time for _, _, message in strings] == [5 * S, 6 * S, 7 * S]
        assert {schema.name for schema, _, _ in strings if schema} == {"std_msgs/msg/String"}
        assert sum(1 for _ in reader.iter_messages()) == len(events)
        assert [found.name for found in reader.iter_attachments()] == ["run-setup.json", "world.json"]


def test_chunks_end_with_each_simulated_second_and_are_in_the_file_at_once(tmp_path: Path) -> None:
    path = tmp_path / "trace.mcap"
    writer = McapWriter(path, RunSetup())
    for tick in range(35):
        writer(Text(tick * 100 * MS, "x", 6, str(tick)))
    trace = read(path)  # the writer lives on, as if it had been killed now
    assert [event.text for event in trace.events if isinstance(event, Text)] == [str(i) for i in range(30)]
    assert not trace.complete
    assert "0:00:02.900" in trace.lost
    writer.flush()
    assert len(read(path).events) == 35
    writer.close()
    writer.close()
    assert read(path).complete


def test_an_attachment_may_come_late(tmp_path: Path) -> None:
    path = tmp_path / "trace.mcap"
    writer = McapWriter(path, RunSetup())
    writer(Text(1, "x", 6, "before"))
    writer.attach(Attachment("notes.txt", "text/plain", b"late"))
    writer(Text(2, "x", 6, "after"))
    writer.close()
    trace = read(path)
    assert trace.attachments["notes.txt"].data == b"late"
    assert len(trace.events) == 2


def test_one_may_read_some_kinds_only(tmp_path: Path) -> None:
    path = tmp_path / "trace.mcap"
    events = write_sample(path)
    for kinds in ({Text, Slice}, {Published}, set()):
        with OpenTrace(path) as reading:
            found = list(reading.events(kinds))
        assert found == [event for event in events if type(event) in kinds]
        assert reading.complete


def test_two_publishers_of_one_topic_are_distinguished(tmp_path: Path) -> None:
    path = tmp_path / "trace.mcap"
    writer = McapWriter(path, RunSetup())
    events = tuple(
        Published(at, "/a", "std_msgs/msg/Empty", name, b"\0\1\0\0") for at, name in ((1, "p"), (2, "q"))
    )
    for event in events:
        writer(event)
    writer.close()
    assert read(path).events == events


def flip_a_bit(path: Path, chunk: int) -> None:
    """Damage the middle of one chunk of a trace."""
    with path.open("r+b") as file:
        summary = make_reader(file).get_summary()
        assert summary is not None
        index = summary.chunk_indexes[chunk]
        middle = index.chunk_start_offset + index.chunk_length // 2
        file.seek(middle)
        byte = file.read(1)[0]
        file.seek(middle)
        file.write(bytes([byte ^ 1]))


def uncompressed(path: Path, *, checksums: bool = True) -> None:
    """Write a trace anew as volery wrote it before chunks were compressed."""
    with path.open("rb") as file:
        found = list(StreamReader(file, emit_chunks=True).records)
    with path.open("wb") as file:
        file.write(b"\x89MCAP0\r\n")
        for record in found:
            if isinstance(record, records.Chunk):
                body = ZstdDecompressor().decompress(record.data)
                times = record.message_end_time, record.message_start_time
                checksum = record.uncompressed_crc if checksums else 0
                record = records.Chunk("", body, *times, checksum, len(body))  # noqa: PLW2901
            builder = RecordBuilder()
            record.write(builder)
            file.write(builder.end())
        file.write(b"\x89MCAP0\r\n")


@pytest.mark.parametrize("checksums", [True, False])
def test_a_trace_without_compression_opens(tmp_path: Path, *, checksums: bool) -> None:
    path = tmp_path / "trace.mcap"
    events = write_sample(path)
    size = path.stat().st_size
    uncompressed(path, checksums=checksums)
    assert path.stat().st_size > 3 * size
    trace = read(path)
    assert [repr(event) for event in trace.events] == [repr(event) for event in events]
    assert trace.complete


def test_a_trace_in_another_compression_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "trace.mcap"
    write_sample(path, 2.0)
    path.write_bytes(path.read_bytes().replace(b"\x04\0\0\0zstd", b"\x04\0\0\0zzzz"))
    with pytest.raises(UsageError, match=r"trace\.mcap is compressed by 'zzzz'"):
        read(path)


@pytest.mark.parametrize("share", [0.3, 0.5, 0.7, 0.9])
def test_a_cut_trace_gives_what_is_in_it(tmp_path: Path, share: float) -> None:
    path = tmp_path / "trace.mcap"
    events = write_sample(path)
    path.write_bytes(path.read_bytes()[: int(path.stat().st_size * share)])
    trace = read(path)
    assert [repr(event) for event in trace.events] == [repr(event) for event in events[: len(trace.events)]]
    assert 0 < len(trace.events) < len(events)
    assert "the writer never finished" in trace.lost


def test_a_damaged_chunk_is_left_out_and_said(tmp_path: Path) -> None:
    path = tmp_path / "trace.mcap"
    events = write_sample(path, 5.0)
    flip_a_bit(path, 3)
    trace = read(path)
    assert 0 < len(trace.events) < len(events)
    assert "damaged" in trace.lost
    assert not trace.complete


def test_events_of_a_channel_that_was_introduced_in_a_damaged_part_are_missing(tmp_path: Path) -> None:
    path = tmp_path / "trace.mcap"
    events = write_sample(path, 5.0)
    flip_a_bit(path, 0)  # the one with the definition of activations
    trace = read(path)
    assert 0 < len(trace.events) < len(events)
    first, second = trace.lost.split("; ")  # each loss once, in order
    assert first.startswith("a part that follows 0:00:00.000 is damaged: ")
    assert second.startswith("what a channel carries")


def test_a_damaged_attachment_is_left_out_and_said(tmp_path: Path) -> None:
    path = tmp_path / "trace.mcap"
    write_sample(path, 2.0)
    data = bytearray(path.read_bytes())
    place = data.index(b"world.json") - 4
    data[place : place + 4] = b"\xff\xff\xff\xff"  # the length of its name
    path.write_bytes(data)
    trace = read(path)
    assert "world.json" not in trace.attachments
    assert trace.lost.startswith("an attachment is damaged")
    assert not trace.complete


def test_a_message_that_is_shorter_than_its_frame_is_damage(tmp_path: Path) -> None:
    path = tmp_path / "trace.mcap"
    write_sample(path, 2.0)
    data, place = path.read_bytes(), 8
    while data[place] != Opcode.CHUNK:
        place += 9 + int.from_bytes(data[place + 1 : place + 9], "little")
    body = struct.pack("<BQ", Opcode.MESSAGE, 4) + bytes(4)
    chunk = bytes(24) + struct.pack("<IIQ", crc32(body), 0, len(body)) + body
    path.write_bytes(data[:place] + struct.pack("<BQ", Opcode.CHUNK, len(chunk)) + chunk)
    trace = read(path)
    assert not trace.events
    assert "is damaged" in trace.lost


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"\x89MCAP0\r\n" * 2 + b"\n\n\n", "does not contain the set-up of its run"),
        (b"", "not a trace"),
        (b"hello, I am a text", "not a trace"),
        (b"\x89MCAP0\r\n", "does not contain the set-up of its run"),
    ],
)
def test_other_files_are_refused(tmp_path: Path, content: bytes, says: str) -> None:
    path = tmp_path / "trace.mcap"
    path.write_bytes(content)
    with warnings.catch_warnings(record=True) as left_open:
        warnings.simplefilter("always", ResourceWarning)
        with pytest.raises(UsageError, match=says) as refusal:
            read(path)
        del refusal
        gc.collect()
    assert not left_open


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"none\.mcap"):
        read(tmp_path / "none.mcap")


def test_a_missing_folder_is_a_usage_error(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot write"):
        McapWriter(tmp_path / "none" / "trace.mcap", RunSetup())


class _FullDisk:
    """A file that takes so many bytes and no more."""

    def __init__(self, room: int) -> None:
        self.content = BytesIO()
        self.room = room
        self.closed = False

    def write(self, data: memoryview) -> int:
        if self.content.tell() >= self.room:
            raise OSError(28, "No space left on device")
        return self.content.write(data[: self.room - self.content.tell()])

    def truncate(self, size: int) -> None:
        self.content.truncate(size)

    def close(self) -> None:
        self.closed = True


def test_a_full_disk_leaves_a_readable_trace_and_a_problem(tmp_path: Path) -> None:
    path = tmp_path / "trace.mcap"
    writer = McapWriter(path, sample_setup())
    begun = path.stat().st_size
    disk = _FullDisk(100_000)
    writer._output._file.close()
    writer._output._file = disk
    disk.content.write(path.read_bytes())
    for event in sample_events(seconds=20.0):
        writer(event)
    writer.close()
    assert "No space left on device" in writer.problem
    assert str(path) in writer.problem
    assert disk.closed
    path.write_bytes(disk.content.getvalue())
    assert begun < path.stat().st_size <= 100_000
    trace = read(path)
    assert trace.events
    assert not trace.complete
    with OpenTrace(path) as reading:
        assert reading.setup == sample_setup()


def test_set_ups_survive_and_others_are_refused() -> None:
    assert setup_from_json(to_json(sample_setup())) == sample_setup()
    for wrong in (
        b"{",
        b"[]",
        b'{"schema":"volery-setup/9"}',
        b'{"schema":"volery-setup/1","seed":"x"}',
        b"[" * 10**5,
    ):
        with pytest.raises(UsageError, match=r"run-setup\.json"):
            setup_from_json(wrong)
    with pytest.raises(UsageError, match="map"):
        scenery_from_json(b"{}")


def test_a_trace_of_another_version_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "trace.mcap"
    write_sample(path, 1.0)
    path.write_bytes(path.read_bytes().replace(b"volery-trace/1", b"volery-trace/9"))
    with pytest.raises(UsageError, match="volery-trace/9"):
        read(path)


def test_slices_and_failures_keep_their_order_of_telling(tmp_path: Path) -> None:
    path = tmp_path / "trace.mcap"
    events = (Slice(5, 9, "p", 0, "t", "c"), Failure(2 * S, "c", "late"), Slice(1, 2, "p", 0, "t", "c"))
    writer = McapWriter(path, RunSetup())
    for event in events:
        writer(event)
    writer.close()
    assert read(path).events == events


def test_rosbags_reads_the_file_as_a_recording(tmp_path: Path) -> None:
    path = tmp_path / "trace.mcap"
    events = write_sample(path)
    with AnyReader([path]) as reader:
        found = [reader.deserialize(raw, connection.msgtype) for connection, _, raw in reader.messages()]
    assert len(found) == len(events)


def test_a_trace_is_complete_only_with_its_end_and_its_last_bytes(tmp_path: Path) -> None:
    path = tmp_path / "trace.mcap"
    events = write_sample(path)
    whole = path.read_bytes()
    for cut in (1, 4, 8):
        path.write_bytes(whole[:-cut])
        trace = read(path)
        assert len(trace.events) == len(events)
        assert not trace.complete
        assert trace.lost.startswith("the writer never finished")
    path.write_bytes(whole[: len(whole) // 2] + whole[-8:])
    assert not read(path).complete


def test_the_file_is_closed_at_the_end(tmp_path: Path) -> None:
    path = tmp_path / "trace.mcap"
    write_sample(path, seconds=1.0)
    with OpenTrace(path) as reading:
        list(reading.events())
        assert not reading._file.closed
    assert reading._file.closed


@pytest.mark.parametrize("share", [0.2, 0.5, 0.8])
def test_whole_records_of_a_chunk_that_is_cut_are_read(tmp_path: Path, share: float) -> None:
    path = tmp_path / "trace.mcap"
    events = write_sample(path, 0.9)
    uncompressed(path)
    data, place = path.read_bytes(), 8
    while data[place] != Opcode.CHUNK:
        place += 9 + int.from_bytes(data[place + 1 : place + 9], "little")
    length = int.from_bytes(data[place + 1 : place + 9], "little")
    cut = place + int(share * length)
    for end in range(cut, cut + 40, 3):
        path.write_bytes(data[:end])
        trace = read(path)
        assert 0 < len(trace.events) < len(events)
        assert [repr(event) for event in trace.events] == [repr(one) for one in events[: len(trace.events)]]
        assert trace.lost.startswith("the writer never finished; what follows ")
    assert len(trace.events) > share * len(events) / 2
