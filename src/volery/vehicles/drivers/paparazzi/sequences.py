"""Steps and repeated set-points of the Paparazzi driver: modes, motors and positions in the local frame."""

from __future__ import annotations

from math import hypot, radians

from volery.base.errors import CapabilityError, Refused
from volery.base.position import AMSL, AboveHome, Position
from volery.base.time import MS, Ns, S
from volery.kernel.api import Action, Kernel
from volery.vehicles.driver import ManualControl, Step
from volery.vehicles.drivers.paparazzi.backend import BY_VELOCITY, STOP, PaparazziBackend, PprzSetpoint
from volery.vehicles.drivers.paparazzi.decoder import CHANGE, GUIDED, START
from volery.vehicles.drivers.steps import SetpointRepeater, at_rest, immediate_step, send_nothing
from volery.vehicles.telemetry import Velocity

CONTROL_PERIOD: Ns = 100 * MS
VELOCITY_PERIOD: Ns = 250 * MS
STOPS = 4
"""Least number of velocities of zero at the end of a velocity: 1 s."""
SLOWED, NOISE_M_S, TURNED_DEG = 0.5, 0.1, 2.0
"""Share of a slow velocity, error of the estimate, and turn within 1 s, at which it has stopped."""

STILL = PprzSetpoint(0.0, 0.0, 0.0, 0.0, BY_VELOCITY)

CHANGED_WITHIN: Ns = 8 * S
"""Time-out of mode changes and motors. ROTORCRAFT_STATUS arrives each 1.2 s where nothing changes."""
SETTINGS_WITHIN: Ns = 10 * S
POSITION_WITHIN: Ns = 5 * S
HEARD_WITHIN: Ns = 4 * S
"""Time-out until sticks by datalink count as a transmitter, which the status shows each 1.2 s."""
TRANSMITTER = (
    "if a transmitter is on, put its mode switch into the third position (AUTO2) or switch it off: "
    "it decides about the mode"
)
ARMING = "look at its arming status; it does not start its motors in KILL or with unaligned attitude"


class PaparazziSetpoints(SetpointRepeater):
    """Repeats velocities in GUIDED, and manual control in the modes that this program commanded."""

    def __init__(self, kernel: Kernel, backend: PaparazziBackend) -> None:
        super().__init__(
            kernel,
            backend.telemetry,
            GUIDED,
            velocity_period=VELOCITY_PERIOD,
            control_period=CONTROL_PERIOD,
        )
        self._backend = backend
        self._speed = 0.0  # commanded last, m/s
        self._headings: list[float] = []  # degrees, at each velocity of zero at the end of a velocity

    def follow_velocity(self, velocity: Velocity, yaw_rate: float, lasting: Ns) -> None:
        """Repeat a velocity for *lasting*, then a velocity of zero until the vehicle is seen to stand."""
        self._speed = hypot(*velocity)
        self._headings = []
        self.follow(lambda: self.send_velocity(velocity, yaw_rate), lasting)

    def has_stopped(self) -> bool:
        """Return whether a fresh position shows that it has stopped, and turns no more.

        The last velocity has no end: a command that is lost must be sent again.
        """
        seen = self._backend.telemetry
        self._headings.append(seen.attitude.heading)
        if len(self._headings) <= STOPS or self._backend.decoder.lacks_position() or not at_rest(seen):
            return False
        turned = (self._headings[-1] - self._headings[-1 - STOPS] + 180.0) % 360.0 - 180.0
        slow = self._speed == 0.0 or hypot(*seen.velocity) <= max(NOISE_M_S, SLOWED * self._speed)
        return slow and abs(turned) <= TURNED_DEG

    def send_stop(self) -> None:
        """Send a velocity of zero once."""
        self._backend.send_setpoint(STILL)

    def send_velocity(self, velocity: Velocity, yaw_rate: float) -> None:
        """Send a velocity and a turn rate once; zero once its position does not count any more."""
        if self._backend.decoder.lacks_position():
            self.send_stop()
            return
        north, east, up = velocity
        self._backend.send_setpoint(PprzSetpoint(north, east, -up, radians(yaw_rate), BY_VELOCITY))

    def is_commanded(self, mode: str) -> bool:
        """Return whether *mode* is one of ours."""
        return mode in self._backend.decoder.ours

    def send_control(self, control: ManualControl) -> None:
        """Send manual control like a transmitter."""
        self._backend.send_manual_control(control)


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
            answer=CHANGE,
            again=S,
            enters=mode,
            advice=TRANSMITTER if self.decoder.transmitter else "",
        )

    def guided(self) -> tuple[Step, ...]:
        """Return steps that enter GUIDED and only then release manual control."""
        return self.check_settings(), self.change_mode(GUIDED), self.release()

    def wait_for_sticks(self) -> Step:
        """Return a step that waits until sticks by datalink count; without them no mode obeys them."""
        return Step(
            ask="take its sticks from the datalink",
            send=send_nothing,
            done=lambda seen: self.decoder.transmitter,
            within=HEARD_WITHIN,
            skippable=True,
            advice="it must be built to take radio control from the datalink (RC_UP)",
        )

    def check_position(self, asked: str) -> None:
        """Raise ``Refused`` if it has no position that counts."""
        lack = self.decoder.lacks_position()
        if lack:
            raise Refused(self.telemetry.name, asked, f"{lack}; land() needs no position")

    def locate(self) -> Step:
        """Return a step that waits for a position that counts."""
        return Step(
            ask="tell its position",
            send=send_nothing,
            done=lambda seen: not self.decoder.lacks_position(),
            within=POSITION_WITHIN,
            skippable=True,
            advice="a position without a 3D fix counts for nothing",
        )

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
            fails=self.backend.wrong_setting,
            advice="it must answer GET_SETTING, and number its settings as in its XML: aircraft=PATH",
        )

    def start_motors(self) -> Step:
        """Return a step that arms in the present mode. Arming that ends in FAILSAFE is none."""
        return Step(
            ask="arm",
            send=lambda: self.backend.set_motors(True),
            done=lambda seen: seen.armed and not seen.failsafe,
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
        """Return north, east of the present position. Raises ``Refused`` without one that counts."""
        self.check_position("stay over its place")
        here = self.telemetry.position
        assert here is not None, "a position that counts was received"
        return self._ned(here)[:2]

    def at(self, goal: Position) -> PprzSetpoint:
        """Return the set-point of *goal* with the commanded heading."""
        return PprzSetpoint(*self._ned(goal), self.heading())

    def stay(self) -> None:
        """Send the present position as set-point, if it counts."""
        if self.telemetry.position is not None and not self.decoder.lacks_position():
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
