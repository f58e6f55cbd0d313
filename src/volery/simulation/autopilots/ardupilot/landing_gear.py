"""Landing gear of a simulated ArduPilot copter: outputs with the function 29, deployed or retracted.

The gear moves by AIRFRAME_CONFIGURATION, by a switch, at the start (LGR_STARTUP), at heights (LGR_DEPLOY_ALT,
LGR_RETRACT_ALT), after a take-off in AUTO or GUIDED and before a landing (LGR_OPTIONS). The body does not
change with it: only the outputs do. Pins that sense the gear are not simulated.
"""

from __future__ import annotations

from dataclasses import dataclass

from volery.simulation.autopilots.ardupilot.feature import Feature, Kept
from volery.simulation.autopilots.ardupilot.servo_outputs import channels, move
from volery.simulation.autopilots.mavlink.messages import ACCEPTED, Command
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle
from volery.trace.events import INFO

GEAR_OUTPUT = 29
"""SERVOn_FUNCTION."""
STARTS_RETRACTED, STARTS_DEPLOYED = 1, 2
"""LGR_STARTUP."""
RETRACTS_AFTER_TAKEOFF, DEPLOYS_FOR_LANDING = 1, 2
"""Bits of LGR_OPTIONS."""
RETRACT = 1
"""param2 of AIRFRAME_CONFIGURATION; any other value deploys."""
AIRFRAME_CONFIGURATION, GEAR_SWITCH = 2520, 29
"""MAV_CMD, and value of RCn_OPTION."""
CLIMBS_BY_ITSELF = ("AUTO", "GUIDED")


@dataclass
class GearState:
    """Landing gear, as its outputs were last set."""

    deployed: bool | None = None
    """``None`` until it has moved."""
    started: bool = False
    """Whether the position at the start has been taken."""
    height: int = 0
    """Height above home [m], climb and landing at the last tick."""
    climbing: bool = False
    landing: bool = False


gear_of = Kept(GearState)


def move_gear(vehicle: AutopilotVehicle, deploy: bool) -> None:
    """Deploy or retract, if LGR_ENABLE allows: outputs go to their upper or lower end."""
    parameters, gear = vehicle.parameters, gear_of(vehicle)
    if not parameters["LGR_ENABLE"]:
        return
    move(vehicle, GEAR_OUTPUT, float(deploy))
    if channels(vehicle, GEAR_OUTPUT) and not (deploy and gear.deployed):
        vehicle.send_text(INFO, f"LandingGear: {'DEPLOY' if deploy else 'RETRACT'}")
    gear.deployed = deploy


def on_airframe_configuration(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle AIRFRAME_CONFIGURATION; the number of the gear (param1) is not read."""
    move_gear(vehicle, deploy=int(command.param2) != RETRACT)
    return ACCEPTED


def switch_gear(vehicle: AutopilotVehicle, position: int) -> None:
    """Deploy with the switch down, retract with it up; the middle changes nothing."""
    if position:
        move_gear(vehicle, deploy=position < 0)


def watch_gear(vehicle: AutopilotVehicle) -> None:
    """Move the gear where the start, a height, a take-off or a landing demands it, at each tick."""
    parameters, gear = vehicle.parameters, gear_of(vehicle)
    if not parameters["LGR_ENABLE"]:
        return
    if not gear.started:
        gear.started = True
        startup = round(parameters["LGR_STARTUP"])
        if startup in (STARTS_RETRACTED, STARTS_DEPLOYED):
            move_gear(vehicle, deploy=startup == STARTS_DEPLOYED)
    _at_heights(vehicle)
    options, manoeuvre = round(parameters["LGR_OPTIONS"]), vehicle.manoeuvre
    climbs = vehicle.armed and manoeuvre.taking_off and vehicle.mode.name in CLIMBS_BY_ITSELF
    lands = vehicle.armed and manoeuvre.landing
    climbed = gear.climbing and not climbs and vehicle.armed and not vehicle.landed
    if climbed and options & RETRACTS_AFTER_TAKEOFF and vehicle.mode.name in CLIMBS_BY_ITSELF:
        move_gear(vehicle, deploy=False)
    if lands and not gear.landing and options & DEPLOYS_FOR_LANDING:
        move_gear(vehicle, deploy=True)
    gear.climbing, gear.landing = climbs, lands


def _at_heights(vehicle: AutopilotVehicle) -> None:
    """Deploy or retract an armed vehicle that passes a height above home, in whole metres; 0: none."""
    gear = gear_of(vehicle)
    lower, upper = vehicle.parameters["LGR_DEPLOY_ALT"], vehicle.parameters["LGR_RETRACT_ALT"]
    height, before = max(0, int(vehicle.height)), gear.height
    gear.height = height
    if not vehicle.armed or not channels(vehicle, GEAR_OUTPUT):
        return
    if gear.deployed is not True and lower > 0 and height <= lower < before:
        move_gear(vehicle, deploy=True)
    elif gear.deployed is not False and upper > 0 and lower <= upper and before < upper <= height:
        move_gear(vehicle, deploy=False)


COPTER = Feature(
    parameters={
        "LGR_ENABLE": ("", "any value but 0: there is a landing gear"),
        "LGR_STARTUP": ("", "1 retracts, 2 deploys the landing gear at the start"),
        "LGR_DEPLOY_ALT": ("m", "height above home below which a descent deploys the landing gear; 0: none"),
        "LGR_RETRACT_ALT": ("m", "height above home above which a climb retracts the landing gear; 0: none"),
        "LGR_OPTIONS": ("", "landing gear: bit 0 retracts after a take-off, bit 1 deploys for landing"),
    },
    commands={AIRFRAME_CONFIGURATION: on_airframe_configuration},
    switches={GEAR_SWITCH: switch_gear},
    on_tick=watch_gear,
)
