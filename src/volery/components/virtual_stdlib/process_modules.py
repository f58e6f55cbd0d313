"""Modules of a script, which is a process: ``sys``, ``os``, ``signal``, ``argparse``, ``unittest`` ...

They are Python's own where a script cannot reach beyond itself. Its arguments, its search path, its output,
its signals and its end are its own.
"""

from __future__ import annotations

import atexit as real_atexit
import builtins
import importlib as real_importlib
import importlib.util
import inspect as real_inspect
import os as real_os
import signal as real_signal
import sys as real_sys
import unittest as real_unittest
import zlib
from collections.abc import Callable, Sequence
from io import TextIOBase
from types import FrameType, ModuleType, SimpleNamespace
from typing import Any, NoReturn

from volery.base.errors import UsageError
from volery.base.time import to_seconds
from volery.components.virtual_stdlib.process_environment import make_module, record_output
from volery.kernel import waiting
from volery.kernel.api import Kernel

READ_ARGUMENTS = ("argparse", "optparse")
"""Modules of Python that read ``sys.argv``: each process has its own copy."""

_BELOW_IMPORTLIB = ("abc", "machinery", "metadata", "resources", "util")
_NO_SIGNALS = ("alarm", "setitimer", "getitimer", "sigwait", "sigtimedwait", "pthread_kill", "set_wakeup_fd")
_Handler = Callable[[int, FrameType | None], Any]


class RefusedProcess:
    """Base of the names of ``multiprocessing``: a class may derive from them, but none can be made."""

    def __init__(self, *args: object, **kwargs: object) -> None:
        raise UsageError(
            f"{type(self).__name__} of multiprocessing is not available to a component, which is one "
            "process: use threading, or make another component"
        )


class Output(TextIOBase):
    """Standard output or standard error of a process: each line is recorded, as what ``print`` writes."""

    encoding = "utf-8"

    def __init__(self, kernel: Kernel) -> None:
        self._kernel = kernel
        self._begun = ""

    def writable(self) -> bool:
        """Return True."""
        return True

    def write(self, text: str) -> int:
        """Record the lines that *text* ends."""
        *lines, self._begun = (self._begun + text).split("\n")
        for line in lines:
            record_output(self._kernel, f"{line}\n")
        return len(text)

    def finish(self) -> None:
        """Record the last line, if it has no end."""
        if self._begun:
            self.write("\n")


class ProcessModules:
    """The modules of one process, by name.

    Args:
        kernel: The run's kernel.
        name: Name of the component.
        arguments: ``sys.argv``: the path of the script and its arguments.
        path: ``sys.path``; the first entry is the script's folder.
        at_end: Registers what is called when the process or the run ends, the last one first.
        leave: Ends the process at once, with an exit status.
        import_module: ``importlib.import_module`` of the process.
    """

    def __init__(
        self,
        kernel: Kernel,
        name: str,
        *,
        arguments: Sequence[str],
        path: list[str],
        at_end: Callable[[Callable[[], object]], None],
        leave: Callable[[int], None],
        import_module: Callable[..., ModuleType],
    ) -> None:
        self._kernel = kernel
        self._pid = 10_000 + zlib.crc32(name.encode()) % 20_000
        self._at_end = at_end
        self._leave = leave
        self._import_module = import_module
        self._exits: list[tuple[Callable[..., object], tuple[Any, ...], dict[str, Any]]] = []
        self._handlers: dict[int, Any] = {}
        self.over = False  # no signal reaches it any more
        self.output, self.errors = Output(kernel), Output(kernel)
        self.sys = _changed(
            real_sys,
            argv=list(arguments),
            path=path,
            modules=dict(real_sys.modules),
            stdout=self.output,
            stderr=self.errors,
        )
        below = {
            f"importlib.{one}": real_importlib.import_module(f"importlib.{one}") for one in _BELOW_IMPORTLIB
        }
        self._modules = {
            "sys": self.sys,
            "os": self._os(),
            "os.path": real_os.path,
            "signal": self._signal(),
            "atexit": _changed(real_atexit, register=self._register, unregister=self._unregister),
            "importlib": _changed(real_importlib, import_module=import_module),
            "inspect": _changed(real_inspect, getmodule=self._module_of),
            **below,
        }

    def get(self, name: str) -> ModuleType | None:
        """Return the module of this process, or None if it is that of the run."""
        if name in READ_ARGUMENTS and name not in self._modules:
            self._modules[name] = _private_copy(name, self.sys)
        if name == "unittest" and name not in self._modules:
            self._modules[name] = self._unittest()
        return self._modules.get(name)

    def finish(self) -> None:
        """Complete its output; handlers of signals are not called any more."""
        self.over = True
        self.output.finish()
        self.errors.finish()

    def _unittest(self) -> ModuleType:
        """Return ``unittest`` whose ``main`` runs the tests of this process, in its arguments and time."""
        runner, program = (_private_copy(f"unittest.{one}", self.sys) for one in ("runner", "main"))
        vars(runner)["time"] = SimpleNamespace(perf_counter=lambda: to_seconds(self._kernel.now()))
        vars(program)["runner"] = runner
        of_program = {one: vars(program)[one] for one in ("main", "TestProgram")}
        return _changed(real_unittest, **of_program, TextTestRunner=vars(runner)["TextTestRunner"])

    # -- atexit

    def _register(self, function: Callable[..., object], /, *args: Any, **kwargs: Any) -> Any:
        if not self._exits:
            self._at_end(self._run_exits)
        self._exits.append((function, args, kwargs))
        return function

    def _unregister(self, function: Callable[..., object]) -> None:
        self._exits[:] = [one for one in self._exits if one[0] != function]

    def _run_exits(self) -> None:
        while self._exits:
            function, args, kwargs = self._exits.pop()
            function(*args, **kwargs)

    # -- os

    def _module_of(self, object: Any, _filename: str | None = None) -> ModuleType | None:  # noqa: A002 - Python's
        """Return the module that defines an object: of a message class the package's ``msg``."""
        name = getattr(object, "__module__", None) or ""
        above = name.rpartition(".")[0]
        if above.rpartition(".")[2] in ("msg", "srv", "action"):
            return self._import_module(above)
        module: ModuleType | None = self.sys.modules.get(name) or real_inspect.getmodule(object, _filename)
        return module

    def _os(self) -> ModuleType:
        environment = dict(real_os.environ)
        return _changed(
            real_os,
            _exit=self._exit,
            abort=lambda: self._exit(134),
            getpid=lambda: self._pid,
            kill=self._kill,
            fork=_refuse("os.fork", "a component is one process; make another component"),
            environ=environment,
            getenv=environment.get,
        )

    def _exit(self, status: int) -> NoReturn:
        kernel = self._kernel
        with kernel.interact():
            self._leave(status)
            while True:
                kernel.park(None, "os._exit")

    def _kill(self, pid: int, number: int) -> None:
        if pid != self._pid:
            raise ProcessLookupError(
                f"os.kill({pid}): a component reaches no process but its own ({self._pid})"
            )
        self._deliver(number)

    # -- signal

    def _signal(self) -> ModuleType:
        names = {name: value for name, value in vars(real_signal).items() if not name.startswith("__")}
        refused = {
            name: _refuse(
                f"signal.{name}", "use a timer of ROS or threading.Timer, which run in virtual time"
            )
            for name in _NO_SIGNALS
        }
        changed = {
            "signal": self._set_handler,
            "getsignal": self._handler,
            "raise_signal": self._deliver,
            "siginterrupt": lambda number, flag: None,
            "pause": lambda: waiting.Signal(self._kernel, "signal.pause").wait_for(lambda: False),
        }
        return make_module("signal", {**names, **refused, **changed})

    def _handler(self, number: int) -> Any:
        return self._handlers.get(number, real_signal.getsignal(number) if number else None)

    def _set_handler(self, number: int, handler: _Handler | int) -> Any:
        if not self._handlers:
            self._at_end(self._interrupt)
        before = self._handlers.get(number, real_signal.SIG_DFL)
        self._handlers[number] = handler
        return before

    def _interrupt(self) -> None:
        """Deliver what a launcher sends at the end of a run: SIGINT, or SIGTERM if that is handled only."""
        if not self.over:
            number = next(
                (one for one in (real_signal.SIGINT, real_signal.SIGTERM) if one in self._handlers), 0
            )
            if callable(self._handlers.get(number)):
                self._deliver(number)

    def _deliver(self, number: int) -> None:
        handler = self._handlers.get(number, real_signal.SIG_DFL)
        if callable(handler):
            handler(number, None)
        elif handler == real_signal.SIG_DFL and number == real_signal.SIGINT:
            raise KeyboardInterrupt
        elif handler == real_signal.SIG_DFL and number not in (0, real_signal.SIGCHLD, real_signal.SIGCONT):
            self._exit(128 + number)


def _changed(module: ModuleType, **names: Any) -> ModuleType:
    """Return a copy of a module of Python with other values of some names."""
    made = ModuleType(module.__name__, module.__doc__)
    made.__dict__.update({**vars(module), **names})
    return made


def _refuse(what: str, instead: str) -> Callable[..., NoReturn]:
    def refused(*args: object, **kwargs: object) -> NoReturn:
        raise UsageError(f"{what} is not available to a component: {instead}")

    return refused


def _private_copy(name: str, own_sys: ModuleType) -> ModuleType:
    """Return a copy of a module of Python that uses another ``sys``. Its code is not counted."""

    def import_(wanted: str, *args: Any, **kwargs: Any) -> ModuleType:
        if wanted in ("sys", "__main__"):
            return own_sys if wanted == "sys" else own_sys.modules["__main__"]
        return builtins.__import__(wanted, *args, **kwargs)

    spec = importlib.util.find_spec(name)
    loader: Any = None if spec is None else spec.loader
    made = ModuleType(name)
    made.__dict__["__builtins__"] = {**vars(builtins), "__import__": import_}
    exec(loader.get_code(name), made.__dict__)
    return made
