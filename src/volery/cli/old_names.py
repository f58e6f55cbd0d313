"""Names that commands had before they stood below nouns: scripts and files with these go on working."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from volery.base.errors import UsageError

MOVED = {
    "report": "runs report",
    "conformance": "vehicle conformance",
    "files": "vehicle files",
    "logs": "vehicle logs",
    "mission": "vehicle mission",
    "params": "vehicle params",
    "serve": "vehicle serve",
    "bag": "ros bag",
    "bridge": "ros bridge",
    "deploy": "ros deploy",
    "export-messages": "ros messages",
    "graph": "ros graph",
    "calibrate": "cost calibrate",
    "profile": "cost profile",
    "validate": "cost validate",
    "go": "control go",
    "response": "control response",
    "teleop": "control teleop",
    "tune": "control tune",
    "twin": "control twin",
}
"""Old first word of a command, and the words that stand for it now."""

QUIET = frozenset({"-q", "--quiet"})


def current_words(words: Sequence[str]) -> tuple[list[str], str]:
    """Return the words of a command line in the present spelling, and what to say of an old one, if it is."""
    first, rest = next(iter(words), ""), words[1:]
    if first not in MOVED:
        return list(words), ""
    several = first == "report" and sum(not one.startswith("-") for one in rest) > 1
    new = "runs compare" if several else MOVED[first]
    return [*new.split(), *rest], f"volery: `volery {first}` is now `volery {new}`"


def current_tables(stated: dict[str, Any], where: str) -> dict[str, Any]:
    """Return the tables of a configuration file under the present names.

    Raises:
        UsageError: A command has a table under both names.
    """
    tables = {name: table for name, table in stated.items() if name not in MOVED}
    for old in stated.keys() & MOVED.keys():
        noun, verb = MOVED[old].split()
        below = tables.setdefault(noun, {})
        if isinstance(below, dict):
            if verb in below:
                raise UsageError(f"{where}[{old}] and [{noun}.{verb}] are the same; keep [{noun}.{verb}]")
            tables[noun] = {**below, verb: stated[old]}
    return tables
