"""Observables of other packages: quantities that requirements may bound, and a table for the report.

A package derives a class from ``AddedObservables`` and names it in its entry points ``volery.observables``;
``examples/separation`` is one. From then on models may bound its quantities as those of the core. In every
run one instance receives the events; what it comes to is in ``run.json``, its table in the report.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite, nan
from typing import Any, ClassVar

from volery.base.errors import UsageError, choices
from volery.base.installed import Registry
from volery.base.time import Ns
from volery.base.units import QuantityError, unit
from volery.requirements.record import AddedRecord, TableRecord
from volery.trace.attachments import RunSetup


@dataclass(frozen=True)
class ObservedQuantity:
    """A quantity that requirements may bound. An empty ``unit`` stands for a count or a share."""

    name: str
    unit: str
    description: str


class AddedObservables(ABC):
    """What a package observes in a run: derive from it, and name the class in ``volery.observables``.

    An instance is made at the start of a run and another for each requirement on it. It receives the events
    in the order of the run and must not keep more of them than it needs. What a method raises ends the
    instance, not the run: its values are unknown then, and a warning says why.

    Attributes:
        subject: What the quantities are of: ``application``, ``component``, ``processor``, ``network``,
            ``vehicle`` or ``chain``. A requirement names the subject: ``drone_1.<quantity>``.
        quantities: What requirements may bound.
        listens: The types of events that ``take`` receives, of ``volery.trace.events``.
        setup: The set-up of the run, with the names of its vehicles, components and so on.
    """

    subject: ClassVar[str] = "application"
    quantities: ClassVar[tuple[ObservedQuantity, ...]] = ()
    listens: ClassVar[tuple[type[Any], ...]] = ()

    def __init__(self, setup: RunSetup) -> None:
        self.setup = setup

    @abstractmethod
    def take(self, event: Any) -> None:
        """Take an event of one of the types in ``listens``."""

    @abstractmethod
    def value(self, subject: str, quantity: str, at: Ns) -> float:
        """Return a quantity of a subject at a time of the run, in its unit; NaN if nothing was observed."""

    def table(self, at: Ns) -> TableRecord | None:
        """Return a table for the report of a run that ended at a time; by default there is none."""
        return None


added_observables: Registry[type[AddedObservables]] = Registry("volery.observables", "observables")


def subjects_of(setup: RunSetup) -> Mapping[str, tuple[str, ...]]:
    """Return {kind of subject: the names of those in a run}, without operations."""
    return {
        "application": ("application",),
        "component": tuple(component.name for component in setup.components),
        "processor": tuple(processor.name for processor in setup.processors),
        "vehicle": tuple(vehicle.name for vehicle in setup.vehicles),
        "chain": tuple(chain.name for chain in setup.chains),
        "network": tuple(network.name for network in setup.networks),
    }


def a_kind(subject: str) -> str:
    """Return a kind of subject with its article."""
    return f"an {subject}" if subject[0] in "aeiou" else f"a {subject}"


def load_added() -> dict[str, type[AddedObservables]]:
    """Return the classes of all packages by the names of their entry points.

    Raises:
        UsageError: One cannot be imported, or is not declared as ``AddedObservables`` says.
    """
    return {name: _checked(name, added_observables.load(name)) for name in added_observables.names()}


def _checked(name: str, made: Any) -> type[AddedObservables]:
    wrong = ""
    kinds = tuple(subjects_of(RunSetup()))
    if not (isinstance(made, type) and issubclass(made, AddedObservables)):
        wrong = f"{made!r} is no class derived from volery.requirements.added_observables.AddedObservables"
    elif made.subject not in kinds:
        wrong = f"its subject is {made.subject!r}; there is {choices(kinds)}"
    else:
        for quantity in made.quantities:
            try:
                unit(quantity.unit)
            except QuantityError as error:
                wrong = f"the unit of {quantity.name}: {error}"
    if wrong:
        raise UsageError(f"the observables {name!r} cannot be used: {wrong}; mend or uninstall the package")
    checked: type[AddedObservables] = made
    return checked


class AddedInRun:
    """The observables of one package in one run.

    ``failed`` says what they raised; empty while they did not. Nothing reaches them any more after that.
    """

    def __init__(self, name: str, made: type[AddedObservables], setup: RunSetup) -> None:
        self.name = name
        self.failed = ""
        self._made = made
        self._subjects = subjects_of(setup)[made.subject]
        self._one: AddedObservables | None = None
        try:
            self._one = made(setup)
        except Exception as error:  # of another package
            self._fail(error)

    def listens_to(self, kind: type[Any]) -> bool:
        """Return whether events of a type matter."""
        return issubclass(kind, self._made.listens)

    def take(self, event: Any) -> None:
        """Pass an event on."""
        if self._one is None:
            return
        try:
            self._one.take(event)
        except Exception as error:
            self._fail(error)

    def value(self, subject: str, quantity: str, at: Ns) -> float:
        """Return a quantity; NaN if it is unknown."""
        if self._one is None:
            return nan
        try:
            return float(self._one.value(subject, quantity, at))
        except Exception as error:
            self._fail(error)
            return nan

    def record(self, at: Ns) -> AddedRecord:
        """Return what they came to in a run that ended at a time."""
        found = {
            f"{subject}.{quantity.name}": self.value(subject, quantity.name, at)
            for subject in self._subjects
            for quantity in self._made.quantities
        }
        table = None
        try:
            table = None if self._one is None else self._one.table(at)
            if table is not None and any(len(row) != len(table.columns) for row in table.rows):
                raise ValueError(f"a row of the table {table.title!r} has not {len(table.columns)} cells")
        except Exception as error:
            self._fail(error)
            table = None
        values = {name: value if isfinite(value) else None for name, value in found.items()}
        return AddedRecord(values=values, table=table)

    def _fail(self, error: Exception) -> None:
        self._one = None
        self.failed = f"the observables {self.name!r} ended: {type(error).__name__}: {error}"
