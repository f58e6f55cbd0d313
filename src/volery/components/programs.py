"""The host of Python components: what is to run for an instance, and starting it.

A *program* is what becomes a component's object: a class of the user's file, a plain script, or a stub where
there is no file yet. It is checked before anything starts and made in the component's own flow of control, so
that a constructor may block, call ROS and cost time.

What stands in for a component that has no file yet: takes its stated times, returns neutral values.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Protocol

from volery.base.errors import Location, ModelError, choices, did_you_mean
from volery.base.time import Ns
from volery.components.component_api import register_kernel
from volery.components.instance import Instance, OnFailure
from volery.components.loader import Loader, SourceFile, parse
from volery.kernel.api import Kernel
from volery.kernel.task import Scope, Task
from volery.kernel.waiting import Rate, sleep

RUN = "run"


class Program(Protocol):
    """What becomes the object of an instance."""

    def check(self, given: Iterable[str], operations: Iterable[str], active: bool) -> None:
        """Raise ``ModelError`` if these arguments do not fit, or if it does not provide what it should."""

    def make(self, given: Mapping[str, Any]) -> object:
        """The object; may block."""

    def run(self, thing: object) -> None:
        """The flow of control of an active component."""


class ClassProgram:
    """A class without any base class of ours: arguments by name, operations as methods, ``run`` if it is
    active.
    """

    def __init__(self, cls: type, source: SourceFile) -> None:
        self._class = cls
        self._source = source

    def check(self, given: Iterable[str], operations: Iterable[str], active: bool) -> None:
        """See ``Program``."""
        self._check_arguments(list(given))
        for operation in operations:
            if not callable(getattr(self._class, operation, None)):
                raise self._error(
                    f"has no method {operation!r}, an operation that it provides{self._nearest(operation)}"
                )
        if active and not callable(getattr(self._class, RUN, None)):
            raise self._error(f"has no method {RUN!r}, but is active")

    def _check_arguments(self, given: list[str]) -> None:
        parameters = self._parameters()
        named = [
            parameter.name
            for parameter in parameters
            if parameter.kind in (parameter.POSITIONAL_OR_KEYWORD, parameter.KEYWORD_ONLY)
        ]
        takes_any = any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters)
        for parameter in parameters:
            if (
                parameter.name in named
                and parameter.default is parameter.empty
                and parameter.name not in given
            ):
                raise self._error(
                    f"its constructor asks for {parameter.name!r}{did_you_mean(parameter.name, given)}, "
                    f"but the model gives {choices(given)}",
                    "__init__",
                )
        for name in given:
            if name not in named and not takes_any:
                raise self._error(
                    f"the model gives {name!r}{did_you_mean(name, named)}, "
                    f"but its constructor takes {choices(named)}",
                    "__init__",
                )

    def _parameters(self) -> list[inspect.Parameter]:
        try:
            return list(inspect.signature(self._class).parameters.values())
        except (TypeError, ValueError):
            return []

    def _nearest(self, operation: str) -> str:
        return did_you_mean(operation, [name for name in dir(self._class) if not name.startswith("_")])

    def _error(self, what: str, method: str = "") -> ModelError:
        name = self._class.__name__
        return ModelError(
            f"{name}: {what}", where=Location(str(self._source.path), self._source.line_of(name, method))
        )

    def make(self, given: Mapping[str, Any]) -> object:
        """See ``Program``."""
        return self._class(**given)

    def run(self, thing: object) -> None:
        """See ``Program``."""
        getattr(thing, RUN)()


class ScriptProgram:
    """A plain script, run as ``__main__`` in the component's flow of control. It provides no operations."""

    def __init__(self, loader: Loader, source: SourceFile, name: str) -> None:
        self._loader = loader
        self._source = source
        self._name = name

    def check(self, given: Iterable[str], operations: Iterable[str], active: bool) -> None:
        """See ``Program``: a script takes no arguments and is called by nobody."""
        where = Location(str(self._source.path), 1)
        for name in given:
            raise ModelError(
                f"a script without a class takes no ports and no parameters, but the model gives {name!r}",
                where=where,
            )
        for operation in operations:
            raise ModelError(
                f"a script without a class cannot provide the operation {operation!r}", where=where
            )
        if not active:
            raise ModelError(
                "a script without a class runs by itself: state 'active' in the model", where=where
            )

    def make(self, given: Mapping[str, Any]) -> object:
        """See ``Program``."""
        return self

    def run(self, thing: object) -> None:
        """See ``Program``."""
        self._loader.load(self._source, self._name, as_main=True)


def load_program(
    loader: Loader, name: str, path: Path, class_name: str, where: Location | None = None
) -> Program:
    """What the instance called *name* is to run: *class_name* of the file at *path*.

    With an empty *class_name* the file is a script. ``ModelError`` (at *where*, the line that names the file)
    if it is missing, is no Python or has no such class; ``ComponentError`` if it raises on being loaded.
    """
    source = parse(path, where)
    if not class_name:
        return ScriptProgram(loader, source, name)
    _require_class(source, class_name)
    module = loader.load(source, name)
    cls = getattr(module, class_name, None)
    if not isinstance(cls, type):
        raise ModelError(
            f"{class_name!r} is not a class", where=Location(str(path), source.line_of(class_name))
        )
    return ClassProgram(cls, source)


def script_or_class(path: Path, class_name: str, where: Location | None = None) -> str:
    """Which of the two a file written for ROS is: empty for a script, else *class_name*.

    It is a script if it runs something when it is ``__main__``, or defines no such class. Errors as
    ``load_program``'s.
    """
    source = parse(path, where)
    return "" if source.is_script() or class_name not in source.class_names() else class_name


def load_class(path: Path, class_name: str, loader: Loader | None = None) -> type:
    """*class_name* of the file at *path*, for tests and tools; errors as ``load_program``'s."""
    source = parse(path)
    _require_class(source, class_name)
    cls: type = getattr((loader or Loader()).load(source, class_name), class_name)
    return cls


def load_function(loader: Loader, path: Path, function: str) -> Any:
    """*function* of the file at *path*, for missions: ``def mission(drone: Drone)``. Errors as
    ``load_program``'s.
    """
    source = parse(path)
    module = loader.load(source, path.stem)
    found = getattr(module, function, None)
    if not callable(found):
        there = [
            name
            for name, value in vars(module).items()
            if inspect.isfunction(value) and value.__module__ == module.__name__
        ]
        raise ModelError(f"no function {function!r}; there is {choices(there)}", where=Location(str(path), 1))
    return found


def _require_class(source: SourceFile, class_name: str) -> None:
    names = source.class_names()
    if class_name not in names:
        raise ModelError(
            f"no class {class_name!r}{did_you_mean(class_name, names)}; there is {choices(names)}",
            where=Location(str(source.path), 1),
        )


def start(
    instance: Instance, program: Program, given: Mapping[str, Any], scope: Scope, failed: OnFailure
) -> Task:
    """Start *instance*: construct its object from the arguments *given* and, if it is active, run it.

    Checks first, so that nothing has started when something is
    missing: ``ModelError``, ``EstimateError``. *failed* is told when its flow of control ends with an error;
    whoever calls it meanwhile is told as well.
    """
    active = instance.seat.is_active
    program.check(given, instance.operations, active)
    instance.pricing.check(instance.name, instance.operations, active)
    register_kernel(instance.kernel)
    instance.scope = scope
    instance.failed = failed

    def body() -> None:
        if _construct(instance, program, given) and active:
            sleep(instance.kernel, instance.seat.starts_at - instance.kernel.now())
            instance.guard(lambda: program.run(instance.object), RUN)

    return instance.kernel.spawn(body, instance.name, instance.context, scope)


def _construct(instance: Instance, program: Program, given: Mapping[str, Any]) -> bool:
    done = instance.guard(lambda: instance.complete(program.make(given)), "its constructor")
    if not done:
        instance.give_up("its constructor has failed")
    return done


_NEUTRAL: dict[str, Callable[[], object]] = {
    "bool": bool,
    "int": int,
    "float": float,
    "str": str,
    "bytes": bytes,
    "list": list,
    "dict": dict,
}


def neutral(returns: str) -> object:
    """The neutral value of a type as a model writes it: ``""``, 0, False, an empty list for ``T[]``, else
    ``None``.
    """
    written = returns.strip()
    if written.endswith("[]"):
        return []
    make = _NEUTRAL.get(written)
    return make() if make else None


class Stub:
    """Provides operations that do nothing. The run charges what is stated for each."""

    def __init__(self, operations: Mapping[str, str]) -> None:
        for name, returns in operations.items():
            setattr(self, name, _returning(returns))


def _returning(returns: str) -> Callable[..., object]:
    def operation(*args: object, **kwargs: object) -> object:
        return neutral(returns)

    return operation


class StubProgram:
    """A ``Program`` without a file. *operations* maps each to its return type as the model writes it.

    An active one is released each *period*, or once if it states none.
    """

    def __init__(self, kernel: Kernel, operations: Mapping[str, str], period: Ns | None = None) -> None:
        self._kernel = kernel
        self._operations = operations
        self._period = period

    def check(self, given: Iterable[str], operations: Iterable[str], active: bool) -> None:
        """Fits everything."""

    def make(self, given: Mapping[str, Any]) -> object:
        """The stub."""
        return Stub(self._operations)

    def run(self, thing: object) -> None:
        """Be released each period."""
        if self._period is None:
            return
        rate = Rate(self._kernel, self._period)
        while True:
            rate.sleep()
