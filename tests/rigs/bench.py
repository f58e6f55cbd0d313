"""A scripted vehicle, a virtual kernel, and the driver that commands it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rigs.missions import carried_out
from volery.base.time import S
from volery.kernel.virtual import VirtualKernel
from volery.links.in_process_link import in_process_pair
from volery.links.mavlink_codec import MAVLINK
from volery.vehicles import Drone, Vehicle


class Bench:
    """``fly(mission)`` runs it as a task and returns what it returns, or raises what it raises."""

    peer: Any
    opener: Any
    codec: Any = MAVLINK
    standing = "HOLD"  # the mode in which a rover begins

    def __init__(
        self, kind: type[Vehicle] = Drone, *, options: dict[str, str] | None = None, **stated: Any
    ) -> None:
        self.events: list[Any] = []
        self.kernel = VirtualKernel(record=self.events.append)
        self.link, theirs = in_process_pair(self.kernel, name="radio", codec=self.codec)
        self.autopilot = self.peer(self.kernel, theirs, 2 if kind is Drone else 10)
        self.craft = self.autopilot.craft
        if kind is not Drone:
            self.craft.mode = self.standing
        driver = self.opener(self.kernel, self.link, "craft_1", options or {})
        self.vehicle: Any = kind(self.kernel, "craft_1", driver, **stated)

    def fly(self, mission: Callable[[Any], Any]) -> Any:
        scope = self.kernel.root.child("mission")
        return carried_out(self.kernel, lambda: mission(self.vehicle), scope)

    def after(self, seconds: float, action: Callable[[], None]) -> None:
        self.kernel.call_at(self.kernel.now() + round(seconds * S), action)

    def recorded(self, kind: type) -> list[Any]:
        return [event for event in self.events if isinstance(event, kind)]
