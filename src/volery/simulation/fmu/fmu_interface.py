"""What an FMU has of what moves a body: the checks before a run, and the variables that are exchanged.

An FMU that an optional quantity is not found in lacks it; a name that the model states must be there.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import prod
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import BadZipFile, ZipFile

from volery.base.errors import UsageError, choices, did_you_mean
from volery.base.installed import require_extra
from volery.model.fmu_bodies import Fmu
from volery.simulation.world.state_layout import STEP_S

INPUTS = {"commands": 0, "wind": 3, "ground": 1, "voltage": 1, "load": 1, "push": 3}
"""Number of values of each input; 0: one for each motor."""
OUTPUTS = {
    "position": 3,
    "velocity": 3,
    "attitude": 4,
    "angles": 3,
    "rates": 3,
    "specific_force": 3,
    "rotor_speeds": 0,
    "current": 1,
}
"""The same of each output."""
_REQUIRED = ("commands", "position", "velocity", "rates")
_REALS = ("Real", "Float64")
_SETTABLE = {"Real": float, "Float64": float, "Integer": int, "Int32": int, "Boolean": bool}
_SHOWN = 12


class Exchanged(NamedTuple):
    """Quantities that are exchanged, in their order.

    Args:
        widths: Number of values by quantity.
        references: Value references, of scalars or arrays.
    """

    widths: Mapping[str, int]
    references: tuple[int, ...]

    @property
    def size(self) -> int:
        """Number of all values."""
        return sum(self.widths.values())


class FmuInterface(NamedTuple):
    """An FMU that can move a body.

    Args:
        file: The FMU.
        version: Version of FMI: 2 or 3.
        identifier: Name of its machine code.
        token: Its guid.
        inputs: What it takes.
        outputs: What it gives; ``attitude`` or ``angles``, not both.
        parameters: Type, value reference and value of each parameter to set.
    """

    file: Path
    version: int
    identifier: str
    token: str
    inputs: Exchanged
    outputs: Exchanged
    parameters: tuple[tuple[str, int, float | bool], ...]


def read_interface(fmu: Fmu, rotors: int) -> FmuInterface:
    """Read the description of an FMU and find the variables that move a body.

    Args:
        fmu: The FMU as a model states it.
        rotors: Number of motors.

    Raises:
        UsageError: It cannot move such a body on this machine; the text names the FMU and what to do.
    """
    require_extra("fmi", "an FMU as a body")
    description, members = _description(fmu.file)
    version = int(description.fmiVersion[0])
    if version not in (2, 3):
        raise UsageError(f"{fmu.file}: FMI {description.fmiVersion}; export it for FMI 2 or 3")
    if description.coSimulation is None:
        raise UsageError(f"{fmu.file} is for model exchange only; export it for co-simulation")
    identifier = description.coSimulation.modelIdentifier
    _check_binary(fmu.file, version, identifier, members)
    _check_step(fmu.file, description)
    finder = _Finder(fmu, rotors, description)
    inputs, outputs = finder.exchanged(INPUTS), finder.exchanged(OUTPUTS)
    finder.check()
    parameters = tuple(finder.parameters())
    return FmuInterface(fmu.file, version, identifier, description.guid, inputs, outputs, parameters)


def _description(file: Path) -> tuple[Any, list[str]]:
    """Return FMPy's description of an FMU, and the names of what is in it."""
    from fmpy import read_model_description  # noqa: PLC0415  # needs an extra
    from fmpy.model_description import ValidationError  # noqa: PLC0415

    try:
        with ZipFile(file) as archive:
            members = archive.namelist()
        return read_model_description(str(file)), members
    except OSError as error:
        raise UsageError(f"{file}: {error.strerror or error}") from error
    except (BadZipFile, KeyError):
        raise UsageError(f"{file} is no FMU: an FMU is a zip archive with a modelDescription.xml") from None
    except ValidationError as error:
        raise UsageError(f"{file}: its modelDescription.xml is not valid: {error.problems[0]}") from None
    except Exception as error:  # FMPy raises whatever its parser does
        raise UsageError(f"{file}: its modelDescription.xml cannot be read: {error}") from error


def _check_binary(file: Path, version: int, identifier: str, members: list[str]) -> None:
    import fmpy  # noqa: PLC0415  # needs an extra

    platform = fmpy.platform if version == 2 else fmpy.platform_tuple
    if f"binaries/{platform}/{identifier}{fmpy.sharedLibraryExtension}" in members:
        return
    there = sorted({name.split("/")[1] for name in members if name.startswith("binaries/") and name[9:]})
    has = f"it has {choices(there)}" if there else "it has no machine code"
    raise UsageError(f"{file} cannot run on this computer, which is {platform}: {has}; export it for that")


def _check_step(file: Path, description: Any) -> None:
    fixed = description.coSimulation.fixedInternalStepSize
    if fixed and abs(STEP_S / float(fixed) - round(STEP_S / float(fixed))) > 1e-6:
        raise UsageError(
            f"{file} steps by {float(fixed):g} s inside; the world steps by {STEP_S:g} s: export it with "
            f"that, or with a whole part of it"
        )


class _Finder:
    """Finds the variables of an FMU by the names of a model, and collects what is wrong."""

    def __init__(self, fmu: Fmu, rotors: int, description: Any) -> None:
        self._fmu, self._rotors = fmu, rotors
        self._variables = {one.name: one for one in description.modelVariables}
        self._stated = fmu.variables.stated()
        self._problems: list[str] = []
        self._found: set[str] = set()

    def exchanged(self, quantities: Mapping[str, int]) -> Exchanged:
        """Return those of the quantities that the FMU has."""
        widths: dict[str, int] = {}
        references: list[int] = []
        for quantity, stated in quantities.items():
            if quantity == "angles" and "attitude" in widths:
                continue
            width = stated or self._rotors
            names = getattr(self._fmu.variables, quantity)
            variables = self._variables_of(quantity, names, width)
            if variables:
                widths[quantity] = width
                references.extend(variable.valueReference for variable in variables)
        self._found |= widths.keys()
        return Exchanged(widths, tuple(references))

    def check(self) -> None:
        """Raise ``UsageError`` if something is missing or does not fit."""
        missing = [one for one in _REQUIRED if one not in self._found and one not in self._stated]
        if not self._found & {"attitude", "angles"} and not self._stated & {"attitude", "angles"}:
            missing.append("attitude or angles")
        if missing:
            ends = {"inputs": "input", "outputs": "output"}
            has = "; ".join(f"its {plural} are {self._names(one)}" for plural, one in ends.items())
            self._problems.append(
                f"has no variable for {', '.join(missing)}; name it below `variables`: {has}"
            )
        if self._problems:
            raise UsageError("; ".join(f"{self._fmu.file} {problem}" for problem in self._problems))

    def parameters(self) -> Iterator[tuple[str, int, float | bool]]:
        """Yield type, value reference and value of each parameter that the model sets."""
        for name, value in self._fmu.parameters.items():
            variable = self._variables.get(name)
            if variable is None or variable.causality not in ("parameter", "structuralParameter"):
                there = [
                    variable.name
                    for variable in self._variables.values()
                    if variable.causality == "parameter"
                ]
                raise UsageError(f"{self._fmu.file} has no parameter {name!r}{did_you_mean(name, there)}")
            made = _SETTABLE.get(variable.type)
            if made is None or made(value) != value:
                raise UsageError(
                    f"{self._fmu.file}: {name} is {variable.type}; it cannot be set to {value:g}"
                )
            yield variable.type, variable.valueReference, made(value)

    def _names(self, causality: str) -> str:
        names = [variable.name for variable in self._variables.values() if variable.causality == causality]
        more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
        return (", ".join(names[:_SHOWN]) or "none") + more

    def _variables_of(self, quantity: str, names: tuple[str, ...], width: int) -> list[Any]:
        """Return the scalars, or the array, of a quantity; none if it is not there."""
        if len(names) == 1 and width > 1 and not self._is_array(names[0]):
            names = tuple(f"{names[0]}[{place}]" for place in range(1, width + 1))
        elif len(names) not in (1, width):
            self._problems.append(
                f"needs {width} names for {quantity}, or one; the model states {len(names)}"
            )
            return []
        absent = [name for name in names if name not in self._variables]
        if absent:
            if quantity in self._stated:
                hint = did_you_mean(absent[0], self._variables)
                self._problems.append(f"has no variable {absent[0]!r} for {quantity}{hint}")
            return []
        variables = [self._variables[name] for name in names]
        problem = self._misfit(quantity, variables, width)
        if problem:
            self._problems.append(problem)
        return [] if problem else variables

    def _is_array(self, name: str) -> bool:
        return name in self._variables and bool(self._variables[name].shape)

    def _misfit(self, quantity: str, variables: list[Any], width: int) -> str:
        """Return what does not fit about the variables of a quantity; empty: nothing."""
        for one in variables:
            if one.type not in _REALS:
                return f"has {one.name} as {one.type}; {quantity} needs {' or '.join(_REALS)}"
            if (one.causality == "input") != (quantity in INPUTS):
                end = "input" if quantity in INPUTS else "output"
                return f"has {one.name} as {one.causality}; {quantity} is an {end}"
        if sum(prod(variable.shape or ()) for variable in variables) != width:
            return f"gives {quantity} another number of values than {width}"
        return ""
