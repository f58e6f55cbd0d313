"""A C++ component as a ``Program``: loaded, constructed and run."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

from volery.base.errors import ComponentError, ModelError
from volery.components.cpp.answers import Connected, answers
from volery.components.cpp.build import Compiled
from volery.components.cpp.errors import CppError, Exited
from volery.components.cpp.flow import Flows, house
from volery.components.cpp.interfaces import Operation, operations
from volery.components.cpp.library import Library
from volery.components.cpp.meter import Meter, Worth
from volery.components.ports import PortList
from volery.components.stand_ins.words import INFO
from volery.kernel.api import Kernel
from volery.ros.client_libraries.wire import Answers, Reader, Writer
from volery.trace.events import Text

MAKE, RUN, OPERATIONS = range(3)
"""The first callables of a library, as in ``<volery/border.h>``."""


class CppObject:
    """A component's object as the rest of the house sees it: one method for each provided operation."""

    def __init__(self, flows: Flows, provided: Sequence[Operation]) -> None:
        self.flows = flows
        for number, operation in enumerate(provided):
            setattr(self, operation.name, partial(_call, flows, OPERATIONS + number, operation))


def _call(flows: Flows, number: int, operation: Operation, *args: Any, **kwargs: Any) -> Any:
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
        compiled: Compiled,
        more: Answers | None = None,
        on_end: Callable[[], None] | None = None,
    ) -> None:
        self._kernel = kernel
        self._name = name
        self._compiled = compiled
        self._more = more or {}
        self._on_end = on_end
        self._meter: tuple[Meter, Worth] | None = None
        self._on_load: Callable[[Library], None] = lambda library: None

    def count(self, meter: Meter, worth: Worth) -> None:
        """Have *meter* read what the code counts, as *worth* says."""
        self._meter = (meter, worth)

    def when_loaded(self, told: Callable[[Library], None]) -> None:
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
        known = answers(self._kernel, self._name, parameters, self._connected(given))
        runtime = house(self._compiled.house)
        library = Library(self._compiled.library, self._name)
        self._on_load(library)
        if self._meter is not None:
            meter, worth = self._meter
            meter.read_from(library.counters, worth)
        flows = Flows(runtime, self._name, library.dispatch, {**known, **self._more}, self._hear)
        flows.call(MAKE)
        return CppObject(flows, component.provided)

    def _connected(self, given: Mapping[str, Any]) -> dict[str, Connected]:
        component = self._compiled.component
        found = {}
        for port in component.requires:
            interface = (component.interfaces or {}).get(port.interface)
            known = {one.name: one for one in operations(interface)} if interface else {}
            there = given.get(port.port, ())
            targets = list(there) if isinstance(there, (PortList, list)) else [there]
            found[port.port] = Connected(known, targets)
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
        except Exited as left:
            status = left.status
        except CppError as error:
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
