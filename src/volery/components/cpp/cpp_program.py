"""A C++ component as a ``Program``: loaded, constructed and run."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

from volery.base.errors import ComponentError, ModelError
from volery.components.cpp.bindings import CppOperation, operations
from volery.components.cpp.build import CompiledComponent
from volery.components.cpp.framework import (
    CppError,
    FiberPool,
    LoadedLibrary,
    ProcessExit,
    StepMeter,
    ToSteps,
    framework_runtime,
)
from volery.components.cpp.framework_calls import ConnectedPort, request_handlers
from volery.components.ports import PortList
from volery.components.virtual_stdlib.process_environment import INFO
from volery.kernel.api import Kernel
from volery.ros.client_libraries.abi_codec import Reader, RequestHandlers, Writer
from volery.trace.events import Text

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
        client_library: Request handlers of a client library, added to those of every component.
        on_exit: Called when ``main`` has returned, as the end of a process is noticed by others.
    """

    def __init__(
        self,
        kernel: Kernel,
        name: str,
        compiled: CompiledComponent,
        client_library: RequestHandlers | None = None,
        on_exit: Callable[[], None] | None = None,
    ) -> None:
        self._kernel = kernel
        self._name = name
        self._compiled = compiled
        self._client_library = client_library or {}
        self._on_exit = on_exit
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
        ports = {one.port for one in component.requires}
        parameters = {name: value for name, value in given.items() if name not in ports}
        handlers = request_handlers(self._kernel, self._name, parameters, self._connected(given))
        runtime = framework_runtime(self._compiled.framework)
        library = LoadedLibrary(self._compiled.library, self._name)
        self._on_load(library)
        if self._meter is not None:
            meter, to_steps = self._meter
            meter.read_from(library.counters, to_steps)
        handlers.update(self._client_library)
        fibers = FiberPool(runtime, self._name, library.dispatch, handlers, self._record_output)
        fibers.call(MAKE)
        return CppObject(fibers, component.provided)

    def _connected(self, given: Mapping[str, Any]) -> dict[str, ConnectedPort]:
        component = self._compiled.component
        found = {}
        for port in component.requires:
            interface = (component.interfaces or {}).get(port.interface)
            known = {one.name: one for one in operations(interface)} if interface else {}
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
            returned = thing.fibers.call(RUN, Writer().text(self._name).done())
            status = Reader(returned).integer() if returned else 0  # run() of a class returns nothing
        except ProcessExit as exited:
            status = exited.status
        except CppError as error:
            if self._compiled.component.class_name:
                raise
            raise ComponentError(self._name, f"main() raised {error}") from error
        if self._on_exit is not None:
            self._on_exit()
        if status:
            raise ComponentError(self._name, f"ended with exit status {status}")
