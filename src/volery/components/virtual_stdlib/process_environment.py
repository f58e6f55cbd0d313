"""Replacements of ``time``, ``datetime``, ``random`` and ``print``, by which a process uses its environment.

Time is the time of the run; local time is UTC on every machine. Each component has a named stream of random
numbers, seeded from the run's seed. Printed text becomes lines of the trace and goes to the standard error
stream, since the standard output belongs to the program that runs the components.
"""

from __future__ import annotations

import builtins as real_builtins
import datetime as real_datetime
import random as real_random
import sys
import time as real_time
from collections.abc import Mapping
from io import StringIO
from types import ModuleType
from typing import Any, NoReturn

from volery.base.errors import choices
from volery.base.seeds import stream
from volery.base.time import Ns, S, from_seconds, to_seconds
from volery.kernel import waiting
from volery.kernel.api import Kernel
from volery.trace.events import INFO, Text

_PURE = ("struct_time", "strptime", "asctime", "timezone", "tzname")
_DRAWS = (
    "betavariate", "binomialvariate", "choice", "choices", "expovariate", "gammavariate", "gauss",
    "getrandbits", "getstate", "lognormvariate", "normalvariate", "paretovariate", "randbytes", "randint",
    "random", "randrange", "sample", "seed", "setstate", "shuffle", "triangular", "uniform",
    "vonmisesvariate", "weibullvariate",
)  # fmt: skip


def make_module(name: str, names: Mapping[str, Any]) -> ModuleType:
    """Return a module with exactly the given names; any other raises an ``AttributeError`` with a reason."""
    module = ModuleType(name, f"Replaces {name} in the files of a run's components.")
    module.__dict__.update(names)

    def missing(attribute: str) -> NoReturn:
        raise AttributeError(
            f"{name}.{attribute} is not available in the files of components, where time is the run's; "
            f"there is {choices(key for key in names if not key.startswith('_'))}"
        )

    module.__dict__["__getattr__"] = missing
    return module


class _Clock:
    def __init__(self, kernel: Kernel, epoch: Ns) -> None:
        self._kernel = kernel
        self._epoch = epoch

    def monotonic_ns(self) -> Ns:
        """Return the time since the start of the run. This is an interaction point."""
        return waiting.read_clock(self._kernel)

    def monotonic(self) -> float:
        return to_seconds(self.monotonic_ns())

    def time_ns(self) -> Ns:
        return self._epoch + self.monotonic_ns()

    def time(self) -> float:
        return self.time_ns() / S

    def sleep(self, seconds: float) -> None:
        if seconds < 0:
            raise ValueError("sleep length must be non-negative")
        waiting.sleep(self._kernel, from_seconds(seconds))

    def gmtime(self, seconds: float | None = None) -> real_time.struct_time:
        return real_time.gmtime(self.time() if seconds is None else seconds)

    def ctime(self, seconds: float | None = None) -> str:
        return real_time.asctime(self.gmtime(seconds))

    def strftime(self, form: str, when: Any = None) -> str:
        return real_time.strftime(form, self.gmtime() if when is None else when)


def time_module(kernel: Kernel, epoch: Ns) -> ModuleType:
    """Return the replacement of ``time``."""
    clock = _Clock(kernel, epoch)
    names: dict[str, Any] = {name: getattr(real_time, name) for name in _PURE}
    names.update(timezone=0, tzname=("UTC", "UTC"), daylight=0, altzone=0)
    for name in ("monotonic", "monotonic_ns", "time", "time_ns", "sleep", "gmtime", "ctime", "strftime"):
        names[name] = getattr(clock, name)
    names["localtime"] = clock.gmtime
    names["perf_counter"] = clock.monotonic
    names["perf_counter_ns"] = clock.monotonic_ns
    return make_module("time", names)


def datetime_module(kernel: Kernel, epoch: Ns) -> ModuleType:
    """Return the replacement of ``datetime``: ``now``, ``utcnow`` and ``today`` on the clock of the run."""
    clock = _Clock(kernel, epoch)

    class RunDatetime(real_datetime.datetime):
        @classmethod
        def now(cls, tz: real_datetime.tzinfo | None = None) -> RunDatetime:
            utc = cls.fromtimestamp(clock.time(), real_datetime.UTC)
            return utc.astimezone(tz) if tz is not None else utc.replace(tzinfo=None)

        @classmethod
        def utcnow(cls) -> RunDatetime:
            return cls.now()

        @classmethod
        def today(cls) -> RunDatetime:
            return cls.now()

    class RunDate(real_datetime.date):
        @classmethod
        def today(cls) -> RunDate:
            now = RunDatetime.now()
            return cls(now.year, now.month, now.day)

    RunDatetime.__name__ = RunDatetime.__qualname__ = "datetime"
    RunDate.__name__ = RunDate.__qualname__ = "date"
    names = {name: value for name, value in vars(real_datetime).items() if not name.startswith("_")}
    return make_module("datetime", {**names, "datetime": RunDatetime, "date": RunDate})


def random_module(kernel: Kernel, seed: int) -> ModuleType:
    """Return the replacement of ``random``.

    Each component has a stream, created when it first draws; the component is that of the current task.
    ``Random()`` without a seed takes one from the component's stream.
    """
    streams: dict[str, real_random.Random] = {}

    def own_stream() -> real_random.Random:
        task = kernel.current()
        component = task.context.component if task is not None else ""
        if component not in streams:
            streams[component] = stream(seed, f"component {component}")
        return streams[component]

    class Random(real_random.Random):
        def __init__(self, x: Any = None) -> None:
            super().__init__(own_stream().getrandbits(64) if x is None else x)

    def drawing(name: str) -> Any:
        def draw(*args: Any, **kwargs: Any) -> Any:
            return getattr(own_stream(), name)(*args, **kwargs)

        draw.__name__ = name
        return draw

    names: dict[str, Any] = {name: drawing(name) for name in _DRAWS if hasattr(real_random.Random, name)}
    return make_module("random", {**names, "Random": Random, "SystemRandom": Random})


def record_output(kernel: Kernel, text: str) -> None:
    """Write text that a component prints, and record it as a line of the trace."""
    sys.stderr.write(text)
    with kernel.interact():
        task = kernel.current()
        if task is not None and text.strip():
            kernel.record(Text(kernel.now(), task.context.component, INFO, text.rstrip()))


def _exit(code: object = None) -> NoReturn:
    """Raise ``SystemExit``, as ``exit`` and ``quit`` do."""
    raise SystemExit(code)


def builtins_module(kernel: Kernel) -> ModuleType:
    """Return the replacement of ``builtins``, which is also used for names without an import."""

    def record_print(
        *values: Any, sep: str | None = " ", end: str | None = "\n", file: Any = None, flush: bool = False
    ) -> None:
        if file is not None:
            real_builtins.print(*values, sep=sep, end=end, file=file, flush=flush)
            return
        written = StringIO()
        real_builtins.print(*values, sep=sep, end=end, file=written)
        record_output(kernel, written.getvalue())

    module = ModuleType("builtins", real_builtins.__doc__)
    module.__dict__.update(vars(real_builtins), print=record_print, exit=_exit, quit=_exit)
    return module
