"""What PX4 says while it returns."""

from __future__ import annotations

import struct

from volery.simulation.autopilots.px4 import events
from volery.simulation.autopilots.px4.commander import INFO, of
from volery.simulation.autopilots.vehicle_state import Vehicle


def tell_stage(vehicle: Vehicle, stage: str, amsl: float, above: float) -> None:
    """The words and the event of a stage; *amsl* is its altitude, *above* that above the destination."""
    log = of(vehicle).log
    figures = struct.pack("<iB", int(amsl), max(0, min(255, int(above))))
    heights = f"{int(amsl)} m ({int(above)} m above destination)\t"
    if stage == "climb":
        vehicle.say(INFO, "RTL HOME activated\t")
        log.tell(events.RETURN_ACTIVATED)
        if not vehicle.armed:
            return
        vehicle.say(INFO, "RTL: landing at home position.\t")
        vehicle.say(INFO, f"RTL: climb to {heights}")
        log.tell(events.RETURN_HOME)
        log.tell(events.RETURN_CLIMB, figures)
    elif stage == "return":
        vehicle.say(INFO, f"RTL: return at {heights}")
        log.tell(events.RETURN_FLY, figures)
    elif stage == "descend":
        vehicle.say(INFO, f"RTL: descend to {heights}")
        log.tell(events.RETURN_DESCEND, figures)
    else:
        vehicle.say(INFO, "RTL: land at destination\t")
        log.tell(events.RETURN_LAND)
