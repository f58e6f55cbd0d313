"""Deeply nested input is refused by every reader of it, with an error of this project."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from volery.base.errors import VoleryError
from volery.calibration.core_measurement import read_notes
from volery.components.loader import Loader
from volery.components.programs import load_class
from volery.cost.catalogue import read_catalogue
from volery.cost.instrumentation import StepCounter
from volery.requirements.record import read_record
from volery.run.assembly.fences import read_fence
from volery.run.distributed.remote_ports import ValueCodec
from volery.run.distributed.topic_messages import from_message
from volery.run.gains import read_gains
from volery.vehicles.vehicle_plan import Plan

DEPTH = 20_000
LIST = "[" * DEPTH + "]" * DEPTH
DEEP_SUM = f"class A:\n    x = 1{' + 1' * DEPTH}\n"
COUNTED_SUM = f"class A:\n    def f(self):\n        return 1{' + len(self)' * 600}\n"

READERS: dict[str, tuple[str, str, Callable[[Path], object]]] = {
    "catalogue": ("laws.yaml", f"processors: {LIST}", read_catalogue),
    "gains": ("gains.toml", f"a = {LIST}", lambda file: read_gains(file, {})),
    "record": ("run.json", LIST, lambda file: read_record(file.parent)),
    "fence": ("fence.geojson", LIST, read_fence),
    "plan": ("mission.plan", LIST, Plan.read),
    "component": ("a.py", DEEP_SUM, lambda file: load_class(file, "A")),
    "counted component": (
        "a.py",
        COUNTED_SUM,
        lambda file: load_class(file, "A", Loader(steps=StepCounter())),
    ),
    "value of a port": ("", LIST, lambda file: ValueCodec(lambda *_: None).from_text(file.read_text())),
    "message of a component": ("", LIST, lambda file: from_message(SimpleNamespace(data=file.read_text()))),
}


@pytest.mark.parametrize("reader", READERS)
def test_deeply_nested_input_is_refused(tmp_path: Path, reader: str) -> None:
    name, text, read = READERS[reader]
    file = tmp_path / (name or "text")
    file.write_text(text, encoding="ascii")
    with pytest.raises(VoleryError):
        read(file)


def test_deeply_nested_notes_of_a_measurement_are_left_out(tmp_path: Path) -> None:
    notes = tmp_path / "notes.json"
    notes.write_text(LIST, encoding="ascii")
    assert read_notes(notes) == {}
