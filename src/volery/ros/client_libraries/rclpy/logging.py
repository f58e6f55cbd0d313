"""rclpy's loggers. A line is recorded in the trace under the name of the component."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from functools import partial
from typing import Any, ClassVar

from volery.base.time import Ns, S, from_seconds
from volery.ros.client_libraries.library_base import Caller, Rosout, caller
from volery.ros.client_libraries.rclpy.context import Contexts


class LoggingSeverity(IntEnum):
    """Log levels of rclpy."""

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
    """Logger of node.get_logger() *throttle_duration_sec*, *once*, *skip_first* apply per text."""

    contexts: ClassVar[Contexts]

    def __init__(self, name: str, rosout: Rosout | None = None) -> None:
        self.name = name
        self._rosout = rosout
        self._last: dict[str, Ns] = {}
        self._seen: set[str] = set()

    def get_child(self, name: str) -> Logger:
        """Return a logger below this one."""
        return type(self)(f"{self.name}.{name}", self._rosout)

    def set_level(self, level: int) -> None:
        """Set the lowest severity that this logger and the loggers below it log."""
        self.contexts.levels[self.name] = int(level)

    def get_effective_level(self) -> LoggingSeverity:
        """Return the level of this logger, or that of the nearest logger above that has one."""
        name = self.name
        while name and name not in self.contexts.levels:
            name = name.rpartition(".")[0]
        return LoggingSeverity(self.contexts.levels.get(name, LoggingSeverity.INFO))

    def is_enabled_for(self, severity: int) -> bool:
        """Return whether a line of this severity would be logged."""
        return severity >= self.get_effective_level()

    def log(self, message: Any, severity: int, **options: Any) -> bool:
        """Log a line; return False if it was suppressed."""
        return self._log(message, LoggingSeverity(severity), caller(1), options)

    def _log(self, message: Any, level: LoggingSeverity, where: Caller, options: dict[str, Any]) -> bool:
        text = str(message)
        if level < self.get_effective_level() or self._suppressed(text, options):
            return False
        self.contexts.current().log(_SYSLOG[level], text)
        if self._rosout is not None:
            self._rosout.publish(partial(self._fill, level, text, where))
        return True

    def _fill(self, level: int, text: str, where: Caller, message: Any) -> None:
        message.stamp.sec, message.stamp.nanosec = divmod(self.contexts.now(), S)
        message.level, message.name, message.msg = int(level), self.name, text
        message.file, message.function, message.line = where

    def _suppressed(self, text: str, options: dict[str, Any]) -> bool:
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
        """Log a line for developers."""
        return self._log(message, LoggingSeverity.DEBUG, caller(1), options)

    def info(self, message: Any, **options: Any) -> bool:
        """Log information."""
        return self._log(message, LoggingSeverity.INFO, caller(1), options)

    def warning(self, message: Any, **options: Any) -> bool:
        """Log a warning."""
        return self._log(message, LoggingSeverity.WARN, caller(1), options)

    warn = warning

    def error(self, message: Any, **options: Any) -> bool:
        """Log an error."""
        return self._log(message, LoggingSeverity.ERROR, caller(1), options)

    def fatal(self, message: Any, **options: Any) -> bool:
        """Log a fatal error."""
        return self._log(message, LoggingSeverity.FATAL, caller(1), options)


def functions(loggers: type[Logger]) -> dict[str, Callable[..., Any]]:
    """Return the functions of ``rclpy.logging`` by name."""

    def set_logger_level(name: str, level: int, detailed_error: bool = False) -> None:
        loggers(name).set_level(level)

    def get_logger_effective_level(name: str) -> LoggingSeverity:
        return loggers(name).get_effective_level()

    def get_logger_level(name: str) -> LoggingSeverity:
        return LoggingSeverity(loggers.contexts.levels.get(name, LoggingSeverity.UNSET))

    def get_logging_severity_from_string(log_severity: str) -> LoggingSeverity:
        return LoggingSeverity[log_severity.upper()]

    found: tuple[Any, ...] = (
        set_logger_level,
        get_logger_effective_level,
        get_logger_level,
        get_logging_severity_from_string,
    )
    return {"get_logger": loggers, **{one.__name__: one for one in found}}
