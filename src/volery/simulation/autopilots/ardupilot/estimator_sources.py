"""Sources of ArduPilot's estimator: sets chosen by command or switch, and glitches of the satellites.

EK3_SRCn_POSXY of the chosen set decides whether satellites are used; it is read when the set is chosen. The
other sources a set may name do not exist here, so that such a set has no position.
"""

from __future__ import annotations

from volery.base.time import S
from volery.simulation.autopilots.ardupilot.modes import CRITICAL, Check
from volery.simulation.autopilots.ardupilot.parameter_checks import GPS, SETS
from volery.simulation.autopilots.mavlink.messages import ACCEPTED, DENIED, Command
from volery.simulation.autopilots.vehicle_state import Vehicle

SET_SOURCES, SOURCES_OPTION = 42_007, 90
"""MAV_CMD, and value of RCn_OPTION."""


def choose_sources(vehicle: Vehicle, number: int) -> None:
    """Use the sources of a set, from 1; before the estimator has an origin nothing changes."""
    ignored = vehicle.parameters[f"EK3_SRC{number}_POSXY"] != GPS
    started = vehicle.uptime() > vehicle.rules.startup.origin_after
    if started and ignored != vehicle.switches.satellites_ignored:
        vehicle.switches.satellites_ignored = ignored
        vehicle.flight.use_gps(not ignored)


def on_set_sources(vehicle: Vehicle, command: Command) -> int:
    """Handle SET_EKF_SOURCE_SET: param1 is the set, 1 to 3."""
    if not SETS[0] <= command.param1 < SETS[-1] + 1:
        return DENIED
    choose_sources(vehicle, int(command.param1))
    return ACCEPTED


GLITCH_AFTER, GLITCH_CLEARED_AFTER = 1.0, 10 * S
"""Time for which all fixes are refused [s], and are fused again [ns], until EKF3 says so."""


def watch_glitches(vehicle: Vehicle) -> None:
    """Note the beginning and end of a glitch of the satellites, which a copter reports."""
    failsafes, now = vehicle.failsafes, vehicle.kernel.now()
    refused = vehicle.estimate.gps_refused
    if refused > 0.0:
        failsafes.refused_at = now
    glitching = refused > GLITCH_AFTER or (
        failsafes.glitching and now - failsafes.refused_at <= GLITCH_CLEARED_AFTER
    )
    if glitching == failsafes.glitching:
        return
    failsafes.glitching = glitching
    if vehicle.flies:
        vehicle.send_text(CRITICAL, "GPS Glitch or Compass error" if glitching else "Glitch cleared")


GLITCH_CHECK = Check("GPS glitching", lambda vehicle: vehicle.failsafes.glitching)


def switch_sources(vehicle: Vehicle, position: int) -> None:
    """Choose the first set with the switch down, the second in the middle, the third up."""
    choose_sources(vehicle, position + 2)
