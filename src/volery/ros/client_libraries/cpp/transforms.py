"""Handlers of the requests of ``tf2_ros`` and ``tf`` in C++, over the tree that tf2 for Python keeps, too."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from volery.base.time import Ns
from volery.ros.client_libraries.abi_codec import Reader, Writer
from volery.ros.client_libraries.cpp.session import CppSession
from volery.ros.client_libraries.tf2.tf2_ros import TF, TF_STATIC, Buffer
from volery.ros.client_libraries.tf2.transform_tree import TransformException
from volery.ros.graph import AS_OFFERED, ReadyCallbacks
from volery.ros.graph.work import Work
from volery.ros.messages import from_cdr, to_cdr


class _Nanoseconds(NamedTuple):
    """A time or duration as ``Buffer`` takes it."""

    nanoseconds: Ns


class _WatchedBuffer(Buffer):
    """A buffer that tells of each change."""

    def __init__(self, cache_time: Any) -> None:
        super().__init__(cache_time)
        self.watches: dict[_Watch, None] = {}

    def set_transform(self, transform: Any, authority: str = "", *, static: bool = False) -> None:
        """See ``Buffer``."""
        super().set_transform(transform, authority, static=static)
        for watch in list(self.watches):
            watch.changed()


class _Watch:
    """Calls back in the tasks of a queue after changes of a buffer, once for changes at one time."""

    def __init__(
        self, session: CppSession, buffer: _WatchedBuffer, callback: int, group: ReadyCallbacks
    ) -> None:
        self._session, self._buffer, self._callback, self._group = session, buffer, callback, group
        self._pending = False
        buffer.watches[self] = None

    def changed(self) -> None:
        """Let the queue have the callback, if it has not got it already."""
        if not self._pending:
            self._pending = True
            self._group.add(Work(self._session.kernel.now(), self._tell))

    def _tell(self) -> None:
        self._pending = False
        if self in self._buffer.watches:
            self._session.call_back(self._callback, b"")

    def close(self) -> None:
        """End."""
        self._buffer.watches.pop(self, None)


def _create(session: CppSession, arguments: Reader) -> int:
    kind: Any = type("Buffer", (_WatchedBuffer,), {"graph": session.graph, "kernel": session.kernel})
    return session.keep(kind(_Nanoseconds(arguments.integer())))


def _watch(session: CppSession, arguments: Reader) -> int:
    buffer = session.find(arguments.integer(), _WatchedBuffer)
    return session.keep(_Watch(session, buffer, arguments.integer(), session.group(arguments.integer())))


def _buffer(session: CppSession, arguments: Reader) -> Buffer:
    return session.find(arguments.integer(), Buffer)


def _listen(session: CppSession, arguments: Reader) -> None:
    """Fill a buffer in a task of its own, as the listener's thread does."""
    buffer, node = _buffer(session, arguments), session.node
    group = node.group()

    def on_transforms(static: bool, message: Any) -> None:
        for transform in message.transforms:
            buffer.set_transform(transform, static=static)

    for topic in (TF, TF_STATIC):
        on_message = partial(on_transforms, topic == TF_STATIC)
        node.subscribe(topic, "tf2_msgs/msg/TFMessage", on_message, AS_OFFERED, group)
    session.spawn(group.spin, "tf2_ros::TransformListener")


def _set(session: CppSession, arguments: Reader) -> bool:
    buffer = _buffer(session, arguments)
    transform = from_cdr("geometry_msgs/msg/TransformStamped", arguments.raw())
    buffer.set_transform(transform, static=arguments.flag())
    return True


def _question(arguments: Reader) -> tuple[str, str, _Nanoseconds, _Nanoseconds]:
    """Read target, source, time and time-out."""
    target, source = arguments.text(), arguments.text()
    return target, source, _Nanoseconds(arguments.integer()), _Nanoseconds(arguments.integer())


def _can(session: CppSession, arguments: Reader) -> str:
    """Return why there is no transform, or ``""``."""
    possible, reason = _buffer(session, arguments).can_transform(*_question(arguments), True)
    return "" if possible else reason or "a name of a frame is not valid"


def _look_up(session: CppSession, arguments: Reader) -> bytes:
    try:
        transform = _buffer(session, arguments).lookup_transform(*_question(arguments))
    except TransformException as error:
        return Writer().flag(False).text(type(error).__name__).text(str(error)).done()
    return Writer().flag(True).done() + to_cdr(transform)


TRANSFORMS: dict[str, Callable[[CppSession, Reader], Any]] = {
    "tf_buffer": _create,
    "tf_listen": _listen,
    "tf_set": _set,
    "tf_watch": _watch,
    "tf_can": _can,
    "tf_look_up": _look_up,
    "tf_clear": lambda session, arguments: _buffer(session, arguments).clear(),
    "tf_frames": lambda session, arguments: _buffer(session, arguments).all_frames_as_string(),
}
"""Handlers by the name of the request."""
