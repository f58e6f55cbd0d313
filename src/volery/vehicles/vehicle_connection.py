"""The connection of a vehicle: its state as the autopilot reports it, what it supports, and its link."""

from __future__ import annotations

from collections.abc import Callable

from volery.base.errors import CapabilityError, LinkLost, LinkSilent, NotArrived, VehicleError
from volery.base.position import Position
from volery.base.time import MINUTE, MS, Ns, S, from_seconds, to_seconds
from volery.kernel.api import Handle, Kernel
from volery.trace.events import Text
from volery.vehicles.driver import Capability, Driver
from volery.vehicles.executor import StepExecutor
from volery.vehicles.telemetry import REFRESHED_AFTER, Telemetry, describe_state

FIRST_MESSAGE_WITHIN_S = 10.0
LINK_RETURN_S = 30.0
"""How long the end of a program waits for a lost link."""

VERSION_WITHIN: Ns = 3 * S
SAID_AFTER: Ns = 5 * S
SAID_AGAIN_AFTER: Ns = 15 * S
"""Times after which a wait for a position is reported."""

ASK_PERIOD: Ns = 500 * MS
ASK_FOR: Ns = MINUTE
"""An autopilot that has not sent its parameters after this time will not send them."""
ON_LINK_LOSS = "if this program stops sending"
"""Beginning of the recorded line that states the vehicle's reaction to a lost link."""


class VehicleConnection:
    """What is known of a vehicle behind a driver, and whether it is there.

    Args:
        kernel: clock and tasks.
        name: name of the vehicle in messages and in the trace.
        kind: kind of vehicle that is expected: ``drone`` or ``rover``.
        driver: driver of its autopilot.
        executor: knows when the link is lost.
    """

    def __init__(self, kernel: Kernel, name: str, kind: str, driver: Driver, executor: StepExecutor) -> None:
        self.name = name
        self.kind = kind
        self._kernel = kernel
        self._driver = driver
        driver.telemetry.detects_silence = driver.cycle is None
        self._executor = executor
        self._supported: frozenset[Capability] = frozenset()  # as known once the vehicle was connected
        self._link_loss_query: Handle | None = None

    def poll(self) -> Telemetry:
        """Process received messages and return the telemetry."""
        if self._driver.cycle is not None:
            self._driver.poll()
        with self._kernel.interact():
            return self._driver.telemetry

    def known(self, what: str, value: Position | None) -> Position:
        """Return *value*; raise the error that *what* is not known yet where it is None."""
        if value is None:
            raise self.unknown(what)
        return value

    def unknown(self, what: str) -> VehicleError:
        """Return the error for something that the autopilot has not reported yet."""
        return VehicleError(self.name, what, "the autopilot does not know it yet; wait_ready() first")

    def wait_connected(self, within: float = FIRST_MESSAGE_WITHIN_S) -> None:
        """Wait for the first message of the autopilot.

        Args:
            within: longest time to wait, s.

        Raises:
            LinkSilent: nothing was received.
            LinkGarbled: something else was received; the error says what.
            CapabilityError: the vehicle is of another kind, or its firmware is not supported.
        """
        telemetry = self._driver.telemetry

        def connected() -> bool:
            return telemetry.last_message_ns >= 0 and self._driver.problem() is None

        with self._kernel.joined():
            is_connected = self._executor.wait(connected, from_seconds(within))
        if not is_connected:
            with self._kernel.interact():
                problem = self._driver.problem()
            if problem is not None:
                raise type(problem)(f"{self.name}: {problem}")
            raise LinkSilent(f"{self.name}: no message was received within {within:g} s")
        if not telemetry.kind:
            telemetry.kind = self.kind  # MAVROS does not report the kind of vehicle
            self.poll()  # the kind changes how messages are decoded
        if telemetry.kind != self.kind:
            raise CapabilityError(f"{self.name} is a {telemetry.kind}, not a {self.kind}")
        self._record_link_loss_reaction()

    def wait_for_version(self) -> None:
        """Wait until the autopilot has stated its version, for 3 s at most: not all do."""
        seen = self.poll()
        with self._kernel.joined():
            self._executor.wait(lambda: seen.version is not None, VERSION_WITHIN)

    def wait_located(self, within: float, tell: Callable[[str], object] | None = None) -> None:
        """Wait until the autopilot reports position and home.

        Args:
            within: longest time to wait, s; 0 does not wait.
            tell: receives what is missing, every few seconds.

        Raises:
            NotArrived: they are not known in time; the error names what is missing and what its GPS reports.
        """
        if within == 0.0 or not self._missing_place():
            return
        began = self._kernel.now()
        until, say_after = began + from_seconds(within), SAID_AFTER
        with self._kernel.joined():
            while self._missing_place():
                now = self._kernel.now()
                if now >= until:
                    what = f"{self._missing_place()} within {within:g} s; a wait of 0 s does not need it"
                    raise NotArrived(self.name, "connect", what)
                self._executor.wait(lambda: not self._missing_place(), min(until - now, say_after))
                missing, say_after = self._missing_place(), SAID_AGAIN_AFTER
                if missing and tell is not None:
                    tell(f"{self.name}: {missing} after {to_seconds(self._kernel.now() - began):.0f} s")

    def _missing_place(self) -> str:
        """Return what of position and home the autopilot does not report, in words; empty for nothing."""
        seen = self.poll()
        missing = [
            name for name, known in (("position", seen.position), ("home", seen.home)) if known is None
        ]
        if not missing:
            return ""
        gps = f"its GPS reports {seen.fix or 'nothing'}, {seen.satellites} satellites"
        return f"it has not reported its {' and its '.join(missing)} ({gps})"

    def _record_link_loss_reaction(self) -> None:
        """Record the reaction to a lost link as soon as it is known, without blocking."""
        if self._link_loss_query is not None:
            return
        until = self._kernel.now() + ASK_FOR

        def ask() -> None:
            line = self._driver.on_link_loss()
            if line:
                self._kernel.record(Text(self._kernel.now(), self.name, 6, f"{ON_LINK_LOSS}: {line}"))
            if line or self._kernel.now() >= until:
                query.cancel()

        with self._kernel.guard:
            self._link_loss_query = query = self._kernel.every(ASK_PERIOD, ask)

    def require(self, capability: Capability | None = None) -> None:
        """Process received messages; wait for the first one if there was none.

        Args:
            capability: what the vehicle must be able to do; ``CapabilityError`` if it cannot.
        """
        telemetry = self.poll()
        if telemetry.last_message_ns < 0 or telemetry.kind != self.kind:
            self.wait_connected()
        if capability is None:
            return
        problem = self._driver.problem()
        if isinstance(problem, CapabilityError):
            raise CapabilityError(f"{self.name}: {problem}")
        if capability not in self._supported:
            capabilities = self._driver.capabilities
            if capability not in capabilities:
                can = ", ".join(sorted(each.value for each in capabilities))
                raise CapabilityError(f"{self.name} cannot {capability.value}; it can {can}")
            self._supported |= capabilities

    def wait_for_link(self) -> None:
        """If the link is or was lost, give it time to return and telemetry time to become fresh."""
        telemetry = self._driver.telemetry
        if not telemetry.stale and not self._executor.link_lost():
            return
        if not self._executor.wait(
            lambda: not (telemetry.stale or self._executor.link_lost()), from_seconds(LINK_RETURN_S)
        ):
            raise LinkLost(
                f"{self.name}: the link did not return; it is unknown whether it has come to rest; last: "
                f"{describe_state(telemetry)}{', FLYING' if telemetry.flying else ''}, {self._reaction()}"
            )
        if not telemetry.detects_silence:
            self._executor.wait(lambda: False, REFRESHED_AFTER)

    def _reaction(self) -> str:
        return self._driver.on_link_loss() or "its reaction to a lost link is not known"

    def close(self) -> None:
        """Stop all communication, with the kernel's guard held."""
        if self._link_loss_query is not None:
            self._link_loss_query.cancel()
        self._driver.close()
