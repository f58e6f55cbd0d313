"""From a file to a checked ``System``: ``load``; ``gaps`` and ``check_code`` say what a run lacks.

``load`` gives one allocation and one scenario. A model is read in one pass over its
tree; here, what concerns several sections is checked and put together.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import fields, replace
from pathlib import Path as FilePath

from volery.base.errors import ModelError, choices
from volery.model import rules
from volery.model.assembly import (
    NOT_PLACES,
    Assembly,
    Selection,
    assemble,
    change_from_option,
    model_file,
)
from volery.model.builder import ModelBuilder
from volery.model.components import StatedFigure
from volery.model.document import DOCUMENT, Document
from volery.model.environment import Environment, VehicleSpec
from volery.model.fields import TEXT, ListOf, read_child
from volery.model.instances import Instance, TargetKind, check_cycles
from volery.model.reading import NOTE_PREFIX, ModelReading, Vocabulary
from volery.model.system import NetworkSpec, System
from volery.model.text import CollectedModelError, Path, written

FIDELITIES = ("times", "code", "firmware", "hardware")
"""Constant times · real component code · real autopilot firmware in the loop · real vehicles."""


def check_code(system: System) -> None:
    """Check that the files of all components are there.

    Raises:
        ModelError: A file is missing; all of them at once (``CollectedModelError``).
    """
    found = list(_unwritten(system))
    if len(found) == 1:
        raise found[0]
    if found:
        raise CollectedModelError(found)


def _unwritten(system: System) -> Iterator[ModelError]:
    stated = {finding.path: finding.where for finding in system.warnings}
    for component in {instance.component.name: instance.component for instance in system.instances}.values():
        if component.path and not system.file_of(component).exists():
            what = (
                f"there is no file {component.path!r}: a run needs its code. Write it, or remove `path` to "
                "run with the times that the model states (--fidelity times)"
            )
            at = f"components.{component.name}.path"
            yield ModelError(what, at, stated.get(at, component.where), rules.UNWRITTEN_CODE.code)


def gaps(system: System, fidelity: str) -> Iterator[ModelError]:
    """Yield what is missing, component by component, in the order of the model."""
    yield from _unwritten(system)
    used = {instance.component.name: instance.component for instance in system.instances}
    for component in used.values():
        if fidelity != "times" and not (component.path or component.package):
            what = "it has no code: fidelity `code` needs a `path`; `times` runs without"
            yield ModelError(what, f"components.{component.name}", component.where, rules.NO_CODE.code)
    if fidelity == "times":
        for instance in system.instances:
            yield from _missing_figures(system, instance)


def _missing_figures(system: System, instance: Instance) -> Iterator[ModelError]:
    if instance.processor is None:
        return
    kind = system.processor(instance.processor).kind
    component = instance.component
    for interface in component.provides.values():
        for operation in system.interfaces[interface].operations:
            figures = component.operations.get(operation, ())
            yield from _missing(instance, f"operations.{operation}", figures, kind)
    if instance.activity is not None:
        yield from _missing(instance, "activation", component.activation, kind)


def _missing(
    instance: Instance, what: str, figures: tuple[StatedFigure, ...], kind: str
) -> Iterator[ModelError]:
    if any(figure.processor == kind for figure in figures):
        return
    stated = f" (there is one at {choices({figure.processor for figure in figures})})" if figures else ""
    yield ModelError(
        f"no time is stated at {kind}, where {instance.name} runs{stated}; fidelity `times` needs one",
        f"components.{instance.component.name}.{what}",
        instance.component.where,
        rules.MISSING_TIMES.code,
    )


RESERVED = ("application", "environment", NOTE_PREFIX)
"""Names that messages, observables and ports use for the whole."""


def load(
    model: str | FilePath | ModelBuilder,
    vocabulary: Vocabulary,
    scenario: str | None = None,
    allocation: str | None = None,
    overrides: Iterable[str] = (),
) -> System:
    """Read a model.

    Args:
        model: The model's file, a folder with a ``model.yaml``, or a model that was built in Python.
        vocabulary: Names that are defined outside the model.
        scenario: The scenario; None for the model without one.
        allocation: The allocation; None for the scenario's, or the first of the model.
        overrides: Changes ``path=value`` that win over both.

    Raises:
        ModelError: What is wrong with the model; all of it at once (``CollectedModelError``).
        UsageError: The model has no such scenario or allocation.
    """
    options = tuple(overrides)
    selection = Selection(scenario, allocation, tuple(change_from_option(text) for text in options))
    source = model if isinstance(model, ModelBuilder) else model_file(model)
    folder = source.folder if isinstance(source, ModelBuilder) else source.parent
    made, problems = assemble(source, selection)
    reading = ModelReading(made.root, problems, vocabulary, folder, made.stated)
    catalogues = _read_catalogues(reading)
    _, document = read_child(DOCUMENT, made.root, (), reading)
    if document is None:
        problems.raise_if_any()
    system = _resolve(reading, document, made)
    problems.raise_if_any()
    return replace(system, overrides=options, catalogues=catalogues, warnings=problems.warnings)


def _read_catalogues(reading: ModelReading) -> tuple[FilePath, ...]:
    """Add the processors of the model's own catalogues to the vocabulary; return the files."""
    path: Path = ("platform", "catalogues")
    node = reading.root.at(path)
    if node is None:
        return ()
    right, names = read_child(ListOf(TEXT, bare=True), node, path, reading)
    files = tuple(reading.folder / name for name in names) if right else ()
    known = dict(reading.vocabulary.processors)
    for position, file in enumerate(files):
        try:
            known.update(reading.vocabulary.read_catalogue(file))
        except ModelError as error:
            reading.problems.add((*path, position), str(error))
    reading.vocabulary = replace(reading.vocabulary, processors=known)
    return files


def _resolve(reading: ModelReading, document: Document, made: Assembly) -> System:
    """Put the sections of a document together, and check what concerns several of them."""
    _check_names(reading)
    _check_allocations(reading)
    stated = {name: str(node.value) for name, node in (made.places or {}).items()}
    places = _processors_of(reading, stated, made.allocation)
    for name in reading.names(("application",)):
        if name not in stated:
            path: Path = ("allocations", made.allocation) if made.allocation else ("application", name)
            which = (
                f"allocation {made.allocation!r}" if made.allocation else "this model has no allocation and"
            )
            reading.problems.add(path, f"{which} does not say where {name} runs", rule=rules.UNALLOCATED)
    surroundings = document.environment
    spaces = {space.name for space in document.memory_spaces}
    systems = {
        places[system.name]: system.name
        for system in document.platform.operating_systems
        if system.name in places
    }
    instances = (
        *(
            replace(
                one,
                processor=places.get(one.name),
                memory_space=stated[one.name] if stated.get(one.name) in spaces else None,
            )
            for one in document.application
        ),
        *surroundings.components,
    )
    vehicles = [
        replace(vehicle, processor=places.get(vehicle.name) or _carried_processor(reading, vehicle))
        for vehicle in surroundings.vehicles
    ]
    environment = Environment(
        **{field.name: getattr(surroundings, field.name) for field in fields(Environment)}
        | {"vehicles": tuple(vehicles)}
    )
    check_cycles(reading, instances)
    _check_reach(reading, instances, document.platform.networks)
    return System(
        name=document.name,
        instances=instances,
        processors=tuple(
            replace(processor, operating_system=systems.get(processor.name))
            for processor in document.platform.processors
        ),
        networks=document.platform.networks,
        environment=environment,
        chains=document.chains,
        requirements=document.requirements,
        memory_spaces=document.memory_spaces,
        operating_systems=document.platform.operating_systems,
        devices=document.platform.devices,
        types=document.types,
        design_parameters=document.design_parameters,
        provenances={written(path): one for path, one in reading.provenances.items()},
        suppressions=document.suppress,
        limits=document.run,
        components=document.components,
        interfaces=document.interfaces,
        description=document.description,
        allocation=made.allocation,
        scenario=made.scenario,
        allocations=tuple(document.allocations),
        scenarios=tuple(document.scenarios),
        sources=made.sources,
        folder=reading.folder,
    )


def _processors_of(reading: ModelReading, stated: dict[str, str], allocation: str) -> dict[str, str]:
    """Return the processor that each allocated thing leads to; report those that lead to none."""
    processors = set(reading.names(("platform", "processors")))
    heights = dict.fromkeys(reading.names(("memory_spaces",)), 1)
    heights |= dict.fromkeys(reading.names(("platform", "operating_systems")), 2)
    heights |= dict.fromkeys(processors, 3)
    found: dict[str, str] = {}
    for name, first in stated.items():
        place, below = first, heights.get(name, 0)
        while place not in processors and heights.get(place, 0) > below and place in stated:
            place, below = stated[place], heights[place]
        if place in processors and heights[place] > below:
            found[name] = place
        elif place in heights:
            what = (
                (
                    f"{place} is on no processor in allocation {allocation!r}"
                    if place not in stated
                    else f"{place} cannot be on {stated[place]}"
                )
                if heights[place] > below
                else f"{name} cannot be on {place}"
            )
            reading.problems.add(("allocations", allocation, name), what, rule=rules.BROKEN_CHAIN)
    return found


def _check_names(reading: ModelReading) -> None:
    """Report names that two things share: observables and allocations refer to things by their name."""
    taken: dict[str, str] = dict.fromkeys(RESERVED, "a word of the model")
    sections: tuple[tuple[Path, str], ...] = (
        (("application",), "a component instance"),
        (("environment", "components"), "a component instance"),
        (("environment", "vehicles"), "a vehicle"),
        (("platform", "processors"), "a processor"),
        (("platform", "operating_systems"), "an operating system"),
        (("memory_spaces",), "a memory space"),
        (("chains",), "a chain"),
    )
    for section, what in sections:
        for name in reading.names(section):
            if name in taken:
                reading.problems.add(
                    (*section, name),
                    f"{name!r} is already {taken[name]}; choose another name",
                    rule=rules.DUPLICATE_NAME,
                )
            taken.setdefault(name, what)


def _check_allocations(reading: ModelReading) -> None:
    """Report allocations, chosen or not, of instances and vehicles that do not exist."""
    sections: tuple[Path, ...] = (("application",), ("environment", "vehicles"), ("memory_spaces",))
    placeable = reading.names(*sections, ("platform", "operating_systems"))
    for allocation in reading.names(("allocations",)):
        for name in reading.names(("allocations", allocation)):
            path: Path = ("allocations", allocation, name)
            if name in reading.names(("environment", "components")):
                what = f"{name} belongs to the environment: it runs nowhere and costs nothing"
                reading.problems.add(path, what, rule=rules.ALLOCATED_ENVIRONMENT)
            elif name not in NOT_PLACES:
                reading.known(path, name, "component instance or vehicle", placeable)


def _carried_processor(reading: ModelReading, vehicle: VehicleSpec) -> str | None:
    """Return the one computer that a vehicle carries: its node runs there unless it is allocated."""
    processors = reading.root.at(("platform", "processors"))
    carried = [
        name
        for name, node in (processors.items if processors else {}).items()
        if (by := node.child("carried_by")) is not None and by.value == vehicle.name
    ]
    if len(carried) > 1:
        reading.problems.add(
            ("environment", "vehicles", vehicle.name),
            f"it carries {' and '.join(carried)}: the allocation must say where its node runs, "
            f"such as `{vehicle.name}: {carried[0]}`",
            rule=rules.AMBIGUOUS_NODE,
        )
    return carried[0] if len(carried) == 1 else None


def _check_reach(
    reading: ModelReading, instances: tuple[Instance, ...], networks: tuple[NetworkSpec, ...]
) -> None:
    """Report calls between two computers that no network joins. The environment is everywhere."""
    processor_of = {instance.name: instance.processor for instance in instances}
    for instance in instances:
        for connection in instance.connections.values():
            for target in connection.targets:
                here, there = instance.processor, processor_of.get(target.name)
                if target.kind is not TargetKind.INSTANCE or None in (here, there) or here == there:
                    continue
                if not any(here in network.between and there in network.between for network in networks):
                    reading.problems.add(
                        ("application", instance.name, connection.port),
                        f"{instance.name} on {here} calls {target.name} on {there}: no network joins them",
                        rule=rules.NO_NETWORK,
                    )
