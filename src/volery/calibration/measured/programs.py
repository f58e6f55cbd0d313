"""How each node of a model is started as a process of its own client library."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from volery.base.errors import Location, ModelError
from volery.calibration.ros.stage import roscpp_program
from volery.components.cpp.sources import find_sources
from volery.components.python import script_or_class
from volery.model.system import Instance, System
from volery.run.platform import commanded_by

METERS = Path(str(files("volery.calibration.measured").joinpath("meters")))


@dataclass(frozen=True)
class NodeProgram:
    """A node: ``command`` starts it. One of the environment is started and not ``measured``."""

    instance: str
    node: str
    command: tuple[str, ...]
    measured: bool


def programs(system: System) -> tuple[NodeProgram, ...]:
    """Those of all nodes of *system*, the environment's first.

    Compiles what is roscpp. ``ModelError`` for a component that is no node of rospy or roscpp that stands
    alone; ``UsageError`` if roscpp or a compiler is missing.
    """
    for instance in system.instances:
        _check(system, instance)
    made = [_program(system, instance) for instance in system.instances]
    return tuple(sorted(made, key=lambda one: one.measured))


def _check(system: System, instance: Instance) -> None:
    component = instance.component
    if component.language not in ("rospy", "roscpp") or not component.path:
        raise _cannot(instance, f"is {component.language}, and what is measured is nodes of rospy and roscpp")
    if commanded_by(instance):
        raise _cannot(instance, "commands a vehicle, which is nothing that a plain node can do")
    if component.language == "rospy":
        file = system.file_of(component)
        if component.class_stated or script_or_class(file, component.class_name, component.where):
            raise _cannot(instance, "is a class, and what is measured is scripts")


def _cannot(instance: Instance, what: str) -> ModelError:
    return ModelError(f"{instance.name} {what}", where=instance.component.where or Location("", 0))


def _program(system: System, instance: Instance) -> NodeProgram:
    file = system.file_of(instance.component)
    if instance.component.language == "roscpp":
        start: tuple[str, ...] = (str(_compiled(instance, file)),)
    else:
        start = (sys.executable, str(METERS / "rospy.py"), str(file))
    return NodeProgram(
        instance.name,
        f"{instance.namespace.rstrip('/')}/{instance.name}",
        (*start, *_arguments(instance)),
        not instance.is_environment,
    )


def _compiled(instance: Instance, file: Path) -> Path:
    component = instance.component
    sources = [*find_sources(file, component.where).compiled, METERS / "roscpp.cpp"]
    options = component.build
    return roscpp_program(instance.name, sources, options.flags, options.libraries)


def _arguments(instance: Instance) -> Iterator[str]:
    """As roslaunch gives them."""
    yield f"__name:={instance.name}"
    if instance.namespace != "/":
        yield f"__ns:={instance.namespace}"
    for name, other in instance.remap.items():
        yield f"{name}:={other}"
    for name, value in instance.parameters.items():
        yield f"_{name}:={json.dumps(value)}"
