"""The suite finds what is wrong with a driver, and says what is missing or cannot be tried."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from volery.base.errors import UsageError
from volery.cli.main import application
from volery.simulation.autopilots.ardupilot import FIRMWARE
from volery.simulation.autopilots.fleet_autopilot import firmwares
from volery.testing import Outcome, conformance
from volery.testing.checks import CheckFailedError, demand, raising
from volery.testing.driver_conformance import chosen
from volery.testing.fault_trials import try_fault
from volery.vehicles import Capability
from volery.vehicles.driver import DriverFactory, ManualControl, drivers
from volery.vehicles.drivers.ardupilot import open_driver

HEIGHTS: list[float] = []
"""Heights at which a strong vehicle was given manual control, m above home."""


class Cheat:
    """An ArduPilot driver that is wrong in one way."""

    def __init__(self, way: str, *opened: Any) -> None:
        self._driver, self._way = open_driver(*opened), way

    def __getattr__(self, name: str) -> Any:
        return getattr(self._driver, name)

    @property
    def capabilities(self) -> frozenset[Capability]:
        lacking = {Capability.SPEED} if self._way == "no speed" else set()
        return frozenset(self._driver.capabilities - lacking)

    def manual_control(self, control: ManualControl | None) -> None:
        if self._way == "strong" and control is not None:
            HEIGHTS.append(self._driver.telemetry.above_home)
            control = control._replace(throttle=1.0)
        self._driver.manual_control(control)

    def goto(self, *asked: Any) -> Sequence[Any]:
        steps = self._driver.goto(*asked)
        if self._way == "claims":
            return [replace(step, done=lambda seen: True) for step in steps]
        if self._way == "hangs":
            return [replace(step, done=lambda seen: False, within=10**15) for step in steps]
        if self._way == "raises":
            raise ZeroDivisionError("of the driver's own")
        return list(steps)


@pytest.fixture(autouse=True)
def cheats() -> Iterator[None]:
    ways = ("claims", "hangs", "raises", "no speed", "strong")
    for way in ways:

        def opens(*opened: Any, way: str = way) -> Any:
            return Cheat(way, *opened)

        drivers.add(f"cheat-{way.replace(' ', '-')}", DriverFactory(on_link=opens))
        firmwares.add(f"cheat-{way.replace(' ', '-')}", FIRMWARE)
    yield
    for registry in (drivers, firmwares):
        for name in [name for name in registry._added if name.startswith("cheat")]:
            del registry._added[name]


def found(url: str, *only: str) -> Mapping[str, Any]:
    return {one.check: one for one in conformance(url, only=only).results}


def test_a_driver_that_claims_to_have_arrived() -> None:
    result = found("sim:cheat-claims", "goto")["goto"]
    assert result.outcome is Outcome.FAILED
    assert "beside" in result.detail


def test_a_driver_that_hangs() -> None:
    result = found("sim:cheat-hangs", "goto")["goto"]
    assert result.outcome is Outcome.FAILED
    assert "hangs" in result.detail


def test_a_driver_that_raises_what_is_none_of_ours() -> None:
    result = found("sim:cheat-raises", "goto")["goto"]
    assert result.outcome is Outcome.FAILED
    assert "ZeroDivisionError: of the driver's own" in result.detail
    assert try_fault("cheat-raises", "none", "goto").broken.startswith("a fault of volery: ZeroDivision")


def test_a_strong_vehicle_is_not_flown_by_hand_out_of_the_clear_space() -> None:
    """Observed: the check lifted a `bebop`, which hovers at a quarter of its thrust, to 92 m."""
    HEIGHTS.clear()
    assert found("sim:cheat-strong", "stabilize")["stabilize"].outcome is Outcome.PASSED
    assert 22.0 < max(HEIGHTS) < 30.0


def test_a_fault_trial_of_a_driver_that_hangs() -> None:
    assert try_fault("cheat-hangs", "none", "goto").broken == "it hangs"


def test_what_a_driver_has_declared_missing_is_no_fault() -> None:
    report = conformance("sim:cheat-no-speed", only=["speed", "capabilities"])
    results = {one.check: one for one in report.results}
    assert report.conforms
    assert results["speed"].outcome is Outcome.LACKING
    assert results["speed"].detail == "cannot go at a stated speed"
    assert "go at a stated speed" in results["capabilities"].detail


def test_the_same_report_twice() -> None:
    first, second = (conformance("sim:ardupilot", only=["goto", "hold"], seed=3) for _ in range(2))
    assert first == second
    assert first != conformance("sim:ardupilot", only=["goto", "hold"], seed=4)


def test_each_check_states_its_demand() -> None:
    checks = [*chosen(), *chosen(kind="rover")]
    names = [one.name for one in chosen()]
    assert len(set(names)) == len(names)
    assert all(one.demands.endswith(".") and len(one.demands) > 25 for one in checks)


def test_names_that_are_none() -> None:
    with pytest.raises(UsageError, match=r"no check 'lnd'.*did you mean 'land'"):
        conformance("sim:ardupilot", only=["lnd"])
    with pytest.raises(UsageError, match="no kind of vehicle 'plane'"):
        conformance("sim:ardupilot", kind="plane")


def test_demands() -> None:
    demand(True, "never said")
    with pytest.raises(CheckFailedError, match="said"):
        demand(False, "said")
    with raising(UsageError, naming="x") as caught:
        raise UsageError("x is none")
    assert caught.text == "x is none"
    with pytest.raises(CheckFailedError, match="nothing was raised"), raising(UsageError, naming="x"):
        pass
    with pytest.raises(CheckFailedError, match="does not name y"), raising(UsageError, naming="y"):
        raise UsageError("x")


# -- at the command line


def run(*arguments: str) -> Any:
    return CliRunner().invoke(application(), ["vehicle", "conformance", *arguments])


def test_the_command_line_reports_the_results(tmp_path: Path) -> None:
    good = run("sim:ardupilot", "--only", "identification,goto", "--out", str(tmp_path))
    assert good.exit_code == 0
    assert "2 passed" in good.output
    kept = json.loads((tmp_path / "conformance.json").read_text(encoding="utf-8"))
    assert kept["conforms"]
    assert [one["check"] for one in kept["results"]] == ["identification", "goto"]
    bad = run("sim:cheat-claims", "--only", "goto")
    assert bad.exit_code == 1
    assert "1 failed" in bad.output


def test_the_command_line_lists_them_and_refuses_others() -> None:
    listed = run("--list", "--only", "link", "--json")
    assert listed.exit_code == 0
    assert "link-lost" in [one["check"] for one in json.loads(listed.output)]
    assert run("sim:ardupilot", "--only", "nothing").exit_code == 2
    assert run("sim:betaflight").exit_code == 2
