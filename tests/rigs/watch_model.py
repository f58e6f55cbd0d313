"""A model with all views and its code, in which nothing is wrong."""

from pathlib import Path

CODE = {
    "camera.py": """\
import volery


class Camera:
    def __init__(self, world, rate_hz):
        self.world = world

    def grab(self, count: int) -> list:
        return []
""",
    "detector.py": """\
import volery


class Detector:
    def __init__(self, eyes):
        self.eyes = eyes

    def run(self):
        while True:
            volery.sleep(0.1)
""",
    "filter.py": """\
import rospy


class Filter:
    def run(self):
        rospy.spin()
""",
    "map.py": """\
import rospy


class Map:
    def run(self):
        rospy.spin()
""",
    "pilot.py": """\
class Pilot:
    def __init__(self, drone, eyes):
        pass

    def run(self):
        pass
""",
}

LIBRARY = """\
components:
  Map:
    language: rospy
    path: code/map.py
    active: true
    subscribes: {/filtered: {type: sensor_msgs/Image}}
"""

CITY = """\
origin: {latitude: 43.47, longitude: -3.8, amsl: 20 m}
places:
  port: {east: 0 m, north: 0 m, role: port}
"""

MODEL = """\
volery: 1
name: watch
include: library.yaml
types:
  Image: {fields: {width: int, height: int}}
  Mode: {values: [day, night]}
interfaces:
  Grab:
    grab: {args: {count: int}, returns: "Image[]"}
  Empty:
  Steer:
    steer: {args: {mode: Mode}}
components:
  Camera:
    language: python
    path: code/camera.py
    provides: {pictures: Grab}
    requires: {world: Environment}
    parameters: {rate_hz: 10}
    queues: {pictures: {size: 2, full: remove-first, timeout: 50 ms}}
    at: {processor: rpi4-cortex-a72, frequency: 1500 MHz}
    operations: {grab: {time: 2 ms, best: 1 ms, worst: 4 ms, provenance: measured, uncertainty: 10 %}}
    memory: 10 MB
  Detector:
    language: python
    path: code/detector.py
    requires: {eyes: Grab}
    active: {period: 100 ms, deadline: 80 ms, jitter: 2 ms, priority: 7}
    at: {processor: rpi4-cortex-a72, frequency: 1500 MHz}
    activation: {time: 12 ms}
    calls: {activation: {eyes.grab: 1}}
  Filter:
    language: rospy
    path: code/filter.py
    active: true
    subscribes: {/raw: {type: sensor_msgs/Image}}
    publishes: {/filtered: {type: sensor_msgs/Image}}
  Source:
    language: rospy
    active: {period: 1 s}
    publishes: {/raw: {type: sensor_msgs/msg/Image, size: 1 MB}}
  Pilot:
    language: python
    path: code/pilot.py
    requires: {drone: Drone, eyes: "Grab[]"}
    active: true
application:
  camera: {is: Camera, world: environment}
  detector: {is: Detector, eyes: camera.pictures}
  filter: {is: Filter, namespace: /vision}
  map: {is: Map}
  pilot: {is: Pilot, drone: drone_1, eyes: [camera.pictures]}
memory_spaces:
  vision: {memory: 64 MB}
platform:
  processors:
    ground: {is: intel-i5-3470, frequency: 3000 MHz, memory: 4 GB}
    onboard:
      is: rpi4-cortex-a72
      frequency: {value: 1500 MHz, provenance: required, source: data sheet}
      carried_by: drone_1
      caches: {l2: {level: 2, size: 1 MB}}
      power_states: {full: {frequency: 1500 MHz, total: 6.4 W}}
  networks:
    radio: {between: [ground, onboard], bandwidth: 1 Mbit/s, latency: 15 ms}
  operating_systems:
    debian: {type: Debian 12, drivers: [v4l2]}
  devices:
    lens: {kind: sensor, on: onboard, driver: v4l2, path: /dev/video0}
allocations:
  all: {camera: vision, detector: vision, vision: debian, debian: onboard, filter: ground, map: ground,
    pilot: onboard}
environment:
  world: city.yaml
  vehicles:
    drone_1: {kind: multirotor, autopilot: ardupilot, at: port, battery: {capacity: 5 Ah, charge: 90 %}}
  components:
    source: {is: Source}
  workload: {orders: {rate: 6 / h, count: 3}}
scenarios:
  calm: {set: {environment.wind: 0 m/s}}
chains:
  seen: [/raw, /filtered]
requirements:
  fast: {observe: detector.response_time, max: 80 ms}
  in_time: {observe: detector.deadline_misses, max: 0}
  charge: {observe: drone_1.battery_min, min: 0.2}
  chain: {observe: seen.latency, max: 1 s}
design_parameters:
  clock: {paths: platform.processors.onboard.frequency, values: [600 MHz, 1500 MHz]}
run: {duration: 1 min}
"""


def write_watch_model(folder: Path) -> Path:
    """Write the model and its code into *folder*; return the model's file."""
    (folder / "code").mkdir(parents=True)
    for name, text in CODE.items():
        (folder / "code" / name).write_text(text)
    (folder / "model.yaml").write_text(MODEL)
    (folder / "library.yaml").write_text(LIBRARY)
    (folder / "city.yaml").write_text(CITY)
    return folder / "model.yaml"
