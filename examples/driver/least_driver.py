"""A driver of no more than every driver has: of an imaginary drone that is at once where it is sent."""

from collections.abc import Sequence

from volery import AMSL, Position
from volery.base.time import MS, Ns, S
from volery.kernel.api import Kernel
from volery.vehicles import Capability, Driver
from volery.vehicles.driver import Step
from volery.vehicles.telemetry import Telemetry, Velocity


class LeastDriver(Driver):
    """Obeys at once; a real driver sends a message where this one changes its own telemetry.

    Args:
        kernel: clock and tasks.
        name: name of the vehicle.
        home: where it stands, AMSL.
    """

    offboard_mode = "OBEYS"
    capabilities = frozenset(
        {Capability.TAKEOFF, Capability.GOTO, Capability.HOLD, Capability.RETURN_HOME, Capability.LAND}
    )

    def __init__(self, kernel: Kernel, name: str, home: Position) -> None:
        self.name, self.telemetry = name, Telemetry(kernel, name)
        self.telemetry.kind, self.telemetry.mode, self.telemetry.home = "drone", "OBEYS", home
        self.telemetry.velocity, self.telemetry.ready = Velocity(0.0, 0.0, 0.0), True
        self._kernel, self._home, self._place = kernel, home, home
        self._reports = kernel.every(100 * MS, self._report)

    def _report(self) -> None:
        """Do what a decoder does with a message."""
        self.telemetry.note_message(self._kernel.now())
        self.telemetry.update_position(self._place)
        self.telemetry.above_home = self._place.altitude.metres - self._home.altitude.metres
        self.telemetry.changed.notify()

    def _order(self, ask: str, place: Position, *, armed: bool, flying: bool) -> Sequence[Step]:
        """Return the step of an operation: what is sent, and how telemetry shows that it is done."""

        def send() -> None:
            self._place = place
            self.telemetry.armed, self.telemetry.flying = armed, flying

        return (Step(ask=ask, send=send, done=lambda seen: seen.position == place, within=10 * S),)

    def _above(self, place: Position, height: float) -> Position:
        return Position(place.latitude, place.longitude, AMSL(self._home.altitude.metres + height))

    def ready(self, within: Ns) -> Sequence[Step]:
        return ()

    def arm(self) -> Sequence[Step]:
        return self._order("arm", self._place, armed=True, flying=False)

    def disarm(self, force: bool) -> Sequence[Step]:
        return self._order("disarm", self._above(self._place, 0.0), armed=False, flying=False)

    def takeoff(self, height: float, within: Ns) -> Sequence[Step]:
        return self._order("take off", self._above(self._place, height), armed=True, flying=True)

    def goto(self, goal: Position, speed: float | None, within: Ns) -> Sequence[Step]:
        place = goal if isinstance(goal.altitude, AMSL) else self._above(goal, goal.altitude.metres)
        return self._order(f"go to {goal}", place, armed=True, flying=True)

    def hold(self) -> Sequence[Step]:
        return self._order("hold", self._place, armed=True, flying=True)

    def return_home(self, within: Ns) -> Sequence[Step]:
        return self._order("return home", self._home, armed=False, flying=False)

    def land(self, within: Ns) -> Sequence[Step]:
        return self._order("land", self._above(self._place, 0.0), armed=False, flying=False)

    def stop(self) -> None:
        """Nothing is repeated."""

    def problem(self) -> None:
        """Nothing can be wrong."""

    def close(self) -> None:
        self._reports.cancel()
