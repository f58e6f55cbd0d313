"""The text form of interfaces, components and their instances."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import ConfigDict, Field

from volery.model.fields import (
    Energy,
    Form,
    Frequency,
    Listed,
    Name,
    Parameters,
    Period,
    Provenance,
    Switch,
    Time,
)

Language = Literal["python", "rospy", "rclpy", "c++", "roscpp", "rclcpp"]


class SignatureForm(Form):
    """An operation: its arguments by name with their types, and what it returns."""

    args: dict[Name, str] = {}
    returns: str = ""


class ReferenceForm(Form):
    """The processor of the catalogue and the frequency that a figure was stated at."""

    processor: str
    frequency: Frequency


class FigureForm(Form):
    """What an operation takes; scaled to other frequencies of the same processor, not to another."""

    time: Time
    energy: Energy | None = None
    at: ReferenceForm | None = None
    provenance: Provenance = "estimated"


class ActivityForm(Form):
    """An active component's own flow of control. A greater priority is more urgent."""

    period: Period | None = None
    deadline: Period | None = None
    priority: int = 0
    start: Time = 0


class BuildForm(Form):
    """How C++ is compiled: options for the compiler, and libraries by the names that follow `-l`."""

    flags: Annotated[list[str], Listed()] = []
    libraries: Annotated[list[str], Listed()] = []


class ComponentForm(Form):
    """A kind of component: its language and file, its ports, and what it takes in fidelity `times`."""

    language: Language
    path: str = ""
    class_name: str = Field(default="", alias="class")
    build: BuildForm = BuildForm()
    provides: dict[Name, str] = {}
    requires: dict[Name, str] = {}
    parameters: Parameters = {}
    active: Annotated[ActivityForm | None, Switch()] = None
    at: ReferenceForm | None = None
    operations: dict[Name, Annotated[list[FigureForm], Listed()]] = {}
    activation: Annotated[list[FigureForm], Listed()] = []


Targets = Annotated[list[str], Listed()]


class InstanceForm(Form):
    """A component that exists. Every other key is a required port: `routes: planner.paths`."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Targets]

    component: str = Field(alias="is")
    parameters: Parameters = {}
    active: Annotated[ActivityForm | None, Switch()] = None
    namespace: str = "/"
    remap: dict[str, str] = {}

    @property
    def ports(self) -> dict[str, list[str]]:
        """Required ports and the texts of what they are connected to."""
        return dict(self.__pydantic_extra__)
