"""The last line of defence: what the autopilot does by itself if this program is killed.

SIGKILL, a lost power supply or a crashed operating system leave no program that could land a vehicle. The
autopilot's failsafe for a lost link does; it is asked for before the flight and restored after it.
"""

from __future__ import annotations

from volery.base.errors import VoleryError
from volery.trace.events import INFO, WARNING, Text
from volery.vehicles import Vehicle
from volery.vehicles.driver import LinkLossAction
from volery.vehicles.vehicle_connection import ON_LINK_LOSS


class LastDefence:
    """A vehicle that returns, lands or hovers if this program is killed; see ``ending.Landable``.

    Args:
        vehicle: The vehicle.
        action: What it does then.
    """

    def __init__(self, vehicle: Vehicle, action: LinkLossAction) -> None:
        self._vehicle = vehicle
        self._action = action
        self._before: dict[str, float] = {}

    @property
    def name(self) -> str:
        """Name of the vehicle."""
        return self._vehicle.name

    def ask(self) -> None:
        """Set the parameters of its failsafe. Raises what ``Vehicle.set_link_loss_action`` raises."""
        changed = self._vehicle.set_link_loss_action(self._action)
        self._before = {name: before for name, (before, _) in changed.items()}
        settings = ", ".join(f"{name}={now:g}, was {before:g}" for name, (before, now) in changed.items())
        self._record(INFO, f"it is asked to {self._action} ({settings or 'no parameter had to be changed'})")

    def come_to_rest(self) -> str:
        """Bring the vehicle to rest, then restore its parameters; if it is not at rest they stay."""
        found = self._vehicle.come_to_rest()
        for name, before in self._before.items():
            try:
                self._vehicle.parameters.set(name, before)
            except VoleryError as error:
                self._record(WARNING, f"{name} could not be restored, set it to {before:g}: {error}")
        if self._before:
            restored = ", ".join(f"{name}={before:g}" for name, before in self._before.items())
            self._record(INFO, f"it does again what it did before ({restored})")
        return found

    def _record(self, severity: int, text: str) -> None:
        kernel = self._vehicle.kernel
        with kernel.guard:
            kernel.record(Text(kernel.now(), self.name, severity, f"{ON_LINK_LOSS}: {text}"))
