"""What a Paparazzi rotorcraft will do if its commander falls silent, in words, from its flight plan.

Facts: in GUIDED nothing is missed: neither ground nor transmitter nor, so the sources, a fence. In NAV the
plan's own rules hold. Modes that sticks fly become FAILSAFE when the sticks stop.

Paparazzi's sequences: what its rotorcraft firmware wants to be told, and how one sees it done.

Facts behind them, from public definitions and sources; see ``modes.ASSUMED``. Nothing is acknowledged. Motors
start and stop by a setting or by a block of the flight plan. Blocks take off and land; in between it goes by
set-points in GUIDED, which stand until the next one. Telemetry is 0.25 s (position) to 2 s (block) late, but
a change of mode is told at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import radians

from volery.base.errors import CapabilityError, LinkError, Refused
from volery.base.position import AboveHome, Position
from volery.base.time import Ns, S
from volery.kernel.api import Action, Kernel
from volery.links.paparazzi_aircraft import PaparazziAircraft
from volery.vehicles.driver import Capability, ManualControl, Step
from volery.vehicles.drivers.paparazzi.backend import PaparazziBackend
from volery.vehicles.drivers.paparazzi.modes import ATTITUDE_MODE, FAILSAFE, GUIDED, HEIGHT_MODE
from volery.vehicles.drivers.paparazzi.sequences import LIFTED_M, Blocks, PaparazziSteps, TakeoffAndLanding
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
from volery.vehicles.mission import MissionItem
from volery.vehicles.telemetry import Velocity


def on_link_loss(aircraft: PaparazziAircraft) -> str:
    """One line."""
    far = f", further than {aircraft.farthest:g} m from home it turns back" if aircraft.farthest else ""
    return (
        "in GUIDED it misses nobody: it goes to its last set-point and stays there, and a velocity goes on "
        f"without end; in NAV (taking off, landing) it goes on with its plan{far}; flown by sticks it comes "
        "down (FAILSAFE)"
    )


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
"""No speed: GUIDED flies at the aircraft's own. No missions: a flight plan is built into the aircraft."""
_NONE: frozenset[Capability] = frozenset()


class Paparazzi:
    """The driver. See ``vehicles.driver.Driver`` for what the methods mean.

    Raises ``UsageError`` if the aircraft's flight plan has not those *blocks*.
    """

    landing_modes = frozenset({FAILSAFE})
    cycle: Action | None = None

    def __init__(self, kernel: Kernel, uplink: PaparazziBackend, blocks: Blocks) -> None:
        self.name = uplink.telemetry.name
        self.telemetry = uplink.telemetry
        self._uplink = uplink
        self._pieces = PaparazziSteps(kernel, uplink)
        self._setpoints = self._pieces.setpoints
        self._ground = TakeoffAndLanding(self._pieces, blocks)
        self._eviction = Takeover(kernel, uplink.telemetry, GUIDED)

    @property
    def offboard_mode(self) -> str:
        """GUIDED; words that are no mode while somebody else has it there."""
        return self._eviction.offboard_mode

    @property
    def capabilities(self) -> frozenset[Capability]:
        """Those of a rotorcraft; none until it has been heard."""
        return CAPABILITIES if self.telemetry.kind == DRONE_KIND else _NONE

    def poll(self) -> None:
        """What arrives is taken in by itself."""

    def on_link_loss(self) -> str:
        """From its flight plan, as far as that says it."""
        return on_link_loss(self._uplink.aircraft) if self.telemetry.kind == DRONE_KIND else ""

    def problem(self) -> LinkError | CapabilityError | None:
        """What is wrong with the way to the aircraft, or with what is there."""
        return self._uplink.problem()

    def close(self) -> None:
        """Stop talking and let go of the link."""
        self.stop()
        self._eviction.end()
        self._uplink.close()

    # -- on the ground

    def ready(self, within: Ns) -> Sequence[Step]:
        """Until it has a fix, an origin and an aligned attitude, and its settings are the ones meant."""
        advice = (
            "it needs a 3D fix, an origin (blocks 'Wait GPS' and 'Geo init' done, INS_REF sent), an aligned "
            "attitude, and to answer GET_SETTING"
        )
        return (ready_step(within, advice),)

    def arm(self) -> Sequence[Step]:
        """In the mode it is in; from KILL, where motors do not start, by way of GUIDED."""
        return (self._pieces.know_settings(), self._pieces.start_motors())

    def disarm(self, force: bool) -> Sequence[Step]:
        """Paparazzi itself would stop the motors in the air, too: without *force* it is not asked to."""
        if self.telemetry.flying and not force:
            said = "it flies, and would fall: a Paparazzi stops its motors in the air, too; land() first"
            raise Refused(self.name, "disarm", said)
        return (self._pieces.stop_motors(force=force),)

    def takeoff(self, height: float, within: Ns) -> Sequence[Step]:
        """Ready, off the ground by blocks or without, up in GUIDED."""
        return (*self.ready(READY_WITHIN), *self._ground.climb(height, within))

    # -- by position

    def goto(self, goal: Position, speed: float | None, within: Ns) -> Sequence[Step]:
        """GUIDED, then a set-point, with the heading as it is."""
        del speed  # there is no such capability
        return (*self._pieces.guided(), self._reach(goal, within))

    def _reach(self, goal: Position, within: Ns) -> Step:
        aim = TargetMonitor(self.telemetry, self._eviction)
        return aim.reach(goal, lambda: self._uplink.setpoint(self._pieces.at(goal)), GUIDED, within)

    def hold(self) -> Sequence[Step]:
        """In GUIDED, first without velocity, then where it has stopped."""
        return (*self._pieces.guided(), self._setpoints.braking(), immediate_step("stay", self._pieces.stay))

    def velocity(self, velocity: Velocity, yaw_rate: float, lasting: Ns) -> Sequence[Step]:
        """GUIDED, then repeated until it has lasted long enough; then it stops."""
        self._pieces.yaw = None
        return (
            *self._pieces.guided(),
            immediate_step("fly on", lambda: self._setpoints.follow(velocity, yaw_rate, lasting)),
        )

    def heading(self, degrees: float) -> Sequence[Step]:
        """In GUIDED, where it is."""

        def turn() -> None:
            self._pieces.yaw = radians(degrees)
            self._pieces.stay()

        step = Step(
            ask=f"turn to {degrees:g} degrees",
            send=turn,
            done=heading_reached(degrees),
            within=TURNED_WITHIN,
            again=4 * S,
            mode=GUIDED,
            armed=True,
        )
        return (*self._pieces.guided(), step)

    def return_home(self, within: Ns) -> Sequence[Step]:
        """In GUIDED over home at the height it has, then down: mode HOME goes there, but does not land."""
        if not self.telemetry.armed:
            return ()
        home = self.telemetry.home
        if home is None:
            raise Refused(self.name, "return home", "it has not told where its home is")
        above = AboveHome(max(self.telemetry.above_home, LIFTED_M))
        over = Position(home.latitude, home.longitude, above)
        reach = replace(self._reach(over, within), ask="be over home")
        return (*self._pieces.guided(), reach, *self._ground.land_by_plan(within))

    def land(self, within: Ns) -> Sequence[Step]:
        """By the plan's block, or without it far from home; without a fix in FAILSAFE, which needs none."""
        return self._ground.land(within) if self.telemetry.armed else ()

    # -- by sticks

    def stabilize(self) -> Sequence[Step]:
        """ATTITUDE_DIRECT, with the sticks held. In the air not with an idle throttle: it would fall."""
        self._setpoints.hold_any()
        check_throttle(self.telemetry, self._setpoints.held)
        return (self._pieces.change(ATTITUDE_MODE),)

    def altitude_hold(self) -> Sequence[Step]:
        """ATTITUDE_RC_CLIMB, with the sticks held."""
        self._setpoints.hold_any()
        return (self._pieces.change(HEIGHT_MODE),)

    def manual(self) -> Sequence[Step]:
        """Rovers only."""
        raise CapabilityError(f"{self.name}: a rotorcraft has no wheels to steer by hand")

    def manual_control(self, sticks: ManualControl | None) -> None:
        """Keep sending them, as long as the mode is ours."""
        self._setpoints.take(sticks)

    def stop(self) -> None:
        """No set-point and no stick is repeated any more."""
        self._setpoints.end()

    # -- missions

    def upload(self, mission: Sequence[MissionItem]) -> Sequence[Step]:
        """A flight plan is built into the aircraft."""
        raise CapabilityError(f"{self.name}: {len(mission)} items: a Paparazzi's plan is built into it")

    def start_mission(self, within: Ns) -> Sequence[Step]:
        """A flight plan is built into the aircraft."""
        raise CapabilityError(f"{self.name}: a Paparazzi's flight plan is built into it")
