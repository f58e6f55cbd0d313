"""rclpy's ``Time``, ``Duration``, ``Clock`` and ``Rate`` over the time of the graph."""

from __future__ import annotations

from enum import IntEnum
from functools import total_ordering
from typing import Any, ClassVar

from volery.base.time import Ns, S, from_seconds
from volery.ros.client_libraries.rclpy.context import (
    Context,
    Contexts,
    NotInitializedException,
    ROSInterruptException,
)
from volery.ros.messages.client_classes import RCLPY, message_of
from volery.ros.messages.message import nanoseconds
from volery.ros.messages.store import distribution

_TimeMessage: Any = message_of("builtin_interfaces/msg/Time", RCLPY)
_DurationMessage: Any = message_of("builtin_interfaces/msg/Duration", RCLPY)


class ClockType(IntEnum):
    """The clock that a time was read from. On the embedded graph all clocks show the time of the graph."""

    ROS_TIME = 1
    SYSTEM_TIME = 2
    STEADY_TIME = 3


_LARGEST: Ns = (1 << 63) - 1
ADDS_DURATIONS = distribution() not in ("humble", "iron", "jazzy")
"""Whether durations have arithmetic, as from Kilted on."""


def _total_ns(seconds: float, nanoseconds_: float, what: str) -> Ns:
    total = (from_seconds(seconds) if isinstance(seconds, float) else seconds * S) + int(nanoseconds_)
    if not -_LARGEST - 1 <= total <= _LARGEST:
        raise OverflowError(f"Total nanoseconds value is too large to store in C {what}.")
    return total


@total_ordering
class Duration:
    """A duration, which may be negative."""

    def __init__(self, *, seconds: float = 0, nanoseconds: float = 0) -> None:
        self.nanoseconds: Ns = _total_ns(seconds, nanoseconds, "duration")

    def __repr__(self) -> str:
        return f"Duration(nanoseconds={self.nanoseconds})"

    def __str__(self) -> str:
        return f"{self.nanoseconds} nanoseconds"

    __hash__: Any = None

    def __eq__(self, other: object) -> bool:
        return self.nanoseconds == other.nanoseconds if isinstance(other, Duration) else NotImplemented

    def __lt__(self, other: object) -> bool:
        return self.nanoseconds < other.nanoseconds if isinstance(other, Duration) else NotImplemented

    def __add__(self, other: Any) -> Duration:
        if not (isinstance(other, Duration) and ADDS_DURATIONS):
            return NotImplemented
        return Duration(nanoseconds=self.nanoseconds + other.nanoseconds)

    def __sub__(self, other: Any) -> Duration:
        if not (isinstance(other, Duration) and ADDS_DURATIONS):
            return NotImplemented
        return Duration(nanoseconds=self.nanoseconds - other.nanoseconds)

    def __mul__(self, factor: float) -> Duration:
        if not (isinstance(factor, int | float) and ADDS_DURATIONS):
            return NotImplemented
        return Duration(nanoseconds=round(self.nanoseconds * factor))

    def to_msg(self) -> Any:
        """Return the duration as ``builtin_interfaces/msg/Duration``."""
        seconds, rest = divmod(self.nanoseconds, S)
        return _DurationMessage(sec=seconds, nanosec=rest)

    @classmethod
    def from_msg(cls, msg: Any) -> Duration:
        """Return the duration in a ``builtin_interfaces/msg/Duration``."""
        return cls(nanoseconds=nanoseconds(msg))


Infinite = Duration(nanoseconds=(1 << 63) - 1)


@total_ordering
class Time:
    """A point in time. Times of different clocks can be neither compared nor subtracted."""

    def __init__(
        self, *, seconds: float = 0, nanoseconds: float = 0, clock_type: ClockType = ClockType.SYSTEM_TIME
    ) -> None:
        self.nanoseconds: Ns = _total_ns(seconds, nanoseconds, "time point")
        self.clock_type = ClockType(clock_type)
        if self.nanoseconds < 0:
            raise ValueError("Seconds value must not be negative")

    def __repr__(self) -> str:
        return f"Time(nanoseconds={self.nanoseconds}, clock_type={self.clock_type.name})"

    __hash__: Any = None

    def seconds_nanoseconds(self) -> tuple[int, int]:
        """Return seconds and remaining nanoseconds."""
        return divmod(self.nanoseconds, S)

    def _check(self, other: Time) -> None:
        if other.clock_type is not self.clock_type:
            raise TypeError("Can't compare times with different clock types")

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Time):
            return NotImplemented
        self._check(other)
        return self.nanoseconds == other.nanoseconds

    def __lt__(self, other: object) -> bool:
        if not isinstance(other, Time):
            return NotImplemented
        self._check(other)
        return self.nanoseconds < other.nanoseconds

    def __add__(self, other: Any) -> Time:
        if not isinstance(other, Duration):
            return NotImplemented
        return Time(nanoseconds=self.nanoseconds + other.nanoseconds, clock_type=self.clock_type)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        if isinstance(other, Time):
            self._check(other)
            return Duration(nanoseconds=self.nanoseconds - other.nanoseconds)
        if isinstance(other, Duration):
            return Time(nanoseconds=self.nanoseconds - other.nanoseconds, clock_type=self.clock_type)
        return NotImplemented

    def to_msg(self) -> Any:
        """Return the time as ``builtin_interfaces/msg/Time``."""
        seconds, rest = self.seconds_nanoseconds()
        return _TimeMessage(sec=seconds, nanosec=rest)

    @classmethod
    def from_msg(cls, msg: Any, clock_type: ClockType = ClockType.ROS_TIME) -> Time:
        """Return the time in a ``builtin_interfaces/msg/Time``."""
        return cls(nanoseconds=nanoseconds(msg), clock_type=clock_type)


class ClockChange(IntEnum):
    """How the source of a clock has changed."""

    ROS_TIME_NO_CHANGE = 1
    ROS_TIME_ACTIVATED = 2
    ROS_TIME_DEACTIVATED = 3
    SYSTEM_TIME_NO_CHANGE = 4


class JumpThreshold:
    """Jumps that a callback is for: the least ones forwards and backwards, and changes of the source."""

    def __init__(
        self, *, min_forward: Duration | None, min_backward: Duration | None, on_clock_change: bool = True
    ) -> None:
        if min_forward is not None and min_forward.nanoseconds <= 0:
            raise ValueError("min_forward must be a positive non-zero duration")
        if min_backward is not None and min_backward.nanoseconds >= 0:
            raise ValueError("min_backward must be a negative non-zero duration")
        if min_forward is None and min_backward is None and not on_clock_change:
            raise ValueError("At least one threshold must be set")
        self.min_forward, self.min_backward = min_forward, min_backward
        self.on_clock_change = on_clock_change


class TimeJump:
    """A jump of a clock: its kind and its length."""

    def __init__(self, clock_change: ClockChange, delta: Duration) -> None:
        self.clock_change, self.delta = clock_change, delta


class JumpHandle:
    """A callback for jumps. The clock of a run never jumps, so it is never called."""

    def unregister(self) -> None:
        """Do nothing: the callback is never called."""

    def __enter__(self) -> JumpHandle:
        return self

    def __exit__(self, *_: object) -> None:
        self.unregister()


class Clock:
    """A clock that shows the time of the graph."""

    contexts: ClassVar[Contexts]

    def __init__(self, *, clock_type: ClockType = ClockType.SYSTEM_TIME) -> None:
        self.clock_type = ClockType(clock_type)

    @property
    def ros_time_is_active(self) -> bool:
        """Whether the clock shows ROS time, which is the time of the graph."""
        return self.clock_type is ClockType.ROS_TIME

    def now(self) -> Time:
        """Return the current time. An interaction point."""
        return Time(nanoseconds=self.contexts.now(), clock_type=self.clock_type)

    def create_jump_callback(
        self, threshold: JumpThreshold, *, pre_callback: Any = None, post_callback: Any = None
    ) -> JumpHandle:
        """Return a handle for callbacks that are never called: the clock of a run does not jump."""
        if pre_callback is None and post_callback is None:
            raise ValueError("One of pre_callback or post_callback must be callable")
        return JumpHandle()

    def sleep_until(self, until: Time, context: Context | None = None) -> bool:
        """Block until a time; return False if the context was shut down meanwhile."""
        if until.clock_type is not self.clock_type:
            raise ValueError("until's clock type does not match this clock's type")
        used = context or self.contexts.current()
        if not used.ok():
            raise NotInitializedException()
        used.sleep(until.nanoseconds - self.contexts.now())
        return used.ok()

    def sleep_for(self, rel_time: Duration, context: Context | None = None) -> bool:
        """Block for a duration; return False if the context was shut down meanwhile."""
        used = context or self.contexts.current()
        if not used.ok():
            raise NotInitializedException()
        used.sleep(rel_time.nanoseconds)
        return used.ok()


class ROSClock(Clock):
    """A clock of type ``ROS_TIME``."""

    def __init__(self) -> None:
        super().__init__(clock_type=ClockType.ROS_TIME)


class Rate:
    """Keeps a loop at a period, without a spinning executor."""

    def __init__(self, context: Context, period: Ns) -> None:
        self._context = context
        self._rate = context.first_node().rate(period)

    def sleep(self) -> None:
        """Block until the next release; raise ``ROSInterruptException`` at shutdown."""
        if not self._context.ok():
            raise ROSInterruptException()
        self._rate.sleep()
        if not self._context.ok():
            raise ROSInterruptException()

    def destroy(self) -> None:
        """Do nothing: a rate holds no resources."""


JUMPS = {kind.__name__: kind for kind in (ClockChange, JumpHandle, JumpThreshold, TimeJump)}
"""Part of ``rclpy.clock``."""
