"""The MAVLink side of a vehicle node: one autopilot at the other end of a link."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from types import TracebackType
from typing import Any, NamedTuple, Self

from volery.base.time import Ns
from volery.bridge.modes import Firmware
from volery.kernel.api import Kernel
from volery.kernel.waiting import Signal
from volery.links.link import Frame, Link

INVALID_AUTOPILOT = 8
"""MAV_AUTOPILOT of ground stations and companions."""
_KEPT_ALL = frozenset({"STATUSTEXT", "MISSION_ITEM_REACHED", "HEARTBEAT", "PARAM_VALUE"})


class Heard(NamedTuple):
    """A frame, and when it came."""

    frame: Frame
    at: Ns


class Ear:
    """Hears frames of some names while it is open.

    ``with wire.listen("COMMAND_ACK") as ear: ear.next(within)``.
    """

    def __init__(self, wire: Wire, names: tuple[str, ...]) -> None:
        self.names = frozenset(names)
        self._wire = wire
        self._frames: deque[Frame] = deque()
        self._filled = Signal(wire.kernel, f"{wire.name} ({', '.join(names)})")

    def __enter__(self) -> Self:
        with self._wire.kernel.guard:
            self._wire.ears.append(self)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        with self._wire.kernel.guard:
            self._wire.ears.remove(self)

    def hear(self, frame: Frame) -> None:
        """House code."""
        self._frames.append(frame)
        self._filled.notify()

    def next(self, within: Ns) -> Frame | None:
        """The next frame, waiting for it; ``None`` if none comes in time."""
        if self._filled.wait_for(lambda: self._frames, within):
            return self._frames.popleft()
        return None


class Wire:
    """Sends as (*system*, *component*) to the autopilot that is heard first, and keeps what it says.

    *vehicle* is the system id to listen for where several share a link; 0: whichever speaks.
    """

    def __init__(self, kernel: Kernel, link: Link, system: int, component: int, vehicle: int = 0) -> None:
        self.kernel, self.name = kernel, link.name
        self._link = link
        self._system, self._component = system, component
        self._vehicle = vehicle
        self._published: frozenset[str] | None = None
        self.target: tuple[int, int] = (0, 0)
        self.firmware = Firmware()
        self.last_heartbeat: Ns | None = None
        self.latest: dict[str, Heard] = {}
        self.fresh: list[Heard] = []
        self.ears: list[Ear] = []
        self._came = Signal(kernel, f"{link.name} (frames)")
        link.receive(self._receive)

    @property
    def known(self) -> bool:
        """Whether an autopilot has been heard."""
        return self.target != (0, 0)

    def _receive(self, frame: Frame) -> None:
        if self._vehicle not in (0, frame.system):
            return
        if frame.name == "HEARTBEAT" and not self.known and frame.fields["autopilot"] != INVALID_AUTOPILOT:
            self.target = (frame.system, frame.component)
        if (frame.system, frame.component) != self.target:
            return
        now = self.kernel.now()
        if frame.name == "HEARTBEAT":
            self.last_heartbeat = now
            self.firmware = Firmware(frame.fields["autopilot"], frame.fields["type"])
        heard = Heard(frame, now)
        if frame.name not in _KEPT_ALL:
            self._forget(frame.name)
        self.latest[frame.name] = heard
        if self._published is None or frame.name in self._published:
            self.fresh.append(heard)
            self._came.notify()
        for ear in tuple(self.ears):
            if frame.name in ear.names:
                ear.hear(frame)

    def _forget(self, name: str) -> None:
        """What is repeated all the time is published in its latest form only."""
        last = self.latest.get(name)
        if last is not None and last in self.fresh:
            self.fresh.remove(last)

    def only(self, published: Iterable[str]) -> None:
        """From now on these names alone are fresh: nobody is woken for the others."""
        self._published = frozenset(published)

    def take(self) -> list[Heard]:
        """What has come since it was last asked."""
        taken, self.fresh = self.fresh, []
        return taken

    def wait(self, until: Ns) -> None:
        """Block the current task until something has come, or that time."""
        within = max(0, until - self.kernel.now())
        self._came.wait_for(lambda: self.fresh, within, ends_activation=True)

    def last(self, name: str) -> dict[str, Any] | None:
        """The fields of the latest frame of that name."""
        heard = self.latest.get(name)
        return heard.frame.fields if heard else None

    def listen(self, *names: str) -> Ear:
        """An ear for frames of these names; a context manager."""
        return Ear(self, names)

    def send(self, name: str, fields: dict[str, Any]) -> None:
        """Send to nobody in particular."""
        with self.kernel.guard:
            self._link.send(Frame(name, fields, self._system, self._component))

    def send_to(self, name: str, fields: dict[str, Any]) -> None:
        """Send to the autopilot."""
        system, component = self.target
        if name == "MANUAL_CONTROL":  # the one message that addresses a system only
            self.send(name, {"target": system, **fields})
        elif name == "STATUSTEXT":  # to whom it may concern
            self.send(name, fields)
        else:
            self.send(name, {"target_system": system, "target_component": component, **fields})
