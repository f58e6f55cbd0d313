"""Messages in JSON, as Foxglove and web tools record them in MCAP: ROS types of their JSON schemas.

Numbers become float64, whole numbers int64, base64 texts bytes, nested objects types of their own. A value
that has no such type (of several kinds, without a schema, a list in a list) is carried as its JSON text.
"""

from __future__ import annotations

import binascii
import json
import re
from base64 import b64decode
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from volery.base.errors import UsageError
from volery.ros.messages import lazy_rosbags as rosbags

TEXT_FIELD = "json"
"""Field of a type whose schema states no fields: the whole message as text."""
_SIMPLE = {"integer": "int64", "number": "float64", "boolean": "bool", "string": "string"}
_STAMPS = {"time": "builtin_interfaces/Time", "duration": "builtin_interfaces/Duration"}
_STAMP_KEYS = {"sec", "nsec"}
_WORD_ENDS = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|[^A-Za-z0-9]+")
_PYTHON_KINDS: dict[str, tuple[type, ...]] = {
    "int64": (int,),
    "float64": (int, float),
    "bool": (bool,),
    "string": (str,),
}

Read = Callable[[Any], Any]


class _Member(NamedTuple):
    """A field of a message: the JSON key, the field's name, its type and how its value is read."""

    key: str
    name: str
    type: str
    read: Read


def ros_name_of(schema: str) -> str:
    """Return the type's full name for a schema: ``foxglove/msg/Log`` for ``foxglove.Log``."""
    parts = [word for word in re.split(r"[./]|::", schema) if word not in ("", "msg")]
    label = _camel(parts[-1]) if parts else ""
    package = "_".join(_words("_".join(parts[:-1]))) or "json"
    return f"{package if package[0].isalpha() else f'json_{package}'}/msg/{label or 'Message'}"


def _words(name: str) -> list[str]:
    return [word.lower() for word in _WORD_ENDS.split(name) if word]


def _camel(name: str) -> str:
    made = "".join(word.capitalize() for word in _words(name))
    return made if not made or made[0].isalpha() else f"N{made}"


class JsonType:
    """A ROS type made of a JSON schema, and its messages.

    Args:
        name: Full name of the type, as of ``ros_name_of``.
        schema: The schema's text.

    Attributes:
        definition: Its definition with those of its parts, as ``.msg``.
        left_out: Keys of the messages read so far that the schema does not have.

    Raises:
        UsageError: The text is no JSON schema of an object.
    """

    def __init__(self, name: str, schema: str) -> None:
        self._package, _, self._label = name.partition("/msg/")
        self._texts: dict[str, str] = {}
        self._by_reference: dict[str, tuple[str, Read] | None] = {}
        self.left_out: dict[str, None] = {}
        try:
            self._schema = json.loads(schema)
            if not isinstance(self._schema, dict):
                raise UsageError("its JSON schema is no object")
            kind, self._read = self._message_type(self._label, self._schema, whole=True)
        except (ValueError, RecursionError) as error:
            raise UsageError(f"its JSON schema cannot be read: {error}") from None
        own = self._texts.pop(kind.rpartition("/")[2])
        parts = (f"{'=' * 80}\nMSG: {self._package}/{label}\n{text}" for label, text in self._texts.items())
        self.definition = "".join((own, *parts))
        self._types: rosbags.Typestore | None = None

    def decoded(self, types: rosbags.Typestore, data: bytes) -> Any:
        """Return a message as one of `types`, which know ``definition``.

        Raises ``UsageError`` if it does not fit.
        """
        self._types = types
        try:
            return self._read(json.loads(data))
        except (ValueError, RecursionError) as error:
            raise UsageError(f"these {len(data)} bytes are no JSON of its schema: {error}") from error

    # -- types of schemas

    def _type_of(self, label: str, schema: Any) -> tuple[str, Read]:
        """Return a ROS type, ``type[]`` for a list, and what reads its values."""
        schema = _single(schema)
        reference = schema.get("$ref")
        if isinstance(reference, str):
            return self._referred(reference)
        kind = str(schema.get("type"))
        if kind == "string" and schema.get("contentEncoding") == "base64":
            return "uint8[]", _bytes
        if kind in _SIMPLE:
            return _SIMPLE[kind], _plain(_SIMPLE[kind])
        if kind == "array" and isinstance(schema.get("items"), dict):
            inner, read = self._type_of(label, schema["items"])
            if inner.endswith("]"):
                inner, read = "string", json.dumps
            return f"{inner}[]", _list_of(inner, read)
        if kind == "object" and isinstance(schema.get("properties"), dict) and schema["properties"]:
            return self._message_type(label, schema)
        return "string", json.dumps

    def _referred(self, reference: str) -> tuple[str, Read]:
        if reference not in self._by_reference:
            self._by_reference[reference] = None
            found: Any = self._schema
            for word in reference.removeprefix("#").strip("/").split("/"):
                key = word.replace("~1", "/").replace("~0", "~")
                found = found.get(key) if isinstance(found, dict) else None
            label = f"{self._label}{_camel(reference.rpartition('/')[2])}"
            self._by_reference[reference] = self._type_of(label, found)
        return self._by_reference[reference] or ("string", json.dumps)  # the second: within itself

    def _message_type(self, label: str, schema: dict[str, Any], whole: bool = False) -> tuple[str, Read]:
        properties = schema.get("properties")
        properties = properties if isinstance(properties, dict) else {}
        if not whole and set(properties) == _STAMP_KEYS:
            kind = _STAMPS["duration" if schema.get("title") == "duration" else "time"]
            return kind, lambda value: self._stamp(kind, value)
        while label in self._texts:
            label += "X"
        self._texts[label] = ""  # its place is before its parts
        members: list[_Member] = []
        for key, inner in properties.items():
            name = "_".join(_words(key)) or "field"
            name = name if name[0].isalpha() else f"n{name}"
            while any(member.name == name for member in members):
                name += "x"
            members.append(_Member(key, name, *self._type_of(f"{label}{_camel(key)}", inner)))
        if not members:
            members = [_Member("", TEXT_FIELD, "string", json.dumps)]
        self._texts[label] = "".join(f"{member.type} {member.name}\n" for member in members)
        return f"{self._package}/{label}", lambda value: self._message(label, members, value)

    # -- values

    def _class(self, name: str) -> Any:
        assert self._types is not None
        return self._types.types[name]

    def _message(self, label: str, members: list[_Member], value: Any) -> Any:
        made = self._class(f"{self._package}/msg/{label}")
        if members[0].key == "":
            return made(**{TEXT_FIELD: json.dumps(value)})
        if value is not None and not isinstance(value, dict):
            raise UsageError(f"{label}: {_short(value)} is no object")
        value = value or {}
        known = {member.key for member in members}
        self.left_out.update({f"{label}.{key}": None for key in value if key not in known})
        fields = {}
        for one in members:
            try:
                fields[rosbags.normalize_fieldname(one.name)] = one.read(value.get(one.key))
            except UsageError as error:
                raise UsageError(f"{label}.{one.key}: {error}") from None
        return made(**fields)

    def _stamp(self, kind: str, value: Any) -> Any:
        value = value or {}
        if not isinstance(value, dict):
            raise UsageError(f"{_short(value)} is no time")
        read = _plain("int64")
        made = self._class(kind.replace("/", "/msg/"))
        return made(sec=read(value.get("sec")), nanosec=read(value.get("nsec")))


def _single(schema: Any) -> dict[str, Any]:
    """Return the one kind of a value that may also be null; an empty schema if there are several."""
    if not isinstance(schema, dict):
        return {}
    for key in ("anyOf", "oneOf", "allOf"):
        if isinstance(schema.get(key), list):
            real = [one for one in schema[key] if not (isinstance(one, dict) and one.get("type") == "null")]
            return _single(real[0]) if len(real) == 1 else {}
    if isinstance(schema.get("type"), list):
        kinds = [one for one in schema["type"] if one != "null"]
        return {**schema, "type": kinds[0]} if len(kinds) == 1 else {}
    return schema


def _plain(base: str) -> Read:
    kinds = _PYTHON_KINDS[base]
    make = {"int64": int, "float64": float, "bool": bool, "string": str}[base]

    def read(value: Any) -> Any:
        if value is None:
            return make()
        if base == "int64" and isinstance(value, float) and value.is_integer():
            value = int(value)
        if not isinstance(value, kinds) or (isinstance(value, bool) and base != "bool"):
            raise UsageError(f"{_short(value)} is no {base}")
        if isinstance(value, int) and not -(2**63) <= value < 2**63:
            raise UsageError(f"{_short(value)} does not fit into {base}")
        return make(value)

    return read


def _list_of(inner: str, read: Read) -> Read:
    def read_all(value: Any) -> Any:
        if value is not None and not isinstance(value, list):
            raise UsageError(f"{_short(value)} is no list")
        values = [read(one) for one in value or ()]
        return values if inner == "string" or "/" in inner else np.array(values, inner)

    return read_all


def _bytes(value: Any) -> Any:
    if not isinstance(value, str | None):
        raise UsageError(f"{_short(value)} is no text in base64")
    try:
        return np.frombuffer(b64decode(value or "", validate=True), np.uint8)
    except binascii.Error as error:
        raise UsageError(f"{_short(value)} is no base64: {error}") from None


def _short(value: Any) -> str:
    text = "a number" if isinstance(value, int) and abs(value) > 10**30 else repr(value)
    return text if len(text) < 60 else f"{text[:60]}..."
