"""A DJI multirotor: modes, boot and failsafes, composed as a firmware, and the list of assumptions.

Figures that a user may want to vary are parameters instead.
"""

from __future__ import annotations

from collections.abc import Mapping

from volery.base.time import MS, S, to_seconds
from volery.ros.messages.dji_constants import GO_HOME_ALTITUDES, DisplayMode
from volery.simulation.autopilots.dji.endpoint import SWITCH_SCALE, DjiEndpoint
from volery.simulation.autopilots.dji.flight_controller import (
    ENGINE_START_TIME,
    F_ABOVE,
    FINISHED_LANDING_TIME,
    MAX_WAYPOINTS,
    MIN_WAYPOINTS,
    P_BELOW,
    STAY_ACTION,
    SWITCH,
    FlightController,
    controller_of,
)
from volery.simulation.autopilots.dji.parameters import SUPPORTED, parameters, tuning
from volery.simulation.autopilots.dji.sdk_services import ACCEPTED, REFUSED
from volery.simulation.autopilots.dji.sdk_setpoints import (
    LIFT_OFF_M,
    LIFT_OFF_M_S,
    LIFT_OFF_PERCENT,
    SdkControl,
)
from volery.simulation.autopilots.firmware import BootEvent, BootSequence, Failsafe, Firmware, PeriodicWork
from volery.simulation.autopilots.flight_stack.flight import Flight
from volery.simulation.autopilots.manoeuvres.manual_flight import AltitudeHold, Loiter
from volery.simulation.autopilots.manoeuvres.onboard_mission_flight import (
    FlyMission,
    MissionRules,
    copter_leg,
)
from volery.simulation.autopilots.manoeuvres.to_point import Land, Return, TakeOff
from volery.simulation.autopilots.vehicle_state import (
    ArmingTimes,
    Manoeuvre,
    Mode,
    ParameterTable,
    RcDefaults,
    StartupTimes,
    Vehicle,
    VehicleRules,
)

READY, ORIGIN, POSITION = 3 * S, 15 * S, 25 * S
"""Uptimes at which the node publishes, the position is known, and the position is trusted. Assumed."""

NO_BITS = 0
"""There is no heartbeat."""


def _take_off(vehicle: Vehicle) -> Manoeuvre:
    return TakeOff(vehicle, vehicle.parameters["TAKEOFF_HEIGHT"])


MISSION_RULES = MissionRules(
    first_item=0,
    item_begins=lambda vehicle, number, item: controller_of(vehicle).item_begins(number, item),
    ended=lambda vehicle: controller_of(vehicle).mission_ended(),
)


def _mission(vehicle: Vehicle) -> Manoeuvre:
    return FlyMission(vehicle, copter_leg, MISSION_RULES)


MODES = {
    mode.number: mode
    for mode in (
        Mode(DisplayMode.ATTITUDE, "ATTITUDE", NO_BITS, AltitudeHold, pilot=True),
        Mode(DisplayMode.P_GPS, "P_GPS", NO_BITS, Loiter, pilot=True),
        Mode(DisplayMode.AUTO_TAKEOFF, "AUTO_TAKEOFF", NO_BITS, _take_off),
        Mode(DisplayMode.AUTO_LANDING, "AUTO_LANDING", NO_BITS, Land),
        Mode(DisplayMode.NAVI_MISSION, "NAVI_MISSION", NO_BITS, _mission, needs_position=True),
        Mode(DisplayMode.NAVI_GO_HOME, "NAVI_GO_HOME", NO_BITS, Return, needs_position=True),
        Mode(DisplayMode.NAVI_SDK_CTRL, "NAVI_SDK_CTRL", NO_BITS, SdkControl),
        Mode(DisplayMode.FORCE_AUTO_LANDING, "FORCE_AUTO_LANDING", NO_BITS, Land),
    )
}


def finish_boot(vehicle: Vehicle) -> None:
    """Put the aircraft on the ground in P_GPS."""
    vehicle.ground.landed = True
    controller_of(vehicle).reset()
    vehicle.enter_mode(MODES[DisplayMode.P_GPS])


def _below(percent: str) -> Failsafe:
    begins = {
        "LOW_BATTERY": FlightController.low_battery,
        "CRITICAL_BATTERY": FlightController.critical_battery,
    }[percent]
    return Failsafe(
        percent.lower().replace("_", " "),
        lambda vehicle: vehicle.estimate.battery_left * 100.0 < vehicle.parameters[percent],
        lambda vehicle: begins(controller_of(vehicle)),
    )


def own_parameters(_system: int, _flight: Flight) -> dict[str, float]:
    """Return no parameters: none follow from the vehicle."""
    return {}


COPTER = Firmware(
    name="dji",
    kind="multirotor",
    rules=VehicleRules(
        modes=MODES,
        boot_mode=MODES[DisplayMode.P_GPS],
        startup=StartupTimes(READY, ORIGIN, POSITION, POSITION),
        arming=ArmingTimes(motors_rest=S, spool_up=S, takeoff_slew=100 * MS, abandoned_after=1500 * MS),
        parameters=ParameterTable(parameters, tuning, own_parameters, SUPPORTED),
        rc=RcDefaults((1500, 1500, 1500, 1500, 2000, 1000, 1000, 1000, 0, 0, 0, 0, 0, 0, 0, 0), True),
        firmware_state=FlightController,
    ),
    boot=BootSequence(
        (BootEvent(READY, finish_boot), BootEvent(ORIGIN, lambda vehicle: vehicle.flight.set_origin())),
        finish_boot,
    ),
    periodic=PeriodicWork(on_step=lambda vehicle: controller_of(vehicle).step()),
    failsafes=(_below("LOW_BATTERY"), _below("CRITICAL_BATTERY")),
    endpoint=DjiEndpoint,
)

ASSUMED: Mapping[str, str] = {
    "switching on": f"the node publishes after {to_seconds(READY):g} s, the position is known after "
    f"{to_seconds(ORIGIN):g} s and trusted after {to_seconds(POSITION):g} s",
    "activation": "any key succeeds; the node of 4.1 activates automatically",
    "authority": "given to any number of programs at once while the mode switch is at F and the "
    "aircraft is activated",
    "mode switch": f"channel {SWITCH} of the transmitter: F above {F_ABOVE}, P below {P_BELOW}, A "
    f"between; `rc` shows {-500 * SWITCH_SCALE:g} at P, 0 at A, {500 * SWITCH_SCALE:g} at F; any "
    "change withdraws the authority, and in flight the aircraft hovers",
    "start of the motors": f"ENGINE_START for {to_seconds(ENGINE_START_TIME):g} s; sets the home position",
    "an M100": "has no `display_mode`, and shows FINISHED_LANDING for "
    f"{to_seconds(FINISHED_LANDING_TIME):g} s",
    "`gps_health`": "5 once the position is trusted, 3 with a fix before that, else 0",
    "set-points": "no effect during a take-off, and while the aircraft goes home or lands by its own "
    "decision; they end tasks of a program",
    "set-points on the ground": f"take off above {LIFT_OFF_M:g} m, {LIFT_OFF_M_S:g} m/s or "
    f"{LIFT_OFF_PERCENT:g} % of thrust",
    "set-points not flown": "angular rates, and thrust with anything but angles",
    "without a position": "ground-relative set-points hover level; P_GPS becomes ATTITUDE",
    "missions": f"{MIN_WAYPOINTS} to {MAX_WAYPOINTS} waypoints; action {STAY_ACTION} stays for a number "
    "of milliseconds; they start in flight only",
    "`ack_data`": f"{ACCEPTED} where accepted, {REFUSED} where refused",
    "altitude for going home": f"from {GO_HOME_ALTITUDES.lowest:g} to {GO_HOME_ALTITUDES.highest:g} m",
    "battery": "measured without error; a low one goes home, a critical one lands, and set-points do "
    "not end that",
}
"""Subject and assumption, as in docs/dji.md."""
