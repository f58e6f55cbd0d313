"""The node that publishes what the added sensors of a simulated vehicle measure: their drivers on board.

Frames: sensors with a place on the body are below ``base_link`` (``/tf_static``), and odometry moves
``base_link`` in ``odom`` (``/tf``). Where several vehicles share a graph the names of frames begin with
``VEHICLE/``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from volery.base.frames import Quaternion, Vector, attitude_ned_to_enu, frd_to_flu, world_to_body
from volery.base.time import Ns, S
from volery.bridge.motion_publishers import TF, TF_MESSAGE, TF_STATIC, ros_quaternion, transform
from volery.bridge.node_interface import BODY, stamped
from volery.kernel.task import ExecutionContext
from volery.kernel.waiting import sleep
from volery.model.added_sensors import Odometry
from volery.model.environment import VehicleSpec
from volery.ros.graph import DEFAULT, LATCHED, EmbeddedGraph, Node, QoS, RosGraph
from volery.ros.messages import new

if TYPE_CHECKING:
    from volery.simulation.autopilots.flight_stack.flight import Estimate, Flight
    from volery.simulation.world.sensors import Measurement, SampledSensor

Alteration: TypeAlias = "Callable[[Measurement], Measurement | None]"
"""What a fault makes of a sample on its way to the graph; None: it is lost."""

NODE = "sensors"
ODOM = "odom"
_ODOMETRY = "nav_msgs/msg/Odometry"


def frames_of(vehicles: Sequence[VehicleSpec]) -> dict[str, str]:
    """Return what the frames of each vehicle begin with: its name if several vehicles have such frames."""
    framed = [
        vehicle.name
        for vehicle in vehicles
        if any(not isinstance(each, str) for each in vehicle.added_sensors)
    ]
    return {name: f"{name}/" if len(framed) > 1 else "" for name in framed}


class SensorNode(NamedTuple):
    """The node of one vehicle's sensors.

    Args:
        graph: The graph.
        flight: The vehicle's flight.
        vehicle: The vehicle in the model.
        context: What the drivers' work is charged to: the computer on board.
        alterations: What faults make of the samples at present: by sensor, in the order of the faults.
        prefix: What the names of its frames begin with.
    """

    graph: RosGraph
    flight: Flight
    vehicle: VehicleSpec
    context: ExecutionContext
    alterations: Mapping[str, Mapping[str, Alteration]]
    prefix: str = ""

    @property
    def moves_frames(self) -> bool:
        """Whether it publishes where ``base_link`` is."""
        return any(isinstance(sensor, Odometry) for sensor in self.vehicle.added_sensors)

    def serve(self) -> None:
        """Publish each sample of the vehicle's added sensors below ``/VEHICLE``, until the end of the run."""
        sensors = self.flight.added_sensors()
        drives = {
            sensor.name: partial(self._drive, sensor=sensor) for sensor in sensors if sensor.publications()
        }
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
            transform(at, f"{self.prefix}{BODY}", f"{self.prefix}{sensor.frame}", ros_quaternion(turn), place)
            for sensor in sensors
            if sensor.mounting is not None
            for place, turn in (sensor.mounting,)
        ]
        if places:
            node.advertise(TF_STATIC, TF_MESSAGE, LATCHED).publish(new(TF_MESSAGE, transforms=places))

    def _altered(self, sensor: str, sample: Measurement) -> Measurement | None:
        """Return a sample as faults leave it."""
        altered: Measurement | None = sample
        for alter in self.alterations.get(sensor, {}).values():
            altered = alter(altered) if altered is not None else None
        return altered

    def _stamp(self, sample: Measurement) -> Ns:
        return max(self.graph.epoch + sample.time, 0)

    def _drive(self, node: Node, sensor: SampledSensor) -> None:
        """Publish the samples of one sensor as they come."""
        advertised = [
            (publication, node.advertise(publication.topic, publication.type, DEFAULT))
            for publication in sensor.publications()
        ]
        rate = node.rate(sensor.period)
        while not node.closed:
            rate.sleep()
            sample = self.flight.measurement(sensor.name)
            remaining = sample.time + sensor.latency - self.graph.kernel.now()
            if remaining > 0:
                sleep(self.graph.kernel, remaining)
            altered = self._altered(sensor.name, sample)
            if altered is None:
                continue
            for publication, publisher in advertised:
                if publication.on_demand and not self._is_heard(publisher.topic):
                    continue
                message = new(publication.type)
                if hasattr(message, "header"):
                    message.header = stamped(self._stamp(altered), f"{self.prefix}{sensor.frame}")
                publication.fill(message, altered.values)
                publisher.publish(message)

    def _is_heard(self, topic: str) -> bool:
        """Return whether the content of a topic is used, or may be on a real graph."""
        return not isinstance(self.graph, EmbeddedGraph) or self.graph.uses_content(topic)

    def _drive_odometry(self, node: Node, odometry: Odometry) -> None:
        """Publish where the vehicle is by its own reckoning, also as a transform."""
        from volery.simulation.world.sensors import Measurement  # noqa: PLC0415  # a real vehicle has none
        from volery.simulation.world.world import STEP  # noqa: PLC0415

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
                sample, sigmas = Measurement(estimate.time, _reckoned(estimate)), estimate.sigmas
            else:
                sample = self.flight.measurement(odometry.named)
            altered = self._altered(odometry.named, sample)
            if altered is None:
                continue
            at = self._stamp(altered)
            position, attitude, velocity, rates = altered.values
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
