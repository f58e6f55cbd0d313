"""ArduPilot's crop sprayer: a pump that follows the speed over ground, and a spinner.

It runs by DO_SPRAYER, its mission item or a switch. Nothing is sprayed here: the outputs are what it does.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot

from volery.base.time import MS, Ns, S
from volery.simulation.autopilots.ardupilot.feature import Feature, Kept, MissionCommand
from volery.simulation.autopilots.ardupilot.servo_outputs import channels, move, write
from volery.simulation.autopilots.mavlink.messages import ACCEPTED, FAILED, Command
from volery.simulation.autopilots.onboard_mission import MissionItem
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

DO_SPRAYER, SPRAYER_SWITCH = 216, 15
"""MAV_CMD, and value of RCn_OPTION."""
PUMP, SPINNER = 22, 23
"""SERVOn_FUNCTION."""
STARTS_AFTER, STOPS_AFTER = 100 * MS, S
"""Time beyond SPRAY_SPEED_MIN after which it sprays, and below it after which it stops."""
TESTED_AT = 1.0
"""Speed [m/s] for which a switch turns the pump of a disarmed vehicle."""


@dataclass
class SprayerState:
    """Crop sprayer."""

    running: bool = False
    """Whether it may spray."""
    tested: bool = False
    """Whether the pump turns at rest."""
    spraying: bool = False
    changes_since: Ns = NEVER
    """Since when the speed has been where it starts or stops to spray."""


sprayer_of = Kept(SprayerState)


def run_sprayer(vehicle: AutopilotVehicle, on: bool) -> None:
    """Let the sprayer run or not; it sprays while it runs above SPRAY_SPEED_MIN."""
    sprayer = sprayer_of(vehicle)
    if on == sprayer.running:
        return
    sprayer.running = on and bool(vehicle.parameters["SPRAY_ENABLE"])
    if not sprayer.running:
        _stop(vehicle)


def _stop(vehicle: AutopilotVehicle) -> None:
    sprayer_of(vehicle).spraying = False
    move(vehicle, PUMP, 0.0)
    move(vehicle, SPINNER, 0.0)


def switch_sprayer(vehicle: AutopilotVehicle, position: int) -> None:
    """Run the sprayer with the switch up; while disarmed this tests the pump."""
    run_sprayer(vehicle, position > 0)
    sprayer_of(vehicle).tested = position > 0 and not vehicle.armed


def on_sprayer(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_SPRAYER: param1 is 1 to run, 0 to stop."""
    if command.param1 not in (0.0, 1.0):
        return FAILED
    run_sprayer(vehicle, command.param1 == 1.0)
    return ACCEPTED


def act_on_sprayer(vehicle: AutopilotVehicle, item: MissionItem) -> None:
    """Execute the mission item DO_SPRAYER."""
    if item.param1 in (0.0, 1.0):
        run_sprayer(vehicle, item.param1 == 1.0)


def update_sprayer(vehicle: AutopilotVehicle) -> None:
    """Set pump and spinner of a sprayer that runs, at each tick."""
    sprayer, parameters = sprayer_of(vehicle), vehicle.parameters
    if not sprayer.running:
        return
    if not parameters["SPRAY_ENABLE"]:
        run_sprayer(vehicle, on=False)
        return
    if not channels(vehicle, PUMP):
        return
    speed = hypot(*vehicle.estimate.velocity[:2])
    sprays = _sprays(vehicle, speed)
    if sprayer.tested:
        speed, sprays = TESTED_AT, True
    if not sprays:
        _stop(vehicle)
        return
    sprayer.spraying = True
    percent = max(speed * parameters["SPRAY_PUMP_RATE"], parameters["SPRAY_PUMP_MIN"])
    move(vehicle, PUMP, int(100.0 * percent) / 10_000.0)
    write(vehicle, SPINNER, round(parameters["SPRAY_SPINNER"]))


def _sprays(vehicle: AutopilotVehicle, speed: float) -> bool:
    """Return whether it sprays: the speed [m/s] was beyond its limit for long enough."""
    sprayer, now = sprayer_of(vehicle), vehicle.kernel.now()
    fast = 100.0 * speed >= vehicle.parameters["SPRAY_SPEED_MIN"]
    if fast == sprayer.spraying:
        sprayer.changes_since = NEVER
    elif sprayer.changes_since == NEVER:
        sprayer.changes_since = now
    elif now - sprayer.changes_since > (STARTS_AFTER if fast else STOPS_AFTER):
        sprayer.changes_since = NEVER
        return fast
    return sprayer.spraying


COPTER = ROVER = Feature(
    parameters={
        "SPRAY_ENABLE": ("", "any value but 0: there is a sprayer"),
        "SPRAY_PUMP_MIN": ("%", "least share of the pump"),
        "SPRAY_PUMP_RATE": ("%", "share of the pump at 1 m/s"),
        "SPRAY_SPEED_MIN": ("cm/s", "speed over ground below which it does not spray"),
        "SPRAY_SPINNER": ("µs", "pulse width of the spinner"),
    },
    commands={DO_SPRAYER: on_sprayer},
    items={DO_SPRAYER: MissionCommand("Sprayer", act_on_sprayer, silent=True)},
    switches={SPRAYER_SWITCH: switch_sprayer},
    on_tick=update_sprayer,
)
