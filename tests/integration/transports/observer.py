"""A node of ours on a real graph, in a process of its own: tells what it hears, in hexadecimal as JSON.

    observer.py ros1|ros2 FOLDER LIMIT_S /topic=package/msg/Type=COUNT ...

Says "ready" once it listens. FOLDER has the files whose own types it knows. Ends when it has heard as much as
it should of each topic, or at its limit.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from volery.base.time import MS, S
from volery.kernel.wall import WallKernel
from volery.ros.graph import BEST_AVAILABLE, QoS
from volery.ros.messages import define_imported, to_cdr
from volery.run.assembly.ros_graphs import open_graph

EVERYTHING = QoS(None, BEST_AVAILABLE, BEST_AVAILABLE)


def main(graph_name: str, folder: str, limit_s: str, *wanted: str) -> None:
    for file in sorted(Path(folder).glob("*.py")):
        define_imported(file)
    heard: dict[str, list[str]] = {}
    missing: dict[str, int] = {}

    def listen(node: Any, topic: str, kind: str) -> None:
        node.subscribe(topic, kind, lambda message: heard[topic].append(to_cdr(message).hex()), EVERYTHING)

    kernel = WallKernel()
    with kernel.adopt("observer"):
        graph = open_graph(kernel, graph_name)
        node = graph.node("observer")
        for topic, kind, count in (one.split("=") for one in wanted):
            heard[topic], missing[topic] = [], int(count)
            listen(node, topic, kind)
        sys.stdout.write("ready\n")
        sys.stdout.flush()
        end = kernel.now() + int(limit_s) * S
        while kernel.now() < end and any(len(heard[topic]) < missing[topic] for topic in heard):
            node.spin_once(100 * MS)
        graph.close()
    kernel.close()
    json.dump(heard, sys.stdout)


if __name__ == "__main__":
    main(*sys.argv[1:])
