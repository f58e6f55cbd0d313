"""ArduPilot's failsafes for ground station, radio, battery and estimator.

Parameters set triggers and actions.
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
"""Enters a mode if that is possible, and returns whether it was."""

CONTINUE_MISSION_ON_RADIO, CONTINUE_MISSION_ON_STATION = 1 << 0, 1 << 1
CONTINUE_GUIDED_ON_RADIO, CONTINUE_LANDING, CONTINUE_PILOT_ON_STATION = 1 << 2, 1 << 3, 1 << 4
"""Bits of FS_OPTIONS."""


def station_lost(vehicle: Vehicle) -> bool:
    """Return whether a ground station that was received is silent for longer than FS_GCS_TIMEOUT."""
    if vehicle.parameters["FS_GCS_ENABLE"] == 0.0 or vehicle.failsafes.station_last_ns == NEVER:
        return False
    silence = vehicle.kernel.now() - vehicle.failsafes.station_last_ns
    return silence > from_seconds(vehicle.parameters["FS_GCS_TIMEOUT"])


def radio_lost(vehicle: Vehicle) -> bool:
    """Return whether the throttle channel is below FS_THR_VALUE."""
    if vehicle.parameters["FS_THR_ENABLE"] == 0.0:
        return False
    return vehicle.rc[vehicle.tuning.sticks.throttle] < vehicle.parameters["FS_THR_VALUE"]


def _battery_below(vehicle: Vehicle, volts: str, charge: str) -> bool:
    parameters, estimate = vehicle.parameters, vehicle.estimate
    if vehicle.uptime() < 3 * S:
        return False
    left = parameters["BATT_CAPACITY"] - estimate.battery_used_mah
    sagged = parameters[volts] > 0.0 and estimate.battery_volts < parameters[volts]
    if not sagged:
        vehicle.failsafes.low_voltage_since.pop(volts, None)
        return parameters[charge] > 0.0 and left < parameters[charge]
    since = vehicle.failsafes.low_voltage_since.setdefault(volts, vehicle.kernel.now())
    return vehicle.kernel.now() - since >= from_seconds(parameters["BATT_LOW_TIMER"])


def battery_low(vehicle: Vehicle) -> bool:
    """Return whether BATT_LOW_VOLT or BATT_LOW_MAH was crossed; the state does not clear."""
    return "battery low" in vehicle.failsafes.active or _battery_below(
        vehicle, "BATT_LOW_VOLT", "BATT_LOW_MAH"
    )


def battery_critical(vehicle: Vehicle) -> bool:
    """Return whether BATT_CRT_VOLT or BATT_CRT_MAH was crossed; the state does not clear."""
    return "battery critical" in vehicle.failsafes.active or _battery_below(
        vehicle, "BATT_CRT_VOLT", "BATT_CRT_MAH"
    )


def estimator_lost(vehicle: Vehicle) -> bool:
    """Return whether an armed vehicle in flight lost the position that its mode needs."""
    if vehicle.parameters["FS_EKF_THRESH"] <= 0.0 or not vehicle.armed or vehicle.landed:
        return False
    lost = not vehicle.estimate.position_ok
    return lost and (vehicle.mode.needs_position or "estimator" in vehicle.failsafes.active)


class CopterFailsafes:
    """Failsafe actions of a copter. ``switch`` changes its mode."""

    RTL, LAND, BRAKE, AUTO, ALT_HOLD = 6, 9, 17, 3, 2
    RESPONSES: Mapping[int, tuple[int, ...]] = {
        1: (RTL, LAND),
        3: (RTL, LAND),
        4: (LAND,),
        5: (LAND,),
        6: (RTL, LAND),
        7: (BRAKE, LAND),
    }
    """FS_GCS_ENABLE to the modes that are tried in order. SmartRTL is represented by its fallback."""
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
        """Return the failsafes in the order in which they are checked."""
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
        vehicle.send_text(WARNING, f"{what} Failsafe Cleared")

    def on_station_lost(self, vehicle: Vehicle) -> None:
        """React to a lost ground station as FS_GCS_ENABLE and FS_OPTIONS demand."""
        vehicle.rc.release()
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
        """React to a lost transmitter as FS_THR_ENABLE and FS_OPTIONS demand."""
        options = round(vehicle.parameters["FS_OPTIONS"])
        keeps = ""
        if options & CONTINUE_MISSION_ON_RADIO and vehicle.mode.name == "AUTO":
            keeps = "Continuing Auto"
        elif options & CONTINUE_GUIDED_ON_RADIO and vehicle.mode.name == "GUIDED":
            keeps = "Continuing Guided Mode"
        self._respond(vehicle, "Radio", self.RADIO.get(round(vehicle.parameters["FS_THR_ENABLE"]), ()), keeps)

    def on_battery(self, vehicle: Vehicle, level: str) -> None:
        """Report a low or critical battery and execute BATT_FS_LOW_ACT or BATT_FS_CRT_ACT."""
        estimate = vehicle.estimate
        used = estimate.battery_used_mah
        vehicle.send_text(WARNING, f"Battery 1 is {level} {estimate.battery_volts:.2f}V used {used:.0f} mAh")
        action = round(vehicle.parameters["BATT_FS_LOW_ACT" if level == "low" else "BATT_FS_CRT_ACT"])
        if action == 5:
            disarm(vehicle, self._disarmed, force=True)
        elif action:
            self._respond(vehicle, "Battery", self.BATTERY.get(action, ()), "")

    def _respond(self, vehicle: Vehicle, what: str, modes: tuple[int, ...], keeps: str) -> None:
        if not vehicle.armed:
            vehicle.send_text(WARNING, f"{what} Failsafe")
        elif self._on_ground(vehicle):
            vehicle.send_text(WARNING, f"{what} Failsafe - Disarming")
            disarm(vehicle, self._disarmed, force=True)
        elif vehicle.manoeuvre.landing and round(vehicle.parameters["FS_OPTIONS"]) & CONTINUE_LANDING:
            vehicle.send_text(WARNING, f"{what} Failsafe - Continuing Landing")
        elif keeps:
            vehicle.send_text(WARNING, f"{what} Failsafe - {keeps}")
        else:
            for mode in modes:
                if self._switch(vehicle, mode):
                    break
            vehicle.send_text(WARNING, f"{what} Failsafe")

    def _on_ground(self, vehicle: Vehicle) -> bool:
        """Return whether the vehicle may simply disarm: on the ground, and no started mission."""
        manoeuvre = vehicle.manoeuvre
        return vehicle.landed and not (isinstance(manoeuvre, FlyMission) and manoeuvre.started)

    def on_estimator_lost(self, vehicle: Vehicle) -> None:
        """React to a lost position: LAND or ALT_HOLD, as FS_EKF_ACTION demands."""
        vehicle.send_text(CRITICAL, "EKF variance")
        action = round(vehicle.parameters["FS_EKF_ACTION"])
        mode = {1: self.LAND, 2: self.ALT_HOLD, 3: self.LAND}.get(action)
        if mode is not None and self._switch(vehicle, mode):
            vehicle.send_text(CRITICAL, f"EKF Failsafe: changed to {vehicle.mode.name} Mode")

    def on_estimator_back(self, vehicle: Vehicle) -> None:
        """Report the position; the mode stays."""
        vehicle.send_text(CRITICAL, "EKF Failsafe Cleared")


class RoverFailsafes:
    """Failsafe actions of a rover: FS_ACTION for ground station and radio."""

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
        """Return the failsafes in the order in which they are checked."""
        return (
            Failsafe("station", station_lost, lambda v: self._begin(v, "GCS"), lambda v: self._end(v, "GCS")),
            Failsafe("radio", radio_lost, lambda v: self._begin(v, "Radio"), lambda v: self._end(v, "Radio")),
            Failsafe("battery low", battery_low, lambda v: self._battery(v, "low")),
            Failsafe("battery critical", battery_critical, lambda v: self._battery(v, "critical")),
        )

    def _begin(self, vehicle: Vehicle, what: str) -> None:
        vehicle.send_text(WARNING, f"{what} Failsafe")
        self._act(vehicle, round(vehicle.parameters["FS_ACTION"]))

    def _end(self, vehicle: Vehicle, what: str) -> None:
        vehicle.send_text(WARNING, f"{what} Failsafe Cleared")

    def _battery(self, vehicle: Vehicle, level: str) -> None:
        estimate = vehicle.estimate
        used = estimate.battery_used_mah
        vehicle.send_text(WARNING, f"Battery 1 is {level} {estimate.battery_volts:.2f}V used {used:.0f} mAh")
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
