"""State of a component that uses rospy: its node, its helper tasks, its shutdown, and its time.

``Time``, ``Duration``, ``Rate`` and ``Timer`` use the clock of the current component's node. rospy's
exceptions stand here too.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, NamedTuple, Self

from greenlet import GreenletExit

from volery.base.errors import ComponentError, VoleryError
from volery.base.time import Ns, S, from_seconds
from volery.kernel.api import Kernel
from volery.kernel.task import Cancelled, Scope
from volery.kernel.waiting import Signal, current_task, poll, read_clock
from volery.ros.client_libraries.library_base import AtEnd, Launch, LaunchedComponents, Rosout, node_of_file
from volery.ros.graph import LATCHED, Node, ReadyCallbacks, RosGraph, Work
from volery.ros.messages.client_classes import ROSPY, message_of
from volery.ros.messages.message import nanoseconds
from volery.trace.events import ERROR, WARNING, Failure, Text

READ_CLOCK: Ns = 1100
"""Time of ``get_time`` or ``Time.now`` in a loop that polls, ns; of rospy 1.15, measured."""


class ROSException(Exception):  # noqa: N818 - rospy's name
    """A time-out or a wrong call."""


class ROSInitException(ROSException):
    """A call before ``init_node``."""


class ROSSerializationException(ROSException):
    """A value does not fit the field of its message."""


class ROSInterruptException(ROSException, KeyboardInterrupt):
    """The node shuts down while it sleeps."""


class ROSTimeMovedBackwardsException(ROSInterruptException):
    """Never raised: simulated time does not move backwards."""


class ROSInternalException(Exception):  # noqa: N818 - rospy's name
    """Base class of errors of connections."""


class TransportException(ROSInternalException):
    """A connection has failed. Never raised: messages of a simulated graph need no connections."""


class TransportInitError(TransportException):
    """A connection cannot be made. Never raised."""


class TransportTerminated(TransportException):
    """A connection has ended. Never raised."""


class ServiceException(Exception):  # noqa: N818 - rospy's name
    """A service call has failed."""


_EXCEPTIONS: tuple[type[Exception], ...] = (
    ROSException,
    ROSInitException,
    ROSSerializationException,
    ROSInterruptException,
    ROSTimeMovedBackwardsException,
    ROSInternalException,
    TransportException,
    TransportInitError,
    TransportTerminated,
)
for _kind in _EXCEPTIONS:
    _kind.__module__ = "rospy.exceptions"
ServiceException.__module__ = "rospy.service"
EXCEPTIONS = {kind.__name__: kind for kind in (*_EXCEPTIONS, ServiceException)}


@dataclass(eq=False)
class Session:
    """The node of one component and what rospy keeps for it."""

    graph: RosGraph
    node: Node
    scope: Scope
    kernel: Kernel
    ended: Signal
    rosout: Rosout
    at_end: AtEnd
    shutdown: str = ""
    """Reason of the shutdown; empty while the node is not shut down."""
    hooks: list[Callable[[], Any]] = field(default_factory=list)
    given: tuple[Any, ...] = ()
    """Arguments of ``init_node``."""
    failures: dict[str, None] = field(default_factory=dict)
    callbacks: int = 0
    """Number of callbacks that were called, without shutdown hooks."""
    failed_callbacks: int = 0
    initialised: bool = False

    def log(self, severity: int, text: str) -> None:
        """Record a log line of this node. An interaction point."""
        kernel = self.kernel
        with kernel.interact():
            kernel.record(Text(kernel.now(), self.node.context.component, severity, text))

    def check(self) -> None:
        """Raise ``ROSInterruptException`` if the node is shutting down."""
        if self.shutdown:
            raise ROSInterruptException(f"rospy shutdown: {self.shutdown}")

    def on_shutdown(self, hook: Callable[[], Any]) -> None:
        """Call *hook* when the node shuts down or the run ends."""
        if not self.hooks:
            self.at_end(self.node.context, lambda: self.end("the run has ended"))
        self.hooks.append(hook)

    def end(self, reason: str) -> None:
        """Shut down: call the hooks, then leave the graph."""
        if not self.shutdown:
            self.shutdown = reason or "signal_shutdown"
            for hook in self.hooks:
                self._guarded(hook, "shutdown hook")
            self.node.close()
            self.ended.notify()

    def wait_for_end(self) -> None:
        """Block until the node shuts down."""
        self.ended.wait_for(lambda: self.shutdown, ends_activation=True)

    def spinning_group(self, label: str, what: str) -> ReadyCallbacks:
        """Return a new group that a helper task spins, as a thread of rospy would.

        Args:
            label: Name of the task.
            what: Description of a callback in reports of failures.
        """
        group = self.node.group()

        def body() -> None:
            while not self.node.closed:
                self._guarded(group.spin_once, what, counted=True)

        self._spawn(body, label)
        return group

    def spawn(self, body: Callable[[], None], label: str) -> None:
        """Run *body* in a helper task, as a thread of rospy would."""
        self._spawn(lambda: self._guarded(body, label), label)

    def spawning_group(self, label: str, what: str) -> ReadyCallbacks:
        """Return a new group that runs each piece of work in a task of its own."""

        def start(work: Work) -> None:
            self._spawn(lambda: self._guarded(work.run, what, counted=True), label)

        return self.node.group(start)

    def _spawn(self, body: Callable[[], None], label: str) -> None:
        context = replace(self.node.context, deadline=None, period=None, on_release=None)

        def run() -> None:
            with suppress(SystemExit):  # it ends the thread alone, as in rospy
                body()

        self.kernel.spawn(run, f"{context.component} ({label})", context, self.scope)

    def _guarded(self, run: Callable[[], object], what: str, counted: bool = False) -> None:
        """Run a callback. An exception is logged, as in rospy, and is a failure of the component."""
        try:
            if run() is not False and counted:
                self.callbacks += 1
        except ROSInterruptException:
            pass
        except (Cancelled, GreenletExit, KeyboardInterrupt, SystemExit):
            raise
        except BaseException as error:
            self.report_failure(what, error)
            if counted:
                self.callbacks += 1
                self.failed_callbacks += 1

    def report_failure(self, what: str, error: BaseException) -> None:
        """Log what a callback has raised; each text is a failure of the component once."""
        text = f"{what} raised {_description(error)}"
        self.log(ERROR, f"bad callback: {text}")
        if text not in self.failures:
            if not self.failures:
                self.at_end(self.node.context, self._judge_callbacks)
            self.failures[text] = None
            self.kernel.record(Failure(self.kernel.now(), self.node.context.component, text))

    def _judge_callbacks(self) -> None:
        """Raise ``ComponentError`` if every callback has failed: the node did nothing of what it is for."""
        if self.failed_callbacks and self.failed_callbacks == self.callbacks:
            first = next(iter(self.failures))
            what = f"every callback failed ({self.callbacks} of {self.callbacks}): {first}"
            raise ComponentError(self.node.context.component, what)


def _description(error: BaseException) -> str:
    if isinstance(error, VoleryError):
        return str(error)
    traceback = error.__traceback__
    while traceback is not None and traceback.tb_next is not None:
        traceback = traceback.tb_next
    where = f" (line {traceback.tb_lineno})" if traceback is not None else ""
    try:
        words = str(error)
    except Exception as fault:  # its own method fails
        words = f"(its __str__ raised {type(fault).__name__})"
    return f"{type(error).__name__}: {words}{where}"


@dataclass(eq=False)
class Sessions(LaunchedComponents):
    """Sessions of all components of one run that use rospy."""

    _open: dict[str, Session] = field(default_factory=dict, init=False)
    headers: dict[tuple[str, str], dict[str, Any]] = field(default_factory=dict, init=False)
    """What files add to the headers of connections, by node and topic or service."""

    def join(self, name: str, anonymous: bool, *options: Any) -> None:
        """Execute ``init_node``; raise ``ROSException`` at a second call with other arguments."""
        session = self.find() or self._open_session(name, anonymous)
        given = name, anonymous, *options
        if session.initialised and session.given != given:
            before = ", ".join(map(repr, session.given))
            raise ROSException(
                f"rospy.init_node() has already been called with different arguments: {before}; a process "
                "has one node"
            )
        session.initialised, session.given = True, given

    def _open_session(self, name: str, anonymous: bool) -> Session:
        component = self.component
        task = current_task(self.kernel)
        launch, given = self.launch_of(component), self.node_of(component)
        node = node_of_file(self.graph, component, name, launch, given, anonymous=anonymous)
        for key, value in (launch or Launch()).parameters.items():
            node.set_parameter(key if key.startswith("/") else f"~{key}", value)
        ended = Signal(self.kernel, f"{component} (rospy.spin)")
        rosout = Rosout(self.graph, node, "rosgraph_msgs/msg/Log", LATCHED)
        made = self._open[component] = Session(
            self.graph, node, task.scope, self.kernel, ended, rosout, self.at_end
        )
        return made

    def shut_down(self, name: str) -> bool:
        """Shut the node *name* down, as another node may; return whether there is one."""
        found = [one for one in self._open.values() if one.node.name == name and not one.shutdown]
        for session in found:
            session.end("shutdown by another node")
        return bool(found)

    def initialised(self) -> Session:
        """Return the session of the current component; raise ``ROSInitException`` before ``init_node``."""
        task = self.kernel.current()
        session = None if task is None else self._open.get(task.context.component)
        if session is None or not session.initialised:
            raise ROSInitException(f"{self.component}: call rospy.init_node() first")
        return session

    def joined(self) -> Session:
        """Return the session of the current task's component, joining the graph if it has not yet.

        For the functions that rospy allows before ``init_node``.
        """
        return self.find() or self._open_session(self.component, anonymous=False)

    def find(self) -> Session | None:
        """Return the session of the current task's component, or None before it has joined the graph.

        A component that was started again has none.
        """
        task = self.kernel.current() or current_task(self.kernel)
        found = self._open.get(task.context.component)
        if found is not None and found.scope.cancelled and self.started_again(found.scope):
            return None
        return found

    def now(self) -> Ns:
        """Return ROS time. An interaction point."""
        node = self.initialised().node
        if poll(self.kernel, READ_CLOCK):
            return self.graph.epoch + self.kernel.now()
        read_clock(self.kernel)
        return node.now()


_TimeMessage: Any = message_of("builtin_interfaces/msg/Time", ROSPY)
_DurationMessage: Any = message_of("builtin_interfaces/msg/Duration", ROSPY)


def as_ns(value: Any) -> Ns:
    """Return a number of seconds, or a ``Duration``, in ns."""
    return from_seconds(value) if isinstance(value, (int, float)) else nanoseconds(value)


class Time(_TimeMessage):  # type: ignore[misc]  # the class is made when this module is loaded
    """A point in ROS time: ``Time(secs, nsecs)``, ``Time.now()``, ``Time.from_sec(float)``."""

    __slots__ = ()
    sessions: ClassVar[Sessions]

    @classmethod
    def now(cls) -> Self:
        """Return the current time."""
        return cls(0, cls.sessions.now())


class Duration(_DurationMessage):  # type: ignore[misc]  # the class is made when this module is loaded
    """A duration: ``Duration(secs, nsecs)``, ``Duration.from_sec(float)``."""

    __slots__ = ()


Time.__module__ = Duration.__module__ = "rospy.rostime"


class Rate:
    """Keeps a loop at a frequency of *hz*."""

    sessions: ClassVar[Sessions]

    def __init__(self, hz: float, reset: bool = False) -> None:
        self._session = self.sessions.initialised()
        if hz == 0:
            raise ZeroDivisionError(f"rospy.Rate({hz}): give a frequency above 0 Hz")
        period = int(S / hz)  # truncated, as by rospy
        self.sleep_dur = Duration(0, period)
        self._last = self._session.node.now()
        self._rate = self._session.node.rate(period) if period > 0 else None
        if self._rate is None:
            self._session.log(
                WARNING, f"rospy.Rate({hz}) never sleeps; give a frequency from above 0 to 1e9 Hz"
            )

    @property
    def last_time(self) -> Time:
        """Time at which the last sleep has ended, or the rate was made."""
        return Time(0, self._last)

    def remaining(self) -> Duration:
        """Return the time until the next release."""
        return self.sleep_dur if self._rate is None else Duration(0, self._rate.remaining())

    def sleep(self) -> None:
        """Block until the next release; raise ``ROSInterruptException`` at shutdown."""
        self._session.check()
        if self._rate is not None:
            self._rate.sleep()
            self._last = self._session.node.now()
        elif not poll(self._session.kernel, READ_CLOCK):
            read_clock(self._session.kernel)
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
    daemon = True

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
        self._stopped = False
        self._ended = Signal(self._session.kernel, "rospy.Timer (its end)")
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
            self.shutdown()
        self._callback(event)
        self._took = (self._session.node.now() - now) / S

    def is_alive(self) -> bool:
        """Return whether it will call again."""
        return not self._stopped and not self._session.shutdown

    def join(self, timeout: float | None = None) -> None:
        """Block until it is stopped, or for a time in seconds."""
        self._ended.wait_for(lambda: not self.is_alive(), None if timeout is None else from_seconds(timeout))

    def shutdown(self) -> None:
        """Stop the timer."""
        self._stopped = True
        self._timer.cancel()
        self._ended.notify()
