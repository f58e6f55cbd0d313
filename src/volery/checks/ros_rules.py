"""Rules of ROS: names that it takes, nodes of one name, topics of two types, topics without a publisher."""

from __future__ import annotations

import re
from collections.abc import Iterator

from volery.checks.system_rules import instance_path
from volery.model import rules
from volery.model.components import ROS_LANGUAGES
from volery.model.instances import Instance
from volery.model.rules import Finding
from volery.model.system import System
from volery.ros.graph.interface import absolute_name, absolute_remaps, join_names

_SEGMENT = r"[A-Za-z_][A-Za-z0-9_]*"
_ROS_NAME = re.compile(rf"(/|~/?)?{_SEGMENT}(/{_SEGMENT})*\Z")
_OF_EVERY_GRAPH = ("/clock", "/tf", "/tf_static", "/rosout")


def ros_names(system: System) -> Iterator[Finding]:
    """Find names that ROS does not take, and nodes whose names are the same in ROS."""
    nodes: dict[str, str] = {}
    for instance in system.instances:
        if instance.component.language in ROS_LANGUAGES:
            yield from _names_of(instance)
            full = join_names(instance.namespace, instance.name.replace("-", "_"))
            if full in nodes:
                what = f"it is the node {full} in ROS, and so is {nodes[full]}"
                yield Finding(rules.NODE_CLASH, what, instance_path(instance), instance.where)
            nodes.setdefault(full, instance.name)
    for component in {one.component.name: one.component for one in system.instances}.values():
        for section, topics in (("publishes", component.publishes), ("subscribes", component.subscribes)):
            for name in topics:
                if _ROS_NAME.match(name) is None:
                    at = f"components.{component.name}.{section}.{name}"
                    yield Finding(rules.BAD_ROS_NAME, f"{name!r} is no name in ROS", at, component.where)


def _names_of(instance: Instance) -> Iterator[Finding]:
    path = instance_path(instance)
    namespace = instance.namespace.strip("/")
    if namespace and _ROS_NAME.match(namespace) is None:
        what = f"{instance.namespace!r} is no namespace in ROS"
        yield Finding(rules.BAD_ROS_NAME, what, f"{path}.namespace", instance.where)
    for name in (*instance.remap, *instance.remap.values()):
        if _ROS_NAME.match(name) is None:
            yield Finding(rules.BAD_ROS_NAME, f"{name!r} is no name in ROS", f"{path}.remap", instance.where)


def full_topic(instance: Instance, name: str) -> str:
    """Return the full name of a topic that *instance* calls *name*, after its remapping."""
    known = {old: new for old, new in instance.remap.items() if _ROS_NAME.match(old) and _ROS_NAME.match(new)}
    node = join_names(instance.namespace, instance.name)
    full = absolute_name(name, instance.namespace, node)
    return absolute_remaps(known, instance.namespace, node).get(full, full)


def topics(system: System) -> Iterator[Finding]:
    """Find topics of two types, and those that nothing publishes."""
    known: dict[str, tuple[str, str]] = {}
    ends = list(_topics_of(system))
    for instance, full, kind, _ in ends:
        other, by = known.setdefault(full, (kind, instance.name))
        if other != kind:
            what = f"{full} is {kind} here, and {other} in {by}"
            yield Finding(rules.TOPIC_TYPES, what, instance_path(instance), instance.where)
    published = {full for _, full, _, publishes in ends if publishes}
    own = (*(f"/{vehicle.name}/" for vehicle in system.vehicles), *_OF_EVERY_GRAPH)
    for instance, full, _, publishes in ends:
        if not publishes and full not in published and not full.startswith(own):
            what = f"it subscribes to {full}, which no component publishes"
            yield Finding(rules.NOT_PUBLISHED, what, instance_path(instance), instance.where)
    for chain in system.chains if published else ():
        for missing in (one for one in chain.topics if one not in published and not one.startswith(own)):
            yield Finding(rules.NOT_PUBLISHED, f"no component publishes {missing}", f"chains.{chain.name}")


def _topics_of(system: System) -> Iterator[tuple[Instance, str, str, bool]]:
    """Yield each stated topic: its instance, its full name and type, and whether it is published."""
    for instance in system.instances:
        component = instance.component
        stated = [(name, one.type, True) for name, one in component.publishes.items()]
        stated += [(name, one.type, False) for name, one in component.subscribes.items()]
        for name, kind, publishes in stated:
            if _ROS_NAME.match(name) is not None:
                yield instance, full_topic(instance, name), kind.replace("/msg/", "/"), publishes


ROS_RULES = (ros_names, topics)
"""Every rule above, in the order of the report."""
