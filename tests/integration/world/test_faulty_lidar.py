"""A drone that explores while its lidar breaks: it says what is wrong, stands still, and goes on after it."""

from __future__ import annotations

from pathlib import Path
from shutil import copytree

import numpy as np
import pytest

from volery import Options, simulate
from volery.base.time import S
from volery.run.event_log import LogOptions
from volery.trace.events import VehicleState
from volery.trace.reader import read

EXAMPLE = Path(__file__).parents[3] / "examples" / "mapping"
pytestmark = [pytest.mark.integration, pytest.mark.long]

FAULTS = {
    "silent": ("sensor-silent", "no scan for"),
    "stuck": ("sensor-stuck", "it is stuck"),
    "maximum": ("ranges-maximum", "the scan is all maximum where the map has obstacles"),
    "numbers": ("ranges-not-a-number", "the scan says nothing"),
    "late": ("sensor-clock-off, by: -5 s", "the scan is 5 s old"),
    "early": ("sensor-clock-off, by: 1 h", "s ahead of the clock"),
}
FIRST, EACH, LASTS = 16, 8, 5
"""When the faults begin, one after the other, and how long each lasts [s]."""


def changed(folder: Path, faults: str, seconds: int) -> Path:
    """Return a copy of the example with faults that ends early."""
    made = folder / "model"
    copytree(EXAMPLE, made)
    text = (EXAMPLE / "model.yaml").read_text(encoding="utf-8")
    text = text.replace("  floor_plan:", f"  faults:\n{faults}  floor_plan:")
    text = text[: text.index("requirements:")] + (
        "requirements: {touches_nothing: {observe: drone.collisions, max: 0}}\n"
        f"run: {{duration: {seconds} s}}\n"
    )
    (made / "model.yaml").write_text(text, encoding="utf-8")
    return made / "model.yaml"


def flown(model: Path, folder: Path) -> tuple[list[tuple[float, str]], np.ndarray]:
    """Return what was said when [s], and times [s], heights [m] and horizontal speeds [m/s] (n, 3)."""
    run = simulate(model, Options(out=folder / "run", log=LogOptions(folder / "log.txt")))
    assert run.ok, run.error or run.verdicts
    said = []
    for line in (folder / "log.txt").read_text(encoding="utf-8").splitlines():
        hours, minutes, seconds = line.split()[0].split(":")
        said.append((3600.0 * int(hours) + 60.0 * int(minutes) + float(seconds), line))
    states = [
        (one.at / S, one.z, float(np.hypot(one.vx, one.vy)))
        for one in read(folder / "run" / "trace.mcap").events
        if isinstance(one, VehicleState)
    ]
    return said, np.array(states)


def test_each_fault_of_the_lidar_is_named_and_the_drone_stands_until_it_is_over(tmp_path):
    faults = "".join(
        f"    {name}: {{kind: {kind}, vehicle: drone, sensor: lidar, at: {FIRST + EACH * number} s, "
        f"duration: {LASTS} s}}\n"
        for number, (name, (kind, _)) in enumerate(FAULTS.items())
    )
    said, states = flown(changed(tmp_path, faults, FIRST + EACH * len(FAULTS)), tmp_path)
    time, height, speed = states.T
    for number, (name, (_, word)) in enumerate(FAULTS.items()):
        begin = FIRST + EACH * number
        assert any(word in text for at, text in said if begin < at < begin + LASTS), name
        assert any("on the way" in text for at, text in said if begin + LASTS <= at < begin + EACH), name
        during = (time > begin + 3.5) & (time < begin + LASTS)
        assert speed[during].max() < 0.2, name
        assert height[during].min() > 0.5, name


def test_a_lidar_that_stays_silent_makes_it_land(tmp_path):
    fault = "    silent: {kind: sensor-silent, vehicle: drone, sensor: lidar, at: 12 s}\n"
    said, states = flown(changed(tmp_path, fault, 40), tmp_path)
    assert any("gives up and lands: no scan for more than 0.5 s" in text for _, text in said)
    assert states[-1, 1] < 0.2
    assert states[-1, 2] < 0.01
