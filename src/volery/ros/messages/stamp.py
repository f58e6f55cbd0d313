"""Times and durations as message values with arithmetic.

They also support ROS 1's spelling (``stamp.secs``, ``stamp.to_sec()``), so that files written for it work.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

from volery.ros.messages.message import Message

_SECOND = 1_000_000_000


class Stamp(Message):
    """Base of times and durations. Every object with ``sec`` and ``nanosec`` may be the other operand."""

    __slots__ = ()
    if TYPE_CHECKING:  # the fields of the types that are made of this
        sec: Any
        nanosec: Any

        def __init__(self, sec: int = 0, nanosec: int = 0) -> None: ...

    @property
    def secs(self) -> int:
        """``sec`` in ROS 1's spelling."""
        return int(self.sec)

    @secs.setter
    def secs(self, value: int) -> None:
        self.sec = value

    @property
    def nsecs(self) -> int:
        """``nanosec`` in ROS 1's spelling."""
        return int(self.nanosec)

    @nsecs.setter
    def nsecs(self, value: int) -> None:
        self.nanosec = value

    def to_nsec(self) -> int:
        """Return the value in ns."""
        return int(self.sec * _SECOND + self.nanosec)

    def to_sec(self) -> float:
        """Return the value in s, rounded as in ROS 1."""
        return float(self.sec + self.nanosec / _SECOND)

    to_time = to_sec

    def is_zero(self) -> bool:
        """Return whether the value is 0."""
        return self.to_nsec() == 0

    def __bool__(self) -> bool:
        return not self.is_zero()

    def __lt__(self, other: Any) -> bool:
        return self.to_nsec() < nanoseconds(other)

    def __le__(self, other: Any) -> bool:
        return self.to_nsec() <= nanoseconds(other)

    def __gt__(self, other: Any) -> bool:
        return self.to_nsec() > nanoseconds(other)

    def __ge__(self, other: Any) -> bool:
        return self.to_nsec() >= nanoseconds(other)

    def __eq__(self, other: object) -> bool:
        if not hasattr(other, "nanosec"):
            return NotImplemented
        return self.to_nsec() == nanoseconds(other)

    def __hash__(self) -> int:
        return hash(self.to_nsec())


def nanoseconds(value: Any) -> int:
    """Return a stamp in ns; raise ``TypeError`` for any other object."""
    try:
        return int(value.sec * _SECOND + value.nanosec)
    except AttributeError:
        raise TypeError(f"{value!r} is neither a time nor a duration") from None


def _is_time(value: Any) -> bool:
    return isinstance(value, TimeValue)


class DurationValue(Stamp):
    """A duration. If negative, ``sec`` is negative and ``nanosec`` counts upward."""

    __slots__ = ()
    kind: ClassVar[type[DurationValue]]
    """Class of the message type, used for results."""

    @classmethod
    def of(cls, ns: int) -> DurationValue:
        """Return the value of `ns` nanoseconds."""
        return DurationValue.kind(*divmod(ns, _SECOND))

    def __add__(self, other: Any) -> Any:
        if _is_time(other):
            return other + self
        return DurationValue.of(self.to_nsec() + nanoseconds(other))

    def __sub__(self, other: Any) -> DurationValue:
        if _is_time(other):
            raise TypeError("a duration minus a time")
        return DurationValue.of(self.to_nsec() - nanoseconds(other))

    def __neg__(self) -> DurationValue:
        return DurationValue.of(-self.to_nsec())

    def __abs__(self) -> DurationValue:
        return DurationValue.of(abs(self.to_nsec()))

    def __mul__(self, factor: float) -> DurationValue:
        return DurationValue.of(round(self.to_nsec() * factor))

    __rmul__ = __mul__

    def __truediv__(self, by: Any) -> Any:
        if hasattr(by, "nanosec"):
            return self.to_nsec() / nanoseconds(by)
        return DurationValue.of(round(self.to_nsec() / by))


class TimeValue(Stamp):
    """A point in ROS time."""

    __slots__ = ()
    kind: ClassVar[type[TimeValue]]
    """Class of the message type, used for results."""

    @classmethod
    def of(cls, ns: int) -> TimeValue:
        """Return the value of `ns` nanoseconds."""
        return TimeValue.kind(*divmod(ns, _SECOND))

    def __add__(self, other: Any) -> TimeValue:
        if _is_time(other):
            raise TypeError("a time plus a time")
        return TimeValue.of(self.to_nsec() + nanoseconds(other))

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        if _is_time(other):
            return DurationValue.of(self.to_nsec() - nanoseconds(other))
        return TimeValue.of(self.to_nsec() - nanoseconds(other))
