"""A DJI multirotor: its modes and its habits, put together as a dialect."""

from __future__ import annotations

from volery.base.time import MS, S
from volery.ros.messages.dji_constants import DisplayMode
from volery.simulation.autopilots.dji.controller import Controller, controller_of
from volery.simulation.autopilots.dji.face import DjiFace
from volery.simulation.autopilots.dji.parameters import HONOURED, parameters, tuning
from volery.simulation.autopilots.dji.setpoints import Obey
from volery.simulation.autopilots.firmware import BootEvent, Failsafe, Firmware
from volery.simulation.autopilots.flight_stack.flight import Flight
from volery.simulation.autopilots.manoeuvres.manual_flight import AltitudeHold, Loiter
from volery.simulation.autopilots.manoeuvres.onboard_mission_flight import FlyMission, copter_leg
from volery.simulation.autopilots.manoeuvres.to_point import Land, Return, TakeOff
from volery.simulation.autopilots.vehicle_state import Manoeuvre, Mode, Vehicle

READY, ORIGIN, POSITION = 3 * S, 15 * S, 25 * S
"""After it was switched on: when it speaks, when it knows where it is, when that may be trusted. Assumed."""

NO_BITS = 0
"""There is no heartbeat whose bits a mode could set."""


def _take_off(vehicle: Vehicle) -> Manoeuvre:
    return TakeOff(vehicle, vehicle.parameters["TAKEOFF_HEIGHT"])


def _mission(vehicle: Vehicle) -> Manoeuvre:
    return FlyMission(vehicle, copter_leg)


MODES = {
    mode.number: mode
    for mode in (
        Mode(DisplayMode.ATTITUDE, "ATTITUDE", NO_BITS, AltitudeHold, pilot=True),
        Mode(DisplayMode.P_GPS, "P_GPS", NO_BITS, Loiter, pilot=True),
        Mode(DisplayMode.AUTO_TAKEOFF, "AUTO_TAKEOFF", NO_BITS, _take_off),
        Mode(DisplayMode.AUTO_LANDING, "AUTO_LANDING", NO_BITS, Land),
        Mode(DisplayMode.NAVI_MISSION, "NAVI_MISSION", NO_BITS, _mission, needs_position=True),
        Mode(DisplayMode.NAVI_GO_HOME, "NAVI_GO_HOME", NO_BITS, Return, needs_position=True),
        Mode(DisplayMode.NAVI_SDK_CTRL, "NAVI_SDK_CTRL", NO_BITS, Obey),
        Mode(DisplayMode.FORCE_AUTO_LANDING, "FORCE_AUTO_LANDING", NO_BITS, Land),
    )
}


def ready(vehicle: Vehicle) -> None:
    """It stands, and speaks from now on."""
    vehicle.landed = True
    controller_of(vehicle).reset()
    vehicle.enter(MODES[DisplayMode.P_GPS])


def _nothing(_vehicle: Vehicle) -> None:
    """Nothing is done then."""


def _below(percent: str) -> Failsafe:
    begins = {"LOW_BATTERY": Controller.low_battery, "CRITICAL_BATTERY": Controller.critical_battery}[percent]
    return Failsafe(
        percent.lower().replace("_", " "),
        lambda vehicle: vehicle.estimate.battery_left * 100.0 < vehicle.parameters[percent],
        lambda vehicle: begins(controller_of(vehicle)),
        _nothing,
    )


def own_parameters(_system: int, _flight: Flight) -> dict[str, float]:
    """None follow from the vehicle."""
    return {}


COPTER = Firmware(
    name="dji",
    kind="multirotor",
    face=DjiFace,
    memory=Controller,
    boot_mode=MODES[DisplayMode.P_GPS],
    boot_events=(BootEvent(READY, ready), BootEvent(ORIGIN, lambda vehicle: vehicle.flight.set_origin())),
    ready_after=READY,
    origin_after=ORIGIN,
    position_after=POSITION,
    local_position_after=POSITION,
    on_warm=ready,
    on_warm_position=_nothing,
    each_second=_nothing,
    modes=MODES,
    tuning=tuning,
    transmitter=(1500, 1500, 1500, 1500, 2000, 1000, 1000, 1000, 0, 0, 0, 0, 0, 0, 0, 0),
    stands=True,
    motors_rest=S,
    spool_time=S,
    takeoff_slew=100 * MS,
    resigns_after=1500 * MS,
    watches=(_below("LOW_BATTERY"), _below("CRITICAL_BATTERY")),
    on_step=lambda vehicle: controller_of(vehicle).step(),
    on_disarmed=_nothing,
    throttle_centred=True,
    first_item=0,
    mission_item_begins=lambda vehicle, number, item: controller_of(vehicle).item_begins(number, item),
    mission_ended=lambda vehicle: controller_of(vehicle).mission_ended(),
    parameters=parameters,
    own_parameters=own_parameters,
    supported_parameters=HONOURED,
)
