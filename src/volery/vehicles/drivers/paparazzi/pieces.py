"""Pieces that sequences of steps are made of: modes, motors, and places in the aircraft's local frame."""

from __future__ import annotations

from math import radians

from volery.base.errors import CapabilityError, Refused
from volery.base.position import AMSL, AboveHome, Position
from volery.base.time import Ns, S
from volery.kernel.api import Action, Kernel
from volery.vehicles.driver import Step
from volery.vehicles.drivers.paparazzi.modes import GUIDED, KILL, START
from volery.vehicles.drivers.paparazzi.setpoints import Setpoints
from volery.vehicles.drivers.paparazzi.uplink import STOP, Setpoint, Uplink
from volery.vehicles.drivers.steps import at_once, nothing

CHANGED_WITHIN: Ns = 8 * S
"""Of a mode; and of the motors. ROTORCRAFT_STATUS comes each 1.2 s where nothing changes."""

SETTLED_WITHIN: Ns = 10 * S

TRANSMITTER = (
    "if a transmitter is on, put its mode switch into the third position (AUTO2) or switch it off: "
    "it decides about the mode"
)
ARMING = "look at its arming status; it does not start its motors in KILL or with unaligned attitude"


class Pieces:
    """What it takes to say something to one aircraft. ``yaw`` is the heading last asked for, radians."""

    def __init__(self, kernel: Kernel, uplink: Uplink) -> None:
        self.kernel = kernel
        self.uplink = uplink
        self.telemetry = uplink.telemetry
        self.hearing = uplink.hearing
        self.setpoints = Setpoints(kernel, uplink)
        self.yaw: float | None = None

    # -- steps

    def change(self, mode: str, send: Action | None = None) -> Step:
        """Enter *mode*; by *send* where there is another way than settings."""
        self.setpoints.unfollow()
        return Step(
            ask=f"change to {mode}",
            send=send or (lambda: self.uplink.mode(mode)),
            done=lambda seen: seen.mode == mode,
            within=CHANGED_WITHIN,
            skippable=True,
            again=S,
            enters=mode,
            advice=TRANSMITTER,
        )

    def guided(self) -> tuple[Step, Step]:
        """GUIDED first; only then are the sticks let go."""
        return self.change(GUIDED), self.let_go()

    def let_go(self) -> Step:
        """No sticks any more."""
        return at_once("let go of the sticks", self.setpoints.release)

    def know_settings(self) -> Step:
        """Nothing is written before."""
        return Step(
            ask="tell its settings",
            send=nothing,
            done=lambda seen: self.hearing.settled,
            within=SETTLED_WITHIN,
            skippable=True,
            advice="it must answer GET_SETTING, and number its settings as in its XML: aircraft=PATH",
        )

    def start_motors(self) -> Step:
        """In the mode it is in; from KILL, where motors do not start, by way of GUIDED."""

        def send() -> None:
            if self.telemetry.mode == KILL:
                self.uplink.mode(GUIDED)
            self.uplink.motors(True)

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
        """*force*: in every way there is."""

        def send() -> None:
            if force:
                self.uplink.emergency(STOP)
            self.uplink.motors(False)

        return Step(
            ask="disarm",
            send=send,
            done=lambda seen: not seen.armed,
            within=CHANGED_WITHIN,
            skippable=True,
            again=S,
        )

    # -- places

    def heading(self) -> float:
        """The one last asked for, else the one it has; radians."""
        return self.yaw if self.yaw is not None else radians(self.telemetry.attitude.heading)

    def spot(self) -> tuple[float, float]:
        """North, east of where it is; the origin as long as it has told no place."""
        here = self.telemetry.position
        return self._ned(here)[:2] if here is not None else (0.0, 0.0)

    def at(self, goal: Position) -> Setpoint:
        """*goal*, with the heading as it is to be."""
        return Setpoint(*self._ned(goal), self.heading())

    def stay(self) -> None:
        """Be told to be where it is."""
        if self.telemetry.position is not None:
            self.uplink.setpoint(self.at(self.telemetry.position))

    def _ned(self, place: Position) -> tuple[float, float, float]:
        """North, east, down in the local frame."""
        name, origin = self.telemetry.name, self.hearing.origin
        if origin is None:
            raise Refused(name, f"go to {place}", "it has not told the origin of its local frame (INS_REF)")
        if isinstance(place.altitude, AboveHome):
            amsl = origin.amsl + place.altitude.metres
        elif isinstance(place.altitude, AMSL):
            amsl = place.altitude.metres
        else:
            raise CapabilityError(f"{name}: {place.altitude}: it flies to AMSL or above home only")
        east, north, up = origin.enu(place.latitude, place.longitude, amsl)
        return north, east, -up
