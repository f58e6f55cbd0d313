"""The safety switch over links without MAVLink: MAVROS and a DJI SDK node."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rigs.airstrip import Airstrip
from rigs.missions import carried_out
from volery.base.time import MS, S
from volery.bridge import serve_vehicle
from volery.control.actuation import VelocitySetpoints
from volery.control.flight import ControlledFlight
from volery.control.manoeuvres import Rotation
from volery.control.safety_switch import Authority, SwitchSettings
from volery.kernel.task import ExecutionContext
from volery.ros.graph import EmbeddedGraph
from volery.run.assembly.vehicles import VehicleSettings, open_vehicles
from volery.trace.events import Text
from volery.vehicles import Drone
from volery.vehicles.drivers.mavros import MAVROS

FLYING_S, MOVED_S = 4.0, 1.0


def takeover(kernel: Any, drone: Drone, channel: int, move: Callable[[], None]) -> tuple[Authority, str]:
    """Fly, move the switch in the air, and return who has control a second later, and why."""
    flight = ControlledFlight(
        drone, Rotation([0.0, 90.0], 10.0), VelocitySetpoints(drone), switch=SwitchSettings(channel=channel)
    )
    found: list[Authority] = []
    said: list[str] = []
    kernel.record = lambda event: said.append(event.text) if isinstance(event, Text) else None

    def look() -> None:
        if drone.flying:
            kernel.call_at(kernel.now() + round(FLYING_S * S), move)
            kernel.call_at(kernel.now() + round((FLYING_S + MOVED_S) * S), end)
            watching.cancel()

    def end() -> None:
        found.append(flight.authority)
        kernel.cancel(scope, "the test is over")

    watching = kernel.every(100 * MS, look)
    drone.wait_ready()
    scope = kernel.root.child("flight")
    task = kernel.spawn(flight.run, "flight", ExecutionContext("flight"), scope)
    while not task.done:
        kernel.sleep_until(kernel.now() + 100 * MS)
    return found[0], " ".join(said)


class Mavros(Airstrip):
    """A simulated ArduCopter, MAVROS's names before it, and a node that commands it."""

    firmware = "ardupilot"

    def open(self) -> None:
        return None

    def fly(self, mission: Callable[[Any], Any]) -> Any:
        graph = EmbeddedGraph(self.kernel)
        serve_vehicle(graph, self.link, "craft_1", ExecutionContext("vehicle node"))

        def body() -> Any:
            assert MAVROS.on_graph is not None
            driver = MAVROS.on_graph(
                self.kernel, graph.node("control"), "craft_1", {"autopilot": self.firmware}
            )
            return mission(self.commanded_by(driver))

        return carried_out(self.kernel, body)


def test_over_mavros_the_switch_takes_over() -> None:
    at = Mavros()
    channels = at.autopilot.vehicle.rc.transmitter
    channels[5] = 1500

    def low() -> None:
        channels[5] = 1000

    authority, said = at.fly(lambda drone: takeover(at.kernel, drone, 6, low))
    assert authority is Authority.MANUAL
    assert "the switch is at 1000 us: manual takeover" in said
    assert at.autopilot.vehicle.mode.name != "GUIDED"


def simulated(name: str, mission: Callable[[Any, Drone], Any]) -> Any:
    opened = open_vehicles({name: f"sim:{name}?start=warm"}, {name: Drone}, VehicleSettings())
    drone, fleet = opened.vehicles[0], opened.fleet
    assert fleet is not None
    assert isinstance(drone, Drone)
    try:

        def body() -> Any:
            drone.wait_connected()
            return mission(fleet.autopilots[name].vehicle, drone)

        return carried_out(opened.kernel, body)
    finally:
        drone.close()
        opened.kernel.close()


def test_a_dji_mode_switch_is_channel_5() -> None:
    def mission(vehicle: Any, drone: Drone) -> tuple[Authority, str]:
        def move() -> None:
            vehicle.rc.transmitter[4] = 1500

        return takeover(drone.kernel, drone, 5, move)

    authority, said = simulated("dji", mission)
    assert authority is Authority.MANUAL
    assert "the switch is at 1000 us: manual takeover" in said
