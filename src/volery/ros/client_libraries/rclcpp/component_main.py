"""The ``main`` of files that have none: of the components of a composition, and of plain classes of nodes."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

from volery.base.errors import UsageError

REGISTER = "RCLCPP_COMPONENTS_REGISTER_NODE"


class Sources(Protocol):
    """The nodes that a component's sources define."""

    def defines_main(self) -> bool:
        """Return whether they define ``main``."""

    def mentions(self, function: str) -> bool:
        """Return whether they call a function or a macro."""

    def file_of_class(self, name: str) -> Path | None:
        """Return the file that defines a class, or None."""


def main_of(sources: Sources, node_class: str) -> str:
    """Return the text of a file with the ``main`` that *sources* lack, or ``""`` if they have one.

    Args:
        sources: Sources of the component.
        node_class: The class of its node, with its namespaces, if the model states one.

    Raises:
        UsageError: Nothing says which node is to run.
    """
    if sources.defines_main():
        return ""
    if sources.mentions(REGISTER):
        return f'#include "rclcpp_components/component_main.hpp"\nVOLERY_COMPONENT_MAIN("{node_class}")\n'
    file = sources.file_of_class(node_class.rpartition("::")[2]) if node_class else None
    if file is None:
        what = f"no class {node_class!r} in its files" if node_class else "it has no main()"
        raise UsageError(f"{what} and no {REGISTER}(): write one of them, or state the `class` of its node")
    header = "rclcpp_components/component_main.hpp"
    return f'#include "{file}"\n#include "{header}"\nVOLERY_CLASS_MAIN({node_class})\n'
