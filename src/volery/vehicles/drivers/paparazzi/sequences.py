"""Steps of the Paparazzi driver: modes, motors, positions in the local frame, take-off and landing.

Take-off and landing use blocks of the flight plan in NAV, or GUIDED where NAV would turn back: in NAV an
aircraft returns by itself if it is further from home than its plan allows. Blocks are therefore flown only
well inside that distance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import radians

from volery.base.errors import CapabilityError, Refused
from volery.base.position import AMSL, AboveHome, Position
from volery.base.time import Ns, S
from volery.kernel.api import Action, Kernel
from volery.vehicles.driver import Step
from volery.vehicles.drivers.paparazzi.backend import (
    COME_DOWN,
    STOP,
    VELOCITY_Z,
    PaparazziBackend,
    PaparazziSetpoints,
    Setpoint,
)
from volery.vehicles.drivers.paparazzi.modes import (
    FAILSAFE,
    GUIDED,
    KILL,
    LAND_BLOCK,
    NAV,
    START,
    START_BLOCK,
    TAKEOFF_BLOCK,
)
from volery.vehicles.drivers.steps import (
    climbed_to,
    disarmed_step,
    horizontal_distance,
    immediate_step,
    send_nothing,
)
from volery.vehicles.telemetry import Telemetry

CHANGED_WITHIN: Ns = 8 * S
"""Time-out of mode changes and motors. ROTORCRAFT_STATUS arrives each 1.2 s where nothing changes."""
SETTINGS_WITHIN: Ns = 10 * S
BLOCK_WITHIN: Ns = 15 * S

LIFTED_M = 1.0
"""Height above the ground at which the take-off block is done."""
SINKING_M_S = 0.8
"""Rate of descent in GUIDED; the blocks of the stock plan use the same."""
WELL_INSIDE = 0.9
"""Share of the distance at which NAV turns back, inside which blocks are flown."""

TRANSMITTER = (
    "if a transmitter is on, put its mode switch into the third position (AUTO2) or switch it off: "
    "it decides about the mode"
)
ARMING = "look at its arming status; it does not start its motors in KILL or with unaligned attitude"


class PaparazziSteps:
    """Common steps for one aircraft. ``yaw`` is the heading commanded last, radians."""

    def __init__(self, kernel: Kernel, backend: PaparazziBackend) -> None:
        self.kernel = kernel
        self.backend = backend
        self.telemetry = backend.telemetry
        self.decoder = backend.decoder
        self.setpoints = PaparazziSetpoints(kernel, backend)
        self.yaw: float | None = None

    # -- modes and motors

    def change_mode(self, mode: str, send: Action | None = None) -> Step:
        """Return a step that enters *mode*, by *send* if there is another way than settings."""
        self.setpoints.end_velocity()
        return Step(
            ask=f"change to {mode}",
            send=send or (lambda: self.backend.set_mode(mode)),
            done=lambda seen: seen.mode == mode,
            within=CHANGED_WITHIN,
            skippable=True,
            again=S,
            enters=mode,
            advice=TRANSMITTER,
        )

    def guided(self) -> tuple[Step, Step]:
        """Return steps that enter GUIDED and only then release manual control."""
        return self.change_mode(GUIDED), self.release()

    def release(self) -> Step:
        """Return a step that releases manual control."""
        return immediate_step("let go of the sticks", self.setpoints.release)

    def check_settings(self) -> Step:
        """Return a step that waits for the check of the setting numbers; nothing is written before."""
        return Step(
            ask="tell its settings",
            send=send_nothing,
            done=lambda seen: self.decoder.settings_checked,
            within=SETTINGS_WITHIN,
            skippable=True,
            advice="it must answer GET_SETTING, and number its settings as in its XML: aircraft=PATH",
        )

    def start_motors(self) -> Step:
        """Return a step that arms in the present mode; from KILL, where motors do not start, in GUIDED."""

        def send() -> None:
            if self.telemetry.mode == KILL:
                self.backend.set_mode(GUIDED)
            self.backend.set_motors(True)

        return Step(
            ask="arm",
            send=send,
            done=lambda seen: seen.armed,
            within=CHANGED_WITHIN,
            skippable=True,
            answer=START,
            again=3 * S,
            advice=ARMING,
        )

    def stop_motors(self, *, force: bool = False) -> Step:
        """Return a step that stops the motors; *force* also sends the emergency command."""

        def send() -> None:
            if force:
                self.backend.send_emergency(STOP)
            self.backend.set_motors(False)

        return Step(
            ask="disarm",
            send=send,
            done=lambda seen: not seen.armed,
            within=CHANGED_WITHIN,
            skippable=True,
            again=S,
        )

    # -- positions

    def heading(self) -> float:
        """Return the heading commanded last, else the present one; radians."""
        return self.yaw if self.yaw is not None else radians(self.telemetry.attitude.heading)

    def spot(self) -> tuple[float, float]:
        """Return north, east of the present position; the origin before the first position."""
        here = self.telemetry.position
        return self._ned(here)[:2] if here is not None else (0.0, 0.0)

    def at(self, goal: Position) -> Setpoint:
        """Return the set-point of *goal* with the commanded heading."""
        return Setpoint(*self._ned(goal), self.heading())

    def stay(self) -> None:
        """Send the present position as set-point."""
        if self.telemetry.position is not None:
            self.backend.send_setpoint(self.at(self.telemetry.position))

    def _ned(self, place: Position) -> tuple[float, float, float]:
        """Return north, east, down in the local frame."""
        name, origin = self.telemetry.name, self.decoder.origin
        if origin is None:
            raise Refused(
                name, f"go to {place}", "it has not reported the origin of its local frame (INS_REF)"
            )
        if isinstance(place.altitude, AboveHome):
            amsl = origin.amsl + place.altitude.metres
        elif isinstance(place.altitude, AMSL):
            amsl = place.altitude.metres
        else:
            raise CapabilityError(f"{name}: {place.altitude}: it flies to AMSL or above home only")
        east, north, up = origin.enu(place.latitude, place.longitude, amsl)
        return north, east, -up


@dataclass(frozen=True)
class Blocks:
    """Names of the blocks of the flight plan that are flown."""

    start: str = START_BLOCK
    takeoff: str = TAKEOFF_BLOCK
    land: str = LAND_BLOCK


class TakeoffAndLanding:
    """Steps of take-off and landing. Raises ``UsageError`` if the flight plan does not have the blocks."""

    def __init__(self, steps: PaparazziSteps, blocks: Blocks) -> None:
        self._steps = steps
        self._backend = steps.backend
        self._telemetry = steps.telemetry
        self._blocks = blocks
        for block in (blocks.start, blocks.takeoff, blocks.land):
            self._backend.aircraft.block(block)

    def _by_plan(self) -> bool:
        """Return whether it is so near home that NAV does not turn back; assumed without a position."""
        telemetry, farthest = self._telemetry, self._backend.aircraft.farthest
        if farthest is None or telemetry.home is None or telemetry.position is None:
            return True
        return horizontal_distance(telemetry.position, telemetry.home) <= WELL_INSIDE * farthest

    # -- take-off

    def climb(self, height: float, within: Ns) -> Sequence[Step]:
        """Return steps from the ground to *height* metres above home, in GUIDED at the end."""
        steps = self._steps
        steps.yaw = None
        spot: list[tuple[float, float]] = []

        def send() -> None:
            if not spot:
                spot.append(steps.spot())
            self._backend.send_setpoint(Setpoint(*spot[0], -height, steps.heading()))

        straight_up = Step(
            ask=f"climb to {height:g} m",
            send=send,
            done=climbed_to(height),
            within=within,
            again=S,
            mode=GUIDED,
            armed=True,
        )
        if self._by_plan():
            enter = steps.change_mode(NAV)
            return (enter, self._start_block(), self._takeoff_block(within), *steps.guided(), straight_up)
        return (*steps.guided(), replace(steps.start_motors(), mode=GUIDED), straight_up)

    def _start_block(self) -> Step:
        return Step(
            ask="start the motors",
            send=lambda: self._backend.enter_block(self._blocks.start),
            done=lambda seen: seen.armed,
            within=BLOCK_WITHIN,
            skippable=True,
            again=2 * S,
            mode=NAV,
            advice=ARMING,
        )

    def _takeoff_block(self, within: Ns) -> Step:
        ground: list[float] = []

        def send() -> None:
            ground.append(self._telemetry.above_home)
            self._backend.enter_block(self._blocks.takeoff)

        return Step(
            ask="lift off",
            send=send,
            done=lambda seen: seen.above_home >= ground[0] + LIFTED_M,
            within=within,
            again=5 * S,
            mode=NAV,
            armed=True,
            advice=f"look at what block {self._blocks.takeoff!r} of its flight plan does",
        )

    # -- landing

    def land(self, within: Ns) -> Sequence[Step]:
        """Return steps that land in place; without a fix in FAILSAFE, which needs no position."""
        steps = self._steps
        steps.yaw = None
        if steps.decoder.good_fix:
            return self.land_by_plan(within) if self._by_plan() else self._descend(within)

        def fail_safely() -> None:
            self._backend.set_mode(FAILSAFE)
            self._backend.send_emergency(COME_DOWN)

        enter = steps.change_mode(FAILSAFE, fail_safely)
        return (enter, steps.release(), disarmed_step("land", FAILSAFE, within, (KILL,)))

    def land_by_plan(self, within: Ns) -> Sequence[Step]:
        """Return steps that land by the landing block."""
        steps = self._steps
        enter = self._landing_block()
        return (
            enter,
            steps.change_mode(NAV),
            steps.release(),
            disarmed_step("land", NAV, within, (KILL,)),
        )

    def _landing_block(self) -> Step:
        """Return a step that enters the block before NAV, in which the previous block would be flown."""
        steps = self._steps
        number = self._backend.aircraft.block(self._blocks.land).number
        sent_at: list[Ns] = []

        def send() -> None:
            sent_at.append(steps.kernel.now())
            self._backend.enter_block(self._blocks.land)

        def landing(seen: Telemetry) -> bool:
            reported_at, block = steps.decoder.block
            return not seen.armed or (reported_at > sent_at[0] and block >= number)

        return Step(
            ask=f"go to block {self._blocks.land!r}",
            send=send,
            done=landing,
            within=BLOCK_WITHIN,
            again=4 * S,
            mode=self._telemetry.mode,
        )

    def _descend(self, within: Ns) -> Sequence[Step]:
        """Return steps that descend vertically in GUIDED until landed, then stop the motors."""
        steps = self._steps
        spot: list[tuple[float, float]] = []

        def send() -> None:
            if not spot:
                spot.append(steps.spot())
            self._backend.send_setpoint(Setpoint(*spot[0], SINKING_M_S, steps.heading(), VELOCITY_Z))

        descend = Step(
            ask="descend",
            send=send,
            done=lambda seen: not seen.flying,
            within=within,
            again=S,
            mode=GUIDED,
            leads_to=(KILL,),
        )
        return (*steps.guided(), descend, steps.stop_motors())
