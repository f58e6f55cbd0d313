"""Somebody has the vehicle in the very mode in which it obeys programs.

The mode does not show it. So he has it until he has chosen another mode in between, or it is disarmed.

Where it was sent by position, and whether it still goes there.

An autopilot that goes by position says where to: ArduPilot and PX4 in POSITION_TARGET_GLOBAL_INT, where a new
target shows within a second, to a centimetre, as recorded; a Paparazzi in the carrot of its ROTORCRAFT_FP. So
once ours has been shown, another one was set by somebody else: another station that sends the vehicle
elsewhere, or has it pause where it is. The mode does not tell, for it stays the same.
"""

from __future__ import annotations

from volery.base.position import AMSL, Position
from volery.base.time import MS, Ns, S
from volery.kernel.api import Action, Handle, Kernel
from volery.vehicles.driver import Step
from volery.vehicles.drivers.steps import DRONE_KIND, arrived_at, horizontal_distance
from volery.vehicles.telemetry import Telemetry

CHECK_PERIOD: Ns = 100 * MS


class Takeover:
    """Of this program from *mode*."""

    def __init__(self, kernel: Kernel, telemetry: Telemetry, mode: str) -> None:
        self._kernel = kernel
        self._seen = telemetry
        self._mode = mode
        self._watch: Handle | None = None

    @property
    def stands(self) -> bool:
        """He still has it."""
        return self._watch is not None

    @property
    def offboard_mode(self) -> str:
        """To which mode somebody must switch to hand it over; words that are no mode while it stands."""
        return f"another mode and then to {self._mode}" if self.stands else self._mode

    def begin(self) -> None:
        """He has it from now on."""
        if self._watch is None:
            self._watch = self._kernel.every(CHECK_PERIOD, self._look)

    def end(self) -> None:
        """Over, or nobody asks any more."""
        if self._watch is not None:
            self._watch.cancel()
            self._watch = None

    def _look(self) -> None:
        if self._seen.mode != self._mode or not self._seen.armed:
            self.end()


SAME_TARGET_M = 0.5
"""Targets that are nearer to each other are one."""
OTHER_TARGET_FOR: Ns = S
"""For so long another target must be shown: a bad wire may bring an old message late."""


class TargetMonitor:
    """One target, from when it is ``set``. Where the autopilot's own is not heard, as behind MAVROS, nothing
    is ever found.
    """

    def __init__(self, telemetry: Telemetry, eviction: Takeover) -> None:
        self._seen = telemetry
        self._eviction = eviction
        self._goal: Position | None = None
        self._confirmed = False
        self._other_since: Ns | None = None

    def set(self, goal: Position) -> None:
        """It is sent there now: what it has shown before counts no more."""
        self._goal = goal
        self._confirmed = False
        self._other_since = None
        self._seen.target = None

    @property
    def confirmed(self) -> bool:
        """It has shown that it goes there."""
        if not self._confirmed:
            self._confirmed = self._goal is not None and self._shows(self._goal)
        return self._confirmed

    def reach(self, goal: Position, send: Action, mode: str, within: Ns, *, rover: bool = False) -> Step:
        """By *send*, which sends it there, again until it has shown that it goes there; in *mode*."""

        def say() -> None:
            if not self.confirmed:
                self.set(goal)
                send()

        return Step(
            ask=f"reach {goal}",
            send=say,
            done=arrived_at(goal, rover),
            within=within,
            again=S,
            mode=mode,
            armed=True,
            lost=self.lost,
        )

    def lost(self) -> str:
        """How somebody has changed it, who has the vehicle then; empty if nobody has."""
        target = self._seen.target
        if not self.confirmed or self._goal is None or target is None or self._shows(self._goal):
            self._other_since = None
            return ""
        if self._other_since is None:
            self._other_since = self._seen.last_message_ns
        if self._seen.last_message_ns - self._other_since < OTHER_TARGET_FOR:
            return ""
        self._eviction.begin()
        return f"was sent elsewhere by another, to {target}"

    def _shows(self, goal: Position) -> bool:
        target = self._seen.target
        if target is None or horizontal_distance(target, goal) > SAME_TARGET_M:
            return False
        level = isinstance(goal.altitude, AMSL) and self._seen.kind == DRONE_KIND
        return not level or abs(target.altitude.metres - goal.altitude.metres) <= SAME_TARGET_M
