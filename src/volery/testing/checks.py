"""What a conformance check is: a small function with a name, a demand in words, and what it takes to run it.

```python
@check(needs=(Capability.TAKEOFF,), flies=True)
def takeoff(stage: Stage) -> None:
    \"\"\"takeoff(10) from the ground returns in the air, 10 m above home.\"\"\"
    stage.drone.takeoff(10)
    demand(stage.drone.flying, "it returned on the ground")
```

A check that finds fault says so by ``demand``; any other error that leaves it is a fault, too. One whose
circumstances cannot be had here raises ``NotPossibleError``. What it returns, if anything, is noted beside
"passed".
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
    """What was demanded was not so."""


class NotPossibleError(Exception):
    """The circumstances of this check cannot be had on this link or with this vehicle."""


@dataclass(frozen=True)
class Check:
    """One check. ``flies``: it arms or moves the vehicle. ``kind`` is drone, rover, or empty for both.

    ``lets_fall``: it ends with a vehicle on its back, and is done in simulation only. ``cold``: on one that
    was switched on just now. ``neighbour``: a second vehicle is heard on the same link.
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
"""All that have been registered; within a group in the order in which they are run."""


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
    """Make a check of the function below: its name is the check's, its docstring what it demands."""

    def register(body: Body) -> Body:
        name = body.__name__.replace("_", "-")
        group = group_of(body.__module__)
        demands = " ".join((body.__doc__ or "").split())
        CHECKS.append(Check(name, group, demands, body, needs, flies, kind, lets_fall, cold, neighbour))
        return body

    return register


def demand(holds: object, otherwise: str) -> None:
    """Raise ``CheckFailedError`` saying what was seen *otherwise*, unless it *holds*."""
    if not holds:
        raise CheckFailedError(otherwise)


class Caught:
    """What ``raising`` has caught."""

    error: VoleryError

    @property
    def text(self) -> str:
        """Its words."""
        return str(self.error)


@contextmanager
def raising(*kinds: type[VoleryError], naming: str) -> Iterator[Caught]:
    """Demand that the block raises one of *kinds*, and that its message says *naming*."""
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
