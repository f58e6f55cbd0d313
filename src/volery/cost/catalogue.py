"""The catalogue of processors: data with provenance, read from ``catalogue.yaml`` and from a user's files."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from volery.base.errors import EstimateError, ModelError, choices, did_you_mean
from volery.base.files import read_text
from volery.base.installed import require_extra
from volery.cost.code_laws import CodeLaw, CoreLaw, check_range
from volery.cost.figures import PowerLaw, WithProvenance
from volery.cost.ros_law import RosLaw

ROSCPP = "roscpp"


class Settings(WithProvenance):
    """The frequencies that a processor can be set to (its DVFS set), in equal steps."""

    least_mhz: float = Field(gt=0)
    greatest_mhz: float = Field(gt=0)
    step_mhz: float = Field(gt=0)

    def mhz(self) -> tuple[float, ...]:
        """Return all of them in MHz, ascending."""
        count = round((self.greatest_mhz - self.least_mhz) / self.step_mhz)
        return tuple(self.least_mhz + number * self.step_mhz for number in range(count + 1))


class ListPrice(BaseModel):
    """A price of one piece, in a currency of ISO 4217; ``source`` is the basis where it is ``estimated``."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)

    amount: float = Field(ge=0)
    currency: str = Field(pattern="^[A-Z]{3}$")
    year: int
    source: str
    estimated: bool = False


class Supply(BaseModel):
    """Power that a supply must give [W]: no law of what is drawn."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)

    watts: float = Field(gt=0)
    source: str
    estimated: bool = False


class HardwareEntry(BaseModel):
    """Price and supply of a part that is no processor."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)

    price: ListPrice
    supply: Supply | None = None


class ProcessorEntry(BaseModel):
    """One kind of processor: its cores, the frequency range of its laws, its settings, its laws.

    A law is absent where there are no figures.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)

    name: str
    description: str
    source: str
    cores: int
    least_mhz: float
    greatest_mhz: float
    settings: Settings | None = None
    price: ListPrice | None = None
    supply: Supply | None = None
    power: PowerLaw | None = None
    ros: dict[str, RosLaw] = {}
    code: dict[str, CodeLaw] = {}
    core_model: CoreLaw | None = None

    def check_frequency(self, frequency_mhz: float) -> None:
        """Raise ``EstimateError`` for a frequency outside the range of the laws."""
        check_range(self.name, frequency_mhz, self.least_mhz, self.greatest_mhz)

    def set_to(self) -> tuple[float, ...]:
        """Return the settings within the range of the laws, in MHz; empty where they are not known."""
        known = self.settings.mhz() if self.settings else ()
        return tuple(one for one in known if self.least_mhz <= one <= self.greatest_mhz)

    def ros_law(self, language: str) -> RosLaw:
        """Return the law of ROS calls for nodes of a client library.

        Where only roscpp's figures exist they are used, and the law's ``charged_as`` says so.

        Args:
            language: ``roscpp``, ``rospy`` or ``rclpy``.

        Raises:
            EstimateError: There are no figures.
        """
        law = self.ros.get(language) or self.ros.get(ROSCPP)
        if law is None:
            raise EstimateError(
                f"{self.name}: the catalogue has no figures of ROS calls for it; allocate ROS nodes to "
                "a processor that has some, or measure them there: "
                f"volery cost calibrate ros --client {language}"
            )
        charged_as = "" if law.client == language else language
        return law.model_copy(update={"processor": self.name, "charged_as": charged_as})

    def power_law(self) -> PowerLaw:
        """Return the law of electrical power; raise ``EstimateError`` without figures."""
        if self.power is None:
            raise EstimateError(f"{self.name}: the catalogue has no power figures for it")
        return self.power

    def code_law(self, language: str = "python") -> CodeLaw:
        """Return the law of counted code; raise ``EstimateError`` without figures."""
        law = self.code.get(language)
        if law is None:
            raise EstimateError(
                f"{self.name}: the catalogue has no figure for counted {language} code"
                f" (there is one for {choices(self.code)}); state times and run with fidelity 'times'"
            )
        return law.model_copy(update={"processor": self.name})

    def core_law(self) -> CoreLaw:
        """Return the law of compiled code; raise ``EstimateError`` without figures."""
        if self.core_model is None:
            raise EstimateError(
                f"{self.name}: the catalogue has no figures of compiled code for it; "
                "volery cost calibrate processor measures them there"
            )
        return self.core_model.model_copy(update={"name": self.name})


class Catalogue(BaseModel):
    """Processors by the name of their kind, and prices of other hardware by what it is."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)

    processors: dict[str, ProcessorEntry]
    hardware: dict[str, HardwareEntry] = {}

    def processor(self, kind: str) -> ProcessorEntry:
        """Return the entry of a kind; raise ``EstimateError`` with the valid names if there is none."""
        entry = self.processors.get(kind)
        if entry is None:
            hint = did_you_mean(kind, self.processors)
            raise EstimateError(
                f"no processor {kind!r} in the catalogue{hint}; there is {choices(self.processors)}"
            )
        return entry


def parse_catalogue(text: str, name: str = "catalogue") -> Catalogue:
    """Parse a catalogue from YAML text; raise ``ModelError`` naming the place of what is wrong."""
    require_extra("model", "catalogues of processors")
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        data = YAML(typ="safe").load(text)
    except (YAMLError, RecursionError) as error:
        raise ModelError(f"not YAML: {error}", name) from error
    entries = data.get("processors", {}) if isinstance(data, dict) else {}
    for kind, entry in entries.items():
        if isinstance(entry, dict):
            entry.setdefault("name", kind)
    try:
        return Catalogue.model_validate(data)
    except ValidationError as error:
        wrong = sorted(error.errors(), key=lambda one: one["type"] != "extra_forbidden")  # typos first
        what = "; ".join(f"{'.'.join(map(str, one['loc']))}: {one['msg']}" for one in wrong[:3])
        raise ModelError(what, name) from error


def read_catalogue(file: Path) -> Catalogue:
    """Read a user's catalogue; raise ``ModelError`` if it is missing or wrong."""
    try:
        text = read_text(file)
    except (OSError, UnicodeDecodeError) as error:
        raise ModelError(f"{file}: this catalogue cannot be read: {error}") from error
    return parse_catalogue(text, str(file))


def load_catalogue(*more: Path) -> Catalogue:
    """Return the catalogue that comes with volery, extended by files.

    An entry of an existing name adds its laws to that entry, in place of those of the same library or
    language.

    Args:
        more: Catalogues of the user, in order.

    Raises:
        ModelError: A file cannot be read or is wrong.
    """
    shipped = _shipped_catalogue()
    found, hardware = dict(shipped.processors), dict(shipped.hardware)
    for file in more:
        read = read_catalogue(file)
        hardware |= read.hardware
        for name, entry in read.processors.items():
            found[name] = _merge_entries(found[name], entry) if name in found else entry
    return Catalogue(processors=found, hardware=hardware)


@cache
def _shipped_catalogue() -> Catalogue:
    text = files("volery.cost").joinpath("catalogue.yaml").read_text(encoding="utf-8")
    return parse_catalogue(text, "catalogue.yaml")


def _merge_entries(known: ProcessorEntry, new: ProcessorEntry) -> ProcessorEntry:
    return known.model_copy(
        update={
            "ros": {**known.ros, **new.ros},
            "code": {**known.code, **new.code},
            "least_mhz": min(known.least_mhz, new.least_mhz),
            "greatest_mhz": max(known.greatest_mhz, new.greatest_mhz),
            "price": new.price or known.price,
            "supply": new.supply or known.supply,
            "power": new.power or known.power,
            "settings": new.settings or known.settings,
            "core_model": new.core_model or known.core_model,
        }
    )
