"""The graph of a run, from its trace: the same picture as of a graph that is there now."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from volery.base.errors import UsageError
from volery.base.time import to_seconds
from volery.report.document import TRACE_FILE
from volery.ros.graph.interface import ServiceState
from volery.ros.graph.snapshot import GraphSnapshot, TopicSnapshot
from volery.trace.events import Call, Message, Published
from volery.trace.reader import Reading

NODES = "/"


def graph_of_run(folder: Path) -> GraphSnapshot:
    """Who said what to whom in the run whose folder this is; rates are over the whole run.

    Raises ``UsageError`` if there is no trace in it.
    """
    types: dict[str, str] = {}
    said: Counter[str] = Counter()
    publishers: dict[str, dict[str, None]] = {}
    subscribers: dict[str, dict[str, None]] = {}
    services: dict[str, str] = {}
    lasted = 0
    with Reading(folder / TRACE_FILE) as reading:
        for event in reading.events():
            if isinstance(event, Published):
                types[event.topic] = event.type
                said[event.topic] += 1
                publishers.setdefault(event.topic, {})[event.publisher] = None
                lasted = max(lasted, event.at)
            elif isinstance(event, Message):
                publishers.setdefault(event.topic, {})[event.publisher] = None
                subscribers.setdefault(event.topic, {})[event.subscriber] = None
            elif isinstance(event, Call) and event.operation.startswith(NODES):
                services[event.operation] = event.callee
    if not publishers:
        raise UsageError(f"{folder}: nobody published anything in this run; there is no graph to show")
    seconds = to_seconds(lasted) or 1.0
    topics = tuple(
        TopicSnapshot(
            name,
            types.get(name, ""),
            tuple(sorted(publishers[name])),
            tuple(sorted(subscribers.get(name, ()))),
            said[name] / seconds if name in said else None,
        )
        for name in sorted(publishers)
    )
    nodes = {node for topic in topics for node in (*topic.publishers, *topic.subscribers)}
    served = tuple(ServiceState(name, "", server) for name, server in sorted(services.items()))
    return GraphSnapshot(tuple(sorted(nodes)), topics, served)
