"""Classes of messages as rospy and rclpy have them, made of the same definitions as the graph's.

A client library's class is derived from the graph's and has the same slots. A received message, which is a
copy for its subscription, becomes one of the library in place: only classes are assigned. A list of numbers
is converted when it is read first, as rospy (tuple, bytes) and rclpy (``array.array``) have it. Publishing
copies to the graph's class and gives values as the library's encoding does.
"""

from __future__ import annotations

import json
import struct
import sys
from array import array
from collections.abc import Callable
from functools import cache, partial
from typing import IO, TYPE_CHECKING, Any, Literal, NamedTuple, cast

import numpy as np

from volery.base.errors import UsageError
from volery.ros.messages.encodings import from_ros1, ros1_name, ros1_service, ros1_type, to_ros1
from volery.ros.messages.message import (
    BYTES,
    SEQ,
    DurationValue,
    Header,
    MessageField,
    ReceivedNumbers,
    RosMessage,
    Stamp,
    TimeValue,
    ValueEncoding,
    default_value,
    generated_copy,
    may_be_long,
    plain_number,
    set_written,
    slot_of,
)
from volery.ros.messages.slot_types import slot_types
from volery.ros.messages.store import idl_fields, message_class, service

Library = Literal["", "rospy", "rclpy"]
"""A client library with classes of its own; empty for the graph's classes."""
ROSPY: Library = "rospy"
RCLPY: Library = "rclpy"
_CODES = {
    "int8": "b", "uint8": "B", "char": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I",
    "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
"""Type codes of ``array.array``."""
_UNSET: Any = object()


@cache
def message_of(name: str, library: Library = "") -> type[RosMessage]:
    """Return a client library's class of a message type; raise ``UsageError`` if the type is unknown."""
    of_graph = message_class(name)
    if not library:
        return of_graph
    if of_graph.__msgtype__ != name:
        return message_of(of_graph.__msgtype__, library)
    return cast("type[RosMessage]", _rospy_class(of_graph) if library == ROSPY else _rclpy_class(of_graph))


@cache
def service_of(full: str, library: Library = "") -> type:
    """Return the class of ``from package.srv import Name`` as a client library has it."""
    pair = service(full)
    request, response = (message_of(one.__msgtype__, library) for one in (pair.request, pair.response))
    members: dict[str, Any] = {"_type": full, "_request_class": request, "_response_class": response}
    label = full.rpartition("/")[2]
    if library == ROSPY:
        members |= {"_type": ros1_name(full), "_md5sum": _Lazy(lambda _: ros1_service(full).md5)}
        members["__module__"] = f"{full.partition('/')[0]}.srv._{label}"
    else:
        members |= {"Request": request, "Response": response}
    if library == RCLPY:
        members |= {"__init__": _no_instance, "__module__": generated_module(full)}
    return type(label, (), members)


def generated_module(full: str) -> str:
    """Return the module that rosidl generates for a type: ``std_msgs.msg._string``."""
    package, kind, label = full.split("/")
    return f"{package}.{kind}." + "".join(f"_{one.lower()}" if one.isupper() else one for one in label)


def _no_instance(self: Any) -> None:
    raise NotImplementedError("Service classes can not be instantiated")


def library_of(cls: Any) -> Library:
    """Return the client library of a message class."""
    return cast("Library", getattr(cls, "client_library", ""))


def adopt(message: Any, library: Library) -> Any:
    """Make a message of the graph one of a client library's class, in place, and return it.

    Only for a message of the caller alone.
    """
    if library and isinstance(message, RosMessage):
        cls: Any = message_of(message.__msgtype__, library)
        cls._adopt(message)
    return message


def receiving(cls: Any) -> Callable[[Any], Any] | None:
    """Return what makes a received message one of *cls*, or None if the graph's messages are."""
    return _adoption(cls) if hasattr(cls, "_adopt") else None


class _Lazy:
    """An attribute of a class that is computed when it is read first."""

    def __init__(self, compute: Callable[[Any], Any]) -> None:
        self._compute = compute

    def __get__(self, instance: Any, owner: Any) -> Any:
        return self._compute(owner)


class _Absent:
    """An attribute that a class of a client library does not have, though the graph's has it."""

    def __set_name__(self, owner: Any, name: str) -> None:
        self._name = name

    def __get__(self, instance: Any, owner: Any) -> Any:
        raise AttributeError(f"{owner.__name__!r} object has no attribute {self._name!r}")

    def __set__(self, instance: Any, value: Any) -> None:
        raise AttributeError(f"{type(instance).__name__!r} object has no attribute {self._name!r}")


def _derived(
    of_graph: Any, name: str, module: str, library: Library, bases: tuple[type, ...], members: dict[str, Any]
) -> Any:
    namespace = {"__slots__": (), "__module__": module, "client_library": library, **members}
    made: Any = type(name, (*bases, of_graph), namespace)
    made._adopt = _adopting(made)
    return made


def _fields(of_graph: Any) -> list[MessageField]:
    return list(of_graph.fields_of)


@cache
def bounded_fields(cls: Any) -> tuple[MessageField, ...]:
    """Return the fields of a message class that are sequences with a bound, or contain some."""
    return tuple(
        field for field in _fields(cls) if field.bound or (field.nested and bounded_fields(field.nested))
    )


def beyond_bound(message: Any, fields: tuple[MessageField, ...]) -> str:
    """Return which sequence of a message is longer than its definition allows, or an empty string.

    Fast DDS of Jazzy and Kilted refuses such a message; a string may be longer than its bound.
    """
    for field in fields:
        value = getattr(message, field.name)
        if field.bound and len(value) > field.bound:
            return f"{field.name} has {len(value)} items, at most {field.bound} are allowed"
        inner = bounded_fields(field.nested) if field.nested else ()
        for item in () if not inner else value if field.length is not None else (value,):
            found = beyond_bound(item, inner)
            if found:
                return f"{field.name}.{found}"
    return ""


class _FunctionSource:
    """Source of a function with its names."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.names: dict[str, Any] = {"unset": _UNSET}

    def name(self, value: Any) -> str:
        """Return a name for a value."""
        label = f"name_{len(self.names)}"
        self.names[label] = value
        return label

    def function(self, head: str, title: str) -> Any:
        """Return the function."""
        source = f"def function({head}):" + "".join(f"\n    {line}" for line in self.lines)
        exec(compile(source, f"<{title}>", "exec"), self.names)
        return self.names["function"]


def _adopting(cls: Any) -> Callable[[Any], Any]:
    """Return ``_adoption`` of *cls*, which is made at the first use."""

    def first(message: Any) -> Any:
        cls._adopt = _adoption(cls)
        return cls._adopt(message)

    return first


@cache
def _adoption(cls: Any) -> Callable[[Any], Any]:
    """Return what makes a message of the graph one of *cls*, a class of a client library."""
    writing = _FunctionSource()
    _write_adoption(writing, cls, "message", cls.client_library)
    made: Callable[[Any], Any] = writing.function("message", f"reception of {cls.__msgtype__}")
    return made


def _write_adoption(writing: _FunctionSource, cls: Any, of: str, library: Library) -> None:
    writing.lines.append(f"{of}.__class__ = {writing.name(cls)}")
    for field in _fields(cls):
        inner: Any = message_of(field.nested.__msgtype__, library) if field.nested else None
        if field.length is not None:
            if inner is not None:
                # the class attribute, since the first call replaces it
                writing.lines.append(f"for item in {of}.{field.name}: {writing.name(inner)}._adopt(item)")
            elif field.base != "string" and not _as_numpy(field, library):
                slot = slot_of(cls, field.name)
                get, put = writing.name(slot.__get__), writing.name(slot.__set__)
                writing.lines.append(f"{put}({of}, {writing.name(_boxed)}({get}({of})))")
        elif inner is not None:
            part = f"part_{len(writing.lines)}"
            writing.lines.append(f"{part} = {of}.{field.name}")
            _write_adoption(writing, inner, part, library)
    if of == "message":
        writing.lines.append("return message")


def _boxed(value: Any) -> Any:
    return ReceivedNumbers(value) if isinstance(value, np.ndarray) else value


def _as_numpy(one: MessageField, library: Library) -> bool:
    """Return whether a client library has a list of numbers as numpy array, as the graph has.

    A long one of the graph cannot be written.
    """
    return (
        library == RCLPY
        and bool(one.length)
        and one.base in _CODES
        and not may_be_long(one.base, one.length or 0)
    )


def _converting(
    cls: Any, one: MessageField, convert: Callable[[Any], Any], put: Callable[[Any], Any] | None
) -> Any:
    """Return the property of a list of numbers; *put* is applied to what is assigned."""
    slot = slot_of(cls, one.name)
    get, assign = slot.__get__, slot.__set__

    def read(self: Any) -> Any:
        value = get(self)
        if value.__class__ is ReceivedNumbers:
            value = convert(value.array)
            assign(self, value)
        return value

    def write(self: Any, value: Any) -> None:
        assign(self, value if put is None else put(value))

    return property(read, write)


# -- rospy


class MessageException(Exception):  # noqa: N818 - genpy's name
    """A message is wrong."""


class SerializationError(MessageException):
    """A value does not fit its field."""


class DeserializationError(MessageException):
    """Bytes are no message of a type."""


_ROS1_FIELDS: dict[str, dict[str, str]] = {
    "sensor_msgs/msg/CameraInfo": {"d": "D", "k": "K", "r": "R", "p": "P"},
    "sensor_msgs/msg/Range": {"variance": ""},
    "shape_msgs/msg/SolidPrimitive": {"polygon": ""},
    "stereo_msgs/msg/DisparityImage": {"t": "T"},
    "visualization_msgs/msg/Marker": {
        "texture_resource": "",
        "texture": "",
        "uv_coordinates": "",
        "mesh_file": "",
    },
}
"""ROS 1's names of fields by type and our name; empty for what ROS 1's definition lacks."""


def _rospy_class(of_graph: Any) -> Any:
    name = of_graph.__msgtype__
    label = ros1_name(name).rpartition("/")[2].replace("_Request", "Request").replace("_Response", "Response")
    fields = _fields(of_graph)
    renamed = _ROS1_FIELDS.get(name, {})
    shown = [field for field in fields if renamed.get(field.name, field.name)]
    slots = [renamed.get(one.name, one.name) for one in shown]
    types = [_ros1_type_of(one) for one in shown]
    bases: tuple[type, ...] = (_RospyMessage,)
    if issubclass(of_graph, Header):
        slots, types = ["seq", *slots], ["uint32", *types]
    if issubclass(of_graph, TimeValue):
        bases = (Ros1Time,)
    elif issubclass(of_graph, DurationValue):
        bases = (Ros1Duration,)
    members: dict[str, Any] = {
        "_type": ros1_name(name).replace("_Request", "Request").replace("_Response", "Response"),
        "_slot_types": types,
        "_md5sum": _Lazy(lambda _: ros1_type(name).md5),
        "_full_text": _Lazy(lambda _: ros1_type(name).text),
        "_has_header": _Lazy(lambda _: ros1_type(name).has_header),
    }
    for one in fields:
        if one.length is not None and one.nested is None and one.base != "string":
            members[one.name] = _converting(of_graph, one, partial(_as_tuple, one.base), None)
    for ours, theirs in renamed.items():
        if theirs:
            members[theirs] = members.get(ours) or _Renamed(ours)
    package = name.partition("/")[0]
    stamps = issubclass(of_graph, Stamp)
    module = "genpy.rostime" if stamps else f"{package}.{name.split('/')[1]}._{label}"
    made = _derived(of_graph, label, module, ROSPY, bases, members)
    if not stamps:
        made.__slots__ = slots
        made.__init__ = _rospy_init(made, of_graph, fields, slots, renamed)
    return made


@cache
def numpy_class(cls: Any) -> Any:
    """Return ``rospy.numpy_msg.numpy_msg(cls)``: its received lists of numbers are numpy arrays."""
    members = {
        field.name: _converting(cls, field, np.copy, None)
        for field in _fields(cls)
        if field.length is not None and field.nested is None and field.base not in ("string", "uint8", "char")
    }
    label = f"Numpy_{cls._type.replace('/', '__')}"
    namespace = {"__slots__": (), "__module__": "rospy.numpy_msg", "client_library": ROSPY, **members}
    made: Any = type(label, (cls,), namespace)
    made.__slots__ = cls.__slots__
    made._adopt = _adopting(made)
    return made


class _Renamed:
    """A field under ROS 1's name."""

    def __init__(self, ours: str) -> None:
        self._ours = ours

    def __get__(self, instance: Any, owner: Any) -> Any:
        return self if instance is None else getattr(instance, self._ours)

    def __set__(self, instance: Any, value: Any) -> None:
        setattr(instance, self._ours, value)


def _ros1_type_of(one: MessageField) -> str:
    base = ros1_name(one.nested.__msgtype__) if one.nested else one.base.replace("octet", "byte")
    base = {"builtin_interfaces/Time": "time", "builtin_interfaces/Duration": "duration"}.get(base, base)
    return base if one.length is None else f"{base}[{one.length or ''}]"


def _as_tuple(base: str, values: Any) -> Any:
    if base in ("uint8", "char"):
        shared = values.base
        return shared if shared.__class__ is bytes and len(shared) == len(values) else values.tobytes()
    return tuple((values.view(np.int8) if base in BYTES else values).tolist())


def _rospy_init(
    cls: Any, of_graph: Any, fields: list[MessageField], slots: list[str], renamed: dict[str, str]
) -> Callable[..., None]:
    """Return ``__init__``: no arguments, all fields in order, or some by name; None means the default."""
    writing = _FunctionSource()
    defaults = {renamed.get(field.name) or field.name: _rospy_default(field) for field in fields}
    if "seq" in slots:
        defaults["seq"] = "0"
    for key, value in list(defaults.items()):
        if callable(value):
            defaults[key] = f"{writing.name(value)}()"
    count = len(slots)
    writing.lines += [f"self.{ours} = {defaults[ours]}" for ours, theirs in renamed.items() if not theirs]
    writing.lines += [
        "if args:",
        "    if fields: raise TypeError('Message constructor may only use args OR keywords, not both')",
        f"    if len(args) != {count}: raise TypeError('Invalid number of arguments, args should be '"
        f"{str(slots)!r} ' args are' + str(args))",
        f"    {''.join(f'{one}, ' for one in (f'value_{slot}' for slot in slots))} = args" if count else "",
        "elif fields:",
        "    for one in fields:",
        f"        if one not in known: raise AttributeError(one + ' is not an attribute of {cls.__name__}')",
        *(f"    value_{slot} = fields.get({slot!r})" for slot in slots),
        "else:",
        *(f"    self.{slot} = {defaults[slot]}" for slot in slots),
        "    return",
        *(f"self.{slot} = {defaults[slot]} if value_{slot} is None else value_{slot}" for slot in slots),
    ]
    writing.lines = [line for line in writing.lines if line]
    if issubclass(of_graph, Header):
        writing.lines.insert(0, f"self.{SEQ} = 0")
    writing.names["known"] = frozenset(slots)
    init: Callable[..., None] = writing.function("self, *args, **fields", f"{cls.__name__} of rospy")
    return init


def _rospy_default(one: MessageField) -> Any:
    """Return the source of a field's default, or what makes it."""
    if one.nested is not None:
        nested = message_of(one.nested.__msgtype__, ROSPY)
        count = one.length
        return nested if count is None else lambda: [nested() for _ in range(count)]
    if one.length is None:
        zero: Any = "" if one.base == "string" else False if one.base == "bool" else 0
        return repr(float(zero) if one.base.startswith("float") else zero)
    if one.base in ("uint8", "char"):
        return repr(bytes(one.length))
    zero = "" if one.base == "string" else False if one.base == "bool" else 0
    return f"[{float(zero) if one.base.startswith('float') else zero!r}] * {one.length}"


class _RospyMessage:
    """What rospy's messages have beside their fields."""

    __slots__: tuple[str, ...] = ()

    @property
    def _connection_header(self) -> dict[str, Any] | None:
        """Header of the connection that the message came over; None if it was made here."""
        header_of = getattr(self, "connection_of", None)
        return None if header_of is None else cast("dict[str, Any]", header_of())

    def __str__(self) -> str:
        return _yaml(self)

    __repr__ = __str__

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, type(self)):
            return False
        return all(_alike(getattr(self, one), getattr(other, one)) for one in type(self).__slots__)

    __hash__: Any = None

    def __getstate__(self) -> list[Any]:
        return [getattr(self, one) for one in type(self).__slots__]

    def __reduce__(self) -> tuple[Any, ...]:
        return _unset_message, (cast("Any", self).__msgtype__,), self.__getstate__()

    def __setstate__(self, state: list[Any]) -> None:
        for name, value in zip(type(self).__slots__, state, strict=True):
            setattr(self, name, value)

    def _get_types(self) -> list[str]:
        return list(cast("Any", self)._slot_types)

    def _check_types(self, exc: Exception | None = None) -> None:
        self._encoded()

    def _encoded(self) -> bytes:
        try:
            return to_ros1(cast("RosMessage", self))
        except UsageError as error:
            raise SerializationError(str(error)) from error

    def serialize(self, buff: IO[bytes]) -> None:
        """Write the message's ROS 1 bytes to a file-like object; raise ``SerializationError``."""
        data = self._encoded()
        header = self._header()
        buff.write(data if header is None else struct.pack("<I", header.seq) + data[4:])

    def deserialize(self, str: bytes) -> Any:  # noqa: A002 - rospy's name
        """Read the fields from ROS 1 bytes; return the message, raise ``DeserializationError``."""
        cls: Any = type(self)
        try:
            made = cls._adopt(from_ros1(cls.__msgtype__, str))
        except UsageError as error:
            raise DeserializationError(error.args[0]) from error
        for one in cls.__slots__:
            setattr(self, one, getattr(made, one))
        header = self._header()
        if header is not None:
            header.seq = struct.unpack("<I", str[:4])[0]
        return self

    def _header(self) -> Any:
        """Return the header that the encoding begins with, or None."""
        message: Any = self
        return message if isinstance(self, Header) else message.header if message._has_header else None


def _unset_message(name: str) -> Any:
    """Return a message of rospy whose state is set next, by ``pickle`` or ``copy``."""
    return message_of(name, ROSPY)()


def _alike(one: Any, other: Any) -> bool:
    """Return whether two values are equal; a list and a tuple may be."""
    if isinstance(one, list | tuple) and isinstance(other, list | tuple):
        return list(one) == list(other)
    return bool(one == other)


def _yaml(value: Any, indent: str = "") -> str:
    """Return a value of a message as rospy prints it."""
    if isinstance(value, Stamp):
        return f"{indent}secs: {value.secs}\n{indent}nsecs: {value.nsecs:9d}"
    if isinstance(value, _RospyMessage | RosMessage):
        names = type(value).__slots__ if isinstance(value, _RospyMessage) else value.__match_args__
        return "\n".join(
            f"{indent}{name}: {_yaml_inside(getattr(value, name), indent)}" for name in cast("Any", names)
        )
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False) if value else "''"
    return str(value)


def _yaml_inside(value: Any, indent: str) -> str:
    if isinstance(value, RosMessage):
        return f"\n{_yaml(value, indent + '  ')}"
    if isinstance(value, bytes | list | tuple | np.ndarray):
        values = list(value)
        if not values:
            return "[]"
        inner = indent + "  "
        if isinstance(values[0], Stamp | RosMessage):
            return "".join(f"\n{inner}- \n{_yaml(value, inner + '  ')}" for value in values)
        if isinstance(values[0], str):
            return "".join(f"\n{inner}- {value}" for value in values)
        return str(values)
    return _yaml(value)


_SECOND = 1_000_000_000


class _Ros1Stamp:
    """Arithmetic of genpy's times and durations: a value takes part in its own kind's only."""

    __slots__ = ()
    if TYPE_CHECKING:  # of the message
        sec: Any
        nanosec: Any

    def __init__(self, secs: Any = 0, nsecs: int = 0) -> None:
        if not isinstance(secs, int):
            if nsecs:
                raise ValueError("if secs is a float, nsecs cannot be set")
            whole = int(secs)
            secs, nsecs = whole, int((secs - whole) * _SECOND)
        self.set(*divmod(secs * _SECOND + nsecs, _SECOND))
        if self.sec < 0 and isinstance(self, TimeValue):
            raise TypeError("time values must be positive")

    @classmethod
    def from_sec(cls, float_secs: float) -> Any:
        """Return the value of seconds; the integer and the fractional part are truncated by themselves."""
        whole = int(float_secs)
        return cls(whole, int((float_secs - whole) * _SECOND))

    def __reduce__(self) -> tuple[Any, ...]:
        return _unset_message, (cast("Any", self).__msgtype__,), (self.sec, self.nanosec)

    def __setstate__(self, state: tuple[int, int]) -> None:
        self.set(*state)

    def __copy__(self) -> Any:
        return type(self)(self.sec, self.nanosec)

    def __deepcopy__(self, memo: Any) -> Any:
        return self.__copy__()

    def to_nsec(self) -> int:
        """Return the value in ns."""
        return int(self.sec * _SECOND + self.nanosec)

    def set(self, secs: int, nsecs: int) -> None:
        """Set seconds and nanoseconds."""
        self.sec = secs
        self.nanosec = nsecs

    def canon(self) -> None:
        """Carry whole seconds from the nanoseconds."""
        self.set(*divmod(self.to_nsec(), _SECOND))

    def __str__(self) -> str:
        return str(self.to_nsec())

    def __repr__(self) -> str:
        return f"{type(self).__module__.partition('.')[0]}.{type(self).__name__}[{self.to_nsec()}]"

    def __hash__(self) -> int:
        return hash((self.sec, self.nanosec))

    def _ns(self, other: Any) -> int | None:
        """Return another value of the same kind in ns, or None."""
        kind = TimeValue if isinstance(self, TimeValue) else DurationValue
        return other.to_nsec() if isinstance(other, kind) else None

    def __eq__(self, other: object) -> bool:
        ns = self._ns(other)
        return ns is not None and self.to_nsec() == ns

    def __lt__(self, other: Any) -> Any:
        ns = self._ns(other)
        return NotImplemented if ns is None else self.to_nsec() < ns

    def __le__(self, other: Any) -> Any:
        ns = self._ns(other)
        return NotImplemented if ns is None else self.to_nsec() <= ns

    def __gt__(self, other: Any) -> Any:
        ns = self._ns(other)
        return NotImplemented if ns is None else self.to_nsec() > ns

    def __ge__(self, other: Any) -> Any:
        ns = self._ns(other)
        return NotImplemented if ns is None else self.to_nsec() >= ns


class Ros1Time(_Ros1Stamp):
    """``genpy.Time``: a point in time, never negative."""

    __slots__ = ()

    @classmethod
    def from_seconds(cls, float_secs: float) -> Any:
        """Return ``from_sec``."""
        return cls.from_sec(float_secs)

    def to_time(self) -> float:
        """Return the value in s."""
        return cast("Stamp", self).to_sec()

    def __add__(self, other: Any) -> Any:
        if not isinstance(other, DurationValue):
            return NotImplemented
        return type(self)(0, self.to_nsec() + other.to_nsec())

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        if isinstance(other, TimeValue):
            return message_of("builtin_interfaces/msg/Duration", ROSPY)(0, self.to_nsec() - other.to_nsec())
        if not isinstance(other, DurationValue):
            return NotImplemented
        return type(self)(0, self.to_nsec() - other.to_nsec())


class Ros1Duration(_Ros1Stamp):
    """``genpy.Duration``; a negative one has negative seconds and nanoseconds that count upward."""

    __slots__ = ()

    def _of(self, ns: int) -> Any:
        return type(self)(0, ns)

    def __neg__(self) -> Any:
        return self._of(-self.to_nsec())

    def __abs__(self) -> Any:
        return self._of(abs(self.to_nsec()))

    def __add__(self, other: Any) -> Any:
        return (
            self._of(self.to_nsec() + other.to_nsec()) if isinstance(other, DurationValue) else NotImplemented
        )

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        return (
            self._of(self.to_nsec() - other.to_nsec()) if isinstance(other, DurationValue) else NotImplemented
        )

    def __mul__(self, factor: Any) -> Any:
        if isinstance(factor, int):
            return self._of(self.to_nsec() * factor)
        if isinstance(factor, float):
            return type(self).from_sec(cast("Stamp", self).to_sec() * factor)
        return NotImplemented

    __rmul__ = __mul__

    def __truediv__(self, by: Any) -> Any:
        if isinstance(by, int | float):
            return type(self).from_sec(cast("Stamp", self).to_sec() / by)
        if isinstance(by, DurationValue):
            return cast("Stamp", self).to_sec() / by.to_sec()
        return NotImplemented

    def __floordiv__(self, by: Any) -> Any:
        if isinstance(by, int | float):
            return type(self).from_sec(cast("Stamp", self).to_sec() // by)
        if isinstance(by, DurationValue):
            return self.to_nsec() // by.to_nsec()
        return NotImplemented

    def __mod__(self, by: Any) -> Any:
        return self._of(self.to_nsec() % by.to_nsec()) if isinstance(by, DurationValue) else NotImplemented

    def __divmod__(self, by: Any) -> Any:
        return (self // by, self % by) if isinstance(by, DurationValue) else NotImplemented


# -- rclpy


class Odd(NamedTuple):
    """A value of another type than its field's, which rclpy sends as something else.

    Attributes:
        message: The message.
        path: Path of the field.
        given: The value.
        sent: What arrives.
    """

    message: Any
    path: str
    given: Any
    sent: Any


odd_values: list[Odd] = []
"""What rclpy has sent so far that is not what was given; the publisher takes its own."""


def take_odd_values(message: Any) -> list[Odd]:
    """Return what copying *message* has sent otherwise than given."""
    if not odd_values:
        return []
    found = [value for value in odd_values if value.message is message]
    odd_values.clear()
    return found


def _c_number(base: str, value: Any, message: Any, path: str) -> Any:
    """Return what rclpy's generated code in C sends for a value of another type.

    It reads a ``float`` from the object's memory without looking at its type (an int of Python 3.11 has its
    number of digits there, from 3.12 on a tag; None nothing), takes nothing but ``True`` as true, and cuts
    whole numbers.
    """
    if base == "bool":
        sent: Any = value is True
        same = bool(sent) == bool(value)
    elif base.startswith("float"):
        if isinstance(value, float):
            return float(value)
        sent = 0.0 if value is None else _as_c_double(value)
        same = sent == value
    else:
        limits = np.iinfo(base if base not in BYTES and base != "char" else "uint8")
        if isinstance(value, bytes) and base in BYTES:
            return value[0]
        number = plain_number(base, value, message, path)
        widest = np.iinfo(np.int64 if limits.min else np.uint64)
        if not widest.min <= number <= widest.max:
            raise OverflowError(f"not a {base}")
        span = 1 << limits.bits
        sent = (number - limits.min) % span + limits.min
        same = sent == number
    if not same:
        odd_values.append(Odd(message, path, value, sent))
    return sent


def _as_c_double(value: Any) -> float:
    if isinstance(value, np.generic):
        data = value.tobytes()[:8].ljust(8, b"\0")
    elif isinstance(value, int):
        digits = -(-abs(value).bit_length() // sys.int_info.bits_per_digit)
        if sys.version_info >= (3, 12):
            sign = 0 if value > 0 else 1 if value == 0 else 2
            data = struct.pack("<Q", digits << 3 | sign)
        else:
            data = struct.pack("<q", -digits if value < 0 else digits)
    else:
        raise TypeError("not a float")
    return float(struct.unpack("<d", data)[0])


_C = ValueEncoding(_c_number, infinite=True, wraps=True)


def _rclpy_class(of_graph: Any) -> Any:
    name = of_graph.__msgtype__
    package, kind, label = name.split("/")
    fields = _fields(of_graph)
    members: dict[str, Any] = {
        "get_fields_and_field_types": classmethod(lambda _: dict(idl_fields(name))),
        "_fields_and_field_types": _Lazy(lambda _: dict(idl_fields(name))),
    }
    for one in fields:
        if one.nested is not None or one.base == "string":
            continue
        if one.length is not None:
            members[one.name] = _rclpy_list(of_graph, one)
        elif one.base in BYTES:
            members[one.name] = _rclpy_byte(of_graph, one)
    if issubclass(of_graph, Header):
        members |= {"seq": _Absent(), "_values": staticmethod(lambda one: (one.stamp, one.frame_id))}
    if issubclass(of_graph, Stamp):
        shown = ("secs", "nsecs", "to_nsec", "to_sec", "to_time", "is_zero")
        members |= {one: _Absent() for one in shown}
        members |= {one: getattr(object, one) for one in ("__lt__", "__le__", "__gt__", "__ge__")}
        operators = ("add", "radd", "sub", "neg", "abs", "mul", "rmul", "truediv", "bool")
        members |= {f"__{operator}__": None for operator in operators if hasattr(of_graph, f"__{operator}__")}
        members["__bool__"] = lambda _: True
    module = generated_module(f"{package}/{kind}/{label}")
    members["SLOT_TYPES"] = _Lazy(lambda _: slot_types(of_graph.__msgtype__))
    made = _derived(of_graph, label, module, RCLPY, (_RclpyMessage,), members)
    made.__slots__ = [*(f"_{field.name}" for field in fields), "_check_fields"]
    for constant, value in _byte_constants(of_graph):
        setattr(made, constant, value)
    made.__init__ = _rclpy_init(made, of_graph, fields)
    set_written(made, {one: partial(generated_copy, of_graph, fields, _C) for one in ("_copied", "copy")})
    return made


def _byte_constants(of_graph: Any) -> list[tuple[str, bytes]]:
    found = of_graph.constants_of
    return [(name, bytes([value])) for name, base, value in found if base in BYTES and isinstance(value, int)]


def _rclpy_list(of_graph: Any, one: MessageField) -> Any:
    if one.base not in _CODES:  # bool and byte
        as_list = (
            (lambda values: [bytes([item]) for item in values]) if one.base in BYTES else np.ndarray.tolist
        )
        return _converting(of_graph, one, as_list, None)
    dtype = np.dtype("uint8" if one.base == "char" else one.base)
    if one.length:
        return _converting(of_graph, one, np.array, lambda values: np.array(values, dtype))
    code = _CODES[one.base]

    def as_array(values: Any) -> array[Any]:
        made = array(code)
        made.frombytes(np.ascontiguousarray(values).data.cast("B"))
        return made

    def assigned(values: Any) -> array[Any]:
        if isinstance(values, array) and values.typecode == code:
            return values  # as rclpy, without a copy
        if isinstance(values, np.ndarray) and values.dtype == dtype:
            return as_array(values)
        return array(code, values)

    return _converting(of_graph, one, as_array, assigned)


def _as_bytes(values: Any) -> list[bytes]:
    return [bytes([value]) for value in values]


def _rclpy_byte(of_graph: Any, one: MessageField) -> Any:
    slot = slot_of(of_graph, one.name)

    def read(self: Any) -> Any:
        value = slot.__get__(self)
        return bytes([value]) if isinstance(value, int) else value

    return property(read, slot.__set__)


def _rclpy_init(cls: Any, of_graph: Any, fields: list[MessageField]) -> Callable[..., None]:
    """Return ``__init__``, which takes fields by name and ignores what is none, as rclpy's does."""
    writing = _FunctionSource()
    head = ["self"]
    for field in fields:
        default = default_value(of_graph.__msgtype__, field)
        if field.nested is not None and field.length is None:
            default = message_of(field.nested.__msgtype__, RCLPY)
        elif field.nested is not None:
            nested, count = message_of(field.nested.__msgtype__, RCLPY), field.length or 0
            default = partial(_several, nested, count)
        elif field.length is not None and field.base not in (*_CODES, "string"):  # lists of bool and byte
            default = partial(_several, bytes if field.base in BYTES else bool, field.length)
        if callable(default):
            made = writing.name(default)
            head.append(f"{field.name}=unset")
            writing.lines.append(f"self.{field.name} = {made}() if {field.name} is unset else {field.name}")
        else:
            head.append(f"{field.name}={writing.name(default)}")
            writing.lines.append(f"self.{field.name} = {field.name}")
    if issubclass(of_graph, Header):
        writing.lines.append(f"self.{SEQ} = 0")
    if fields:
        head.insert(1, "*")
    writing.lines.append("return None")
    init: Callable[..., None] = writing.function(", ".join([*head, "**others"]), f"{cls.__name__} of rclpy")
    return init


def _several(cls: Any, count: int) -> list[Any]:
    return [b"\0" if cls is bytes else cls() for _ in range(count)]


class _RclpyMessage:
    """What rclpy's messages have beside their fields."""

    __slots__ = ()

    def __repr__(self) -> str:
        cls: Any = type(self)
        shown = (f"{one}={_shown(getattr(self, one))}" for one in cls.__match_args__)
        return f"{cls.__module__.rpartition('.')[0]}.{cls.__name__}({', '.join(shown)})"

    def __eq__(self, other: object) -> bool:
        cls: Any = type(self)
        if not isinstance(other, cls):
            return False
        return all(_equal(getattr(self, one), getattr(other, one)) for one in cls.__match_args__)

    __hash__: Any = None


def _shown(value: Any) -> str:
    if isinstance(value, array):
        return repr(value)[len("array('f', ") : -1] if value else "[]"
    return repr(value)


def _equal(one: Any, other: Any) -> bool:
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        return bool(np.array_equal(one, other))
    return bool(one == other)
