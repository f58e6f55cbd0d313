"""A mission on board: given to the aircraft, begun, and followed to its end."""

from __future__ import annotations

from collections.abc import Sequence

from volery.base.errors import Refused
from volery.base.time import Ns, S
from volery.ros.messages.dji import DisplayMode
from volery.vehicles.driver import Step
from volery.vehicles.drivers.arrival import at
from volery.vehicles.drivers.dji import carrier as key
from volery.vehicles.drivers.dji.missions import Plan, plan_of
from volery.vehicles.drivers.dji.names import START_MISSION
from volery.vehicles.drivers.dji.pieces import ASK_AGAIN, DESCENDS, SDK, WAITS, Pieces
from volery.vehicles.drivers.dji.tasks import Tasks
from volery.vehicles.drivers.steps import ANSWERED_WITHIN, nothing
from volery.vehicles.mission import MissionItem
from volery.vehicles.telemetry import Telemetry

FLYING = DisplayMode.NAVI_MISSION.name


class MissionFlight:
    """The mission that this program gave it last."""

    def __init__(self, pieces: Pieces, tasks: Tasks) -> None:
        self._pieces = pieces
        self._tasks = tasks
        self._carrier = pieces.carrier
        self._seen = pieces.telemetry
        self._plan: Plan | None = None

    def upload(self, mission: Sequence[MissionItem]) -> Sequence[Step]:
        """As waypoints above the point of take-off."""
        home, here = self._seen.home, self._seen.position
        if home is None or here is None:
            said = "it does not know where it is yet; wait_ready() first"
            raise Refused(self._pieces.name, "upload a mission", said)
        plan = plan_of(self._pieces.name, self._carrier.names.package, mission, home, here)

        def keep() -> None:
            self._plan = plan

        step = Step(
            ask=f"take a mission of {len(plan.task.mission_waypoint)} waypoints",
            send=lambda: self._carrier.ask(key.MISSION, self._carrier.names.mission(plan.task), keep),
            done=lambda seen: self._pieces.accepted(key.MISSION),
            within=30 * S + len(plan.task.mission_waypoint) * 2 * S,
            answer=key.MISSION,
            again=5 * S,
        )
        return (self._pieces.activated(), step)

    def start(self, within: Ns) -> Sequence[Step]:
        """Take off, start it; to its end: down, or standing at the last point."""
        plan = self._plan
        if plan is None:
            raise Refused(self._pieces.name, "start the mission", "none was uploaded by this program")
        lift: Sequence[Step] = ()
        if not self._seen.flying:
            if plan.takeoff is None:
                said = "it is on the ground, and no TakeOff comes first"
                raise Refused(self._pieces.name, "start the mission", said)
            lift = self._tasks.takeoff(plan.takeoff, within)
        begin = Step(
            ask="start the mission",
            send=self._begin,
            done=lambda seen: self._pieces.accepted(key.START),
            within=ANSWERED_WITHIN,
            answer=key.START,
            again=ASK_AGAIN,
            enters=FLYING,
            leads_to=(WAITS, SDK),
            armed=True,
        )
        return (*lift, self._pieces.authority(), self._pieces.quiet(), begin, self._over(plan, within))

    def _begin(self) -> None:
        self._pieces.stream.stop()
        self._pieces.hearing.asked = FLYING
        self._carrier.ask(key.START, self._carrier.names.mission_action(START_MISSION))

    def _over(self, plan: Plan, within: Ns) -> Step:
        """Without an end in the air it is over when it is down."""
        end = plan.end

        def over(seen: Telemetry) -> bool:
            if not seen.armed:
                return True
            return end is not None and at(end, False)(seen) and (seen.mode != FLYING or self._carrier.is_m100)

        return Step(
            ask="finish the mission",
            send=nothing,
            done=over,
            within=within,
            mode=FLYING,
            leads_to=(WAITS, *sorted(DESCENDS)),
        )
