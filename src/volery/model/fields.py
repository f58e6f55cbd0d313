"""The kinds of values that stand in a model's text, as pydantic annotations: what they become and how they
read.

Each says in the JSON Schema what an editor may offer.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, GetCoreSchemaHandler, GetJsonSchemaHandler, StringConstraints
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import core_schema

from volery.base import units
from volery.base.time import Ns
from volery.base.units import Kind, NotAQuantity
from volery.model.text import Quoted


class Form(BaseModel):
    """A mapping of the text with known keys."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class _Reader(ABC):
    """What stands in the text becomes what ``read`` makes of it."""

    @abstractmethod
    def read(self, written: object) -> object:
        """The value; ``NotAQuantity`` if it is none."""

    def __get_pydantic_core_schema__(
        self, source: object, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(self.read)


class _Rewriter(ABC):
    """What may be written shorter: it is validated as what ``meant`` makes of it."""

    @abstractmethod
    def meant(self, written: object) -> object:
        """The longer form."""

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        return core_schema.no_info_before_validator_function(self.meant, handler(source))


@dataclass(frozen=True)
class Written(_Reader):
    """A quantity as people write it. ``least`` and ``most`` are in the unit of its kind."""

    kind: Kind
    least: float | None = None
    above: float | None = None
    most: float | None = None

    def read(self, written: object) -> float:
        """The number; ``NotAQuantity`` if it is none or outside what is possible."""
        value = units.read(written, self.kind)
        unit = "" if self.kind.unit == "1" else f" {self.kind.unit}"
        if self.least is not None and value < self.least:
            raise NotAQuantity(f"{written} is too little: at least {self.least:g}{unit}")
        if self.above is not None and value <= self.above:
            raise NotAQuantity(f"{written} is too little: more than {self.above:g}{unit}")
        if self.most is not None and value > self.most:
            raise NotAQuantity(f"{written} is too much: at most {self.most:g}{unit}")
        return value

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        noun = self.kind.noun
        return {"type": ["string", "number"], "description": f"a {noun}, such as {self.kind.examples}"}


@dataclass(frozen=True)
class WrittenTime(Written):
    """A time, in nanoseconds; the bounds are in seconds."""

    def read(self, written: object) -> Ns:
        """Nanoseconds."""
        super().read(written)
        return units.read_ns(written)


@dataclass(frozen=True)
class Degrees(_Reader):
    """An angle in degrees: a bare number, or one with a unit."""

    most: float

    def read(self, written: object) -> float:
        """Degrees; ``NotAQuantity`` if beyond what there is."""
        bare = isinstance(written, int | float) and not isinstance(written, bool)
        value = units.read(f"{written!r} deg" if bare else written, units.ANGLE)
        if abs(value) > self.most:
            raise NotAQuantity(f"{written} is off the globe: {-self.most:g} to {self.most:g} degrees")
        return value

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        return {"type": ["number", "string"], "description": "degrees"}


SHORT = "x-short"
"""Marks, in the schema, a mapping that may be written as the value of this key alone."""


@dataclass(frozen=True)
class Short(_Rewriter):
    """A mapping that may be written as the value of its main key alone: ``battery: 5 Ah``."""

    key: str

    def meant(self, written: object) -> object:
        """The mapping that is meant."""
        return written if isinstance(written, dict) or written is None else {self.key: written}

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        return {"anyOf": [{"type": ["string", "number"]}, handler(schema)], SHORT: self.key}


@dataclass(frozen=True)
class Listed(_Rewriter):
    """A list that may be written without brackets if it has one item."""

    def meant(self, written: object) -> object:
        """The list that is meant."""
        return written if isinstance(written, list) else [written]

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        described = handler(schema)
        return {"anyOf": [described["items"], described]}


@dataclass(frozen=True)
class OrNothing(_Rewriter):
    """A mapping whose key may stand with nothing behind it."""

    def meant(self, written: object) -> object:
        """The mapping that is meant."""
        return {} if written is None else written

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        return {"anyOf": [handler(schema), {"type": "null"}]}


@dataclass(frozen=True)
class Switch(_Rewriter):
    """A mapping that may be written ``true`` (all by default) or ``false`` (as if it were not there)."""

    def meant(self, written: object) -> object:
        """The mapping that is meant, or nothing."""
        return ({} if written else None) if isinstance(written, bool) else written

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        return {"anyOf": [{"type": "boolean"}, handler(schema)]}


class _Parameter(_Reader):
    """Whatever YAML can say; an unquoted number with a unit becomes a number in SI units."""

    def read(self, written: object) -> object:
        """See ``parameter``."""
        return parameter(written)

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        return {"description": "any value; an unquoted `6 / h` or `10 m` becomes a number in SI units"}


def parameter(written: Any) -> Any:
    """The value of a parameter: see ``volery.model.system.Value``."""
    if isinstance(written, Mapping):
        return {key: parameter(value) for key, value in written.items()}
    if isinstance(written, list):
        return tuple(parameter(value) for value in written)
    if isinstance(written, Quoted):
        return str(written)
    if isinstance(written, str):
        return _number_or_text(written)
    return written


def _number_or_text(written: str) -> float | str:
    try:
        return float(units.parse(written).value)
    except NotAQuantity:
        return written


Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z_][A-Za-z0-9_-]*$")]
Parameters = dict[str, Annotated[Any, _Parameter()]]
Time = Annotated[Ns, WrittenTime(units.TIME, least=0)]
Period = Annotated[Ns, WrittenTime(units.TIME, above=0)]
Energy = Annotated[float, Written(units.ENERGY, least=0)]
Frequency = Annotated[float, Written(units.FREQUENCY, above=0)]
Rate = Annotated[float, Written(units.RATE, least=0)]
Bandwidth = Annotated[float, Written(units.BANDWIDTH, above=0)]
Length = Annotated[float, Written(units.LENGTH)]
Distance = Annotated[float, Written(units.LENGTH, least=0)]
Speed = Annotated[float, Written(units.SPEED, least=0)]
Charge = Annotated[float, Written(units.CHARGE, above=0)]
Voltage = Annotated[float, Written(units.VOLTAGE, above=0)]
Loss = Annotated[float, Written(units.RATIO, least=0, most=0.99)]
Load = Annotated[float, Written(units.RATIO, least=0, most=0.99)]
Share = Annotated[float, Written(units.RATIO, least=0, most=1)]
Latitude = Annotated[float, Degrees(90.0)]
Longitude = Annotated[float, Degrees(180.0)]
Heading = Annotated[float, Degrees(360.0)]
Provenance = Literal["estimated", "measured", "calculated", "required"]
