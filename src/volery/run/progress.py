"""Progress of a run while it executes, for the user interface."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

from volery.base.time import Ns, S
from volery.kernel.api import Kernel
from volery.trace.events import Event, Milestone, Text
from volery.vehicles.vehicle import ON_LINK_LOSS

PERIOD: Ns = S


@dataclass(frozen=True)
class VehicleProgress:
    """Present state of a vehicle. ``height`` is metres above the ground, or above home for a real vehicle."""

    name: str
    mode: str
    armed: bool
    height: float


@dataclass(frozen=True)
class Progress:
    """Present state of a run. ``limit`` is its latest end or 0, ``parcels`` the number by state."""

    now: Ns
    limit: Ns
    vehicles: tuple[VehicleProgress, ...]
    parcels: dict[str, int]


ReadVehicles = Callable[[], tuple[VehicleProgress, ...]]
"""Returns the present state of the vehicles."""

Show = Callable[[Progress], None]
"""Called about once a simulated second. It must not block."""


Tell = Callable[[str], None]
"""Called with a line that the user should read at once. It must not block."""


class LostLinkReporter:
    """Stream tap that reports what each vehicle does when the link to its commander is lost."""

    def __init__(self, tell: Tell) -> None:
        self._tell = tell

    def __call__(self, event: Event) -> None:
        """Report a text about the loss of the link."""
        if isinstance(event, Text) and event.text.startswith(ON_LINK_LOSS):
            self._tell(f"{event.source}: {event.text}")


class ProgressReporter:
    """Stream tap that reports the progress of a run periodically.

    Args:
        kernel: Clock of the run.
        limit: Latest end of the run, 0 for none.
        read: Returns the state of the vehicles.
        show: Receives the progress.
    """

    def __init__(self, kernel: Kernel, limit: Ns, read: ReadVehicles, show: Show) -> None:
        self._kernel = kernel
        self._limit = limit
        self._read = read
        self._show = show
        self._parcels: dict[str, str] = {}
        kernel.every(PERIOD, self._report)

    def __call__(self, event: Event) -> None:
        """Count parcels by state."""
        if isinstance(event, Milestone) and event.kind == "parcel":
            self._parcels[event.subject] = event.state

    def _report(self) -> None:
        parcels = dict(Counter(self._parcels.values()))
        self._show(Progress(self._kernel.now(), self._limit, self._read(), parcels))
