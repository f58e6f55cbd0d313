"""``tune`` on a simulated ArduCopter."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from volery.base.errors import UsageError
from volery.control import tuning
from volery.run import tune as module
from volery.run.go import GoSettings
from volery.run.result import Options
from volery.run.tune import tune


def test_tuned_gains_have_margins_and_cost_less_on_the_fitted_process(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    short = replace(module.LOOPS["rotation"], training=(0.0, 90.0), held_back=(0.0, 60.0), seconds=4.0)
    monkeypatch.setattr(module, "LOOPS", {**module.LOOPS, "rotation": short})
    monkeypatch.setattr(tuning, "ROUNDS", 2)
    monkeypatch.setattr(tuning, "CANDIDATES", 24)
    monkeypatch.setattr(module, "TRAINING", 6)
    monkeypatch.setattr(module, "HELD_BACK", 8)
    monkeypatch.setattr(module, "CANDIDATES", 2)  # the gains by hand and those of the process, in flights
    monkeypatch.setattr(module, "TRAINING_LINKS", ("",))
    monkeypatch.setattr(module, "HELD_BACK_LINKS", ("wire=bytes&jitter=0.06",))
    found = tune("rotation", "sim:ardupilot?start=warm", GoSettings(), Options(out=tmp_path))
    hand, simc, tuned = found.judged
    assert found.process.misfit < 1.5
    assert 2.0 < found.oscillation.ultimate_gain < 6.0
    assert tuned.modelled <= hand.modelled
    assert tuned.margins.gain > 1.5
    assert max(hand.flown, simc.flown, tuned.flown) < 2.0


def test_an_unknown_loop_is_named() -> None:
    with pytest.raises(UsageError, match="no loop 'pitch'; there is altitude or rotation"):
        tune("pitch", "sim:ardupilot", GoSettings(), Options())
