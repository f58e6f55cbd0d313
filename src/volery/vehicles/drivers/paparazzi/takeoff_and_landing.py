"""Take-off and landing of the Paparazzi driver.

They use blocks of the flight plan in NAV, or GUIDED where NAV would turn back: in NAV an aircraft returns by
itself if it is further from home than its plan allows. Blocks are therefore flown only well inside that
distance.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import hypot, isnan

from volery.base.errors import Refused
from volery.base.time import MS, Ns, S, to_seconds
from volery.vehicles.driver import ManualControl, Repeat, Step
from volery.vehicles.drivers.paparazzi.backend import COME_DOWN, VELOCITY_Z, PprzSetpoint
from volery.vehicles.drivers.paparazzi.decoder import (
    ATTITUDE_MODE,
    FAILSAFE,
    GUIDED,
    HOME,
    KILL,
    LAND_BLOCK,
    MAX_PPRZ,
    NAV,
    START_BLOCK,
    TAKEOFF_BLOCK,
)
from volery.vehicles.drivers.paparazzi.sequences import ARMING, PaparazziSteps
from volery.vehicles.drivers.steps import (
    AT_REST_M_S,
    NEAR_UP_M,
    disarmed_step,
    immediate_step,
)
from volery.vehicles.telemetry import Telemetry

BLOCK_WITHIN: Ns = 15 * S
LANDING_BLOCK_WITHIN: Ns = 30 * S
"""A damaged frame can keep the aircraft's parser waiting for up to 255 bytes; the repetitions supply them."""
BLOCK_REPORTED_WITHIN: Ns = 5 * S
"""Time without ROTORCRAFT_NAV_STATUS, which is sent each 1.6 s, after which it is not waited for."""
LIFTED_M = 1.0
"""Height above the ground at which the take-off block is done."""
SINKING_M_S = 0.8
"""Rate of descent in GUIDED; the blocks of the stock plan use the same."""
WELL_INSIDE = 0.9
"""Share of the distance at which NAV turns back, inside which blocks are flown."""
OVERSHOT_M, CREEPING_M_S = 1.0, 0.1
"""Error of height and rate with which a climb is over: it overshoots by 0.65 m and comes back at 0.01 m/s."""
SUNK_M = 0.5
NOT_SINKING_FOR: Ns = 10 * S
"""Time in which FAILSAFE must lower the height by ``SUNK_M``; it should descend at 1.5 m/s."""
RESCUE = "land() again once it has a fix, or fly it by hand"
WATCH_PERIOD: Ns = 250 * MS
STANDING_M_S = 0.1
STANDING_FOR: Ns = S
CARRIED = 0.85
"""Share of the thrust of a steady descent below which a vehicle that does not move stands on the ground."""


@dataclass(frozen=True)
class Blocks:
    """Names of the blocks of the flight plan that are flown."""

    start: str = START_BLOCK
    takeoff: str = TAKEOFF_BLOCK
    land: str = LAND_BLOCK


def _unless_disarmed(step: Step) -> Step:
    """Return *step*, which a disarmed aircraft needs no more."""
    done = step.done
    return replace(step, skippable=True, done=lambda seen: not seen.armed or done(seen))


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
        return telemetry.distance(telemetry.position, telemetry.home) <= WELL_INSIDE * farthest

    # -- motors on the ground

    def arm(self, *, by_hand: bool) -> Sequence[Step]:
        """Return steps that start the motors on the ground, and nothing else.

        In GUIDED the aircraft lifts off as soon as its motors run, and in NAV it flies the present block: it
        is armed in NAV, in the block that starts the motors or in an earlier one.

        Args:
            by_hand: it is or will be in a mode of sticks.

        Raises:
            Refused: without a fix NAV becomes FAILSAFE and KILL; too far from home it would fly there.
        """
        steps, telemetry = self._steps, self._telemetry
        in_place = (steps.check_settings(), steps.start_motors())
        in_nav = telemetry.mode in {NAV, GUIDED, KILL, FAILSAFE, HOME}
        if by_hand or telemetry.armed or not in_nav:
            return in_place
        if not steps.decoder.good_fix:
            said = f"it has no 3D fix ({telemetry.fix or 'none reported'}): it would stop its motors again"
            raise Refused(telemetry.name, "arm", said)
        waits = 0 <= steps.decoder.block[1] <= self._backend.aircraft.block(self._blocks.start).number
        if telemetry.mode == NAV and waits:
            return (in_place[0], replace(in_place[1], mode=NAV))
        if not self._by_plan():
            said = f"in {telemetry.mode} it would lift off, in NAV fly home; takeoff(height) instead"
            raise Refused(telemetry.name, "arm", said)
        return (in_place[0], steps.change_mode(NAV), self._start_block())

    def stop_on_ground(self) -> tuple[Step, Step, Step]:
        """Return steps that stop the motors of an aircraft that a newer status still shows on the ground."""
        steps, telemetry = self._steps, self._telemetry
        asked_at: list[Ns] = []

        def send() -> None:
            if not asked_at:
                asked_at.append(steps.kernel.now())
            if steps.decoder.status_at > asked_at[0] and not telemetry.flying:
                self._backend.set_motors(False)

        stop = replace(
            steps.stop_motors(),
            ask="disarm on the ground",
            send=send,
            again=WATCH_PERIOD,
            fails=lambda: "it has lifted off meanwhile; land() again" if telemetry.flying else "",
        )
        return (steps.check_settings(), stop, steps.release())

    def _stop_when_down(self) -> Repeat:
        """Return a repetition that stops motors which go on running on the ground."""
        began, touch_down = self._steps.kernel.now(), _TouchDown(self._steps)

        def stop() -> None:
            telemetry = self._telemetry
            landed = self._steps.decoder.status_at > began and telemetry.armed and not telemetry.flying
            if landed and _is_still(telemetry):
                self._backend.set_motors(False)
            touch_down.watch()

        return Repeat(WATCH_PERIOD, stop)

    # -- take-off

    def climb(self, height: float, within: Ns) -> Sequence[Step]:
        """Return steps from the ground to *height* metres above home, in GUIDED at the end."""
        steps = self._steps
        steps.yaw = None
        spot: list[tuple[float, float]] = []
        # on the ground: until GUIDED is entered, which lost frames delay, the plan flies on to its next block
        note_spot = immediate_step("note where it stands", lambda: spot.append(steps.spot()))

        def send() -> None:
            self._backend.send_setpoint(PprzSetpoint(*spot[-1], -height, steps.heading()))

        straight_up = Step(
            ask=f"climb to {height:g} m",
            send=send,
            done=_climbed_to(height),
            within=within,
            again=S,
            mode=GUIDED,
            armed=True,
            fails=steps.decoder.lacks_position,
        )
        if self._by_plan():
            enter = (steps.locate(), note_spot, steps.check_settings(), steps.change_mode(NAV))
            return (*enter, self._start_block(), self._takeoff_block(within), *steps.guided(), straight_up)
        start = replace(steps.start_motors(), mode=GUIDED)
        return (steps.locate(), note_spot, *steps.guided(), start, straight_up)

    def _start_block(self) -> Step:
        return Step(
            ask="start the motors",
            send=lambda: self._backend.enter_block(self._blocks.start),
            done=lambda seen: seen.armed and not seen.failsafe,
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
        """Return steps that land in place; without a fix in FAILSAFE, which needs no position.

        On the ground they stop the motors; an aircraft that lifts off meanwhile is landed.
        """
        steps = self._steps
        steps.yaw = None
        if not steps.decoder.good_fix:
            landing = self._land_without_fix(within)
        elif self._by_plan():
            landing = self.land_by_plan(within)
        else:
            landing = self._descend(within)
        if self._telemetry.flying:
            return landing
        check, stop, release = self.stop_on_ground()
        stop = replace(stop, done=lambda seen: not seen.armed or seen.flying, fails=lambda: "")
        return (check, stop, release, *map(_unless_disarmed, landing))

    def _land_without_fix(self, within: Ns) -> Sequence[Step]:
        """Return steps that land in FAILSAFE or, where that keeps the height, by thrust over the datalink.

        Once there is a fix again, the plan lands it.
        """
        steps, descent = self._steps, _DescentByThrust(self._steps)
        by_hand = steps.setpoints.held is not None and steps.decoder.transmitter

        def fail_safely() -> None:
            self._backend.set_mode(FAILSAFE)
            self._backend.send_emergency(COME_DOWN)

        def take_sticks() -> None:
            steps.decoder.note_commanded(self._telemetry.mode)
            descent.begin()

        def until_fixed(step: Step) -> Step:
            """Skip or end the step once it is down, or has a fix."""
            done = step.done
            return replace(
                step,
                skippable=True,
                done=lambda seen: not seen.armed or steps.decoder.good_fix or done(seen),
            )

        failsafe = self._sinking(FAILSAFE)
        level = (
            until_fixed(steps.change_mode(FAILSAFE, fail_safely)),
            replace(
                until_fixed(disarmed_step("land", FAILSAFE, within, (KILL,))),
                done=lambda seen: not seen.armed or steps.decoder.good_fix or bool(failsafe()),
            ),
        )
        refused = f"FAILSAFE keeps its height, and sticks by datalink are not obeyed; {RESCUE}"
        take = until_fixed(steps.wait_for_sticks())
        take = replace(take, send=take_sticks, advice=refused)
        sink = replace(
            until_fixed(disarmed_step("land", ATTITUDE_MODE, within, (FAILSAFE, KILL))),
            keep=Repeat(WATCH_PERIOD, descent.control),
            fails=self._sinking(ATTITUDE_MODE),
        )
        let_go = replace(
            until_fixed(steps.wait_for_sticks()),
            ask="let go of the sticks",
            send=steps.setpoints.release,
            done=lambda seen: not steps.decoder.transmitter or not seen.armed or steps.decoder.good_fix,
        )
        # with sticks neither a setting nor their switch ends FAILSAFE: by way of GUIDED, once they count
        leave = () if by_hand else (take, let_go, until_fixed(steps.change_mode(GUIDED)), take)
        level_out = immediate_step("hold the thrust", descent.begin)
        by_sticks = (*leave, level_out, until_fixed(steps.change_mode(ATTITUDE_MODE)), sink)
        by_plan = (replace(step, skippable=True) for step in self.land_by_plan(within))
        before = () if by_hand else level
        return (steps.check_settings(), *before, *by_sticks, *by_plan, steps.release())

    def _sinking(self, mode: str) -> Callable[[], str]:
        """Return a function that describes a vehicle that does not sink in *mode*."""
        kept: list[tuple[Ns, float]] = []

        def tell() -> str:
            seen, now = self._telemetry, self._steps.kernel.now()
            if seen.mode != mode or isnan(seen.above_home):
                kept.clear()
            elif not kept or abs(seen.above_home - kept[0][1]) > SUNK_M:
                kept[:] = [(now, seen.above_home)]
            elif now - kept[0][0] > NOT_SINKING_FOR:
                height, seconds = seen.above_home, to_seconds(now - kept[0][0])
                return (
                    f"in {mode} it does not sink: {height:.1f} m above home after {seconds:.0f} s; {RESCUE}"
                )
            return ""

        return tell

    def land_by_plan(self, within: Ns) -> Sequence[Step]:
        """Return steps that land by the landing block."""
        steps = self._steps
        enter = self._landing_block()
        return (
            steps.check_settings(),
            enter,
            replace(steps.change_mode(NAV), done=lambda seen: seen.mode == NAV or not seen.armed),
            steps.release(),
            replace(disarmed_step("land", NAV, within, (KILL,)), keep=self._stop_when_down()),
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
            if not seen.armed or not sent_at:
                return not seen.armed
            waited = steps.kernel.now() - max(sent_at[0], reported_at) > BLOCK_REPORTED_WITHIN
            return (reported_at > sent_at[0] and block >= number) or (waited and reported_at < sent_at[0])

        return Step(
            ask=f"go to block {self._blocks.land!r}",
            send=send,
            done=landing,
            within=LANDING_BLOCK_WITHIN,
            again=S,
            mode=self._telemetry.mode,
        )

    def _descend(self, within: Ns) -> Sequence[Step]:
        """Return steps that descend vertically in GUIDED until landed, then stop the motors.

        The aircraft itself sees only after 12 s that it stands on the ground, and may jump meanwhile.
        """
        steps = self._steps
        spot: list[tuple[float, float]] = []

        def send() -> None:
            if not spot:
                spot.append(steps.spot())
            self._backend.send_setpoint(PprzSetpoint(*spot[0], SINKING_M_S, steps.heading(), VELOCITY_Z))

        descend = Step(
            ask="descend",
            send=send,
            done=lambda seen: not seen.flying,
            within=within,
            again=S,
            mode=GUIDED,
            leads_to=(KILL,),
            keep=Repeat(WATCH_PERIOD, _TouchDown(steps).watch),
        )
        return (*steps.guided(), descend, steps.stop_motors())


class _TouchDown:
    """Stops the motors of an aircraft that was sinking and now stands, carried by less thrust than before."""

    def __init__(self, steps: PaparazziSteps) -> None:
        self._steps = steps
        self._sinking_thrust = 0  # unknown before it sinks
        self._standing_since: Ns | None = None

    def watch(self) -> None:
        """Judge the last position; at the touch-down stop the motors."""
        decoder, now = self._steps.decoder, self._steps.kernel.now()
        up = self._steps.telemetry.velocity.up
        if up <= -SINKING_M_S / 2:
            self._sinking_thrust = decoder.thrust
        standing = self._sinking_thrust > 0 and abs(up) <= STANDING_M_S and not decoder.is_old()
        if not standing:
            self._standing_since = None
            return
        if self._standing_since is None:
            self._standing_since = now
        carried = decoder.thrust <= CARRIED * self._sinking_thrust
        if carried and now - self._standing_since >= STANDING_FOR:
            self._steps.backend.set_motors(False)


class _DescentByThrust:
    """Lowers an aircraft in ATTITUDE_DIRECT: a PI controller from the vertical speed to the thrust.

    It needs no position. The gains give a bandwidth of 1 rad/s (an excess of thrust of 1 % accelerates by
    0.1 m/s^2), slow enough for telemetry of four samples a second.
    """

    GAIN, INTEGRAL_GAIN = 0.1, 0.03
    """Thrust per error of speed [1/(m/s)] and per its integral [1/m], as shares of the weight."""
    LEAST, MOST = 0.6, 1.2
    """Limits of the thrust as shares of the weight."""
    STEADY_M_S = 0.2
    """Error of the speed with which the present thrust is the weight."""
    USUAL = 0.5
    """Thrust that carries an aircraft which has reported none."""

    def __init__(self, steps: PaparazziSteps) -> None:
        self._steps = steps
        self._touch_down = _TouchDown(steps)
        self._weight = self.USUAL
        self._integral = 0.0

    def begin(self) -> None:
        """Hold the thrust that was reported last; it carries the aircraft unless that was swinging."""
        self._weight = self._steps.decoder.thrust / MAX_PPRZ or self.USUAL
        self._command(1.0)

    def control(self) -> None:
        """Update the thrust from the last vertical speed; at the touch-down stop the motors."""
        self._touch_down.watch()
        up = self._steps.telemetry.velocity.up
        error = 0.0 if isnan(up) else -SINKING_M_S - up
        share = 1.0 + self.GAIN * error + self.INTEGRAL_GAIN * self._integral
        limited = min(self.MOST, max(self.LEAST, share))
        if abs(error) < self.STEADY_M_S:
            self._weight *= 1.0 + self.INTEGRAL_GAIN * self._integral
            self._integral = 0.0
        if limited == share or error * (share - limited) < 0.0:
            self._integral += error * to_seconds(WATCH_PERIOD)
        self._command(limited)

    def _command(self, share: float) -> None:
        throttle = min(1.0, share * self._weight)
        self._steps.setpoints.hold(ManualControl(throttle=throttle))


def _is_still(seen: Telemetry) -> bool:
    """Return whether it does not move, as far as that is known: without a fix by its climb rate alone."""
    return abs(seen.velocity.up) <= AT_REST_M_S and not hypot(*seen.velocity[:2]) > AT_REST_M_S


def _climbed_to(height: float) -> Callable[[Telemetry], bool]:
    """Return a condition: in the air about *height* metres above home, and no longer climbing."""

    def climbed(seen: Telemetry) -> bool:
        error, rate = abs(seen.above_home - height), abs(seen.velocity.up)
        near = error <= NEAR_UP_M and rate <= AT_REST_M_S
        return seen.flying and (near or (error <= OVERSHOT_M and rate <= CREEPING_M_S))

    return climbed
