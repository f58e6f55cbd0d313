"""The parameters of an autopilot: get, set, load, save and compare.

Files are those of the ground stations: ``.params`` of QGroundControl (columns for vehicle, component, name,
value and type) and ``.param`` or ``.parm`` of Mission Planner and MAVProxy (name and value). Both are read by
content; the suffix chooses what is written.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import isclose, isfinite
from pathlib import Path
from typing import NamedTuple

from volery.base.errors import UsageError, VehicleError
from volery.base.files import replace_text
from volery.vehicles.limits import is_number
from volery.vehicles.services import Parameter, Services

LARGEST_FILE = 4_000_000
QGC, PLAIN = ".params", (".param", ".parm")
SYSTEM, COMPONENT = 1, 1


class ParameterDifference(NamedTuple):
    """One parameter that differs; ``None`` where a side does not have it."""

    name: str
    here: float | None
    there: float | None


class Parameters:
    """Parameters of one vehicle, read from and written to its autopilot.

    Every call blocks until the autopilot has answered; nothing is cached: another station may change a
    parameter. Values are numbers; the autopilot's own type is kept.

    Args:
        name: name of the vehicle.
        services: services of its autopilot.
        system: MAVLink system id, for files.

    Attributes:
        converted: what the last file states under a name of another version of the firmware, by own name.
        left_alone: where the last file differs in values that the autopilot writes itself, such as counters.
    """

    def __init__(self, name: str, services: Services, system: int = SYSTEM) -> None:
        self._name = name
        self._services = services
        self._system = system or SYSTEM
        self.converted: dict[str, str] = {}
        self.left_alone: list[ParameterDifference] = []

    def get(self, name: str) -> float:
        """Return the value of one parameter.

        Raises:
            Refused: the autopilot has no such parameter; the error names the one that took its place.
            NotArrived: it does not answer.
        """
        return self._services.read_parameter(self._services.parameter_name(name)).value

    def set(self, name: str, value: float) -> None:
        """Set one parameter and return when the autopilot reports the value.

        Raises:
            UsageError: the value is no finite number.
            Refused: the autopilot has no such parameter, keeps another value, or the value does not fit its
                type.
            NotArrived: it does not answer.
        """
        if not is_number(value):
            raise UsageError(f"{self._name}: {name} = {value!r}: a parameter is a finite number")
        self._services.write_parameter(self._services.parameter_name(name), float(value))

    def all(self) -> dict[str, float]:
        """Return all parameters by name, in the autopilot's order."""
        return {name: found.value for name, found in self._services.read_parameters().items()}

    def save(self, file: str | Path) -> int:
        """Write all parameters to a file and return their number.

        Args:
            file: path that ends in .params (QGroundControl), .param or .parm (Mission Planner, MAVProxy).
        """
        path = Path(file)
        if path.suffix not in (QGC, *PLAIN):
            raise UsageError(f"{path}: end the name in .params (QGroundControl), .param or .parm")
        parameters = self._services.read_parameters()
        text = _qgc_text(parameters, self._system) if path.suffix == QGC else _plain_text(parameters)
        try:
            replace_text(path, text)
        except OSError as error:
            raise UsageError(f"{path}: cannot be written: {error.strerror}") from None
        return len(parameters)

    def load(self, file: str | Path) -> list[ParameterDifference]:
        """Set the parameters of a file that differ, and return what was changed (``here`` is the old value).

        A parameter that the autopilot refuses or does not have does not stop the others. A parameter that has
        another name in this version of the firmware is set under that, converted to its unit. Values that the
        autopilot writes itself stay as they are.

        Raises:
            VehicleError: some were not set; the error names them. The others are set.
        """
        changed, failed = [], []
        for one in self.compare(file):
            if one.there is None:
                continue
            if one.here is None:
                failed.append(f"{one.name} (the autopilot has none)")
                continue
            try:
                self.set(one.name, one.there)
            except VehicleError as error:
                failed.append(f"{one.name} ({error.what})")
            else:
                changed.append(one)
        if failed:
            raise VehicleError(
                self._name,
                f"load {file}",
                f"{len(changed)} parameters were set, {len(failed)} were not: {', '.join(failed)}",
            )
        return changed

    def compare(self, file: str | Path | Mapping[str, float]) -> list[ParameterDifference]:
        """Return where the vehicle (``here``) and a file or mapping (``there``) differ, by name.

        Parameters that only the vehicle has are left out: a file usually states a part of them. What a file
        states under a name of another version of the firmware is compared under the vehicle's own. Values
        that the autopilot writes itself, such as counters, are no settings and left out (``left_alone``).
        """
        there = file if isinstance(file, Mapping) else read_parameter_file(file)
        here = self.all()
        own, self.converted = self._under_own_names(there, here)
        found = [difference for difference in differences(here, own) if difference.there is not None]
        volatile = self._services.parameter_rules.volatile
        self.left_alone = [one for one in found if one.name in volatile and one.here is not None]
        return [one for one in found if one.name not in volatile]

    def _under_own_names(
        self, there: Mapping[str, float], here: Mapping[str, float]
    ) -> tuple[dict[str, float], dict[str, str]]:
        """Return values under the names that the vehicle has, and what was stated under others."""
        own, stated = dict(there), {}
        for name, value in there.items():
            renamed = self._services.parameter_rules.renamed.get(name)
            if renamed is None or name in here or renamed.other(name) not in here:
                continue
            del own[name]
            other = renamed.other(name)
            if other not in there:
                own[other] = renamed.converted(name, value)
                stated[other] = f"{name}={value:g}"
        return own, stated


def differences(here: Mapping[str, float], there: Mapping[str, float]) -> list[ParameterDifference]:
    """Return the parameters that differ by more than a 32-bit float does, in alphabetical order."""
    found = []
    for name in sorted({*here, *there}):
        mine, other = here.get(name), there.get(name)
        same = mine is not None and other is not None and isclose(mine, other, rel_tol=1e-6, abs_tol=1e-9)
        if not same:
            found.append(ParameterDifference(name, mine, other))
    return found


def read_parameter_file(file: str | Path) -> dict[str, float]:
    """Return the parameters of a file of QGroundControl, Mission Planner or MAVProxy.

    A file of QGroundControl may list several components, such as a gimbal; only the autopilot's rows count.

    Raises:
        UsageError: the file cannot be read; the error names the line.
    """
    path = Path(file)
    try:
        if not path.is_file():
            raise UsageError(f"{path}: there is no such file")
        if path.stat().st_size > LARGEST_FILE:
            raise UsageError(f"{path}: larger than {LARGEST_FILE} bytes; this is no file of parameters")
        lines = path.read_text(encoding="utf-8").splitlines()
    except UnicodeDecodeError:
        raise UsageError(f"{path}: no text; this is no file of parameters") from None
    except OSError as error:
        raise UsageError(f"{path}: cannot be read: {error.strerror}") from None
    found: dict[str, float] = {}
    for number, line in enumerate(lines, 1):
        name, value = _name_and_value(line)
        if name:
            try:
                found[name] = _checked(name, value, line.strip())
            except UsageError as error:
                raise UsageError(f"{path}:{number}: {error}") from None
    if not found:
        raise UsageError(f"{path}: there is no parameter of an autopilot in it (component {COMPONENT})")
    return found


def _checked(name: str, value: str, line: str) -> float:
    """Return the value that a *line* states; raise ``UsageError`` if it is none."""
    if name.startswith("@"):
        what = "is for ArduPilot's build; load that file by itself and leave the line out"
        raise UsageError(f"{line!r} {what}")
    try:
        number = float(int(value, 16)) if _HEX.fullmatch(value) else float(value)
    except ValueError:
        raise UsageError(f"{value!r} is no value of {name!r}") from None
    if not isfinite(number) or not re.fullmatch(r"[A-Za-z_][\w.\[\]>-]*", name):
        raise UsageError(f"{line!r} is no parameter and its value")
    return number


_HEX = re.compile(r"0[xX][0-9A-Fa-f]{1,16}")
"""A mask as ArduPilot's own files have it."""


def _name_and_value(line: str) -> tuple[str, str]:
    """Return what a line of a file states; an empty name for a comment or a row of another component."""
    words = re.split(r"[\s,=]+", line.split("#", 1)[0].strip())
    if len(words) != 5:
        return words[0], words[1] if len(words) > 1 else ""
    _, component, name, value, _ = words
    return ("" if component.isdigit() and int(component) != COMPONENT else name), value


def _qgc_text(found: Mapping[str, Parameter], system: int) -> str:
    rows = [f"{system}\t{COMPONENT}\t{one.name}\t{_number(one)}\t{one.type}" for one in found.values()]
    head = "# Vehicle-Id Component-Id Name Value Type"
    return "\n".join(["# Onboard parameters", "#", head, *rows, ""])


def _plain_text(found: Mapping[str, Parameter]) -> str:
    return "\n".join([*(f"{one.name},{_number(one)}" for one in found.values()), ""])


def _number(one: Parameter) -> str:
    """Return the value with the digits of a 32-bit float; whole types without a point."""
    return f"{one.value:.9g}" if one.type >= 9 else f"{one.value:.0f}"
