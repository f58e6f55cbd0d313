"""Conformance checks: functions with a name, a stated demand, and the circumstances that they need.

```python
@check(needs=(Capability.TAKEOFF,), flies=True)
def takeoff(stage: Stage) -> None:
    \"\"\"takeoff(10) from the ground returns in the air, 10 m above home.\"\"\"
    stage.drone.takeoff(10)
    demand(stage.drone.flying, "it returned on the ground")
```

A check reports a fault with ``demand``; every other exception is a fault, too. A check whose circumstances
are not available raises ``NotPossibleError``. Its return value, if any, is reported with "passed".
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from volery.base.errors import VoleryError
from volery.vehicles import Capability

Body = Callable[[Any], str | None]
"""Runs a check on a ``Stage``; the stage's module imports this one, so its type is not named here."""


class CheckFailedError(Exception):
    """A demand was not met."""


class NotPossibleError(Exception):
    """The circumstances of a check are not available on this link or with this vehicle."""


@dataclass(frozen=True)
class Check:
    """One check.

    Attributes:
        name: Name in reports.
        group: Group that it is reported and selected with.
        demands: What must hold.
        body: Runs the check on a stage.
        needs: Capabilities that the driver must have.
        flies: It arms or moves the vehicle.
        kind: ``drone``, ``rover``, or empty for both.
        lets_fall: It ends with an overturned vehicle, so it runs in simulation only.
        cold: It needs a vehicle that has just been switched on.
        neighbour: It needs a second vehicle on the same link.
    """

    name: str
    group: str
    demands: str
    body: Body
    needs: tuple[Capability, ...] = ()
    flies: bool = False
    kind: str = "drone"
    lets_fall: bool = False
    cold: bool = False
    neighbour: bool = False


CHECKS: list[Check] = []
"""All registered checks; within a group in the order of execution."""


def group_of(module: str) -> str:
    """Return the group of the checks in a module: ``manual-control`` for ``...manual_control_checks``."""
    return module.rpartition(".")[2].removesuffix("_checks").replace("_", "-")


def check(
    *,
    needs: tuple[Capability, ...] = (),
    flies: bool = False,
    kind: str = "drone",
    lets_fall: bool = False,
    cold: bool = False,
    neighbour: bool = False,
) -> Callable[[Body], Body]:
    """Register the decorated function as a check: its name is the check's, its docstring the demand."""

    def register(body: Body) -> Body:
        name = body.__name__.replace("_", "-")
        group = group_of(body.__module__)
        demands = " ".join((body.__doc__ or "").split()).removeprefix("Check that ")
        CHECKS.append(Check(name, group, demands, body, needs, flies, kind, lets_fall, cold, neighbour))
        return body

    return register


def demand(holds: object, otherwise: str) -> None:
    """Raise ``CheckFailedError`` with the text `otherwise` unless `holds` is true."""
    if not holds:
        raise CheckFailedError(otherwise)


class Caught:
    """The exception that ``raising`` has caught."""

    error: VoleryError

    @property
    def text(self) -> str:
        """Text of the exception."""
        return str(self.error)


@contextmanager
def raising(*kinds: type[VoleryError], naming: str) -> Iterator[Caught]:
    """Demand that the block raises one of `kinds` with a message that contains `naming`."""
    expected = " or ".join(kind.__name__ for kind in kinds)
    caught = Caught()
    try:
        yield caught
    except kinds as error:
        demand(naming in str(error), f"{type(error).__name__} does not name {naming}: {error}")
        caught.error = error
        return
    except VoleryError as error:
        raise CheckFailedError(f"{type(error).__name__} instead of {expected}: {error}") from error
    raise CheckFailedError(f"nothing was raised; expected {expected}")
