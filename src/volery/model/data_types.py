"""Data types of arguments and messages, by name.

A model may state them; then a type of an argument that is none of them is a problem. Without them, types are
text for people and generators.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

from volery.base.errors import Location
from volery.model import rules
from volery.model.fields import TEXT, ListOf, MapOf, Record, Shorter
from volery.model.reading import ModelReading
from volery.model.text import Path

SECTION: Path = ("types",)
PRIMITIVES = ("bool", "bytes", "dict", "float", "int", "list", "object", "str", "tuple")
"""Types that need no declaration."""

_WORD = re.compile(r"[A-Za-z_][\w/]*")


@dataclass(frozen=True, slots=True)
class DataType:
    """A data type of arguments and messages: a structure with fields, or an enumeration with values."""

    name: str
    fields: Annotated[
        Mapping[str, str], MapOf(TEXT), "Fields by name, and their types with a unit: `float m`."
    ] = field(default_factory=dict)
    values: Annotated[tuple[str, ...], ListOf(TEXT), "Values of an enumeration."] = ()
    description: Annotated[str, TEXT, "What it stands for."] = ""
    where: Location | None = field(default=None, compare=False)


DATA_TYPES = MapOf(Shorter(Record(DataType), empty=True))


def check_type(reading: ModelReading, path: Path, text: str) -> None:
    """Report the types of *text* that the model does not declare, if it declares any.

    A unit may follow the type (``float m``); a message type has a ``/``.
    """
    declared = reading.names(SECTION)
    if not declared:
        return
    words = _WORD.findall(text.partition(" ")[0] if "[" not in text else text)
    for word in words:
        if "/" not in word:
            reading.known(path, word, "type", [*declared, *PRIMITIVES], rules.UNKNOWN_TYPE)
