"""Sources of ArduPilot's estimator: sets chosen by command or switch, and glitches of the satellites.

EK3_SRCn_POSXY of the chosen set decides whether satellites are used; it is read when the set is chosen.
External poses are those of ``external_navigation``. The other sources that a set may name do not exist here,
so that such a set has no position.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from volery.base.time import Ns, S
from volery.simulation.autopilots.ardupilot.feature import ArmingCheck, Feature, Kept
from volery.simulation.autopilots.ardupilot.parameter_checks import EXTERNAL, GPS, SETS
from volery.simulation.autopilots.mavlink.messages import ACCEPTED, DENIED, Command, Fields
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle
from volery.trace.events import CRITICAL

SET_SOURCES, SOURCES_OPTION = 42_007, 90
"""MAV_CMD, and value of RCn_OPTION."""
GLITCHING = 1 << 15
"""Bit of EKF_STATUS_FLAGS: satellites are refused."""


@dataclass
class SourceState:
    """Satellites as the estimator uses them. Times in ns."""

    number: int = 1
    """The chosen set."""
    ignored: bool = False
    """Whether the chosen set of sources has no satellites."""
    glitching: bool = False
    """Whether the estimator has refused all fixes for a second, and has not fused them for ten since then."""
    refused_at: Ns = NEVER
    """When it last refused one."""


sources_of = Kept(SourceState)


def choose_sources(vehicle: AutopilotVehicle, number: int) -> None:
    """Use the sources of a set, from 1; before the estimator has an origin nothing changes."""
    source = vehicle.parameters[f"EK3_SRC{number}_POSXY"]
    ignored = source != GPS
    started = vehicle.uptime() > vehicle.rules.startup.origin_after
    sources = sources_of(vehicle)
    if not started:
        return
    sources.number = number
    if ignored != sources.ignored:
        sources.ignored = ignored
        if source != EXTERNAL or not vehicle.parameters["VISO_TYPE"]:
            vehicle.flight.use_gps(not ignored)


def on_set_sources(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle SET_EKF_SOURCE_SET: param1 is the set, 1 to 3."""
    if not SETS[0] <= command.param1 < SETS[-1] + 1:
        return DENIED
    choose_sources(vehicle, int(command.param1))
    return ACCEPTED


GLITCH_AFTER, GLITCH_CLEARED_AFTER = 1.0, 10 * S
"""Time for which all fixes are refused [s], and are fused again [ns], until EKF3 says so."""


def watch_glitches(vehicle: AutopilotVehicle) -> None:
    """Note the beginning and end of a glitch of the satellites, which a copter reports."""
    sources, now = sources_of(vehicle), vehicle.kernel.now()
    refused = vehicle.estimate.gps_refused
    if refused > 0.0:
        sources.refused_at = now
    glitching = refused > GLITCH_AFTER or (
        sources.glitching and now - sources.refused_at <= GLITCH_CLEARED_AFTER
    )
    if glitching == sources.glitching:
        return
    sources.glitching = glitching
    if vehicle.flies:
        vehicle.send_text(CRITICAL, "GPS Glitch or Compass error" if glitching else "Glitch cleared")


def switch_sources(vehicle: AutopilotVehicle, position: int) -> None:
    """Choose the first set with the switch down, the second in the middle, the third up."""
    choose_sources(vehicle, position + 2)


def _amend_report(vehicle: AutopilotVehicle, report: Fields) -> Fields:
    """Return EKF_STATUS_REPORT with the flag of a glitch."""
    return {**report, "flags": report["flags"] | GLITCHING} if sources_of(vehicle).glitching else report


ROVER = Feature(
    commands={SET_SOURCES: on_set_sources},
    switches={SOURCES_OPTION: switch_sources},
    on_tick=watch_glitches,
    amends={"EKF_STATUS_REPORT": _amend_report},
)
COPTER = replace(ROVER, checks=(ArmingCheck("GPS glitching", lambda vehicle: sources_of(vehicle).glitching),))
