"""Steps that are the same for every MAVLink autopilot."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import replace

from volery.base.errors import CapabilityError, Refused
from volery.base.time import MS, Ns, S
from volery.kernel.api import Action, Kernel
from volery.vehicles.driver import (
    Capability,
    Land,
    LinkLossAction,
    MissionItem,
    Repeat,
    ReturnHome,
    Settings,
    Step,
)
from volery.vehicles.drivers.mavlink.backend import Ack, Backend
from volery.vehicles.drivers.mavlink.client import MavlinkClient
from volery.vehicles.drivers.steps import (
    ANSWERED_WITHIN,
    ARMED_WITHIN,
    DRONE_KIND,
    ROVER_KIND,
    ROVER_NEAR_M,
    Takeover,
    at_rest,
    ready_step,
    send_nothing,
)
from volery.vehicles.services import PlanItem
from volery.vehicles.telemetry import UNFIXED, Telemetry

COMPLETE_FOR: Ns = 2500 * MS
"""Time in which the messages about the end of a mission and the next heartbeat arrive."""
ARMING_CHECKS_PERIOD: Ns = 5 * S
LASTS_AFTER: Ns = 6 * S
"""Time after which an arming check counts as one that stays: it has been reported twice."""

ROVER_CAPABILITIES = frozenset(
    {
        Capability.GOTO,
        Capability.SPEED,
        Capability.RETURN_HOME,
        Capability.HOLD,
        Capability.MANUAL_CONTROL,
        Capability.MISSION,
    }
)
DRONE_CAPABILITIES = ROVER_CAPABILITIES | {
    Capability.TAKEOFF,
    Capability.VELOCITY,
    Capability.ACCELERATION,
    Capability.ATTITUDE,
    Capability.HEADING,
    Capability.LAND,
    Capability.STABILIZE,
    Capability.ALTITUDE_HOLD,
    Capability.CLIMB_BY_THROTTLE,
}
_CAPABILITIES = {DRONE_KIND: DRONE_CAPABILITIES, ROVER_KIND: ROVER_CAPABILITIES}
_NONE: frozenset[Capability] = frozenset()


class MavlinkDriver:
    """What drivers with a MAVLink ``Backend`` share. See ``vehicles.driver.Driver`` for the operations."""

    obeys = ""
    """Mode in which the firmware obeys a computer."""
    landing_modes: frozenset[str] = frozenset()

    def __init__(self, kernel: Kernel, name: str, backend: Backend) -> None:
        self.name = name
        self.telemetry = backend.telemetry
        self.cycle: Action | None = backend.cycle
        self.poll = backend.poll
        self.problem = backend.problem
        self.services = backend.services
        self.request_attitude = backend.request_attitude
        self.request_obstacles = backend.request_obstacles
        self._kernel = kernel
        self._backend = backend
        self._takeover = Takeover(kernel, backend.telemetry, self.obeys)
        self._last_item: int | None = None  # the item at which the mission on board ends in the air
        self._mission_lands = False  # the mission on board was stored by this program, and ends on the ground

    @property
    def capabilities(self) -> frozenset[Capability]:
        """Capabilities of the kind of vehicle; none before the first message."""
        return _CAPABILITIES.get(self.telemetry.kind, _NONE)

    @abstractmethod
    def stop(self) -> None:
        """Stop repeating manual control and set-points."""

    def close(self) -> None:
        """Stop all communication and release the link."""
        self.stop()
        self._takeover.end()
        self._backend.close()

    def link_loss_settings(self, action: LinkLossAction) -> Settings:
        """Return the parameters for a lost link; over a graph the link is that of another program."""
        if not isinstance(self._backend, MavlinkClient):
            raise CapabilityError(
                f"{self.name}: over a ROS graph its link is another program's, which goes on when this one "
                "is killed: what it then does cannot be asked for; connect to it by MAVLink"
            )
        return self._link_loss_settings(action)

    @abstractmethod
    def _link_loss_settings(self, action: LinkLossAction) -> Settings:
        """Return the parameters for a lost link to this program."""

    # -- on the ground

    def ready(self, within: Ns) -> Sequence[Step]:
        """Wait until the arming checks pass and there is a position."""
        keep = Repeat(ARMING_CHECKS_PERIOD, self._backend.request_arming_checks)
        began: Ns | None = None

        def send() -> None:
            nonlocal began
            began = self._kernel.now()
            self._backend.request_arming_checks()

        def never() -> str:
            if began is None or self._kernel.now() - began < LASTS_AFTER:
                return ""
            reasons = "; ".join(self._backend.lasting_reasons(began))
            return f"arming checks fail that waiting does not mend: {reasons}" if reasons else ""

        step = ready_step(within, self._missing, keep)
        return (replace(step, send=send, fails=never, failure=Refused),)

    def _missing(self) -> str:
        """Return what it lacks to be ready, by its own telemetry, and what can be done."""
        seen = self.telemetry
        unlocated = seen.position is None
        if unlocated and seen.external_pose_ns >= 0:
            return "its estimator has no position by the poses that it gets: are its parameters for them set?"
        if (seen.fix in UNFIXED and seen.external_pose_ns < 0) or (not seen.fix and unlocated):
            fix = f"its GPS reports {seen.fix or 'nothing'}, {seen.satellites} satellites"
            return f"{fix}: give it a view of the sky"
        if unlocated:
            return "its estimator has no position yet: stand it still and level"
        if seen.home is None:
            return "it has not reported its home"
        if not seen.armable:
            reasons = "; ".join(self._backend.failing_checks())
            return f"its arming checks fail: {reasons}" if reasons else "its arming checks fail; look at them"
        return "its estimator has no valid position: stand it still and level"

    def arm(self) -> Sequence[Step]:
        """Arm in the present mode."""

        def send() -> None:
            problem = self._backend.problem()  # the firmware has reported its version by now
            if isinstance(problem, CapabilityError):
                raise CapabilityError(f"{self.name}: {problem}")
            self._backend.arm(True)

        step = Step(
            ask="arm",
            send=send,
            done=lambda seen: seen.armed,
            within=ARMED_WITHIN,
            skippable=True,
            answer=Ack.ARM,
            again=2 * S,
        )
        return (step,)

    def disarm(self, force: bool) -> Sequence[Step]:
        """Disarm; in the air the autopilot refuses without *force*."""
        step = Step(
            ask="disarm",
            send=lambda: self._backend.arm(False, force=force),
            done=lambda seen: not seen.armed,
            within=ARMED_WITHIN,
            skippable=True,
            answer=Ack.ARM,
            again=2 * S,
        )
        return (step,)

    # -- missions

    @abstractmethod
    def _items(self, mission: Sequence[MissionItem]) -> list[PlanItem]:
        """Return the mission as items of the firmware."""

    @abstractmethod
    def _end_in_air(self, mission: Sequence[MissionItem]) -> int | None:
        """Return the number of the item at which the mission ends in the air; ``None`` if it lands."""

    def upload(self, mission: Sequence[MissionItem]) -> Sequence[Step]:
        """Replace the mission on board by MAVLink's mission protocol."""
        items = self._items(mission)
        step = Step(
            ask=f"take a mission of {len(items)} items",
            send=lambda: self._backend.upload(items),
            done=lambda seen: _accepted(seen, Ack.MISSION),
            within=30 * S + len(items) * S,
            answer=Ack.MISSION,
            again=2 * S,
        )
        self._last_item = self._end_in_air(mission)
        self._mission_lands = isinstance(mission[-1], Land | ReturnHome)
        return (step,)

    def _finish_mission(self, mode: str, leads_to: tuple[str, ...], within: Ns, ends_in: str = "") -> Step:
        """Return a step that ends when disarmed, at the last item, or when the mission is reported over.

        An autopilot may report it as complete when the return home begins that is its last item.

        Args:
            mode: mode in which missions are flown.
            leads_to: modes in which they end on the ground.
            within: time-out, ns.
            ends_in: mode that the autopilot enters when one has ended in the air; empty where it stays.
        """
        seen = self.telemetry
        complete, ended = _Lasting(self._kernel), _Lasting(self._kernel)

        def over(seen: Telemetry) -> bool:
            last = self._last_item
            if not seen.armed or (last is not None and seen.mission_reached >= last):
                return True
            in_air = seen.mission_ended and seen.flying and not self._mission_lands
            stays = complete.holds(in_air and seen.mode not in self.landing_modes)
            return stays or (in_air and seen.mode == ends_in)

        def taken() -> str:
            """Return that another has changed the mode, unless the mission is reported to have ended."""
            left = ended.holds(bool(ends_in) and seen.mode == ends_in and not seen.mission_ended)
            return f"changed from {mode} to {seen.mode}" if left else ""

        return Step(
            ask="finish the mission",
            send=self._backend.request_mission_progress,
            done=over,
            within=within,
            mode=mode,
            leads_to=(*leads_to, ends_in) if ends_in else leads_to,
            lost=taken,
        )

    def _forget_progress(self) -> None:
        self.telemetry.mission_reached = -1
        self.telemetry.mission_ended = False

    # -- common steps

    def _reach_home(self, mode: str, resting: str, within: Ns) -> Step:
        """Return a step that waits until a rover rests near home; there it may change to *resting*."""

        def home(seen: Telemetry) -> bool:
            return (
                seen.home is not None
                and seen.located
                and seen.distance(seen.position, seen.home) <= ROVER_NEAR_M + 1.0
                and at_rest(seen)
            )

        return Step(
            ask="return home",
            send=send_nothing,
            done=home,
            within=within,
            mode=mode,
            leads_to=(resting,),
            armed=True,
        )

    def _set_speed(self, speed: float, mode: str) -> Step:
        """Return a step that sets the speed over ground, m/s."""
        return Step(
            ask=f"go at {speed:g} m/s",
            send=lambda: self._backend.set_speed(speed),
            done=lambda seen: _accepted(seen, Ack.SPEED),
            within=ANSWERED_WITHIN,
            answer=Ack.SPEED,
            again=S,
            mode=mode,
        )


class _Lasting:
    """Finds out whether something has been the case for ``COMPLETE_FOR``."""

    def __init__(self, kernel: Kernel) -> None:
        self._kernel = kernel
        self._since: Ns | None = None

    def holds(self, now_true: bool) -> bool:
        """Note whether it is the case now; return whether it has lasted."""
        now = self._kernel.now()
        self._since = (now if self._since is None else self._since) if now_true else None
        return self._since is not None and now - self._since >= COMPLETE_FOR


def _accepted(seen: Telemetry, key: str) -> bool:
    answer = seen.answers.get(key)
    return answer is not None and answer.accepted
