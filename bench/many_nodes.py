"""CPU time of 100 rclpy nodes with 100 topics at 50 Hz: on the embedded graph, and on real rclpy beside it.

Both run the same file, ``ros_nodes/ring.py``, in one process each; building the nodes is left out. Messages
that a busy machine loses to real rclpy make its sum smaller, so the ratio is that for a message.
Real rclpy is asked in the environment of ``--python`` (scripts/ros2-venv); the goal is a ratio of 0.5.

    python bench/many_nodes.py --python .venv/ros2-jazzy/bin/python [--seconds 5]
"""

from __future__ import annotations

import argparse
import os
import subprocess
from pathlib import Path
from time import process_time

from volery.base.time import S
from volery.components.loader import Loader, parse
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.ros.client_libraries.importable_modules import importable_modules
from volery.ros.graph import EmbeddedGraph
from volery.ros.graph.embedded_graph import record_none

RING = Path(__file__).parent / "ros_nodes" / "ring.py"


def embedded(seconds: int) -> tuple[float, int]:
    """Return the CPU seconds and the messages of a run on the embedded graph."""
    kernel = VirtualKernel()
    graph = EmbeddedGraph(kernel, records=record_none)
    loader = Loader(importable_modules(graph))
    found: list[float] = []

    def body() -> None:
        start: list[float] = []
        ring = loader.load(parse(RING), "ring")
        count = ring.main(seconds, lambda: start.append(process_time()))
        found.extend((process_time() - start[0], count))

    kernel.spawn(body, "ring", ExecutionContext("ring"))
    kernel.run((seconds + 1) * S)
    return found[0], int(found[1])


def real(python: str, seconds: int) -> tuple[float, int]:
    """Return the CPU seconds and the messages of a run on real rclpy."""
    kept = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "VIRTUAL_ENV")}
    done = subprocess.run(
        [python, str(RING), str(seconds)],
        env={**kept, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"},
        capture_output=True,
        text=True,
        check=True,
    )
    used, count = done.stdout.split()
    return float(used), int(count)


def main() -> None:
    """Print both and their ratio."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--python", required=True, help="interpreter with rclpy")
    options.add_argument("--seconds", type=int, default=5)
    given = options.parse_args()
    ours, received = embedded(given.seconds)
    theirs, taken = real(given.python, given.seconds)
    for name, used, count in (("embedded", ours, received), ("rclpy", theirs, taken)):
        print(f"{name:10}{used:8.2f} s CPU{count:8} messages{used / count * 1e6:8.1f} us a message")
    print(f"ratio for a message {ours / received / (theirs / taken):.2f}")


if __name__ == "__main__":
    main()
