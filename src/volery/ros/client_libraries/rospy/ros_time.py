"""rospy's ``Time``, ``Duration``, ``Rate`` and ``Timer``."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple, Self

from volery.base.errors import UsageError
from volery.base.time import Ns, S, from_seconds
from volery.ros.client_libraries.rospy.session import Session, Sessions
from volery.ros.messages import message_class
from volery.ros.messages.stamp import nanoseconds

_TimeMessage: Any = message_class("builtin_interfaces/msg/Time")
_DurationMessage: Any = message_class("builtin_interfaces/msg/Duration")


def as_ns(value: Any) -> Ns:
    """Return a number of seconds, or a ``Duration``, in ns."""
    if isinstance(value, (int, float)):
        return from_seconds(value)
    return nanoseconds(value)


def _parts(secs: float, nsecs: int) -> tuple[int, int]:
    whole = _truncated(secs) if isinstance(secs, float) else secs * S
    return divmod(whole + nsecs, S)


def _truncated(seconds: float) -> Ns:
    """Return seconds in ns, truncated as by genpy: integer and fractional part separately."""
    whole = int(seconds)
    return whole * S + int((seconds - whole) * S)


class Time(_TimeMessage):  # type: ignore[misc]  # the class is made when this module is loaded
    """A point in ROS time: ``Time(secs, nsecs)``, ``Time.now()``, ``Time.from_sec(float)``."""

    __slots__ = ()
    sessions: ClassVar[Sessions]

    def __init__(self, secs: float = 0, nsecs: int = 0) -> None:
        super().__init__(*_parts(secs, nsecs))

    @classmethod
    def now(cls) -> Self:
        """Return the current time."""
        return cls(0, cls.sessions.now())

    @classmethod
    def from_sec(cls, seconds: float) -> Self:
        """Return the value of seconds, truncated as by genpy."""
        return cls(0, _truncated(seconds))

    from_seconds = from_sec


class Duration(_DurationMessage):  # type: ignore[misc]  # the class is made when this module is loaded
    """A duration: ``Duration(secs, nsecs)``, ``Duration.from_sec(float)``."""

    __slots__ = ()

    def __init__(self, secs: float = 0, nsecs: int = 0) -> None:
        super().__init__(*_parts(secs, nsecs))

    @classmethod
    def from_sec(cls, seconds: float) -> Self:
        """Return the value of seconds, truncated as by genpy."""
        return cls(0, _truncated(seconds))

    from_seconds = from_sec


class Rate:
    """Keeps a loop at a frequency of *hz*."""

    sessions: ClassVar[Sessions]

    def __init__(self, hz: float, reset: bool = False) -> None:
        if hz <= 0:
            raise UsageError(f"rospy.Rate({hz}): give a frequency above 0 Hz")
        self._session = self.sessions.initialised()
        period = int(S / hz)  # truncated, as by rospy
        self.sleep_dur = Duration(0, period)
        self._rate = self._session.node.rate(period)

    def remaining(self) -> Duration:
        """Return the time until the next release."""
        return Duration(0, self._rate.remaining())

    def sleep(self) -> None:
        """Block until the next release; raise ``ROSInterruptException`` at shutdown."""
        self._session.check()
        self._rate.sleep()
        self._session.check()


class TimerEvent(NamedTuple):
    """Argument of the callback of a ``Timer``."""

    last_expected: Time | None
    last_real: Time | None
    current_expected: Time
    current_real: Time
    last_duration: float | None


class Timer:
    """Calls *callback* each *period* in a thread of its own."""

    sessions: ClassVar[Sessions]

    def __init__(
        self, period: Any, callback: Callable[[TimerEvent], Any], oneshot: bool = False, reset: bool = False
    ) -> None:
        self._session = self.sessions.initialised()
        self._period = as_ns(period)
        self._callback = callback
        self._oneshot = oneshot
        self._expected = self._session.node.now() + self._period
        self._last: TimerEvent | None = None
        self._took: float | None = None
        name = getattr(callback, "__name__", "callback")
        group = self._session.spinning_group("timer", f"timer {name}")
        self._timer = self._session.node.timer(self._period, self._fire, group)

    def _fire(self) -> None:
        now = self._session.node.now()
        last = self._last
        event = TimerEvent(
            last.current_expected if last else None,
            last.current_real if last else None,
            Time(0, self._expected),
            Time(0, now),
            self._took,
        )
        self._last = event
        self._expected += self._period * max(1, (now - self._expected) // self._period + 1)
        if self._oneshot:
            self._timer.cancel()
        self._callback(event)
        self._took = (self._session.node.now() - now) / S

    def shutdown(self) -> None:
        """Stop the timer."""
        self._timer.cancel()


def sleep(session: Session, duration: Any) -> None:
    """Block for a number of seconds or a ``Duration``; raise ``ROSInterruptException`` at shutdown."""
    session.check()
    session.node.sleep(as_ns(duration))
    session.check()
