"""Conformance of transports: named checks of what the node interface must do on any ROS graph.

```python
from volery.testing.transport_conformance import CHECKS, Site

with kernel.adopt("checks"):
    for name, check in CHECKS.items():
        with Site(graph, name) as site:
            check(site)
```

A check that finds a fault raises ``CheckFailedError``. ``Traits`` states the intended differences of graphs,
and checks demand what the traits state.
"""

from __future__ import annotations

import traceback
from collections.abc import Iterator
from contextlib import contextmanager

from volery.ros.graph.interface import RosGraph
from volery.testing import transport_node_checks, transport_topic_checks
from volery.testing.checks import CheckFailedError
from volery.testing.transport_site import CHECKS, EMBEDDED, ROS1, ROS2, Site, Traits, check

__all__ = [
    "CHECKS", "EMBEDDED", "ROS1", "ROS2", "Site", "Traits", "check", "run_checks",
    "transport_node_checks", "transport_topic_checks",
]  # fmt: skip


@contextmanager
def no_fault(name: str) -> Iterator[list[str]]:
    """Collect the descriptions of the faults that the block finds."""
    faults: list[str] = []
    try:
        yield faults
    except CheckFailedError as error:
        faults.append(f"{name}: {error}")
    except Exception:
        faults.append(f"{name}: {traceback.format_exc()}")


def run_checks(graph: RosGraph, traits: Traits) -> dict[str, str]:
    """Run all checks on one graph, within a task; return their faults by name, empty for none."""
    found = {}
    for name, body in CHECKS.items():
        with no_fault(name) as faults, Site(graph, name, traits) as site:
            body(site)
        found[name] = "; ".join(faults)
    return found
