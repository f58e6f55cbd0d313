"""What the modes of the rotorcraft fly, but for GUIDED."""

from __future__ import annotations

from volery.base.frames import Vector, enu_to_ned
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.simulation.autopilots.manoeuvres.manual_flight import AltitudeHold, ByPilot, Stabilize
from volery.simulation.autopilots.paparazzi.memory import of
from volery.simulation.autopilots.paparazzi.navigation import Demand, Vertical
from volery.simulation.autopilots.vehicle_state import Manoeuvre, Vehicle

LIFTS_M = 0.3
"""Standing on the ground it lifts off for a height that far above."""


class Killed(Manoeuvre):
    """Motors off: nothing to fly."""

    def step(self) -> None:
        """Motors cannot be on in this mode."""
        self.idle()


class Sink(Manoeuvre):
    """FAILSAFE: level, down at FAILSAFE_DESCENT_SPEED, wherever the wind carries it."""

    landing = True

    def step(self) -> None:
        """Sink."""
        speed = self.vehicle.parameters["FAILSAFE_DESCENT_SPEED"]
        tuning = self.vehicle.tuning
        self.drive(Setpoint(Control.CLIMB, climb=-speed, speed_down=max(0.1, speed), accel_z=tuning.accel_z))


class FlyPlan(Manoeuvre):
    """NAV: whatever the flight plan demands."""

    def enter(self) -> None:
        """Keep the heading that it has."""
        of(self.vehicle).navigation.heading = self.vehicle.estimate.attitude[2]

    @property
    def demand(self) -> Demand:
        """What is to be flown now."""
        return of(self.vehicle).navigation.demand

    def wants_to_fly(self) -> bool:
        """When it is to climb, or to be above where it stands."""
        demand = self.demand
        if demand.vertical is Vertical.CLIMB:
            return demand.climb > 0.0
        here = of(self.vehicle).navigation.position
        return demand.vertical is Vertical.ALTITUDE and demand.target[2] > here[2] + LIFTS_M

    def step(self) -> None:
        """Drive there."""
        demand, tuning = self.demand, self.vehicle.tuning
        self.landing = demand.vertical is Vertical.CLIMB and demand.climb < 0.0
        self.target = None if demand.vertical is Vertical.THROTTLE else enu_to_ned(demand.goal)
        if demand.vertical is Vertical.THROTTLE:
            self.idle()
            return
        climbs = demand.vertical is Vertical.CLIMB
        self.drive(
            Setpoint(
                Control.POSITION_CLIMB if climbs else Control.POSITION,
                position=enu_to_ned(demand.target),
                climb=demand.climb,
                yaw=of(self.vehicle).navigation.heading,
                speed=tuning.speed,
                speed_up=tuning.speed_up,
                speed_down=tuning.speed_down,
                accel=tuning.accel,
                accel_z=tuning.accel_z,
                tilt=tuning.tilt,
            )
        )


class FlyHome(FlyPlan):
    """HOME: to the waypoint HOME at its height, and stay there."""

    def enter(self) -> None:
        """Straight there."""
        super().enter()
        of(self.vehicle).navigation.fly_home()


class Direct(Stabilize):
    """ATTITUDE_DIRECT: sticks are lean angles, turn rate and thrust, in proportion."""

    def thrust(self, throttle: float) -> float:
        """As the stick says."""
        return throttle


class HoldHeight(AltitudeHold):
    """ATTITUDE_Z_HOLD: sticks are lean angles and turn rate; the height at which it began is held."""

    def climb(self, throttle: float) -> float:
        """The throttle stick commands no climb."""
        return 0.0


class HoldPlace(ByPilot):
    """HOVER_Z_HOLD: it stays where it began; the sticks turn it only."""

    def __init__(self, vehicle: Vehicle) -> None:
        super().__init__(vehicle)
        self._place: Vector = (0.0, 0.0, 0.0)

    def enter(self) -> None:
        """Stay here."""
        self._place = self.vehicle.estimate.position

    def step(self) -> None:
        """Stay."""
        tuning = self.vehicle.tuning
        self.drive(
            Setpoint(
                Control.POSITION,
                position=self._place,
                yaw_rate=self.pilot.yaw * tuning.pilot_yaw_rate,
                speed=tuning.speed,
                accel=tuning.accel,
                accel_z=tuning.accel_z,
                tilt=tuning.tilt,
            )
        )
