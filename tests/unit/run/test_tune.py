"""``tune`` on a simulated ArduCopter."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from volery.base.errors import UsageError
from volery.control import tuning
from volery.run import tune as module
from volery.run.go import GoSettings
from volery.run.result import Options
from volery.run.tune import tune


def test_tuned_gains_keep_their_margins_and_fly(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    short = replace(module.LOOPS["rotation"], goals=lambda random: [0.0, float(random.choice([60.0, 90.0]))])
    monkeypatch.setattr(module, "LOOPS", {**module.LOOPS, "rotation": short})
    monkeypatch.setattr(tuning, "ROUNDS", 2)
    monkeypatch.setattr(tuning, "CANDIDATES", 24)
    for name, value in (
        ("TRAINING", 6),
        ("HELD_BACK", 8),
        ("TRAINING_FLIGHTS", 1),
        ("HELD_BACK_FLIGHTS", 1),
        ("CANDIDATES", 2),
    ):
        monkeypatch.setattr(module, name, value)
    found = tune("rotation", "sim:ardupilot?start=warm", GoSettings(by="attitude"), Options(out=tmp_path))
    hand, simc, tuned = found.judged
    assert found.process.misfit < 1.5
    assert 2.0 < found.oscillation.ultimate_gain < 6.0
    assert found.process.acceleration < 500.0
    assert tuned.margins.gain >= 2.0
    assert tuned.margins.phase >= 45.0
    assert tuned.margins.sensitivity <= 2.0
    assert max(hand.flown, simc.flown, tuned.flown) < 2.0


def test_an_unknown_loop_is_named() -> None:
    with pytest.raises(UsageError, match="no loop 'pitch'; there is altitude or rotation"):
        tune("pitch", "sim:ardupilot", GoSettings(), Options())


def test_an_interrupt_ends_the_whole_series(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    flights = []

    def interrupted(*given: object, **more: object) -> SimpleNamespace:
        flights.append(given)
        return SimpleNamespace(completed=False, error=None)

    monkeypatch.setattr(module, "go", interrupted)
    with pytest.raises(KeyboardInterrupt):
        tune("rotation", "sim:ardupilot", GoSettings(), Options(out=tmp_path))
    assert len(flights) == 1
