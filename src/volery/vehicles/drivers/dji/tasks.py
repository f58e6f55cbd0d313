"""Motors and tasks: what a DJI aircraft does by itself once it is told to, off the ground and back to it."""

from __future__ import annotations

from collections.abc import Sequence

from volery.base.errors import Refused
from volery.base.time import Ns, S
from volery.ros.messages.dji import DisplayMode
from volery.vehicles.driver import Step
from volery.vehicles.drivers.arrival import risen
from volery.vehicles.drivers.dji import carrier as key
from volery.vehicles.drivers.dji.hearing import TAKES_OFF
from volery.vehicles.drivers.dji.names import GO_HOME, LAND, TAKE_OFF
from volery.vehicles.drivers.dji.pieces import ASK_AGAIN, SDK, STARTS, WAITS, Pieces
from volery.vehicles.drivers.steps import ANSWERED_WITHIN, ARMED_WITHIN, until_disarmed
from volery.vehicles.telemetry import Telemetry

UP_WITHIN: Ns = 35 * S
"""Of the take-off itself: motors within 5 s, off the ground within 20 s, then to the fixed height."""
M100_GAINS_M = 0.8
"""An M100 counts as off the ground once it is so much above home. The SDK's demo asks for 1 m; of a take-off
to about 1.2 m that leaves little for the drift of a height.
"""


class Tasks:
    """Take-off, landing and going home need no authority; the motors do."""

    def __init__(self, pieces: Pieces) -> None:
        self._pieces = pieces
        self._carrier = pieces.carrier
        self._seen = pieces.telemetry

    def arm(self) -> Sequence[Step]:
        """Start the motors."""
        step = Step(
            ask="start the motors",
            send=lambda: self._carrier.motors(True),
            done=lambda seen: seen.armed,
            within=ARMED_WITHIN,
            skippable=True,
            answer=key.MOTORS,
            again=ASK_AGAIN,
            leads_to=STARTS,
        )
        return (self._pieces.activated(), self._pieces.authority(), step)

    def disarm(self, force: bool) -> Sequence[Step]:
        """Stop the motors. In the air the aircraft would fall: that takes *force*."""
        if self._seen.flying and not force:
            said = "it flies, and would fall; land() first, or force it"
            raise Refused(self._pieces.name, "disarm", said)
        step = Step(
            ask="stop the motors",
            send=lambda: self._carrier.motors(False, force=force),
            done=lambda seen: not seen.armed,
            within=ARMED_WITHIN,
            skippable=True,
            answer=key.MOTORS,
            again=ASK_AGAIN,
        )
        alone = force and self._carrier.names.kills_without_authority
        return (self._pieces.authority(), step) if self._seen.armed and not alone else (step,)

    def takeoff(self, height: float, within: Ns) -> Sequence[Step]:
        """Task 4, which starts the motors and goes to its own height; then to *height* by set-points."""
        pieces = self._pieces
        pieces.check_height(height, f"take off to {height:g} m")
        lift = Step(
            ask="take off",
            send=lambda: self._carrier.task(TAKE_OFF, DisplayMode.AUTO_TAKEOFF),
            done=self._off_the_ground,
            within=UP_WITHIN,
            answer=key.TASK,
            again=ASK_AGAIN,
            enters=DisplayMode.AUTO_TAKEOFF.name,
            leads_to=STARTS,
            armed=True,
        )
        climb = pieces.to_point(
            f"climb to {height:g} m", lambda: pieces.over_here(height), risen(height), within
        )
        return (*pieces.ready(), pieces.authority(), lift, *climb)

    def _off_the_ground(self, seen: Telemetry) -> bool:
        if self._carrier.is_m100 and not seen.above_home >= M100_GAINS_M:
            return False
        return seen.flying and seen.mode not in {mode.name for mode in TAKES_OFF}

    def return_home(self, within: Ns) -> Sequence[Step]:
        """Task 1: it climbs, goes home and lands; near home it lands at once."""
        return self._until_down(GO_HOME, DisplayMode.NAVI_GO_HOME, "return home and land", within)

    def land(self, within: Ns) -> Sequence[Step]:
        """Task 6, until the motors have stopped."""
        return self._until_down(LAND, DisplayMode.AUTO_LANDING, "land", within)

    def _until_down(self, task: int, mode: DisplayMode, ask: str, within: Ns) -> Sequence[Step]:
        if not self._seen.armed:
            return ()
        if not self._seen.flying:
            return self.disarm(force=False)
        begin = Step(
            ask=ask,
            send=lambda: self._carrier.task(task, mode),
            done=lambda seen: seen.mode == mode.name or not seen.armed,
            within=ANSWERED_WITHIN,
            answer=key.TASK,
            again=ASK_AGAIN,
            enters=mode.name,
            leads_to=(WAITS, SDK),
        )
        return (self._pieces.quiet(), begin, until_disarmed(ask, mode.name, within))
