"""The catalogue of processors: data with provenance, read from ``catalogue.yaml``."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

from pydantic import BaseModel, ConfigDict, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from volery.base.errors import EstimateError, ModelError, choices, did_you_mean
from volery.cost.code import CodeLaw
from volery.cost.energy import PowerLaw
from volery.cost.figure import Figure
from volery.cost.ros import RosLaw

__all__ = ["Catalogue", "Figure", "ProcessorEntry", "catalogue", "read"]

ROSCPP = "roscpp"


class ProcessorEntry(BaseModel):
    """One kind of processor.

    Its cores, the frequencies it runs at, and its laws as far as there are figures.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    description: str
    source: str
    cores: int
    least_mhz: float
    greatest_mhz: float
    power: PowerLaw | None = None
    ros: dict[str, RosLaw] = {}
    code: dict[str, CodeLaw] = {}

    def check_frequency(self, frequency_mhz: float) -> None:
        """``EstimateError`` for a frequency outside the range that the laws of this processor hold for."""
        if not self.least_mhz <= frequency_mhz <= self.greatest_mhz:
            raise EstimateError(
                f"{self.name}: {frequency_mhz:g} MHz is outside the range of its laws, "
                f"{self.least_mhz:g} to {self.greatest_mhz:g} MHz"
            )

    def ros_law(self, language: str) -> RosLaw:
        """The law of ROS calls for nodes written in *language* (``roscpp``, ``rospy``, ``rclpy``).

        Where only roscpp's figures exist they are used, and the law's ``charged_as`` says so.
        ``EstimateError`` if there are none at all.
        """
        law = self.ros.get(language) or self.ros.get(ROSCPP)
        if law is None:
            raise EstimateError(
                f"{self.name}: the catalogue has no figures of ROS calls for it; allocate ROS nodes to a "
                f"processor that has some, or add them (measure each call's process time at two frequencies)"
            )
        charged_as = "" if law.client == language else language
        return law.model_copy(update={"processor": self.name, "charged_as": charged_as})

    def power_law(self) -> PowerLaw:
        """The law of its power; ``EstimateError`` if there are no figures."""
        if self.power is None:
            raise EstimateError(f"{self.name}: the catalogue has no power figures for it")
        return self.power

    def code_law(self, language: str = "python") -> CodeLaw:
        """The law of counted code; ``EstimateError`` if there are no figures."""
        law = self.code.get(language)
        if law is None:
            raise EstimateError(
                f"{self.name}: the catalogue has no figure for counted {language} code"
                f" (there is one for {choices(self.code)}); state times and run with fidelity 'times'"
            )
        return law.model_copy(update={"processor": self.name})


class Catalogue(BaseModel):
    """Processors by the name of their kind."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    processors: dict[str, ProcessorEntry]

    def processor(self, kind: str) -> ProcessorEntry:
        """The entry of a kind; ``EstimateError`` with the valid names if there is none."""
        entry = self.processors.get(kind)
        if entry is None:
            hint = did_you_mean(kind, self.processors)
            raise EstimateError(
                f"no processor {kind!r} in the catalogue{hint}; there is {choices(self.processors)}"
            )
        return entry


def read(text: str, name: str = "catalogue") -> Catalogue:
    """A catalogue from YAML text. ``ModelError`` names the place of what is wrong."""
    try:
        data = YAML(typ="safe").load(text)
    except YAMLError as error:
        raise ModelError(f"not YAML: {error}", name) from error
    entries = data.get("processors", {}) if isinstance(data, dict) else {}
    for kind, entry in entries.items():
        if isinstance(entry, dict):
            entry.setdefault("name", kind)
    try:
        return Catalogue.model_validate(data)
    except ValidationError as error:
        wrong = sorted(error.errors(), key=lambda one: one["type"] != "extra_forbidden")  # typos first
        said = "; ".join(f"{'.'.join(map(str, one['loc']))}: {one['msg']}" for one in wrong[:3])
        raise ModelError(said, name) from error


@cache
def catalogue() -> Catalogue:
    """The catalogue that comes with volery."""
    text = files("volery.cost").joinpath("catalogue.yaml").read_text(encoding="utf-8")
    return read(text, "catalogue.yaml")
