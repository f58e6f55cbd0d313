"""A catalogue of the user's, into which calibrations put what they measured."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from volery.base.errors import UsageError
from volery.calibration.machine import Machine
from volery.cost.catalogue import read
from volery.cost.figure import Stated


def put_law(
    file: Path, machine: Machine, where: Sequence[str], law: Stated, reach_mhz: tuple[float, float]
) -> None:
    """Make *law* what stands at *where* (``("code", "python")``) in the machine's entry of the catalogue at
    *file*, made if need be.

    The entry's range of frequencies grows to contain *reach_mhz*; everything else in the file stays. Raises
    ``ModelError`` if the file is there and no catalogue, ``UsageError`` if it cannot be written.
    """
    yaml = YAML()
    yaml.width = 110
    if file.exists():
        read(file.read_text(encoding="utf-8"), str(file))
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
    read(file.read_text(encoding="utf-8"), str(file))


def _new_entry(machine: Machine) -> dict[str, Any]:
    return {
        "description": machine.description,
        "source": "measured by volery calibrate on the machine itself",
        "cores": machine.cores,
        "least_mhz": machine.frequency_mhz,
        "greatest_mhz": machine.frequency_mhz,
    }
