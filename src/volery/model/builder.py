"""A model that is built in Python: the same keys, values and checks as in YAML.

Each entry remembers the line of the program that added it, so that messages name it. There are no classes
for components, processors and so on with parameters of their own: the keys are declared once, in the fields
of the model's classes, and what is wrong with them is reported when the model is loaded or checked.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path as FilePath
from typing import Any

from volery.base.errors import Location, UsageError
from volery.base.files import write_text
from volery.model.text import Quoted, TextNode
from volery.model.writing import model_text

TEXT_NAME = "model.yaml"
"""Name of the text of a built model in the trace of a run."""


class ModelBuilder:
    """A model that is built step by step.

    ::

        model = ModelBuilder("field-patrol", folder=Path(__file__).parent)
        model.add("interfaces", "Routing", get_route={"returns": "Position[]"})
        model.add("components", "Planner", language="python", provides={"paths": "Routing"})
        model.add("application", "planner", is_="Planner")
        model.add("platform.processors", "ground", is_="intel-i5-3470", frequency="3 GHz")
        model.add("allocations", "all", planner="ground")
        run = volery.simulate(model)

    Quantities are texts with a unit, as in YAML; ``Quoted("10 m")`` is a text that is no quantity.

    Args:
        name: Name of the system.
        folder: Where paths of the model start.
    """

    def __init__(self, name: str, *, folder: str | FilePath = ".") -> None:
        self.folder = FilePath(folder)
        self.root = plain_node({"volery": 1, "name": name}, _caller())

    def add(self, section: str, name: str, /, **values: Any) -> None:
        """Add an entry to a section.

        Args:
            section: The section, such as ``components`` or ``platform.processors``.
            name: Name of the entry.
            values: Its keys. An underscore at the end is left out: ``is_`` is the key ``is``.

        Raises:
            UsageError: the section has an entry of this name.
        """
        below = self._mapping(section, _caller())
        if name in below:
            raise UsageError(f"{section} has {name!r} already, from {below[name].where}")
        below[name] = plain_node({_key(key): value for key, value in values.items()} or None, _caller())

    def set(self, path: str, value: Any) -> None:
        """Set the value at a path, such as ``run.duration``; what leads to it is made if it is missing."""
        above, _, key = path.rpartition(".")
        self._mapping(above, _caller())[key] = plain_node(value, _caller())

    def text(self) -> str:
        """Return the model as YAML."""
        return model_text(self.root.plain())

    def write(self, file: str | FilePath) -> None:
        """Write the model as YAML, for the command line and for git. Raises ``OSError``."""
        write_text(FilePath(file), self.text())

    def _mapping(self, path: str, where: Location) -> dict[str, TextNode]:
        node = self.root
        for step in path.split(".") if path else ():
            entries = node.value
            assert isinstance(entries, dict)
            below = entries.setdefault(step, TextNode({}, where))
            if below.value is None:
                below.value = {}
            if not isinstance(below.value, dict):
                raise UsageError(f"{path}: {step} is {below.value!r}, not a mapping")
            node = below
        assert isinstance(node.value, dict)
        return node.value


def _key(name: str) -> str:
    return name[:-1] if name.endswith("_") else name


def _caller() -> Location:
    """Return the line of the program that uses the builder."""
    frame = sys._getframe(1)
    while frame.f_back is not None and frame.f_code.co_filename == __file__:
        frame = frame.f_back
    return Location(frame.f_code.co_filename, frame.f_lineno)


def plain_node(value: Any, where: Location) -> TextNode:
    """Return plain Python data as a tree, every node of which stands at *where*."""
    if isinstance(value, Mapping):
        return TextNode({str(key): plain_node(below, where) for key, below in value.items()}, where)
    if isinstance(value, list | tuple):
        return TextNode([plain_node(below, where) for below in value], where)
    if isinstance(value, FilePath):
        return TextNode(value.as_posix(), where)
    if isinstance(value, bool | int | float | str | None):
        return TextNode(str(value) if isinstance(value, Quoted) else value, where, isinstance(value, Quoted))
    raise UsageError(f"{where}: {value!r} is no value of a model: a text, a number, a list or a mapping is")
