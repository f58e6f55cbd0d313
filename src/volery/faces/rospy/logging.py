"""rospy's log functions: a line goes into the trace under the component's name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from volery.base.time import Ns, from_seconds
from volery.faces.rospy.session import Sessions
from volery.kernel.waiting import current_task
from volery.trace.events import Text

LEVELS = {"DEBUG": 1, "INFO": 2, "WARN": 4, "ERROR": 8, "FATAL": 16}
_SEVERITIES = {"debug": 7, "info": 6, "warn": 4, "err": 3, "error": 3, "fatal": 2}


class _Log:
    """The log functions of one severity."""

    def __init__(self, sessions: Sessions, severity: int) -> None:
        self._sessions, self._severity = sessions, severity
        self._said: dict[tuple[str, str], Ns] = {}

    def _component(self) -> str:
        return current_task(self._sessions.kernel).place.component

    def say(self, msg: Any, *args: Any, **options: Any) -> None:
        """Log ``msg % args``."""
        text = str(msg) % args if args else str(msg)
        with self._sessions.kernel as kernel:
            kernel.record(Text(kernel.now(), self._component(), self._severity, text))

    def throttle(self, period: float, msg: Any, *args: Any) -> None:
        """Log the same *msg* at most once each *period* seconds."""
        with self._sessions.kernel as kernel:
            key = (self._component(), str(msg))
            last = self._said.get(key)
            if last is not None and kernel.now() - last < from_seconds(period):
                return
            self._said[key] = kernel.now()
        self.say(msg, *args)

    def once(self, msg: Any, *args: Any) -> None:
        """Log the same *msg* once."""
        key = (self._component(), str(msg))
        if key not in self._said:
            self._said[key] = 0
            self.say(msg, *args)


def loggers(sessions: Sessions) -> dict[str, Callable[..., None]]:
    """``loginfo``, ``logwarn_throttle`` and so on."""
    found: dict[str, Callable[..., None]] = {}
    for name, severity in _SEVERITIES.items():
        log = _Log(sessions, severity)
        found[f"log{name}"] = log.say
        found[f"log{name}_throttle"] = log.throttle
        found[f"log{name}_once"] = log.once
    return found
