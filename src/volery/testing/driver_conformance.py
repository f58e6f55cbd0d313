"""Conformance of drivers: named checks of what a driver and its autopilot must do, over any address.

```python
from volery.testing import conformance

report = conformance("sim:ardupilot")
assert report.conforms, report.faults
```

Authors of drivers run the same checks: register the driver with an entry point, or with
``volery.vehicles.drivers.add``, and pass its address.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from enum import Enum
from functools import partial
from typing import Any

from volery.base.errors import LowBattery, Refused, UsageError, VoleryError, choices, did_you_mean
from volery.base.process import without_hang_ups
from volery.base.time import to_seconds
from volery.testing.checks import CHECKS, Check, CheckFailedError, NotPossibleError
from volery.testing.driver_checks import GROUPS
from volery.testing.stage import RealStage, SimulatedStage, TestStage, kind_of
from volery.vehicles.address import Address, parse
from volery.vehicles.telemetry import describe_state


class Outcome(Enum):
    """Outcome of a check."""

    PASSED = "passed"
    LACKING = "declared missing"
    IMPOSSIBLE = "not possible here"
    FAILED = "failed"


@dataclass(frozen=True)
class Result:
    """Result of one check.

    Attributes:
        check: The check's name.
        group: The check's group.
        demands: What must hold.
        outcome: How it ended.
        detail: Why it failed or was not possible, or what it returned.
        seconds: Duration on the vehicle's clock, s.
    """

    check: str
    group: str
    demands: str
    outcome: Outcome
    detail: str = ""
    seconds: float = 0.0


Show = Callable[[Check, Result | None], None]
"""Called for each check when it begins (None) and when it ends."""


@dataclass(frozen=True)
class Report:
    """Results of the checks at an address.

    Attributes:
        url: The address.
        seed: Seed of the simulation.
        results: Results in the order of execution.
        interrupted: The checks were ended before the last one, by Ctrl-C or SIGTERM.
        left: Why a real vehicle does not stand on the ground at the end; empty if it does.
    """

    url: str
    seed: int
    results: tuple[Result, ...]
    interrupted: bool = False
    left: str = ""

    @property
    def faults(self) -> tuple[Result, ...]:
        """Results of the checks that failed."""
        return tuple(result for result in self.results if result.outcome is Outcome.FAILED)

    @property
    def conforms(self) -> bool:
        """Whether all checks were run, none failed, and the vehicle stands on the ground."""
        return not (self.faults or self.interrupted or self.left)

    def as_data(self) -> dict[str, Any]:
        """Return the report as values for JSON."""
        results = [{**asdict(result), "outcome": result.outcome.value} for result in self.results]
        return {
            "url": self.url,
            "seed": self.seed,
            "conforms": self.conforms,
            "interrupted": self.interrupted,
            "left": self.left,
            "results": results,
        }


def conformance(
    url: str,
    *,
    only: Sequence[str] = (),
    kind: str = "drone",
    fly: bool = False,
    seed: int = 1,
    second: str = "",
    show: Show | None = None,
) -> Report:
    """Run the checks on a vehicle and return their results.

    ``KeyboardInterrupt`` ends the checks; the report has the results so far. A real vehicle is landed after
    each check and at the end; if that fails, the checks that fly are not run any more, and the report says
    where the vehicle is.

    Args:
        url: Address of the vehicle. A simulated vehicle is new for every check.
        only: Names of checks or groups to run; empty for all.
        kind: ``drone`` or ``rover``.
        fly: Let a real vehicle arm and fly, within 60 m around home and 30 m above it.
        second: Address of another link to the same real vehicle, for checks that need another commander.
        seed: Seed of the simulation.
        show: Called for each check when it begins and when it ends.

    Raises:
        UsageError: a name or an address is not valid.
        LinkSilent: no message of a real vehicle arrives.
    """
    address = parse(url)
    wanted = chosen(only, kind)
    report = show or _report_nothing
    results: list[Result] = []
    left, interrupted = "", False
    try:
        if address.in_virtual_time:
            for one in wanted:
                results.append(_simulated(one, address, kind, seed, report))
        else:
            left = _real(wanted, RealStage(address, kind_of(kind), second), fly, report, results)
    except KeyboardInterrupt:
        interrupted = True
    return Report(url, seed, tuple(results), interrupted or len(results) < len(wanted), left)


def chosen(only: Sequence[str] = (), kind: str = "drone") -> list[Check]:
    """Return the checks for a kind of vehicle, or only those whose name or group is in `only`."""
    kind_of(kind)
    fitting = sorted(
        (one for one in CHECKS if one.kind in {"", kind}), key=lambda one: GROUPS.index(one.group)
    )
    names = {one.name for one in fitting} | {one.group for one in fitting}
    for name in only:
        if name not in names:
            hint = did_you_mean(name, names)
            raise UsageError(f"no check {name!r}{hint}; there is {choices(names)}")
    return [one for one in fitting if not only or one.name in only or one.group in only]


def _simulated(one: Check, address: Address, kind: str, seed: int, report: Show) -> Result:
    report(one, None)
    stage = SimulatedStage(address, kind_of(kind), seed, cold=one.cold, neighbour=one.neighbour)
    try:
        result = _judged(one, stage, lambda: stage.perform(lambda: _play(one, stage)))
    finally:
        stage.close()
    report(one, result)
    return result


def _real(wanted: list[Check], stage: RealStage, fly: bool, report: Show, results: list[Result]) -> str:
    """Append the results of the checks; return why the vehicle does not stand on the ground, else empty."""
    left = ""
    stage.kernel.start()
    try:
        with stage.kernel.adopt("conformance"):
            stage.drone.wait_connected()
            if stage.in_the_air:
                raise Refused(
                    stage.name, "check it", "it flies; land it first: the checks begin on the ground"
                )
            with suppress(KeyboardInterrupt):
                for one in wanted:
                    report(one, None)
                    results.append(_on_real(one, stage, fly))
                    report(one, results[-1])
            left = _left_in_the_air(stage)
    finally:
        stage.close()
    return left


def _left_in_the_air(stage: RealStage) -> str:
    """Bring the vehicle to rest at the end; a second signal ends that, too."""
    try:
        with without_hang_ups():
            return _not_at_rest(stage)
    except KeyboardInterrupt:
        flying = ", FLYING" if stage.in_the_air else ""
        return f"a second signal ended its landing: {describe_state(stage.drone.telemetry)}{flying}"


def _not_at_rest(stage: RealStage) -> str:
    """Bring the vehicle to rest; return why that was not possible, else empty."""
    try:
        stage.rest()
    except VoleryError as error:
        return str(error)
    return ""


def _on_real(one: Check, stage: RealStage, fly: bool) -> Result:
    impossible = partial(Result, one.name, one.group, one.demands, Outcome.IMPOSSIBLE)
    if one.lets_fall or one.neighbour or one.cold:
        return impossible("in simulation only")
    if one.flies and not fly:
        return impossible("it flies: permit it with --fly")
    if one.flies and stage.in_the_air:
        left = _not_at_rest(stage)
        if left:
            return impossible(f"the vehicle flies since an earlier check: {left}")
    result = _judged(one, stage, lambda: _play(one, stage))
    left = _not_at_rest(stage)
    if not left:
        return result
    detail = f"{result.detail}; afterwards it did not come to rest: {left}".removeprefix("; ")
    return replace(result, outcome=Outcome.FAILED, detail=detail)


class _LackingError(Exception):
    """Return whether the vehicle lacks a capability that the check needs."""


def _play(one: Check, stage: TestStage) -> str | None:
    stage.drone.wait_connected()
    missing = [each for each in one.needs if each not in stage.drone.capabilities]
    if missing:
        raise _LackingError(", ".join(each.value for each in missing))
    return one.body(stage)


def _judged(one: Check, stage: TestStage, play: Callable[[], str | None]) -> Result:
    began = stage.kernel.now()
    outcome, detail = Outcome.FAILED, ""
    try:
        detail = play() or ""
        outcome = Outcome.PASSED
    except _LackingError as lacking:
        outcome, detail = Outcome.LACKING, f"cannot {lacking}"
    except NotPossibleError as error:
        outcome, detail = Outcome.IMPOSSIBLE, str(error)
    except LowBattery as error:
        outcome = Outcome.IMPOSSIBLE if isinstance(stage, RealStage) else Outcome.FAILED
        detail = f"{error}; charge it and repeat with --only {one.name}"
    except CheckFailedError as error:
        detail = str(error)
    except Exception as error:
        detail = f"{type(error).__name__}: {error}"
    seconds = round(to_seconds(stage.kernel.now() - began), 1)
    return Result(one.name, one.group, one.demands, outcome, detail, seconds)


def _report_nothing(one: Check, result: Result | None) -> None:
    """Report nothing."""
