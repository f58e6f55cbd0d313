"""A DJI multirotor: modes, boot and failsafes, composed as a firmware, and the list of assumptions.

Figures that a user may want to vary are parameters instead.
"""

from __future__ import annotations

from collections.abc import Mapping

from volery.base.time import MS, S, to_seconds
from volery.ros.messages.dji_constants import (
    GO_HOME_ALTITUDES,
    GUIDES,
    HEADERS,
    NO_CODE,
    DisplayMode,
    DocumentedBehaviour,
)
from volery.simulation.autopilots.autopilot import (
    BootEvent,
    BootSequence,
    Firmware,
    PeriodicWork,
    WatchedCondition,
)
from volery.simulation.autopilots.dji.endpoint import DjiEndpoint
from volery.simulation.autopilots.dji.flight_controller import (
    CONFIRM_BELOW_M,
    ENGINE_START_TIME,
    F_ABOVE,
    FINISHED_LANDING_TIME,
    NO_RC_HEIGHT_M,
    NO_RC_RADIUS_M,
    P_BELOW,
    RANGE_M,
    RC_LOST_AFTER,
    SWITCH,
    FlightController,
    controller_of,
)
from volery.simulation.autopilots.dji.parameters import (
    M600_LAND_FAST,
    M600_LAND_SLOW,
    M600_SLOW_BELOW,
    SLOW_BELOW,
    SUPPORTED,
    parameters,
    tuning,
)
from volery.simulation.autopilots.dji.sdk_commands import (
    LIFT_OFF_M,
    LIFT_OFF_M_S,
    LIFT_OFF_PERCENT,
    LONGEST_PATH_M,
    MAX_WAYPOINTS,
    MIN_WAYPOINTS,
    STAY_ACTION,
    SdkControl,
)
from volery.simulation.autopilots.flight_stack.flight import Flight
from volery.simulation.autopilots.manoeuvres.manual_flight import AltitudeHold, Loiter
from volery.simulation.autopilots.manoeuvres.onboard_mission_flight import (
    FlyMission,
    MissionRules,
    copter_leg,
)
from volery.simulation.autopilots.manoeuvres.to_point import ClimbStraight, DescendAndLand, ReturnAndLand
from volery.simulation.autopilots.vehicle_state import (
    ArmingTimes,
    AutopilotVehicle,
    FlightManoeuvre,
    Mode,
    ParameterTable,
    RcDefaults,
    StartupTimes,
    VehicleRules,
)

READY, ORIGIN, POSITION = 3 * S, 15 * S, 25 * S
"""Uptimes at which the node publishes, the position is known, and the position is trusted. Assumed."""

NO_BITS = 0
"""There is no heartbeat."""


def _take_off(vehicle: AutopilotVehicle) -> FlightManoeuvre:
    return ClimbStraight(vehicle, vehicle.parameters["TAKEOFF_HEIGHT"])


class SdkLanding(DescendAndLand):
    """Descent to the ground; with LAND_WAITS it waits low above it until a program confirms."""

    def sink(self) -> float:
        """Return the descent rate at the present height [m/s]."""
        vehicle = self.vehicle
        waits = vehicle.parameters["LAND_WAITS"] > 0.0 and not controller_of(vehicle).landing_confirmed
        return 0.0 if waits and vehicle.height < CONFIRM_BELOW_M else super().sink()


MISSION_RULES = MissionRules(
    first_item=0,
    item_begins=lambda vehicle, number, item: controller_of(vehicle).item_begins(number, item),
    ended=lambda vehicle: controller_of(vehicle).mission_ended(),
)


def _mission(vehicle: AutopilotVehicle) -> FlightManoeuvre:
    return FlyMission(vehicle, copter_leg, MISSION_RULES)


MODES = {
    mode.number: mode
    for mode in (
        Mode(DisplayMode.ATTITUDE, "ATTITUDE", NO_BITS, AltitudeHold, pilot=True),
        Mode(DisplayMode.P_GPS, "P_GPS", NO_BITS, Loiter, pilot=True),
        Mode(DisplayMode.AUTO_TAKEOFF, "AUTO_TAKEOFF", NO_BITS, _take_off),
        Mode(DisplayMode.AUTO_LANDING, "AUTO_LANDING", NO_BITS, SdkLanding),
        Mode(DisplayMode.NAVI_MISSION, "NAVI_MISSION", NO_BITS, _mission, needs_position=True),
        Mode(DisplayMode.NAVI_GO_HOME, "NAVI_GO_HOME", NO_BITS, ReturnAndLand, needs_position=True),
        Mode(DisplayMode.NAVI_SDK_CTRL, "NAVI_SDK_CTRL", NO_BITS, SdkControl),
        Mode(DisplayMode.FORCE_AUTO_LANDING, "FORCE_AUTO_LANDING", NO_BITS, DescendAndLand),
    )
}


def finish_boot(vehicle: AutopilotVehicle) -> None:
    """Put the aircraft on the ground in P_GPS."""
    vehicle.ground.landed = True
    controller_of(vehicle).reset()
    vehicle.enter_mode(MODES[DisplayMode.P_GPS])


def _below(percent: str) -> WatchedCondition:
    begins = {
        "LOW_BATTERY": FlightController.low_battery,
        "CRITICAL_BATTERY": FlightController.critical_battery,
    }[percent]
    return WatchedCondition(
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
    "two programs": "both have the authority at once",
    "transmitter": f"channel {SWITCH} is the mode switch: F above {F_ABOVE}, P below {P_BELOW}, A between; "
    "it begins where the authority is granted; `rc` keeps its values while the transmitter is off",
    "start of the motors": f"ENGINE_START for {to_seconds(ENGINE_START_TIME):g} s; sets the home position",
    "an M100": f"shows FINISHED_LANDING for {to_seconds(FINISHED_LANDING_TIME):g} s",
    "silence of the program": "brakes and hovers in P_GPS",
    "set-points on the ground": f"take off above {LIFT_OFF_M:g} m, {LIFT_OFF_M_S:g} m/s or "
    f"{LIFT_OFF_PERCENT:g} % of thrust",
    "set-points not flown": "angular rates, and thrust with anything but angles",
    "set-points and going home": "do not end it, also if a program has asked for it",
    "without satellites": "P_GPS becomes ATTITUDE",
    "speed towards a position": "the law that was seen of an M600 holds for all",
    "landing": f"slow below {SLOW_BELOW:g} m above home",
    "downward range of an M210": f"latches beyond {RANGE_M:g} m",
    "`ack_data`": f"{NO_CODE} where a request is refused and no code is known",
    "altitude for going home": f"from {GO_HOME_ALTITUDES.lowest:g} to {GO_HOME_ALTITUDES.highest:g} m",
    "battery": "measured without error",
}
"""Subject and assumption, as in docs/dji.md."""

DOCUMENTED: Mapping[str, DocumentedBehaviour] = {
    "authority": DocumentedBehaviour(
        "A3 and N3 at P, M100 at F, M210 at P or F, M600 at each position", GUIDES
    ),
    "mode switch": DocumentedBehaviour(
        "any move takes the authority; `rc` shows it on its fifth axis: +1, 0, -1 for P, A, F of an A3 or "
        "N3, which have 12 axes; -8000, 0, 8000 of an M100; up to 10000 of others",
        f"{GUIDES}; node 3.8",
    ),
    "`gps_position`": DocumentedBehaviour(
        "altitude by pressure, tens of metres off; without satellites the place stays, messages go on, the "
        "status is always a fix",
        f"{HEADERS}; users (Onboard-SDK #216, #258, #488; ROS #132)",
    ),
    "`gps_health`": DocumentedBehaviour(
        "0 until the home point is set, then the signal level", f"{HEADERS}; node 3.8"
    ),
    "`height_above_takeoff`": DocumentedBehaviour(
        "0 on an A3, N3 and M600; the distance to the ground on an M210, which latches; a height on an M100",
        f"{HEADERS}; users (Onboard-SDK #160, #218; ROS #161, #461)",
    ),
    "task 4": DocumentedBehaviour(
        "climbs to about 1.2 m, only while the motors stand; an M100 whose motors turn accepts and stays",
        f"{GUIDES}; support (ROS #15)",
    ),
    "motors": DocumentedBehaviour(
        "a program stops them on the ground only; 4.1 has a kill switch", f"{GUIDES}; node 4.1"
    ),
    "set-points and landing": DocumentedBehaviour("do not end it", "support (ROS #44)"),
    "set-points and position": DocumentedBehaviour(
        "need GPS, without which only height and heading act; half the offset is flown each second, "
        "at 3 m/s at most",
        f"{HEADERS}; support (Onboard-SDK #459, of an M600)",
    ),
    "going home": DocumentedBehaviour(
        "near home it lands on the spot: within 20 m", "support (ROS #469, of an M210)"
    ),
    "landing of an M600": DocumentedBehaviour(
        f"{M600_LAND_FAST:g} m/s, and {M600_LAND_SLOW:g} m/s from {M600_SLOW_BELOW:g} m above the take-off "
        "point on",
        "support (Onboard-SDK #163)",
    ),
    "landing that waits": DocumentedBehaviour(
        f"at about {CONFIRM_BELOW_M:g} m where the ground looks unsuitable; 3.8 has no task to confirm",
        "manuals; node 4.1",
    ),
    "loss of the transmitter": DocumentedBehaviour(
        f"after {to_seconds(RC_LOST_AFTER):g} s it goes home, or hovers if Assistant 2 is set so", GUIDES
    ),
    "no transmitter since power-on": DocumentedBehaviour(
        f"stays within {NO_RC_RADIUS_M:g} m and {NO_RC_HEIGHT_M:g} m: missions beyond are refused; "
        "set-points stop there",
        "support (Onboard-SDK #359; ROS #169)",
    ),
    "no-fly zone": DocumentedBehaviour(
        "no start inside; it hovers at the border; a mission across is refused", "support (ROS #471); headers"
    ),
    "low battery": DocumentedBehaviour(
        "goes home after 10 s; critical: lands at once; both override the program", GUIDES
    ),
    "missions": DocumentedBehaviour(
        f"{MIN_WAYPOINTS} to {MAX_WAYPOINTS} waypoints, {LONGEST_PATH_M / 1000:g} km; action {STAY_ACTION} "
        "stays for milliseconds; the upload takes 1 s and 1 s for each waypoint. An M300 takes those of a "
        "second kind only (`waypointV2_…`), in radians, without a stay",
        f"{GUIDES}; nodes 3.8 and 4.1",
    ),
    "vehicle node of 4.1": DocumentedBehaviour(
        "one request at a time: take-off and landing answer when finished; a refusal is a failed call",
        "node 4.1",
    ),
    "topics": DocumentedBehaviour(
        "`imu` at 400 Hz, of an M100 at 100 Hz; an M100 has no `display_mode`, `angular_velocity_fused` and "
        "`acceleration_ground_fused`, an M600 no `rc_connection_status`",
        "node 3.8; users (ROS #325)",
    ),
}
"""Subject, behaviour and source, as in docs/dji.md."""
