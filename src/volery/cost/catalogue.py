"""The catalogue of processors: data with provenance, read from ``catalogue.yaml``."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from volery.base.errors import EstimateError, ModelError, choices, did_you_mean
from volery.cost.code_laws import CodeLaw, CoreLaw
from volery.cost.figures import Figure, PowerLaw, WithProvenance
from volery.cost.ros_law import RosLaw

__all__ = ["Catalogue", "Figure", "ProcessorEntry", "Settings", "load_catalogue", "parse_catalogue"]

ROSCPP = "roscpp"


class Settings(WithProvenance):
    """The frequencies that a processor can be set to (its DVFS set), in equal steps."""

    least_mhz: float = Field(gt=0)
    greatest_mhz: float = Field(gt=0)
    step_mhz: float = Field(gt=0)

    def mhz(self) -> tuple[float, ...]:
        """All of them, ascending."""
        count = round((self.greatest_mhz - self.least_mhz) / self.step_mhz)
        return tuple(self.least_mhz + number * self.step_mhz for number in range(count + 1))


class ProcessorEntry(BaseModel):
    """One kind of processor.

    Its cores, the range of frequencies that its laws hold for, the ``settings`` it has where they are known,
    and its laws as far as there are figures.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    description: str
    source: str
    cores: int
    least_mhz: float
    greatest_mhz: float
    settings: Settings | None = None
    power: PowerLaw | None = None
    ros: dict[str, RosLaw] = {}
    code: dict[str, CodeLaw] = {}
    core_model: CoreLaw | None = None

    def check_frequency(self, frequency_mhz: float) -> None:
        """``EstimateError`` for a frequency outside the range that the laws of this processor hold for."""
        if not self.least_mhz <= frequency_mhz <= self.greatest_mhz:
            raise EstimateError(
                f"{self.name}: {frequency_mhz:g} MHz is outside the range of its laws, "
                f"{self.least_mhz:g} to {self.greatest_mhz:g} MHz"
            )

    def set_to(self) -> tuple[float, ...]:
        """The settings within the range of its laws, in MHz; empty where they are not known."""
        known = self.settings.mhz() if self.settings else ()
        return tuple(one for one in known if self.least_mhz <= one <= self.greatest_mhz)

    def ros_law(self, language: str) -> RosLaw:
        """The law of ROS calls for nodes written in *language* (``roscpp``, ``rospy``, ``rclpy``).

        Where only roscpp's figures exist they are used, and the law's ``charged_as`` says so.
        ``EstimateError`` if there are none at all.
        """
        law = self.ros.get(language) or self.ros.get(ROSCPP)
        if law is None:
            raise EstimateError(
                f"{self.name}: the catalogue has no figures of ROS calls for it; allocate ROS nodes to a "
                f"processor that has some, or measure them there: volery calibrate ros --client {language}"
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

    def core_law(self) -> CoreLaw:
        """The law of compiled code; ``EstimateError`` if there are no figures."""
        if self.core_model is None:
            raise EstimateError(
                f"{self.name}: the catalogue has no figures of compiled code for it; "
                "volery calibrate processor measures them there"
            )
        return self.core_model.model_copy(update={"name": self.name})


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


def parse_catalogue(text: str, name: str = "catalogue") -> Catalogue:
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


def load_catalogue(*more: Path) -> Catalogue:
    """The catalogue that comes with volery, and the entries of the files *more*.

    An entry of a name that is there already adds its laws to it, in place of those of the same library or
    language. ``ModelError`` names a file that cannot be read, and the place in it of what is wrong.
    """
    found = dict(_shipped_catalogue().processors)
    for file in more:
        for name, entry in read_catalogue(file).processors.items():
            found[name] = _merge_entries(found[name], entry) if name in found else entry
    return Catalogue(processors=found)


@cache
def _shipped_catalogue() -> Catalogue:
    text = files("volery.cost").joinpath("catalogue.yaml").read_text(encoding="utf-8")
    return parse_catalogue(text, "catalogue.yaml")


def _merge_entries(known: ProcessorEntry, new: ProcessorEntry) -> ProcessorEntry:
    laws = {"ros": {**known.ros, **new.ros}, "code": {**known.code, **new.code}}
    reach = {
        "least_mhz": min(known.least_mhz, new.least_mhz),
        "greatest_mhz": max(known.greatest_mhz, new.greatest_mhz),
    }
    return known.model_copy(
        update={
            **laws,
            **reach,
            "power": new.power or known.power,
            "settings": new.settings or known.settings,
            "core_model": new.core_model or known.core_model,
        }
    )


def read_catalogue(file: Path) -> Catalogue:
    """A user's catalogue. ``ModelError`` if there is no such file, or for what is wrong in it."""
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ModelError(f"{file}: this catalogue cannot be read: {error}") from error
    return parse_catalogue(text, str(file))
