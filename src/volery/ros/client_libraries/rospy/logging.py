"""rospy's log functions. A line is recorded in the trace under the name of the component."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from volery.base.time import Ns, S, from_seconds
from volery.ros.client_libraries.library_base import Caller, caller
from volery.ros.client_libraries.rospy.session import Sessions
from volery.trace.events import Text

LEVELS = {"DEBUG": 1, "INFO": 2, "WARN": 4, "ERROR": 8, "FATAL": 16}
_FUNCTIONS = {
    "debug": (1, 7),
    "info": (2, 6),
    "warn": (4, 4),
    "err": (8, 3),
    "error": (8, 3),
    "fatal": (16, 2),
}
"""Level in ROS 1 and severity in syslog by the name of the function."""


class _Log:
    """The log functions of one severity."""

    def __init__(self, sessions: Sessions, level: int, severity: int) -> None:
        self._sessions, self._level, self._severity = sessions, level, severity
        self._last: dict[tuple[str, str], Ns] = {}

    def log(self, msg: Any, *args: Any, **options: Any) -> None:
        """Log ``msg % args``."""
        self._log(msg, args, caller(1))

    def _log(self, msg: Any, args: tuple[Any, ...], where: Caller) -> None:
        text = str(msg) % args if args else str(msg)
        with self._sessions.kernel as kernel:
            kernel.record(Text(kernel.now(), self._sessions.component, self._severity, text))
        session = self._sessions.find()
        if session is None or self._level < LEVELS["INFO"]:
            return
        node = session.node

        def fill(message: Any) -> None:
            now = node.now()
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(now, S)
            message.level, message.name, message.msg = self._level, node.name, text
            message.file, message.function, message.line = where

        session.rosout.publish(fill)

    def throttle(self, period: float, msg: Any, *args: Any) -> None:
        """Log the same *msg* at most once each *period* seconds."""
        with self._sessions.kernel as kernel:
            key = (self._sessions.component, str(msg))
            last = self._last.get(key)
            if last is not None and kernel.now() - last < from_seconds(period):
                return
            self._last[key] = kernel.now()
        self._log(msg, args, caller(1))

    def once(self, msg: Any, *args: Any) -> None:
        """Log the same *msg* once."""
        key = (self._sessions.component, str(msg))
        if key not in self._last:
            self._last[key] = 0
            self._log(msg, args, caller(1))

    def throttle_identical(self, period: float, msg: Any, *args: Any) -> None:
        """Log the same text at most once each *period* seconds."""
        self.throttle(period, str(msg) % args if args else msg)


def loggers(sessions: Sessions) -> dict[str, Callable[..., None]]:
    """Return ``loginfo``, ``logwarn_throttle`` and so on by name."""
    found: dict[str, Callable[..., None]] = {}
    for name, (level, severity) in _FUNCTIONS.items():
        log = _Log(sessions, level, severity)
        found[f"log{name}"] = log.log
        found[f"log{name}_throttle"] = log.throttle
        found[f"log{name}_throttle_identical"] = log.throttle_identical
        found[f"log{name}_once"] = log.once
    return found
