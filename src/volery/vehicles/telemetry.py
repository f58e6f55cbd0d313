"""The last state that an autopilot has reported. A driver writes it; everything above the driver reads it."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from math import hypot, inf, isfinite, isnan, nan
from typing import NamedTuple

from volery.base.frames import HomeFrame, LocalFrame, Vector
from volery.base.position import Position
from volery.base.time import Ns, S
from volery.kernel.api import Kernel
from volery.kernel.waiting import Signal
from volery.vehicles.firmware_versions import FirmwareVersion
from volery.vehicles.vehicle_clock import Moment, VehicleClock


class Velocity(NamedTuple):
    """Velocity over ground, m/s."""

    north: float
    east: float
    up: float


class Battery(NamedTuple):
    """State of the battery: remaining share 0..1, V and A; NaN for values that are not measured."""

    remaining: float
    volts: float
    amperes: float


class Attitude(NamedTuple):
    """Attitude in degrees: roll right positive, pitch nose up positive, heading clockwise from north."""

    roll: float
    pitch: float
    heading: float


class StatusText(NamedTuple):
    """A text of the autopilot; ``severity`` as in syslog (RFC 5424)."""

    at: Ns
    severity: int
    text: str


class Answer(NamedTuple):
    """An acknowledgement; ``result`` in the protocol's own term."""

    at: Ns
    accepted: bool
    result: str


class Obstacle(NamedTuple):
    """A distance that a range sensor has measured, m, and its direction: a unit vector (east, north, up)."""

    metres: float
    direction: Vector
    at: Ns


KEPT_TEXTS = 50
LEARNT_INTERVALS, KNOWN_INTERVALS = 16, 3
"""Intervals between reports that their mean covers, and fewer than which it is not known."""
STALE_AFTER: Ns = 2 * S
"""Silence after which the state counts as old."""
REFRESHED_AFTER: Ns = 2 * S
"""Time after a silence in which messages that the link has held back may still arrive."""
POSITION_STALE_AFTER: Ns = 3 * S
SAME_HOME_M, SAME_HOME_UP_M = 1.0, 5.0
"""Horizontal and vertical distance up to which home counts as the same place: PX4 corrects its altitude by
the noise of satellite altitudes, +-1.5 m in recordings.
"""
PERIODS_MISSED = 3
"""A position that is reported rarely counts as old after this many of its periods."""
LONGEST_POSITION_AGE: Ns = 30 * S
FIXED = frozenset(
    {"3d_fix", "dgps", "rtk_float", "rtk_fixed", "static", "ppp", "3d", "rtk", "gps health 4", "gps health 5"}
)
UNFIXED = frozenset({"no_gps", "no_fix", "2d_fix", "2d", "na", "gps health 0", "gps health 1"})
"""Terms of the drivers' protocols with a position by satellites, and without one."""

RECENT_CAUSE: Ns = 5 * S
"""Age up to which a text of the autopilot counts as the reason of a mode change."""
_CAUSES: Mapping[str, tuple[str, ...]] = {
    "battery": ("battery",),
    "fence": ("fence",),
    "position: GPS or estimator": ("gps", "ekf", "position", "navigation", "estimator", "vibration"),
    "link to the ground station": ("gcs", "data link", "datalink", "ground control"),
    "manual control": ("radio", "rc failsafe", "manual control", "rc signal"),
    "thrust": ("thrust", "motor", "crash", "attitude"),
    "terrain": ("terrain",),
}
"""Words in an autopilot's texts that tell the cause of a failsafe."""
_LOW_SHARE = 0.15


MIDDLE_US, HALF_US = 1500, 500
"""Middle and half of the range of an RC channel, µs."""
PROGRAM_MAY_FLY, PILOT_FLIES = MIDDLE_US, MIDDLE_US - HALF_US
"""Pulse widths that stand for the mode switch of an autopilot without pulse widths."""


def pulse_of(share: float) -> int:
    """Return the pulse width in µs of a stick or switch at *share*, -1 to 1; 0 for what is no number."""
    return MIDDLE_US + round(HALF_US * min(1.0, max(-1.0, share))) if isfinite(share) else 0


class ReportPeriod:
    """Mean time between the reports of a quantity: of all at first, later of about the last sixteen."""

    def __init__(self) -> None:
        self._last: Ns = -1
        self._mean = nan
        self._intervals = 0

    def note(self, now: Ns) -> None:
        """Note a report at *now* ns."""
        if self._last >= 0:
            self._intervals = min(LEARNT_INTERVALS, self._intervals + 1)
            seconds = (now - self._last) / S
            self._mean = seconds if isnan(self._mean) else self._mean
            self._mean += (seconds - self._mean) / self._intervals
        self._last = now

    @property
    def seconds(self) -> float:
        """The mean, s; NaN before three intervals are known."""
        return self._mean if self._intervals >= KNOWN_INTERVALS else nan


class Telemetry:
    """The last reported state of one vehicle, in this project's units.

    Attributes:
        changed: notified after each message.
        position_reports: time between two reports of position and velocity.
        heading_reports: time between two reports of the heading.
        kind: "drone", "rover", or the autopilot's own term for another kind.
        system: system id, where the protocol has one.
        version: version of the firmware; None where it is not stated, or not yet.
        failsafe: the autopilot is in a failsafe.
        failsafe_lasts: this failsafe need not end on the ground: an order of safety may end it.
        flying: off the ground, as judged by the autopilot.
        armable: it could arm in the present mode.
        ready: it could arm now and go to a position.
        target: where the autopilot reports that it goes; AMSL altitude.
        above_home: height above home, m.
        amsl_known: altitudes AMSL are what they say; if not, only their differences to home's count.
        amsl_remedy: what the user can do if they are not.
        thrust: collective thrust, 0..1 of the largest; NaN where it is not reported.
        mission_item: the mission item in progress.
        mission_reached: the mission item reached last.
        answers: last acknowledgement by key.
        rc: pulse widths of the RC channels as the autopilot reads them, µs; 0 or 65535 where there is none.
            Where an autopilot reports positions instead, ``pulse_of`` converts them. Its mode switch, as
            channel 5, is at 1500 where a program may fly, else at 1000.
        rc_ns: time of their last report; -1 before the first.
        obstacles: what range sensors measure, by message and sector; only where a clearance is stated.
        obstacles_ns: time of their last measurement, also of one that sees nothing; -1 before the first.
        home_frame: local frame about home, in which goals are checked and reached; None without a home.
        home_ns: time since which home is reported where it is now, within ``SAME_HOME_M``; -1 without one.
        detects_silence: whether a silence is one of the link, not of a node that does not run its loop.
        external_pose_ns: when this program has last sent an external position estimate; -1: never.
        stream_lost: how a stream of this program was interrupted, so that a failsafe of the autopilot acts.
    """

    def __init__(self, kernel: Kernel, name: str) -> None:
        self.name = name
        self._kernel = kernel
        self.last_message_ns: Ns = -1
        self.fresh_from: Ns = 0
        self.position: Position | None = None
        self._position_ns: Ns = -1
        self._position_period: Ns = 0
        self._fix = ""
        self._had_fix = False
        self._fix_lost_ns: Ns | None = None
        self._had_estimate = False
        self._estimate_lost_ns: Ns | None = None
        self.detects_silence = True
        self.stream_lost = ""
        self.kind = ""
        self.autopilot = ""
        self.system = 0
        self.version: FirmwareVersion | None = None
        self.mode = ""
        self.status = ""
        self.armed = False
        self.failsafe = False
        self.failsafe_lasts = False
        self.flying = False
        self.armable = False
        self.ready = False
        self.target: Position | None = None
        self.above_home = nan
        self.amsl_known = True
        self.amsl_remedy = ""
        self._clock = VehicleClock()
        self._home: Position | None = None
        self.home_frame: HomeFrame | None = None
        self._home_at_first: Position | None = None  # as it was at ``home_ns``
        self.home_ns: Ns = -1
        self.velocity = Velocity(nan, nan, nan)
        self._attitude = Attitude(nan, nan, nan)
        self.position_reports, self.heading_reports = ReportPeriod(), ReportPeriod()
        self.battery = Battery(nan, nan, nan)
        self.thrust = nan
        self.satellites = 0
        self.mission_item = self.mission_reached = -1
        self.mission_ended = False
        self.texts: deque[StatusText] = deque(maxlen=KEPT_TEXTS)
        self.answers: dict[str, Answer] = {}
        self.rc: tuple[int, ...] = ()
        self.rc_ns: Ns = -1
        self.obstacles: dict[tuple[str, int], Obstacle] = {}
        self.obstacles_ns = self.external_pose_ns = -1
        self.changed = Signal(kernel, f"telemetry of {name}")

    def forget(self) -> None:
        """Forget what a restart of the autopilot has undone, until it is reported again."""
        self.position = self.home = None
        self.ready = self.armable = self.flying = False

    # -- age

    def note_message(self, now: Ns) -> None:
        """Note that the autopilot itself has sent a message."""
        if self.detects_silence and 0 <= self.last_message_ns < now - STALE_AFTER:
            self.fresh_from = now + REFRESHED_AFTER
        self.last_message_ns = now

    @property
    def stale(self) -> bool:
        """Whether the state may be old: the autopilot is silent, or was until a moment ago.

        A link that stalls delivers late what it has held back, so the first messages after a silence may be
        as old as the silence.
        """
        now = self._kernel.now()
        silent = self.detects_silence and now - self.last_message_ns > STALE_AFTER
        return self.last_message_ns < 0 or silent or now < self.fresh_from

    def update_position(self, position: Position) -> None:
        """Store a position estimate that was received now; its altitude is AMSL."""
        now = self._kernel.now()
        if self.position is not None:
            self._position_period = now - self._position_ns
        self.position, self._position_ns = position, now
        self.position_reports.note(now)

    @property
    def attitude(self) -> Attitude:
        """The last reported attitude."""
        return self._attitude

    @attitude.setter
    def attitude(self, attitude: Attitude) -> None:
        if (
            attitude.heading is not self._attitude.heading
        ):  # a report of roll and pitch alone keeps the object
            self.heading_reports.note(self._kernel.now())
        self._attitude = attitude

    @property
    def located(self) -> bool:
        """Whether the position is known, not old, and not an estimate that goes on without satellites."""
        return (
            self.position is not None and not self.stale and self.position_lost_for(self._kernel.now()) == 0
        )

    def position_lost_for(self, now: Ns) -> Ns:
        """Return for how long the position has not been reported or not been a valid estimate, ns.

        An estimate is not valid where the autopilot reports so, or without satellites, unless this program
        sends an external one. It is 0 before the first position, and for a vehicle that never had satellites
        or a valid estimate.
        """
        if self.position is None:
            return 0
        allowed = max(POSITION_STALE_AFTER, PERIODS_MISSED * self._position_period)
        age = now - self._position_ns
        lost = age if age > min(allowed, LONGEST_POSITION_AGE) else 0
        fix_lost = self._fix_lost_ns
        if fix_lost is not None and self.external_pose_ns >= 0:
            sent = now - self.external_pose_ns <= POSITION_STALE_AFTER
            fix_lost = None if sent else max(fix_lost, self.external_pose_ns)
        since = [one for one in (fix_lost, self._estimate_lost_ns) if one is not None]
        return max(lost, *(now - one for one in since)) if since else lost

    def note_obstacle(self, sector: tuple[str, int], direction: Vector, metres: float) -> None:
        """Note what a range sensor measures now.

        Args:
            sector: which sensor or sector of it.
            direction: unit vector (east, north, up).
            metres: distance, m; infinite where nothing is seen.
        """
        self.obstacles_ns = self._kernel.now()
        if isfinite(metres):
            self.obstacles[sector] = Obstacle(metres, direction, self.obstacles_ns)
        else:
            self.obstacles.pop(sector, None)

    @property
    def estimate_valid(self) -> bool:
        """Whether the autopilot has not reported that its estimate of the position has become invalid."""
        return self._estimate_lost_ns is None

    def note_estimate(self, valid: bool) -> None:
        """Note whether the autopilot reports its estimate of the horizontal position as valid."""
        if valid:
            self._had_estimate, self._estimate_lost_ns = True, None
        elif self._had_estimate and self._estimate_lost_ns is None:
            self._estimate_lost_ns = self._kernel.now()

    @property
    def home(self) -> Position | None:
        """Home position (AMSL); None before the first report."""
        return self._home

    @home.setter
    def home(self, home: Position | None) -> None:
        if home == self._home:
            return
        self._home = home
        self.home_frame = None if home is None else HomeFrame(home)
        if home is None or not _same_home(home, self._home_at_first):
            self._home_at_first, self.home_ns = home, self._kernel.now()

    def distance(self, here: Position | None, there: Position | None) -> float:
        """Return the horizontal distance of two positions, m; infinite if one of them or home is unknown."""
        if here is None or there is None or self.home_frame is None:
            return inf
        return self.home_frame.distance(here, there)

    @property
    def fix(self) -> str:
        """Kind of satellite fix in the protocol's own term; empty before the first report."""
        return self._fix

    @fix.setter
    def fix(self, fix: str) -> None:
        self._fix = fix
        if fix in FIXED:
            self._had_fix, self._fix_lost_ns = True, None
        elif fix in UNFIXED and self._had_fix and self._fix_lost_ns is None:
            self._fix_lost_ns = self._kernel.now()

    def update_clock(self, boot_ns: Ns) -> None:
        """Store the autopilot's time since boot, unless the message was overtaken on the way."""
        now = self._kernel.now()
        self._clock.note(boot_ns, now, fresh=now >= self.fresh_from)

    def moment(self) -> Moment:
        """Return the present moment, from which ``elapsed`` counts."""
        now = self._kernel.now()
        return Moment(now, self._clock.time(now))

    def elapsed(self, since: Moment) -> Ns:
        """Return the time since a moment, ns, on the vehicle's clock where that runs faster or slower."""
        now = self._kernel.now()
        return now - since.at if self.stale else self._clock.elapsed(since, now)

    def texts_since(self, when: Ns, severity: int = 6) -> list[str]:
        """Return texts received at or after *when*, at least as severe as *severity*, oldest first."""
        return [text.text for text in self.texts if text.at >= when and text.severity <= severity]

    def silence(self, now: Ns) -> float:
        """Return seconds since the last message; infinite before the first."""
        return inf if self.last_message_ns < 0 else (now - self.last_message_ns) / S


def _same_home(home: Position, before: Position | None) -> bool:
    """Return whether *home* is no other place than *before*, but for corrections by the autopilot."""
    if before is None or abs(home.altitude.metres - before.altitude.metres) > SAME_HOME_UP_M:
        return False
    east, north, _ = LocalFrame(before.latitude, before.longitude, 0.0).to_enu(
        home.latitude, home.longitude, 0.0
    )
    return hypot(east, north) <= SAME_HOME_M


def failsafe_cause(telemetry: Telemetry, now: Ns) -> str:
    """Return why a failsafe of the autopilot acts, in words; empty if none does.

    An autopilot may act by itself without reporting the status of a failsafe: ArduPilot at its fence. Then
    its status text is quoted.

    Args:
        telemetry: telemetry of the vehicle.
        now: the present time, ns.
    """
    said = [text.text.lower() for text in telemetry.texts if now - text.at <= RECENT_CAUSE]
    acts = [text for text in said if "failsafe" in text or "breach" in text]
    if not telemetry.failsafe and not acts:
        return ""
    for text in (*reversed(acts), *reversed(said)):
        for cause, words in _CAUSES.items():
            if any(word in text for word in words):
                return cause
    if telemetry.stream_lost:
        return "set-points of this program"
    if telemetry.position_lost_for(now):
        return "position: GPS or estimator"
    if telemetry.battery.remaining <= _LOW_SHARE:
        return "battery"
    return "not stated by the autopilot"


OVERTURNED_DEG = 70.0
"""Roll or pitch beyond which a multirotor has turned over, degrees."""


def is_overturned(attitude: Attitude) -> bool:
    """Return whether a multirotor with this attitude has turned over; an unknown one has not."""
    return abs(attitude.roll) > OVERTURNED_DEG or abs(attitude.pitch) > OVERTURNED_DEG


def describe_state(telemetry: Telemetry) -> str:
    """Return position, mode, whether it is armed, and whether it has turned over, as last reported."""
    armed = "armed" if telemetry.armed else "disarmed"
    where = f"at {telemetry.position}" if telemetry.position is not None else "position unknown"
    lies = ""
    if telemetry.kind == "drone" and is_overturned(telemetry.attitude):
        lies = ", upside down" if abs(telemetry.attitude.roll) > 90.0 else ", on its side"
    return f"{where}, mode {telemetry.mode or 'unknown'}, {armed}{lies}"
