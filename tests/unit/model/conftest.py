"""A model that is right, to be spoilt one thing at a time."""

from pathlib import Path

import pytest

from volery.model.reading import ProcessorKind, Vocabulary
from volery.model.system import System
from volery.model.system_loader import load
from volery.requirements.observables import OBSERVABLES

CITY = """\
origin: {latitude: 43.47, longitude: -3.8, amsl: 20 m}
places:
  store: {east: 0 m, north: 0 m, role: store}
  port_north: {east: 10 m, north: 100 m, role: port}
  hospital: {latitude: 43.471, longitude: -3.8005, role: hospital}
roads:
  junctions: {bend: {east: 5 m, north: 5 m}}
  ways:
    - [store, bend, port_north]
corridors: {height: 40 m, ways: [[port_north, hospital]]}
no_fly_zones:
  prison: {centre: {east: 50 m, north: 50 m}, radius: 20 m, ceiling: 100 m}
  school: {corners: [{east: 0, north: 200 m}, {east: 10 m, north: 200 m}, port_north]}
"""

MODEL = """\
volery: 1
name: hospital-delivery
interfaces:
  Routing:
    get_path: {args: {start: Position, goal: Position}, returns: "Position[]"}
  Delivery: {order: {args: {good: str, destination: str}, returns: Receipt}}
  DroneService: {deliver: {}}
  Progress:
components:
  DeliveryCentral:
    language: python
    path: code/central.py
    provides: {orders: Delivery}
    requires: {routes: Routing, drones: "DroneService[]"}
    operations: {order: {time: 2 ms, energy: 3 mJ, at: {processor: intel-i5-3470, frequency: 3 GHz}}}
  RouteGenerator:
    language: python
    path: code/planner.py
    provides: {paths: Routing}
    requires: {map: Environment}
    at: {processor: rpi4-cortex-a72, frequency: 1500 MHz}
    operations:
      get_path:
        - {time: 5 ms}
        - {time: 1 ms, at: {processor: intel-i5-3470, frequency: 3000 MHz}, provenance: measured}
  drone_control:
    language: rospy
    path: code/control.py
    provides: {service: DroneService}
    requires: {drone: Drone, progress: Progress}
    active: {period: 100 ms, deadline: 80 ms, priority: 10}
    parameters: {rate: 6 / h, label: "10 m", points: [1 km, x], steps: 3}
  Requester: {language: python, path: code/requester.py, requires: {central: Delivery}, active: true}
application:
  central: {is: DeliveryCentral, routes: planner.paths, drones: [control.service]}
  planner: {is: RouteGenerator, map: environment}
  control: {is: drone_control, drone: drone_1, active: {priority: 12}, parameters: {steps: 4}}
platform:
  processors:
    ground: {is: intel-i5-3470, frequency: 3000 MHz}
    onboard: {is: rpi4-cortex-a72, frequency: 1500 MHz, carried_by: drone_1}
  networks:
    radio: {between: [ground, onboard], bandwidth: 57600 bit/s, latency: 20 ms, loss: 0.5 %}
allocations:
  fast: {central: ground, planner: ground, control: onboard}
  slow: {extends: fast, planner: onboard, set: {platform.processors.onboard.frequency: 600 MHz}}
environment:
  world: city.yaml
  wind: 3 m/s
  vehicles:
    drone_1: {kind: multirotor, autopilot: ardupilot, at: port_north, battery: 5 Ah, parameters: {WP_YAW: 1}}
    rover_1: {kind: rover, autopilot: ardupilot, at: store, heading: 90 deg, sensors: rtk, started: cold}
  components:
    requester: {is: Requester, central: central.orders}
  workload: {requesters: 3, orders: {rate: 6 / h, count: 3, seed: orders}}
scenarios:
  calm: {set: {environment.wind: 0 m/s}}
  pocket:
    extends: calm
    allocation: slow
    duration: 60 s
    until: {observe: application.delivered, min: 1}
    set: {environment.wind.gusts: 1 m/s}
requirements:
  landing: {observe: drone_1.landing_offset, max: 30 cm}
  control: {observe: control.deadline_misses, max: 0}
run: {duration: 15 min}
"""


class Workshop:
    """A folder with the model; ``load`` reads it as it is now."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.file = folder / "model.yaml"
        (folder / "code").mkdir()
        for name in ("central", "planner", "control", "requester"):
            (folder / "code" / f"{name}.py").touch()
        self.file.write_text(MODEL)
        (folder / "city.yaml").write_text(CITY)
        self.vocabulary = Vocabulary(
            processors={
                "intel-i5-3470": ProcessorKind(4, 1.6e9, 3.0e9),
                "rpi4-cortex-a72": ProcessorKind(4, 0.6e9, 1.5e9, (0.6e9, 0.7e9, 1.4e9, 1.5e9)),
            },
            autopilots=frozenset({"ardupilot"}),
            observables=OBSERVABLES,
        )

    def change(self, old: str, new: str, name: str = "model.yaml") -> "Workshop":
        """Replace *old*, which must be there, in a file."""
        file = self.folder / name
        text = file.read_text()
        assert old in text, old
        file.write_text(text.replace(old, new))
        return self

    def load(self, scenario: str | None = None, allocation: str | None = None, *overrides: str) -> System:
        """The system that the folder's model describes."""
        return load(self.file, self.vocabulary, scenario, allocation, overrides)

    def line_of(self, text: str, name: str = "model.yaml") -> int:
        """The line of a file that holds *text*."""
        lines = (self.folder / name).read_text().splitlines()
        return next(number for number, line in enumerate(lines, 1) if text in line)


@pytest.fixture
def workshop(tmp_path: Path) -> Workshop:
    return Workshop(tmp_path)
