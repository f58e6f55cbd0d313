"""Writes the pages of docs/reference that are made from the code, so that they cannot be wrong about it.

    python scripts/generate_docs.py [--check]

With --check nothing is written; the exit status says whether they are up to date.
"""

from __future__ import annotations

import ast
import json
import sys
from pathlib import Path
from typing import Any

from typer.main import get_command

from volery.autopilots.ardupilot import DIALECT
from volery.cli.main import app
from volery.cost import catalogue
from volery.model.schema import schema
from volery.requirements.observables import OBSERVABLES

ROOT = Path(__file__).parent.parent
REFERENCE = ROOT / "docs" / "reference"
CONFORMANCE = ROOT / "tests" / "conformance" / "ardupilot"
MADE = "<!-- made by scripts/generate_docs.py; do not edit -->\n\n"


def observables() -> str:
    """What a requirement may bound."""
    lines = [
        "# Observables\n",
        "What a requirement of a model may bound, as `<subject>.<quantity>`.",
        "An empty unit stands for a count or a share.\n",
    ]
    subject = ""
    for one in OBSERVABLES:
        if one.subject != subject:
            subject = one.subject
            lines += [f"\n## Of the {subject}\n", "| quantity | unit | what it is |", "|---|---|---|"]
        lines.append(f"| `{one.quantity}` | {one.unit} | {one.description} |")
    return "\n".join(lines) + "\n"


def processors() -> str:
    """The catalogue of processors."""
    lines = [
        "# Processors of the catalogue\n",
        "Every figure carries its provenance; what is missing is not known.\n",
    ]
    for name, entry in catalogue().processors.items():
        lines += [
            f"\n## {name}\n",
            f"{entry.description}. {entry.cores} cores, {entry.least_mhz:g} to {entry.greatest_mhz:g} MHz.\n",
        ]
        for client, law in entry.ros.items():
            lines.append(
                f"- ROS calls ({client}): {law.provenance}; {law.source}. Valid: {law.validity}. {law.note}"
            )
        if entry.power is not None:
            power = entry.power
            words = f"{power.provenance}, within {power.band():.0%}; {power.source}. Valid: {power.validity}"
            lines.append(f"- Power: {words}.")
        for language, code in entry.code.items():
            lines.append(
                f"- Counted code ({language}): {code.provenance}; {code.source}. Valid: {code.validity}."
            )
    return "\n".join(lines) + "\n"


def command_line() -> str:
    """The help of every command."""
    lines = ["# The command line\n"]

    def describe(command: Any, path: str) -> None:
        lines.append(f"\n## {path}\n\n{command.help or ''}\n")
        options = [one for one in command.params if one.param_type_name == "option" and one.name != "help"]
        if options:
            lines.append("| option | meaning |\n|---|---|")
            for one in options:
                names = ", ".join([*one.opts, *one.secondary_opts])
                lines.append(f"| `{names}` | {one.help or ''} |")
        for name, below in getattr(command, "commands", {}).items():
            describe(below, f"{path} {name}")

    describe(get_command(app), "volery")
    return "\n".join(lines) + "\n"


def ardupilot_parameters() -> str:
    """Which parameters of the simulated ArduPilot change what it does."""
    lines = [
        "# Parameters of the simulated ArduPilot\n",
        "All parameters of ArduCopter and ArduRover 4.5.6 are there: listed, read, set, kept. The copter's",
        "names, types and values are the recorded ones. Of the rover's, few were recorded: those that it",
        "shares with the copter have the copter's values, the rest the documented defaults. Those in the",
        "tables change what the vehicle does; the others change nothing.",
    ]
    for kind, dialect in DIALECT.kinds.items():
        every = [one.name for one in dialect.parameters()]
        kept = [name for name in every if name not in dialect.honoured]
        lines += [f"\n## {dialect.name}, {kind}\n", "| parameter | what it changes |", "|---|---|"]
        lines += [f"| `{name}` | {what} |" for name, what in sorted(dialect.honoured.items())]
        lines += [
            f"\nKept and not honoured, {len(kept)} of {len(every)}:\n",
            ", ".join(f"`{one}`" for one in kept),
        ]
    return "\n".join(lines) + "\n"


def ardupilot_checks() -> str:
    """What is checked against the recordings: the names of the conformance tests."""
    lines = [
        "# What is checked of the simulated ArduPilot\n",
        "Each line is a test against facts that were read off recordings of ArduCopter and ArduRover 4.5.6.",
    ]
    for file in sorted(CONFORMANCE.glob("test_*.py")):
        tests = [node for node in ast.parse(file.read_text()).body if isinstance(node, ast.FunctionDef)]
        names = [node.name.removeprefix("test_") for node in tests if node.name.startswith("test_")]
        lines += [f"\n## {file.stem.removeprefix('test_').capitalize()}\n"]
        lines += [f"- {name.replace('_', ' ')}" for name in names]
    return "\n".join(lines) + "\n"


def pages() -> dict[str, str]:
    """File name and content."""
    return {
        "observables.md": MADE + observables(),
        "processors.md": MADE + processors(),
        "command-line.md": MADE + command_line(),
        "ardupilot-parameters.md": MADE + ardupilot_parameters(),
        "ardupilot-checks.md": MADE + ardupilot_checks(),
        "model.schema.json": json.dumps(schema(), indent=2, ensure_ascii=False) + "\n",
    }


def main() -> int:
    """Write, or check."""
    stale = [name for name, text in pages().items() if not _same(REFERENCE / name, text)]
    if "--check" in sys.argv:
        for name in stale:
            print(f"docs/reference/{name} is not up to date: run 'make docs'")
        return 1 if stale else 0
    REFERENCE.mkdir(parents=True, exist_ok=True)
    for name in stale:
        (REFERENCE / name).write_text(pages()[name], encoding="utf-8")
    return 0


def _same(path: Path, text: str) -> bool:
    return path.exists() and path.read_text(encoding="utf-8") == text


if __name__ == "__main__":
    sys.exit(main())
