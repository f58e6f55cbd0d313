"""Recordings of other years, distributions and programs: a type is its name and its definition."""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zstandard
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability, QosReliability
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore
from typer.testing import CliRunner

from volery.base.errors import UsageError
from volery.cli.main import application
from volery.ros.messages.bags import create_bag, open_bag, qos_profile
from volery.ros.messages.containers import Offer
from volery.ros.messages.store import distribution, new

MARKER, STATE, RANGE = "visualization_msgs/msg/Marker", "mavros_msgs/msg/State", "sensor_msgs/msg/Range"


def converted(path: Path, out: Path, *options: str) -> tuple[int, dict[str, Any], str]:
    """Return exit status, result and notes of ``volery ros bag convert``."""
    done = CliRunner().invoke(
        application(), ["ros", "bag", "convert", str(path), str(out), "--json", *options]
    )
    return done.exit_code, json.loads(done.stdout), done.stderr


def read_by_rosbags(path: Path) -> list[Any]:
    """Return what rosbags' own reader makes of a recording, by the definitions in it."""
    with AnyReader([path]) as reader:
        return [reader.deserialize(data, connection.msgtype) for connection, _, data in reader.messages()]


def made(types: Typestore, name: str, **fields: Any) -> Any:
    """Return a message of rosbags' class, every other field zero."""

    def zero(kind: int, detail: Any) -> Any:
        if kind == 2:
            return made(types, detail)
        if kind == 1:
            return "" if detail[0] == "string" else False if detail[0] == "bool" else 0
        item = detail[0]
        return [] if item[0] == 2 or item[1][0] == "string" else np.zeros(0, item[1][0].replace("byte", "u1"))

    given = {label: fields.get(label, zero(*what)) for label, what in types.fielddefs[name][1]}
    return types.types[name](**given)


def old_types(**texts: str) -> Typestore:
    """Return Noetic's types in which these have another definition."""
    noetic = get_typestore(Stores.ROS1_NOETIC)
    types = get_typestore(Stores.EMPTY)
    known = ("std_msgs/msg/Header", "builtin_interfaces/msg/Time")
    types.register({one: noetic.fielddefs[one] for one in known})
    for name, text in texts.items():
        types.register(get_types_from_msg(text, name.replace("__", "/")))
    return types


def rosbag1(path: Path, types: Typestore, messages: dict[str, tuple[str, list[Any]]]) -> Path:
    with Writer1(path) as writer:
        for topic, (name, found) in messages.items():
            text, digest = types.generate_msgdef(name, ros_version=1)
            connection = writer.add_connection(topic, name, msgdef=text, md5sum=digest)
            for number, message in enumerate(found):
                writer.write(connection, number, types.serialize_ros1(message, name))
    return path


def test_a_marker_of_ros1_becomes_one_of_ros2_and_back(tmp_path: Path) -> None:
    noetic = get_typestore(Stores.ROS1_NOETIC)
    markers = [made(noetic, MARKER, ns="way", id=number, text=f"wp {number}") for number in range(5)]
    path = rosbag1(tmp_path / "a.bag", noetic, {"/marker": (MARKER, markers)})
    status, result, notes = converted(path, tmp_path / "b")
    assert (status, result["written"]) == (0, 5)
    assert "our defaults for Marker.texture_resource" in notes
    assert [(one.id, one.text) for one in read_by_rosbags(tmp_path / "b")] == [
        (number, f"wp {number}") for number in range(5)
    ]
    assert [one.message.text for one in open_bag(tmp_path / "b").messages()] == [f"wp {n}" for n in range(5)]
    assert converted(tmp_path / "b", tmp_path / "c.bag")[0] == 0
    assert [one.text for one in read_by_rosbags(tmp_path / "c.bag")] == [f"wp {n}" for n in range(5)]


def test_a_state_of_an_older_mavros_is_read_by_its_own_definition(tmp_path: Path) -> None:
    types = old_types(
        mavros_msgs__msg__State="Header header\nbool connected\nbool armed\nbool guided\nstring mode\n"
    )
    path = rosbag1(
        tmp_path / "a.bag", types, {"/state": (STATE, [made(types, STATE, armed=True, mode="AUTO.MISSION")])}
    )
    (read,) = (one.message for one in open_bag(path).messages())
    assert (read.armed, read.mode, read.system_status) == (True, "AUTO.MISSION", 0)
    bag = open_bag(path)
    list(bag.messages())
    assert bag.differences == [
        "mavros_msgs/msg/State is read by its definition in the recording and our defaults for "
        "State.manual_input, State.system_status"
    ]
    assert converted(path, tmp_path / "b.bag")[0] == 0
    assert not hasattr(read_by_rosbags(tmp_path / "b.bag")[0], "system_status")  # as recorded


def test_fields_in_another_order_keep_their_values(tmp_path: Path) -> None:
    """Both layouts have the same size, so the bytes alone do not tell them apart."""
    name = "mavros_msgs/msg/ExtendedState"
    types = old_types(
        mavros_msgs__msg__ExtendedState="std_msgs/Header header\nuint8 landed_state\nuint8 vtol_state\n"
    )
    path = rosbag1(tmp_path / "a.bag", types, {"/x": (name, [made(types, name, landed_state=2)])})
    (read,) = (one.message for one in open_bag(path).messages())
    assert (read.landed_state, read.vtol_state) == (2, 0)
    assert converted(path, tmp_path / "b")[1]["written"] == 1
    assert read_by_rosbags(tmp_path / "b")[0].landed_state == 2


@pytest.mark.parametrize("plugin", list(StoragePlugin))
def test_a_recording_of_foxy_in_both_storages(tmp_path: Path, plugin: StoragePlugin) -> None:
    """Its SQLite holds no definitions: those of the first distribution that fits are taken."""
    foxy = get_typestore(Stores.ROS2_FOXY)
    path = tmp_path / "foxy"
    with Writer2(path, version=8, storage_plugin=plugin) as writer:
        connection = writer.add_connection("/marker", MARKER, typestore=foxy)
        for number in range(3):
            message = made(foxy, MARKER, id=number, text="here")
            writer.write(connection, number, foxy.serialize_cdr(message, MARKER))
    if plugin == StoragePlugin.SQLITE3:
        import sqlite3

        (file,) = path.glob("*.db3")
        database = sqlite3.connect(file)
        database.execute("DROP TABLE message_definitions")
        database.execute("UPDATE schema SET schema_version = 3")
        database.commit()
        database.close()
    bag = open_bag(path)
    assert [(one.message.id, one.message.text) for one in bag.messages()] == [(n, "here") for n in range(3)]
    if plugin == StoragePlugin.SQLITE3:
        assert "the fields of Galactic, as its definition is not in the recording" in bag.differences[0]
    assert converted(path, tmp_path / "b")[1]["written"] == 3
    assert [one.id for one in read_by_rosbags(tmp_path / "b")] == [0, 1, 2]


def mcap(path: Path, profile: str, fill: Callable[[McapWriter], None], **options: Any) -> Path:
    with path.open("wb") as file:
        writer = McapWriter(file, compression=CompressionType.ZSTD, **options)
        writer.start(profile=profile)
        fill(writer)
        writer.finish()
    return path


def recorded_by(store: Stores, path: Path, name: str, message: Any) -> Path:
    types = get_typestore(store)
    text, _ = types.generate_msgdef(name, ros_version=2)

    def fill(writer: McapWriter) -> None:
        channel = writer.register_channel("/t", "cdr", writer.register_schema(name, "ros2msg", text.encode()))
        writer.add_message(channel, 5, bytes(types.serialize_cdr(message(types), name)), 5)

    return mcap(path, "ros2", fill)


@pytest.mark.parametrize(("store", "variance"), [(Stores.ROS2_HUMBLE, 0.0), (Stores.ROS2_JAZZY, 0.25)])
def test_a_field_that_the_other_ros_lacks_is_named_and_costs_the_status(
    tmp_path: Path, store: Stores, variance: float
) -> None:
    more = {"variance": variance} if variance else {}
    path = recorded_by(store, tmp_path / "a.mcap", RANGE, lambda types: made(types, RANGE, range=1.5, **more))
    (read,) = (one.message for one in open_bag(path).messages())
    assert (read.range, read.variance) == (1.5, variance)
    status, result, notes = converted(path, tmp_path / "b")
    assert (status, result["fields_left_out"]) == (0, {})
    assert getattr(read_by_rosbags(tmp_path / "b")[0], "variance", 0.0) == variance
    status, result, notes = converted(path, tmp_path / "c.bag")
    assert (status, result["written"]) == (3 if variance else 0, 1)
    assert ("/t: fields are left out: sensor_msgs/msg/Range has no Range.variance there" in notes) == bool(
        variance
    )
    assert read_by_rosbags(tmp_path / "c.bag")[0].range == 1.5
    assert converted(path, tmp_path / "c.bag", "--allow-loss")[0] == 0


def test_a_type_that_changed_its_fields_is_not_read_by_the_bytes(tmp_path: Path) -> None:
    """Lyrical's event has a stamp where others have a whole number of the same size."""
    name = "lifecycle_msgs/msg/TransitionEvent"
    path = recorded_by(
        Stores.ROS2_LYRICAL,
        tmp_path / "a.mcap",
        name,
        lambda types: made(types, name, stamp=made(types, "builtin_interfaces/msg/Time", sec=100, nanosec=7)),
    )
    bag = open_bag(path)
    (read,) = (one.message for one in bag.messages())
    assert read.timestamp == 0
    assert "TransitionEvent.stamp" in bag.left_out["/t"]
    for out in ("b", "c.bag"):
        assert converted(path, tmp_path / out)[0] == 0
        (kept,) = read_by_rosbags(tmp_path / out)
        assert (kept.stamp.sec, kept.stamp.nanosec) == (100, 7)


def test_two_definitions_of_one_type_in_one_recording(tmp_path: Path) -> None:
    def fill(writer: McapWriter) -> None:
        for topic, text, data in (
            ("/old", "int32 a\n", struct.pack("<i", 1)),
            ("/new", "float64 b\nint32 a\n", struct.pack("<di", 0.5, 2)),
        ):
            schema = writer.register_schema("pair_msgs/msg/Two", "ros2msg", text.encode())
            writer.add_message(writer.register_channel(topic, "cdr", schema), 1, b"\0\1\0\0" + data, 1)

    path = mcap(tmp_path / "a.mcap", "ros2", fill)
    assert sorted(one.message.a for one in open_bag(path).messages()) == [1, 2]
    assert converted(path, tmp_path / "b")[1]["written"] == 2
    assert sorted(one.a for one in read_by_rosbags(tmp_path / "b")) == [1, 2]


def test_two_types_of_one_topic_keep_their_own(tmp_path: Path) -> None:
    noetic = get_typestore(Stores.ROS1_NOETIC)
    path = tmp_path / "a.bag"
    with Writer1(path) as writer:
        for name, value in (
            ("std_msgs/msg/Float32", 1.5),
            ("std_msgs/msg/Int32", 7),
            ("std_msgs/msg/String", "w"),
        ):
            connection = writer.add_connection("/n", name, typestore=noetic)
            writer.write(connection, 1, noetic.serialize_ros1(made(noetic, name, data=value), name))
    bag = open_bag(path)
    assert [(one.name, one.type, one.messages) for one in bag.topics] == [
        ("/n", f"std_msgs/msg/{one}", 1) for one in ("Float32", "Int32", "String")
    ]
    assert {one.message.data for one in bag.messages()} == {1.5, 7, "w"}
    for out in ("b", "c.bag"):
        assert converted(path, tmp_path / out)[0] == 0
        assert {one.data for one in read_by_rosbags(tmp_path / out)} == {1.5, 7, "w"}


def test_an_mcap_of_ros1_messages(tmp_path: Path) -> None:
    noetic = get_typestore(Stores.ROS1_NOETIC)
    name = "geometry_msgs/msg/PointStamped"
    text, digest = noetic.generate_msgdef(name, ros_version=1)

    def fill(writer: McapWriter) -> None:
        schema = writer.register_schema("geometry_msgs/PointStamped", "ros1msg", text.encode())
        metadata = {"callerid": "/rover", "latching": "1", "md5sum": digest}
        channel = writer.register_channel("/point", "ros1", schema, metadata)
        for number in range(10):
            point = made(noetic, "geometry_msgs/msg/Point", x=float(number))
            message = noetic.serialize_ros1(made(noetic, name, point=point), name)
            writer.add_message(channel, number, bytes(message), number)

    path = mcap(tmp_path / "a.mcap", "ros1", fill)
    bag = open_bag(path)
    assert bag.complete
    assert [one.message.point.x for one in bag.messages()] == list(range(10))
    assert converted(path, tmp_path / "b.bag")[0] == 0
    with AnyReader([tmp_path / "b.bag"]) as reader:
        (connection,) = reader.connections
        assert (connection.digest, connection.ext.callerid, connection.ext.latching) == (digest, "/rover", 1)


def test_an_encoding_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    def fill(writer: McapWriter) -> None:
        schema = writer.register_schema("pose", "protobuf", b"\x0a\x01a")
        writer.add_message(writer.register_channel("/p", "protobuf", schema), 1, b"\x0a\x01a", 1)
        writer.add_message(writer.register_channel("/j", "json", 0), 1, b'{"a": 1}', 1)
        writer.add_message(writer.register_channel("/none", "cdr", 0), 1, b"\0\1\0\0", 1)

    path = mcap(tmp_path / "a.mcap", "", fill)
    bag = open_bag(path)
    assert bag.complete
    assert bag.unreadable == {
        "/p": "its messages are encoded as protobuf; cdr, json or ros1 can be read",
        "/j": "its messages are encoded as json and have no schema",
        "/none": "its type (none) is not known and not defined in the recording",
    }
    status, result, notes = converted(path, tmp_path / "b")
    assert (status, result["written"], set(result["left_out"])) == (3, 0, {"/j", "/none", "/p"})
    assert "truncated" not in notes
    assert converted(path, tmp_path / "b", "--allow-loss")[0] == 0


DETECTION = {
    "type": "object",
    "properties": {
        "timestamp": {
            "type": "object",
            "title": "time",
            "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}},
        },
        "frameId": {"type": "string"},
        "size": {"type": "object", "properties": {"x": {"type": "number"}, "y": {"type": "number"}}},
        "picture": {"type": "string", "contentEncoding": "base64"},
        "ranges": {"type": "array", "items": {"type": "number"}},
        "places": {"type": "array", "items": {"$ref": "#/$defs/place"}},
        "rows": {"type": "array", "items": {"type": "array", "items": {"type": "integer"}}},
        "maybe": {"anyOf": [{"type": "null"}, {"type": "number"}]},
        "free": {},
        "from": {"type": "integer"},
    },
    "$defs": {
        "place": {
            "type": "object",
            "properties": {"x": {"type": "number"}, "next": {"$ref": "#/$defs/place"}},
        }
    },
}


def json_recording(path: Path, schema: object, *texts: str, name: str = "vendor.Detection") -> Path:
    def fill(writer: McapWriter) -> None:
        known = writer.register_schema(name, "jsonschema", json.dumps(schema).encode())
        channel = writer.register_channel("/seen", "json", known)
        for number, text in enumerate(texts):
            writer.add_message(channel, number, text.encode(), number)

    return mcap(path, "", fill)


@pytest.mark.parametrize("out", ["b", "b.bag"])
def test_json_becomes_messages_by_its_schema(tmp_path: Path, out: str) -> None:
    message = {
        "timestamp": {"sec": 100, "nsec": 5},
        "frameId": "map",
        "size": {"x": 1, "y": 0.5},
        "picture": "AQID",
        "ranges": [1, 2.5],
        "places": [{"x": 1}, {"x": 2, "next": {"x": 3}}],
        "rows": [[1, 2], [3]],
        "maybe": None,
        "free": {"a": [1]},
        "from": 7,
    }
    path = json_recording(tmp_path / "a.mcap", DETECTION, json.dumps(message))
    assert [topic.type for topic in open_bag(path).topics] == ["vendor/msg/Detection"]
    status, result, _ = converted(path, tmp_path / out)
    assert (status, result["written"], result["fields_left_out"]) == (0, 1, {})
    (seen,) = read_by_rosbags(tmp_path / out)
    assert (seen.timestamp.sec, seen.timestamp.nanosec, seen.frame_id) == (100, 5, "map")
    assert (seen.size.x, seen.size.y, seen.from_, seen.maybe) == (1.0, 0.5, 7, 0.0)
    assert (bytes(seen.picture), list(seen.ranges)) == (b"\1\2\3", [1.0, 2.5])
    assert [(one.x, one.next) for one in seen.places] == [(1.0, "null"), (2.0, '{"x": 3}')]
    assert (seen.rows, seen.free) == (["[1, 2]", "[3]"], '{"a": [1]}')
    (own,) = open_bag(path).messages()  # what is played
    assert (own.message.from_, own.message.size.x) == (7, 1.0)


def test_json_without_fields_in_its_schema_is_carried_as_text(tmp_path: Path) -> None:
    path = json_recording(tmp_path / "a.mcap", {"type": "object"}, '{"a": 1}', name="pose")
    assert converted(path, tmp_path / "b")[0] == 0
    (seen,) = read_by_rosbags(tmp_path / "b")
    assert (seen.__msgtype__, seen.json) == ("json/msg/Pose", '{"a": 1}')


def test_json_that_does_not_fit_is_left_out_and_named(tmp_path: Path) -> None:
    schema = {"type": "object", "properties": {"n": {"type": "integer"}, "x": {"type": "number"}}}
    large = "1" + "0" * 400
    wrong = ['{"n": "a"}', f'{{"n": {large}}}', f'{{"x": {large}}}', "[1]", '{"n": true}', "{", "[" * 100_000]
    for number, text in enumerate(wrong):
        path = json_recording(tmp_path / f"{number}.mcap", schema, '{"n": 1}', text)
        status, result, _ = converted(path, tmp_path / f"b{number}")
        assert (status, result["written"], list(result["left_out"])) == (3, 1, ["/seen"]), text[:20]
    path = json_recording(tmp_path / "more.mcap", schema, '{"n": 1, "other": 2}')
    status, result, _ = converted(path, tmp_path / "more")
    assert (status, result["written"], list(result["fields_left_out"])) == (3, 1, ["/seen"])
    deep: object = {}
    for _ in range(400):
        deep = {"type": "object", "properties": {"a": deep}}
    for schema_of_no_object in ([], 7, deep, {"properties": 7}, {"properties": {"a": {"type": {"b": []}}}}):
        path = json_recording(tmp_path / "s.mcap", schema_of_no_object, '{"n": 1}')
        assert open_bag(path).complete


@pytest.mark.parametrize("encoding", ["ros2idl", "omgidl"])
def test_definitions_in_idl_also_of_parts(tmp_path: Path, encoding: str) -> None:
    def struct_of(name: str, fields: str) -> str:
        return f"module demo_msgs {{ module msg {{ struct {name} {{ {fields} }}; }}; }};\n"

    line = "=" * 80 + "\nIDL: demo_msgs/msg/"
    outer = struct_of("Pair", "double a; sequence<int32> b; demo_msgs::msg::Part part;")
    text = f"{line}Pair\n{outer}{line}Part\n{struct_of('Part', 'int16 c;')}"
    if encoding == "omgidl":
        text = struct_of("Part", "int16 c;") + outer

    def fill(writer: McapWriter) -> None:
        schema = writer.register_schema("demo_msgs/msg/Pair", encoding, text.encode())
        channel = writer.register_channel("/pair", "cdr", schema)
        data = b"\0\1\0\0" + struct.pack("<dI2ih", 0.5, 2, 3, -3, 4)
        writer.add_message(channel, 1, data, 1)

    path = mcap(tmp_path / "a.mcap", "ros2", fill)
    (read,) = (one.message for one in open_bag(path).messages())
    assert (read.a, list(read.b), read.part.c) == (0.5, [3, -3], 4)
    assert converted(path, tmp_path / "b")[0] == 0
    assert read_by_rosbags(tmp_path / "b")[0].part.c == 4


def test_a_chunk_of_several_frames_in_a_file_without_an_index(tmp_path: Path) -> None:
    def record(kind: int, body: bytes) -> bytes:
        return struct.pack("<BQ", kind, len(body)) + body

    def text(value: str) -> bytes:
        return struct.pack("<I", len(value)) + value.encode()

    schema = struct.pack("<H", 1) + text("std_msgs/msg/String") + text("ros2msg") + text("string data")
    channel = struct.pack("<HH", 1, 1) + text("/s") + text("cdr") + text("")
    words = [record(5, struct.pack("<HIQQ", 1, 0, at, at) + b"\0\1\0\0\2\0\0\0a\0") for at in range(1, 7)]
    halves = record(3, schema) + record(4, channel) + b"".join(words[:3]), b"".join(words[3:])
    packed = b"".join(zstandard.ZstdCompressor().compress(half) for half in halves)
    whole = b"".join(halves)
    chunk = struct.pack("<QQQI", 1, 6, len(whole), zlib.crc32(whole)) + text("zstd")
    chunk += struct.pack("<Q", len(packed)) + packed
    magic = b"\x89MCAP0\r\n"
    path = tmp_path / "a.mcap"
    path.write_bytes(
        magic
        + record(1, text("ros2") + text("own"))
        + record(6, chunk)
        + record(15, bytes(4))
        + record(2, bytes(20))
        + magic
    )
    bag = open_bag(path)
    assert bag.complete
    assert [one.at for one in bag.messages()] == [1, 2, 3, 4, 5, 6]


def test_chunks_that_overlap_in_time_are_read_in_order(tmp_path: Path) -> None:
    def fill(writer: McapWriter) -> None:
        schema = writer.register_schema("std_msgs/msg/Int32", "ros2msg", b"int32 data\n")
        channel = writer.register_channel("/n", "cdr", schema)
        for at in (9, 2, 7, 4, 5, 6, 3, 8, 1, 0):
            writer.add_message(channel, at, b"\0\1\0\0" + struct.pack("<i", at), at)

    path = mcap(tmp_path / "a.mcap", "ros2", fill, chunk_size=100)
    assert [one.message.data for one in open_bag(path).messages()] == list(range(10))


LATCHED, UNRELIABLE = qos_profile(True, True, 1), qos_profile(False, False, 5)


def test_qos_latching_and_sender_go_through_every_format(tmp_path: Path) -> None:
    path = tmp_path / "a.bag"
    with create_bag(path) as writer:
        writer.write("/plan", 1, new("std_msgs/String", data="once"), Offer(True, "/planner"))
        writer.write("/tick", 2, new("std_msgs/String", data="on"), Offer(False, "/clock"))
    assert converted(path, tmp_path / "b")[0] == 0
    plan, tick = open_bag(tmp_path / "b").connections
    assert (plan.source.offer, tick.source.offer.latched) == (Offer(True, "/planner", (LATCHED,)), False)
    assert converted(tmp_path / "b", tmp_path / "c.bag")[0] == 0
    assert [one.source.offer for one in open_bag(tmp_path / "c.bag").connections] == [
        Offer(True, "/planner"),
        Offer(False, "/clock"),
    ]
    with create_bag(tmp_path / "d") as writer:
        writer.write("/scan", 1, new("std_msgs/String"), Offer(False, "", (UNRELIABLE,)))
    assert converted(tmp_path / "d", tmp_path / "e")[0] == 0
    with AnyReader([tmp_path / "e"]) as reader:
        (profile,) = reader.connections[0].ext.offered_qos_profiles
    assert (profile.reliability, profile.durability) == (QosReliability.BEST_EFFORT, QosDurability.VOLATILE)


def test_a_recording_that_is_cut_is_converted_with_status_3(tmp_path: Path) -> None:
    with create_bag(tmp_path / "a.bag") as writer:
        for number in range(300):
            writer.write("/n", number, new("std_msgs/String", data="x" * 100))
    cut = tmp_path / "cut.bag"
    cut.write_bytes((tmp_path / "a.bag").read_bytes()[:15000])
    status, result, notes = converted(cut, tmp_path / "b.bag")
    assert (status, 0 < result["written"] < 300, "is truncated" in notes) == (3, True, True)


def test_a_topic_that_was_not_recorded_is_bad_input(tmp_path: Path) -> None:
    with create_bag(tmp_path / "a.bag") as writer:
        writer.write("/n", 1, new("std_msgs/String"))
    done = CliRunner().invoke(
        application(),
        ["ros", "bag", "convert", str(tmp_path / "a.bag"), str(tmp_path / "b"), "--topic", "/m"],
    )
    assert (done.exit_code, "has no topic /m" in done.stderr) == (2, True)


def test_a_value_that_does_not_fit_the_other_definition_is_named(tmp_path: Path) -> None:
    from volery.ros.messages.conversion import Conversion

    wide, narrow = old_types(a__msg__B="int32 n\nuint16[] m\n"), old_types(a__msg__B="int8 n\nuint8[] m\n")
    convert = Conversion(wide, narrow, "a/msg/B", narrow.types.__getitem__)
    assert convert(made(wide, "a/msg/B", n=5, m=np.array([7], np.uint16))).m.tolist() == [7]
    with pytest.raises(UsageError, match=r"a/msg/B\.n: 300 does not fit: not from -128 to 127"):
        convert(made(wide, "a/msg/B", n=300))
    with pytest.raises(UsageError, match=r"a/msg/B\.m: .* does not fit: not all of them are uint8"):
        convert(made(wide, "a/msg/B", m=np.array([300], np.uint16)))


def test_a_folder_whose_metadata_states_other_qos_than_its_file(tmp_path: Path) -> None:
    """As ROS 2's own test bags; rosbags drops the messages of such a connection."""
    path = tmp_path / "a"
    with create_bag(path) as writer:
        writer.write("/n", 1, new("std_msgs/Int32", data=5), Offer(True, "", (LATCHED,)))
        writer.write("/m", 2, new("std_msgs/Int32", data=6), Offer(False, "", (UNRELIABLE,)))
    metadata = path / "metadata.yaml"
    lines = metadata.read_text().replace("reliability: best_effort", "reliability: reliable").splitlines()
    metadata.write_text("\n".join(lines))
    bag = open_bag(path)
    assert [one.message.data for one in bag.messages()] == [5, 6]


def test_a_definition_without_text_is_that_of_a_type_without_fields(tmp_path: Path) -> None:
    def fill(writer: McapWriter) -> None:
        schema = writer.register_schema("void_msgs/msg/Nothing", "ros2msg", b"")
        writer.add_message(writer.register_channel("/e", "cdr", schema), 1, b"\0\1\0\0\0", 1)

    path = mcap(tmp_path / "a.mcap", "ros2", fill)
    (read,) = open_bag(path).messages()
    assert read.message.__msgtype__ == "void_msgs/msg/Nothing"
    assert converted(path, tmp_path / "b")[0] == 0


def test_a_definition_that_does_not_fit_its_messages_gives_way_to_one_that_does(tmp_path: Path) -> None:
    def fill(writer: McapWriter) -> None:
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"uint8 level\n")
        data = b"\0\1\0\0\7\0\0\0a word\0"
        writer.add_message(writer.register_channel("/s", "cdr", schema), 1, data, 1)

    bag = open_bag(mcap(tmp_path / "a.mcap", "ros2", fill))
    assert [one.message.data for one in bag.messages()] == ["a word"]
    assert bag.differences == [
        f"std_msgs/msg/String is read by the fields of {distribution().capitalize()}, "
        "as its definition does not fit"
    ]


def test_messages_that_cannot_be_decoded_are_copied_within_ros2(tmp_path: Path) -> None:
    """Events of services are defined by the text of the service."""
    name, data = "demo_msgs/srv/Add_Event", b"\0\1\0\0anything"

    def fill(writer: McapWriter) -> None:
        schema = writer.register_schema(name, "ros2msg", b"int64 a\n---\nint64 sum\n")
        writer.add_message(writer.register_channel("/add/_service_event", "cdr", schema), 1, data, 1)

    path = mcap(tmp_path / "a.mcap", "ros2", fill)
    assert "Add_Event is not known" in open_bag(path).unreadable["/add/_service_event"]
    assert converted(path, tmp_path / "b")[:2] == (0, {"written": 1, "left_out": {}, "fields_left_out": {}})
    ((connection, raw),) = open_bag(tmp_path / "b").raw()
    assert (connection.source.type, raw.data) == (name, data)
    assert converted(path, tmp_path / "c.bag")[0] == 3


def test_messages_that_do_not_fit_their_type_are_named_and_cost_the_status(tmp_path: Path) -> None:
    noetic = get_typestore(Stores.ROS1_NOETIC)
    path = tmp_path / "a.bag"
    with Writer1(path) as writer:
        connection = writer.add_connection("/s", "std_msgs/msg/String", typestore=noetic)
        for number, data in enumerate((b"\2\0\0\0ab", b"\xff\xff\xff\x7fab", b"\2\0\0\0cd")):
            writer.write(connection, number, data)
    status, result, notes = converted(path, tmp_path / "b")
    assert (status, result["written"]) == (3, 2)
    assert "/s: messages are left out: " in notes
    assert [one.data for one in read_by_rosbags(tmp_path / "b")] == ["ab", "cd"]
