"""ArduPilot's failsafes: ground station, radio, battery, estimator.

What trips them and what they do is parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from volery.base.time import S, from_seconds
from volery.simulation.autopilots.ardupilot.modes import CRITICAL, WARNING, disarm
from volery.simulation.autopilots.firmware import Failsafe
from volery.simulation.autopilots.manoeuvres.onboard_mission_flight import FlyMission
from volery.simulation.autopilots.manual_control import NEVER
from volery.simulation.autopilots.vehicle_state import Vehicle

Switch = Callable[[Vehicle, int], bool]
"""Changes the mode if it may; the failsafe's own way, without a station's answer."""

CONTINUE_MISSION_ON_RADIO, CONTINUE_MISSION_ON_STATION = 1 << 0, 1 << 1
CONTINUE_GUIDED_ON_RADIO, CONTINUE_LANDING, CONTINUE_PILOT_ON_STATION = 1 << 2, 1 << 3, 1 << 4
"""Bits of FS_OPTIONS."""


def station_lost(vehicle: Vehicle) -> bool:
    """A ground station was heard once, and has been silent for FS_GCS_TIMEOUT."""
    if vehicle.parameters["FS_GCS_ENABLE"] == 0.0 or vehicle.station_seen == NEVER:
        return False
    silence = vehicle.kernel.now() - vehicle.station_seen
    return silence > from_seconds(vehicle.parameters["FS_GCS_TIMEOUT"])


def radio_lost(vehicle: Vehicle) -> bool:
    """The throttle channel is below FS_THR_VALUE."""
    if vehicle.parameters["FS_THR_ENABLE"] == 0.0:
        return False
    return vehicle.sticks[vehicle.tuning.sticks.throttle] < vehicle.parameters["FS_THR_VALUE"]


def _battery_below(vehicle: Vehicle, volts: str, charge: str) -> bool:
    parameters, estimate = vehicle.parameters, vehicle.estimate
    if vehicle.uptime() < 3 * S:
        return False
    left = parameters["BATT_CAPACITY"] - estimate.battery_used_mah
    sagged = parameters[volts] > 0.0 and estimate.battery_volts < parameters[volts]
    if not sagged:
        vehicle.sagging.pop(volts, None)
        return parameters[charge] > 0.0 and left < parameters[charge]
    since = vehicle.sagging.setdefault(volts, vehicle.kernel.now())
    return vehicle.kernel.now() - since >= from_seconds(parameters["BATT_LOW_TIMER"])


def battery_low(vehicle: Vehicle) -> bool:
    """Below BATT_LOW_VOLT for BATT_LOW_TIMER, or less than BATT_LOW_MAH left; once low, low for good."""
    return "battery low" in vehicle.failsafes or _battery_below(vehicle, "BATT_LOW_VOLT", "BATT_LOW_MAH")


def battery_critical(vehicle: Vehicle) -> bool:
    """Likewise for the critical level."""
    return "battery critical" in vehicle.failsafes or _battery_below(vehicle, "BATT_CRT_VOLT", "BATT_CRT_MAH")


def estimator_lost(vehicle: Vehicle) -> bool:
    """In the air, in a mode that needs a position, without one."""
    if vehicle.parameters["FS_EKF_THRESH"] <= 0.0 or not vehicle.armed or vehicle.landed:
        return False
    lost = not vehicle.estimate.position_ok
    return lost and (vehicle.mode.needs_position or "estimator" in vehicle.failsafes)


class CopterFailsafes:
    """What a copter does. *switch* changes its mode."""

    RTL, LAND, BRAKE, AUTO, ALT_HOLD = 6, 9, 17, 3, 2
    RESPONSES: Mapping[int, tuple[int, ...]] = {
        1: (RTL, LAND),
        3: (RTL, LAND),
        4: (LAND,),
        5: (LAND,),
        6: (RTL, LAND),
        7: (BRAKE, LAND),
    }
    """FS_GCS_ENABLE to the modes that are tried. SmartRTL is not there: what it falls back to is."""
    RADIO: Mapping[int, tuple[int, ...]] = {
        1: (RTL, LAND),
        2: (RTL, LAND),
        3: (LAND,),
        4: (RTL, LAND),
        5: (LAND,),
    }
    BATTERY: Mapping[int, tuple[int, ...]] = {
        1: (LAND,),
        2: (RTL, LAND),
        3: (RTL, LAND),
        4: (LAND,),
        7: (BRAKE, LAND),
    }

    def __init__(self, switch: Switch, disarmed: str) -> None:
        self._switch = switch
        self._disarmed = disarmed

    def watches(self) -> tuple[Failsafe, ...]:
        """In the order in which they are looked at."""
        return (
            Failsafe(
                "station", station_lost, self.on_station_lost, lambda vehicle: self._clear(vehicle, "GCS")
            ),
            Failsafe("radio", radio_lost, self.on_radio_lost, lambda vehicle: self._clear(vehicle, "Radio")),
            Failsafe("battery low", battery_low, lambda vehicle: self.on_battery(vehicle, "low")),
            Failsafe(
                "battery critical",
                battery_critical,
                lambda vehicle: self.on_battery(vehicle, "critical"),
            ),
            Failsafe("estimator", estimator_lost, self.on_estimator_lost, self.on_estimator_back),
        )

    def _clear(self, vehicle: Vehicle, what: str) -> None:
        vehicle.say(WARNING, f"{what} Failsafe Cleared")

    def on_station_lost(self, vehicle: Vehicle) -> None:
        """The ground station is silent."""
        vehicle.sticks.release()
        options = round(vehicle.parameters["FS_OPTIONS"])
        keeps = ""
        if options & CONTINUE_MISSION_ON_STATION and vehicle.mode.name == "AUTO":
            keeps = "Continuing Auto Mode"
        elif options & CONTINUE_PILOT_ON_STATION and vehicle.mode.pilot:
            keeps = "Continuing Pilot Control"
        self._respond(
            vehicle, "GCS", self.RESPONSES.get(round(vehicle.parameters["FS_GCS_ENABLE"]), ()), keeps
        )

    def on_radio_lost(self, vehicle: Vehicle) -> None:
        """The transmitter is gone."""
        options = round(vehicle.parameters["FS_OPTIONS"])
        keeps = ""
        if options & CONTINUE_MISSION_ON_RADIO and vehicle.mode.name == "AUTO":
            keeps = "Continuing Auto"
        elif options & CONTINUE_GUIDED_ON_RADIO and vehicle.mode.name == "GUIDED":
            keeps = "Continuing Guided Mode"
        self._respond(vehicle, "Radio", self.RADIO.get(round(vehicle.parameters["FS_THR_ENABLE"]), ()), keeps)

    def on_battery(self, vehicle: Vehicle, level: str) -> None:
        """The battery is low or critical: it says so, and does what BATT_FS_*_ACT asks for."""
        estimate = vehicle.estimate
        used = estimate.battery_used_mah
        vehicle.say(WARNING, f"Battery 1 is {level} {estimate.battery_volts:.2f}V used {used:.0f} mAh")
        action = round(vehicle.parameters["BATT_FS_LOW_ACT" if level == "low" else "BATT_FS_CRT_ACT"])
        if action == 5:
            disarm(vehicle, self._disarmed, force=True)
        elif action:
            self._respond(vehicle, "Battery", self.BATTERY.get(action, ()), "")

    def _respond(self, vehicle: Vehicle, what: str, modes: tuple[int, ...], keeps: str) -> None:
        if not vehicle.armed:
            vehicle.say(WARNING, f"{what} Failsafe")
        elif self._on_ground(vehicle):
            vehicle.say(WARNING, f"{what} Failsafe - Disarming")
            disarm(vehicle, self._disarmed, force=True)
        elif vehicle.manoeuvre.landing and round(vehicle.parameters["FS_OPTIONS"]) & CONTINUE_LANDING:
            vehicle.say(WARNING, f"{what} Failsafe - Continuing Landing")
        elif keeps:
            vehicle.say(WARNING, f"{what} Failsafe - {keeps}")
        else:
            for mode in modes:
                if self._switch(vehicle, mode):
                    break
            vehicle.say(WARNING, f"{what} Failsafe")

    def _on_ground(self, vehicle: Vehicle) -> bool:
        """Whether it may simply disarm: standing, and no mission waits to start."""
        manoeuvre = vehicle.manoeuvre
        return vehicle.landed and not (isinstance(manoeuvre, FlyMission) and manoeuvre.started)

    def on_estimator_lost(self, vehicle: Vehicle) -> None:
        """No position any more: land level, or hold the height by hand."""
        vehicle.say(CRITICAL, "EKF variance")
        action = round(vehicle.parameters["FS_EKF_ACTION"])
        mode = {1: self.LAND, 2: self.ALT_HOLD, 3: self.LAND}.get(action)
        if mode is not None and self._switch(vehicle, mode):
            vehicle.say(CRITICAL, f"EKF Failsafe: changed to {vehicle.mode.name} Mode")

    def on_estimator_back(self, vehicle: Vehicle) -> None:
        """The position is back; the mode stays."""
        vehicle.say(CRITICAL, "EKF Failsafe Cleared")


class RoverFailsafes:
    """What a rover does: FS_ACTION for station and radio."""

    HOLD, RTL = 4, 11
    ACTIONS: Mapping[int, tuple[int, ...]] = {
        1: (RTL, HOLD),
        2: (HOLD,),
        3: (RTL, HOLD),
        4: (HOLD,),
        6: (HOLD,),
    }

    def __init__(self, switch: Switch, disarmed: str) -> None:
        self._switch = switch
        self._disarmed = disarmed

    def watches(self) -> tuple[Failsafe, ...]:
        """In the order in which they are looked at."""
        return (
            Failsafe("station", station_lost, lambda v: self._begin(v, "GCS"), lambda v: self._end(v, "GCS")),
            Failsafe("radio", radio_lost, lambda v: self._begin(v, "Radio"), lambda v: self._end(v, "Radio")),
            Failsafe("battery low", battery_low, lambda v: self._battery(v, "low")),
            Failsafe("battery critical", battery_critical, lambda v: self._battery(v, "critical")),
        )

    def _begin(self, vehicle: Vehicle, what: str) -> None:
        vehicle.say(WARNING, f"{what} Failsafe")
        self._act(vehicle, round(vehicle.parameters["FS_ACTION"]))

    def _end(self, vehicle: Vehicle, what: str) -> None:
        vehicle.say(WARNING, f"{what} Failsafe Cleared")

    def _battery(self, vehicle: Vehicle, level: str) -> None:
        estimate = vehicle.estimate
        used = estimate.battery_used_mah
        vehicle.say(WARNING, f"Battery 1 is {level} {estimate.battery_volts:.2f}V used {used:.0f} mAh")
        self._act(
            vehicle, round(vehicle.parameters["BATT_FS_LOW_ACT" if level == "low" else "BATT_FS_CRT_ACT"])
        )

    def _act(self, vehicle: Vehicle, action: int) -> None:
        if not vehicle.armed:
            return
        if action == 5:
            disarm(vehicle, self._disarmed, force=True)
            return
        for mode in self.ACTIONS.get(action, ()):
            if self._switch(vehicle, mode):
                return
