"""The rules that a model is checked against, each with a code, its meaning and the remedy.

Every problem that ``volery model check`` reports is of one rule. Codes are stable: an editor, a CI job or a
``suppress`` entry refers to them. Where a rule is checked, and on what, is in the module that has the data:
most of them while the text is read, the others in ``volery.checks``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from volery.base.errors import Location

Level = Literal["error", "warning"]


@dataclass(frozen=True, slots=True)
class ModelRule:
    """A rule. A model that breaks one of level ``error`` does not run.

    ``suppressible`` is true for rules that a model may suppress with a reason: it can run in spite of them.
    """

    code: str
    name: str
    level: Level
    title: str
    remedy: str
    suppressible: bool = False


@dataclass(frozen=True, slots=True)
class BrokenRule:
    """A rule that a model breaks: what is wrong, at which path of the model, in which line."""

    rule: ModelRule
    what: str
    path: str = ""
    where: Location | None = None

    def __str__(self) -> str:
        return f"{self.path}: {self.what}" if self.path else self.what


RULES: dict[str, ModelRule] = {}
"""Every rule by its code."""


def _rule(code: str, name: str, title: str, remedy: str, level: Level = "error") -> ModelRule:
    rule = ModelRule(code, name, level, title, remedy, suppressible=level == "warning")
    assert code not in RULES, code
    RULES[code] = rule
    return rule


def _warning(code: str, name: str, title: str, remedy: str) -> ModelRule:
    return _rule(code, name, title, remedy, "warning")


# -- the text

NOT_A_MODEL = _rule(
    "V101",
    "not-a-model",
    "The file is not YAML, or no model.",
    "Correct the line; `volery new DIR` writes a model.",
)
DUPLICATE_KEY = _rule("V102", "duplicate-key", "A key stands twice in one mapping.", "Remove one of the two.")
UNKNOWN_KEY = _rule(
    "V103",
    "unknown-key",
    "A key that this mapping does not have.",
    "Use one of the valid keys that the message lists.",
)
MISSING_KEY = _rule("V104", "missing-key", "A key that must be stated is missing.", "Add the key.")
WRONG_VALUE = _rule(
    "V105",
    "wrong-value",
    "A value of the wrong form or outside its range.",
    "Write a value as the message says.",
)
WRONG_QUANTITY = _rule(
    "V106",
    "wrong-quantity",
    "A quantity without a unit, with a wrong unit, or outside its range.",
    "Write a number with a unit of the kind that is expected.",
)
BAD_NAME = _rule(
    "V107",
    "bad-name",
    "A name with other characters than letters, digits, _ and -.",
    "Rename it: letters, digits, _ and -, starting with a letter.",
)
TOO_LARGE = _rule(
    "V108",
    "too-large",
    "More values than a model has, or aliases that contain themselves.",
    "Repeat entries, not aliases.",
)
MISSING_FILE = _rule(
    "V109", "missing-file", "A file that the model names is not there.", "Correct the path, or add the file."
)
OUTSIDE = _rule(
    "V110",
    "outside-folder",
    "A file outside the folder of the model.",
    "Move the file into the folder, or list its folder under `files_from`.",
)
BAD_CHANGE = _rule(
    "V111",
    "bad-change",
    "A change (`set`, `--set`) of something that the model does not have.",
    "Correct the path.",
)
CIRCULAR = _rule("V112", "circular", "Something extends, includes or contains itself.", "Break the circle.")

# -- structure

UNKNOWN_NAME = _rule(
    "V201",
    "unknown-name",
    "A name that refers to nothing in the model.",
    "Use one of the names that the message lists.",
)
UNCONNECTED = _rule(
    "V202", "unconnected-port", "A required port without a provider.", "Connect the port to a provided one."
)
DOUBLY_CONNECTED = _rule(
    "V203",
    "doubly-connected-port",
    "Several providers at a port that requires one.",
    "Connect one provider, or require a list: `Name[]`.",
)
INTERFACE_MISMATCH = _rule(
    "V204",
    "interface-mismatch",
    "A connection of ports whose interfaces differ.",
    "Connect a port of the same interface, or give both the same operations.",
)
SYNCHRONOUS_CYCLE = _rule(
    "V205",
    "synchronous-cycle",
    "Calls that lead back to their caller: they would wait for themselves.",
    "Replace one by a topic.",
)
DUPLICATE_NAME = _rule("V206", "duplicate-name", "Two things of one name.", "Rename one of them.")
TOPIC_CONNECTED = _rule(
    "V207",
    "connected-topic-port",
    "A connection of a port that publishes and subscribes.",
    "Remove the connection, or give the interface operations.",
)
UNKNOWN_TYPE = _rule(
    "V208",
    "unknown-type",
    "A type of an argument that the model's `types` do not have.",
    "Declare the type under `types`.",
)

# -- allocation

UNALLOCATED = _rule(
    "V301", "unallocated", "An instance that the allocation does not place.", "Add it to the allocation."
)
ALLOCATED_ENVIRONMENT = _rule(
    "V302",
    "allocated-environment",
    "An allocation of something that runs nowhere.",
    "Remove it from the allocation.",
)
BROKEN_CHAIN = _rule(
    "V303",
    "broken-allocation-chain",
    "A memory space or an operating system that leads to no processor.",
    "Allocate it to an operating system or a processor.",
)
NO_NETWORK = _rule(
    "V304",
    "no-network",
    "A call between two computers that no network joins.",
    "Add a network, or allocate them together.",
)
AMBIGUOUS_NODE = _rule(
    "V305",
    "ambiguous-node",
    "A vehicle with several computers, and no allocation of its node.",
    "State in the allocation where the node of the vehicle runs.",
)
MEMORY_EXCEEDED = _warning(
    "V306",
    "memory-exceeded",
    "Components need more memory than their place has.",
    "Move one, or enlarge the memory.",
)

# -- times

NO_REFERENCE = _rule(
    "V401",
    "time-without-reference",
    "A time without the processor it was taken at.",
    "Add `at: {processor: …, frequency: …}`.",
)
MISSING_TIMES = _warning(
    "V402",
    "missing-times",
    "No time at a processor where fidelity `times` needs one.",
    "State the time, or use fidelity `code`.",
)
FREQUENCY_RANGE = _rule(
    "V403",
    "frequency-out-of-range",
    "A frequency outside the range of the processor.",
    "Use a frequency of the range.",
)
FREQUENCY_SETTING = _warning(
    "V404",
    "frequency-not-a-setting",
    "A frequency that the processor cannot be set to.",
    "Use the nearest setting.",
)
OVERLOAD = _warning(
    "V405",
    "overload",
    "Periodic components need more than all cores of their processor.",
    "Move one, or lengthen a period.",
)
TIME_ORDER = _rule(
    "V406", "time-order", "A best time above the mean, or a mean above the worst.", "Order the three times."
)
DEADLINE_PERIOD = _warning(
    "V407",
    "deadline-beyond-period",
    "A deadline later than the next release.",
    "Shorten the deadline, or suppress the rule if releases may overlap.",
)
TOO_MANY_CORES = _rule(
    "V408", "too-many-cores", "More cores than the processor has.", "Use as many as the message says."
)

# -- ROS

NODE_CLASH = _rule(
    "V501",
    "node-name-clash",
    "Two ROS nodes of one full name.",
    "Give one of them a namespace or another name.",
)
TOPIC_TYPES = _rule(
    "V502",
    "topic-type-mismatch",
    "A topic that is published and subscribed with different types.",
    "Use one type.",
)
NOT_PUBLISHED = _warning(
    "V503",
    "topic-not-published",
    "A topic that components subscribe to, or a chain names, and none publishes.",
    "Correct the name or the `remap`, or suppress the rule if another program publishes it.",
)
BAD_ROS_NAME = _rule(
    "V504",
    "bad-ros-name",
    "A topic or namespace that is no name in ROS.",
    "Letters, digits, _ and /, no digit after a /.",
)

NOT_SUBSCRIBED = _warning(
    "V505",
    "topic-not-subscribed",
    "A topic of a chain that no component subscribes to.",
    "Correct the name or the `remap`, or end the chain before it.",
)

# -- requirements

UNKNOWN_OBSERVABLE = _rule(
    "V601",
    "unknown-observable",
    "A bound on something that is not observed.",
    "See `volery model observables`.",
)
BAD_BOUND = _rule(
    "V602", "bad-bound", "A bound with neither or both of max and min.", "State exactly one of max and min."
)
UNREACHABLE = _warning(
    "V603",
    "unreachable-requirement",
    "A requirement that no run can meet, that every run meets, or of which nothing is observed.",
    "Correct the subject, the bound, the number of orders, or the duration of the run.",
)

# -- code

NO_CODE = _warning("V701", "no-code", "A component without code: fidelity `code` needs it.", "Add a `path`.")
NO_TOOL_CHAIN = _warning(
    "V703",
    "no-tool-chain",
    "A language whose compiler or client library is not on this machine.",
    "Install it; `volery doctor` prints how.",
)
CODE_MISMATCH = _rule(
    "V704",
    "code-mismatch",
    "The class in a component's file does not fit its ports.",
    "Change the class, or the model.",
)

UNWRITTEN_CODE = _warning(
    "V705",
    "unwritten-code",
    "A component whose file is not there: everything but a run works without it.",
    "Correct the path, or write the file; without `path`, stated times run.",
)

NO_FIRMWARE = _rule(
    "V706",
    "no-firmware",
    "Real firmware that is not on this machine, or that does not fly in virtual time.",
    "Correct the program; `volery doctor` prints how one is built.",
)

UNFIT_FMU = _rule(
    "V707",
    "unfit-fmu",
    "An FMU that cannot move its vehicle on this machine.",
    "Export it as the message says, or name its variables below `body`.",
)

# -- models of other tools

NOT_MAPPED = _warning(
    "V901",
    "not-mapped",
    "Something in a UML file that a model of volery does not have.",
    "Change the file, or import it and state the rest in YAML.",
)

# -- the model's own statements about rules

BAD_SUPPRESSION = _rule(
    "V801",
    "bad-suppression",
    "A suppression of a rule that does not exist or that cannot be suppressed.",
    "Name a rule of level `warning`, with a reason.",
)
IDLE_SUPPRESSION = _warning(
    "V802", "idle-suppression", "A suppression of something that is not reported.", "Remove the suppression."
)


def find(text: str) -> ModelRule | None:
    """Return the rule of a code or a name, None if there is none."""
    return RULES.get(text) or next((one for one in RULES.values() if one.name == text), None)
