"""Tables III and IV of *Modeling and Performance Estimation of Robotic Systems using ROS*, from a run.

The paper's drone controller is a 10 Hz loop of about 257 s. A component that does the same (one init, one
NodeHandle, 2566 sleeps of 100 ms) is simulated on each of its platforms; the ROS time in ``run.json`` is put
beside the estimated column of Table III. The paper does not publish how often its controller made which call,
so its other calls are missing here: that is the rest of the difference.

Table IV is what that error does to the estimate of the whole application: with p the share of ROS in its time
and d the error of the ROS estimate, the error of the total is p d with an estimate and p without one.

    python bench/paper_tables.py
"""

from __future__ import annotations

import json
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from volery.run.result import Options
from volery.run.simulate import simulate

SLEEPS = 2566

CONTROLLER = f"""
import rospy


class Controller:
    def run(self):
        rospy.init_node("controller")
        for _ in range({SLEEPS}):
            rospy.sleep(0.1)
"""

MODEL = """
volery: 1
name: paper-tables
components:
  Controller: {language: rospy, path: controller.py, active: {priority: 1}}
application:
  controller: {is: Controller}
platform:
  processors:
    board: {is: intel-i5-3470, frequency: 3000 MHz}
allocations:
  only: {controller: board}
environment:
  origin: {latitude: 43.47, longitude: -3.8, amsl: 12 m}
  places: {yard: {east: 0 m, north: 0 m}}
  vehicles: {bystander: {kind: rover, autopilot: ardupilot, at: yard}}
run: {duration: 300 s}
"""


class Platform(NamedTuple):
    """A column of the paper: ns of ROS time estimated and measured, and the whole application's ms."""

    kind: str
    mhz: int
    estimated: int
    measured: int
    total_ms: int
    improvement: float  # Table IV, per cent

    @property
    def name(self) -> str:
        return f"{'Intel' if 'intel' in self.kind else 'ARM'} {self.mhz}"


PLATFORMS = (
    Platform("intel-i5-3470", 1600, 485_873_399, 582_581_163, 22_875, 83.5),
    Platform("intel-i5-3470", 3000, 318_626_359, 461_462_380, 22_018, 69.0),
    Platform("rpi4-cortex-a72", 600, 521_466_358, 904_953_908, 213_446, 57.1),
    Platform("rpi4-cortex-a72", 1500, 233_965_058, 398_265_784, 87_688, 57.8),
)


def ros_time_s(platform: Platform, folder: Path) -> float:
    """What ``run.json`` says that the controller's calls into ROS took on a platform."""
    (folder / "controller.py").write_text(CONTROLLER, encoding="utf-8")
    (folder / "model.yaml").write_text(MODEL, encoding="utf-8")
    out = folder / platform.name.replace(" ", "-").lower()
    board = f"platform.processors.board={{is: {platform.kind}, frequency: {platform.mhz} MHz}}"
    simulate(folder, Options(fidelity="code", out=out), overrides=[board])
    record = json.loads((out / "run.json").read_text(encoding="utf-8"))
    controller = record["components"]["controller"]
    assert controller["ros_calls"] == {"init": 1, "node_handle": 1, "sleep": SLEEPS}
    return float(controller["ros_cpu_s"])


def estimates() -> list[float]:
    """Seconds of ROS time on each of the four platforms."""
    with TemporaryDirectory() as folder:
        return [ros_time_s(platform, Path(folder)) for platform in PLATFORMS]


def main() -> None:
    ours = estimates()
    print("Table III: ROS time of the drone controller, ns")
    print(f"{'platform':<12}{'estimated here':>16}{'by the paper':>16}{'ratio':>9}{'measured':>16}")
    for platform, seconds in zip(PLATFORMS, ours, strict=True):
        ratio = seconds * 1e9 / platform.estimated
        print(
            f"{platform.name:<12}{seconds * 1e9:>16,.0f}{platform.estimated:>16,}{ratio:>9.1%}"
            f"{platform.measured:>16,}"
        )
    print("\nTable IV: what the error of the ROS estimate does to the whole application, %")
    print(
        f"{'platform':<12}{'ROS share':>10}{'with it':>9}{'without':>9}{'improvement':>13}{'the paper':>11}"
    )
    for platform, seconds in zip(PLATFORMS, ours, strict=True):
        share = platform.measured / 1e6 / platform.total_ms
        error = abs(platform.measured - seconds * 1e9) / platform.measured
        print(
            f"{platform.name:<12}{share:>10.2%}{share * error:>9.2%}{share:>9.2%}"
            f"{1 - error:>13.1%}{platform.improvement:>10.1f}%"
        )


if __name__ == "__main__":
    main()
