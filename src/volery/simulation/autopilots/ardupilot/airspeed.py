"""ArduPilot's airspeed sensor: a pitot tube and a thermometer, which are reported and not flown by.

Source: AP_Airspeed, GCS_Common (VFR_HUD, SYS_STATUS) and the sensors of ArduPilot's own simulator, which
measure without error here; its analogue sensor has no temperature.
"""

from __future__ import annotations

from volery.simulation.autopilots.ardupilot.feature import Feature
from volery.simulation.autopilots.mavlink.messages import Fields
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

ANALOGUE = 2
"""ARSPD_TYPE without a thermometer."""
SENSOR = 1 << 4
"""MAV_SYS_STATUS_SENSOR of the differential pressure."""
SEA_LEVEL_CELSIUS, LAPSE = 15.0, 0.0065
"""ISO 2533: temperature at sea level and its fall with the height [degC/m]."""
SELF_HEATING = 25.0
"""Temperature of the sensor above that of the air in ArduPilot's simulator [degC] (SIM_Airspeed_DLVR)."""


def is_there(vehicle: AutopilotVehicle) -> bool:
    """Return whether the vehicle has an airspeed sensor."""
    return vehicle.parameters["ARSPD_ENABLE"] != 0.0 and vehicle.parameters["ARSPD_TYPE"] > 0.0


def speed(vehicle: AutopilotVehicle) -> float | None:
    """Return the airspeed [m/s], never negative; ``None`` without a sensor."""
    return max(0.0, vehicle.flight.air_from_ahead()) if is_there(vehicle) else None


def temperature(vehicle: AutopilotVehicle) -> float | None:
    """Return the temperature at the sensor [degC]; ``None`` where none is measured."""
    if not is_there(vehicle) or vehicle.parameters["ARSPD_TYPE"] == ANALOGUE:
        return None
    return SEA_LEVEL_CELSIUS - LAPSE * vehicle.estimate.geodetic[2] + SELF_HEATING


def _amend_hud(vehicle: AutopilotVehicle, hud: Fields) -> Fields:
    """Return VFR_HUD with the measured airspeed."""
    measured = speed(vehicle)
    return hud if measured is None else {**hud, "airspeed": measured}


def _amend_status(vehicle: AutopilotVehicle, status: Fields) -> Fields:
    """Return SYS_STATUS with the sensor, if there is one; it is never enabled."""
    if not is_there(vehicle):
        return status
    names = ("onboard_control_sensors_present", "onboard_control_sensors_health")
    return {**status, **{name: status[name] | SENSOR for name in names}}


def _amend_high_latency(vehicle: AutopilotVehicle, report: Fields) -> Fields:
    """Return HIGH_LATENCY2 with the temperature."""
    celsius = temperature(vehicle)
    return report if celsius is None else {**report, "temperature_air": int(celsius)}


COPTER = ROVER = Feature(
    parameters={
        "ARSPD_ENABLE": ("", "any value but 0: there may be an airspeed sensor"),
        "ARSPD_TYPE": ("", "any value above 0: there is one, and it is reported; 2: without a thermometer"),
    },
    amends={"VFR_HUD": _amend_hud, "SYS_STATUS": _amend_status, "HIGH_LATENCY2": _amend_high_latency},
)
