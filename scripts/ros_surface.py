"""The page of the ROS client libraries: each public name of the original, and whether it is there.

The names of the originals are the lists in ``ros_surface/``. What there is of them is found by asking the
modules that files import in a run. The lists of C++ say it themselves; a test compiles all names that are
there.
"""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.ros.client_libraries.importable_modules import importable_modules
from volery.ros.graph import EmbeddedGraph

LISTS = Path(__file__).parent / "ros_surface"
CPP = "cpp/"
"""Beginning of the names of lists of libraries in C++; a line that begins with - has what is not there."""


class Name(NamedTuple):
    """A name of an original library: where it is, and why it is not there, or "" if it is."""

    owner: str
    name: str
    refused: str


def imported() -> dict[str, ModuleType]:
    """Return the modules that files of a run can import."""
    found: dict[str, ModuleType] = {}
    kernel = VirtualKernel(lambda _: None)
    kernel.spawn(
        lambda: found.update(importable_modules(EmbeddedGraph(kernel))), "page", ExecutionContext("page")
    )
    kernel.run(1)
    return found


def surface(library: str, modules: dict[str, ModuleType]) -> list[Name]:
    """Return all names of a library."""
    names = []
    for line in (LISTS / f"{library}.txt").read_text(encoding="utf-8").splitlines():
        if line.startswith("#"):
            continue
        owner, _, inside = line.partition(": " if library.startswith(CPP) else ":")
        for one in inside.split() or [""]:
            if library.startswith(CPP):
                names.append(Name(owner.removeprefix("-"), one, "-" if owner.startswith("-") else ""))
            else:
                names.append(Name(owner, one, _refused(owner, one, modules)))
    return names


def _refused(owner: str, name: str, modules: dict[str, ModuleType]) -> str:
    """Return the words with which a name is refused, or ""."""
    module = owner
    while module not in modules and "." in module:
        module = module.rpartition(".")[0]
    found: Any = modules[module]
    try:
        for part in (*owner.removeprefix(module).split("."), name):
            found = _part(found, part) if part else found
    except (AttributeError, ImportError) as error:
        return (
            str(error).partition("; ")[2].replace("docs/reference/ros-surface.md lists what is", "-") or "-"
        )
    words = inspect.getdoc(found) or ""
    return words.removeprefix("Refuse: ") if words.startswith("Refuse: ") else ""


def _part(found: Any, name: str) -> Any:
    if inspect.isclass(found) and not hasattr(found, name):
        sources = (inspect.getsource(one) for one in found.__mro__ if _has_source(one))
        if any(re.search(rf"\bself\.{name}\b", text) for text in sources):
            return None  # made by the constructor
    return getattr(found, name)


def _has_source(kind: type) -> bool:
    return kind.__module__.startswith("volery.") and "<locals>" not in kind.__qualname__ and _file(kind)


def _file(kind: type) -> bool:
    try:
        inspect.getsource(kind)
    except (OSError, TypeError):
        return False
    return True


def page(libraries: dict[str, str]) -> str:
    """Return the page.

    Args:
        libraries: Name of each list in ``ros_surface/``, and its title.
    """
    modules = imported()
    lines = [
        "# Names of the ROS client libraries\n",
        "Each public name of the original libraries, and whether files of a run have it. A name that is not",
        "there raises an error that names it, with the file and line of its use and what to do instead; a",
        "member of a class that is not there is an AttributeError of Python. In C++ a name that is not there",
        "does not compile; the error has file and line.",
    ]
    for library, title in libraries.items():
        names = surface(library, modules)
        there = sum(not one.refused for one in names)
        lines += [f"\n## {title}\n", f"{there} of {len(names)} names are there.\n"]
        lines += ["| of | there | not there |", "|---|---|---|"]
        for owner in dict.fromkeys(one.owner for one in names):
            own = [one for one in names if one.owner == owner]
            kept = ", ".join(f"`{one.name}`" for one in own if not one.refused and one.name)
            lines.append(f"| `{owner}` | {kept} | {_missing(own)} |")
    return "\n".join(lines) + "\n"


def _missing(names: list[Name]) -> str:
    """Return the names that are not there, those with the same words together."""
    groups: dict[str, list[str]] = {}
    for one in names:
        if one.refused:
            groups.setdefault(one.refused, []).append(f"`{one.name}`" if one.name else "all")
    return "; ".join(
        ", ".join(inside) + (f" ({words})" if words != "-" else "") for words, inside in groups.items()
    )
