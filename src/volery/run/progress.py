"""What a run says of itself while it goes on, for whoever shows it."""

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
    """A vehicle as it is now: the autopilot's mode, whether it is armed, metres above the ground (of a real
    one, above home).
    """

    name: str
    mode: str
    armed: bool
    height: float


@dataclass(frozen=True)
class Progress:
    """Where a run stands. ``limit`` is when it ends at the latest; ``parcels`` counts parcels by state."""

    now: Ns
    limit: Ns
    vehicles: tuple[VehicleProgress, ...]
    parcels: dict[str, int]


ReadVehicles = Callable[[], tuple[VehicleProgress, ...]]
"""What vehicles do now."""

Show = Callable[[Progress], None]
"""Called about once a simulated second. It must not block and changes nothing."""


Tell = Callable[[str], None]
"""Called with a line that is worth reading at once. It must not block and changes nothing."""


class LostLinkReporter:
    """Passes on what vehicles are known to do if their commander falls silent. A tap of a run's stream."""

    def __init__(self, tell: Tell) -> None:
        self._tell = tell

    def __call__(self, event: Event) -> None:
        """Follow texts."""
        if isinstance(event, Text) and event.text.startswith(ON_LINK_LOSS):
            self._tell(f"{event.source}: {event.text}")


class ProgressReporter:
    """Tells *show* how a run goes; *look* says what its vehicles do. A tap of its stream."""

    def __init__(self, kernel: Kernel, limit: Ns, look: ReadVehicles, show: Show) -> None:
        self._kernel = kernel
        self._limit = limit
        self._look = look
        self._show = show
        self._parcels: dict[str, str] = {}
        kernel.every(PERIOD, self._tell)

    def __call__(self, event: Event) -> None:
        """Follow parcels."""
        if isinstance(event, Milestone) and event.kind == "parcel":
            self._parcels[event.subject] = event.state

    def _tell(self) -> None:
        parcels = dict(Counter(self._parcels.values()))
        self._show(Progress(self._kernel.now(), self._limit, self._look(), parcels))
