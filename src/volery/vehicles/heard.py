"""A vehicle as something that is heard: whether it is there, of the right kind, and able."""

from __future__ import annotations

from volery.base.errors import CapabilityError, LinkLost, LinkSilent, VehicleError
from volery.base.position import Position
from volery.base.time import MINUTE, MS, Ns, from_seconds
from volery.kernel.api import Handle, Kernel
from volery.trace.events import Text
from volery.vehicles.driver import Capability, Driver
from volery.vehicles.perform import Performer
from volery.vehicles.telemetry import Telemetry

HEARD_WITHIN_S = 10.0
RETURN_OF_LINK_S = 30.0
TOLD_ANEW_S = 2.0
"""After a link has returned everything that counts has been said again within this time."""

ASK_PERIOD: Ns = 500 * MS
ASKED_FOR: Ns = MINUTE
"""An autopilot that has not told its parameters by then will not."""

IF_SILENT = "if this program falls silent"
"""How the line begins that says what a vehicle then does."""


class Heard:
    """``Commanded`` adds what it is told to do."""

    kind = ""

    def __init__(self, kernel: Kernel, name: str, driver: Driver, silence: Ns) -> None:
        self.name = name
        self._kernel = kernel
        self._driver = driver
        self._performer = Performer(kernel, driver, silence)
        self._asking: Handle | None = None

    @property
    def kernel(self) -> Kernel:
        """The clock that it lives on."""
        return self._kernel

    def _look(self) -> Telemetry:
        if self._driver.cycle is not None:
            self._driver.look()
        with self._kernel:
            return self._driver.telemetry

    def _known(self, what: str, value: Position | None) -> Position:
        if value is None:
            raise VehicleError(self.name, what, "the autopilot does not know it yet; wait_ready() first")
        return value

    def wait_heard(self, within: float = HEARD_WITHIN_S) -> None:
        """Until the autopilot is heard. Raises ``LinkSilent`` or ``LinkGarbled``: what is there instead."""
        seen = self._driver.telemetry

        def well_heard() -> bool:
            return seen.heard >= 0 and self._driver.problem() is None

        if not self._performer.wait(well_heard, from_seconds(within)):
            with self._kernel:
                problem = self._driver.problem()
            if problem is not None:
                raise type(problem)(f"{self.name}: {problem}")
            raise LinkSilent(f"{self.name}: nothing was heard within {within:g} s")
        if not seen.kind:
            seen.kind = self.kind  # MAVROS does not say what it is
            self._look()  # what was heard may mean another thing now
        if seen.kind != self.kind:
            raise CapabilityError(f"{self.name} is a {seen.kind}, not a {self.kind}")
        self._tell_if_silent()

    def _tell_if_silent(self) -> None:
        """Record what it does if its commander falls silent, as soon as that is known. Nobody waits."""
        if self._asking is not None:
            return

        until = self._kernel.now() + ASKED_FOR

        def ask() -> None:
            line = self._driver.if_silent()
            if line:
                self._kernel.record(Text(self._kernel.now(), self.name, 6, f"{IF_SILENT}: {line}"))
            if line or self._kernel.now() >= until:
                asking.cancel()

        with self._kernel.guard:
            self._asking = asking = self._kernel.every(ASK_PERIOD, ask)

    def _hear(self) -> None:
        """What comes before every operation: take in what has arrived, and wait if nothing ever has."""
        self._look()
        if self._driver.telemetry.heard < 0 or self._driver.telemetry.kind != self.kind:
            self.wait_heard()

    def _require(self, capability: Capability) -> None:
        self._hear()
        problem = self._driver.problem()
        if isinstance(problem, CapabilityError):
            raise CapabilityError(f"{self.name}: {problem}")
        if capability not in self._driver.capabilities:
            can = ", ".join(sorted(each.value for each in self._driver.capabilities))
            raise CapabilityError(f"{self.name} cannot {capability.value}; it can {can}")

    def _wait_for_link(self) -> None:
        """If it is lost at this moment, give it time to return, and then to say what it does meanwhile."""
        if not self._performer.silent():
            return
        if not self._performer.wait(lambda: not self._performer.silent(), from_seconds(RETURN_OF_LINK_S)):
            raise LinkLost(f"{self.name}: the link did not return; nobody knows whether it has come to rest")
        self._performer.wait(lambda: False, from_seconds(TOLD_ANEW_S))
