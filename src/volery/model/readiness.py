"""What a valid model still lacks for one fidelity: figures, code, languages that do not run yet."""

from __future__ import annotations

from collections.abc import Iterator

from volery.base.errors import ModelError, choices
from volery.model.problems import CollectedModelError
from volery.model.system import Component, Figure, Instance, Interface, System, Vocabulary

FIDELITIES = ("times", "code", "firmware", "hardware")
"""Constant times · real component code · real autopilot firmware in the loop · real vehicles."""


def check_ready(system: System, fidelity: str, vocabulary: Vocabulary) -> None:
    """Raise ``ModelError`` for whatever *system* lacks to run at *fidelity* (``times`` or ``code``)."""
    found = list(gaps(system, fidelity, vocabulary))
    if len(found) == 1:
        raise found[0]
    if found:
        raise CollectedModelError(found)


def gaps(system: System, fidelity: str, vocabulary: Vocabulary) -> Iterator[ModelError]:
    """What is missing, component by component, in the order of the model."""
    for component in _used(system):
        if fidelity == "code" and not component.path:
            what = "it has no code: fidelity `code` needs a `path`; `times` runs without"
            yield ModelError(what, f"components.{component.name}", component.where)
        if component.path and component.language not in vocabulary.languages:
            what = f"{component.language} components do not run yet; {choices(vocabulary.languages)} do"
            yield ModelError(what, f"components.{component.name}.language", component.where)
    if fidelity == "times":
        for instance in system.instances:
            yield from _missing_figures(system, instance)


def _used(system: System) -> list[Component]:
    """The components that have instances."""
    return list({instance.component.name: instance.component for instance in system.instances}.values())


def _missing_figures(system: System, instance: Instance) -> Iterator[ModelError]:
    if instance.processor is None:
        return
    kind = system.processor(instance.processor).kind
    component = instance.component
    for operation in _offered(component, dict(system.interfaces)):
        figures = component.operations.get(operation, ())
        yield from _missing(instance, f"operations.{operation}", figures, kind)
    if instance.activity is not None:
        yield from _missing(instance, "activation", component.activation, kind)


def _offered(component: Component, interfaces: dict[str, Interface]) -> list[str]:
    return [
        operation
        for interface in component.provides.values()
        for operation in interfaces[interface].operations
    ]


def _missing(instance: Instance, what: str, figures: tuple[Figure, ...], kind: str) -> Iterator[ModelError]:
    if any(figure.processor == kind for figure in figures):
        return
    stated = f" (there is one at {choices({figure.processor for figure in figures})})" if figures else ""
    yield ModelError(
        f"no time is stated at {kind}, where {instance.name} runs{stated}; fidelity `times` needs one",
        f"components.{instance.component.name}.{what}",
        instance.component.where,
    )
