"""The computer that is calibrated: its name, its cores, the frequency that it runs at.

A catalogue of the user's, into which calibrations put what they measured.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from ruamel.yaml import YAML

from volery.base.errors import UsageError
from volery.cost.catalogue import parse_catalogue
from volery.cost.figures import WithProvenance

CPUINFO = Path("/proc/cpuinfo")
CPUS = Path("/sys/devices/system/cpu")
TOLERANCE = 0.02
"""How far a stated frequency may be from the one that a machine reports."""


@dataclass(frozen=True)
class Machine:
    """``name`` is short enough for a model, ``description`` the processor's own."""

    name: str
    description: str
    cores: int
    frequency_mhz: float


def this_machine(name: str = "", cpuinfo: Path = CPUINFO) -> Machine:
    """As Linux describes it, under *name* if one is given. ``UsageError`` where it does not."""
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
    return Machine(name or short, description, os.cpu_count() or 1, float(round(mhz)))


def _scaled_mhz() -> float:
    try:
        return int((CPUS / "cpu0/cpufreq/scaling_cur_freq").read_text(encoding="ascii")) / 1000.0
    except (OSError, ValueError) as error:
        raise UsageError(
            "this machine does not say what frequency it runs at; state it: --frequency"
        ) from error


@contextmanager
def at_frequency(machine: Machine, wanted_mhz: float | None, cpus: Path = CPUS) -> Iterator[float]:
    """Keep all cores at a frequency, MHz, where the machine allows it; give the one that holds.

    ``UsageError`` if another one is wanted than the machine runs at and it cannot be set.
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
        for _ in range(2):  # a least frequency above the greatest is refused: the second pass has room
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
        return  # whether it has taken it is looked at afterwards


def put_law(
    file: Path, machine: Machine, where: Sequence[str], law: WithProvenance, reach_mhz: tuple[float, float]
) -> None:
    """Make *law* what stands at *where* (``("code", "python")``) in the machine's entry of the catalogue at
    *file*, made if need be.

    The entry's range of frequencies grows to contain *reach_mhz*; everything else in the file stays. Raises
    ``ModelError`` if the file is there and no catalogue, ``UsageError`` if it cannot be written.
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
        "source": "measured by volery calibrate on the machine itself",
        "cores": machine.cores,
        "least_mhz": machine.frequency_mhz,
        "greatest_mhz": machine.frequency_mhz,
    }
