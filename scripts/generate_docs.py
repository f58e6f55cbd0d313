"""Writes the pages of docs/reference that are made from the code, so that they cannot be wrong about it.

    python scripts/generate_docs.py [--check]

With --check nothing is written; the exit status says whether they are up to date.
"""

from __future__ import annotations

import ast
import json
import re
import sys
from collections.abc import Iterable, Mapping
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

from package_map import package_map
from ros_surface import page as ros_surface
from typer.main import get_command

from volery.cli.command import Noun
from volery.cli.main import application
from volery.cost import ListPrice, Supply, load_catalogue
from volery.drawing.deployment import deployment_svg
from volery.drawing.page import page
from volery.drawing.shapes import functional_svg, verification_svg
from volery.model.document import schema
from volery.model.faults import FAULTS, TRIAL_FAULTS, Fault
from volery.model.fields import entries, summary
from volery.model.rules import RULES
from volery.model.system_loader import load
from volery.report.graph_picture import graph_of_model, graph_svg
from volery.requirements.observables import NOTED, OBSERVABLES
from volery.run.assembly.model_checks import vocabulary
from volery.simulation.autopilots.ardupilot import FIRMWARE as ARDUPILOT
from volery.simulation.autopilots.ardupilot.copter import CORE as COPTER
from volery.simulation.autopilots.ardupilot.features import OPTIONAL, features_of
from volery.simulation.autopilots.ardupilot.rover import CORE as ROVER
from volery.simulation.autopilots.autopilot import FirmwareFamily
from volery.simulation.autopilots.autopilot_parameters import Renamed
from volery.simulation.autopilots.px4 import FIRMWARE as PX4
from volery.simulation.autopilots.vehicle_state import ParameterTable
from volery.simulation.real_firmware.firmware_faults import WAYS, ByParameters, LinkFrom, Way
from volery.simulation.world.body_specs import Multirotor
from volery.testing.driver_checks import GROUPS
from volery.testing.driver_conformance import chosen
from volery.testing.fault_trials import BREAKS_M_S, NEAR_M, PHASES, UPRIGHT_DEG, most_lean
from volery.testing.fault_trials import FAULTS as TRIALS
from volery.vehicles.tried_versions import OPERATIONS, TABLE

ROOT = Path(__file__).parent.parent
REFERENCE = ROOT / "docs" / "reference"
CONFORMANCE = ROOT / "tests" / "conformance"
MARKS = {"passed": "✓", "failed": "✗", "declared missing": "–", "not possible here": "·"}
MADE = "<!-- made by scripts/generate_docs.py; do not edit -->\n\n"
_LIBRARIES = {
    "rclpy": "rclpy 7.1.6 (ROS 2 Jazzy)",
    "rospy": "rospy 1.15.15 (ROS 1 Noetic)",
    "actionlib": "actionlib 1.14.0 (ROS 1 Noetic)",
    "message_filters": "message_filters 1.15.15 (ROS 1 Noetic)",
    "tf": "tf 1.13.2 (ROS 1 Noetic)",
    "tf2_ros": "tf2_ros 0.7.6 (ROS 1 Noetic)",
    "cpp/roscpp": "roscpp 1.15.15 with roscpp_core, rosconsole and xmlrpcpp, in C++ (ROS 1 Noetic)",
    "cpp/message_filters": "message_filters 1.15.15, in C++ (ROS 1 Noetic)",
    "cpp/tf": "tf 1.13.2 with its conversions to Eigen, and angles, in C++ (ROS 1 Noetic)",
    "cpp/tf2": "tf2 and tf2_ros 0.7.6, in C++ (ROS 1 Noetic)",
    "cpp/actionlib": "actionlib 1.14.0 and dynamic_reconfigure 1.7.3, in C++ (ROS 1 Noetic)",
}
"""Client libraries whose names are listed, with their titles."""


def observables() -> str:
    """What a requirement may bound."""
    lines = [
        "# Observables\n",
        "What a requirement of a model may bound, as `<subject>.<quantity>`: `planner.response_time`.",
        "The subject is the name of a component instance, processor, network, vehicle or chain, or",
        "`application`. An operation is a subject by the names of its instance and itself, a ROS service by",
        "the last word of its name: `planner.order_of.response_time`.",
        "An empty unit stands for a count or a share.\n",
    ]
    subject = ""
    for one in OBSERVABLES:
        if one.subject != subject:
            subject = one.subject
            lines += [f"\n## Of the {subject}\n", "| quantity | unit | what it is |", "|---|---|---|"]
        lines.append(f"| `{one.quantity}` | {one.unit} | {one.description} |")
    lines += [
        "\n## Of your own\n",
        "| observable | unit | what it is |",
        "|---|---|---|",
        *(f"| `{one.subject}.{one.quantity}` | {one.unit} | {one.description} |" for one in NOTED),
        "\nKind, subject and state are words of your own; a component states them while it runs:\n",
        "```python",
        'volery.note("point", "north-east corner", "inspected")',
        "```\n",
        "and a requirement bounds the count, here that four different points were inspected:\n",
        "```yaml",
        "requirements:",
        "  all_inspected: {observe: note.point.inspected, min: 4}",
        "  in_time: {observe: note.point.inspected.time_max, max: 5 min}",
        "```\n",
        "A state that was never noted counts 0, also one that is misspelt; its times are unknown, so no",
        "bound on them is met. The report has a table of each kind, its counts and its marks on the map.\n",
        "\n## Of other packages\n",
        "A package adds quantities and a table for the report by a class in its entry points",
        "`volery.observables`; `examples/separation` measures how near drones come to each other:\n",
        "```yaml",
        "requirements:",
        "  apart: {observe: drone_1.separation_min, min: 5 m}",
        "```\n",
        "`volery model observables` lists what the installed packages add; their values are in `run.json`.",
    ]
    return "\n".join(lines) + "\n"


def hardware_lines(price: ListPrice | None, supply: Supply | None) -> list[str]:
    """Price and supply of one part."""
    lines = []
    if price is not None:
        kind = "estimated, from" if price.estimated else "by"
        lines.append(f"- Price: {price.amount:g} {price.currency} ({price.year}), {kind} {price.source}.")
    if supply is not None:
        kind = "estimated, from" if supply.estimated else "by"
        lines.append(f"- Supply: {supply.watts:g} W, {kind} {supply.source}.")
    return lines


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
        lines += hardware_lines(entry.price, entry.supply)
        if entry.power is not None:
            power = entry.power
            words = f"{power.provenance}, {power.how_good()}; {power.source}. Valid: {power.validity}"
            lines.append(f"- Power: {words}.")
        for language, code in entry.code.items():
            good = code.how_good().capitalize()
            lines.append(f"- Counted code ({language}): {code.source}. Valid: {code.validity}. {good}.")
    lines.append("\n# Other hardware\n\nWhere a model states no `price`.\n")
    for name, part in load_catalogue().hardware.items():
        lines += [f"\n## {name}\n", *hardware_lines(part.price, part.supply)]
    return "\n".join(lines) + "\n"


def command_line() -> str:
    """The help of every command."""
    lines = ["# The command line\n"]

    def describe(command: Any, path: str) -> None:
        command = command.described() if isinstance(command, Noun) else command
        usage = " ".join(command.collect_usage_pieces(command.context_class(command)))
        lines.append(f"\n## {path}\n\n`{path} {usage}`\n\n{command.help or ''}\n")
        for kind in ("argument", "option"):
            rows = [one for one in command.params if one.param_type_name == kind and one.name != "help"]
            if rows:
                lines.append(f"| {kind} | meaning |\n|---|---|")
            for one in rows:
                names = one.name if kind == "argument" else ", ".join([*one.opts, *one.secondary_opts])
                lines.append(f"| `{names}` | {one.help or ''} |")
            if rows:
                lines.append("")
        for name, below in getattr(command, "commands", {}).items():
            describe(below, f"{path} {name}")

    describe(get_command(application()), "volery")
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
        "All parameters of ArduCopter and ArduRover 4.5.6 are there: listed and read; what changes nothing\n"
        "keeps its value. The copter's\n"
        "names, types and values are the recorded ones. Of the rover's, few were recorded: those that it\n"
        "shares with the copter have the copter's values, the rest the documented defaults.\n"
        "Where 4.8, the default, has another name, it follows; values in cm are metres there, 1/100 degrees\n"
        "degrees, and ARMING_SKIPCHK and SIM_GPS1_ENABLE the opposite. Units and defaults are those of 4.5.\n"
        "Features that are off by default are on with `features=all` or their names; without them, all\n"
        "parameters that begin as theirs are absent.",
    ),
    "px4": Firmware(
        "PX4",
        "PX4 1.14.0 with its built-in quadrotor",
        PX4,
        "The parameters recorded of 1.14 are there, with their recorded types and values, in both versions.\n"
        "Those that have no effect are listed and read, and keep their values.\n"
        "The rover's are the multirotor's and documented defaults of a few of its own.",
    ),
}


def _all_names(name: str, renamed: Mapping[str, Renamed]) -> str:
    """Return the name of a parameter, and the one that the newest version has for it."""
    return f"`{name}`, now `{renamed[name].name}`" if name in renamed else f"`{name}`"


def supported_parameters(firmware: Firmware) -> str:
    """Return the page of parameters that change the behaviour of a simulated autopilot."""
    lines = [
        f"# Parameters of the simulated {firmware.name}\n",
        firmware.parameters,
        "Those in the tables change what the vehicle does; the others change nothing.",
    ]
    for kind, one in firmware.family.kinds.items():
        table = one.rules.parameters
        every = [parameter.name for parameter in table.defaults()]
        names = {name: _all_names(name, table.renamed) for name in every}
        kept = [names[name] for name in every if name not in table.supported]
        lines += [f"\n## {one.name}, {kind}\n"]
        if firmware.family.optional:
            lines += feature_tables(kind, table)
        else:
            lines += ["| parameter | what it changes |", "|---|---|"]
            lines += [f"| {names[name]} | {what} |" for name, what in sorted(table.supported.items())]
        lines += [
            f"\nWithout effect, {len(kept)} of {len(every)}:\n",
            ", ".join(kept),
        ]
    return "\n".join(lines) + "\n"


CORES = {"multirotor": ("COPTER", COPTER), "rover": ("ROVER", ROVER)}


def feature_tables(kind: str, table: ParameterTable) -> list[str]:
    """Return the parameters of ArduPilot's core and of each feature, with their defaults and units."""
    name, core = CORES[kind]
    defaults = {
        one.name: one.value for one in ARDUPILOT.with_features("all").kinds[kind].rules.parameters.defaults()
    }
    stated: set[str] = set()
    lines: list[str] = []
    for title, feature in {"core": core, **features_of(name, OPTIONAL)}.items():
        own = {one: what for one, what in sorted(feature.parameters.items()) if one not in stated}
        stated |= set(own)
        off = ", off by default" if title in OPTIONAL else ""
        if own:
            lines += [
                f"### {title.replace('_', ' ')}{off}\n",
                "| parameter | default | unit | what it changes |",
            ]
            lines += ["|---|---|---|---|"]
        lines += [
            f"| {_all_names(one, table.renamed)} | {defaults[one]:g} | {unit} | {what} |"
            for one, (unit, what) in own.items()
        ]
        lines += [""] if own else []
    return lines


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
        "What `volery vehicle conformance sim:AUTOPILOT` finds, check by check; run it over your own vehicle",
        "or driver. `scripts/gather_trials.py` flies them anew.\n",
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


def model() -> str:
    """Return the reference of the model language: every key of every mapping."""
    made = schema()
    lines = [
        "# The model language\n",
        "Every mapping of a model file, key by key. A star marks keys that must be given. Quantities are",
        "written with their unit; a bare zero needs none. `volery model schema` prints the same as a JSON",
        "Schema ([model.schema.json](model.schema.json)), with which editors complete and check a model.\n",
        "Faults have [a page of their own](faults.md); so do [observables](observables.md) and",
        "[processors](processors.md).\n",
        "## The file\n",
        *_keys(made),
    ]
    faulty = {cls.__name__ for cls in FAULTS.values()}
    for name, definition in made["$defs"].items():
        if name not in faulty:
            lines += [f"\n## {_title(name)}\n", f"{definition['description']}\n", *_keys(definition)]
    return "\n".join(lines) + "\n"


def _keys(definition: dict[str, Any]) -> list[str]:
    """Return the table of a mapping's keys."""
    required = definition.get("required", [])
    lines = ["| key | value | default | meaning |", "|---|---|---|---|"]
    for key, one in definition["properties"].items():
        star = "\\*" if key in required else ""
        default = f"`{one['default']}`" if "default" in one else ""
        lines.append(f"| `{key}`{star} | {_value(one)} | {default} | {one['description']} |")
    others = definition.get("additionalProperties")
    if isinstance(others, dict):
        lines.append(f"| any other | {_value(others)} | | {others.get('description', '')} |")
    return lines


def _value(one: dict[str, Any]) -> str:
    """Return how a value is written, in a few words."""
    if "$ref" in one:
        title = _title(one["$ref"].rpartition("/")[2])
        return f"[{title}](#{title.lower().replace(' ', '-')})"
    if "enum" in one or "const" in one:
        return ", ".join(f"`{value}`" for value in one.get("enum", [one.get("const")]))
    if "x-unit" in one:
        return _quantity(one)
    if "anyOf" in one:
        if all(option.get("$ref", "").rpartition("/")[2] in _FAULT_CLASSES for option in one["anyOf"]):
            return "[fault](faults.md)"
        return " or ".join(dict.fromkeys(_value(option) for option in one["anyOf"]))
    return _collection(one) or _scalar(one.get("type", "anything"))


def _collection(one: dict[str, Any]) -> str:
    """Return how a list or a mapping is written; an empty text for anything else."""
    if one.get("maxProperties") == 1:
        return "one of " + ", ".join(f"`{key}`: {_value(below)}" for key, below in one["properties"].items())
    if "items" in one:
        return f"list of {_value(one['items'])}"
    if "patternProperties" in one:
        return f"by name: {_value(next(iter(one['patternProperties'].values())))}"
    if isinstance(one.get("additionalProperties"), dict):
        return f"mapping to {_value(one['additionalProperties'])}"
    return ""


def _scalar(types: str | list[str]) -> str:
    """Return how a value of JSON types is written."""
    if isinstance(types, list):
        return "text or number"
    words = {"string": "text", "integer": "whole number", "object": "mapping", "null": "nothing"}
    return words.get(types, types)


def _quantity(one: dict[str, Any]) -> str:
    """Return the unit of a quantity with its range."""
    unit = "ratio" if one["x-unit"] == "1" else one["x-unit"]
    bounds = [
        f"{words} {one[key]:g}"
        for key, words in (("x-minimum", "at least"), ("x-above", "more than"), ("x-maximum", "at most"))
        if key in one
    ]
    return ", ".join([unit, *bounds])


_FAULT_CLASSES = {cls.__name__ for cls in FAULTS.values()}


def _title(name: str) -> str:
    """Return the heading of a class of the model: ``AllocationText`` gives ``Allocation``."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name.removesuffix("Text").removesuffix("Spec")).capitalize()


def versions() -> str:
    """Which versions of each firmware were tried, and how."""
    lines = [
        "# Versions of firmware\n",
        "Which versions each driver was tried with, and how what is said about them is known:",
        "**flown** on unmodified firmware in its own simulator, **read** in its sources or in the",
        "definitions of its protocol, **reported** by others, or not tried (–).",
        "`volery doctor --vehicle URL` and the first line of a connection name the row.",
        "What a message means in which version stands in `drivers/px4/versions.py` and",
        "`drivers/ardupilot/versions.py`; a version that no rule covers is flown by the newest rules,",
        "with a warning.\n",
        f"| firmware | source | date | {' | '.join(OPERATIONS)} | |",
        f"|---|---|---|{'---|' * len(OPERATIONS)}---|",
    ]
    for row in TABLE:
        known = " | ".join(one.value for one in row.known)
        lines.append(
            f"| {row.autopilot}: {row.version} | {row.commit} | {row.date} | {known} | {row.remark} |"
        )
    lines += [
        "\nThe five-line mission is `examples/mission.py`; single operations are those of the",
        "[vehicle API](../vehicle-api.md); attitude set-points are `set_attitude` without a heading;",
        "plans are missions, fences and rally points, up and down; conformance is",
        "`volery vehicle conformance --fly`. Figures:",
        "[tried on real firmware](../real-firmware.md).",
    ]
    return "\n".join(lines) + "\n"


def faults() -> str:
    """Return the catalogue of faults, and the results of the fault trials."""
    definitions = schema()["$defs"]
    lines = [
        "# Faults\n",
        "## What a model can state\n",
        "Under `environment.faults`, by a name of your own: `kind`, when (`at`), for how long (`duration`;",
        "for good if it is not given), what it happens to, and the arguments of the kind.\n",
        "```yaml",
        "environment:",
        "  faults:",
        "    weak_motor: {kind: motor-dead, vehicle: drone_1, motor: 2, thrust: 60 %, at: 30 s}",
        "    gust_front: {kind: wind, speed: 9 m/s, direction: 200 deg, at: 40 s, duration: 20 s}",
        "```",
    ]
    common = {"kind", "at", "duration"}
    for kind, cls in FAULTS.items():
        definition = definitions[cls.__name__]
        own = {key: one for key, one in definition["properties"].items() if key not in common}
        described = {**definition, "properties": own}
        lines += [f"\n### {kind}\n", f"{definition['description']}\n", *(_keys(described) if own else [])]
    lines += ["\n## Only in fault trials\n", "| kind | what happens |", "|---|---|"]
    lines += [f"| `{kind}` | {summary(cls)} |" for kind, cls in TRIAL_FAULTS.items()]
    return "\n".join([*lines, *_fault_trials()]) + "\n"


def _fault_trials() -> list[str]:
    """Return the results of each fault in each phase of a flight."""
    lines = [
        "\n## Fault trials\n",
        "One fault in one phase of a flight of each simulated autopilot, through bytes, in virtual time. The",
        "first line of a cell is the outcome for the caller: `done`, or the error that the call raised; the",
        "second is the sequence of the aircraft's modes from the fault until it stands on the ground.",
        "`scripts/gather_trials.py` flies them anew.\n",
        "In every cell: no call hung; what ended done was done, by the vehicle's true position (within",
        f"{NEAR_M:g} m of the goal); any other end is an error that names the vehicle;",
        "nothing was done twice; another station's mode was kept; motors never stopped above 1 m; at",
        f"the end it stood on the ground, disarmed, after a touch-down slower than {BREAKS_M_S:g} m/s,",
        f"leaning less than {UPRIGHT_DEG:g} degrees, with the battery not yet empty. In wind it may",
        "lean as far as balances the drag of the mean and twice the gusts,",
        f"atan(D / m g): {most_lean(Multirotor(), TRIALS['wind']):.0f} degrees here. Judged by the simulated",
        "truth. A cell in which a demand was not met says so in bold.\n",
        "| trial | fault |",
        "|---|---|",
        *(f"| {name} | {_arguments(fault)} |" for name, fault in TRIALS.items()),
        "\n| phase | when |",
        "|---|---|",
        *(f"| {name} | {program.__doc__} |" for name, program in PHASES.items()),
    ]
    for name, of in _trials().items():
        cells = {(one["fault"], one["phase"]): one for one in of["faults"]}
        lines += [f"\n### {name}\n", f"| trial | {' | '.join(PHASES)} |", "|---" * (len(PHASES) + 1) + "|"]
        for fault in TRIALS:
            row = [_cell(cells[fault, phase]) for phase in PHASES]
            lines.append(f"| {fault} | {' | '.join(row)} |")
    return [*lines, *_worst_landings()]


def _worst_landings() -> list[str]:
    """Return the worst touch-down of each autopilot, by quantity, with the trial that it belongs to."""
    lines = [
        "\n### The worst touch-downs\n",
        "By truth; the trial and the phase in parentheses. From 8 % this airframe hovers for 34 s, and",
        "ArduPilot's landing from 10 m takes 24 s at its 0.5 m/s: the least battery is what a sudden loss of",
        "charge leaves after a landing at once. Drained by flying, it lands with `Limits.landing_reserve`",
        "left, 2 % by default.\n",
        "| autopilot | fastest | most lean | least battery | farthest from home |",
        "|---|---|---|---|---|",
    ]
    quantities = (("sink_m_s", " m/s", 1), ("lean_deg", "°", 1), ("battery", "", -1), ("away_m", " m", 1))
    for name, of in _trials().items():
        cells = []
        for key, unit, sign in quantities:
            flown = [(sign * one["landing"][key], one) for one in of["faults"] if one["landing"]]
            value, one = max(flown, key=itemgetter(0))
            cells.append(f"{sign * value:g}{unit} ({one['fault']}, {one['phase']})")
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return lines


def _arguments(fault: Fault | None) -> str:
    """Return the kind of a fault with the arguments that differ from the defaults."""
    if fault is None:
        return "none"
    stated = [
        f"{one.key}: {one.syntax.written(value)}"
        for one in entries(type(fault))
        if one.key not in {"at", "vehicle"}
        and (value := getattr(fault, one.attribute)) is not None
        and (value != one.default or one.key == "charge")
    ]
    return f"`{fault.kind}` {', '.join(stated)}".strip()


def _cell(one: dict[str, Any]) -> str:
    broken = f"<br>**{one['broken']}**" if one["broken"] else ""
    return f"{one['caller']}<br>{' → '.join(one['aircraft'])}{broken}"


def delivery_model() -> dict[Path, str]:
    """The delivery example: its page, and its pictures."""
    system = load(ROOT / "examples" / "delivery", vocabulary())
    drawers = {
        "functional": functional_svg,
        "deployment": deployment_svg,
        "verification": verification_svg,
        "topics": lambda system: graph_svg(graph_of_model(system)),
    }
    images = {f"delivery-{view}.svg": draw(system) for view, draw in drawers.items()}
    links = {view: f"../images/delivery-{view}.svg" for view in drawers}
    return {
        **{ROOT / "docs" / "images" / name: text for name, text in images.items()},
        REFERENCE / "delivery-model.md": MADE + page(system, links),
    }


def firmware_faults() -> str:
    """Return how faults reach real firmware, and what was seen of it in bench/firmware_faults.py."""
    found: list[dict[str, Any]] = json.loads((REFERENCE / "firmware-faults.json").read_text(encoding="utf-8"))
    lines = [
        "# Faults on real firmware\n",
        "How each [kind of fault](faults.md) reaches a program of real firmware that flies",
        "[in the loop](../firmware-in-the-loop.md).\n",
        f"| kind | {' | '.join(WAYS)} |",
        "|---" * (len(WAYS) + 1) + "|",
        *(f"| `{kind}` | {' | '.join(_way(ways.get(kind)) for ways in WAYS.values())} |" for kind in FAULTS),
        "\nBy its link: what the firmware is sent in each exchange has the fault. By the world: the body,",
        "the air, a link or a computer beside has it; the firmware itself has none. Parameters are set at",
        "the time of the fault and get their values back at its end; of two names the firmware has one. A",
        "fault that a program cannot be given is refused by name before the run, or, if it boots in the",
        "run, as soon as it has answered.\n",
        "## What they do\n",
        "`bench/firmware_faults.py` lets each fault strike in each phase of a flight, for good, and",
        "watches for 45 s what the vehicle does: the real program, and the simulated autopilot of the",
        "same project. All parameters are default ones but those that fit the program to the body. Times",
        "count from the fault. Whatever a flight without a fault shows, too, is left out.",
    ]
    for project in dict.fromkeys(row["project"] for row in found):
        rows = {(row["real"], row["fault"], row["phase"]): row for row in found if row["project"] == project}
        phases = dict.fromkeys(row["phase"] for row in rows.values())
        version = next(row["version"] for row in rows.values() if row["real"])
        lines += [
            f"\n### {project} {version}\n",
            f"| fault | | {' | '.join(phases)} |",
            "|---" * (len(phases) + 2) + "|",
        ]
        for fault in dict.fromkeys(row["fault"] for row in rows.values() if row["fault"] != "none"):
            for real in (True, False):
                cells = [
                    _reaction(rows[real, fault, phase], rows[real, "none", phase])
                    if (real, fault, phase) in rows and (real, "none", phase) in rows
                    else ""
                    for phase in phases
                ]
                name = f"`{fault}`" if real else ""
                lines.append(f"| {name} | {'real' if real else 'simulated'} | {' | '.join(cells)} |")
        lines += ["\nThe words of the real one, with the phase in which they came first:\n"]
        lines += [f"- `{fault}`: {said}" for fault, said in _words(rows.values()).items()]
    return "\n".join(lines) + "\n"


def _way(way: Way | LinkFrom | ByParameters | None) -> str:
    if isinstance(way, ByParameters):
        values = " times its angle in eighths of a turn" if way.unit else ""
        groups = (" or ".join(f"`{name}` {value:g}" for name, value in group) for group in way.settings)
        return ", ".join(groups) + values
    if isinstance(way, LinkFrom):
        return f"{Way.LINK.value}, from {way.major}.{way.minor} on"
    return way.value if way is not None else "refused"


NEAR_ENOUGH_M = 3.0
WORST_SEVERITY = 4


def _reaction(row: dict[str, Any], usual: dict[str, Any]) -> str:
    """Return what a vehicle did that it does not do without the fault."""
    parts = [row["broken"]] if row["broken"] else []
    modes = {mode for _, mode in usual["modes"]}
    parts += [f"{mode} after {at:.0f} s" for at, mode in row["modes"] if mode not in modes]
    if usual["flown"] and not row["flown"]:
        parts.append("does not take off")
    if row["down_s"] is not None and not row["broken"] and row["phase"] != "landing":
        parts.append(f"disarmed after {row['down_s']:.0f} s")
    if usual["down_s"] is not None and row["down_s"] is None:
        parts.append("not disarmed")
    parts = parts or ["goes on"]
    if row["estimate_off_m"] > usual["estimate_off_m"] + NEAR_ENOUGH_M and row["flown"]:
        parts.append(f"estimate off by {row['estimate_off_m']:.0f} m")
    elif row["phase"] != "cruise" and row["moved_m"] > usual["moved_m"] + NEAR_ENOUGH_M:
        parts.append(f"moved {row['moved_m']:.0f} m")
    return ", ".join(parts)


def _words(rows: Iterable[dict[str, Any]]) -> dict[str, str]:
    """Return what a real firmware says of each fault, by fault."""
    real = [row for row in rows if row["real"]]
    usual = {text for row in real if row["fault"] == "none" for _, _, text in row["texts"]}
    said: dict[str, dict[str, str]] = {}
    for row in real:
        for at, severity, text in row["texts"]:
            key = re.sub(r"[-\d.]+", "…", text.strip())
            if severity <= WORST_SEVERITY and text not in usual:
                said.setdefault(row["fault"], {}).setdefault(
                    key, f"“{text.strip()}” ({row['phase']}, {at:.0f} s)"
                )
    return {fault: "; ".join(texts.values()) for fault, texts in said.items()}


def rules() -> str:
    """The rules that a model is checked against."""
    lines = [
        "# Rules of models\n",
        "`volery model check` names the rule of each finding. A model with an error does not run.",
        "Warnings can be [suppressed](../models.md#checks) with a reason.\n",
        "| code | name | level | what it finds | remedy |",
        "|---|---|---|---|---|",
    ]
    lines += [
        f"| {one.code} | `{one.name}` | {one.level} | {one.title} | {one.remedy} |" for one in RULES.values()
    ]
    return "\n".join(lines) + "\n"


def pages() -> dict[Path, str]:
    """Return each generated file with its content."""
    reference = {
        "observables.md": MADE + observables(),
        "processors.md": MADE + processors(),
        "command-line.md": MADE + command_line(),
        **{f"{name}-parameters.md": MADE + supported_parameters(one) for name, one in FIRMWARES.items()},
        **{f"{name}-checks.md": MADE + checks(one, name) for name, one in FIRMWARES.items()},
        "conformance.md": MADE + conformance(),
        "faults.md": MADE + faults(),
        "firmware-faults.md": MADE + firmware_faults(),
        "model.md": MADE + model(),
        "ros-surface.md": MADE + ros_surface(_LIBRARIES),
        "rules.md": MADE + rules(),
        "versions.md": MADE + versions(),
        "model.schema.json": json.dumps(schema(), indent=2, ensure_ascii=False) + "\n",
    }
    return {
        **{REFERENCE / name: text for name, text in reference.items()},
        **delivery_model(),
        ROOT / "docs" / "images" / "packages.svg": package_map(),
    }


def main() -> int:
    """Write the stale files; with --check print their names and return 1."""
    stale = {
        path: text
        for path, text in pages().items()
        if not path.exists() or path.read_text(encoding="utf-8") != text
    }
    if "--check" in sys.argv:
        for path in stale:
            print(f"{path.relative_to(ROOT)} is not up to date: run 'make docs'")
        return 1 if stale else 0
    for path, text in stale.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
