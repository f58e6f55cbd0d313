"""Classes of message values: every field has a default, an unknown field is an error, copies are cheap.

A class is a slotted dataclass. Arrays of numbers are numpy arrays of the field's type; an assigned list
becomes an array when the message is copied, as by publishing, and numbers become what their encoding gives.
Copies share a long array, which is read-only then.
Client libraries have classes derived from these (``client_classes``). Times and durations have arithmetic and
also ROS 1's spelling (``stamp.secs``, ``stamp.to_sec()``).
"""

from __future__ import annotations

import struct
from array import array
from collections.abc import Callable, Sequence
from dataclasses import field, make_dataclass
from functools import partial
from operator import attrgetter, index
from types import MemberDescriptorType
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, cast

import numpy as np

from volery.base.errors import UsageError

LONG = 4096
"""Bytes from which on an array is long: copies of a message share it, its content is recorded on demand."""

Copy = Callable[[Any], Any]
_MISFITS = (TypeError, ValueError, AttributeError, OverflowError, struct.error)
"""What a value that does not fit its field raises."""


class ReceivedNumbers:
    """A list of numbers as the graph delivered it; a client library converts it when it is read first."""

    __slots__ = ("array",)

    def __init__(self, array: np.ndarray[Any, Any]) -> None:
        self.array = array


class ValueEncoding(NamedTuple):
    """How a client library encodes single values of other types than their field's.

    Attributes:
        number: Returns a field's value as it arrives, of the kind (``float64``), the value, the message and
            the path of the field. Called for values whose type is not the field's. May raise.
        infinite: Whether ``float32`` out of range becomes infinite; else it is an error.
        wraps: Whether whole numbers out of range are given to ``number``; else the encoder refuses them.
    """

    number: Callable[[str, Any, Any, str], Any]
    infinite: bool = False
    wraps: bool = False


def plain_number(base: str, value: Any, message: Any, path: str) -> Any:
    """Return a value as ROS 1's encoding gives it: 1 in a ``float64`` is 1.0, 1 in a ``bool`` True."""
    if base == "bool":
        if value not in (0, 1):
            raise TypeError("not a bool")
        return bool(value)
    if base.startswith("float"):
        if isinstance(value, str):
            raise TypeError("not a number")
        return float(value)
    return int(index(value))


PLAIN = ValueEncoding(plain_number)


def generated_copy(cls: Any, fields: list[Any], law: ValueEncoding = PLAIN) -> Copy:
    """Return the method ``copy`` of a message class; its result is of the graph's classes.

    Generated code takes half the time of a loop over the fields.
    """
    writing = _CopyingSource(law)
    made = writing.expression(cls, fields, "self", "")
    return _compiled(f"copy of {cls.__msgtype__}", [*writing.lines, f"return {made}"], writing.names)


def generated_conversion(cls: Any, fields: list[Any]) -> Copy:
    """Return the method ``converted`` of a message class."""
    names: dict[str, Any] = {"ndarray": np.ndarray}
    tests = _conversions(fields, "self", names)
    if tests is None:
        return generated_copy(cls, fields)
    return _compiled(f"conversion of {cls.__msgtype__}", [*tests, "return self"], names)


def _compiled(title: str, lines: list[str], names: dict[str, Any]) -> Copy:
    """Return the method with these statements; a value that does not fit raises an error with its field."""
    body = "".join(f"\n        {line}" for line in lines)
    source = (
        f"def method(self):\n    try:{body}\n    except misfits:\n        return self._copied_by_fields()"
    )
    exec(compile(source, f"<{title}>", "exec"), names | {"misfits": _MISFITS}, names)
    written: Copy = names["method"]
    return written


def _singles(infinite: bool, *values: float) -> tuple[float, ...]:
    """Return floats in the precision of ``float32``."""
    packing = _SINGLE[len(values)] if len(values) < len(_SINGLE) else struct.Struct(f"<{len(values)}f")
    try:
        return packing.unpack(packing.pack(*values))
    except OverflowError:
        if not infinite:
            raise
        with np.errstate(over="ignore"):
            return tuple(float(np.float32(value)) for value in values)


_SINGLE = [struct.Struct(f"<{count}f") for count in range(12)]


class _CopyingSource:
    """Source of one copying function; nested messages and numbers are assigned to variables first."""

    def __init__(self, law: ValueEncoding) -> None:
        self.law = law
        self.lines: list[str] = []
        self.names: dict[str, Any] = {"number": law.number, "singles": partial(_singles, law.infinite)}

    def expression(self, cls: Any, fields: list[Any], of: str, path: str) -> str:
        """Return the expression that makes a `cls` of the fields of the variable `of`."""
        kind = f"kind_{len(self.names)}"
        self.names[kind] = cls
        values = []
        floats: list[str] = []
        for one in fields:
            value = f"{of}.{one.name}"
            if one.length is not None:
                copier, slot = f"copier_{len(self.names)}", f"slot_{len(self.names)}"
                self.names[copier] = _copier(one)
                self.names[slot] = slot_of(cls, one.name).__get__
                value = f"{copier}({slot}({of}))"
            elif one.nested is not None:
                variable = self._assigned(value)
                value = self.expression(one.nested, one.nested.fields_of, variable, f"{path}{one.name}.")
            elif one.base != "string":
                value = self._number(cls, one, of, f"{path}{one.name}")
                if one.base == "float32":
                    floats.append(value)
            values.append(value)
        if floats:
            self.lines.append(f"{', '.join(floats)}, = singles({', '.join(floats)})")
        if issubclass(cls, Header):
            values.append(f"{of}.{SEQ}")
        return f"{kind}({', '.join(values)})"

    def _assigned(self, value: str) -> str:
        variable = f"part_{len(self.lines)}"
        self.lines.append(f"{variable} = {value}")
        return variable

    def _number(self, cls: Any, one: Any, of: str, path: str) -> str:
        """Write the assignment of a number to a variable, and its check."""
        if one.base in BYTES:
            slot = f"slot_{len(self.names)}"
            self.names[slot] = slot_of(cls, one.name).__get__
            variable = self._assigned(f"{slot}({of})")
        else:
            variable = self._assigned(f"{of}.{one.name}")
        kind = "float" if one.base.startswith("float") else "bool" if one.base == "bool" else "int"
        wrong = f"{variable}.__class__ is not {kind}"
        if kind == "int" and self.law.wraps:
            limits = np.iinfo(_dtype(one.base))
            wrong += f" or not {limits.min} <= {variable} <= {limits.max}"
        self.lines.append(f"if {wrong}: {variable} = number({one.base!r}, {variable}, self, {path!r})")
        return variable


BYTES = ("byte", "octet")
"""Names of ROS 2's ``byte``, which rclpy has as ``bytes`` of length 1."""


def slot_of(cls: Any, name: str) -> Any:
    """Return the descriptor of a field as messages of type *cls* keep it, whatever their client library."""
    return next(
        vars(one)[name] for one in cls.__mro__ if isinstance(vars(one).get(name), MemberDescriptorType)
    )


def _conversions(fields: list[Any], of: str, names: dict[str, Any]) -> list[str] | None:
    """Return the statements that convert the lists below the expression *of*; None if they are no numbers."""
    lines: list[str] = []
    for one in fields:
        value = f"{of}.{one.name}"
        if one.length is None:
            inner = [] if one.nested is None else _conversions(one.nested.fields_of, value, names)
            if inner is None:
                return None
            lines += inner
            if one.base == "float32":
                names["singles"] = partial(_singles, False)
                lines.append(f"{value}, = singles({value})")
        elif one.nested is not None or one.base == "string":
            return None
        else:
            number = len(names)
            names[f"type_{number}"], names[f"copier_{number}"] = _dtype(one.base), _copier(one)
            shape = f"{value}.shape != ({one.length},)" if one.length else f"{value}.ndim != 1"
            wrong = f"type({value}) is not ndarray or {value}.dtype is not type_{number} or {shape}"
            if may_be_long(one.base, one.length):
                wrong += f" or {value}.nbytes >= {LONG}"  # the copier makes it one that can be shared
            lines += [f"if {wrong}:", f"    {value} = copier_{number}({value})"]
    return lines


Default = Callable[[], Any]
Copier = Callable[[Any], Any]


class RosMessage:
    """A ROS message; ``__msgtype__`` is its type's name, ``__match_args__`` the names of its fields."""

    __slots__ = ("connection_of",)
    """Beside the fields: what makes the header of the connection that rospy's messages state."""
    __msgtype__: ClassVar[str] = ""
    __match_args__: ClassVar[tuple[str, ...]] = ()
    _copiers: ClassVar[tuple[tuple[int, Copier], ...]] = ()
    _values: ClassVar[Callable[[Any], tuple[Any, ...]]]
    _copied: ClassVar[Callable[[Any], Any]]
    of_graph: ClassVar[Any]
    """Class of the type on the graph; a client library's is derived from it. Private to this package."""
    fields_of: ClassVar[list[MessageField]] = []
    """Fields of the type. Private to this package."""
    constants_of: ClassVar[Sequence[tuple[str, str, Any]]] = ()
    """Name, kind and value of the type's constants. Private to this package."""
    __hash__: ClassVar[Any] = None  # messages are mutable values

    if TYPE_CHECKING:  # each class has the fields of its type

        def __init__(self, *values: Any, **fields: Any) -> None: ...

    def copy(self) -> Any:
        """Return a copy with lists converted to arrays; ``UsageError`` if a value does not fit."""
        raise NotImplementedError  # each type has its own

    def converted(self) -> Any:
        """Return this message with its lists converted to arrays in place.

        An array of the field's type stays. A type with lists of strings or messages is copied, since these
        may belong to other messages as well. Only for a message of the caller alone. Raises ``UsageError`` if
        a value does not fit.
        """
        raise NotImplementedError  # each type has its own

    def _copied_by_fields(self) -> Any:
        cls = type(self)
        values = cls._values(self)
        copied = list(values)
        for place, copier in cls._copiers:
            try:
                copied[place] = copier(copied[place])
            except _MISFITS as error:
                name = f"{cls.__msgtype__}.{cls.__match_args__[place]}"
                raise UsageError(f"{name}: {copied[place]!r} does not fit: {error}") from error
        graph = cls.of_graph(*copied)
        if isinstance(self, Header):
            graph.seq = self.seq
        return graph

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, RosMessage) or other.__msgtype__ != self.__msgtype__:
            return NotImplemented
        return all(_same(getattr(self, name), getattr(other, name)) for name in self.__match_args__)


def _same(one: Any, other: Any) -> bool:
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        return bool(np.array_equal(one, other))
    return bool(one == other)


SEQ = "ros1_seq"
"""Slot of a header in which ``seq`` is kept."""


class Header(RosMessage):
    """A header. ROS 1's ``seq`` is carried on the embedded graph; ROS 2 has no such field."""

    __slots__ = ()

    @property
    def seq(self) -> int:
        """ROS 1's count of messages."""
        return int(getattr(self, SEQ))

    @seq.setter
    def seq(self, value: int) -> None:
        setattr(self, SEQ, value)


class Nothing(RosMessage):
    """A type without fields; its encoding has one unused byte."""

    __slots__ = ()
    structure_needs_at_least_one_member = 0

    def __init__(self, structure_needs_at_least_one_member: int = 0) -> None: ...


DEFAULTS: dict[tuple[str, str], Any] = {("geometry_msgs/msg/Quaternion", "w"): 1.0}
"""Defaults that definitions of ROS 2 state, by type and field; all others are zero, false or empty."""


class MessageField(NamedTuple):
    """A field of a type: exactly one of ``base`` (a number, bool or string) and ``nested`` is given.

    ``length`` is ``None`` for a single value, 0 for a sequence, else the length of an array. ``bound`` is the
    greatest length of a sequence, 0 without.
    """

    name: str
    base: str
    nested: type[RosMessage] | None
    length: int | None
    bound: int = 0


def make_class(
    name: str, base: type[RosMessage], constants: Sequence[tuple[str, str, Any]], fields: list[MessageField]
) -> type[RosMessage]:
    """Create the class of message type `name` (``package/msg/Name``), derived from `base`."""
    package, kind, label = name.split("/")
    members: list[tuple[str, Any, Any]] = []
    copiers = []
    for place, one in enumerate(fields):
        members.append((one.name, Any, _default(name, one)))
        copier = _copier(one)
        if copier:
            copiers.append((place, copier))
    if issubclass(base, Header):
        members.append((SEQ, int, field(default=0)))
    namespace = {
        **{label: value for label, _, value in constants},
        "constants_of": constants,
        "__msgtype__": name,
        "__module__": f"{package}.{kind}",
        "_type": name,
        "_copiers": tuple(copiers),
        "_values": staticmethod(_values_of(tuple(one.name for one in fields))),
        "fields_of": fields,
    }
    dataclass: Any = make_dataclass(
        label, members, bases=(base,), namespace=namespace, init=bool(fields), eq=False, slots=True
    )
    setattr(dataclass, "__match_args__", tuple(one.name for one in fields))  # noqa: B010 - fixed to mypy
    dataclass.of_graph = dataclass
    set_written(dataclass, {"_copied": partial(generated_copy, dataclass, fields)})
    set_written(
        dataclass,
        {
            "copy": partial(generated_copy, dataclass, fields),
            "converted": partial(generated_conversion, dataclass, fields),
        },
    )
    return cast("type[RosMessage]", dataclass)


def set_written(cls: Any, methods: dict[str, Callable[[], Copy]]) -> None:
    """Give a message class methods that are written at their first use; a field of that name comes first."""
    for name, write in methods.items():
        if name not in cls.__match_args__:
            setattr(cls, name, _written_at_first_use(cls, name, write))


def _written_at_first_use(cls: Any, name: str, write: Callable[[], Copy]) -> Copy:
    """Return a method that replaces itself by what *write* returns: most types are never copied."""

    def method(self: Any) -> Any:
        written = write()
        setattr(cls, name, written)
        return written(self)

    return method


def _values_of(names: tuple[str, ...]) -> Callable[[Any], tuple[Any, ...]]:
    if not names:
        return lambda message: ()
    get = attrgetter(*names)
    return get if len(names) > 1 else lambda message: (get(message),)


def _default(owner: str, one: MessageField) -> Any:
    default = default_value(owner, one)
    return field(default_factory=default) if callable(default) else field(default=default)


def default_value(owner: str, one: MessageField) -> Any:
    """Return a field's default, or what makes it."""
    stated = DEFAULTS.get((owner, one.name))
    if one.length is None:
        return one.nested or (_zero(one.base) if stated is None else stated)
    if stated is not None:
        return partial(cast("Copier", _copier(one)), stated)
    count = one.length
    if one.nested:
        nested = one.nested
        return lambda: [nested() for _ in range(count)]
    if one.base == "string":
        return lambda: [""] * count
    return partial(np.zeros, count, _dtype(one.base))


def _zero(base: str) -> Any:
    if base == "string":
        return ""
    if base == "bool":
        return False
    return 0.0 if base.startswith("float") else 0


def _dtype(base: str) -> np.dtype[Any]:
    return np.dtype({"bool": "bool", "byte": "uint8", "char": "uint8", "octet": "uint8"}.get(base, base))


def may_be_long(base: str, length: int) -> bool:
    """Return whether an array of numbers of this length, or a sequence (0), can have ``LONG`` bytes."""
    return not length or length * _dtype(base).itemsize >= LONG


def _copier(one: MessageField) -> Copier | None:
    if one.length is None:
        if one.nested:
            return partial(_copy_nested, one.nested)
        return None if one.base == "string" else partial(_number_or_as_is, one.base)
    if one.nested:
        return partial(_copy_list, partial(_copy_nested, one.nested), one.length)
    if one.base == "string":
        return partial(_copy_list, _string, one.length)
    return partial(_copy_bytes if one.base in BYTES else _copy_array, _dtype(one.base), one.length)


def _number_or_as_is(base: str, value: Any) -> Any:
    """Return a number as it is encoded, or a value that the encoder refuses."""
    try:
        number = plain_number(base, value, None, "")
        return _singles(False, number)[0] if base == "float32" else number
    except _MISFITS:
        return value


def _copy_nested(cls: type[RosMessage], value: Any) -> Any:
    if isinstance(value, cls):
        return type(value)._copied(value)
    copied = list(cls._values(value))
    for place, copier in cls._copiers:
        copied[place] = copier(copied[place])
    return cls(*copied)


def _string(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{value!r} is no string")
    return value


def _copy_list(copier: Copier, count: int, values: Any) -> list[Any]:
    copied = [copier(value) for value in values]
    if count and len(copied) != count:
        raise ValueError(f"{len(copied)} values, but the field has {count}")
    return copied


def _copy_bytes(dtype: np.dtype[Any], count: int, values: Any) -> Any:
    """Copy a list of ``byte``: ``bytes`` of length 1 in rclpy, signed numbers in rospy."""
    if isinstance(values, list | tuple) and values:
        values = b"".join(values) if isinstance(values[0], bytes) else bytes(value & 255 for value in values)
    return _copy_array(dtype, count, values)


def _copy_array(dtype: np.dtype[Any], count: int, values: Any) -> Any:
    kind = values.__class__
    if kind is list or kind is tuple:
        if dtype.char != "?":  # an array refuses fractions as whole numbers
            values = array(dtype.char, values)
    elif kind is ReceivedNumbers:
        values = values.array
    elif kind is bytes or kind is bytearray:
        values = np.frombuffer(values, np.uint8)
    given: Any = np.asarray(values, dtype)
    if given.ndim != 1 or (count and given.shape[0] != count):
        wanted = count or "one row of"
        raise ValueError(f"an array of shape {given.shape}, but the field has {wanted} values")
    if given.nbytes < LONG:
        return given.copy()
    if given.base.__class__ is bytes:  # these never change
        return given
    return np.frombuffer(given.tobytes(), dtype)


_SECOND = 1_000_000_000


class Stamp(RosMessage):
    """Base of times and durations. Every object with ``sec`` and ``nanosec`` may be the other operand."""

    __slots__ = ()
    if TYPE_CHECKING:  # the fields of the types that are made of this
        sec: Any
        nanosec: Any

        def __init__(self, sec: int = 0, nanosec: int = 0) -> None: ...

    @property
    def secs(self) -> int:
        """``sec`` in ROS 1's spelling."""
        return int(self.sec)

    @secs.setter
    def secs(self, value: int) -> None:
        self.sec = value

    @property
    def nsecs(self) -> int:
        """``nanosec`` in ROS 1's spelling."""
        return int(self.nanosec)

    @nsecs.setter
    def nsecs(self, value: int) -> None:
        self.nanosec = value

    def to_nsec(self) -> int:
        """Return the value in ns."""
        return int(self.sec * _SECOND + self.nanosec)

    def to_sec(self) -> float:
        """Return the value in s, rounded as in ROS 1."""
        return float(self.sec + self.nanosec / _SECOND)

    to_time = to_sec

    def is_zero(self) -> bool:
        """Return whether the value is 0."""
        return self.to_nsec() == 0

    def __bool__(self) -> bool:
        return not self.is_zero()

    def __lt__(self, other: Any) -> bool:
        return self.to_nsec() < nanoseconds(other)

    def __le__(self, other: Any) -> bool:
        return self.to_nsec() <= nanoseconds(other)

    def __gt__(self, other: Any) -> bool:
        return self.to_nsec() > nanoseconds(other)

    def __ge__(self, other: Any) -> bool:
        return self.to_nsec() >= nanoseconds(other)

    def __eq__(self, other: object) -> bool:
        if not hasattr(other, "nanosec"):
            return NotImplemented
        return self.to_nsec() == nanoseconds(other)

    def __hash__(self) -> int:
        return hash(self.to_nsec())


def nanoseconds(value: Any) -> int:
    """Return a stamp in ns; raise ``TypeError`` for any other object."""
    try:
        return int(value.sec * _SECOND + value.nanosec)
    except AttributeError:
        raise TypeError(f"{value!r} is neither a time nor a duration") from None


def _is_time(value: Any) -> bool:
    return isinstance(value, TimeValue)


class DurationValue(Stamp):
    """A duration. If negative, ``sec`` is negative and ``nanosec`` counts upward."""

    __slots__ = ()
    kind: ClassVar[type[DurationValue]]
    """Class of the message type, used for results."""

    @classmethod
    def of(cls, ns: int) -> DurationValue:
        """Return the value of `ns` nanoseconds."""
        return DurationValue.kind(*divmod(ns, _SECOND))

    def __add__(self, other: Any) -> Any:
        if _is_time(other):
            return other + self
        return DurationValue.of(self.to_nsec() + nanoseconds(other))

    def __sub__(self, other: Any) -> DurationValue:
        if _is_time(other):
            raise TypeError("a duration minus a time")
        return DurationValue.of(self.to_nsec() - nanoseconds(other))

    def __neg__(self) -> DurationValue:
        return DurationValue.of(-self.to_nsec())

    def __abs__(self) -> DurationValue:
        return DurationValue.of(abs(self.to_nsec()))

    def __mul__(self, factor: float) -> DurationValue:
        return DurationValue.of(round(self.to_nsec() * factor))

    __rmul__ = __mul__

    def __truediv__(self, by: Any) -> Any:
        if hasattr(by, "nanosec"):
            return self.to_nsec() / nanoseconds(by)
        return DurationValue.of(round(self.to_nsec() / by))


class TimeValue(Stamp):
    """A point in ROS time."""

    __slots__ = ()
    kind: ClassVar[type[TimeValue]]
    """Class of the message type, used for results."""

    @classmethod
    def of(cls, ns: int) -> TimeValue:
        """Return the value of `ns` nanoseconds."""
        return TimeValue.kind(*divmod(ns, _SECOND))

    def __add__(self, other: Any) -> TimeValue:
        if _is_time(other):
            raise TypeError("a time plus a time")
        return TimeValue.of(self.to_nsec() + nanoseconds(other))

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        if _is_time(other):
            return DurationValue.of(self.to_nsec() - nanoseconds(other))
        return TimeValue.of(self.to_nsec() - nanoseconds(other))
