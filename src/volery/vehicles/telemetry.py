"""The last state that an autopilot has reported. A driver writes it; everything above the driver reads it."""

from __future__ import annotations

from collections import deque
from math import inf, nan
from typing import NamedTuple

from volery.base.position import Position
from volery.base.time import Ns, S
from volery.kernel.api import Kernel
from volery.kernel.waiting import Signal


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


KEPT_TEXTS = 50


class Telemetry:
    """The last reported state of one vehicle, in this project's units.

    Attributes:
        changed: notified after each message.
        last_message_ns: time of the last message of the autopilot itself; -1 before the first.
        kind: "drone", "rover", or the autopilot's own term for another kind.
        system: system id, where the protocol has one.
        failsafe: the autopilot is in a failsafe.
        flying: off the ground, as judged by the autopilot.
        armable: it could arm in the present mode.
        ready: it could arm now and go to a position.
        position: position estimate with an AMSL altitude.
        target: where the autopilot reports that it goes; AMSL altitude.
        above_home: height above home, m.
        mission_item: the mission item in progress.
        mission_reached: the mission item reached last.
        answers: last acknowledgement by key.
    """

    def __init__(self, kernel: Kernel, name: str) -> None:
        self.name = name
        self.last_message_ns: Ns = -1
        self.kind = ""
        self.autopilot = ""
        self.system = 0
        self.mode = ""
        self.status = ""
        self.armed = False
        self.failsafe = False
        self.flying = False
        self.armable = False
        self.ready = False
        self.position: Position | None = None
        self.target: Position | None = None
        self.above_home = nan
        self.home: Position | None = None
        self.velocity = Velocity(nan, nan, nan)
        self.attitude = Attitude(nan, nan, nan)
        self.battery = Battery(nan, nan, nan)
        self.fix = ""
        self.satellites = 0
        self.mission_item = -1
        self.mission_reached = -1
        self.mission_ended = False
        self.texts: deque[StatusText] = deque(maxlen=KEPT_TEXTS)
        self.answers: dict[str, Answer] = {}
        self.changed = Signal(kernel, f"telemetry of {name}")

    def texts_since(self, when: Ns, severity: int = 6) -> list[str]:
        """Return texts received at or after *when*, at least as severe as *severity*, oldest first."""
        return [text.text for text in self.texts if text.at >= when and text.severity <= severity]

    def silence(self, now: Ns) -> float:
        """Return seconds since the last message; infinite before the first."""
        return inf if self.last_message_ns < 0 else (now - self.last_message_ns) / S
