"""Recordings that a run plays into its graph, in place of what recorded them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path as FilePath
from typing import Annotated

from volery.base import units
from volery.base.errors import Location
from volery.base.time import MS, Ns
from volery.model import rules
from volery.model.components import check_inside
from volery.model.fields import (
    TEXT,
    TIME,
    ListOf,
    MapOf,
    OneOf,
    QuantityField,
    Record,
    Schema,
    Shorter,
    Syntax,
    expected,
)
from volery.model.reading import ModelReading
from volery.model.text import Path, TextNode

STAMPS = ("run", "recorded")


class _Recording(Syntax):
    """A recording beside the model: a file, or the folder of a rosbag 2."""

    def read(self, node: TextNode, path: Path, reading: ModelReading) -> str:
        """See ``Syntax``."""
        if not isinstance(node.value, str):
            raise expected("text", node)
        check_inside(reading, path, node.value)
        if not (reading.folder / node.value).exists():
            what = f"there is no recording {node.value!r} beside the model"
            reading.problems.add(path, what, rule=rules.MISSING_FILE)
        return node.value

    def schema(self, definitions: Schema) -> Schema:
        """See ``Syntax``."""
        return {"type": "string"}


@dataclass(frozen=True, slots=True)
class RecordedInput:
    """A recording whose messages are published at their times: a rosbag 1, a rosbag 2 or MCAP."""

    name: str
    bag: Annotated[str, _Recording(), "File or folder of the recording, relative to the model."]
    topics: Annotated[
        tuple[str, ...],
        ListOf(TEXT, bare=True),
        "Topics that are played; all that can be decoded if not given.",
    ] = ()
    rate: Annotated[float, QuantityField(units.RATIO, above=0), "Recorded seconds in a simulated second."] = (
        1.0
    )
    after_ns: Annotated[Ns, TIME, "Recorded time that is skipped at the beginning."] = 0
    delay_ns: Annotated[Ns, TIME, "Simulated time at which it begins: nodes have subscribed by then."] = (
        500 * MS
    )
    loop: Annotated[bool, OneOf((False, True)), "Whether it begins again at its end."] = False
    remap: Annotated[
        Mapping[str, str], MapOf(TEXT, free=True), "Names of its topics, and their replacements."
    ] = field(default_factory=dict)
    stamps: Annotated[
        str,
        OneOf(STAMPS),
        "`run`: stamps of headers are moved to the time of the run, as live; `recorded`: they stay.",
    ] = "run"
    where: Location | None = field(default=None, compare=False)


INPUTS = MapOf(Shorter(Record(RecordedInput), key="bag"), values_only=True)


def with_recordings(
    inputs: tuple[RecordedInput, ...], files: Iterable[FilePath]
) -> tuple[RecordedInput, ...]:
    """Return *inputs* and one for each of *files*, that of an option, with its defaults."""
    made = list(inputs)
    for file in files:
        taken = {one.name for one in made}
        number = next(each for each in range(1, len(made) + 2) if f"bag_{each}" not in taken)
        made.append(RecordedInput(f"bag_{number}", str(file.absolute()), where=Location("--bag", 0)))
    return tuple(made)
