"""``time`` and ``datetime`` on the clock of the run. Local time is UTC, on every machine."""

from __future__ import annotations

import datetime as real_datetime
import time as real_time
from types import ModuleType
from typing import Any

from volery.base.time import Ns, S, from_seconds, to_seconds
from volery.components.stand_ins.module import make_module
from volery.kernel import waiting
from volery.kernel.api import Kernel

_PURE = ("struct_time", "strptime", "asctime", "timezone", "tzname")


class _Clock:
    def __init__(self, kernel: Kernel, epoch: Ns) -> None:
        self._kernel = kernel
        self._epoch = epoch

    def monotonic_ns(self) -> Ns:
        """Since the start of the run. An interaction point."""
        with self._kernel as kernel:
            return kernel.now()

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
    """Stands in for ``time``."""
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
    """Stands in for ``datetime``: ``now``, ``utcnow`` and ``today`` on the clock of the run."""
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
