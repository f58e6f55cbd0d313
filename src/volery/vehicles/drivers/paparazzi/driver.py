"""Driver of Paparazzi rotorcraft: the steps of each operation.

Facts from public definitions and sources; see ``decoder.ASSUMED``. Nothing is acknowledged. Motors start and
stop by a setting or by a block of the flight plan. Blocks take off and land; in between the aircraft follows
set-points in GUIDED, which last until the next one. Telemetry is late: a position by 0.25 s, a change of mode
by up to 1.2 s, a block by up to 1.6 s. A position without a fix counts for nothing: in GUIDED the aircraft
would follow it for hundreds of metres.

On a lost link nothing happens in GUIDED: neither the ground station nor a transmitter nor, by the sources, a
fence is monitored. In NAV the plan's own rules hold. Manual modes become FAILSAFE when manual control ends.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import radians

from volery.base.errors import CapabilityError, NotArrived, Refused
from volery.base.position import AboveHome, Position
from volery.base.time import Ns, S
from volery.kernel.api import Action, Kernel
from volery.vehicles.driver import (
    Capability,
    LinkLossAction,
    ManualControl,
    ServicesDriver,
    SetpointDriver,
    Settings,
    Step,
)
from volery.vehicles.drivers.paparazzi.backend import PaparazziBackend
from volery.vehicles.drivers.paparazzi.decoder import ATTITUDE_MODE, FAILSAFE, GUIDED, HEIGHT_MODE
from volery.vehicles.drivers.paparazzi.sequences import PaparazziSteps
from volery.vehicles.drivers.paparazzi.services import PaparazziServices
from volery.vehicles.drivers.paparazzi.takeoff_and_landing import LIFTED_M, Blocks, TakeoffAndLanding
from volery.vehicles.drivers.steps import (
    DRONE_KIND,
    READY_WITHIN,
    TURNED_WITHIN,
    Takeover,
    TargetMonitor,
    check_throttle,
    heading_reached,
    immediate_step,
    ready_step,
)
from volery.vehicles.telemetry import Velocity

CAPABILITIES = frozenset(
    {
        Capability.TAKEOFF,
        Capability.GOTO,
        Capability.VELOCITY,
        Capability.HEADING,
        Capability.RETURN_HOME,
        Capability.LAND,
        Capability.HOLD,
        Capability.MANUAL_CONTROL,
        Capability.STABILIZE,
        Capability.ALTITUDE_HOLD,
    }
)
"""No speed: GUIDED flies at the aircraft's own. No missions: a flight plan is built into the aircraft. No
climb by throttle: version 6.2 does not follow it in ATTITUDE_RC_CLIMB.
"""
_NONE: frozenset[Capability] = frozenset()


class Paparazzi(SetpointDriver, ServicesDriver):
    """Driver of a Paparazzi rotorcraft. See ``vehicles.driver.Driver`` for the operations.

    Raises ``UsageError`` if the aircraft's flight plan does not have *blocks*.
    """

    landing_modes = frozenset({FAILSAFE})
    cycle: Action | None = None

    def __init__(self, kernel: Kernel, backend: PaparazziBackend, blocks: Blocks) -> None:
        self.name = backend.telemetry.name
        self.telemetry = backend.telemetry
        self._backend = backend
        self._services = PaparazziServices(kernel, backend)
        self._steps = PaparazziSteps(kernel, backend)
        self._setpoints = self._steps.setpoints
        self.problem = backend.problem
        self.stop = self._setpoints.end
        self._takeoff_and_landing = TakeoffAndLanding(self._steps, blocks)
        self._takeover = Takeover(kernel, backend.telemetry, GUIDED)

    @property
    def offboard_mode(self) -> str:
        """GUIDED; words that are no mode while another station has control in it."""
        return self._takeover.offboard_mode

    @property
    def capabilities(self) -> frozenset[Capability]:
        """Capabilities of a rotorcraft; none before the first message."""
        return CAPABILITIES if self.telemetry.kind == DRONE_KIND else _NONE

    def poll(self) -> None:
        """Do nothing: messages are processed as they arrive."""

    @property
    def services(self) -> PaparazziServices:
        """Parameters and payload, as far as it has them."""
        return self._services

    def on_link_loss(self) -> str:
        """Return the reaction to a lost link, as far as the flight plan states it."""
        if self.telemetry.kind != DRONE_KIND:
            return ""
        farthest = self._backend.aircraft.farthest
        far = f", further than {farthest:g} m from home it turns back" if farthest else ""
        return (
            "in GUIDED it does not react: it flies to its last set-point and stays there, and a velocity "
            f"goes on without end; in NAV (taking off, landing) it goes on with its plan{far}; flown by "
            "sticks it descends (FAILSAFE)"
        )

    def link_loss_settings(self, action: LinkLossAction) -> Settings:
        """Raise: what a Paparazzi does is compiled into it, and nothing of it acts in GUIDED."""
        raise CapabilityError(
            f"{self.name}: a Paparazzi cannot be made to {action} when this program is killed: what it does "
            "without a datalink is an exception of its flight plan or GEOFENCE_DATALINK_LOST_TIME of its "
            "airframe file; both are compiled in, and neither acts in GUIDED"
        )

    def close(self) -> None:
        """Stop all communication and release the link."""
        self.stop()
        self._takeover.end()
        self._backend.close()

    # -- on the ground

    def ready(self, within: Ns) -> Sequence[Step]:
        """Wait for a fix, an origin, an aligned attitude, and checked settings."""
        advice = (
            "it needs a 3D fix, an origin (blocks 'Wait GPS' and 'Geo init' done, INS_REF sent), an aligned "
            "attitude, and to answer GET_SETTING"
        )
        return (replace(ready_step(within, advice), fails=self._backend.wrong_setting),)

    def arm(self) -> Sequence[Step]:
        """Arm in the present mode; from KILL, where motors do not start, and from GUIDED by way of NAV."""
        return self._takeoff_and_landing.arm(by_hand=self._setpoints.held is not None)

    def disarm(self, force: bool) -> Sequence[Step]:
        """Disarm. Paparazzi would stop the motors in the air: that is refused here without *force*."""
        if self.telemetry.flying and not force:
            said = "it flies, and would fall: a Paparazzi stops its motors in the air, too; land() first"
            raise Refused(self.name, "disarm", said)
        stop = self._steps.stop_motors(force=force)
        return (replace(self._steps.check_settings(), send=stop.send), stop)

    def takeoff(self, height: float, within: Ns) -> Sequence[Step]:
        """Wait until ready, lift off by blocks or without, and climb in GUIDED."""
        return (*self.ready(READY_WITHIN), *self._takeoff_and_landing.climb(height, within))

    # -- operations with a position

    def goto(self, goal: Position, speed: float | None, within: Ns) -> Sequence[Step]:
        """Enter GUIDED and send a set-point, with the heading unchanged."""
        del speed  # there is no such capability
        self._steps.check_position(f"go to {goal}")
        return (*self._steps.guided(), self._reach(goal, within))

    def _reach(self, goal: Position, within: Ns) -> Step:
        monitor = TargetMonitor(self.telemetry, self._takeover)
        step = monitor.step(goal, lambda: self._backend.send_setpoint(self._steps.at(goal)), GUIDED, within)
        return replace(step, fails=self._steps.decoder.lacks_position, failure=NotArrived)

    def hold(self) -> Sequence[Step]:
        """Stop in GUIDED by a velocity of zero, then hold that position."""
        self._steps.check_position("hold")
        brake = replace(self._setpoints.braking_step(), fails=self._steps.decoder.lacks_position)
        stay = immediate_step("stay", self._steps.stay)
        return (*self._steps.guided(), brake, stay)

    def velocity(self, velocity: Velocity, yaw_rate: float, lasting: Ns) -> Sequence[Step]:
        """Enter GUIDED and repeat a velocity for *lasting*, then stop."""
        self._steps.check_position("follow a velocity")
        self._steps.yaw = None
        follow = immediate_step(
            "fly on", lambda: self._setpoints.follow_velocity(velocity, yaw_rate, lasting)
        )
        return (*self._steps.guided(), follow)

    def heading(self, degrees: float) -> Sequence[Step]:
        """Turn in place in GUIDED."""
        self._steps.check_position(f"turn to {degrees:g} degrees")

        def send() -> None:
            self._steps.yaw = radians(degrees)
            self._steps.stay()

        turn = Step(
            ask=f"turn to {degrees:g} degrees",
            send=send,
            done=heading_reached(degrees),
            within=TURNED_WITHIN,
            again=4 * S,
            mode=GUIDED,
            armed=True,
            fails=self._steps.decoder.lacks_position,
        )
        return (*self._steps.guided(), turn)

    def return_home(self, within: Ns) -> Sequence[Step]:
        """Fly over home in GUIDED at the present height, then land; mode HOME does not land."""
        if not self.telemetry.armed:
            return ()
        if not self.telemetry.flying:
            return self._takeoff_and_landing.stop_on_ground()
        self._steps.check_position("return home")
        home = self.telemetry.home
        if home is None:
            raise Refused(self.name, "return home", "it has not reported its home")
        above = AboveHome(max(self.telemetry.above_home, LIFTED_M))
        over = Position(home.latitude, home.longitude, above)
        reach = replace(self._reach(over, within), ask="be over home")
        return (*self._steps.guided(), reach, *self._takeoff_and_landing.land_by_plan(within))

    def land(self, within: Ns) -> Sequence[Step]:
        """Land by the plan's block, or in GUIDED far from home; without a fix in FAILSAFE."""
        return self._takeoff_and_landing.land(within) if self.telemetry.armed else ()

    # -- manual flight

    def stabilize(self) -> Sequence[Step]:
        """Enter ATTITUDE_DIRECT with manual control repeated; in the air not with an idle throttle."""
        self._setpoints.hold_any()
        check_throttle(self.telemetry, self._setpoints.held)
        return (
            self._steps.check_settings(),
            self._steps.wait_for_sticks(),
            self._steps.change_mode(ATTITUDE_MODE),
        )

    def hand_over(self) -> Sequence[Step]:
        """Stop sending; the switch of the transmitter chooses the mode."""
        return (immediate_step("stop sending", self.stop),)

    def altitude_hold(self) -> Sequence[Step]:
        """Enter ATTITUDE_RC_CLIMB with manual control repeated."""
        self._setpoints.hold_any()
        return (
            self._steps.check_settings(),
            self._steps.wait_for_sticks(),
            self._steps.change_mode(HEIGHT_MODE),
        )

    def manual_control(self, control: ManualControl | None) -> None:
        """Repeat *control*; ``None`` ends the repetition."""
        self._setpoints.set_control(control)
