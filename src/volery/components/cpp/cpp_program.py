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
    CppException,
    FiberPool,
    LoadedLibrary,
    ProcessExit,
    StepMeter,
    ToSteps,
    framework_runtime,
)
from volery.components.cpp.framework_calls import ConnectedPort, request_handlers
from volery.components.ports import PortList
from volery.components.virtual_stdlib.environment import INFO
from volery.kernel.api import Kernel
from volery.ros.client_libraries.abi_codec import Reader, RequestHandlers, Writer
from volery.trace.events import Text

MAKE, RUN, OPERATIONS = range(3)
"""The first callables of a library, as in ``<volery/border.h>``."""


class CppObject:
    """A component's object as the rest of the house sees it: one method for each provided operation."""

    def __init__(self, flows: FiberPool, provided: Sequence[CppOperation]) -> None:
        self.flows = flows
        for number, operation in enumerate(provided):
            setattr(self, operation.name, partial(_call, flows, OPERATIONS + number, operation))


def _call(flows: FiberPool, number: int, operation: CppOperation, *args: Any, **kwargs: Any) -> Any:
    names = [name for name, _ in operation.arguments]
    given = dict(zip(names, args, strict=False)) | kwargs
    if len(args) > len(names) or given.keys() != set(names):
        raise TypeError(f"{operation.name}() takes {', '.join(names) or 'nothing'}")
    written = Writer()
    for name, kind in operation.arguments:
        kind.write(written, given[name])
    return operation.returns.read(Reader(flows.call(number, written.done())))


class CppProgram:
    """See ``Program``. Made of a component that was compiled for the instance called *name*.

    *more* is what a client library answers beside what any component may ask. *on_end* is called when a
    program of its own has returned from ``main``, as a process's end would be noticed. *meter* and *worth*
    count what it computes, where its library counts itself.
    """

    def __init__(
        self,
        kernel: Kernel,
        name: str,
        compiled: CompiledComponent,
        more: RequestHandlers | None = None,
        on_end: Callable[[], None] | None = None,
    ) -> None:
        self._kernel = kernel
        self._name = name
        self._compiled = compiled
        self._more = more or {}
        self._on_end = on_end
        self._meter: tuple[StepMeter, ToSteps] | None = None
        self._on_load: Callable[[LoadedLibrary], None] = lambda library: None

    def count(self, meter: StepMeter, worth: ToSteps) -> None:
        """Have *meter* read what the code counts, as *worth* says."""
        self._meter = (meter, worth)

    def when_loaded(self, told: Callable[[LoadedLibrary], None]) -> None:
        """*told* is given the library before any of its code has run."""
        self._on_load = told

    def check(self, given: Iterable[str], operations: Iterable[str], active: bool) -> None:
        """See ``Program``. What a class must have is the compiler's to say."""
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
        """See ``Program``: loads the library and constructs the user's object."""
        component = self._compiled.component
        ports = {one.port for one in component.requires}
        parameters = {name: value for name, value in given.items() if name not in ports}
        known = request_handlers(self._kernel, self._name, parameters, self._connected(given))
        runtime = framework_runtime(self._compiled.house)
        library = LoadedLibrary(self._compiled.library, self._name)
        self._on_load(library)
        if self._meter is not None:
            meter, worth = self._meter
            meter.read_from(library.counters, worth)
        flows = FiberPool(runtime, self._name, library.dispatch, {**known, **self._more}, self._hear)
        flows.call(MAKE)
        return CppObject(flows, component.provided)

    def _connected(self, given: Mapping[str, Any]) -> dict[str, ConnectedPort]:
        component = self._compiled.component
        found = {}
        for port in component.requires:
            interface = (component.interfaces or {}).get(port.interface)
            known = {one.name: one for one in operations(interface)} if interface else {}
            there = given.get(port.port, ())
            targets = list(there) if isinstance(there, (PortList, list)) else [there]
            found[port.port] = ConnectedPort(known, targets)
        return found

    def _hear(self, text: str) -> None:
        """What it prints becomes lines of the trace, and goes to the standard error stream."""
        sys.stderr.write(text)
        now, record = self._kernel.now(), self._kernel.record
        for line in filter(str.strip, text.splitlines()):
            record(Text(now, self._name, INFO, line))

    def run(self, thing: object) -> None:
        """See ``Program``."""
        assert isinstance(thing, CppObject)
        try:
            status = _status(thing.flows.call(RUN, Writer().text(self._name).done()))
        except ProcessExit as left:
            status = left.status
        except CppException as error:
            if self._compiled.component.class_name:
                raise
            raise ComponentError(self._name, f"main() raised {error}") from error
        if self._on_end is not None:
            self._on_end()
        if status:
            raise ComponentError(self._name, f"ended with exit status {status}")


def _status(returned: bytes) -> int:
    """What ``main`` returned; a class's ``run`` returns nothing."""
    return Reader(returned).integer() if returned else 0
