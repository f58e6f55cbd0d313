"""MAVLink's mission upload: we tell the count, the autopilot asks for each item and acknowledges the last."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from volery.base.time import Ns, S
from volery.vehicles.drivers.mavlink.commands import Item

STALLED: Ns = 5 * S
MISSION = 0


class Upload:
    """One upload under way. *send_to* takes a message's name and its fields but for the target."""

    def __init__(self, items: Sequence[Item], send_to: Callable[..., None]) -> None:
        self._items = items
        self._send_to = send_to
        self._asked: Ns | None = None

    def begin(self) -> None:
        """Tell how many there are."""
        self._send_to("MISSION_COUNT", count=len(self._items), mission_type=MISSION)

    def alive(self, now: Ns) -> bool:
        """The autopilot goes on asking."""
        return self._asked is not None and now - self._asked < STALLED

    def requested(self, number: int, now: Ns) -> None:
        """Send an item; whichever it asks for, as often as it asks."""
        self._asked = now
        if not 0 <= number < len(self._items):
            return
        item = self._items[number]
        first, second, third, fourth = item.parameters
        self._send_to(
            "MISSION_ITEM_INT",
            seq=number,
            frame=item.frame,
            command=item.command,
            current=0,
            autocontinue=1,
            param1=first,
            param2=second,
            param3=third,
            param4=fourth,
            x=round(item.latitude * 1e7),
            y=round(item.longitude * 1e7),
            z=item.z,
            mission_type=MISSION,
        )
