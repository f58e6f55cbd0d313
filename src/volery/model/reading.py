"""One pass over a model's tree: where names are looked up and problems are collected.

The names of vehicles, processors, components and so on are taken from the tree, not from what was read
before. So references are checked where they stand, in any order of sections, and all problems are reported at
once.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path as FilePath
from typing import Any, TypeVar

from volery.base.errors import Location
from volery.model import rules
from volery.model.rules import ModelRule
from volery.model.text import Path, Problems, TextNode, no_such

T = TypeVar("T")


NOTE_PREFIX = "note"
"""First word of the observables ``note.<kind>.<state>`` that an application makes with ``volery.note()``."""

NOTE_TIMES = ("time_max", "time_mean")
"""Quantities of ``note.<kind>.<state>.<quantity>``: seconds from a subject's first state to this one."""


def split_note(text: str) -> tuple[str, str, str] | None:
    """Return kind, state and quantity of an observable of notes, None if it is none or lacks a word.

    The quantity is one of ``NOTE_TIMES``, or empty for the number of subjects. A state may contain points.
    """
    prefix, _, words = text.partition(".")
    kind, _, state = words.partition(".")
    stem, _, last = state.rpartition(".")
    quantity = last if stem and last in NOTE_TIMES else ""
    state = stem if quantity else state
    return (kind, state, quantity) if prefix == NOTE_PREFIX and kind and state else None


@dataclass(frozen=True, slots=True)
class Observable:
    """A quantity that requirements may bound: ``<subject>.<quantity>``.

    ``subject`` is the kind of the observed thing: ``component``, ``operation``, ``processor``, ``network``,
    ``vehicle``, ``chain`` or ``application``. An empty ``unit`` stands for a count or a share.
    """

    subject: str
    quantity: str
    unit: str
    description: str


@dataclass(frozen=True, slots=True)
class ProcessorKind:
    """What the catalogue states of a processor: its cores and the range in which its laws are valid.

    ``settings_hz`` are the frequencies within the range that can be set, ascending; empty if unknown.
    """

    cores: int
    least_hz: float
    greatest_hz: float
    settings_hz: tuple[float, ...] = ()


Kinds = Mapping[str, ProcessorKind]


def _no_catalogue(file: FilePath) -> Kinds:
    return {}


@dataclass(frozen=True)
class Vocabulary:
    """Names that are defined outside the model. The caller supplies them; the model only checks against them.

    ``airframes`` are the autopilots that fly an airframe of the model. ``read_catalogue`` returns the
    processors of a catalogue file that the model refers to, or raises ``ModelError``.
    """

    processors: Kinds
    autopilots: frozenset[str]
    observables: tuple[Observable, ...] = ()
    read_catalogue: Callable[[FilePath], Kinds] = _no_catalogue
    sensors: frozenset[str] = frozenset()
    airframes: frozenset[str] = frozenset()


PROVENANCES = ("estimated", "measured", "calculated", "required")
"""Where a figure comes from (MARTE's NFP source)."""


@dataclass(frozen=True, slots=True)
class Provenance:
    """Where a figure comes from: one of ``PROVENANCES``, its relative standard uncertainty, and the source.

    ``uncertainty`` is None where none is stated.
    """

    provenance: str = "estimated"
    uncertainty: float | None = None
    source: str = ""


@dataclass
class ModelReading:
    """The tree that is read, what it is checked against, and the problems found so far.

    ``stated`` is the tree before a number of vehicles is replaced by the copies.
    ``provenances`` are those of quantities that state one, by their paths.
    """

    root: TextNode
    problems: Problems
    vocabulary: Vocabulary
    folder: FilePath
    stated: TextNode
    provenances: dict[Path, Provenance] = field(default_factory=dict)
    _results: dict[Callable[[Any], Any], Any] = field(default_factory=dict)

    def names(self, *sections: Path) -> list[str]:
        """Return the keys of the mappings at *sections*, in order."""
        found = (self.root.at(section) for section in sections)
        return [name for node in found if node is not None for name in node.items]

    def once(self, make: Callable[[ModelReading], T]) -> T:
        """Return what *make* computes from this reading. It is called only the first time."""
        if make not in self._results:
            self._results[make] = make(self)
        result: T = self._results[make]
        return result

    def where(self, path: Path) -> Location | None:
        """Return the file and line of *path*."""
        return self.problems.where(path)

    def known(
        self, path: Path, name: str, noun: str, valid: Iterable[str], rule: ModelRule = rules.UNKNOWN_NAME
    ) -> bool:
        """Return whether *name* is one of the *valid* names; report a problem at *path* if it is not."""
        names = valid if isinstance(valid, Collection) else list(valid)
        if name not in names:
            self.problems.add(path, no_such(name, noun, names), rule=rule)
        return name in names
