"""How the fields of the model's classes are written: one declaration for parser, JSON Schema and reference.

A frozen dataclass declares each field that a model may state as ``Annotated[type, syntax, description]``. The
syntax parses what is written and describes itself in the JSON Schema; the default of the field is its
default in the file. The key in the file is the name of the field without its unit (``latency_ns`` is written
``latency``), or a ``Key``. Fields without a syntax (``name``, ``where``) are filled in by the reader.

Rejected: pydantic. It needs a second class for each entity, since lines, names that come from keys, and
references cannot be filled in while it validates; and each of its messages has to be rephrased for models.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, dataclass, fields
from functools import cache
from typing import Annotated, Any, get_args, get_origin, get_type_hints

from volery.base import units
from volery.base.errors import choices, did_you_mean
from volery.base.time import Ns, S
from volery.base.units import Kind, QuantityError
from volery.model import rules
from volery.model.reading import PROVENANCES, ModelReading, Provenance
from volery.model.rules import ModelRule
from volery.model.text import Path, Quoted, TextNode

Schema = dict[str, Any]

SHORT = "x-short"
"""Marks, in the JSON Schema, a mapping that may be written as the value of this key alone."""

_LONGEST_SHOWN = 200
"""Characters of a value in a message."""
NAME = r"^[A-Za-z_][A-Za-z0-9_-]*$"
_UNIT_SUFFIX = re.compile(r"_(ns|hz|bit_s|m_s2|m_s|m2|m|deg_s|deg|coulomb|kg|ohm|v|w|j|b)$")


class WrongValueError(ValueError):
    """The written value does not fit its field. An empty message: the problem has been reported already."""

    def __init__(self, message: str, rule: ModelRule = rules.WRONG_VALUE) -> None:
        super().__init__(message)
        self.rule = rule


def expected(what: str, node: TextNode) -> WrongValueError:
    """Return the error for a *node* that is something else than *what*."""
    return WrongValueError(f"{what} is expected, not {shown(node)}")


def shown(node: TextNode) -> str:
    """Return the value of *node* for a message."""
    if isinstance(node.value, dict | list):
        return "a mapping" if isinstance(node.value, dict) else "a list"
    if node.value is None:
        return "nothing"
    text = repr(node.value) if isinstance(node.value, str) else str(node.value)
    return text if len(text) <= _LONGEST_SHOWN else f"{text[:_LONGEST_SHOWN]}… ({len(text)} characters)"


class Syntax(ABC):
    """How a value is written in a model."""

    @abstractmethod
    def read(self, node: TextNode, path: Path, reading: ModelReading) -> Any:
        """Return the value of *node*, which stands at *path*.

        Raises:
            WrongValueError, QuantityError: the node is not written in this syntax.
        """

    @abstractmethod
    def schema(self, definitions: Schema) -> Schema:
        """Return the JSON Schema. Schemas of records are added to *definitions*."""

    def written(self, value: Any) -> Any:
        """Return *value*, a default, as it would be written; None if it is not worth stating."""
        return value if isinstance(value, bool | int | float) or (value and isinstance(value, str)) else None


def read_child(syntax: Syntax, node: TextNode, path: Path, reading: ModelReading) -> tuple[bool, Any]:
    """Return (True, the value of *node*), or (False, None) after reporting what is wrong with it."""
    try:
        return True, syntax.read(node, path, reading)
    except (WrongValueError, QuantityError) as error:
        if str(error):
            rule = error.rule if isinstance(error, WrongValueError) else rules.WRONG_QUANTITY
            reading.problems.add(path, str(error), node.where, rule)
        return False, None


# -- scalars


class TextField(Syntax):
    """Any text."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> str:
        """See ``Syntax``."""
        if not isinstance(node.value, str):
            raise expected("text", node)
        return node.value

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return {"type": "string"}


@dataclass(frozen=True)
class Whole(Syntax):
    """A whole number of at least ``least`` and at most ``most``."""

    least: int | None = None
    most: int | None = None

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> int:
        """See ``Syntax``."""
        value = node.value
        if not isinstance(value, int) or isinstance(value, bool):
            raise expected("a whole number", node)
        if self.least is not None and value < self.least:
            raise WrongValueError(f"{value} is too little: at least {self.least}")
        if self.most is not None and value > self.most:
            raise WrongValueError(f"{value} is too much: at most {self.most}")
        return value

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        bounds = {"minimum": self.least, "maximum": self.most}
        return {"type": "integer", **{key: value for key, value in bounds.items() if value is not None}}


class Number(Syntax):
    """A number without a unit."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> float:
        """See ``Syntax``."""
        if isinstance(node.value, dict | list) or node.value is None:
            raise expected("a number", node)
        try:
            return float(node.value)
        except (ValueError, OverflowError):
            raise expected("a number", node) from None

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return {"type": "number"}


@dataclass(frozen=True)
class OneOf(Syntax):
    """One of a few fixed values."""

    values: tuple[str | int, ...]

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> str | int:
        """See ``Syntax``."""
        for value in self.values:
            if type(value) is type(node.value) and value == node.value:
                return value
        names = [str(value) for value in self.values]
        raise WrongValueError(
            f"{shown(node)} is not one of {choices(names)}{did_you_mean(str(node.value), names)}"
        )

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return {"enum": list(self.values)}


STATED_KEYS = ("value", "provenance", "uncertainty", "source")
"""Keys of a quantity that is written with its provenance."""


def _bare_value(node: TextNode, path: Path, reading: ModelReading) -> object:
    """Return what is written for a quantity; record its provenance if it is written as a mapping."""
    if not isinstance(node.value, dict):
        return node.value
    for key in node.items:
        if key not in STATED_KEYS:
            what = f"unknown key{did_you_mean(key, STATED_KEYS)}; valid here: {choices(STATED_KEYS)}"
            reading.problems.add((*path, key), what, node.where, rules.UNKNOWN_KEY)
    if "value" not in node.items:
        reading.problems.add((*path, "value"), "this key is missing", node.where, rules.MISSING_KEY)
        raise WrongValueError("")
    provenance, uncertainty, source = (node.child(key) for key in STATED_KEYS[1:])
    reading.provenances[path] = Provenance(
        str(OneOf(PROVENANCES).read(provenance, path, reading)) if provenance else "estimated",
        units.read(uncertainty.value, units.RATIO) if uncertainty else None,
        str(source.value) if source else "",
    )
    return node.items["value"].value


def _quantity_schema() -> Schema:
    described = {
        "value": {"type": ["string", "number"], "description": "The quantity."},
        "provenance": {"enum": list(PROVENANCES), "description": "Where it comes from."},
        "uncertainty": {"type": ["string", "number"], "description": "Relative standard uncertainty."},
        "source": {"type": "string", "description": "The publication, the data sheet or the measurement."},
    }
    return {
        "type": ["string", "number", "object"],
        "properties": described,
        "required": ["value"],
        "additionalProperties": False,
    }


@dataclass(frozen=True)
class QuantityField(Syntax):
    """A number with a unit, such as ``3 m/s``, or a mapping of it with its provenance.

    The bounds are in the unit of its ``kind``.
    """

    kind: Kind
    least: float | None = None
    above: float | None = None
    most: float | None = None

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> float:
        """See ``Syntax``. The value is in the unit of its kind."""
        return self._checked(_bare_value(node, path, reading))

    def _checked(self, written: object) -> float:
        unit = "" if self.kind.unit == "1" else f" {self.kind.unit}"
        value = units.read(written, self.kind)
        if self.least is not None and value < self.least:
            raise QuantityError(f"{written} is too little: at least {self.least:g}{unit}")
        if self.above is not None and value <= self.above:
            raise QuantityError(f"{written} is too little: more than {self.above:g}{unit}")
        if self.most is not None and value > self.most:
            raise QuantityError(f"{written} is too much: at most {self.most:g}{unit}")
        return value

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        bounds = {"x-minimum": self.least, "x-above": self.above, "x-maximum": self.most}
        stated = {key: value for key, value in bounds.items() if value is not None}
        return {**_quantity_schema(), "x-unit": self.kind.unit, "x-quantity": self.hint(), **stated}

    def hint(self) -> str:
        """Return what is to be written, with examples."""
        return f"{self.kind.noun}, such as {self.kind.examples}"

    def written(self, value: Any) -> Any:
        """See ``Syntax``."""
        return f"{value:g} {self.kind.unit}".removesuffix(" 1") if isinstance(value, int | float) else None


class Duration(QuantityField):
    """A time, read to whole nanoseconds. The bounds are in seconds."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> Ns:
        """See ``Syntax``. The value is in nanoseconds."""
        written = _bare_value(node, path, reading)
        self._checked(written)
        return units.read_ns(written)

    def written(self, value: Any) -> Any:
        """See ``Syntax``."""
        return f"{value / S:g} s" if isinstance(value, int) else None


@dataclass(frozen=True)
class Angle(Syntax):
    """An angle: a bare number of degrees, or a number with a unit. ``turn`` wraps it to 0..360 degrees."""

    most: float
    turn: bool = False

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> float:
        """See ``Syntax``. The value is in degrees."""
        written = node.value
        bare = isinstance(written, int | float) and not isinstance(written, bool)
        value = units.read(f"{written!r} deg" if bare else written, units.ANGLE)
        if abs(value) > self.most:
            raise QuantityError(f"{written} is off the globe: {-self.most:g} to {self.most:g} degrees")
        return value % 360.0 if self.turn else value

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        bounds = {"x-minimum": -self.most, "x-maximum": self.most}
        return {"type": ["number", "string"], "x-unit": "deg", "x-quantity": "degrees", **bounds}

    def written(self, value: Any) -> Any:
        """See ``Syntax``."""
        return f"{value:g} deg" if isinstance(value, int | float) else None


class Anything(Syntax):
    """Whatever YAML can state; an unquoted number with a unit becomes a number in SI units."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> Any:
        """See ``Syntax``. Lists become tuples."""
        return _si(node.plain())

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return {"x-quantity": "any value; an unquoted `6 / h` or `10 m` becomes a number in SI units"}


class AsWritten(Anything):
    """Whatever YAML can state, as it is written: what sets another value of the model."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> Any:
        """See ``Syntax``."""
        return node.plain()


def _si(written: Any) -> Any:
    if isinstance(written, Mapping):
        return {key: _si(value) for key, value in written.items()}
    if isinstance(written, list):
        return tuple(_si(value) for value in written)
    if isinstance(written, Quoted):
        return str(written)
    if not isinstance(written, str):
        return written
    try:
        return float(units.parse(written).value)
    except QuantityError:
        return written


@dataclass(frozen=True)
class NameField(Syntax):
    """The name of something that ``valid`` lists. ``none`` is a word that stands for no such thing."""

    noun: str
    valid: Callable[[ModelReading], Iterable[str]]
    none: str = ""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> str | None:
        """See ``Syntax``. An unknown name is reported and returned."""
        if not isinstance(node.value, str):
            raise expected("text", node)
        if self.none and node.value == self.none:
            return None
        reading.known(path, node.value, self.noun, self.valid(reading))
        return node.value

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        other = f", or `{self.none}`" if self.none else ""
        return {
            "type": "string",
            "x-quantity": f"the name of {'an' if self.noun[0] in 'aeiou' else 'a'} {self.noun}{other}",
        }


# -- collections


@dataclass(frozen=True)
class ListOf(Syntax):
    """A list of at least ``least`` items. ``bare``: a single item may be written without brackets."""

    item: Syntax
    least: int = 0
    bare: bool = False

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> tuple[Any, ...]:
        """See ``Syntax``."""
        if not isinstance(node.value, list):
            if self.bare:
                return (self.item.read(node, path, reading),)
            raise expected("a list", node)
        if len(node.value) < self.least:
            raise WrongValueError(f"at least {self.least} are needed here, not {len(node.value)}")
        found = [read_child(self.item, one, (*path, place), reading) for place, one in enumerate(node.value)]
        if not all(right for right, _ in found):
            raise WrongValueError("")
        return tuple(value for _, value in found)

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        items = self.item.schema(definitions)
        listed = {"type": "array", "items": items, **({"minItems": self.least} if self.least else {})}
        return {"anyOf": [items, listed]} if self.bare else listed


@dataclass(frozen=True)
class MapOf(Syntax):
    """A mapping of names, or of any keys (``free``), to values. Entries that are wrong are left out.

    ``values_only`` returns a tuple of the values, for records that carry their names.
    """

    item: Syntax
    free: bool = False
    values_only: bool = False

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> dict[str, Any] | tuple[Any, ...]:
        """See ``Syntax``."""
        if not isinstance(node.value, dict):
            raise expected("a mapping of keys", node)
        found = {}
        for name, one in node.items.items():
            if not self.free and re.search(NAME, name) is None:
                what = f"{name!r} is no name: letters, digits, _ and -, starting with a letter"
                reading.problems.add((*path, name), what, one.where, rules.BAD_NAME)
                continue
            right, value = read_child(self.item, one, (*path, name), reading)
            if right:
                found[name] = value
        return tuple(found.values()) if self.values_only else found

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        item = self.item.schema(definitions)
        below = {"additionalProperties": item} if self.free else {"patternProperties": {NAME: item}}
        return {"type": "object", **below, **({} if self.free else {"additionalProperties": False})}


@dataclass(frozen=True)
class Shorter(Syntax):
    """A record that may be written shorter.

    ``key``: as the value of its main key alone. ``switch``: as ``true`` (all by default) or ``false``
    (absent). ``empty``: as nothing (all by default).
    """

    record: Syntax
    key: str = ""
    switch: bool = False
    empty: bool = False

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> Any:
        """See ``Syntax``."""
        if isinstance(node.value, bool) and self.switch:
            return self.record.read(TextNode({}, node.where), path, reading) if node.value else None
        if node.value is None and self.empty:
            node = TextNode({}, node.where)
        if self.key and not isinstance(node.value, dict) and node.value is not None:
            node = TextNode({self.key: node}, node.where)
        return self.record.read(node, path, reading)

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        short: list[Schema] = []
        short += [{"type": ["string", "number"]}] if self.key else []
        short += [{"type": "boolean"}] if self.switch else []
        short += [{"type": "null"}] if self.empty else []
        marked = {SHORT: self.key} if self.key else {}
        return {"anyOf": [*short, self.record.schema(definitions)], **marked}


@dataclass(frozen=True)
class Shared(Syntax):
    """A mapping written in ``syntax`` that other parts of the model need, too: ``make`` reads it once."""

    syntax: Syntax
    make: Callable[[ModelReading], Any]

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> Any:
        """See ``Syntax``."""
        if not isinstance(node.value, dict):
            raise expected("a mapping of keys", node)
        return reading.once(self.make)

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return self.syntax.schema(definitions)


# -- records


@dataclass(frozen=True)
class Key:
    """The key of a field, where it differs from the name of the field without its unit."""

    name: str


@dataclass(frozen=True)
class Others:
    """Marks the field that takes all keys that no other field has, as a mapping."""


@dataclass(frozen=True)
class DeclaredField:
    """A declared field: where it is written, how, what it means and what it is if it is not stated."""

    attribute: str
    key: str
    syntax: Syntax
    description: str
    default: Any = MISSING
    others: bool = False

    @property
    def required(self) -> bool:
        """True if a model must state the field."""
        return self.default is MISSING and not self.others


def entries(cls: Any) -> tuple[DeclaredField, ...]:
    """Return the declared fields of a dataclass."""
    return _entries(cls)


@cache
def _entries(cls: Any) -> tuple[DeclaredField, ...]:
    hints = get_type_hints(cls, include_extras=True)
    found = []
    for field in fields(cls):
        hint = hints[field.name]
        meta = get_args(hint)[1:] if get_origin(hint) is Annotated else ()
        syntax = next((each for each in meta if isinstance(each, Syntax)), None)
        if syntax is None:
            continue
        key = next((each.name for each in meta if isinstance(each, Key)), _UNIT_SUFFIX.sub("", field.name))
        default = field.default if field.default_factory is MISSING else field.default_factory()
        others = any(isinstance(each, Others) for each in meta)
        text = next((each for each in meta if isinstance(each, str)), "")
        found.append(DeclaredField(field.name, key, syntax, text, default, others))
    return tuple(found)


@dataclass(frozen=True)
class Record(Syntax):
    """A mapping with the declared keys of a dataclass.

    ``prepare`` may add entries to the mapping before it is read: defaults that stand elsewhere, which are
    then ``supplied``. ``kind`` is the value of the key ``kind``, where the mapping is one of several.
    """

    cls: type[Any]
    prepare: Callable[[TextNode, Path, ModelReading], TextNode] | None = None
    kind: str = ""
    supplied: tuple[str, ...] = ()

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> Any:
        """See ``Syntax``. ``name`` is the last step of *path*, ``where`` the line of the mapping."""
        if not isinstance(node.value, dict):
            raise expected("a mapping of keys", node)
        if self.prepare is not None:
            node = self.prepare(node, path, reading)
        declared = entries(self.cls)
        keys = {one.key: one for one in declared if not one.others}
        others = next((one for one in declared if one.others), None)
        wrong = self._misses_keys(keys, node, path, reading)
        rest: dict[str, TextNode] = {}
        values: dict[str, Any] = {}
        for key, below in node.items.items():
            entry = keys.get(key)
            if entry is None:
                rest[key] = below
            elif not (below.value is None and entry.default is None):
                fits, values[entry.attribute] = read_child(entry.syntax, below, (*path, key), reading)
                wrong |= not fits
        if others is not None:
            fits, values[others.attribute] = read_child(
                others.syntax, TextNode(rest, node.where), path, reading
            )
            wrong |= not fits
        elif self._has_unknown_keys(rest, keys, path, reading):
            wrong = True
        if wrong:
            raise WrongValueError("")
        own = {field.name for field in fields(self.cls)} - {one.attribute for one in declared}
        filled = {"name": str(path[-1]) if path else "", "where": node.where}
        return self.cls(**values, **{name: value for name, value in filled.items() if name in own})

    def _misses_keys(
        self, keys: Mapping[str, DeclaredField], node: TextNode, path: Path, reading: ModelReading
    ) -> bool:
        missing = [key for key, entry in keys.items() if entry.required and key not in node.items]
        for key in missing:
            reading.problems.add((*path, key), "this key is missing", node.where, rules.MISSING_KEY)
        return bool(missing)

    def _has_unknown_keys(
        self,
        rest: Mapping[str, TextNode],
        keys: Mapping[str, DeclaredField],
        path: Path,
        reading: ModelReading,
    ) -> bool:
        known = [*keys, "kind"] if self.kind else list(keys)
        unknown = {key: node for key, node in rest.items() if key not in known}
        for key, node in unknown.items():
            what = f"unknown key{did_you_mean(key, known)}; valid here: {choices(known)}"
            reading.problems.add((*path, key), what, node.where, rules.UNKNOWN_KEY)
        return bool(unknown)

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        name = self.cls.__name__
        if name not in definitions:
            definitions[name] = {}  # a record may contain itself
            definitions[name] = self._definition(definitions)
        return {"$ref": f"#/$defs/{name}"}

    def _definition(self, definitions: Schema) -> Schema:
        properties: Schema = {}
        if self.kind:
            properties["kind"] = {"const": self.kind, "description": "The kind of fault."}
        below: Schema | bool = False
        for entry in entries(self.cls):
            described = property_schema(entry, definitions)
            if entry.others:
                below = {**described["additionalProperties"], "description": entry.description}
            else:
                properties[entry.key] = described
        required = ["kind"] if self.kind else []
        declared = entries(self.cls)
        required += [one.key for one in declared if one.required and one.key not in self.supplied]
        return {
            "type": "object",
            "description": summary(self.cls),
            "properties": properties,
            **({"required": required} if required else {}),
            "additionalProperties": below,
        }


def property_schema(entry: DeclaredField, definitions: Schema) -> Schema:
    """Return the JSON Schema of a declared field: its syntax, its meaning and its default."""
    made = entry.syntax.schema(definitions)
    hint = made.pop("x-quantity", "")
    sentence = f" {hint[0].upper()}{hint[1:]}." if hint else ""
    default = None if entry.default is MISSING else entry.syntax.written(entry.default)
    return {
        **made,
        "description": f"{entry.description}{sentence}",
        **({} if default is None else {"default": default}),
    }


def summary(cls: type[Any]) -> str:
    """Return the first paragraph of a class's docstring on one line, without its markup."""
    first = (cls.__doc__ or "").split("\n\n")[0]
    return " ".join(first.split()).replace("``", "`")


TEXT = TextField()
NUMBER = Number()
ANYTHING = Anything()
AS_WRITTEN = AsWritten()
TIME = Duration(units.TIME, least=0)
PERIOD = Duration(units.TIME, above=0)
ENERGY = QuantityField(units.ENERGY, least=0)
FREQUENCY = QuantityField(units.FREQUENCY, above=0)
RATE = QuantityField(units.RATE, least=0)
BANDWIDTH = QuantityField(units.BANDWIDTH, above=0)
DATA_SIZE = QuantityField(units.DATA_SIZE, least=0)
LENGTH = QuantityField(units.LENGTH)
DISTANCE = QuantityField(units.LENGTH, least=0)
SPEED = QuantityField(units.SPEED, least=0)
TURN_RATE = QuantityField(units.TURN_RATE, least=0)
ACCELERATION = QuantityField(units.ACCELERATION, least=0)
CHARGE = QuantityField(units.CHARGE, above=0)
VOLTAGE = QuantityField(units.VOLTAGE, above=0)
LOSS = QuantityField(units.RATIO, least=0, most=0.99)
SHARE = QuantityField(units.RATIO, least=0, most=1)
LATITUDE = Angle(90.0)
LONGITUDE = Angle(180.0)
HEADING = Angle(360.0, turn=True)

VEHICLE = NameField("vehicle", lambda reading: reading.names(("environment", "vehicles")))
PROCESSOR = NameField("processor", lambda reading: reading.names(("platform", "processors")))
NETWORK = NameField("network", lambda reading: reading.names(("platform", "networks")))
AUTOPILOT = NameField("autopilot", lambda reading: sorted(reading.vocabulary.autopilots))
PROCESSOR_KIND = NameField("processor in the catalogue", lambda reading: reading.vocabulary.processors)
