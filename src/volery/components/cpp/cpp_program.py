"""A C++ component as a ``Program``: loaded, constructed and run.

It also answers the requests that any C++ component may make: time, sleep, charges, log, its parameters, its
required ports.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from volery.base.errors import ComponentError, ModelError, UsageError, choices, did_you_mean
from volery.base.position import AMSL, Position
from volery.components import component_api
from volery.components.cpp.build import CompiledComponent, CppOperation, operations
from volery.components.cpp.framework import (
    FiberPool,
    LoadedLibrary,
    ProcessExit,
    StepMeter,
    ToSteps,
    framework_runtime,
)
from volery.components.instance import ForeignError
from volery.components.ports import PortList
from volery.components.virtual_stdlib import EPOCH
from volery.kernel import waiting
from volery.kernel.api import Kernel
from volery.kernel.waiting import Signal, current_task
from volery.ros.client_libraries.abi_codec import CppFiber, Reader, RequestHandler, RequestHandlers, Writer
from volery.trace.events import INFO, Failure, Text
from volery.vehicles import Drone

STICK_FULL_SCALE = 1000
"""Full deflection of a stick in the calls of ``I_RosDron``."""


@dataclass(frozen=True)
class ConnectedPort:
    """A required port: its operations by name, empty for drones, and what it is connected to."""

    operations: Mapping[str, CppOperation]
    targets: Sequence[Any]


def request_handlers(
    kernel: Kernel, name: str, parameters: Mapping[str, Any], ports: Mapping[str, ConnectedPort]
) -> dict[str, RequestHandler]:
    """Return the handlers of the component ``name`` by request.

    Args:
        kernel: The run's kernel.
        name: Name of the instance, for error messages.
        parameters: Parameters of the instance.
        ports: Required ports by name; entries may be added until the first request.
    """
    return {
        **_service_handlers(kernel),
        **_thread_handlers(kernel, name),
        **_port_handlers(name, ports),
        "parameter": _ParameterHandler(name, parameters),
    }


def _service_handlers(kernel: Kernel) -> dict[str, RequestHandler]:
    def now(fiber: CppFiber, arguments: Reader) -> bytes:
        return Writer().real(component_api.now()).done()

    def monotonic(fiber: CppFiber, arguments: Reader) -> bytes:
        return Writer().integer(waiting.read_clock(kernel)).done()

    def time_of_day(fiber: CppFiber, arguments: Reader) -> bytes:
        return Writer().integer(EPOCH + waiting.read_clock(kernel)).done()

    def sleep(fiber: CppFiber, arguments: Reader) -> bytes:
        component_api.sleep(arguments.real())
        return b""

    def sleep_ns(fiber: CppFiber, arguments: Reader) -> bytes:
        waiting.sleep(kernel, arguments.integer())
        return b""

    def add_time(fiber: CppFiber, arguments: Reader) -> bytes:
        seconds, at_mhz, joules = arguments.real(), arguments.real(), arguments.real()
        component_api.add_time(seconds, at_mhz or None, joules)
        return b""

    def log(fiber: CppFiber, arguments: Reader) -> bytes:
        component_api.log(arguments.text(), arguments.text())
        return b""

    def note(fiber: CppFiber, arguments: Reader) -> bytes:
        component_api.note(arguments.text(), arguments.text(), arguments.text(), arguments.text())
        return b""

    def exit_process(fiber: CppFiber, arguments: Reader) -> bytes:
        raise ProcessExit(arguments.integer())

    return {
        "now": now,
        "monotonic": monotonic,
        "time_of_day": time_of_day,
        "sleep": sleep,
        "sleep_ns": sleep_ns,
        "add_time": add_time,
        "log": log,
        "note": note,
        "exit": exit_process,
    }


def _thread_handlers(kernel: Kernel, component: str) -> dict[str, RequestHandler]:
    """Return the handlers of threads, and of the waits for what another thread does."""
    changed = Signal(kernel, f"{component} (a thread)")
    changes = 0

    def thread(fiber: CppFiber, arguments: Reader) -> bytes:
        number = arguments.integer()
        task = current_task(kernel)
        context = replace(task.own, deadline=None, period=None, on_release=None)

        def body() -> None:
            try:
                fiber.call_beside(number)
            except Exception as error:
                kernel.record(Failure(kernel.now(), component, f"a thread raised {error}"))

        kernel.spawn(body, f"{component} (a thread)", context, task.scope)
        return b""

    def block(fiber: CppFiber, arguments: Reader) -> bytes:
        seen, within = arguments.integer(), arguments.integer()
        changed.wait_for(lambda: changes > seen, None if within < 0 else within, ends_activation=True)
        return b""

    def wake(fiber: CppFiber, arguments: Reader) -> bytes:
        nonlocal changes
        changes += 1
        changed.notify()
        return b""

    return {"thread": thread, "block": block, "wake": wake}


class _ParameterHandler:
    """Handler of ``volery::parameter<T>(name)``."""

    def __init__(self, component: str, values: Mapping[str, Any]) -> None:
        self._component, self._values = component, values

    def __call__(self, fiber: CppFiber, arguments: Reader) -> bytes:
        name, kind = arguments.text(), arguments.text()
        if name not in self._values:
            hint = did_you_mean(name, self._values)
            raise UsageError(f"{self._component} has no parameter {name!r}{hint}: {choices(self._values)}")
        value = self._values[name]
        if kind == "float" and type(value) in (int, float):
            return Writer().real(value).done()
        if kind in ("int", "bool") and type(value).__name__ == kind:
            return Writer().integer(value).done()
        if kind == "str" and isinstance(value, str):
            return Writer().text(value).done()
        raise UsageError(f"{self._component}: parameter {name!r} is {value!r}, which is no {kind}")


def _port_handlers(name: str, ports: Mapping[str, ConnectedPort]) -> dict[str, RequestHandler]:
    def connected(fiber: CppFiber, arguments: Reader) -> bytes:
        return Writer().integer(len(ports[arguments.text()].targets)).done()

    def call(fiber: CppFiber, arguments: Reader) -> bytes:
        port = ports[arguments.text()]
        target, operation = port.targets[arguments.integer()], port.operations[arguments.text()]
        values = [kind.read(arguments) for _, kind in operation.arguments]
        result = getattr(target, operation.name)(*values)
        reply = Writer()
        operation.returns.write(reply, result)
        return reply.done()

    def drone(fiber: CppFiber, arguments: Reader) -> bytes:
        commanded = _drone(name, ports, arguments.text(), arguments.integer())
        _DRONE_OPERATIONS[arguments.text()](commanded, Reader(arguments.raw()))
        return b""

    return {"connected": connected, "port": call, "drone": drone}


def _drone(name: str, ports: Mapping[str, ConnectedPort], port: str, index: int) -> Drone:
    """Return the drone at a port; with an empty ``port``, the only drone of the component."""
    drones = [port for port in ports.values() if not port.operations]
    if port:
        target = ports[port].targets[index]
    elif len(drones) == 1 and len(drones[0].targets) == 1:
        target = drones[0].targets[0]
    else:
        count = sum(len(one.targets) for one in drones)
        raise UsageError(
            f"{name}: uc_drone_...() is for a component that commands one drone, but it is connected to "
            f"{count}: require one port of the interface Drone, or take I_RosDron& in the constructor"
        )
    assert isinstance(target, Drone)
    return target


def _go(drone: Drone, arguments: Reader) -> None:
    latitude, longitude, altitude = arguments.real(), arguments.real(), arguments.real()
    drone.goto(Position(latitude, longitude, AMSL(altitude)))


def _joystick(drone: Drone, arguments: Reader) -> None:
    pitch, roll, throttle, yaw = (arguments.integer() / STICK_FULL_SCALE for _ in range(4))
    drone.manual_control(pitch, roll, throttle, yaw)


_DRONE_OPERATIONS: Mapping[str, Callable[[Drone, Reader], None]] = {
    "gps_fly": lambda drone, arguments: drone.takeoff(arguments.real()),
    "gps_go": _go,
    "return_ground": lambda drone, arguments: drone.return_home(),
    "joystick": _joystick,
    "stabilize_fly": lambda drone, arguments: drone.stabilize(),
    "alt_hold_fly": lambda drone, arguments: drone.altitude_hold(),
    "land_ground": lambda drone, arguments: drone.land(),
}


MAKE, RUN, OPERATIONS = range(3)
"""Numbers of a library's first callables, as in ``<volery/abi.h>``."""


class CppObject:
    """A component's object with one Python method for each provided operation."""

    def __init__(self, fibers: FiberPool, provided: Sequence[CppOperation]) -> None:
        self.fibers = fibers
        for number, operation in enumerate(provided):
            setattr(self, operation.name, partial(self._call, OPERATIONS + number, operation))

    def _call(self, number: int, operation: CppOperation, *args: Any, **kwargs: Any) -> Any:
        names = [name for name, _ in operation.arguments]
        given = dict(zip(names, args, strict=False)) | kwargs
        if len(args) > len(names) or given.keys() != set(names):
            raise TypeError(f"{operation.name}() takes {', '.join(names) or 'nothing'}")
        encoded = Writer()
        for name, kind in operation.arguments:
            kind.write(encoded, given[name])
        return operation.returns.read(Reader(self.fibers.call(number, encoded.done())))


class CppProgram:
    """The ``Program`` of an instance in C++.

    Args:
        kernel: The run's kernel.
        name: Name of the instance.
        compiled: The component, compiled for this instance.
        client_library: Begins to use a client library, each time that the component starts: returns request
            handlers, which are added to those of every component, and what is called when ``main`` has
            returned, as the end of a process is noticed by others.
        arguments: Command-line arguments of ``main``, after the name of the program.
    """

    def __init__(
        self,
        kernel: Kernel,
        name: str,
        compiled: CompiledComponent,
        client_library: Callable[[], tuple[RequestHandlers, Callable[[], None]]] | None = None,
        arguments: Sequence[str] = (),
    ) -> None:
        self._kernel = kernel
        self._name = name
        self._compiled = compiled
        self._client_library = client_library
        self._on_exit: Callable[[], None] = lambda: None
        self._arguments = arguments
        self._meter: tuple[StepMeter, ToSteps] | None = None
        self._on_load: Callable[[LoadedLibrary], None] = lambda library: None

    def count(self, meter: StepMeter, to_steps: ToSteps) -> None:
        """Let ``meter`` read the counters of the library, converted by ``to_steps``."""
        self._meter = (meter, to_steps)

    def when_loaded(self, call: Callable[[LoadedLibrary], None]) -> None:
        """Call ``call`` with the library before any of its code runs."""
        self._on_load = call

    def check(self, given: Iterable[str], operations: Iterable[str], active: bool) -> None:
        """See ``Program``. The compiler has already checked what a class must have."""
        component = self._compiled.component
        if component.class_name:
            return
        for operation in operations:
            what = f"a program with a main() cannot provide the operation {operation!r}; state a `class`"
            raise ModelError(what, self._name, component.where)
        if not active:
            what = "a program with a main() runs by itself: state 'active' in the model"
            raise ModelError(what, self._name, component.where)

    def make(self, given: Mapping[str, Any]) -> CppObject:
        """See ``Program``: load the library and construct the object."""
        component = self._compiled.component
        ports = {require.port for require in component.requires}
        parameters = {name: value for name, value in given.items() if name not in ports}
        handlers = request_handlers(self._kernel, self._name, parameters, self._connected(given))
        runtime = framework_runtime(self._compiled.framework)
        library = LoadedLibrary(self._compiled.library, self._name)
        self._on_load(library)
        if self._meter is not None:
            meter, to_steps = self._meter
            meter.read_from(library.counters, to_steps)
        if self._client_library is not None:
            of_library, self._on_exit = self._client_library()
            handlers.update(of_library)
        fibers = FiberPool(runtime, self._name, library.dispatch, handlers, self._record_output)
        fibers.call(MAKE)
        return CppObject(fibers, component.provided)

    def _connected(self, given: Mapping[str, Any]) -> dict[str, ConnectedPort]:
        component = self._compiled.component
        found = {}
        for port in component.requires:
            interface = (component.interfaces or {}).get(port.interface)
            known = {operation.name: operation for operation in operations(interface)} if interface else {}
            connected = given.get(port.port, ())
            targets = list(connected) if isinstance(connected, (PortList, list)) else [connected]
            found[port.port] = ConnectedPort(known, targets)
        return found

    def _record_output(self, text: str) -> None:
        """Record printed lines in the trace and write them to the standard error stream."""
        sys.stderr.write(text)
        now, record = self._kernel.now(), self._kernel.record
        for line in filter(str.strip, text.splitlines()):
            record(Text(now, self._name, INFO, line))

    def run(self, thing: object) -> None:
        """See ``Program``."""
        assert isinstance(thing, CppObject)
        try:
            self._run_to_end(thing)
        except Exception:  # the node leaves once it is known what it has flown
            self._kernel.call_at(self._kernel.now(), self._on_exit)
            raise
        self._on_exit()

    def _run_to_end(self, thing: CppObject) -> None:
        try:
            given = Writer().integer(1 + len(self._arguments))
            for argument in (self._name, *self._arguments):
                given.text(argument)
            returned = thing.fibers.call(RUN, given.done())
            status = Reader(returned).integer() if returned else 0  # run() of a class returns nothing
        except ProcessExit as exited:
            status = exited.status
        except ForeignError as error:
            if self._compiled.component.class_name:
                raise
            raise ComponentError(self._name, f"main() raised {error}") from error
        if status:
            raise ComponentError(self._name, f"ended with exit status {status}")
