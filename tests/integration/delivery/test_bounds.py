"""Bounds of services that fly: no run exceeds them, and what is discarded cannot work."""

from __future__ import annotations

from pathlib import Path

import pytest

from volery import Options, simulate
from volery.analysis.impossible import why_impossible
from volery.analysis.simulated_times import longest_times
from volery.analysis.system_analysis import analyse
from volery.model.system_loader import load
from volery.run.assembly.model_checks import vocabulary

pytestmark = pytest.mark.integration

EXAMPLES = Path(__file__).parents[3] / "examples"
ONBOARD = ("onboard_1", "onboard_2", "onboard_depot", "onboard_north", "onboard_east")
FREQUENCIES = [f"platform.processors.{one}.frequency={{}} MHz" for one in ONBOARD]
ONE_CORE = [f"platform.processors.{one}.cores=1" for one in ONBOARD]
LOADED = [f"platform.processors.{one}.load=10 %" for one in ONBOARD]
PATROL = [
    "components.Patrol.calls={activation: {route.order_of: 1}}",
    "components.Patrol.assume={period: 90 ms, beside: {time: 2 ms}, waits: 40 ms}",
]

START_UP_S = 0.07
"""Execution of the nodes of one computer at their start, at 1500 MHz, which no bound covers."""


def at(mhz):
    return [one.format(mhz) for one in FREQUENCIES]


@pytest.mark.parametrize(
    ("model", "scenario", "seed", "overrides"),
    [
        ("delivery", "pocket", 1, at(1500)),
        ("delivery", "pocket", 2, at(900)),
        ("delivery", "pocket", 3, [*at(1200), *LOADED]),
        ("delivery", "pocket", 4, [*at(1500), *ONE_CORE]),
        ("starter", None, 1, PATROL),
        ("starter", "windy", 2, PATROL),
    ],
)
def test_no_run_exceeds_its_bounds(tmp_path, model, scenario, seed, overrides):
    system = load(EXAMPLES / model / "model.yaml", vocabulary(), scenario, None, tuple(overrides))
    found = analyse(system)
    bounds = {one.subject: one for each in found.responses.values() for one in each}
    unbounded = {name for name, one in bounds.items() if one.bound is None}
    if overrides == at(1500):
        assert unbounded == {"central"}
    record = simulate(system, Options("times", seed, out=tmp_path / "run")).record
    assert record.outcome.status == "completed"
    seen = longest_times(tmp_path / "run").responses
    compared = [name for name in seen if name in bounds and name not in unbounded]
    assert compared
    for name in compared:
        assert seen[name] <= bounds[name].bound, name
    for one in found.processors:
        if not one.not_counted:
            start_up = 2 * START_UP_S / record.sim_s
            assert record.processors[one.resource].utilisation <= one.share + start_up, one.resource


@pytest.mark.parametrize(("mhz", "seed"), [(600, 5), (800, 6)])
def test_no_discarded_variant_meets_its_requirements(mhz, seed):
    system = delivery(at(mhz))
    assert any("landing_in_time_1 cannot be met" in one for one in why_impossible(system, "times"))
    assert not simulate(system, Options("times", seed)).record.requirements["landing_in_time_1"].met


def test_a_variant_that_may_work_is_not_discarded():
    assert not list(why_impossible(delivery(at(900)), "times"))


def delivery(overrides):
    return load(EXAMPLES / "delivery" / "model.yaml", vocabulary(), "pocket", None, tuple(overrides))
