"""Commands: MAVLink's numbers as operations of a drone."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from math import isfinite
from typing import Any, NamedTuple

from volery.base.errors import CapabilityError, Refused, UsageError, choices
from volery.base.position import AMSL
from volery.bridge.interpreter.aims import ALTITUDES, Place, on_globe
from volery.bridge.interpreter.conduct import Order
from volery.bridge.interpreter.telling import CUSTOM_MODE_ENABLED
from volery.bridge.modes import DJI_ID, PAPARAZZI_ID, Firmware, mode_name
from volery.links.mavlink import constant, entry_name
from volery.vehicles.drone import Drone

Fields = dict[str, Any]

RELATIVE_ALT = constant("MAV_FRAME_GLOBAL_RELATIVE_ALT")
FORCE = 21_196
"""Second parameter of a disarming: in the air, too."""
READY_WITHIN_S = 2.0
"""So long a take-off waits for an aircraft that is not ready, instead of the drone's own two minutes: whoever
asked is waiting for the answer.
"""

Operation = Callable[[Drone], None]

MODES: Mapping[int, Mapping[str, Operation]] = {
    PAPARAZZI_ID: {
        "GUIDED": Drone.hold,
        "ATTITUDE_DIRECT": Drone.stabilize,
        "ATTITUDE_RC_CLIMB": Drone.altitude_hold,
    },
    DJI_ID: {
        "P_GPS": Drone.hold,
        "ATTITUDE": Drone.altitude_hold,
        "MANUAL_CTRL": Drone.stabilize,
        "AUTO_LANDING": Drone.land,
        "NAVI_GO_HOME": Drone.return_home,
        "NAVI_MISSION": Drone.start_mission,
    },
}
"""What leads to a mode that may be asked for, by MAV_AUTOPILOT. A DJI that a program flies by sticks shows
NAVI_SDK_CTRL.
"""
BY_HAND = (Drone.stabilize, Drone.altitude_hold)


class Command(NamedTuple):
    """COMMAND_LONG or COMMAND_INT. ``x`` and ``y`` are 1e-7 degrees, ``z`` metres in ``frame``."""

    number: int
    parameters: tuple[float, float, float, float]
    x: int
    y: int
    z: float
    frame: int


def from_long(fields: Fields) -> Command:
    """COMMAND_LONG: its altitudes are above home."""
    x, y = (round(one * 1e7) if isfinite(one) else 0 for one in (fields["param5"], fields["param6"]))
    return Command(fields["command"], _first_four(fields), x, y, fields["param7"], RELATIVE_ALT)


def from_int(fields: Fields) -> Command:
    """COMMAND_INT."""
    return Command(
        fields["command"], _first_four(fields), fields["x"], fields["y"], fields["z"], fields["frame"]
    )


def _first_four(fields: Fields) -> tuple[float, float, float, float]:
    return fields["param1"], fields["param2"], fields["param3"], fields["param4"]


def whole(value: float) -> int:
    """The nearest integer. Raises ``UsageError`` for what is no number."""
    if not isfinite(value):
        raise UsageError(f"{value} where a number belongs")
    return round(value)


class Orders:
    """Makes orders for *drone*."""

    def __init__(self, drone: Drone) -> None:
        self._drone = drone
        self._known: Mapping[int, Callable[[Command], Order]] = {
            constant("MAV_CMD_COMPONENT_ARM_DISARM"): self._arm,
            constant("MAV_CMD_NAV_TAKEOFF"): self._take_off,
            constant("MAV_CMD_NAV_LAND"): lambda command: Order("land", self._drone.land),
            constant("MAV_CMD_NAV_RETURN_TO_LAUNCH"): lambda command: Order(
                "return home", self._drone.return_home
            ),
            constant("MAV_CMD_MISSION_START"): lambda command: Order(
                "start the mission", self._drone.start_mission
            ),
            constant("MAV_CMD_DO_REPOSITION"): self._reposition,
            constant("MAV_CMD_CONDITION_YAW"): self._turn,
        }

    def of(self, command: Command) -> Order:
        """Raises ``CapabilityError`` for a command that is not interpreted, ``UsageError`` for one that makes
        no sense.
        """
        make = self._known.get(command.number)
        if make is None:
            name = entry_name("MAV_CMD", command.number)
            known = choices(entry_name("MAV_CMD", number) for number in self._known)
            raise CapabilityError(f"{self._drone.name}: no command {name} here; there is {known}")
        return make(command)

    def _arm(self, command: Command) -> Order:
        drone, (value, force, *_) = self._drone, command.parameters
        if value == 1.0:
            return Order("arm", drone.arm, answered_when_done=True, waits=True)
        if value != 0.0:
            raise UsageError(f"{drone.name}: arm or disarm: {value:g}; 1 arms, 0 disarms")
        if force == FORCE:
            return Order("stop the motors", partial(drone.kill, sure=True), answered_when_done=True)
        return Order("disarm", drone.disarm, answered_when_done=True)

    def _take_off(self, command: Command) -> Order:
        height = self._above_home(command)

        def body() -> None:
            self._drone.wait_ready(READY_WITHIN_S)
            self._drone.takeoff(height)

        return Order(f"take off to {height:g} m", body)

    def _above_home(self, command: Command) -> float:
        if ALTITUDES.get(command.frame) is AMSL:
            return command.z - self._drone.home.altitude.metres
        return command.z

    def _reposition(self, command: Command) -> Order:
        speed, _, _, heading = command.parameters
        goal = on_globe(command.frame, command.x, command.y, command.z)
        place = Place(goal, heading if isfinite(heading) else None, speed if speed > 0.0 else None)
        return Order(f"go to {goal}", lambda: place.fly(self._drone))

    def _turn(self, command: Command) -> Order:
        degrees, _, way, relative = command.parameters
        if relative:
            degrees = self._drone.attitude.heading + (degrees if way >= 0.0 else -degrees)
        return Order(f"turn to {degrees % 360.0:g} degrees", lambda: self._drone.set_heading(degrees))

    def mode(self, firmware: Firmware, base: int, number: int) -> Order:
        """What leads to a mode. Raises ``CapabilityError`` if nothing does."""
        known = MODES.get(firmware.autopilot, {})
        name = mode_name(firmware, number)
        operation = known.get(name) if base & CUSTOM_MODE_ENABLED else None
        if operation is None:
            asked = name if base & CUSTOM_MODE_ENABLED else f"of base mode {base}"
            raise CapabilityError(
                f"{self._drone.name}: no mode {asked} to be asked for; there is {choices(known)}"
            )
        asked = f"change to {name}"
        if operation is Drone.hold:
            return Order(asked, partial(self._hold, asked, name))
        return Order(asked, partial(operation, self._drone), by_hand=operation in BY_HAND)

    def _hold(self, asked: str, mode: str) -> None:
        if not self._drone.flying and self._drone.mode != mode:
            raise Refused(self._drone.name, asked, "it is on the ground; taking off leads there by itself")
        self._drone.hold()
