"""One tree of errors, split by who is at fault.

| class | at fault | examples |
|---|---|---|
| ``ModelError`` | your model file | a typo in a key, a cycle of required ports |
| ``UsageError`` | your call or option | an unknown URL scheme, coordinates off the globe |
| ``ComponentError`` | the code of a component | it raised, or it froze virtual time |
| ``CapabilityError`` | nobody: this vehicle cannot | mission upload where the autopilot has none |
| ``LinkError`` | the wire | silent, lost, garbled |
| ``VehicleError`` | the aircraft | refused, overridden, in failsafe, did not arrive |
| ``FleetError`` | several of a fleet | each vehicle's own error, by its name |
| ``EstimateError`` | a law of cost or physics | out of range, no figure for this processor |

A message names the offender and, where there are any, the valid choices. The command line shows the message
alone; a traceback is for ``--debug``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from typing import NamedTuple, Self


class VoleryError(Exception):
    """Anything this project raises on purpose."""

    def __reduce__(self) -> tuple[object, ...]:
        """How it gets to another process: as it is, whatever its constructor takes."""
        return _again, (type(self), self.args, self.__dict__)


def _again(kind: type[VoleryError], args: tuple[object, ...], state: Mapping[str, object]) -> VoleryError:
    made = kind.__new__(kind, *args)
    made.__dict__.update(state)
    return made


class Location(NamedTuple):
    """Where in a file something stands. Lines count from 1; 0 is no line (an option, a missing file)."""

    file: str
    line: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}" if self.line else self.file


class ModelError(VoleryError):
    """The model is wrong. Says file, line, path in the model, what is wrong and the valid choices."""

    def __init__(self, what: str, path: str = "", where: Location | None = None) -> None:
        self.what, self.path, self.where = what, path, where
        super().__init__(": ".join(part for part in (str(where) if where else "", path, what) if part))


class UsageError(VoleryError):
    """A call, an option or an address that makes no sense."""


class ComponentError(VoleryError):
    """A component's own code raised or misbehaved. The cause, if any, is chained."""

    def __init__(self, component: str, what: str) -> None:
        self.component, self.what = component, what
        super().__init__(f"{component}: {what}")


class CapabilityError(VoleryError):
    """This vehicle or autopilot cannot do what was asked; known before anything moved."""


class LinkError(VoleryError):
    """The wire to a vehicle is silent, lost or carries something else."""


class LinkSilent(LinkError):
    """Nobody answers at this address."""


class LinkLost(LinkError):
    """The autopilot spoke before and has fallen silent."""


class LinkGarbled(LinkError):
    """Bytes arrive, but they are not the protocol that was expected."""


class VehicleError(VoleryError):
    """The aircraft did not do it. Names the vehicle, what was asked and the autopilot's own words."""

    def __init__(self, vehicle: str, asked: str, what: str) -> None:
        self.vehicle, self.asked, self.what = vehicle, asked, what
        super().__init__(f"{vehicle}: {asked}: {what}")


class Refused(VehicleError):
    """The autopilot said no."""


class Overridden(VehicleError):
    """Somebody else, a pilot or another station, commands the vehicle now. Never fought."""


class Failsafe(Overridden):
    """The autopilot itself took over."""


class NotArrived(VehicleError):
    """It was not seen to be done within its time-out."""


class OutOfBounds(VehicleError):
    """Outside what the fence or the stated limits allow: a goal or a path, refused before anything moved; or
    the vehicle itself, which has strayed while it travelled.
    """


class LowBattery(VehicleError):
    """The battery is below the stated reserve: nothing but the way down or home is begun any more."""


class FleetError(ExceptionGroup[Exception], VoleryError):
    """What went wrong with some vehicles of a fleet, by their names; the others did what was asked.

    It is a group of exceptions, too: ``except* Refused`` picks from it.
    """

    failed: Mapping[str, Exception]

    def __new__(cls, asked: str, failed: Mapping[str, Exception]) -> Self:
        """*failed* has at least one error."""
        made = super().__new__(cls, asked, list(failed.values()))
        made.failed = dict(failed)
        return made

    def __init__(self, asked: str, failed: Mapping[str, Exception]) -> None:
        super().__init__(asked, list(failed.values()))

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.message, self.failed)

    def derive(self, errors: Sequence[Exception]) -> ExceptionGroup[Exception]:  # type: ignore[override]  # typeshed states a group of any exceptions
        """The part of it that ``except*`` did not take."""
        left = {name: error for name, error in self.failed.items() if error in errors}
        return FleetError(self.message, left)

    def __str__(self) -> str:
        told = (f"{name}: {_said(name, error)}" for name, error in self.failed.items())
        return f"{self.message}: {len(self.failed)} failed: " + "; ".join(told)


def _said(name: str, error: Exception) -> str:
    said = str(error) if isinstance(error, VoleryError) else f"{type(error).__name__}: {error}"
    return said.removeprefix(f"{name}: ")


class EstimateError(VoleryError):
    """A law has no figure for this, or was asked outside its range of validity."""


class Deadlock(VoleryError):
    """Nothing is left to happen while tasks still wait. Names who waits for what."""


def choices(names: Iterable[str]) -> str:
    """``a, b or c``: how a message lists what would have been valid."""
    listed = sorted(names)
    if not listed:
        return "nothing"
    if len(listed) == 1:
        return listed[0]
    return f"{', '.join(listed[:-1])} or {listed[-1]}"


def did_you_mean(wrong: str, names: Iterable[str]) -> str:
    """`` (did you mean 'x'?)`` if one of *names* is close to *wrong*, else an empty string."""
    close = get_close_matches(wrong, list(names), n=1)
    return f" (did you mean {close[0]!r}?)" if close else ""
