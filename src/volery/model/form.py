"""The text form of a model, key by key: what may stand where. References are resolved elsewhere.

These classes are the source of the JSON Schema, so their docstrings are written for those who write models.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field

from volery.model.fields import Bandwidth, Form, Frequency, Listed, Load, Loss, Name, OrNothing, Period, Time
from volery.model.form_component import ComponentForm, InstanceForm, SignatureForm
from volery.model.form_environment import EnvironmentForm


class ProcessorForm(Form):
    """A computer of a kind in the catalogue.

    `context_switch` is what it takes to put another task on a core. `load` is the share of each core that
    something else takes, before all components: `20 %`.
    """

    kind: str = Field(alias="is")
    frequency: Frequency
    cores: int | None = Field(default=None, ge=1)
    scheduler: Literal["fixed-priority", "round-robin", "fifo"] = "fixed-priority"
    quantum: Period | None = None
    context_switch: Time = 0
    load: Load = 0.0
    carried_by: str | None = None
    powered_by: str | None = None


class NetworkForm(Form):
    """Joins processors."""

    between: list[str] = Field(min_length=2)
    bandwidth: Bandwidth
    latency: Time = 0
    loss: Loss = 0.0


class PlatformForm(Form):
    """The computers and what joins them.

    `catalogues` are files with kinds of processors beside those that volery knows, such as `volery calibrate`
    writes, relative to the model.
    """

    catalogues: Annotated[list[str], Listed()] = []
    processors: dict[Name, ProcessorForm] = {}
    networks: dict[Name, NetworkForm] = {}


class AllocationForm(Form):
    """Which instance runs on which processor. A vehicle's name says where the node runs that serves it."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, str]

    extends: str | None = None
    set: dict[str, Any] = {}

    @property
    def places(self) -> dict[str, str]:
        """Instances and vehicles, and their processors."""
        return dict(self.__pydantic_extra__)


class BoundForm(Form):
    """A bound on an observed quantity: exactly one of `max` and `min`, with its unit."""

    observe: str
    max: str | int | float | None = Field(default=None, union_mode="left_to_right")
    min: str | int | float | None = Field(default=None, union_mode="left_to_right")
    description: str = ""


class RunForm(Form):
    """How long a run lasts: at most `duration`, and no longer than until a bound holds."""

    duration: Period = 900_000_000_000
    until: BoundForm | None = None


class ScenarioForm(Form):
    """Changes to the model for some runs: `set` has paths and values, later ones win."""

    extends: str | None = None
    description: str = ""
    allocation: str | None = None
    set: dict[str, Any] = {}
    duration: Period | None = None
    until: BoundForm | None = None


class ModelForm(Form):
    """A system model.

    `chains` are rows of topics by their full names, `[/drone_1/mavros/state, ...]`, whose end-to-end latency
    can be observed: `observe: NAME.latency`.
    """

    volery: Literal[1]
    name: str
    description: str = ""
    interfaces: dict[Name, Annotated[dict[Name, Annotated[SignatureForm, OrNothing()]], OrNothing()]] = {}
    components: dict[Name, ComponentForm] = {}
    application: dict[Name, InstanceForm] = {}
    platform: PlatformForm = PlatformForm()
    allocations: dict[Name, AllocationForm] = {}
    environment: EnvironmentForm = EnvironmentForm()
    scenarios: dict[Name, ScenarioForm] = {}
    chains: dict[Name, Annotated[list[str], Field(min_length=1)]] = {}
    requirements: dict[Name, BoundForm] = {}
    run: RunForm = RunForm()
