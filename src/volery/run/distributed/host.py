"""The process of one component of a deployed system: what the generated entry points of a package call.

With ``simulated`` a run elsewhere (``volery simulate --deployed``) has the vehicles and the time: the
component follows ``/clock``, begins with the run, and ends with it or when the node of the run has left the
graph. Without, it runs in real time, begins as soon as the services that it calls are there, and lands its
vehicles when it is stopped by a signal.
"""

from __future__ import annotations

import argparse
import os
import sys
import threading
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from volery.base.errors import ModelError, VoleryError
from volery.base.position import Position
from volery.base.process import outlive_output
from volery.base.time import S
from volery.kernel.task import ExecutionContext
from volery.model.instances import Instance, TargetKind
from volery.model.system import System
from volery.model.system_loader import load
from volery.model.text import parse
from volery.ros.graph.interface import full_node_name
from volery.run.assembly.component_builder import BuiltComponents, with_executables
from volery.run.assembly.model_checks import vocabulary
from volery.run.distributed import pipe, plan
from volery.run.distributed.call_types import CallTypes, call_types
from volery.run.distributed.topic_messages import (
    MESSAGE_TYPE,
    QUEUE,
    TO_COMPONENTS,
    TO_RUN,
    from_message,
    is_sent,
    to_message,
)
from volery.run.distributed.worker import ORPHAN_S, Worker
from volery.trace.events import WARNING, Event, Failure, Text

REPEAT_S = 0.5
"""Wall seconds between two ``Ready``."""
WATCH_S = 2.0
"""Wall seconds between two looks for the node of the run."""
ABSENT = 3
"""Looks in a row without the node of the run after which the run is gone."""


class _ToRun:
    """The run as a deployed component sees it: over topics in a simulation, on standard error in reality."""

    def __init__(self, sender: str) -> None:
        self._sender = sender
        self.publish: Callable[[Any], None] | None = None

    def send(self, thing: object) -> bool:
        """See ``pipe.RunSide``."""
        if self.publish is not None and is_sent(thing):
            self.publish(to_message(self._sender, thing))
        elif isinstance(thing, Failure):
            print(f"{thing.who}: {thing.what}", file=sys.stderr, flush=True)  # noqa: T201
        elif isinstance(thing, Text) and thing.severity <= WARNING:
            print(f"{thing.source}: {thing.text}", file=sys.stderr, flush=True)  # noqa: T201
        return True

    def receive(self) -> Any:
        """See ``pipe.RunSide``. Messages arrive by callbacks instead."""
        raise EOFError


class ComponentHost(Worker):
    """One component of a deployed system."""

    def __init__(self, order: pipe.WorkerOrder, *, simulated: bool) -> None:
        self._to_run = _ToRun(order.name)
        super().__init__(order, self._to_run, real_time=not simulated)
        self._begun, self._over = threading.Event(), threading.Event()
        self._watch = threading.Thread(target=self._watch_run, name="run", daemon=True)

    def _record(self, event: Event) -> None:
        self._to_run.send(event)

    def _truth_source(self) -> Callable[[str], Callable[[], Position]] | None:
        return None  # only the run has it

    def _call_types(self) -> CallTypes | None:
        return call_types(self._system)

    def run(self) -> bool:
        """Join the graph, begin when the others are there and run to the end. Return whether it went well."""
        built = self.join()
        node = self.graph.node(f"{plan.node_label(self._model)}_host")
        if self._real_time:
            who = ExecutionContext(self._model.name)
            self._kernel.spawn(partial(self._begin_with_callees, node, built), "start", who)
        else:
            self._talk_to_run(node, built)
        with self._ending.signals():
            self._pass_time()
        if self._ending.error is not None:
            print(f"volery: {self._ending.error}", file=sys.stderr, flush=True)  # noqa: T201
        return self._ending.status != "failed"

    # -- in a simulation

    def _talk_to_run(self, node: Any, built: BuiltComponents) -> None:
        publisher = node.advertise(TO_RUN, MESSAGE_TYPE, QUEUE)
        self._to_run.publish = lambda message: self._kernel.post(partial(publisher.publish, message))
        group = node.group(lambda work: work.run())
        node.subscribe(TO_COMPONENTS, MESSAGE_TYPE, partial(self._received, built), QUEUE, group)
        self._watch.start()

    def _watch_run(self) -> None:
        """Send ``Ready`` until the run begins; end the component when the run's node has left the graph.

        On ROS 1 the master keeps the node of a run that was killed; there roslaunch ends the component.
        """
        while not self._begun.wait(REPEAT_S):
            self._to_run.send(pipe.Ready())
        absent = 0
        while absent < ABSENT and not self._over.wait(WATCH_S):
            absent = 0 if self._run_is_there() else absent + 1
        self._end("its run is gone")

    def _run_is_there(self) -> bool:
        try:
            return full_node_name(plan.NODE, "/") in self.graph.node_names()
        except (OSError, VoleryError):
            return False  # the ROS master is gone

    def _received(self, built: BuiltComponents, message: Any) -> None:
        content = from_message(message).content
        if isinstance(content, pipe.Begin) and not self._begun.is_set():
            self._begun.set()
            built.start()
        elif isinstance(content, pipe.Stop):
            self._ending.begin("interrupted", content.why)

    def _pass_time(self) -> None:
        if not self._real_time:  # the clock may stop before the end
            self._ending.farewell(ExecutionContext(self._model.name), self._leave_in_time)
        super()._pass_time()

    def _leave_in_time(self) -> None:
        timer = threading.Timer(ORPHAN_S, partial(os._exit, 1))
        timer.daemon = True
        timer.start()
        self._begun.set()
        self._over.set()
        self._watch.join()

    # -- in reality

    def _begin_with_callees(self, node: Any, built: BuiltComponents) -> None:
        for callee in _callees(self._system, self._model):
            for operation in plan.operations(self._system, callee):
                name = plan.service_name(callee, operation)
                while not node.wait_for_service(name, 10 * S):
                    print(f"{self._model.name}: waits for {name}", file=sys.stderr, flush=True)  # noqa: T201
        self._kernel.post(built.start)


def _callees(system: System, model: Instance) -> list[Instance]:
    return [
        system.instance(target.name)
        for connection in model.connections.values()
        for target in connection.targets
        if target.kind is TargetKind.INSTANCE
    ]


def with_parameters(system: System, name: str, file: Path) -> System:
    """Return *system* with the parameters of a YAML file in place of those of the instance *name*.

    Raises:
        ModelError: The file cannot be read, or is no mapping.
    """
    try:
        root = parse(file.read_text(encoding="utf-8"), str(file))
    except (OSError, UnicodeDecodeError) as error:
        raise ModelError(f"{file}: these parameters cannot be read: {error}") from error
    given = root.plain()
    if not isinstance(given, Mapping):
        raise ModelError(f"{file}: a mapping of parameters is expected")

    def changed(one: Instance) -> Instance:
        return replace(one, parameters={**one.parameters, **given}) if one.name == name else one

    return replace(system, instances=tuple(map(changed, system.instances)))


def main(model: Path, name: str, *, graph: str, allocation: str = "", scenario: str = "") -> None:
    """Host the component instance *name* of *model* and end the process.

    The command line of an entry point is read here; what launch files of ROS add is ignored.
    """
    outlive_output()
    parser = argparse.ArgumentParser(description=f"Host the component {name}.")
    parser.add_argument(
        "--simulated", choices=("true", "false"), default="false", help="vehicles and time of a simulation"
    )
    parser.add_argument(
        "--parameters", type=Path, metavar="FILE", help="YAML with parameters of the component"
    )
    parser.add_argument("--scenario", default=scenario, help="scenario of the model")
    given, _ = parser.parse_known_args()
    try:
        system = load(model, vocabulary(), given.scenario or None, allocation or None)
        system = with_executables(system)
        if given.parameters is not None:
            system = with_parameters(system, name, given.parameters)
        system, _ = plan.without_computers(system)
        well = ComponentHost(
            pipe.WorkerOrder(system, name, graph, seed=1), simulated=given.simulated == "true"
        ).run()
    except VoleryError as error:
        print(f"volery: {error}", file=sys.stderr, flush=True)  # noqa: T201
        os._exit(2)
    os._exit(0 if well else 1)  # threads of a client library may be left
