"""Service types of ROS for the operations of a model's interfaces, and values to and from their messages.

An operation has a type if all its arguments and its result have: ``str``, ``bool``, ``int``, ``float``,
``Position``, a dataclass of a Python file beside the components, and lists of these (``Position[]``). The
annotations of dataclasses are read from the source; nothing is executed. The response says in ``done``
whether the operation has a result, in ``error`` why not.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

from volery.base.errors import UsageError
from volery.base.position import AMSL, AboveGround, AboveHome, Ellipsoidal, Position
from volery.model.components import Signature
from volery.model.system import System
from volery.ros.messages import RosMessage, new, request

PRIMITIVES = {"str": "string", "bool": "bool", "int": "int64", "float": "float64"}
_PYTHON: Mapping[str, tuple[type, ...]] = {
    "str": (str,),
    "bool": (bool,),
    "int": (int,),
    "float": (int, float),
}
_CONSTRUCTORS: Mapping[str, Callable[[Any], Any]] = {"str": str, "bool": bool, "int": int, "float": float}
_ALTITUDES = {one.__name__: one for one in (AMSL, AboveHome, AboveGround, Ellipsoidal)}
INTERFACES = "interfaces"
"""Last word of the package of a system's messages and services."""
POSITION = "Position"
_POSITION_TEXT = """# WGS-84 degrees, and metres above what `reference` names:
# AMSL, AboveHome, AboveGround or Ellipsoidal
float64 latitude
float64 longitude
float64 altitude
string reference
"""
_FIELD = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*\Z")
_LIST = re.compile(
    r"(?:list\[(?P<list>[^\[\],]+)\]|tuple\[(?P<tuple>[^\[\],]+), *\.\.\.\]|(?P<bare>.+)\[\])\Z"
)


def package_name(*parts: str) -> str:
    """Return a name that ROS 1 and ROS 2 allow: lower case letters, digits and single underscores."""
    words = re.sub(r"[^a-z0-9]+", "_", "_".join(parts).lower()).strip("_")
    return words if words[:1].isalpha() else f"pkg_{words}"


@dataclass(frozen=True)
class _Dataclass:
    """A dataclass: the file beside the components that defines it, and the types of its fields."""

    file: Path
    fields: Mapping[str, str]

    @property
    def module(self) -> str:
        return self.file.stem


@dataclass(frozen=True)
class OperationType:
    """The service type of an operation; ``arguments`` are names and types, ``returns`` may be empty."""

    name: str
    arguments: tuple[tuple[str, str], ...]
    returns: str


@dataclass(frozen=True)
class CallTypes:
    """The service types of a system, in the package ``package``.

    ``definitions`` are the texts of all messages and services by their full names, for the message store.
    ``operations`` are by interface and operation; one without a type is missing.
    """

    package: str
    definitions: Mapping[str, str]
    operations: Mapping[tuple[str, str], OperationType]
    records: Mapping[str, _Dataclass] = field(default_factory=dict)

    def files(self) -> tuple[Path, ...]:
        """Return the files of the dataclasses that messages are made of."""
        used = {name.rpartition("/")[2] for name in self.definitions}
        return tuple(dict.fromkeys(one.file for name, one in self.records.items() if name in used))

    def request(
        self, kind: OperationType, args: tuple[Any, ...], kwargs: dict[str, Any], what: str
    ) -> RosMessage:
        """Return the request of a call. Raises ``UsageError`` naming *what* for values of other types."""
        names = [name for name, _ in kind.arguments]
        given = dict(zip(names, args, strict=False)) | kwargs
        if len(args) > len(names) or set(given) != set(names):
            raise UsageError(
                f"{what}: state each of ({', '.join(names)}) once; a deployed call has no defaults"
            )
        fields = {
            name: self._to_field(given[name], type_, f"{what}: {name}") for name, type_ in kind.arguments
        }
        made: RosMessage = request(kind.name, **fields)
        return made

    def arguments(self, kind: OperationType, asked: Any, find: Find) -> dict[str, Any]:
        """Return the arguments of a request by name."""
        return {name: self._from_field(getattr(asked, name), type_, find) for name, type_ in kind.arguments}

    def response(self, kind: OperationType, result: Any, what: str) -> RosMessage:
        """Return the response with a result; raise ``UsageError`` naming *what* if it is of another type."""
        fields = {"result": self._to_field(result, kind.returns, what)} if kind.returns else {}
        made: RosMessage = new(f"{kind.name}_Response", done=True, **fields)
        return made

    def failure(self, kind: OperationType, error: str) -> RosMessage:
        """Return the response of an operation that failed."""
        made: RosMessage = new(f"{kind.name}_Response", done=False, error=error)
        return made

    def result(self, kind: OperationType, answer: Any, find: Find) -> Any:
        """Return the result of a response."""
        return self._from_field(answer.result, kind.returns, find) if kind.returns else None

    def _to_field(self, value: Any, type_: str, what: str) -> Any:
        inner = _element(type_)
        if inner:
            if not isinstance(value, list | tuple):
                raise UsageError(f"{what} is no list of {inner}, but {value!r}")
            return [self._to_field(one, inner, what) for one in value]
        if type_ in PRIMITIVES:
            if not isinstance(value, _PYTHON[type_]) or (isinstance(value, bool) and type_ != "bool"):
                raise UsageError(f"{what} is no {type_}, but {value!r}")
            return _CONSTRUCTORS[type_](value)
        full = f"{self.package}/msg/{type_}"
        if type_ == POSITION:
            if not isinstance(value, Position):
                raise UsageError(f"{what} is no Position, but {value!r}")
            return new(
                full, latitude=float(value.latitude), longitude=float(value.longitude),
                altitude=float(value.altitude.metres), reference=type(value.altitude).__name__,
            )  # fmt: skip
        if type(value).__name__ != type_:
            raise UsageError(f"{what} is no {type_}, but {value!r}")
        return new(
            full,
            **{
                name: self._to_field(getattr(value, name), below, f"{what}.{name}")
                for name, below in self.records[type_].fields.items()
            },
        )

    def _from_field(self, value: Any, type_: str, find: Find) -> Any:
        inner = _element(type_)
        if inner:
            return [self._from_field(one, inner, find) for one in value]
        if type_ in PRIMITIVES:
            return _CONSTRUCTORS[type_](value)
        if type_ == POSITION:
            if value.reference not in _ALTITUDES:
                raise UsageError(
                    f"a position refers to {value.reference!r}: there is {', '.join(_ALTITUDES)}"
                )
            altitude = _ALTITUDES[value.reference](value.altitude)
            return Position(value.latitude, value.longitude, altitude)
        record = self.records[type_]
        cls = getattr(find(record.module), type_, None)
        if not isinstance(cls, type):
            raise UsageError(f"no class {type_} in {record.module}.py beside the components")
        return cls(
            **{
                name: self._from_field(getattr(value, name), below, find)
                for name, below in record.fields.items()
            }
        )


Find = Callable[[str], ModuleType | None]
"""Returns the module of that name beside the components of this process, loaded if necessary."""


def call_types(system: System) -> CallTypes:
    """Return the service types of the interfaces of *system*."""
    package = package_name(system.name, INTERFACES)
    records = _records(system)
    texts: dict[str, str] = {}
    operations: dict[tuple[str, str], OperationType] = {}
    for interface in system.interfaces.values():
        for signature in interface.operations.values():
            name = _camel(interface.name) + _camel(signature.name)
            used = _used(signature, records)
            if used is None:
                continue
            texts[f"{package}/srv/{name}"] = _service_text(signature, package)
            for one in used:
                texts[f"{package}/msg/{one}"] = _message_text(one, records, package)
            arguments = tuple((each.name, each.type) for each in signature.arguments)
            kind = OperationType(f"{package}/srv/{name}", arguments, signature.returns)
            operations[interface.name, signature.name] = kind
    return CallTypes(package, texts, operations, records)


def _records(system: System) -> dict[str, _Dataclass]:
    """Return the dataclasses of the Python files beside the components, by name."""
    folders = {
        system.file_of(instance.component).parent: None
        for instance in system.instances
        if instance.component.path
    }
    found: dict[str, _Dataclass] = {}
    for file in (file for folder in folders for file in sorted(folder.glob("*.py"))):
        try:
            tree = ast.parse(file.read_bytes())
        except (OSError, SyntaxError, ValueError):
            continue  # loading it says what is wrong
        for node in tree.body:
            if isinstance(node, ast.ClassDef) and _is_dataclass(node):
                fields = {
                    one.target.id: ast.unparse(one.annotation)
                    for one in node.body
                    if isinstance(one, ast.AnnAssign) and isinstance(one.target, ast.Name)
                }
                found.setdefault(node.name, _Dataclass(file, fields))
    return found


def _is_dataclass(node: ast.ClassDef) -> bool:
    return any("dataclass" in ast.unparse(one) for one in node.decorator_list)


def _element(type_: str) -> str:
    """Return the type of the elements of a list type, empty for any other type."""
    match = _LIST.match(type_)
    return next((group.strip() for group in match.groups() if group), "") if match else ""


def _used(signature: Signature, records: Mapping[str, _Dataclass]) -> list[str] | None:
    """Return the messages that an operation needs, None if one of its types cannot be a message."""
    used: dict[str, None] = {}
    waiting = [(argument.name, argument.type) for argument in signature.arguments]
    waiting += [("result", signature.returns)] if signature.returns else []
    while waiting:
        name, type_ = waiting.pop()
        plain = _element(type_) or type_
        if not _FIELD.match(name) or _element(plain):
            return None
        if plain in PRIMITIVES or plain in used:
            continue
        if plain != POSITION and (plain not in records or not records[plain].fields):
            return None
        used[plain] = None
        if plain != POSITION:
            waiting += records[plain].fields.items()
    return list(used)


def _service_text(signature: Signature, package: str) -> str:
    asked = "".join(f"{_field(argument.type, package)} {argument.name}\n" for argument in signature.arguments)
    result = f"{_field(signature.returns, package)} result\n" if signature.returns else ""
    return f"{asked}---\nbool done\nstring error\n{result}"


def _message_text(name: str, records: Mapping[str, _Dataclass], package: str) -> str:
    if name == POSITION:
        return _POSITION_TEXT
    return "".join(f"{_field(type_, package)} {one}\n" for one, type_ in records[name].fields.items())


def _field(type_: str, package: str) -> str:
    inner = _element(type_)
    plain = inner or type_
    written = PRIMITIVES.get(plain, f"{package}/{plain}")
    return f"{written}[]" if inner else written


def _camel(name: str) -> str:
    return "".join(part[:1].upper() + part[1:] for part in re.split(r"[^A-Za-z0-9]+", name) if part)
