"""rclpy's loggers: a line goes into the trace under the component's name."""

from __future__ import annotations

from enum import IntEnum
from typing import Any, ClassVar

from volery.base.time import Ns, from_seconds
from volery.faces.rclpy.context import Contexts


class LoggingSeverity(IntEnum):
    """rclpy's levels."""

    UNSET = 0
    DEBUG = 10
    INFO = 20
    WARN = 30
    ERROR = 40
    FATAL = 50


_SYSLOG = {
    LoggingSeverity.DEBUG: 7,
    LoggingSeverity.INFO: 6,
    LoggingSeverity.WARN: 4,
    LoggingSeverity.ERROR: 3,
    LoggingSeverity.FATAL: 2,
}


class Logger:
    """``node.get_logger()``. *throttle_duration_sec*, *once* and *skip_first* work per text."""

    contexts: ClassVar[Contexts]

    def __init__(self, name: str) -> None:
        self.name = name
        self._level = LoggingSeverity.INFO
        self._last: dict[str, Ns] = {}
        self._seen: set[str] = set()

    def get_child(self, name: str) -> Logger:
        """A logger below this one."""
        return type(self)(f"{self.name}.{name}")

    def set_level(self, level: int) -> None:
        """Log nothing that is less severe."""
        self._level = LoggingSeverity(level)

    def get_effective_level(self) -> LoggingSeverity:
        """What is logged at least."""
        return self._level

    def is_enabled_for(self, severity: int) -> bool:
        """Whether a line of that severity would be logged."""
        return severity >= self._level

    def log(self, message: Any, severity: int, **options: Any) -> bool:
        """Log a line; False if it was left out."""
        level = LoggingSeverity(severity)
        text = str(message)
        if level < self._level or self._left_out(text, options):
            return False
        self.contexts.here().say(_SYSLOG[level], text)
        return True

    def _left_out(self, text: str, options: dict[str, Any]) -> bool:
        first = text not in self._seen
        if options.get("once") and not first:
            return True
        if options.get("once") or options.get("skip_first"):
            self._seen.add(text)
        if options.get("skip_first") and first:
            return True
        period = options.get("throttle_duration_sec")
        if period is None:
            return False
        now, last = self.contexts.now(), self._last.get(text)
        if last is not None and now - last < from_seconds(period):
            return True
        self._last[text] = now
        return False

    def debug(self, message: Any, **options: Any) -> bool:
        """For developers."""
        return self.log(message, LoggingSeverity.DEBUG, **options)

    def info(self, message: Any, **options: Any) -> bool:
        """For everybody."""
        return self.log(message, LoggingSeverity.INFO, **options)

    def warning(self, message: Any, **options: Any) -> bool:
        """Something may be wrong."""
        return self.log(message, LoggingSeverity.WARN, **options)

    warn = warning

    def error(self, message: Any, **options: Any) -> bool:
        """Something is wrong."""
        return self.log(message, LoggingSeverity.ERROR, **options)

    def fatal(self, message: Any, **options: Any) -> bool:
        """It cannot go on."""
        return self.log(message, LoggingSeverity.FATAL, **options)
