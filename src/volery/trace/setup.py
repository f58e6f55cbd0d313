"""What a run was set up with: enough, beside the events, to account for and report on it from its trace
alone.

Whoever starts a run fills it in; the trace carries it as the attachment ``run-setup.json``. It holds no wall
time and no versions, so it is the same for the same run. Order is meaning: tables list things as they stand
here.
"""

from __future__ import annotations

from dataclasses import dataclass

from pydantic import TypeAdapter

from volery.base.time import Ns
from volery.trace import attachments
from volery.trace.events import NONE

SETUP_SCHEMA = "volery-setup/1"

SETUP_ATTACHMENT = "run-setup.json"
"""The attachment of a trace that holds a ``RunSetup``."""
MODEL_ATTACHMENT = "model.yaml"
"""The attachment that holds the text of the system model."""
WORLD_ATTACHMENT = "world.json"
"""The attachment that holds the map: see ``volery.trace.scenery``."""


@dataclass(frozen=True)
class ComponentSetup:
    """A component instance and where it was allocated. ``processor`` is empty where its computing takes no
    time.

    ``period`` and ``deadline`` (relative to the release) are ``NONE`` where the model promises none.
    """

    name: str
    type: str = ""
    language: str = ""
    processor: str = ""
    active: bool = False
    period: Ns = NONE
    deadline: Ns = NONE
    priority: int = 0


@dataclass(frozen=True)
class ProcessorSetup:
    """A processor. ``idle_w`` and ``busy_w`` are watts of the whole of it, idle and with all cores busy.

    They are ``None`` where nobody stated them: then its energy is not counted. ``power_error`` is their
    relative band (0.2: within 20 per cent), ``None`` where it is unknown.
    """

    name: str
    kind: str = ""
    frequency_mhz: float = 0.0
    scheduler: str = ""
    cores: int = 1
    idle_w: float | None = None
    busy_w: float | None = None
    power_error: float | None = None


@dataclass(frozen=True)
class VehicleSetup:
    """A vehicle: ``kind`` is ``multirotor`` or ``rover``; ``autopilot`` the firmware that flies it."""

    name: str
    autopilot: str = ""
    kind: str = ""


@dataclass(frozen=True)
class ChainSetup:
    """A row of topics whose end-to-end latency is observed."""

    name: str
    topics: tuple[str, ...]


@dataclass(frozen=True)
class RequirementSetup:
    """A bound on an observed quantity; ``relation`` is ``max`` or ``min``."""

    name: str
    observable: str
    relation: str
    bound: float
    unit: str = ""


@dataclass(frozen=True)
class LawSetup:
    """A law of cost or physics that priced this run: its ``source``, provenance and what is to be warned of.

    ``provenance`` is ``estimated``, ``measured``, ``calculated`` or ``required``; ``validity`` says in words
    where the law holds; ``warning`` is empty unless the run used it outside that, or on a component it was
    not measured for.
    """

    name: str
    source: str = ""
    provenance: str = ""
    validity: str = ""
    warning: str = ""


@dataclass(frozen=True)
class RunSetup:
    """The circumstances of a run that belong to the run itself, not to the machine it ran on."""

    system: str = ""
    fidelity: str = ""
    allocation: str = ""
    scenario: str = ""
    seed: int = 0
    components: tuple[ComponentSetup, ...] = ()
    processors: tuple[ProcessorSetup, ...] = ()
    vehicles: tuple[VehicleSetup, ...] = ()
    chains: tuple[ChainSetup, ...] = ()
    requirements: tuple[RequirementSetup, ...] = ()
    laws: tuple[LawSetup, ...] = ()
    not_counted: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    schema: str = SETUP_SCHEMA


_ADAPTER = TypeAdapter(RunSetup)


def setup_to_json(setup: RunSetup) -> bytes:
    """The setup as UTF-8 JSON, the same bytes for the same setup."""
    return attachments.to_json(setup)


def setup_from_json(data: bytes) -> RunSetup:
    """The setup that ``setup_to_json`` wrote. Raises ``UsageError`` if it is anything else."""
    return attachments.from_json(data, _ADAPTER, SETUP_SCHEMA, SETUP_ATTACHMENT)
