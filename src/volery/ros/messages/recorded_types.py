"""Message types as recordings define them, and their messages in other encodings and definitions.

A type is its name and its definition. What a recording defines is read by that definition; a message becomes
one of ours, or one of the other ROS, by the names of its fields where the definitions differ.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache, cached_property
from typing import Any, NamedTuple

from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.base import TypesysError
from rosbags.typesys.store import Typestore

from volery.base.errors import UsageError, choices
from volery.ros.messages.containers import DAMAGE, RecordedTopic
from volery.ros.messages.conversion import HEADER, Conversion
from volery.ros.messages.encodings import (
    bounded,
    from_cdr,
    ros1_to_cdr,
    to_cdr,
)
from volery.ros.messages.json_schemas import JsonType
from volery.ros.messages.store import (
    DISTRIBUTIONS,
    distribution,
    message_class,
    parse_definition,
    store,
    types_of,
)

READABLE = ("cdr", "ros1", "json")
"""Encodings of messages that are decoded."""
_OLD = ("galactic", "foxy", "eloquent", "dashing")
"""Distributions before Humble, whose recordings in SQLite hold no definitions."""


class Written(NamedTuple):
    """How messages of a recorded type are written: definition and checksum, and what converts their bytes."""

    definition: str
    digest: str
    convert: Callable[[bytes], bytes]


class RecordedType:
    """The type of a connection by the recording's own definition.

    Args:
        source: The connection.
        stated: ROS 2 distribution that the recording states; for one without definitions.

    Raises:
        UsageError: messages of this type cannot be decoded; the text says why.
    """

    def __init__(self, source: RecordedTopic, stated: str = "") -> None:
        self.name, self.encoding = source.type, source.encoding
        self._source = source
        self._hint = stated
        self.assumed = ""
        """Whose definition was assumed, if the recording has none that its messages fit."""
        if source.encoding not in READABLE:
            stated = f"encoded as {source.encoding}" if source.encoding else "of no stated encoding"
            raise UsageError(f"its messages are {stated}; {choices(READABLE)} can be read")
        self._json: JsonType | None = None
        if source.encoding == "json":
            if not source.definition.strip():
                raise UsageError("its messages are encoded as json and have no schema")
            self._json = JsonType(source.type, source.definition)
        self._types: Typestore | None = None
        self._resolved = False
        problem = "not defined in the recording"
        if source.definition.strip() or (source.schema and not self._is_known):
            try:
                text = self._json.definition if self._json else source.definition
                self._types = _defined(self.name, source.encoding, source.schema, text)
            except (RecursionError, SyntaxError, *DAMAGE) as error:  # classes are made of source code
                problem += f": {error}"
        if self._types is None and not self._is_known:
            raise UsageError(f"its type {self.name or '(none)'} is not known and {problem}")

    @property
    def _is_known(self) -> bool:
        return any(self.name in one.fielddefs for _, one in self._candidates())

    # -- decoding

    def message(self, data: bytes) -> Any:
        """Decode a message as one of our class. Raises ``UsageError`` if the bytes are no such message."""
        types = self._types_for(data)
        if self._json is not None or not self.to_ours.same_bytes:
            return self.to_ours(self._decoded(types, data))
        if self.encoding == "cdr":
            return from_cdr(self.name, data)
        try:
            return from_cdr(self.name, ros1_to_cdr(self.name, data))
        except (SerdeError, IndexError) as error:
            raise UsageError(f"these {len(data)} bytes are no {self.name} of ROS 1: {error}") from error

    def _decoded(self, types: Typestore, data: bytes) -> Any:
        if self._json is not None:
            return self._json.decoded(types, data)
        if types is store():
            message_class(self.name)  # before rosbags compiles its own class into the decoder
        decode = bounded(types, len(data))
        try:
            if self.encoding == "ros1":
                return decode.deserialize_ros1(data, self.name)
            return decode.deserialize_cdr(data, self.name)
        except (SerdeError, IndexError) as error:
            raise UsageError(f"these {len(data)} bytes are no {self.name}: {error}") from error

    @cached_property
    def to_ours(self) -> Conversion:
        """Conversion to our definition; a type that we do not know is learned from the recording."""
        _learn(self._known, self.name)
        return Conversion(self._known, store(), self.name, message_class)

    @cached_property
    def to_noetic(self) -> Conversion:
        """Conversion to Noetic's definition; a type that Noetic does not know keeps the recording's."""
        types = self._noetic_types
        return Conversion(self._known, types, self.name, types.types.__getitem__)

    @cached_property
    def _noetic_types(self) -> Typestore:
        known, noetic, types = self._known, _noetic(), get_typestore(Stores.EMPTY)
        parts = _closure(self.name, noetic.fielddefs, known)
        types.register(
            {part: (noetic if part in noetic.fielddefs else known).fielddefs[part] for part in parts}
        )
        return types

    @property
    def left_out(self) -> tuple[str, ...]:
        """Fields of the messages converted so far that the other definition lacks."""
        made = (self.__dict__.get(one) for one in ("to_ours", "to_noetic", "to_other"))
        found = dict.fromkeys(field for one in made if one is not None for field in one.left_out)
        return (*found, *(self._json.left_out if self._json is not None else ()))

    def differences(self) -> str:
        """Describe what was read by another definition than ours; empty if nothing was."""
        made: Conversion | None = self.__dict__.get("to_ours")
        parts = []
        if self.assumed and (self._source.definition or (made is not None and not made.same_bytes)):
            why = "does not fit" if self._source.definition else "is not in the recording"
            parts.append(f"the fields of {self.assumed}, as its definition {why}")
        if made is not None and not made.same_bytes:
            if not self.assumed:
                parts.append("its definition in the recording")
            if made.filled:
                parts.append(f"our defaults for {', '.join(made.filled)}")
        return f"{self.name} is read by {' and '.join(parts)}" if parts else ""

    # -- writing

    def for_ros2(self) -> Written:
        """Return how it is written into a rosbag 2: as recorded, or from ROS 1 by our definition."""
        types = store() if self.encoding == "ros1" else self._known
        try:
            if self.encoding == "ros1":
                _learn(self._known, self.name)
            text, _ = types.generate_msgdef(self.name, ros_version=2)
            digest = types.hash_rihs01(self.name)
        except (TypesysError, LookupError) as error:
            raise UsageError(f"{self.name} cannot be written: {error}") from error
        if self.encoding == "ros1":
            return Written(text, digest, lambda data: to_cdr(self.message(data)))
        if self._json is not None:
            return Written(text, digest, lambda data: self._as_cdr(types, self._decoded(types, data)))
        recorded = self._source.definition if self._source.schema == "msg" else ""
        return Written(recorded or text, digest, bytes)

    def as_other(self, other: RecordedType) -> Written:
        """Return how it is written into a rosbag 2 by the definition of *other*, a type of its name."""
        written, types = other.for_ros2(), other._known
        if types is self._known:
            return written
        self.to_other = Conversion(self._known, types, self.name, types.types.__getitem__)

        def convert(data: bytes) -> bytes:
            return self._as_cdr(types, self.to_other(self._decoded(self._known, data)))

        return written._replace(convert=convert)

    def _as_cdr(self, types: Typestore, message: Any) -> bytes:
        return bytes(types.serialize_cdr(message, self.name, little_endian=True))

    def for_ros1(self) -> Written:
        """Return how it is written into a rosbag 1: as recorded, or converted from ROS 2 to Noetic's."""
        if self.encoding == "ros1":
            text, digest = self._known.generate_msgdef(self.name, ros_version=1)
            return Written(self._source.definition or text, self._source.digest or digest, bytes)
        types = self._noetic_types
        text, digest = types.generate_msgdef(self.name, ros_version=1)

        def convert(data: bytes) -> bytes:
            message = self.to_noetic(self._decoded(self._known, data))
            return bytes(types.serialize_ros1(message, self.name))

        return Written(text, digest, convert)

    # -- definitions

    @property
    def _known(self) -> Typestore:
        """Return the store with the definition: the recording's, or what its first message fits."""
        if self._types is None:
            return next(one for _, one in self._candidates() if self.name in one.fielddefs)
        return self._types

    def resolve(self, data: bytes) -> None:
        """Choose the definition of a type whose recording has none, by a message."""
        self._types_for(data)

    def _types_for(self, data: bytes) -> Typestore:
        """Return the store with the definition.

        If none is recorded, or one that the first message does not fit, it is the first that this fits.
        """
        if not self._resolved:
            self._resolved = True
            if self._types is None or (self._json is None and not self._fits(self._types, data)):
                self._assume(data)
        return self._known

    def _assume(self, data: bytes) -> None:
        for label, types in self._candidates():
            if self.name in types.fielddefs and self._fits(types, data):
                self._types, self.assumed = types, label or distribution().capitalize()
                for made in ("to_ours", "to_noetic", "_noetic_types"):
                    self.__dict__.pop(made, None)
                return

    def _fits(self, types: Typestore, data: bytes) -> bool:
        try:
            self._decoded(types, data)
        except (UsageError, *DAMAGE):
            return False
        return True

    def _candidates(self) -> Iterator[tuple[str, Typestore]]:
        if self.encoding == "ros1":
            yield "ROS 1 Noetic", _noetic()
            yield "", store()
            return
        if self._hint in (*DISTRIBUTIONS.values(), *_OLD):
            yield self._hint.capitalize(), types_of(self._hint)
        yield "", store()
        for one in (*reversed(DISTRIBUTIONS.values()), *_OLD):
            yield one.capitalize(), types_of(one)


@cache
def _noetic() -> Typestore:
    return get_typestore(Stores.ROS1_NOETIC)


@cache
def _defined(name: str, encoding: str, schema: str, definition: str) -> Typestore:
    """Return the type that a definition defines, with its parts, of which known ones may be missing."""
    types = get_typestore(Stores.EMPTY)
    parsed = parse_definition(name, definition, idl=schema == "idl")
    known = _noetic() if encoding == "ros1" else store()
    for inner in list(_closure(name, parsed, known)):
        if inner not in parsed:
            parsed[inner] = known.fielddefs[inner]
    types.register({one: parsed[one] for one in _closure(name, parsed, known)})
    return types


def _closure(name: str, parsed: dict[str, Any], known: Typestore) -> dict[str, None]:
    """Return a type and the types inside of it, the inner ones first."""
    found: dict[str, None] = {}

    def add(one: str) -> None:
        for _, what in (parsed.get(one) or known.fielddefs[one])[1]:
            detail = what[1]
            inner = detail[0][1] if isinstance(detail[0], tuple) else detail  # of a list, or the field's own
            if isinstance(inner, str) and inner not in found:
                add(inner)
        found[one] = None

    add(name)
    return found


def _learn(types: Typestore, name: str) -> None:
    """Add a type that we do not know, and its unknown parts, to ours: for the graph, and for classes."""
    ours = store()
    if name in ours.fielddefs:
        return
    missing = {one: types.fielddefs[one] for one in _closure(name, {}, types) if one not in ours.fielddefs}
    try:
        ours.register({one: _of_ros2(one, what) for one, what in missing.items()})
    except (SyntaxError, TypesysError) as error:
        raise UsageError(f"its type {name} is not known and cannot be defined: {error}") from error


def _of_ros2(name: str, what: Any) -> Any:
    constants, fields = what
    return constants, [field for field in fields if (name, field[0]) != (HEADER, "seq")]
