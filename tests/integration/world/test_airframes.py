"""``examples/airframes``: a hexacopter, and a quadcopter with PX4, carry a parcel; a heavy one stays."""

from __future__ import annotations

from pathlib import Path

import pytest

from volery import Options, simulate

EXAMPLE = Path(__file__).parents[3] / "examples" / "airframes"

pytestmark = pytest.mark.integration


@pytest.mark.parametrize(("scenario", "energy_j"), [(None, 148_900.0), ("small", 44_200.0)])
def test_a_parcel_is_carried_and_the_battery_swapped(tmp_path, scenario, energy_j):
    run = simulate(EXAMPLE, Options(out=tmp_path / "run", record="summary"), scenario=scenario)
    assert run.ok, run.record.outcome.reason
    lifter = run.record.vehicles["lifter"]
    assert lifter.battery_swaps == 1
    assert lifter.energy_j == pytest.approx(energy_j, rel=0.05)


def test_a_parcel_that_is_too_heavy_stays_and_that_is_a_failure(tmp_path):
    run = simulate(EXAMPLE, Options(out=tmp_path / "run", record="summary"), scenario="heavy")
    assert not run.ok
    assert [one.what for one in run.record.failures] == [
        "parcel stays: its 40 kg are too heavy, 19 kg more can be lifted"
    ]
