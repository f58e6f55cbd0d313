"""The node that plays a recording into the graph of a run, as those nodes did that it was recorded from."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from volery.base.errors import Location, ModelError, UsageError
from volery.base.time import to_seconds
from volery.kernel.task import ExecutionContext
from volery.model.recorded_inputs import RecordedInput
from volery.model.system import System
from volery.ros.graph import RosGraph
from volery.ros.graph.rosbag import PlayOptions, check_topics, play
from volery.ros.messages.bags import Bag, open_bag
from volery.trace.events import WARNING, Text


def recorded_input(system: System, stated: RecordedInput, graph: RosGraph) -> Callable[[], object]:
    """Return what starts to play an input of a model; its node is named after it and costs nothing.

    Raises:
        ModelError: there is no such recording, it lacks a topic, or a topic of it cannot be decoded.
    """
    where = stated.where or Location(stated.bag, 0)
    how = PlayOptions(
        rate=stated.rate,
        topics=stated.topics or None,
        after=to_seconds(stated.after_ns),
        loop=stated.loop,
        restamped=stated.stamps == "run",
    )
    try:
        bag = open_bag(system.folder / stated.bag)
        check_topics(bag, how)
        problem = _unplayable(bag, stated)
    except UsageError as error:
        problem = str(error)
    if problem:
        raise ModelError(problem, f"environment.inputs.{stated.name}", where)
    for topic, why in bag.unreadable.items():
        if topic in stated.topics or topic not in bag.usual:
            bag.note(f"{topic} is left out: {why}")
    context = ExecutionContext(stated.name, None)
    run = partial(_play, stated, graph, bag, how, context)
    return partial(graph.kernel.spawn, run, stated.name, context, graph.kernel.root)


def _unplayable(bag: Bag, stated: RecordedInput) -> str:
    """Return why nothing of a recording would be played; empty if something is."""
    if not bag.usual:
        return f"{bag.path} has no message that can be decoded"
    if bag.start + stated.after_ns > bag.end:
        return f"{bag.path} lasts {to_seconds(bag.end - bag.start):g} s; `after` skips all of it"
    if stated.loop and bag.start + stated.after_ns == bag.end:
        return f"{bag.path} is of one instant from `after` on, and cannot be repeated"
    return ""


def _play(
    stated: RecordedInput, graph: RosGraph, bag: Bag, how: PlayOptions, context: ExecutionContext
) -> None:
    node = graph.node(stated.name, remaps=stated.remap, context=context)
    try:
        node.sleep(stated.delay_ns)
        play(node, bag, how)
    finally:
        for what in (*bag.damage, *bag.differences):
            graph.kernel.record(Text(graph.kernel.now(), stated.name, WARNING, what))
