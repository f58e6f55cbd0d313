"""Processors, networks, and who runs where."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path as FilePath

from volery.base.errors import ModelError
from volery.model.context import RESERVED, Context
from volery.model.form import NetworkForm, ProcessorForm
from volery.model.problems import Path
from volery.model.resolve_library import check_processor
from volery.model.system import Instance, Network, Processor, ProcessorKind, TargetKind
from volery.model.text import Node


def catalogues(context: Context) -> tuple[FilePath, ...]:
    """The files of processors that the model brings along."""
    return tuple(context.folder / name for name in context.form.platform.catalogues)


def with_catalogues(context: Context) -> Context:
    """The same with the processors of those files among the names that are known."""
    known = dict(context.vocabulary.processors)
    for position, file in enumerate(catalogues(context)):
        try:
            known.update(context.vocabulary.read_catalogue(file))
        except ModelError as error:
            context.problems.add(("platform", "catalogues", position), str(error))
    return replace(context, vocabulary=replace(context.vocabulary, processors=known))


def processors(context: Context) -> tuple[Processor, ...]:
    """The platform's computers, checked against the catalogue."""
    forms = context.form.platform.processors
    return tuple(_processor(context, name, form) for name, form in forms.items())


def _processor(context: Context, name: str, form: ProcessorForm) -> Processor:
    path: Path = ("platform", "processors", name)
    check_processor(context, path, "is", form.kind, form.frequency)
    kind = context.vocabulary.processors.get(form.kind)
    if kind is not None:
        _check_setting(context, (*path, "frequency"), form, kind)
    vehicles = context.form.environment.vehicles
    for key, vehicle in (("carried_by", form.carried_by), ("powered_by", form.powered_by)):
        if vehicle is not None and (key, vehicle) != ("powered_by", "mains"):
            context.known((*path, key), vehicle, "vehicle", vehicles)
    if kind is not None and form.cores is not None and form.cores > kind.cores:
        context.problems.add((*path, "cores"), f"{form.kind} has {kind.cores} cores, not {form.cores}")
    powered_by = form.powered_by if form.powered_by is not None else form.carried_by
    return Processor(
        name=name,
        kind=form.kind,
        frequency_hz=form.frequency,
        cores=form.cores or (kind.cores if kind else 1),
        scheduler=form.scheduler,
        quantum_ns=form.quantum,
        context_switch_ns=form.context_switch,
        load=form.load,
        carried_by=form.carried_by,
        powered_by=None if powered_by == "mains" else powered_by,
        where=context.where(path),
    )


def _check_setting(context: Context, path: Path, form: ProcessorForm, kind: ProcessorKind) -> None:
    """Warn of a frequency between two that the processor can be set to."""
    below = [one for one in kind.settings_hz if one < form.frequency]
    above = [one for one in kind.settings_hz if one > form.frequency]
    if form.frequency not in kind.settings_hz and below and above:
        context.problems.warn(
            path,
            f"{form.kind} cannot be set to {form.frequency / 1e6:g} MHz; "
            f"the nearest settings are {below[-1] / 1e6:g} and {above[0] / 1e6:g} MHz",
        )


def networks(context: Context) -> tuple[Network, ...]:
    """What joins the computers."""
    return tuple(_network(context, name, form) for name, form in context.form.platform.networks.items())


def _network(context: Context, name: str, form: NetworkForm) -> Network:
    path: Path = ("platform", "networks", name)
    for position, end in enumerate(form.between):
        context.known((*path, "between", position), end, "processor", context.form.platform.processors)
    if len(set(form.between)) != len(form.between):
        context.problems.add((*path, "between"), "a processor stands here twice")
    between = tuple(form.between)
    return Network(name, between, form.bandwidth, form.latency, form.loss, context.where(path))


def check_names(context: Context) -> None:
    """Observables and allocations go by name, so no two things of a run may share one."""
    environment = context.form.environment
    taken: dict[str, str] = dict.fromkeys(RESERVED, "a word of the model")
    sections: tuple[tuple[Path, list[str], str], ...] = (
        (("application",), list(context.form.application), "a component instance"),
        (("environment", "components"), list(environment.components), "a component instance"),
        (("environment", "vehicles"), list(environment.vehicles), "a vehicle"),
        (("platform", "processors"), list(context.form.platform.processors), "a processor"),
        (("chains",), list(context.form.chains), "a chain"),
    )
    for section, names, what in sections:
        for name in names:
            if name in taken:
                context.problems.add(
                    (*section, name), f"{name!r} is already {taken[name]}; choose another name"
                )
            taken.setdefault(name, what)


def check_all_variants(context: Context) -> None:
    """Every allocation and scenario of the model, chosen or not, speaks of things that exist."""
    allocations, scenarios = context.form.allocations, context.form.scenarios
    for name, scenario in scenarios.items():
        if scenario.extends is not None:
            context.known(("scenarios", name, "extends"), scenario.extends, "scenario", scenarios)
        if scenario.allocation is not None:
            context.known(("scenarios", name, "allocation"), scenario.allocation, "allocation", allocations)
    for name, form in allocations.items():
        if form.extends is not None:
            context.known(("allocations", name, "extends"), form.extends, "allocation", allocations)
        for who, processor in form.places.items():
            _check_place(context, ("allocations", name, who), who, processor)


def _check_place(context: Context, path: Path, who: str, processor: str) -> None:
    environment = context.form.environment
    if who in environment.components:
        context.problems.add(path, f"{who} belongs to the environment: it runs nowhere and costs nothing")
        return
    if context.known(
        path, who, "component instance or vehicle", [*context.form.application, *environment.vehicles]
    ):
        context.known(path, processor, "processor", context.form.platform.processors)


def places(context: Context, allocation: str, chosen: dict[str, Node] | None) -> dict[str, str]:
    """Instance or vehicle to processor, by the chosen allocation; notes instances that run nowhere."""
    found = {who: str(node.value) for who, node in (chosen or {}).items()}
    for name in context.form.application:
        if name not in found:
            path: Path = ("allocations", allocation) if allocation else ("application", name)
            which = f"allocation {allocation!r}" if allocation else "this model has no allocation and"
            context.problems.add(path, f"{which} does not say where {name} runs")
    return found


def vehicle_processor(context: Context, vehicle: str, found: dict[str, str]) -> str | None:
    """Where the node runs that serves *vehicle*: as allocated, or the one computer that it carries."""
    if vehicle in found:
        return found[vehicle]
    carried = [name for name, form in context.form.platform.processors.items() if form.carried_by == vehicle]
    if len(carried) > 1:
        context.problems.add(
            ("environment", "vehicles", vehicle),
            f"it carries {' and '.join(carried)}: the allocation must say where its node runs, "
            f"such as `{vehicle}: {carried[0]}`",
        )
    return carried[0] if len(carried) == 1 else None


def check_reach(context: Context, made: tuple[Instance, ...], joined: tuple[Network, ...]) -> None:
    """A call between two computers needs a network."""
    processor_of = {instance.name: instance.processor for instance in made}
    for instance in made:
        for connection in instance.connections.values():
            for target in connection.targets:
                here, there = instance.processor, processor_of.get(target.name)
                if target.kind is TargetKind.INSTANCE and not _joined(here, there, joined):
                    context.problems.add(
                        ("application", instance.name, connection.port),
                        f"{instance.name} on {here} calls {target.name} on {there}: no network joins them",
                    )


def _joined(here: str | None, there: str | None, joined: tuple[Network, ...]) -> bool:
    """True if a call gets from *here* to *there*; the environment (``None``) is everywhere."""
    if here is None or there is None or here == there:
        return True
    return any(here in network.between and there in network.between for network in joined)
