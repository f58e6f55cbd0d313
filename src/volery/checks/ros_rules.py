"""Rules of ROS: names, nodes of one name, topics of two types, without a publisher or a subscriber."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from volery.checks.system_rules import instance_path
from volery.model import rules
from volery.model.components import ROS_LANGUAGES
from volery.model.instances import Instance
from volery.model.rules import BrokenRule
from volery.model.system import System
from volery.ros.graph.interface import absolute_name, absolute_remaps, join_names

_SEGMENT = r"[A-Za-z_][A-Za-z0-9_]*"
_ROS_NAME = re.compile(rf"(/|~/?)?{_SEGMENT}(/{_SEGMENT})*\Z")
_OF_EVERY_GRAPH = ("/clock", "/tf", "/tf_static", "/rosout")


def ros_names(system: System) -> Iterator[BrokenRule]:
    """Find names that ROS does not take, and nodes whose names are the same in ROS."""
    nodes: dict[str, str] = {}
    for instance in system.instances:
        if instance.component.language in ROS_LANGUAGES:
            yield from _names_of(instance)
            full = join_names(instance.namespace, instance.node_name or instance.name.replace("-", "_"))
            if full in nodes:
                what = f"it is the node {full} in ROS, and so is {nodes[full]}"
                yield BrokenRule(rules.NODE_CLASH, what, instance_path(instance), instance.where)
            nodes.setdefault(full, instance.name)
    for component in {instance.component.name: instance.component for instance in system.instances}.values():
        for section, topics in (("publishes", component.publishes), ("subscribes", component.subscribes)):
            for name in topics:
                if _ROS_NAME.match(name) is None:
                    at = f"components.{component.name}.{section}.{name}"
                    yield BrokenRule(rules.BAD_ROS_NAME, f"{name!r} is no name in ROS", at, component.where)


def _names_of(instance: Instance) -> Iterator[BrokenRule]:
    path = instance_path(instance)
    namespace = instance.namespace.strip("/")
    if namespace and _ROS_NAME.match(namespace) is None:
        what = f"{instance.namespace!r} is no namespace in ROS"
        yield BrokenRule(rules.BAD_ROS_NAME, what, f"{path}.namespace", instance.where)
    for name in (*instance.remap, *instance.remap.values()):
        if _ROS_NAME.match(name) is None:
            yield BrokenRule(
                rules.BAD_ROS_NAME, f"{name!r} is no name in ROS", f"{path}.remap", instance.where
            )


def full_topic(instance: Instance, name: str) -> str:
    """Return the full name of a topic that *instance* calls *name*, after its remapping."""
    known = {old: new for old, new in instance.remap.items() if _ROS_NAME.match(old) and _ROS_NAME.match(new)}
    node = join_names(instance.namespace, instance.node_name or instance.name)
    full = absolute_name(name, instance.namespace, node)
    return absolute_remaps(known, instance.namespace, node).get(full, full)


def topics(system: System) -> Iterator[BrokenRule]:
    """Find topics of two types, and those that nothing publishes or that end a chain unseen."""
    known: dict[str, tuple[str, str]] = {}
    ends = list(_topics_of(system))
    for instance, full, kind, _ in ends:
        other, by = known.setdefault(full, (kind, instance.name))
        if other != kind:
            what = f"{full} is {kind} here, and {other} in {by}"
            yield BrokenRule(rules.TOPIC_TYPES, what, instance_path(instance), instance.where)
    published = {full for _, full, _, publishes in ends if publishes}
    own = (*(f"/{vehicle.name}/" for vehicle in system.vehicles), *_OF_EVERY_GRAPH)
    for instance, full, _, publishes in ends:
        if not publishes and full not in published and not full.startswith(own):
            what = f"it subscribes to {full}, which no component publishes"
            yield BrokenRule(rules.NOT_PUBLISHED, what, instance_path(instance), instance.where)
    for chain in system.chains:
        at = f"chains.{chain.name}"
        for missing in chain.topics if published else ():
            if missing not in published and not missing.startswith(own):
                yield BrokenRule(rules.NOT_PUBLISHED, f"no component publishes {missing}", at, chain.where)
        for topic in chain.topics:
            if not topic.startswith(own) and not any(
                _may_subscribe(system, instance, topic) for instance in system.instances
            ):
                what = f"nothing subscribes to {topic}: no message arrives there, and no latency is observed"
                yield BrokenRule(rules.NOT_SUBSCRIBED, what, at, chain.where)


def _may_subscribe(system: System, instance: Instance, topic: str) -> bool:
    """Return whether *instance* states that it subscribes to *topic*, or has code that may do so."""
    component = instance.component
    if any(full_topic(instance, name) == topic for name in component.subscribes if _ROS_NAME.match(name)):
        return True
    if component.subscribes or not component.path:
        return bool(component.package) and not component.subscribes
    names = _subscribed_in(system.file_of(component))
    return names is None or any(
        full_topic(instance, name) == topic for name in names if _ROS_NAME.match(name)
    )


_SUBSCRIBES = re.compile(r"[Ss]ubscri|wait_for_message")


def _subscribed_in(file: Path) -> list[str] | None:
    """Return the topics that a Python file subscribes to by constant names; None if that cannot be seen."""
    try:
        tree = ast.parse(file.read_bytes())
    except (
        OSError,
        ValueError,
        SyntaxError,
        RecursionError,
    ):  # another language, or it is reported elsewhere
        return None
    found: list[str] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom) and _imports_neighbour(node, file):
            return None
        if not isinstance(node, ast.Call) or not _SUBSCRIBES.search(ast.unparse(node.func)):
            continue
        given = [*node.args, *(keyword.value for keyword in node.keywords)]
        texts = [one.value for one in given if isinstance(one, ast.Constant) and isinstance(one.value, str)]
        if not texts:
            return None
        found += texts
    return found


def _imports_neighbour(node: ast.Import | ast.ImportFrom, file: Path) -> bool:
    """Return whether a module is imported that lies beside *file* and may subscribe for it."""
    if isinstance(node, ast.ImportFrom):
        names = [node.module or ""] if not node.level else [""]
    else:
        names = [name.name for name in node.names]
    tops = [name.partition(".")[0] for name in names]
    return any(
        not top or (file.parent / top).is_dir() or (file.parent / f"{top}.py").exists() for top in tops
    )


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
