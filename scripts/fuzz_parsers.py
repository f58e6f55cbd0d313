"""Coverage-guided fuzzing of every parser: only errors of this project may leave it.

    pip install atheris
    python scripts/fuzz_parsers.py TARGET [-runs=N] [-max_total_time=SECONDS] [CORPUS]

TARGET is a name of TARGETS; the options are those of libFuzzer. An input that raises anything else is written
to the current folder as ``crash-…``. tests/properties/test_hostile_bytes.py keeps what was found.
"""

from __future__ import annotations

import re
import struct
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from importlib.resources import files
from io import BytesIO
from itertools import islice
from pathlib import Path

import atheris
from mcap.writer import CompressionType, IndexType, Writer

INSTRUMENTED = ["volery.base", "volery.links", "volery.model", "volery.ros.messages", "volery.trace"]
INSTRUMENTED += ["mcap", "pymavlink.DFReader", "pyulog"]

with atheris.instrument_imports(include=INSTRUMENTED):
    import pyulog  # noqa: F401  # the reader of logs imports it when it is needed

    from volery.base.errors import VoleryError
    from volery.base.units import QuantityError, parse
    from volery.cost.catalogue import read_catalogue
    from volery.links.flight_logs import DATAFLASH_HEAD, ULOG_MAGIC, read_flight_log
    from volery.links.frame import Frame
    from volery.links.mavlink_codec import MavlinkParser, SignedMavlink
    from volery.links.pprzlink_codec import PPRZLINK, PprzlinkParser
    from volery.links.pprzlink_messages import DATALINK, TELEMETRY
    from volery.links.pprzlink_messages import message_type_of as pprz_type_of
    from volery.links.tlog import read_tlog
    from volery.model.reading import Vocabulary
    from volery.model.system_loader import load
    from volery.ros.messages import RosMessage, new
    from volery.ros.messages.bags import create_bag, open_bag
    from volery.ros.messages.encodings import from_cdr, from_ros1, to_cdr, to_ros1
    from volery.ros.messages.store import idl_fields, interface_messages
    from volery.testing.fuzzing import SEALS
    from volery.testing.sample_run import sample_events, sample_setup
    from volery.trace.attachments import SETUP_ATTACHMENT, ComponentSetup, RunSetup, to_json
    from volery.trace.encoding import EventCodec, type_name
    from volery.trace.events import Published
    from volery.trace.mcap_writer import TRACE_SCHEMA, McapWriter
    from volery.trace.reader import OpenTrace
    from volery.vehicles import address

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests"))
from rigs.flight_log_files import dataflash, ulog  # noqa: E402

MEMORY = Path("/dev/shm")
"""A file system in memory, where a file is written in a hundredth of the time."""
FOLDER = Path(tempfile.mkdtemp(prefix="fuzz-", dir=MEMORY if MEMORY.is_dir() else None))
VOCABULARY = Vocabulary({}, frozenset({"ardupilot", "px4"}))
MESSAGES = 200
"""Messages read of one file: a longer one shows nothing new."""
TYPES = (
    "sensor_msgs/msg/NavSatFix",
    "sensor_msgs/msg/PointCloud2",
    "diagnostic_msgs/msg/DiagnosticArray",
    "mavros_msgs/msg/State",
    "geometry_msgs/msg/PolygonStamped",
    "tf2_msgs/msg/TFMessage",
)


def _file(suffix: str, read: Callable[[Path], object], head: bytes = b"") -> Callable[[bytes], None]:
    """Return a target that reads its input, after the bytes by which a format is recognised, from a file."""

    def run(data: bytes) -> None:
        with suppress(VoleryError):
            read(_stored(suffix, head + data))

    return run


def _stored(suffix: str, data: bytes) -> Path:
    path = FOLDER / f"input{suffix}"
    path.write_bytes(data)
    return path


def _mavlink(data: bytes) -> None:
    MavlinkParser().feed(data)


_KEYED = SignedMavlink(bytes(32))


def _mavlink_signed(data: bytes) -> None:
    """A frame is forged here: the fuzzer has no key, so none may be received."""
    assert not _KEYED.parser().feed(data), "a forged frame was received"


def _pprzlink(data: bytes) -> None:
    PprzlinkParser().feed(data)


def _cdr(data: bytes) -> None:
    with suppress(VoleryError):
        from_cdr(TYPES[data[0] % len(TYPES)] if data else TYPES[0], data[1:])


def _ros1(data: bytes) -> None:
    with suppress(VoleryError):
        from_ros1(TYPES[data[0] % len(TYPES)] if data else TYPES[0], data[1:])


def _definition(data: bytes) -> None:
    with suppress(VoleryError):
        interface_messages("fuzz/msg/Fuzz", data.decode("utf-8", "replace"))


def _address(data: bytes) -> None:
    text = data.decode("utf-8", "surrogateescape")
    for parse_address in (address.parse, address.parse_listen):
        with suppress(VoleryError):
            parse_address(text)


def _quantity(data: bytes) -> None:
    with suppress(QuantityError):
        parse(data.decode("utf-8", "replace"))


def _trace(path: Path) -> None:
    with OpenTrace(path) as reading:
        for _ in islice(reading.events(), MESSAGES):
            pass


def _bag(path: Path) -> None:
    for _ in islice(open_bag(path).messages(), MESSAGES):
        pass


def _tlog(path: Path) -> None:
    for _ in islice(read_tlog(path), MESSAGES):
        pass


TARGETS: dict[str, Callable[[bytes], None]] = {
    "mavlink": _mavlink,
    "mavlink-signed": _mavlink_signed,
    "pprzlink": _pprzlink,
    "cdr": _cdr,
    "ros1": _ros1,
    "definition": _definition,
    "address": _address,
    "quantity": _quantity,
    "trace": _file(".mcap", _trace),
    "mcap": _file(".mcap", _bag),
    "rosbag": _file(".bag", _bag),
    "tlog": _file(".tlog", _tlog),
    "dataflash": _file(".bin", read_flight_log, DATAFLASH_HEAD),
    "dataflash-text": _file(".log", read_flight_log, b"FMT, "),
    "ulog": _file(".ulg", read_flight_log, ULOG_MAGIC),
    "model": _file(".yaml", lambda path: load(path, VOCABULARY)),
    "catalogue": _file(".yaml", read_catalogue),
}


def _filled(name: str) -> RosMessage:
    """Return a message with one element in each of its lists."""
    message: RosMessage = new(name)
    for label, kind in idl_fields(name).items():
        if kind.startswith("sequence<") and "/" in kind:
            setattr(message, label, [new(kind[9:-1])])
    return message


def _recorded() -> list[bytes]:
    lines = (ROOT / "tests/golden/frames/mavlink.txt").read_text(encoding="ascii").splitlines()
    return [bytes.fromhex(line.split()[1]) for line in lines]


def _signed() -> list[bytes]:
    """Return a frame that is signed with another key."""
    (frame,) = MavlinkParser().feed(_recorded()[0])
    return [*_recorded(), SignedMavlink(bytes(31) + b"\1").encode(frame, 0)]


def _every_pprzlink_message() -> list[bytes]:
    kinds = [pprz_type_of(sort, number) for sort in (TELEMETRY, DATALINK) for number in range(256)]
    return [PPRZLINK.encode(Frame(kind.name, {}, 1, 0), 0) for kind in kinds if kind is not None]


def _written_trace() -> list[bytes]:
    """Return a trace as it is written, and a short one without compression and checksums, for mutations."""
    path, short = FOLDER / "seed-trace.mcap", BytesIO()
    own = McapWriter(path, sample_setup(7))
    bare = {"repeat_channels": False, "repeat_schemas": False, "use_statistics": False, "enable_crcs": False}
    plain = Writer(short, compression=CompressionType.NONE, index_types=IndexType.NONE, **bare)
    plain.start("ros2", "volery")
    plain.add_metadata("volery", {"schema": TRACE_SCHEMA})
    setup = RunSetup("s", components=(ComponentSetup("c"),))
    plain.add_attachment(0, 0, SETUP_ATTACHMENT, "", to_json(setup))
    seen: set[type[object]] = {Published}
    for event in sample_events(7, 1.0):
        own(event)
        kind = type(event)
        if kind not in seen:
            seen.add(kind)
            number = plain.register_schema(type_name(kind), "ros2msg", b"")
            channel = plain.register_channel(kind.__name__, "cdr", number)
            plain.add_message(channel, 0, EventCodec(kind).encode(event), 0)
    own.close()
    plain.finish()
    return [path.read_bytes(), short.getvalue()]


def _written_bag(name: str, pattern: str) -> bytes:
    """Return a recording of two short messages: other targets decode long ones."""
    with create_bag(FOLDER / name) as bag:
        for at in range(2):
            bag.write(f"/t{at}", at, new("std_msgs/msg/String"))
    return next(FOLDER.glob(pattern)).read_bytes()


def _written_mcap() -> list[bytes]:
    """Return a file as it is written, and one without rosbag 2's metadata, for mutations."""
    short = BytesIO()
    plain = Writer(short, compression=CompressionType.NONE, enable_crcs=False)
    plain.start("ros2", "")
    number = plain.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
    for at in range(2):
        channel = plain.register_channel(f"/t{at}", "cdr", number)
        plain.add_message(channel, at, to_cdr(new("std_msgs/msg/String")), at)
    plain.finish()
    assert len(list(open_bag(_stored(".mcap", short.getvalue())).messages())) == 2
    return [_written_bag("seed", "seed/*.mcap"), short.getvalue()]


def _written_rosbag() -> list[bytes]:
    """Return a rosbag as it is written, and one without the padding of its first record, for mutations."""
    bag = _written_bag("seed.bag", "seed.bag")
    begin = bag.index(b"    ")
    end = begin + len(bag[begin:]) - len(bag[begin:].lstrip(b" "))
    short = bytearray(bag[:begin] + bag[end:])
    short[begin - 4 : begin] = bytes(4)
    for place in re.finditer(b"(index|chunk)_pos=", bytes(short)):
        (value,) = struct.unpack_from("<Q", short, place.end())
        struct.pack_into("<Q", short, place.end(), value - (end - begin))
    assert len(list(open_bag(_stored(".bag", bytes(short))).messages())) == 2
    return [bag, bytes(short)]


def _dataflash_log() -> list[bytes]:
    tables = {"ATT": ("Roll,Pitch", [(0.1, 1.0, 2.0), (0.2, 1.0, 2.0)])}
    return [dataflash(FOLDER / "seed.bin", tables).read_bytes().removeprefix(DATAFLASH_HEAD)]


def _ulog() -> list[bytes]:
    columns = {"attitude": ("float[4] q", [(0.1, 1.0, 0.0, 0.0, 0.0)])}
    return [ulog(FOLDER / "seed.ulg", columns).read_bytes().removeprefix(ULOG_MAGIC)]


SEEDS: dict[str, Callable[[], list[bytes]]] = {
    "mavlink": _recorded,
    "mavlink-signed": _signed,
    "pprzlink": _every_pprzlink_message,
    "cdr": lambda: [bytes([at]) + to_cdr(_filled(name)) for at, name in enumerate(TYPES)],
    "ros1": lambda: [bytes([at]) + to_ros1(_filled(name)) for at, name in enumerate(TYPES)],
    "definition": lambda: [
        b'uint8 A=1\nstd_msgs/Header header\nstring<=5 s "x"\nfloat64[3] v\nint32[<=4] w\n'
    ],
    "address": lambda: [b"px4:udp://:14540?system=1", b"ardupilot:serial:///dev/ttyUSB0?baud=57600"],
    "quantity": lambda: [b"2 ms", b"57600 bit/s", b"0.5 %", b"1e3 kg*m/s^2"],
    "trace": _written_trace,
    "mcap": _written_mcap,
    "rosbag": _written_rosbag,
    "tlog": lambda: [b"".join(bytes(8) + frame for frame in _recorded()[:10])],
    "dataflash": _dataflash_log,
    "dataflash-text": lambda: [
        b"128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n"
        b"FMT, 129, 15, ATT, Qf, TimeUS,Roll\nATT, 5, 1.5\n"
    ],
    "ulog": _ulog,
    "model": lambda: [(ROOT / "examples/starter/model.yaml").read_bytes()],
    "catalogue": lambda: [files("volery.cost").joinpath("catalogue.yaml").read_bytes()],
}
"""Valid inputs, from which mutations start."""


def _sealed(seal: Callable[[bytearray], bytes]) -> Callable[[bytes, int, int], bytes]:
    """Return a mutator that corrects the checksum of half of its frames, as parsers drop the others."""

    def mutate(data: bytes, size: int, seed: int) -> bytes:
        mutated = bytes(atheris.Mutate(data, len(data)))
        return mutated if seed % 2 else seal(bytearray(mutated))[:size]

    return mutate


def main() -> None:
    """Fuzz the target that the command line names."""
    if len(sys.argv) < 2 or sys.argv[1] not in TARGETS:
        sys.exit(f"{__doc__}\nTargets: {', '.join(TARGETS)}")
    name = sys.argv.pop(1)
    corpus = FOLDER / "seeds"
    corpus.mkdir()
    for number, seed in enumerate(SEEDS[name]()):
        (corpus / str(number)).write_bytes(seed)
    mutators = {"mavlink": SEALS["MAVLink"], "pprzlink": SEALS["pprzlink"]}
    options = {"custom_mutator": _sealed(mutators[name])} if name in mutators else {}
    atheris.Setup([*sys.argv, str(corpus)], TARGETS[name], **options)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
