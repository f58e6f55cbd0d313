"""Interfaces and components: from their forms to frozen data, with what they refer to checked."""

from __future__ import annotations

import re

from volery.model.context import Context
from volery.model.form_component import ActivityForm, ComponentForm, FigureForm, ReferenceForm, SignatureForm
from volery.model.problems import Path
from volery.model.system import (
    CPP_LANGUAGES,
    ENVIRONMENT_INTERFACE,
    VEHICLE_INTERFACES,
    Activity,
    Argument,
    Build,
    Component,
    Figure,
    Interface,
    RequiredPort,
    Signature,
    Value,
)

SPECIAL = (*VEHICLE_INTERFACES, ENVIRONMENT_INTERFACE)
INSTANCE_KEYS = ("is", "component", "parameters", "active", "namespace", "remap")
_MANY = "[]"


def interfaces(context: Context) -> dict[str, Interface]:
    """The model's interfaces. Those of vehicles and of the environment exist by themselves."""
    found = {}
    for name, operations in context.form.interfaces.items():
        path: Path = ("interfaces", name)
        if name in SPECIAL:
            context.problems.add(path, f"{name} is there in every model; choose another name")
        signatures = {operation: _signature(operation, form) for operation, form in operations.items()}
        found[name] = Interface(name, signatures, context.where(path))
    return found


def _signature(name: str, form: SignatureForm) -> Signature:
    return Signature(name, tuple(Argument(*pair) for pair in form.args.items()), form.returns)


def components(context: Context, known: dict[str, Interface]) -> dict[str, Component]:
    """The library."""
    return {name: _component(context, name, form, known) for name, form in context.form.components.items()}


def _component(context: Context, name: str, form: ComponentForm, known: dict[str, Interface]) -> Component:
    path: Path = ("components", name)
    _check_file(context, path, form)
    for port, interface in form.provides.items():
        _check_provided(context, (*path, "provides", port), interface, known)
    requires = {
        port: _required(context, (*path, "requires", port), port, text, known)
        for port, text in form.requires.items()
    }
    operations = {
        operation: _figures(context, (*path, "operations", operation), figures, form.at)
        for operation, figures in form.operations.items()
    }
    _check_operations(context, path, form, known)
    return Component(
        name=name,
        language=form.language,
        path=form.path,
        class_name=form.class_name or camel_case(name),
        class_stated=bool(form.class_name),
        provides=form.provides,
        requires=requires,
        parameters=parameters(form.parameters),
        activity=activity(form.active),
        operations=operations,
        activation=_figures(context, (*path, "activation"), form.activation, form.at),
        build=Build(tuple(form.build.flags), tuple(form.build.libraries)),
        where=context.where(path),
    )


def camel_case(name: str) -> str:
    """The class that a component's file is expected to define: ``drone_control`` gives ``DroneControl``."""
    return "".join(part[:1].upper() + part[1:] for part in re.split(r"[_-]+", name))


def parameters(written: dict[str, Value]) -> dict[str, Value]:
    """A copy of its own."""
    return dict(written)


def activity(form: ActivityForm | None) -> Activity | None:
    """An active component's flow of control. Without a deadline, a period is one."""
    if form is None:
        return None
    deadline = form.deadline if form.deadline is not None else form.period
    return Activity(form.period, deadline, form.priority, form.start)


def _check_file(context: Context, path: Path, form: ComponentForm) -> None:
    file = context.folder / form.path
    if form.path and not (file.is_file() or (form.language in CPP_LANGUAGES and file.is_dir())):
        there = sorted(found.name for found in file.parent.glob("*") if found.is_file())
        beside = f"; in that folder there is {', '.join(there[:8])}" if there else ""
        context.problems.add((*path, "path"), f"there is no file {form.path!r} beside the model{beside}")


def _check_provided(context: Context, path: Path, interface: str, known: dict[str, Interface]) -> None:
    if interface in SPECIAL:
        who = "the environment" if interface == ENVIRONMENT_INTERFACE else "a vehicle"
        context.problems.add(path, f"{interface} is provided by {who}, not by a component")
    else:
        context.known(path, interface, "interface", known)


def _required(
    context: Context, path: Path, port: str, text: str, known: dict[str, Interface]
) -> RequiredPort:
    many = text.endswith(_MANY)
    interface = text.removesuffix(_MANY).strip()
    context.known(path, interface, "interface", [*known, *SPECIAL])
    if port in INSTANCE_KEYS:
        context.problems.add(
            path, f"a required port cannot be called {port!r}: instances have a key of that name"
        )
    return RequiredPort(port, interface, many)


def _check_operations(context: Context, path: Path, form: ComponentForm, known: dict[str, Interface]) -> None:
    offered = [
        operation
        for interface in form.provides.values()
        if interface in known
        for operation in known[interface].operations
    ]
    for operation in form.operations:
        context.known((*path, "operations", operation), operation, "operation of its provided ports", offered)


def _figures(
    context: Context, path: Path, forms: list[FigureForm], default: ReferenceForm | None
) -> tuple[Figure, ...]:
    found = (_figure(context, path, form, form.at or default) for form in forms)
    return tuple(figure for figure in found if figure is not None)


def _figure(context: Context, path: Path, form: FigureForm, at: ReferenceForm | None) -> Figure | None:
    if at is None:
        what = "a time means nothing without where it was taken: add `at: {processor: ..., frequency: ...}`"
        context.problems.add(path, what)
        return None
    check_processor(context, (*path, "at"), "processor", at.processor, at.frequency)
    return Figure(form.time, form.energy, at.processor, at.frequency, form.provenance, context.where(path))


def check_processor(context: Context, path: Path, key: str, kind: str, frequency_hz: float) -> None:
    """Note it if the catalogue has no such processor (named by *key*), or none at that frequency."""
    catalogue = context.vocabulary.processors
    if not context.known((*path, key), kind, "processor in the catalogue", catalogue):
        return
    least, greatest = catalogue[kind].least_hz, catalogue[kind].greatest_hz
    if not least <= frequency_hz <= greatest:
        context.problems.add(
            (*path, "frequency"),
            f"{frequency_hz / 1e6:g} MHz is outside what is known of {kind}: "
            f"{least / 1e6:g} to {greatest / 1e6:g} MHz",
        )
