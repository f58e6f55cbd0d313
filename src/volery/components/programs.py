"""Programs of instances, and how an instance starts.

A program makes a component's object: from a class of the user's file, a plain script, or a stub where there
is no file yet. It is checked before anything starts. The object is constructed in the component's own flow of
control, so a constructor may block, call ROS and take time.
"""

from __future__ import annotations

import ast
import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from volery.base.errors import Location, ModelError, choices, did_you_mean
from volery.base.time import Ns
from volery.components.component_api import caller, component_of, register_kernel
from volery.components.entry_points import entry_function
from volery.components.instance import OnFailure, RunningInstance
from volery.components.loader import Loader, ScriptSpace, SourceFile, parse
from volery.kernel.api import Kernel
from volery.kernel.task import Scope, Task
from volery.kernel.waiting import Rate, sleep
from volery.ros.messages import Library

RUN = "run"
ENTRY = "main"
"""The usual name of the function that an entry point calls."""


class InstanceProgram(Protocol):
    """Makes and runs the object of an instance."""

    def check(self, given: Iterable[str], operations: Iterable[str], active: bool) -> None:
        """Raise ``ModelError`` if the program does not fit the model.

        Args:
            given: Names of the constructor's arguments.
            operations: Names of the operations that it must provide.
            active: Whether it must have a flow of control of its own.
        """

    def make(self, given: Mapping[str, Any]) -> object:
        """Construct the object from arguments by name; may block."""

    def run(self, thing: object) -> None:
        """Run the flow of control of an active component."""


class ClassProgram:
    """A plain class: arguments by name, operations as methods, a method ``run`` if it is active."""

    def __init__(self, cls: type, source: SourceFile) -> None:
        self._class = cls
        self._source = source

    def check(self, given: Iterable[str], operations: Iterable[str], active: bool) -> None:
        """See ``InstanceProgram``."""
        self._check_arguments(list(given))
        for operation in operations:
            if not callable(getattr(self._class, operation, None)):
                raise self._error(
                    f"has no method {operation!r}, an operation that it provides{self._nearest(operation)}"
                )
        if active and not callable(getattr(self._class, RUN, None)):
            raise self._error(f"has no method {RUN!r}, but is active")

    def check_signature(self, operation: str, arguments: Sequence[str]) -> None:
        """Raise ``ModelError`` if a method cannot be called with the arguments that the model states.

        Args:
            operation: Name of the operation. A missing method is left to ``check``.
            arguments: Names of its arguments in the model, in order; without any, nothing is checked.
        """
        method = inspect.getattr_static(self._class, operation, None)
        if not arguments or not inspect.isfunction(method):
            return
        signature = inspect.signature(method)
        try:
            signature.bind(None, *arguments)
        except TypeError as error:
            names = [name for name in signature.parameters if name != "self"]
            raise self._error(
                f"{operation}({', '.join(names)}) does not fit the interface's "
                f"{operation}({', '.join(arguments)}): {error}",
                operation,
            ) from error

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
                    f"its constructor requires {parameter.name!r}{did_you_mean(parameter.name, given)}, "
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
        """See ``InstanceProgram``."""
        return self._class(**given)

    def run(self, thing: object) -> None:
        """See ``InstanceProgram``."""
        getattr(thing, RUN)()


class ScriptProgram:
    """A plain script that runs as ``__main__`` in the component's flow of control, without operations.

    Args:
        loader: The run's loader.
        source: The script.
        arguments: Its command-line arguments.
        function: Function that is called after the file has been executed, as an entry point of its package
            does; empty for a file that calls what it defines by itself.
        library: Client library that it is written for.
        as_main: Whether the file is executed as ``__main__``; not, where the model names the function.
    """

    def __init__(
        self,
        loader: Loader,
        source: SourceFile,
        arguments: Sequence[str] = (),
        function: str = "",
        library: Library = "",
        *,
        as_main: bool = True,
    ) -> None:
        self._loader, self._library = loader, library
        self._as_main = as_main
        self._source = source
        self._arguments = arguments
        self._function = function

    def check(self, given: Iterable[str], operations: Iterable[str], active: bool) -> None:
        """See ``InstanceProgram``: a script takes no arguments and provides no operations."""
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
        if not self._function and self._source.only_defines(ENTRY):
            raise ModelError(
                f"it defines {ENTRY}() and calls nothing; state 'main: {ENTRY}' in the model, or an entry "
                "point (console_scripts) in the setup.py, setup.cfg or pyproject.toml of its package",
                where=where,
            )

    def make(self, given: Mapping[str, Any]) -> object:
        """See ``InstanceProgram``."""
        return self

    def run(self, thing: object) -> None:
        """See ``InstanceProgram``."""
        instance = component_of(caller("a script")[1])
        assert instance is not None, "a script runs in the flow of control of its component"
        space = ScriptSpace(self._loader, instance, self._source, self._arguments, self._library)
        space.run(self._function, self._as_main)


def load_program(
    loader: Loader,
    name: str,
    path: Path,
    class_name: str,
    where: Location | None = None,
    *,
    arguments: Sequence[str] = (),
    function: str = "",
    library: Library = "",
) -> InstanceProgram:
    """Load the program of an instance.

    Args:
        loader: The run's loader.
        name: Name of the instance.
        path: File of the component.
        class_name: Class in the file; empty for a script.
        where: Line of the model that names the file.
        arguments: Command-line arguments of a script.
        function: Function of a script that is called; by default, that of its package's entry point.
        library: Client library that the file is written for.

    Raises:
        ModelError: The file is missing, is not Python or does not contain the class or the function.
        ComponentError: The file raises an exception while it is loaded.
    """
    source = parse(path, where)
    if not class_name:
        if function and not source.defines(function):
            raise ModelError(f"no function {function!r}, which 'main' names", where=Location(str(path), 1))
        called = function or ("" if source.is_script() else entry_function(source))
        return ScriptProgram(loader, source, arguments, called, library, as_main=not function)
    _require_class(source, class_name)
    module = loader.load(source, name, library)
    cls = getattr(module, class_name, None)
    if not isinstance(cls, type):
        raise ModelError(
            f"{class_name!r} is not a class", where=Location(str(path), source.line_of(class_name))
        )
    return ClassProgram(cls, source)


def script_or_class(path: Path, class_name: str, where: Location | None = None) -> str:
    """Return the class name of a file that is written for ROS, or "" if it is a script.

    A script has an ``if __name__ == "__main__":``, a ``main`` or an entry point, starts its node at top
    level, or does not contain the class (a component may be called ``Node``, as what its file imports).
    Errors as of ``load_program``.
    """
    source = parse(path, where)
    defined = any(isinstance(node, ast.ClassDef) and node.name == class_name for node in source.tree.body)
    if source.is_script() or source.defines(ENTRY) or source.starts_node() or not defined:
        return ""
    return "" if entry_function(source) else class_name


def load_class(path: Path, class_name: str, loader: Loader | None = None) -> type:
    """Load a class from a file, for tests and tools. Errors as of ``load_program``."""
    source = parse(path)
    _require_class(source, class_name)
    cls: type = getattr((loader or Loader()).load(source, class_name), class_name)
    return cls


def load_function(loader: Loader, path: Path, function: str) -> Any:
    """Load a function from a file, such as a mission. Errors as of ``load_program``."""
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
    instance: RunningInstance,
    program: InstanceProgram,
    given: Mapping[str, Any],
    scope: Scope,
    failed: OnFailure,
) -> Task:
    """Start an instance: construct its object and, if it is active, run it.

    Args:
        instance: The instance.
        program: Its program.
        given: Arguments of the constructor by name.
        scope: Scope of its tasks.
        failed: Called when its flow of control ends with an error; callers of its operations get an error.

    Returns:
        Its task.

    Raises:
        ModelError: The program does not fit the model; nothing has started.
        EstimateError: A figure is missing; nothing has started.
    """
    active = instance.allocation.is_active
    program.check(given, instance.operations, active)
    instance.pricing.check(instance.name, instance.operations, active)
    register_kernel(instance.kernel)
    instance.scope = scope
    instance.on_failure = instance.on_thread_failure = failed

    def body() -> None:
        if not active and (task := instance.kernel.current()) is not None:
            task.is_activated, task.released = False, None  # to be constructed is no response to anything
        made = instance.run_guarded(lambda: instance.set_object(program.make(given)), "its constructor")
        if not made:
            instance.set_unavailable("its constructor has failed")
        elif active:
            kernel = instance.kernel
            with kernel.interact():
                if instance.allocation.starts_at > kernel.now():
                    sleep(kernel, instance.allocation.starts_at - kernel.now())
            instance.run_guarded(lambda: program.run(instance.object), RUN)

    return instance.kernel.spawn(body, instance.name, instance.context, scope)


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
    """Return the neutral value of a model's type: ``""``, 0, False, ``[]`` for ``T[]``, else None."""
    written = returns.strip()
    if written.endswith("[]"):
        return []
    make = _NEUTRAL.get(written)
    return make() if make else None


class Stub:
    """An object whose operations return neutral values. The run charges the stated cost of each."""

    def __init__(self, operations: Mapping[str, str]) -> None:
        for name, returns in operations.items():
            setattr(self, name, partial(self._return_neutral, returns))

    @staticmethod
    def _return_neutral(returns: str, /, *args: object, **kwargs: object) -> object:
        return neutral(returns)


class StubProgram:
    """The program of a component that has no file yet.

    Args:
        kernel: The run's kernel.
        operations: Return type of each operation as the model writes it.
        period: Period of the releases of an active component, ns; without one it is released once.
    """

    def __init__(self, kernel: Kernel, operations: Mapping[str, str], period: Ns | None = None) -> None:
        self._kernel = kernel
        self._operations = operations
        self._period = period

    def check(self, given: Iterable[str], operations: Iterable[str], active: bool) -> None:
        """Accept every model."""

    def make(self, given: Mapping[str, Any]) -> object:
        """Return the stub."""
        return Stub(self._operations)

    def run(self, thing: object) -> None:
        """Wait for the releases."""
        if self._period is None:
            return
        rate = Rate(self._kernel, self._period)
        while True:
            rate.sleep()
