"""The node that publishes what the added sensors of a simulated vehicle measure: their drivers on board.

Frames: sensors with a place on the body are below ``base_link`` (``/tf_static``), and odometry moves
``base_link`` in ``odom`` (``/tf``). Where several vehicles share a graph the names of frames begin with
``VEHICLE/``.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from volery.base.frames import Quaternion, Vector, attitude_ned_to_enu, frd_to_flu, world_to_body
from volery.base.time import S
from volery.bridge.motion_publishers import TF, TF_MESSAGE, TF_STATIC, ros_quaternion, transform
from volery.bridge.node_interface import BODY, stamped
from volery.kernel.task import ExecutionContext
from volery.kernel.waiting import sleep
from volery.model.added_sensors import Odometry
from volery.model.environment import Vehicle
from volery.ros.graph import DEFAULT, LATCHED, Node, QoS, RosGraph
from volery.ros.messages import new

if TYPE_CHECKING:
    from volery.simulation.autopilots.flight_stack.flight import Estimate, Flight
    from volery.simulation.world.sensors import SampledSensor

NODE = "sensors"
ODOM = "odom"
_ODOMETRY = "nav_msgs/msg/Odometry"


def frames_of(vehicles: Sequence[Vehicle]) -> dict[str, str]:
    """Return what the frames of each vehicle begin with: its name if several vehicles have such frames."""
    framed = [one.name for one in vehicles if any(not isinstance(each, str) for each in one.added_sensors)]
    return {name: f"{name}/" if len(framed) > 1 else "" for name in framed}


class SensorNode(NamedTuple):
    """The node of one vehicle's sensors.

    Args:
        graph: The graph.
        flight: The vehicle's flight.
        vehicle: The vehicle in the model.
        context: What the drivers' work is charged to: the computer on board.
        prefix: What the names of its frames begin with.
    """

    graph: RosGraph
    flight: Flight
    vehicle: Vehicle
    context: ExecutionContext
    prefix: str = ""

    @property
    def moves_frames(self) -> bool:
        """Whether it publishes where ``base_link`` is."""
        return any(isinstance(one, Odometry) for one in self.vehicle.added_sensors)

    def serve(self) -> None:
        """Publish each sample of the vehicle's added sensors below ``/VEHICLE``, until the end of the run."""
        sensors = self.flight.added_sensors()
        drives = {one.name: partial(self._drive, sensor=one) for one in sensors if one.publications()}
        for one in self.vehicle.added_sensors:
            if isinstance(one, Odometry):
                drives[one.named] = partial(self._drive_odometry, odometry=one)
        if not drives:
            return
        kernel, context = self.graph.kernel, self.context

        def run() -> None:
            node = self.graph.node(NODE, f"/{self.vehicle.name}", context=context)
            self._publish_places(node, sensors)
            for name, drive in drives.items():
                kernel.spawn(partial(drive, node), f"{context.component} ({name})", context, kernel.root)

        kernel.spawn(run, f"{context.component} (sensors)", context, kernel.root)

    def _publish_places(self, node: Node, sensors: Sequence[SampledSensor]) -> None:
        """Publish where the sensors are on the body; late subscriptions receive it from the graph."""
        at = self.graph.epoch
        places = [
            transform(at, f"{self.prefix}{BODY}", f"{self.prefix}{one.frame}", ros_quaternion(turn), place)
            for one in sensors
            if one.mounting is not None
            for place, turn in (one.mounting,)
        ]
        if places:
            node.advertise(TF_STATIC, TF_MESSAGE, LATCHED).publish(new(TF_MESSAGE, transforms=places))

    def _drive(self, node: Node, sensor: SampledSensor) -> None:
        """Publish the samples of one sensor as they come."""
        advertised = [(one, node.advertise(one.topic, one.type, DEFAULT)) for one in sensor.publications()]
        rate = node.rate(sensor.period)
        while not node.closed:
            rate.sleep()
            sample = self.flight.measurement(sensor.name)
            remaining = sample.time + sensor.latency - self.graph.kernel.now()
            if remaining > 0:
                sleep(self.graph.kernel, remaining)
            for publication, publisher in advertised:
                message = new(publication.type)
                if hasattr(message, "header"):
                    message.header = stamped(self.graph.epoch + sample.time, f"{self.prefix}{sensor.frame}")
                publication.fill(message, sample.values)
                publisher.publish(message)

    def _drive_odometry(self, node: Node, odometry: Odometry) -> None:
        """Publish where the vehicle is by its own reckoning, also as a transform."""
        from volery.simulation.world.world import STEP  # noqa: PLC0415  # a real vehicle has no simulation

        publisher = node.advertise(odometry.topic("odom"), _ODOMETRY, DEFAULT)
        transforms = node.advertise(TF, TF_MESSAGE, QoS(100))
        parent, child = f"{self.prefix}{ODOM}", f"{self.prefix}{BODY}"
        rate = node.rate(STEP * round(S / STEP / odometry.rate_hz))
        while not node.closed:
            rate.sleep()
            sigmas = (0.0, 0.0, 0.0, 0.0)
            if odometry.of_autopilot:
                estimate = self.flight.estimate()
                if not estimate.position_ok:
                    continue
                time, found, sigmas = estimate.time, _reckoned(estimate), estimate.sigmas
            else:
                time, found = self.flight.measurement(odometry.named)
            at = self.graph.epoch + time
            position, attitude, velocity, rates = found
            turn = ros_quaternion(attitude)
            message = new(_ODOMETRY, header=stamped(at, parent), child_frame_id=child)
            pose, twist = message.pose.pose, message.twist.twist
            pose.position.x, pose.position.y, pose.position.z = position
            pose.orientation = turn
            twist.linear.x, twist.linear.y, twist.linear.z = velocity
            twist.angular.x, twist.angular.y, twist.angular.z = rates
            for part, flat, upright in ((message.pose, *sigmas[:2]), (message.twist, *sigmas[2:])):
                part.covariance[[0, 7, 14]] = flat * flat, flat * flat, upright * upright
            publisher.publish(message)
            moved = transform(at, parent, child, turn, position)
            transforms.publish(new(TF_MESSAGE, transforms=[moved]))


def _reckoned(estimate: Estimate) -> tuple[Vector, Quaternion, Vector, Vector]:
    """Return position east, north, up of the world's origin, attitude, and velocity and rates of the body."""
    north, east, down = (
        here + start for here, start in zip(estimate.position, estimate.origin_ned, strict=True)
    )
    velocity = frd_to_flu(world_to_body(estimate.quaternion, estimate.velocity))
    attitude = attitude_ned_to_enu(estimate.quaternion)
    return (east, north, -down), attitude, velocity, frd_to_flu(estimate.rates)
