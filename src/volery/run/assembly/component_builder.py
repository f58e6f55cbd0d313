"""From a model to its running components: instances, ports, programs, nodes and the vehicles they command."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from volery.base.errors import ModelError, UsageError
from volery.base.position import Position
from volery.components.entry_points import find_executable
from volery.components.instance import RunningInstance
from volery.components.loader import Loader
from volery.components.polling import Polling
from volery.components.ports import ComponentPort, PortList, TrueVehicle
from volery.components.programs import (
    ClassProgram,
    InstanceProgram,
    ScriptProgram,
    StubProgram,
    load_program,
    script_or_class,
)
from volery.components.virtual_stdlib import virtual_modules
from volery.cost import StepCounter, library_table
from volery.kernel.api import Kernel
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.model.components import CPP_LANGUAGES, VEHICLE_INTERFACES, Component, Signature
from volery.model.instances import Instance as InstanceModel
from volery.model.instances import PortConnection, TargetKind
from volery.model.system import System
from volery.model.system_loader import check_code
from volery.ros.client_libraries.importable_modules import importable_modules
from volery.ros.client_libraries.library_base import Launch, node_label
from volery.ros.graph import EmbeddedGraph, Node, RosGraph
from volery.ros.graph.embedded_graph import record_short
from volery.ros.graph.graph_context import Records
from volery.ros.graph.unserved import KnownParticipants
from volery.ros.messages import Library, Workspace, define_imported
from volery.run.assembly.component_ends import ComponentEnds
from volery.run.assembly.computers import ComputingPlatform, commanded_by, is_node
from volery.run.assembly.cpp import CppPrograms, compile_all, is_cpp
from volery.run.assembly.fences import fence_of
from volery.run.assembly.recorded_input import recorded_input
from volery.run.assembly.sensor_node import SensorNode, frames_of
from volery.run.assembly.vehicle_nodes import (
    NAMES_OF,
    NodeNames,
    at_root,
    graph_access,
    names_of,
    node_name,
    serve_on_graph,
    topics_below,
)
from volery.run.ending import Ending, Landable
from volery.trace.events import Unserved
from volery.vehicles import Drone, Rover, Vehicle
from volery.vehicles.driver import drivers

if TYPE_CHECKING:
    from volery.run.assembly.simulated_fleet import SimulatedFleet


class UnattendedVehicle:
    """Vehicle that components command by ROS messages only, without a port.

    At the end of the run it joins *graph* and lands through the driver that ``open_on`` opens there. Earlier,
    it is ``abandoned``: its only commander has failed, so that what it still does is no one's will.
    """

    def __init__(self, graph: RosGraph, name: str, open_on: Callable[[Node], Vehicle]) -> None:
        self.name = name
        self._graph = graph
        self._open_on = open_on
        self._vehicle: Vehicle | None = None
        self.abandoned = False

    def come_to_rest(self) -> str:
        """Land the vehicle if it is armed and no operator controls it. Return what was done."""
        if self._vehicle is None:
            self._vehicle = self._open_on(self._graph.node(f"safety_of_{self.name}"))
            self._vehicle.wait_connected()
        if self.abandoned:
            self._vehicle.take_over()
        return self._vehicle.come_to_rest()


INTERFACES = {kind: interface for interface, kind in VEHICLE_INTERFACES.items()}
"""By the kind of vehicle."""

PYTHON_ROS = ("rospy", "rclpy")
"""Languages whose files import ROS message packages."""


class LateBoundProgram:
    """Program whose object also gets values that are made in its own task.

    ``connect`` joins the graph, and the component is charged for it.
    """

    def __init__(
        self, program: InstanceProgram, names: Iterable[str], connect: Callable[[], Mapping[str, Any]]
    ) -> None:
        self._program = program
        self._names = tuple(names)
        self._connect = connect

    def check(self, given: Iterable[str], operations: Iterable[str], active: bool) -> None:
        """See ``InstanceProgram``."""
        self._program.check([*given, *self._names], operations, active)

    def make(self, given: Mapping[str, Any]) -> object:
        """See ``InstanceProgram``."""
        return self._program.make({**given, **self._connect()})

    def run(self, thing: object) -> None:
        """See ``InstanceProgram``."""
        self._program.run(thing)


@dataclass(frozen=True)
class BuiltComponents:
    """Components that are ready to start.

    ``starters`` are in the order of the model. ``finish`` is called when all components have ended.
    """

    starters: tuple[Callable[[], object], ...]
    loader: Loader
    instances: Mapping[str, RunningInstance]
    doubts: tuple[str, ...] = ()
    unserved: Callable[[], list[Unserved]] = list
    finish: Callable[[], None] = lambda: None

    def start(self) -> None:
        """Start all components. Each starter was made, and checked, before the first one starts."""
        for starter in self.starters:
            starter()

    def warnings(self) -> list[str]:
        """Return what the counting of code has left out, and doubts about it."""
        if self.loader.steps is None:
            return list(self.doubts)
        return [*self.doubts, *library_warnings(self.loader.steps, self.loader.libraries)]


def library_warnings(steps: StepCounter, imported: Collection[str]) -> list[str]:
    """Return what is known of the time that components spent in libraries.

    Args:
        steps: Counter of the run.
        imported: Libraries that were imported.
    """
    found = []
    calls = steps.libraries
    priced = calls.libraries if calls is not None else frozenset()
    unknown = sorted(set(imported) - priced)
    if unknown:
        what = f"what components computed inside libraries was not counted: {', '.join(unknown)}"
        found.append(f"{what}; state it with volery.add_time()")
    if calls is not None and calls.steps:
        shares = [
            f"{name} {spent / max(steps.taken, 1):.0%} ({_error_words(name)})"
            for name, spent in sorted(calls.steps.items())
        ]
        found.append(f"share of library calls in the counted time, by a table: {', '.join(shares)}")
    if calls is not None and calls.unpriced:
        names = [f"{name} ({count})" for name, count in sorted(calls.unpriced.items())]
        found.append(f"calls without an entry of their own in that table: {', '.join(names)}")
    return found


def _error_words(library: str) -> str:
    error = library_table().error_of(library)
    programs = "one program" if error.programs == 1 else f"{error.programs} programs"
    return f"error {error.mean:.0%} on average, {error.worst:.0%} at worst over {programs}"


Truth = Callable[[], Position]
"""Returns the true position of a vehicle."""


@dataclass(frozen=True)
class ProcessPart:
    """Part of a model that one process runs.

    Attributes:
        graph: The real graph.
        instances: Instances of this process.
        reach: ``reach(caller, callee)`` returns the port of an instance of this process to one of another.
        nodes: Nodes that already exist, by the names of their instances.
        truth: Returns the function for the true position of a vehicle.
    """

    graph: RosGraph
    instances: tuple[InstanceModel, ...]
    reach: Callable[[InstanceModel, InstanceModel], ComponentPort]
    nodes: Mapping[str, Node] = field(default_factory=dict)
    truth: Callable[[str], Truth] | None = None


class Builder:
    """Builder of the components of one run, or of the *part* of it in this process.

    Without a *fleet* the vehicles are in another process. *records* is that of ``EmbeddedGraph``.
    """

    def __init__(
        self,
        system: System,
        kernel: Kernel,
        platform: ComputingPlatform,
        fleet: SimulatedFleet | None,
        ending: Ending,
        *,
        part: ProcessPart | None = None,
        records: Records = record_short,
    ) -> None:
        self._system = system
        self._kernel = kernel
        self._platform = platform
        self._fleet = fleet
        self._ending = ending
        self._fence = fence_of(system.environment)
        self._part = part
        self._truth = fleet.truth if fleet else part.truth if part else None
        self._models = part.instances if part else system.instances
        self._graph: RosGraph = (
            part.graph if part else EmbeddedGraph(kernel, platform.tariff, platform.route, records=records)
        )
        self._nodes: dict[str, Node] = dict(part.nodes) if part else {}
        self._landable: dict[str, Landable] = {}
        self._instances: dict[str, RunningInstance] = {}
        self._ends = ComponentEnds(kernel, self._graph, ending, self._commanded_alone)
        self._served: dict[str, str] = {}  # the kind of names of each vehicle that has a node

    def build(self, fidelity: str, seed: int, traces: Path | None = None) -> BuiltComponents:
        """Load every file, create every instance, connect every port.

        Raises:
            ModelError: A file is missing or does not fit its component.
        """
        check_code(replace(self._system, instances=self._models))
        steps = StepCounter(libraries=library_table()) if fidelity != "times" else None
        workspace = Workspace()
        for model in self._system.instances:  # the trace has the messages of other processes, too
            if model.component.path and model.component.language in PYTHON_ROS:
                define_imported(self._system.file_of(model.component), workspace)
        launches = self._launches()
        ready = compile_all(self._system, self._models, fidelity, traced=traces is not None)
        self._cpp = CppPrograms(self._kernel, self._graph, ready, launches, self._nodes, traces)
        modules = importable_modules(self._graph, launches, self._nodes, self._ending.farewell)
        loader = Loader(
            {**virtual_modules(self._kernel, seed), **modules},
            steps,
            Polling(self._kernel, counts=steps is None) if isinstance(self._kernel, VirtualKernel) else None,
            workspace=workspace,
            host=self._ends,
        )
        self._instances = {model.name: self._instance(model, steps) for model in self._models}
        starters = (
            *self._vehicle_nodes(),
            *self._inputs(),
            *(self._starter(model, loader) for model in self._models),
        )
        doubts = tuple(self._cpp.warnings(self._models))
        return BuiltComponents(starters, loader, self._instances, doubts, self._unserved, self._cpp.finish)

    def _unserved(self) -> list[Unserved]:
        """Return what the components waited for in vain on the embedded graph."""
        if not isinstance(self._graph, EmbeddedGraph):
            return []
        served = {name: node for name, node in self._served.items() if node}
        without = [vehicle.name for vehicle in self._system.vehicles if vehicle.name not in served]
        return self._graph.unserved(KnownParticipants(self._instances, served, without))

    def _launches(self) -> dict[str, Launch]:
        """Return the launch settings of the nodes of this process.

        A node that nothing names has its file's name. It has the instance's where several instances run one
        file in one namespace, and where it exists before the file runs, to command vehicles.
        """
        launches = {
            instance.name: self._launch(instance) for instance in self._system.instances if is_node(instance)
        }
        alike = Counter((launch.arguments[0], launch.namespace) for launch in launches.values())
        found = {}
        for model in self._models:
            launch = launches.get(model.name)
            if launch is not None:
                several = alike[launch.arguments[0], launch.namespace] > 1
                kept = model.name if several or commanded_by(model) else ""
                found[model.name] = launch._replace(node_name=launch.node_name or kept)
        return found

    def _launch(self, model: InstanceModel) -> Launch:
        stated = Launch(model.namespace, model.remap, dict(model.parameters), node_name=model.node_name)
        return stated.given(
            (str(self._system.file_of(model.component)), *model.arguments),
            ros=2 if "rcl" in model.component.language else 1,
        )

    def _instance(self, model: InstanceModel, steps: StepCounter | None) -> RunningInstance:
        return RunningInstance(
            self._kernel,
            model.name,
            self._platform.allocation(model),
            self._platform.pricing(model),
            tuple(self._operations(model)),
            self._cpp.meters.get(model.name) or (steps.take if steps else None),
        )

    def _operations(self, model: InstanceModel) -> dict[str, str]:
        """Return the operations that an instance provides, with the type that each returns."""
        return {name: one.returns for name, one in provided_operations(self._system, model).items()}

    def _starter(self, model: InstanceModel, loader: Loader) -> Callable[[], object]:
        instance = self._instances[model.name]
        if model.component.language == "python":
            instance.join_graph = partial(self._join, model)
        program = self._program(model, loader)
        given = self._given(model)
        if not isinstance(program, ScriptProgram):  # a script reads its parameters from ROS
            given = {**model.parameters, **given}
        if commanded_by(model):
            commands = [
                connection
                for connection in model.connections.values()
                if _kind(connection) is TargetKind.VEHICLE
            ]
            names = [command.port for command in commands]
            program = LateBoundProgram(program, names, lambda: self._connect(model, commands))
        return self._ends.starter(instance, model.component.on_failure, program, given)

    def _commanded_alone(self, component: str) -> list[Landable]:
        """Return the vehicles that a component commands, by its ports or by topics, and no other one does."""
        others = [model for model in self._models if model.name != component and self._ends.runs(model.name)]
        by_ports = {name for other in others for name in commanded_by(other)}
        found = []
        for name, vehicle in self._landable.items():
            commanders = self._publishers_to(name)
            flown = component in commanders or name in commanded_by(self._system.instance(component))
            if flown and name not in by_ports and not commanders & {other.name for other in others}:
                if isinstance(vehicle, UnattendedVehicle):
                    vehicle.abandoned = True
                found.append(vehicle)
        return found

    def _publishers_to(self, vehicle: str) -> set[str]:
        """Return the components that publish topics in the names of a vehicle."""
        if not isinstance(self._graph, EmbeddedGraph):
            return set()
        namespace = graph_access(self._autopilot(vehicle), vehicle).namespace.rstrip("/")
        below = f"{'' if self._at_root(vehicle) else namespace}/{topics_below(self._served[vehicle])}"
        nodes = {
            name
            for topic in self._graph.topics()
            if topic.name.startswith(below)
            for name in topic.publishers
        }
        return {
            model.name
            for model in self._models
            if any(node.name in nodes for node in self._graph.nodes_of(model.name))
        }

    def _program(self, model: InstanceModel, loader: Loader) -> InstanceProgram:
        component = model.component
        if not component.path or (is_cpp(component) and model.name not in self._cpp):
            period = model.activity.period_ns if model.activity else None
            return StubProgram(self._kernel, self._operations(model), period)
        if is_cpp(component):
            return self._cpp.program(model)
        return python_program(self._system, model, loader)

    # -- ports

    def _given(self, model: InstanceModel) -> dict[str, Any]:
        """Return the connected objects by port, except for the vehicles that the instance commands."""
        found: dict[str, Any] = {}
        for connection in model.connections.values():
            kind = _kind(connection)
            if kind is TargetKind.ENVIRONMENT:
                found[connection.port] = self._system.environment
            elif kind is TargetKind.INSTANCE:
                ports = [self._port(model, target.name) for target in connection.targets]
                found[connection.port] = PortList(ports) if connection.many else ports[0]
            elif kind is TargetKind.VEHICLE and model.is_environment:
                bodies = [self._body(target.name) for target in connection.targets]
                found[connection.port] = bodies if connection.many else bodies[0]
        return found

    def _body(self, vehicle: str) -> TrueVehicle:
        assert self._fleet is not None, "components of the environment are in the process of the vehicles"
        return TrueVehicle(self._kernel, vehicle, self._fleet.truth(vehicle))

    def _port(self, model: InstanceModel, callee: str) -> ComponentPort:
        other = self._system.instance(callee)
        if self._part is not None and callee not in self._instances:
            return self._part.reach(model, other)
        here, there = model.processor, other.processor
        return ComponentPort(
            self._kernel,
            model.name,
            self._instances[callee],
            self._platform.travel(here, there),
            self._platform.travel(there, here),
        )

    def _connect(self, model: InstanceModel, commands: Iterable[PortConnection]) -> dict[str, Any]:
        """Join the graph and return the vehicles that the instance commands, by port."""
        node = self._join(model)
        found: dict[str, Any] = {}
        for connection in commands:
            vehicles = [
                self._vehicle(node, target.name, connection.interface) for target in connection.targets
            ]
            found[connection.port] = vehicles if connection.many else vehicles[0]
        return found

    def _join(self, model: InstanceModel) -> Node:
        """Return the node of an instance, which joins the graph with the first call, in its own task."""
        node = self._nodes.get(model.name)
        if node is None:
            label = node_label(model.node_name or model.name)
            node = self._graph.node(label, model.namespace, remaps=model.remap)
            self._nodes[model.name] = node
        return node

    def _vehicle(self, node: Node, name: str, interface: str) -> Drone | Rover:
        vehicle = self._open(node, name, interface)
        self._landable.setdefault(name, vehicle)  # its first commander lands it at the end
        self._ending.vehicles = tuple(self._landable.values())
        return vehicle

    def _open(self, node: Node, name: str, interface: str) -> Drone | Rover:
        vehicle = next(vehicle for vehicle in self._system.vehicles if vehicle.name == name)
        served = graph_access(vehicle.autopilot, name)
        home = drivers.load(vehicle.autopilot).home_options(vehicle.at.position)
        driver = served.open_driver(self._kernel, node, name, {"namespace": served.namespace, **home})
        truth = self._truth(name) if self._truth else None
        if interface == "Drone":
            return Drone(self._kernel, name, driver, fence=self._fence, truth=truth)
        return Rover(self._kernel, name, driver, truth=truth)

    # -- nodes that serve vehicles

    def _vehicle_nodes(self) -> Iterable[Callable[[], object]]:
        if self._fleet is None:
            return
        commanded = {name for model in self._system.instances for name in commanded_by(model)}
        for vehicle in self._system.vehicles:
            if vehicle.name in commanded or vehicle.processor is not None:
                graph_access(vehicle.autopilot, vehicle.name)  # raises before anything starts
                codec = self._fleet.family(vehicle.name).codec
                self._served[vehicle.name] = names_of(vehicle, codec, vehicle.name in commanded)
                if vehicle.name not in commanded:
                    self._add_unattended(vehicle.name, INTERFACES[vehicle.kind])
                yield partial(self._serve, self._fleet, vehicle.name, vehicle.processor)
            elif vehicle.added_sensors:
                context = ExecutionContext(node_name(vehicle.name), None)
                yield self._sensor_node(self._fleet, vehicle.name, context).serve

    def _inputs(self) -> Iterable[Callable[[], object]]:
        if self._fleet is not None:  # in the process of the world
            for stated in self._system.environment.inputs:
                yield recorded_input(self._system, stated, self._graph)

    def _add_unattended(self, name: str, interface: str) -> None:
        opened: Callable[[Node], Vehicle] = partial(self._open, name=name, interface=interface)
        if self._on_link_at_end(name):
            opened = partial(self._open_on_link, name=name, interface=interface)
        self._landable[name] = UnattendedVehicle(self._graph, name, opened)
        self._ending.vehicles = tuple(self._landable.values())

    def _on_link_at_end(self, name: str) -> bool:
        """Return whether a vehicle is landed over its link, because its names are not those of its driver."""
        assert self._fleet is not None, "vehicles are served in the process that simulates them"
        codec = self._fleet.family(name).codec
        return codec is not None and self._served[name] != NAMES_OF[codec.name][0]

    def _open_on_link(self, _: Node, name: str, interface: str) -> Drone | Rover:
        assert self._fleet is not None, "vehicles are served in the process that simulates them"
        open_driver = drivers.load(self._autopilot(name)).on_link
        assert open_driver is not None, "MAVLink is spoken on links"
        driver = open_driver(self._kernel, self._fleet.link(name), name, {})
        kind = Drone if interface == "Drone" else Rover
        return kind(self._kernel, name, driver)

    def _autopilot(self, vehicle: str) -> str:
        return next(one.autopilot for one in self._system.vehicles if one.name == vehicle)

    def _at_root(self, vehicle: str) -> bool:
        [found] = [one for one in self._system.vehicles if one.name == vehicle]
        return at_root(found, self._system.vehicles)

    def _serve(self, fleet: SimulatedFleet, name: str, processor: str | None) -> None:
        """Serve a vehicle in the root scope: its node outlives the components, for the landing."""
        context = ExecutionContext(
            node_name(name), self._platform.processors.get(processor) if processor else None
        )
        access = graph_access(self._autopilot(name), name)
        ros2 = any(model.component.language == "rclpy" for model in self._system.instances)
        sensors = self._sensor_node(fleet, name, context)
        names = NodeNames(self._served[name], ros2, not sensors.moves_frames, self._at_root(name))
        serve_on_graph(self._graph, fleet, name, access, context, names)
        sensors.serve()

    def _sensor_node(self, fleet: SimulatedFleet, name: str, context: ExecutionContext) -> SensorNode:
        vehicle = next(vehicle for vehicle in self._system.vehicles if vehicle.name == name)
        prefix = frames_of(self._system.vehicles).get(name, "")
        return SensorNode(self._graph, fleet.flights[name], vehicle, context, fleet.alterations[name], prefix)


def with_executables(system: System) -> System:
    """Return the system with the files of components that the model names by package and executable.

    Raises:
        ModelError: There is no such package or program.
    """
    workspace = Workspace(system.folder)
    found: dict[str, Component] = {}
    for component in (instance.component for instance in system.instances):
        if not (component.package or component.executable) or component.path:
            continue
        if not (component.package and component.executable):
            what = "'package' and 'executable' belong together"
            raise ModelError(what, f"components.{component.name}", component.where)
        try:
            file, function = find_executable(
                workspace,
                component.package,
                component.executable,
                system.folder / "model.yaml",
                cpp=component.language in CPP_LANGUAGES,
            )
        except UsageError as error:
            raise ModelError(str(error), f"components.{component.name}.package", component.where) from error
        found[component.name] = replace(component, path=str(file), main=component.main or function)
    if not found:
        return system
    instances = (
        replace(instance, component=found.get(instance.component.name, instance.component))
        for instance in system.instances
    )
    return replace(system, instances=tuple(instances))


def python_program(system: System, model: InstanceModel, loader: Loader) -> InstanceProgram:
    """Load the Python file of an instance, and check its operations against the interfaces.

    Raises:
        ModelError: The file is missing, is not Python, or an operation does not take its arguments.
        ComponentError: The file raises an exception while it is loaded.
    """
    component = model.component
    path = system.file_of(component)
    chosen = component.class_name
    if component.main:
        chosen = ""
    elif component.language in PYTHON_ROS and not component.stated_class:
        chosen = script_or_class(path, chosen, component.where)
    library = component.language if component.language in PYTHON_ROS else ""
    program = load_program(
        loader,
        model.name,
        path,
        chosen,
        component.where,
        arguments=model.arguments,
        function=component.main,
        library=cast("Library", library),
    )
    if isinstance(program, ClassProgram):
        for signature in provided_operations(system, model).values():
            program.check_signature(signature.name, [argument.name for argument in signature.arguments])
    return program


def provided_operations(system: System, model: InstanceModel) -> dict[str, Signature]:
    """Return the operations that an instance provides, by name."""
    return {
        name: signature
        for interface in model.component.provides.values()
        for name, signature in system.interfaces[interface].operations.items()
    }


def _kind(connection: PortConnection) -> TargetKind | None:
    """Return the kind of a connection's targets, which is the same for all of them."""
    return connection.targets[0].kind if connection.targets else None
