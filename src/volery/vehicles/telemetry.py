"""What the autopilot said last. A driver writes it; everybody above reads it."""

from __future__ import annotations

from collections import deque
from math import inf, nan
from typing import NamedTuple

from volery.base.position import Position
from volery.base.time import Ns, S
from volery.kernel.api import Kernel
from volery.kernel.waiting import Signal


class Velocity(NamedTuple):
    """Metres per second over ground."""

    north: float
    east: float
    up: float


class Battery(NamedTuple):
    """``remaining`` 0..1; NaN where the autopilot does not measure."""

    remaining: float
    volts: float
    amperes: float


class Attitude(NamedTuple):
    """Degrees: roll right +, pitch nose up +, heading clockwise from north."""

    roll: float
    pitch: float
    heading: float


class StatusText(NamedTuple):
    """A text of the autopilot. ``severity`` as in syslog."""

    at: Ns
    severity: int
    text: str


class Answer(NamedTuple):
    """An acknowledgement. ``result`` in the protocol's own word."""

    at: Ns
    accepted: bool
    result: str


KEPT_TEXTS = 50


class Telemetry:
    """Facts about one vehicle, in this project's units, each as it was last heard.

    ``changed`` is notified after each message. ``heard`` is when the autopilot itself last spoke, -1 for
    never. ``position`` has an AMSL altitude, as has ``target``: where it said last that it goes. ``failsafe``
    says that the autopilot itself is in one. ``flying`` is off the ground by the autopilot's own judgement.
    ``ready`` means that it could arm now and fly by position, ``armable`` that it could arm in the mode it is
    in.
    """

    def __init__(self, kernel: Kernel, name: str) -> None:
        self.name = name
        self.heard: Ns = -1
        self.kind = ""  # "drone", "rover", or the autopilot's own word for anything else
        self.autopilot = ""
        self.system = 0  # its id, where the protocol has one
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
        self.mission_item = -1  # the item it flies to
        self.mission_reached = -1  # the item it reached last
        self.mission_ended = False
        self.texts: deque[StatusText] = deque(maxlen=KEPT_TEXTS)
        self.answers: dict[str, Answer] = {}
        self.changed = Signal(kernel, f"telemetry of {name}")

    def texts_since(self, when: Ns, severity: int = 6) -> list[str]:
        """Texts said at or after *when*, that are at least as severe as *severity*, oldest first."""
        return [said.text for said in self.texts if said.at >= when and said.severity <= severity]

    def silence(self, now: Ns) -> float:
        """Seconds since the autopilot was last heard; infinite if it never was."""
        return inf if self.heard < 0 else (now - self.heard) / S
