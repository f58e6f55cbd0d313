"""What the simulated DJI aircraft does where the public definitions are silent: one table.

Figures that somebody may want to try others of are parameters instead: see ``parameters``.
"""

from __future__ import annotations

from collections.abc import Mapping

from volery.base.time import to_seconds
from volery.ros.messages.dji_constants import GO_HOME_ALTITUDES
from volery.simulation.autopilots.dji.controller import F_ABOVE, FINISHED, P_BELOW, STARTING, SWITCH
from volery.simulation.autopilots.dji.copter import ORIGIN, POSITION, READY
from volery.simulation.autopilots.dji.missions import FEWEST, MOST, STAY
from volery.simulation.autopilots.dji.services import ACCEPTED, REFUSED
from volery.simulation.autopilots.dji.setpoints import LIFTS_ABOVE_M, LIFTS_ABOVE_M_S, LIFTS_ABOVE_PERCENT
from volery.simulation.autopilots.dji.telemetry import SWITCH_SCALE

ASSUMED: Mapping[str, str] = {
    "switching on": f"it speaks after {to_seconds(READY):g} s, knows where it is after "
    f"{to_seconds(ORIGIN):g} s, and may be trusted after {to_seconds(POSITION):g} s",
    "activation": "succeeds with any key; the node of 4.1 activates by itself",
    "authority": "is given while the mode switch is at F and it is activated, to any number of programs at "
    "once",
    "mode switch": f"channel {SWITCH} of the transmitter: F above {F_ABOVE}, P below {P_BELOW}, A between; "
    f"`rc` shows {-500 * SWITCH_SCALE:g} at P, 0 at A, {500 * SWITCH_SCALE:g} at F; any move of "
    "it takes the authority, and in the air it hovers",
    "start of the motors": f"shows ENGINE_START for {to_seconds(STARTING):g} s; home is there",
    "an M100": f"has no `display_mode`, and shows FINISHED_LANDING for {to_seconds(FINISHED):g} s",
    "`gps_health`": "is 5 once the position may be trusted, 3 with a fix before that, else 0",
    "set-points": "have no effect during a take-off, and while it goes home or lands by its own decision; "
    "they end what a program has asked for",
    "set-points on the ground": f"lift it off above {LIFTS_ABOVE_M:g} m, {LIFTS_ABOVE_M_S:g} m/s or "
    f"{LIFTS_ABOVE_PERCENT:g} % of thrust",
    "set-points not flown": "angular rates, and thrust with anything but angles",
    "without a position": "set-points about the ground are hovering level; P_GPS becomes ATTITUDE",
    "missions": f"have {FEWEST} to {MOST} waypoints; action {STAY} is staying for so many milliseconds; they "
    "start in the air only",
    "`ack_data`": f"is {ACCEPTED} where it is accepted, {REFUSED} where it is refused",
    "altitude for going home": f"is taken from {GO_HOME_ALTITUDES.lowest:g} to "
    f"{GO_HOME_ALTITUDES.highest:g} m",
    "battery": "is measured without error; once low it goes home, once critical it lands, and "
    "set-points do not end that",
}
"""What, and what is taken for true."""
