"""Diagrams as Mermaid text, which pages of repositories render."""

from __future__ import annotations

import re
from collections.abc import Iterator

from volery.drawing.boxes import Diagram
from volery.drawing.views import functional, verification
from volery.model.system import System

_CLASSES = {
    "active": "fill:#e8f1fb,stroke:#2f6fae",
    "passive": "fill:#ffffff,stroke:#6a87a3",
    "environment": "fill:#fdf6e7,stroke:#b98b2c",
    "vehicle": "fill:#e9f6ee,stroke:#3c8a5d",
    "system": "fill:#e8f1fb,stroke:#2f6fae",
}


def functional_mermaid(system: System) -> str:
    """Return the functional architecture as a flowchart."""
    return _flowchart(functional(system))


def verification_mermaid(system: System) -> str:
    """Return the verification environment as a flowchart."""
    return _flowchart(verification(system))


def deployment_mermaid(system: System) -> str:
    """Return computers with what they execute, and their networks, as a flowchart."""
    return "\n".join(["flowchart TB", *_deployment(system), *_styles()]) + "\n"


def _flowchart(diagram: Diagram) -> str:
    lines = ["flowchart LR"]
    indent = "  "
    if diagram.frame:
        lines.append(f"  subgraph framed[{_text(diagram.frame)}]")
        lines += [
            f"    {_node(box.key, box.title, box.kind)}" for box in diagram.boxes if box.key in diagram.framed
        ]
        lines.append("  end")
    outside = [box for box in diagram.boxes if not (diagram.frame and box.key in diagram.framed)]
    lines += [f"{indent}{_node(one.key, one.title, one.kind)}" for one in outside]
    interfaces = {
        (box.key, port.name): port.interface for box in diagram.boxes for port in box.ports if port.provided
    }
    for link in diagram.links:
        label = interfaces.get((link.target, link.target_port), "")
        lines.append(f"  {_id(link.source)} -->|{_text(label)}| {_id(link.target)}")
    return "\n".join([*lines, *_styles()]) + "\n"


def _deployment(system: System) -> Iterator[str]:
    for processor in system.processors:
        title = f"{processor.name}: {processor.kind}, {processor.cores} × {processor.frequency_mhz:g} MHz"
        if processor.carried_by:
            title += f", on {processor.carried_by}"
        yield f"  subgraph {_id(processor.name)}[{_text(title)}]"
        for instance in system.instances:
            if instance.processor == processor.name:
                kind = "active" if instance.activity else "passive"
                yield f"    {_node(instance.name, f'{instance.name}: {instance.component.name}', kind)}"
        for vehicle in system.vehicles:
            if vehicle.processor == processor.name:
                yield f"    {_node(f'node of {vehicle.name}', f'node of {vehicle.name}', 'vehicle')}"
        yield "  end"
    for network in system.networks:
        key = _id(f"network {network.name}")
        yield f"  {key}(({_text(f'{network.name}, {network.bandwidth_bit_s / 1000:g} kbit/s')}))"
        yield from (f"  {_id(name)} --- {key}" for name in network.between)


def _styles() -> Iterator[str]:
    yield from (f"  classDef {name} {style}" for name, style in _CLASSES.items())


def _node(key: str, title: str, kind: str) -> str:
    return f"{_id(key)}[{_text(title)}]:::{kind}"


def _id(name: str) -> str:
    """Return an id that no keyword of Mermaid equals, and no other name has."""
    return "n_" + re.sub(r"[^A-Za-z0-9]", lambda found: f"_{ord(found.group()):x}_", name)


def _text(words: str) -> str:
    """Return quoted text; Mermaid reads entities such as ``#quot;``."""
    safe = "".join(word if word.isalnum() or word in " _-:.,×/·" else f"#{ord(word)};" for word in words)
    return f'"{safe}"'
