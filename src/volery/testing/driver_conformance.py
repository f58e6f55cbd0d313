"""``conformance``: named checks of what a driver and its autopilot must do, over any address.

```python
from volery.testing import conformance

report = conformance("sim:ardupilot")
assert report.conforms, report.faults
```

Whoever writes a driver of his own runs the same checks over it: register it with an entry point, or with
``volery.vehicles.drivers.add``, and give its address.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from enum import Enum
from typing import Any

from volery.base.errors import UsageError, VoleryError, choices, did_you_mean
from volery.base.time import to_seconds
from volery.testing.checks import CHECKS, Check, CheckFailedError, NotPossibleError
from volery.testing.driver_checks import GROUPS
from volery.testing.simulated_stage import SimulatedStage
from volery.testing.stage import RealStage, Stage, kind_of
from volery.vehicles.address import Address, parse


class Outcome(Enum):
    """How a check ended."""

    PASSED = "passed"
    LACKING = "declared missing"
    IMPOSSIBLE = "not possible here"
    FAILED = "failed"


@dataclass(frozen=True)
class Result:
    """One check's. ``detail`` says why it failed or was not possible, or what was noted; ``seconds`` is how
    long it took on the vehicle's clock.
    """

    check: str
    group: str
    demands: str
    outcome: Outcome
    detail: str = ""
    seconds: float = 0.0


Show = Callable[[Check, Result | None], None]
"""Told of each check as it begins (``None``) and as it ends."""


@dataclass(frozen=True)
class Report:
    """What was found at an address."""

    url: str
    seed: int
    results: tuple[Result, ...]

    @property
    def faults(self) -> tuple[Result, ...]:
        """Those that failed."""
        return tuple(one for one in self.results if one.outcome is Outcome.FAILED)

    @property
    def conforms(self) -> bool:
        """No check failed."""
        return not self.faults

    def as_data(self) -> dict[str, Any]:
        """For JSON."""
        results = [{**asdict(one), "outcome": one.outcome.value} for one in self.results]
        return {"url": self.url, "seed": self.seed, "conforms": self.conforms, "results": results}


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
    """Run the checks over the vehicle at *url* and report.

    *only* these checks, or groups of checks. *kind* is drone or rover. A simulated vehicle is a new one for
    every check and flies without being asked; a real one flies only with *fly*, and one that flies must have
    room: 60 m around home and 30 m above it. *second* is another link to the same real vehicle, for checks
    that need another commander.

    Raises ``UsageError`` for names or addresses that make no sense, ``LinkSilent`` if a real vehicle is not
    heard.
    """
    address = parse(url)
    wanted = chosen(only, kind)
    told = show or _tell_nobody
    if address.carrier == "sim":
        results = [_simulated(one, address, kind, seed, told) for one in wanted]
    else:
        results = _real(wanted, RealStage(address, kind_of(kind), second), fly, told)
    return Report(url, seed, tuple(results))


def chosen(only: Sequence[str] = (), kind: str = "drone") -> list[Check]:
    """The checks for a *kind* of vehicle; *only* those that are named, or whose group is."""
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


def _simulated(one: Check, address: Address, kind: str, seed: int, told: Show) -> Result:
    told(one, None)
    stage = SimulatedStage(address, kind_of(kind), seed, cold=one.cold, neighbour=one.neighbour)
    try:
        result = _judged(one, stage, lambda: stage.perform(lambda: _play(one, stage)))
    finally:
        stage.close()
    told(one, result)
    return result


def _real(wanted: list[Check], stage: RealStage, fly: bool, told: Show) -> list[Result]:
    results = []
    stage.kernel.start()
    try:
        with stage.kernel.adopt("conformance"):
            stage.drone.wait_connected()
            try:
                for one in wanted:
                    told(one, None)
                    results.append(_on_real(one, stage, fly))
                    told(one, results[-1])
            except KeyboardInterrupt:
                with suppress(VoleryError):
                    stage.rest()
                raise
    finally:
        stage.close()
    return results


def _on_real(one: Check, stage: RealStage, fly: bool) -> Result:
    if one.lets_fall or one.neighbour or one.cold:
        why = "in simulation only"
        return Result(one.name, one.group, one.demands, Outcome.IMPOSSIBLE, why)
    if one.flies and not fly:
        return Result(one.name, one.group, one.demands, Outcome.IMPOSSIBLE, "it flies: permit it with --fly")
    result = _judged(one, stage, lambda: _play(one, stage))
    try:
        stage.rest()
    except VoleryError as error:
        detail = f"{result.detail}; afterwards it did not come to rest: {error}".removeprefix("; ")
        return Result(one.name, one.group, one.demands, Outcome.FAILED, detail, result.seconds)
    return result


class _LackingError(Exception):
    """It has said beforehand that it cannot."""


def _play(one: Check, stage: Stage) -> str | None:
    stage.drone.wait_connected()
    missing = [each for each in one.needs if each not in stage.drone.capabilities]
    if missing:
        raise _LackingError(", ".join(each.value for each in missing))
    return one.body(stage)


def _judged(one: Check, stage: Stage, play: Callable[[], str | None]) -> Result:
    began = stage.kernel.now()
    outcome, detail = Outcome.FAILED, ""
    try:
        detail = play() or ""
        outcome = Outcome.PASSED
    except _LackingError as lacking:
        outcome, detail = Outcome.LACKING, f"cannot {lacking}"
    except NotPossibleError as error:
        outcome, detail = Outcome.IMPOSSIBLE, str(error)
    except CheckFailedError as error:
        detail = str(error)
    except Exception as error:
        detail = f"{type(error).__name__}: {error}"
    seconds = round(to_seconds(stage.kernel.now() - began), 1)
    return Result(one.name, one.group, one.demands, outcome, detail, seconds)


def _tell_nobody(one: Check, result: Result | None) -> None:
    """Nobody watches."""
