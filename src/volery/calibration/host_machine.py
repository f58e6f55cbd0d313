"""The computer that is calibrated: its name, cores and frequency, and its entry in the user's catalogue."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import Any

from ruamel.yaml import YAML

from volery.base.errors import UsageError
from volery.cost import WithProvenance, parse_catalogue

CPUINFO = Path("/proc/cpuinfo")
CPUS = Path("/sys/devices/system/cpu")
TOLERANCE = 0.02
"""Greatest relative difference between a stated frequency and the one that the machine reports."""


@dataclass(frozen=True)
class Machine:
    """A computer: a short name for models, the processor's own description, cores, frequency in MHz."""

    name: str
    description: str
    cores: int
    frequency_mhz: float


def this_machine(name: str = "", cpuinfo: Path = CPUINFO, catalogue: Path | None = None) -> Machine:
    """Return this computer as Linux describes it.

    A computer whose frequency cannot be fixed reports another one at each look. So that all its laws hold
    together, the frequency is that of its entry in the catalogue, once there is one.

    Args:
        name: Name for models; by default it is made from the description.
        cpuinfo: File with the description.
        catalogue: File that the entry of the computer is written to.

    Raises:
        UsageError: There is no description, or no frequency in it.
    """
    try:
        text = cpuinfo.read_text(encoding="utf-8")
    except OSError as error:
        raise UsageError(f"calibrating needs Linux: {cpuinfo} cannot be read: {error.strerror}") from error
    described = re.search(r"^(?:model name|Model)\s*:\s*(.+)$", text, re.MULTILINE)
    description = " ".join(described[1].split()) if described else "a processor without a name"
    reported = [float(one) for one in re.findall(r"^cpu MHz\s*:\s*([\d.]+)", text, re.MULTILINE)]
    mhz = median(reported) if reported else _scaled_mhz()
    plain = re.sub(r"\((?:R|TM)\)|@.*| CPU| Processor", "", description)
    short = re.sub(r"[^a-z0-9]+", "-", plain.lower()).strip("-")
    machine = Machine(name or short, description, os.cpu_count() or 1, float(round(mhz)))
    return replace(machine, frequency_mhz=_entry_mhz(catalogue, machine) or machine.frequency_mhz)


def _entry_mhz(catalogue: Path | None, machine: Machine) -> float | None:
    """Return the frequency of the machine's entry; None if there is none, or several frequencies."""
    if catalogue is None or not catalogue.exists():
        return None
    entry = parse_catalogue(catalogue.read_text(encoding="utf-8"), str(catalogue)).processors.get(
        machine.name
    )
    if entry is None or entry.description != machine.description or entry.least_mhz != entry.greatest_mhz:
        return None
    return entry.least_mhz


def _scaled_mhz() -> float:
    try:
        return int((CPUS / "cpu0/cpufreq/scaling_cur_freq").read_text(encoding="ascii")) / 1000.0
    except (OSError, ValueError) as error:
        raise UsageError("this machine does not report its frequency; state it: --frequency") from error


@contextmanager
def at_frequency(machine: Machine, wanted_mhz: float | None, cpus: Path = CPUS) -> Iterator[float]:
    """Keep all cores at a frequency for the duration of the context.

    Args:
        machine: The computer.
        wanted_mhz: Frequency, MHz; None for the present one.
        cpus: Folder of the cores' settings.

    Yields:
        The frequency, MHz.

    Raises:
        UsageError: The frequency cannot be set.
    """
    wanted = machine.frequency_mhz if wanted_mhz is None else wanted_mhz
    limits = sorted(cpus.glob("cpu[0-9]*/cpufreq/scaling_m[ai][xn]_freq"))
    if not limits or wanted_mhz is None:
        if abs(wanted - machine.frequency_mhz) > TOLERANCE * machine.frequency_mhz:
            raise UsageError(
                f"this machine runs at {machine.frequency_mhz:g} MHz, and its frequency cannot be set here "
                f"(no {cpus}/cpu0/cpufreq); calibrate at that one, without --frequency"
            )
        yield wanted
        return
    before = {file: file.read_text(encoding="ascii") for file in limits}
    try:
        _set(limits, str(round(wanted * 1000.0)))
        yield wanted
    finally:
        for _ in range(2):  # a minimum above the maximum is refused; the second pass succeeds
            for file, value in before.items():
                _write(file, value)


def _set(limits: list[Path], khz: str) -> None:
    for _ in range(2):
        for file in limits:
            _write(file, khz)
    refused = [file for file in limits if file.read_text(encoding="ascii").strip() != khz]
    if refused:
        raise UsageError(
            f"{refused[0]} does not take {khz} kHz: it needs root, and a frequency that the processor has"
        )


def _write(file: Path, text: str) -> None:
    try:
        file.write_text(text, encoding="ascii")
    except OSError:
        return  # the setting is checked afterwards


def put_law(
    file: Path, machine: Machine, where: Sequence[str], law: WithProvenance, reach_mhz: tuple[float, float]
) -> None:
    """Write a law into the machine's entry of a catalogue; create the file and the entry if they are missing.

    The rest of the file stays as it is.

    Args:
        file: The catalogue.
        machine: The computer.
        where: Path of the law in the entry, such as ``("code", "python")``.
        law: The law.
        reach_mhz: Range of frequencies, MHz, that the entry's range is extended to.

    Raises:
        ModelError: The file exists and is not a catalogue.
        UsageError: The file cannot be written.
    """
    yaml = YAML()
    yaml.width = 110
    if file.exists():
        parse_catalogue(file.read_text(encoding="utf-8"), str(file))
    data = (yaml.load(file.read_text(encoding="utf-8")) if file.exists() else None) or {}
    entry = data.setdefault("processors", {}).setdefault(machine.name, _new_entry(machine))
    entry["least_mhz"] = min(entry["least_mhz"], reach_mhz[0])
    entry["greatest_mhz"] = max(entry["greatest_mhz"], reach_mhz[1])
    *sections, last = where
    place = entry
    for section in sections:
        place = place.setdefault(section, {})
    place[last] = law.model_dump(exclude_defaults=True)
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with file.open("w", encoding="utf-8") as out:
            yaml.dump(data, out)
    except OSError as error:
        raise UsageError(f"{file} cannot be written: {error.strerror}") from error
    parse_catalogue(file.read_text(encoding="utf-8"), str(file))


def _new_entry(machine: Machine) -> dict[str, Any]:
    return {
        "description": machine.description,
        "source": "measured by volery cost calibrate on the machine itself",
        "cores": machine.cores,
        "least_mhz": machine.frequency_mhz,
        "greatest_mhz": machine.frequency_mhz,
    }
