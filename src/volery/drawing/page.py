"""A page of Markdown about a model: its pictures, components, interfaces, deployment and requirements."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from volery.base.time import to_seconds
from volery.model.components import Component, Interface, StatedFigure
from volery.model.system import System

PICTURES = {
    "functional": "Components with their ports. A ball is a provided interface, a socket a required one.",
    "deployment": "What each computer executes, on board of which vehicle, and the networks between them.",
    "verification": "The system in its verification environment, with the vehicles that it commands.",
    "topics": "Who publishes and who subscribes. The nodes of vehicles have MAVROS's topics.",
}
"""The pictures of a page with their captions."""


def page(system: System, pictures: Mapping[str, str]) -> str:
    """Return the page; *pictures* are paths by view, as the page links to them."""
    return "\n".join(_lines(system, pictures)) + "\n"


def _lines(system: System, pictures: Mapping[str, str]) -> Iterator[str]:
    yield f"# Model: {_cell(system.name)}"
    yield ""
    yield _cell(system.description)
    variants = [f"allocations: {', '.join(system.allocations)}"] if system.allocations else []
    variants += [f"scenarios: {', '.join(system.scenarios)}"] if system.scenarios else []
    if variants:
        shown = f"This page shows allocation {system.allocation}." if system.allocation else ""
        yield f"\nVariants: {_cell('; '.join(variants))}. {_cell(shown)}"
    for view, caption in PICTURES.items():
        if view in pictures:
            yield f"\n![{caption}]({pictures[view]})"
    yield "\n## Interfaces\n"
    yield from _table(
        ("interface", "operations"), (_interface(interface) for interface in system.interfaces.values())
    )
    yield "\n## Components\n"
    yield from _table(
        ("component", "language", "provides", "requires", "activation", "operations"),
        (_component(component) for component in system.components.values()),
    )
    yield "\n## Instances\n"
    yield from _table(
        ("instance", "component", "computer", "connected to"),
        (
            (
                instance.name,
                instance.component.name,
                instance.processor or "environment",
                ", ".join(str(target) for link in instance.connections.values() for target in link.targets),
            )
            for instance in system.instances
        ),
    )
    yield "\n## Requirements\n"
    yield from _table(
        ("requirement", "bound", "purpose"),
        (
            (
                requirement.name,
                f"{requirement.observe} {requirement.relation} {requirement.bound:g}"
                f" {requirement.unit}".strip(),
                requirement.description,
            )
            for requirement in system.requirements
        ),
    )


def _table(headings: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> Iterator[str]:
    yield "| " + " | ".join(headings) + " |"
    yield "|" + "---|" * len(headings)
    for row in rows:
        yield "| " + " | ".join(map(_cell, row)) + " |"


def _interface(one: Interface) -> tuple[str, str]:
    operations = []
    for operation in one.operations.values():
        arguments = ", ".join(f"{each.name}: {each.type}" for each in operation.arguments)
        returns = f" → {operation.returns}" if operation.returns else ""
        operations.append(f"{operation.name}({arguments}){returns}")
    return one.name, "; ".join(operations) or "publish and subscribe"


def _component(one: Component) -> tuple[str, ...]:
    provides = ", ".join(f"{name}: {interface}" for name, interface in one.provides.items())
    requires = ", ".join(
        f"{port.name}: {port.interface}{'[]' if port.many else ''}" for port in one.requires.values()
    )
    activity = one.activity
    words = []
    if activity is not None and activity.period_ns is not None:
        words.append(f"each {to_seconds(activity.period_ns) * 1000:g} ms")
    words += [_figure(figure) for figure in one.activation]
    operations = [
        f"{name} {_figure(figure)}" for name, figures in one.operations.items() for figure in figures
    ]
    return one.name, one.language, provides, requires, ", ".join(words), "; ".join(operations)


def _figure(one: StatedFigure) -> str:
    return f"{one.time_ns / 1e6:g} ms on {one.processor} at {one.frequency_hz / 1e6:g} MHz"


def _cell(text: str) -> str:
    """Return *text* as it may stand in a table of Markdown."""
    escaped = text.replace("\\", "\\\\").replace("|", "\\|").replace("<", "&lt;")
    return " ".join(escaped.split())
