"""The schema of a run's events.

All times are ``int`` nanoseconds since the start of the run. An event is a fact; costs, meanings and
violations are derived by the readers of the stream.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from volery.base.time import Ns

NONE: Ns = -1
"""No deadline, no such time."""


class Slice(NamedTuple):
    """A task ran on a core of a processor from ``start`` to ``end`` without interruption."""

    start: Ns
    end: Ns
    processor: str
    core: int
    task: str
    component: str


class Preemption(NamedTuple):
    """A task was preempted by a more urgent one. Both are named as in ``Slice.task``."""

    at: Ns
    processor: str
    core: int
    preempted: str
    by: str


class Charge(NamedTuple):
    """Execution time was added to a component's pending execution time on its processor.

    ``kind`` is ``code``, ``stated``, ``operation:<name>``, ``activation``, ``ros:<call>``, or
    ``ros:<call>*<n>`` for *n* calls of one batch. ``caller`` is executed by the calling task before it
    continues, ``background`` by other threads of its process; both are
    times at the processor's frequency. ``energy`` in joules is given only where the model states it for the
    operation, else 0.0.
    """

    at: Ns
    component: str
    processor: str
    kind: str
    caller: Ns
    background: Ns
    energy: float


class Activation(NamedTuple):
    """One activation of an active component: from its release to its next blocking wait.

    ``deadline`` is absolute, or ``NONE``.
    """

    released: Ns
    finished: Ns
    component: str
    deadline: Ns


class Call(NamedTuple):
    """One operation through a port, from the caller's call to the caller's return."""

    start: Ns
    end: Ns
    caller: str
    callee: str
    operation: str
    outcome: str  # "ok", or the class name of the error


class Message(NamedTuple):
    """A ROS message reached a subscriber (``received``), or was lost on the way (``received == NONE``)."""

    sent: Ns
    received: Ns
    topic: str
    publisher: str
    subscriber: str
    size: int


class Transmission(NamedTuple):
    """Bytes went over a network: from the sender's request to the delivery, or lost (``received == NONE``).

    ``occupied`` is how long the medium was taken, repetitions included.
    """

    sent: Ns
    received: Ns
    occupied: Ns
    network: str
    size: int


class Published(NamedTuple):
    """The content of a ROS message as it was published, already in ROS 2 CDR encoding."""

    at: Ns
    topic: str
    type: str
    publisher: str
    data: bytes


class Omitted(NamedTuple):
    """A long ROS message was published whose content is not recorded; ``size`` is that of its CDR bytes."""

    at: Ns
    topic: str
    type: str
    publisher: str
    size: int


class VehicleState(NamedTuple):
    """A vehicle's true state (ENU metres about the world's origin) and its autopilot's estimate.

    Attitude is a quaternion (w, x, y, z), FLU body in ENU; velocity in m/s ENU; ``battery`` 0..1; estimates
    are NaN while the autopilot has none. The true state of a real vehicle is unknown: its position is NaN,
    its attitude and velocity are the estimates.
    """

    at: Ns
    vehicle: str
    x: float
    y: float
    z: float
    qw: float
    qx: float
    qy: float
    qz: float
    vx: float
    vy: float
    vz: float
    estimated_x: float
    estimated_y: float
    estimated_z: float
    battery: float
    volts: float
    amperes: float
    armed: bool
    mode: str

    def where(self) -> tuple[float, float, float]:
        """Return the true position, else the estimated one; NaN if neither is known."""
        if self.x == self.x:  # false for NaN alone
            return self.x, self.y, self.z
        return self.estimated_x, self.estimated_y, self.estimated_z


class Collision(NamedTuple):
    """A vehicle hit something that stands in the world.

    ``solid`` is its name in the model, ``speed`` that into its surface [m/s]; position of the vehicle in ENU
    metres about the world's origin.
    """

    at: Ns
    vehicle: str
    solid: str
    speed: float
    x: float
    y: float
    z: float

    def __str__(self) -> str:
        return f"hit {self.solid} at {self.speed:.1f} m/s, {round(self.z, 1) + 0.0:.1f} m up"  # no -0.0


class BatteryService(NamedTuple):
    """A place gave a vehicle another battery, or charged the one that it has.

    ``kind`` is ``swap`` or ``charge``; ``duration`` is the time of charging up to ``at``, ``left`` the share
    of the charge that was left before.
    """

    at: Ns
    vehicle: str
    place: str
    kind: str
    duration: Ns
    left: float


class Operation(NamedTuple):
    """A vehicle operation (take-off, goto, ...) from its call to its end, with its error at the end.

    Errors in metres, horizontal and vertical, by the autopilot's own estimate and by truth; NaN where there
    is none.
    """

    start: Ns
    end: Ns
    vehicle: str
    operation: str
    asked: str
    outcome: str  # "ok", or the class name of the error
    said: str  # the error's message
    estimate_horizontal: float
    estimate_vertical: float
    true_horizontal: float
    true_vertical: float


class Milestone(NamedTuple):
    """Something that the application tracks, such as an order, entered a state: see ``volery.note()``."""

    at: Ns
    component: str
    kind: str
    subject: str
    state: str
    detail: str


EMERGENCY, ALERT, CRITICAL, ERROR, WARNING, NOTICE, INFO, DEBUG = range(8)
"""Severities of syslog, which MAVLink has as well."""


class Text(NamedTuple):
    """A component's log line or an autopilot's status text.

    ``severity`` is that of syslog: 0 emergency .. 7 debug.
    """

    at: Ns
    source: str
    severity: int
    text: str


class Unserved(NamedTuple):
    """What a component offered or asked for until the end of a run, and no node took or served.

    ``kind`` is ``publication``, ``subscription``, ``service``, ``action`` or ``transform``; ``who``: nodes;
    ``times`` is the number of messages, calls or look-ups; ``hint`` says what is there instead.
    """

    at: Ns
    kind: str
    name: str
    type: str
    who: str
    times: int
    since: Ns
    hint: str


class LinkState(NamedTuple):
    """A link came up, went silent, was lost or came back."""

    at: Ns
    link: str
    state: str
    detail: str


class Failure(NamedTuple):
    """A component or the run itself failed."""

    at: Ns
    who: str
    what: str


class ControlSample(NamedTuple):
    """One sample of a control loop: its terms in the unit of the output, the rest in ``unit``.

    ``period`` is a full turn of an angle, 0.0 for another quantity. ``controller`` names the law. Before the
    first measurement all of it is NaN.
    """

    at: Ns
    vehicle: str
    loop: str
    controller: str
    unit: str
    period: float
    goal: float
    measurement: float
    error: float
    proportional: float
    integral: float
    derivative: float
    output: float


class Verdict(NamedTuple):
    """A requirement at the end of a run.

    ``observed`` is NaN when nothing was observed (then ``met`` is False).
    """

    at: Ns
    requirement: str
    observable: str
    relation: str  # "max" or "min"
    bound: float
    observed: float
    met: bool


Event = (
    Slice
    | Preemption
    | Charge
    | Activation
    | Call
    | Message
    | Transmission
    | Published
    | Omitted
    | VehicleState
    | Collision
    | BatteryService
    | Operation
    | Milestone
    | Text
    | Unserved
    | LinkState
    | Failure
    | Verdict
    | ControlSample
)
Record = Callable[[Any], None]
"""Records an ``Event``: what a package that records events is given."""


def ignore(event: Event) -> None:
    """Discard *event*."""
