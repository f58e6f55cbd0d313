"""Writes the pages of docs/reference that are made from the code, so that they cannot be wrong about it.

    python scripts/generate_docs.py [--check]

With --check nothing is written; the exit status says whether they are up to date.
"""

from __future__ import annotations

import ast
import json
import sys
from pathlib import Path
from typing import Any, NamedTuple

from typer.main import get_command

from volery.cli.main import app
from volery.cost import load_catalogue
from volery.model.document import schema
from volery.requirements.observables import OBSERVABLES
from volery.simulation.autopilots.ardupilot import FIRMWARE as ARDUPILOT
from volery.simulation.autopilots.firmware import FirmwareFamily
from volery.simulation.autopilots.px4 import FIRMWARE as PX4
from volery.testing.driver_checks import GROUPS
from volery.testing.driver_conformance import chosen
from volery.testing.fault_trials import PHASES
from volery.testing.faults import FAULTS

ROOT = Path(__file__).parent.parent
REFERENCE = ROOT / "docs" / "reference"
CONFORMANCE = ROOT / "tests" / "conformance"
MARKS = {"passed": "✓", "failed": "✗", "declared missing": "–", "not possible here": "·"}
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
    for name, entry in load_catalogue().processors.items():
        lines += [
            f"\n## {name}\n",
            f"{entry.description}. {entry.cores} cores, {entry.least_mhz:g} to {entry.greatest_mhz:g} MHz.\n",
        ]
        if entry.settings is not None:
            settings = entry.settings
            note = f" Note: {settings.note}." if settings.note else ""
            lines.append(
                f"- Can be set to: {settings.least_mhz:g} to {settings.greatest_mhz:g} MHz in steps of "
                f"{settings.step_mhz:g} MHz; {settings.provenance}, from {settings.source}.{note}"
            )
        for client, law in entry.ros.items():
            lines.append(
                f"- ROS calls ({client}): {law.provenance}; {law.source}. Valid: {law.validity}. {law.note}"
            )
        if entry.power is not None:
            power = entry.power
            words = f"{power.provenance}, {power.how_good()}; {power.source}. Valid: {power.validity}"
            lines.append(f"- Power: {words}.")
        for language, code in entry.code.items():
            good = code.how_good().capitalize()
            lines.append(f"- Counted code ({language}): {code.source}. Valid: {code.validity}. {good}.")
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


class Firmware(NamedTuple):
    """A simulated autopilot that is held to recordings. ``parameters`` says which there are."""

    name: str
    recorded: str
    family: FirmwareFamily
    parameters: str


FIRMWARES = {
    "ardupilot": Firmware(
        "ArduPilot",
        "ArduCopter and ArduRover 4.5.6",
        ARDUPILOT,
        "All parameters of ArduCopter and ArduRover 4.5.6 are there: listed, read, set, kept. The copter's\n"
        "names, types and values are the recorded ones. Of the rover's, few were recorded: those that it\n"
        "shares with the copter have the copter's values, the rest the documented defaults.",
    ),
    "px4": Firmware(
        "PX4",
        "PX4 1.14.0 with its built-in quadrotor",
        PX4,
        "The recorded parameters are there, with their recorded types and values: listed, read, set, kept.\n"
        "The rover's are the multirotor's and documented defaults of a few of its own.",
    ),
}


def honoured(firmware: Firmware) -> str:
    """Which parameters of a simulated autopilot change what it does."""
    lines = [
        f"# Parameters of the simulated {firmware.name}\n",
        firmware.parameters,
        "Those in the tables change what the vehicle does; the others change nothing.",
    ]
    for kind, one in firmware.family.kinds.items():
        table = one.rules.parameters
        every = [parameter.name for parameter in table.defaults()]
        kept = [name for name in every if name not in table.supported]
        lines += [f"\n## {one.name}, {kind}\n", "| parameter | what it changes |", "|---|---|"]
        lines += [f"| `{name}` | {what} |" for name, what in sorted(table.supported.items())]
        lines += [
            f"\nKept and not honoured, {len(kept)} of {len(every)}:\n",
            ", ".join(f"`{one}`" for one in kept),
        ]
    return "\n".join(lines) + "\n"


def checks(firmware: Firmware, folder: str) -> str:
    """What is checked against the recordings: the names of the conformance tests."""
    lines = [
        f"# What is checked of the simulated {firmware.name}\n",
        f"Each line is a test against facts that were read off recordings of {firmware.recorded},",
        "but where a heading says that there is no recording.",
    ]
    for file in sorted((CONFORMANCE / folder).glob("test_*.py")):
        module = ast.parse(file.read_text(encoding="utf-8"))
        tests = [node for node in module.body if isinstance(node, ast.FunctionDef)]
        names = [node.name.removeprefix("test_") for node in tests if node.name.startswith("test_")]
        about = " ".join((ast.get_docstring(module) or "").split())
        lines += [f"\n## {file.stem.removeprefix('test_').capitalize()}\n", f"{about}\n"]
        lines += [f"- {name.replace('_', ' ')}" for name in names]
    return "\n".join(lines) + "\n"


def _trials() -> dict[str, Any]:
    """What scripts/gather_trials.py has found."""
    found: dict[str, Any] = json.loads((REFERENCE / "trials.json").read_text(encoding="utf-8"))
    return found


def conformance() -> str:
    """What each simulated autopilot's driver does of what is demanded of all."""
    found = _trials()
    outcomes = {name: {one["check"]: one for one in of["checks"]} for name, of in found.items()}
    lines = [
        "# Conformance of the drivers\n",
        "What `volery conformance sim:AUTOPILOT` finds, check by check; run it over your own vehicle or",
        "driver. `scripts/gather_trials.py` flies them anew.\n",
        "✓ passed, ✗ failed, – declared missing before anything moves, · not possible there (see below).",
    ]
    for group in GROUPS:
        of_group = [one for one in chosen() if one.group == group]
        if of_group:
            lines += [f"\n## {group.capitalize()}\n", f"| check | {' | '.join(found)} | what it demands |"]
            lines.append("|---|" + ":-:|" * len(found) + "---|")
        for one in of_group:
            marks = [MARKS[outcomes[name][one.name]["outcome"]] for name in found]
            lines.append(f"| `{one.name}` | {' | '.join(marks)} | {one.demands} |")
    lines += ["\n## What is missing, and what is not possible there\n"]
    for name in found:
        for check, one in outcomes[name].items():
            if one["why"]:
                lines.append(f"- {name}, `{check}`: {one['outcome']}: {one['why']}.")
    return "\n".join(lines) + "\n"


def faults() -> str:
    """What came of each fault in each phase of a flight."""
    lines = [
        "# Faults, and what comes of them\n",
        "One fault in one phase of a flight of each simulated autopilot, through bytes, in virtual time. The",
        "first line of a cell is what the caller saw: `done`, or the error that the call raised; the second",
        "what the aircraft did from the fault on, by its modes, until the program's end had brought it down.",
        "`scripts/gather_trials.py` flies them anew.\n",
        "Of every cell holds: no call hung; what ended done was done, by the vehicle's own truth; any other",
        "end is an error that names the vehicle; nothing was done twice; nobody else's mode was fought; at",
        "last it stood on the ground, disarmed.\n",
        "| fault | what happens |",
        "|---|---|",
        *(f"| {name} | {fault.words} |" for name, fault in FAULTS.items()),
        "\n| phase | when |",
        "|---|---|",
        *(f"| {name} | {program.__doc__} |" for name, program in PHASES.items()),
    ]
    for name, of in _trials().items():
        cells = {(one["fault"], one["phase"]): one for one in of["faults"]}
        lines += [f"\n## {name}\n", f"| fault | {' | '.join(PHASES)} |", "|---" * (len(PHASES) + 1) + "|"]
        for fault in FAULTS:
            row = [_cell(cells[fault, phase]) for phase in PHASES]
            lines.append(f"| {fault} | {' | '.join(row)} |")
    return "\n".join(lines) + "\n"


def _cell(one: dict[str, Any]) -> str:
    broken = f"<br>**{one['broken']}**" if one["broken"] else ""
    return f"{one['caller']}<br>{' → '.join(one['aircraft'])}{broken}"


def pages() -> dict[str, str]:
    """File name and content."""
    return {
        "observables.md": MADE + observables(),
        "processors.md": MADE + processors(),
        "command-line.md": MADE + command_line(),
        **{f"{name}-parameters.md": MADE + honoured(one) for name, one in FIRMWARES.items()},
        **{f"{name}-checks.md": MADE + checks(one, name) for name, one in FIRMWARES.items()},
        "conformance.md": MADE + conformance(),
        "faults.md": MADE + faults(),
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
