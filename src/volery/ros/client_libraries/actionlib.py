"""``actionlib``, the actions of ROS 1: goals, feedback and results on the topics of their protocol.

Built on rospy, as the real one is, so that both sides also work with nodes on a real graph. The protocol is
that of http://wiki.ros.org/actionlib/DetailedDescription: a client publishes ``goal`` and ``cancel``; a
server publishes ``status`` (at 5 Hz, and at each change), ``feedback`` and ``result``.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable
from types import ModuleType
from typing import Any, ClassVar

from volery.base.time import MS, Ns
from volery.kernel.waiting import Lock, Signal
from volery.ros.client_libraries.library_base import library_module
from volery.ros.client_libraries.rospy.session import ROSInterruptException, as_ns
from volery.ros.messages.client_classes import ROSPY, message_of

GoalID: Any = message_of("actionlib_msgs/msg/GoalID", ROSPY)
GoalStatus: Any = message_of("actionlib_msgs/msg/GoalStatus", ROSPY)
GoalStatusArray: Any = message_of("actionlib_msgs/msg/GoalStatusArray", ROSPY)

_POLL: Ns = 10 * MS
"""Period at which a client looks for its server, as in actionlib."""
_FREQUENCY_HZ = 5.0
_KEPT_S = 5.0
"""Time for which a server reports a goal that its file holds no longer."""


class ActionException(Exception):  # noqa: N818 - actionlib's name
    """A class that is no action."""


class CommState:
    """States of a goal on the side of the client."""

    WAITING_FOR_GOAL_ACK = 0
    PENDING = 1
    ACTIVE = 2
    WAITING_FOR_RESULT = 3
    WAITING_FOR_CANCEL_ACK = 4
    RECALLING = 5
    PREEMPTING = 6
    DONE = 7
    LOST = 8


class TerminalState:
    """Ways in which a goal ends."""

    RECALLED = GoalStatus.RECALLED
    REJECTED = GoalStatus.REJECTED
    PREEMPTED = GoalStatus.PREEMPTED
    ABORTED = GoalStatus.ABORTED
    SUCCEEDED = GoalStatus.SUCCEEDED
    LOST = GoalStatus.LOST


class SimpleGoalState:
    """States of a goal of ``SimpleActionClient``."""

    PENDING = 0
    ACTIVE = 1
    DONE = 2


def get_name_of_constant(C: Any, n: int) -> str:  # noqa: N803 - actionlib's name
    """Return the name of the constant of class *C* whose value is *n*."""
    names = (name for name in dir(C) if name.isupper() and getattr(C, name) == n)
    return next(names, f"NO_SUCH_STATE_{n}")


_ORDER = (
    *(GoalStatus.PENDING, GoalStatus.ACTIVE, GoalStatus.PREEMPTED, GoalStatus.SUCCEEDED, GoalStatus.ABORTED),
    *(GoalStatus.REJECTED, GoalStatus.PREEMPTING, GoalStatus.RECALLING, GoalStatus.RECALLED),
)
_LETTERS = {
    "P": CommState.PENDING,
    "A": CommState.ACTIVE,
    "R": CommState.WAITING_FOR_RESULT,
    "L": CommState.RECALLING,
    "M": CommState.PREEMPTING,
}
_STEPS = {
    CommState.WAITING_FOR_GOAL_ACK: "P A AMR AR AR PR AM PL PR",
    CommState.PENDING: "- A AMR AR AR R AM L LR",
    CommState.ACTIVE: "! - MR R R ! M ! !",
    CommState.WAITING_FOR_RESULT: "! - - - - - ! ! -",
    CommState.WAITING_FOR_CANCEL_ACK: "- - MR MR MR R M L LR",
    CommState.RECALLING: "! ! MR MR MR R M - R",
    CommState.PREEMPTING: "! ! R R R ! - ! !",
    CommState.DONE: "! ! - - - - ! ! -",
}
"""States that a client passes through, by its state and the server's status in ``_ORDER``.

``-`` is no change, ``!`` a status that cannot follow.
"""


def steps(state: int, status: int) -> tuple[int, ...] | None:
    """Return the states that a client in *state* passes through at a server's *status*; None if it cannot."""
    word = _STEPS[state].split()[_ORDER.index(status)]
    return None if word == "!" else tuple(_LETTERS[letter] for letter in word if letter != "-")


# -- the parts of an action's type


class _ActionTypes:
    """The message classes of an action, taken from its class ``NameAction``."""

    def __init__(self, given: Any) -> None:
        try:
            one = given()
            self.action_goal = type(one.action_goal)
            self.action_result = type(one.action_result)
            self.action_feedback = type(one.action_feedback)
            self.result = type(one.action_result.result)
        except (AttributeError, TypeError):
            raise ActionException(
                f"{given!r} is no action; import one whose name ends in Action, as from actionlib.msg"
            ) from None


class _UsesRospy:
    rospy: ClassVar[Any]

    def now(self) -> Any:
        """Return ROS time."""
        return self.rospy.Time.now()

    def signal(self, name: str) -> Signal:
        """Return a new signal of the kernel."""
        return Signal(self.rospy.Publisher.sessions.kernel, name)


class GoalIDGenerator(_UsesRospy):
    """Makes ids of goals: name of the node, number and time."""

    def __init__(self, name: str | None = None) -> None:
        self._name = name or self.rospy.get_name()
        self._count = 0

    def set_name(self, name: str) -> None:
        """Set the first part of the ids."""
        self._name = name

    def generate_ID(self) -> Any:  # noqa: N802 - actionlib's name
        """Return a new id."""
        self._count += 1
        now = self.now()
        return GoalID(stamp=now, id=f"{self._name}-{self._count}-{now.secs}.{now.nsecs:09d}")


# -- client


class _Goal(_UsesRospy):
    """One goal of a client and its state."""

    def __init__(self, client: ActionClient, sent: Any, on_transition: Any, on_feedback: Any) -> None:
        self.client, self.sent = client, sent
        self._on_transition, self._on_feedback = on_transition, on_feedback
        self.state = CommState.WAITING_FOR_GOAL_ACK
        self.status = GoalStatus(status=GoalStatus.PENDING)
        self.result: Any = None

    @property
    def id(self) -> str:
        """Id of the goal."""
        return str(self.sent.goal_id.id)

    def enter(self, state: int) -> None:
        """Change the state and say so."""
        self.state = state
        if self._on_transition is not None:
            self._on_transition(ClientGoalHandle(self))

    def take_statuses(self, statuses: list[Any]) -> None:
        """Follow the status that the server reports of this goal."""
        if self.state == CommState.DONE:
            return
        own = next((status for status in statuses if status.goal_id.id == self.id), None)
        if own is None:
            if self.state not in (CommState.WAITING_FOR_GOAL_ACK, CommState.WAITING_FOR_RESULT):
                self.status.status = GoalStatus.LOST
                self.enter(CommState.DONE)
            return
        self.status = own
        if own.status not in _ORDER:
            self.rospy.logerr(f"unknown status {own.status} of goal {self.id}")
            return
        passed = steps(self.state, own.status)
        if passed is None:
            status, state = get_name_of_constant(GoalStatus, own.status), self.state
            self.rospy.logerr(
                f"goal {self.id}: status {status} cannot follow {get_name_of_constant(CommState, state)}"
            )
        for state in passed or ():
            self.enter(state)

    def take_result(self, message: Any) -> None:
        """Take the result and end."""
        if message.status.goal_id.id != self.id:
            return
        self.result = message
        self.take_statuses([message.status])
        self.enter(CommState.DONE)

    def take_feedback(self, message: Any) -> None:
        """Pass feedback on."""
        wanted = message.status.goal_id.id == self.id and self.state != CommState.DONE
        if wanted and self._on_feedback is not None:
            self._on_feedback(ClientGoalHandle(self), message.feedback)


class ClientGoalHandle:
    """A goal on the side of the client that sent it."""

    def __init__(self, comm_state_machine: Any) -> None:
        self.comm_state_machine = comm_state_machine

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ClientGoalHandle) and other.comm_state_machine is self.comm_state_machine

    def __hash__(self) -> int:
        return hash(self.comm_state_machine.id)

    def cancel(self) -> None:
        """Request the cancellation of the goal."""
        goal = self.comm_state_machine
        goal.client.cancel_of(GoalID(id=goal.id))
        goal.enter(CommState.WAITING_FOR_CANCEL_ACK)

    def get_comm_state(self) -> int:
        """Return the state as one of ``CommState``."""
        return int(self.comm_state_machine.state)

    def get_goal_status(self) -> int:
        """Return the server's last status, one of ``GoalStatus``."""
        return int(self.comm_state_machine.status.status)

    def get_goal_status_text(self) -> str:
        """Return the text of the server's last status."""
        return str(self.comm_state_machine.status.text)

    def get_result(self) -> Any:
        """Return the result, or None while there is none."""
        message = self.comm_state_machine.result
        return None if message is None else message.result

    def get_terminal_state(self) -> int:
        """Return how the goal has ended, one of ``TerminalState``."""
        goal = self.comm_state_machine
        if goal.state != CommState.DONE:
            goal.rospy.logwarn(
                f"terminal state of goal {goal.id}, which is {get_name_of_constant(CommState, goal.state)}"
            )
        status = self.get_goal_status()
        return status if status in _ENDINGS else GoalStatus.LOST


_ENDINGS = [value for name, value in vars(TerminalState).items() if name.isupper()]


class ActionClient(_UsesRospy):
    """Sends goals and follows all of them."""

    def __init__(self, ns: str, ActionSpec: Any) -> None:  # noqa: N803 - actionlib's name
        self.ns = ns
        kinds = self._kinds = _ActionTypes(ActionSpec)
        self._goals: list[_Goal] = []
        self._ids = _made(self, GoalIDGenerator)()
        self._heard = False
        depth = self.rospy.get_param("actionlib_client_pub_queue_size", 10)
        self._goal = self.rospy.Publisher(f"{ns}/goal", kinds.action_goal, queue_size=depth)
        self._cancel = self.rospy.Publisher(f"{ns}/cancel", GoalID, queue_size=depth)
        self._subscribers = [
            self.rospy.Subscriber(f"{ns}/status", GoalStatusArray, self._on_status),
            self.rospy.Subscriber(f"{ns}/result", kinds.action_result, self._on_result),
            self.rospy.Subscriber(f"{ns}/feedback", kinds.action_feedback, self._on_feedback),
        ]

    def stop(self) -> None:
        """Leave the topics."""
        for one in (*self._subscribers, self._goal, self._cancel):
            one.unregister()

    def send_goal(self, goal: Any, transition_cb: Any = None, feedback_cb: Any = None) -> ClientGoalHandle:
        """Send a goal; its callbacks get the handle at each change of state, and handle and feedback."""
        message = self._kinds.action_goal(goal_id=self._ids.generate_ID(), goal=goal)
        message.header.stamp = self.now()
        made = _made(self, _Goal)(self, message, transition_cb, feedback_cb)
        self._goals.append(made)
        self._goal.publish(message)
        return ClientGoalHandle(made)

    def cancel_of(self, goal_id: Any) -> None:
        """Publish a request for cancellation."""
        self._cancel.publish(goal_id)

    def cancel_all_goals(self) -> None:
        """Request the cancellation of all goals of the server."""
        self.cancel_of(GoalID())

    def cancel_goals_at_and_before_time(self, time: Any) -> None:
        """Request the cancellation of all goals that were sent until *time*."""
        self.cancel_of(GoalID(stamp=time))

    def wait_for_server(self, timeout: Any = 0) -> bool:
        """Block until a server is connected; return False after a time-out (0: none) or at shutdown."""
        started, within = self.now().to_nsec(), as_ns(timeout)
        while not self.rospy.is_shutdown():
            if self._connected():
                return True
            if within and self.now().to_nsec() >= started + within:
                return False
            try:
                self.rospy.sleep(_POLL / 1e9)
            except ROSInterruptException:
                return False
        return False

    wait_for_action_server_to_start = wait_for_server

    def _connected(self) -> bool:
        ends = (*self._subscribers, self._goal, self._cancel)
        return self._heard and all(end.get_num_connections() for end in ends)

    def _on_status(self, message: Any) -> None:
        self._heard = True
        for goal in self._live():
            goal.take_statuses(message.status_list)

    def _on_result(self, message: Any) -> None:
        for goal in self._live():
            goal.take_result(message)

    def _on_feedback(self, message: Any) -> None:
        for goal in self._live():
            goal.take_feedback(message)

    def _live(self) -> list[_Goal]:
        self._goals = [one for one in self._goals if one.state != CommState.DONE]
        return self._goals


class SimpleActionClient(_UsesRospy):
    """Sends one goal at a time."""

    def __init__(self, ns: str, ActionSpec: Any) -> None:  # noqa: N803 - actionlib's name
        self.action_client = _made(self, ActionClient)(ns, ActionSpec)
        self.simple_state = SimpleGoalState.DONE
        self.gh: ClientGoalHandle | None = None
        self.done_cb: Any = None
        self.active_cb: Any = None
        self.feedback_cb: Any = None
        self._done = self.signal(f"{ns} (a result)")

    def wait_for_server(self, timeout: Any = 0) -> bool:
        """Block until a server is connected; return False after a time-out (0: none)."""
        return bool(self.action_client.wait_for_server(timeout))

    def send_goal(
        self, goal: Any, done_cb: Any = None, active_cb: Any = None, feedback_cb: Any = None
    ) -> None:
        """Send a goal and forget the one before.

        Args:
            goal: The goal.
            done_cb: Called with the status and the result.
            active_cb: Called when the server has accepted the goal.
            feedback_cb: Called with feedback.
        """
        self.stop_tracking_goal()
        self.done_cb, self.active_cb, self.feedback_cb = done_cb, active_cb, feedback_cb
        self.simple_state = SimpleGoalState.PENDING
        self.gh = self.action_client.send_goal(goal, self._on_transition, self._on_feedback)

    def send_goal_and_wait(self, goal: Any, execute_timeout: Any = 0, preempt_timeout: Any = 0) -> int:
        """Send a goal and block until it ends; cancel it after a time-out. Return its status."""
        self.send_goal(goal)
        if not self.wait_for_result(execute_timeout):
            self.cancel_goal()
            self.wait_for_result(preempt_timeout)
        return self.get_state()

    def wait_for_result(self, timeout: Any = 0) -> bool:
        """Block until the goal has ended; return False after a time-out (0: none) or at shutdown."""
        if self.gh is None:
            self.rospy.logerr("wait_for_result: no goal was sent")
            return False
        self._done.wait_for(
            lambda: self.simple_state == SimpleGoalState.DONE, as_ns(timeout) or None, ends_activation=True
        )
        return self.simple_state == SimpleGoalState.DONE

    def get_result(self) -> Any:
        """Return the result, or None while there is none."""
        if self.gh is None:
            self.rospy.logerr("get_result: no goal was sent")
            return None
        return self.gh.get_result()

    def get_state(self) -> int:
        """Return the status of the goal; those on the way to an end are PENDING and ACTIVE."""
        if self.gh is None:
            return int(GoalStatus.LOST)
        status = self.gh.get_goal_status()
        shown = {GoalStatus.RECALLING: GoalStatus.PENDING, GoalStatus.PREEMPTING: GoalStatus.ACTIVE}
        return int(shown.get(status, status))

    def get_goal_status_text(self) -> str:
        """Return the text of the server's last status."""
        if self.gh is None:
            self.rospy.logerr("get_goal_status_text: no goal was sent")
            return "ERROR: Called get_goal_status_text when no goal is running"
        return self.gh.get_goal_status_text()

    def cancel_all_goals(self) -> None:
        """Request the cancellation of all goals of the server."""
        self.action_client.cancel_all_goals()

    def cancel_goals_at_and_before_time(self, time: Any) -> None:
        """Request the cancellation of all goals that were sent until *time*."""
        self.action_client.cancel_goals_at_and_before_time(time)

    def cancel_goal(self) -> None:
        """Request the cancellation of the goal."""
        if self.gh is not None:
            self.gh.cancel()

    def stop_tracking_goal(self) -> None:
        """Forget the goal."""
        self.gh = None

    def _on_transition(self, handle: ClientGoalHandle) -> None:
        if self.gh is not None and handle != self.gh:
            return  # of a goal that was forgotten
        state = handle.get_comm_state()
        begun = state in (CommState.ACTIVE, CommState.PREEMPTING)
        if begun and self.simple_state == SimpleGoalState.PENDING:
            self.simple_state = SimpleGoalState.ACTIVE
            if self.active_cb is not None:
                self.active_cb()
        elif state == CommState.DONE and self.simple_state != SimpleGoalState.DONE:
            self.simple_state = SimpleGoalState.DONE
            if self.done_cb is not None:
                self.done_cb(handle.get_goal_status(), handle.get_result())
            self._done.notify()

    def _on_feedback(self, handle: ClientGoalHandle, feedback: Any) -> None:
        if handle == self.gh and self.feedback_cb is not None:
            self.feedback_cb(feedback)


# -- server


class _Held:
    """Held by all handles of a goal, so that its server knows when there is none."""


class _Tracker:
    """A goal of a server and its status."""

    def __init__(self, status: Any, goal: Any = None) -> None:
        self.status, self.goal = status, goal
        self.held: Callable[[], _Held | None] = lambda: None
        self.released: Any = None
        """Time since when no handle is held."""

    def handle(self, server: ActionServer) -> ServerGoalHandle:
        """Return a new handle."""
        held = self.held() or _Held()
        self.held, self.released = weakref.ref(held), None
        return ServerGoalHandle(self, server, held)


_ACCEPTED = {GoalStatus.PENDING: GoalStatus.ACTIVE, GoalStatus.RECALLING: GoalStatus.PREEMPTING}
_CANCELED = {
    GoalStatus.PENDING: GoalStatus.RECALLED,
    GoalStatus.RECALLING: GoalStatus.RECALLED,
    GoalStatus.ACTIVE: GoalStatus.PREEMPTED,
    GoalStatus.PREEMPTING: GoalStatus.PREEMPTED,
}
_CANCEL_REQUESTED = {GoalStatus.PENDING: GoalStatus.RECALLING, GoalStatus.ACTIVE: GoalStatus.PREEMPTING}
_REJECTED = dict.fromkeys((GoalStatus.PENDING, GoalStatus.RECALLING), GoalStatus.REJECTED)
_ABORTED = dict.fromkeys((GoalStatus.ACTIVE, GoalStatus.PREEMPTING), GoalStatus.ABORTED)
_SUCCEEDED = dict.fromkeys((GoalStatus.ACTIVE, GoalStatus.PREEMPTING), GoalStatus.SUCCEEDED)
"""Next status of a goal by its status."""


class ServerGoalHandle:
    """A goal on the side of the server. Without arguments, a handle of no goal."""

    def __init__(
        self, status_tracker: Any = None, action_server: Any = None, handle_tracker: Any = None
    ) -> None:
        self._tracker, self._server, self._held = status_tracker, action_server, handle_tracker

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ServerGoalHandle) and other._tracker is self._tracker

    def __hash__(self) -> int:
        return hash(self.get_goal_id().id)

    @property
    def goal(self) -> Any:
        """The message that brought the goal, or None."""
        return None if self._tracker is None else self._tracker.goal

    def get_goal(self) -> Any:
        """Return the goal, or None."""
        return None if self.goal is None else self.goal.goal

    def get_goal_id(self) -> Any:
        """Return the id of the goal with the time at which it was sent."""
        return GoalID() if self._tracker is None else self._tracker.status.goal_id

    def get_goal_status(self) -> Any:
        """Return the status."""
        return GoalStatus() if self._tracker is None else self._tracker.status

    def get_default_result(self) -> Any:
        """Return an empty result."""
        return self._server.kinds.result()

    def _change(self, following: dict[int, int], to: str, text: str) -> bool:
        status = None if self._tracker is None else self._tracker.status
        if status is None or status.status not in following:
            state = "no goal" if status is None else get_name_of_constant(GoalStatus, status.status)
            self._server_log(f"a goal cannot be {to}: it is {state}")
            return False
        status.status, status.text = following[status.status], text
        return True

    def _server_log(self, text: str) -> None:
        if self._server is None:
            raise ActionException(text)
        self._server.rospy.logerr(text)

    def _end(self, following: dict[int, int], to: str, result: Any, text: str) -> None:
        if self._change(following, to, text):
            self._server.publish_result(self._tracker.status, result)

    def set_accepted(self, text: str = "") -> None:
        """Accept the goal."""
        if self._change(_ACCEPTED, "accepted", text):
            self._server.publish_status()

    def set_canceled(self, result: Any = None, text: str = "") -> None:
        """End the goal as recalled or preempted."""
        self._end(_CANCELED, "canceled", result, text)

    def set_rejected(self, result: Any = None, text: str = "") -> None:
        """End the goal as rejected."""
        self._end(_REJECTED, "rejected", result, text)

    def set_aborted(self, result: Any = None, text: str = "") -> None:
        """End the goal as aborted."""
        self._end(_ABORTED, "aborted", result, text)

    def set_succeeded(self, result: Any = None, text: str = "") -> None:
        """End the goal as succeeded."""
        self._end(_SUCCEEDED, "set to succeeded", result, text)

    def set_cancel_requested(self) -> bool:
        """Take note of a request for cancellation; return whether the goal had none and has not ended."""
        status = None if self._tracker is None else self._tracker.status
        if status is None or status.status not in _CANCEL_REQUESTED:
            return False
        status.status = _CANCEL_REQUESTED[status.status]
        self._server.publish_status()
        return True

    def publish_feedback(self, feedback: Any) -> None:
        """Publish feedback to the client."""
        self._server.publish_feedback(self._tracker.status, feedback)


def _nothing(handle: Any) -> None:
    """Do nothing: the default of a server's callbacks."""


_BEFORE_CANCEL = (
    "This goal handle was canceled by the action server because its timestamp is before the timestamp of the "
    "last cancel request"
)
_REPLACED = "This goal was canceled because another goal was received by the simple action server"
_TAKEN = "This goal has been accepted by the simple action server"
"""Texts of a status on the wire, as actionlib sends them."""


class ActionServer(_UsesRospy):
    """Receives goals and requests for cancellation, and reports about all goals."""

    def __init__(
        self,
        ns: str,
        ActionSpec: Any,  # noqa: N803 - actionlib's name
        goal_cb: Any,
        cancel_cb: Any = _nothing,
        auto_start: bool = True,
    ) -> None:
        self.ns = ns
        self.kinds = _ActionTypes(ActionSpec)
        self.goal_callback, self.cancel_callback = goal_cb or _nothing, cancel_cb or _nothing
        self.started = False
        self.status_list: list[_Tracker] = []
        self.lock = Lock(self.rospy.Publisher.sessions.kernel, f"{ns} (goals)")
        """Held while a goal or a cancellation is taken."""
        self._last_cancel: Ns = 0
        self._ends: list[Any] = []
        self._ids = _made(self, GoalIDGenerator)()
        if auto_start:
            self.rospy.logwarn(
                f"action server {ns}: auto_start is true; goals may come before it is complete, call start()"
            )
            self.start()

    def register_goal_callback(self, cb: Any) -> None:
        """Call *cb* with the handle of each new goal."""
        self.goal_callback = cb

    def register_cancel_callback(self, cancel_cb: Any) -> None:
        """Call *cancel_cb* with the handle of each goal whose cancellation is requested."""
        self.cancel_callback = cancel_cb

    def start(self) -> None:
        """Join the topics and accept goals."""
        if self.started:
            return
        rospy, ns = self.rospy, self.ns
        depth = rospy.get_param("actionlib_server_pub_queue_size", 50)
        found = rospy.search_param("actionlib_status_frequency")
        frequency = float(rospy.get_param(found) if found else _FREQUENCY_HZ)
        self._kept: Ns = as_ns(float(rospy.get_param("~status_list_timeout", _KEPT_S)))
        self._status = rospy.Publisher(f"{ns}/status", GoalStatusArray, latch=True, queue_size=depth)
        self._result = rospy.Publisher(f"{ns}/result", self.kinds.action_result, queue_size=depth)
        self._feedback = rospy.Publisher(f"{ns}/feedback", self.kinds.action_feedback, queue_size=depth)
        self.started = True
        self._ends = [
            rospy.Subscriber(f"{ns}/goal", self.kinds.action_goal, self._locked(self._on_goal)),
            rospy.Subscriber(f"{ns}/cancel", GoalID, self._locked(self._on_cancel)),
        ]
        self._timer = None
        if frequency > 0.0:
            self._timer = rospy.Timer(rospy.Duration(1.0 / frequency), lambda _: self.publish_status())
        self.publish_status()

    def stop(self) -> None:
        """Leave the topics."""
        if self.started:
            self.started = False
            if self._timer is not None:
                self._timer.shutdown()
            for one in (*self._ends, self._status, self._result, self._feedback):
                one.unregister()

    def _locked(self, call: Callable[[Any], None]) -> Callable[[Any], None]:
        def run(message: Any) -> None:
            with self.lock:
                call(message)

        return run

    def _on_goal(self, message: Any) -> None:
        if not self.started:
            return
        for known in self.status_list:
            if known.status.goal_id.id == message.goal_id.id:
                if known.status.status == GoalStatus.RECALLING:  # its cancellation came before it
                    known.status.status = GoalStatus.RECALLED
                    self.publish_result(known.status, None)
                return
        status = GoalStatus(goal_id=message.goal_id, status=GoalStatus.PENDING)
        if not status.goal_id.id:
            status.goal_id = self._ids.generate_ID()
        if not status.goal_id.stamp.to_nsec():
            status.goal_id.stamp = self.now()
        tracker = _Tracker(status, message)
        self.status_list.append(tracker)
        handle = tracker.handle(self)
        if 0 < message.goal_id.stamp.to_nsec() <= self._last_cancel:
            handle.set_canceled(None, _BEFORE_CANCEL)
        else:
            self.goal_callback(handle)

    def _on_cancel(self, goal_id: Any) -> None:
        if not self.started:
            return
        stamp, known = goal_id.stamp.to_nsec(), False
        for tracker in list(self.status_list):
            own = tracker.status.goal_id
            known = known or own.id == goal_id.id
            everything = not goal_id.id and not stamp
            if everything or own.id == goal_id.id or 0 < own.stamp.to_nsec() <= stamp:
                handle = tracker.handle(self)
                if handle.set_cancel_requested():
                    self.cancel_callback(handle)
        if goal_id.id and not known:
            self.status_list.append(_Tracker(GoalStatus(goal_id=goal_id, status=GoalStatus.RECALLING)))
        self._last_cancel = max(self._last_cancel, stamp)

    def publish_result(self, status: Any, result: Any) -> None:
        """Publish the result of a goal and the status of all."""
        message = self.kinds.action_result(status=status, result=result or self.kinds.result())
        message.header.stamp = self.now()
        self._result.publish(message)
        self.publish_status()

    def publish_feedback(self, status: Any, feedback: Any) -> None:
        """Publish feedback of a goal."""
        message = self.kinds.action_feedback(status=status, feedback=feedback)
        message.header.stamp = self.now()
        self._feedback.publish(message)

    def publish_status(self) -> None:
        """Publish the status of all goals, and forget those whose handles are gone for some time."""
        now = self.now()
        for tracker in self.status_list:
            if tracker.released is None and tracker.held() is None:
                tracker.released = now
        self.status_list = [
            one
            for one in self.status_list
            if one.released is None or (now - one.released).to_nsec() <= self._kept
        ]
        message = GoalStatusArray(status_list=[one.status for one in self.status_list])
        message.header.stamp = now
        self._status.publish(message)


class SimpleActionServer(_UsesRospy):
    """Executes one goal at a time; a new goal preempts the one before.

    *execute_cb* is called with each goal in a thread of its own. Without it a file takes the goals itself.
    """

    def __init__(
        self,
        name: str,
        ActionSpec: Any,  # noqa: N803 - actionlib's name
        execute_cb: Any = None,
        auto_start: bool = True,
    ) -> None:
        self.execute_callback = execute_cb
        self.goal_callback: Any = None
        self.preempt_callback: Any = None
        self.new_goal = self.preempt_request = self.new_goal_preempt_request = False
        self.current_goal, self.next_goal = ServerGoalHandle(), ServerGoalHandle()
        self._changed = self.signal(f"{name} (a goal)")
        self._result = _ActionTypes(ActionSpec).result
        if execute_cb is not None:
            session = self.rospy.Publisher.sessions.initialised()
            session.spawn(self._execute_goals, f"goals of {name}")
        self.action_server = _made(self, ActionServer)(
            name, ActionSpec, self._on_goal, self._on_preempt, auto_start
        )

    def start(self) -> None:
        """Join the topics and accept goals."""
        self.action_server.start()

    def accept_new_goal(self) -> Any:
        """Return the goal that has arrived and end the one before; None, with an error, if there is none."""
        with self.action_server.lock:
            if not self.new_goal or self.next_goal.get_goal() is None:
                self.rospy.logerr("accept_new_goal: there is no new goal")
                return None
            if self.is_active() and self.current_goal != self.next_goal:
                self.current_goal.set_canceled(None, _REPLACED)
            self.current_goal, self.new_goal = self.next_goal, False
            self.preempt_request, self.new_goal_preempt_request = self.new_goal_preempt_request, False
            self.current_goal.set_accepted(_TAKEN)
            return self.current_goal.get_goal()

    def is_new_goal_available(self) -> bool:
        """Return whether a goal has arrived that was not accepted yet."""
        return self.new_goal

    def is_preempt_requested(self) -> bool:
        """Return whether the current goal is to be ended."""
        return self.preempt_request

    def is_active(self) -> bool:
        """Return whether there is a goal that has not ended."""
        if self.current_goal.get_goal() is None:
            return False
        return self.current_goal.get_goal_status().status in (GoalStatus.ACTIVE, GoalStatus.PREEMPTING)

    def set_succeeded(self, result: Any = None, text: str = "") -> None:
        """End the goal as succeeded."""
        self.current_goal.set_succeeded(result, text)

    def set_aborted(self, result: Any = None, text: str = "") -> None:
        """End the goal as aborted."""
        self.current_goal.set_aborted(result, text)

    def set_preempted(self, result: Any = None, text: str = "") -> None:
        """End the goal as preempted."""
        self.current_goal.set_canceled(result, text)

    def publish_feedback(self, feedback: Any) -> None:
        """Publish feedback to the client."""
        self.current_goal.publish_feedback(feedback)

    def get_default_result(self) -> Any:
        """Return an empty result."""
        return self._result()

    def register_goal_callback(self, cb: Any) -> None:
        """Call *cb* without arguments when a goal arrives. Not together with ``execute_cb``."""
        if self.execute_callback is not None:
            self.rospy.logwarn("register_goal_callback: the server has an execute_cb, which takes the goals")
        else:
            self.goal_callback = cb

    def register_preempt_callback(self, cb: Any) -> None:
        """Call *cb* without arguments when the current goal is to be ended."""
        self.preempt_callback = cb

    def _on_goal(self, handle: ServerGoalHandle) -> None:
        stamp = handle.get_goal_id().stamp
        waiting = (one for one in (self.current_goal, self.next_goal) if one.get_goal() is not None)
        if any(stamp < one.get_goal_id().stamp for one in waiting):
            handle.set_canceled(None, _REPLACED)
            return
        if self.next_goal.get_goal() is not None and self.next_goal != self.current_goal:
            self.next_goal.set_canceled(None, _REPLACED)
        self.next_goal, self.new_goal, self.new_goal_preempt_request = handle, True, False
        if self.is_active():
            self._preempt()
        if self.goal_callback is not None:
            self.goal_callback()
        self._changed.notify()

    def _on_preempt(self, handle: ServerGoalHandle) -> None:
        if handle == self.current_goal:
            self._preempt()
        else:
            self.new_goal_preempt_request = True

    def _preempt(self) -> None:
        self.preempt_request = True
        if self.preempt_callback is not None:
            self.preempt_callback()

    def _execute_goals(self) -> None:
        while not self.rospy.is_shutdown():
            self._changed.wait_for(lambda: self.new_goal, ends_activation=True)
            goal = self.accept_new_goal()
            if goal is None:
                continue
            try:
                self.execute_callback(goal)
            except ROSInterruptException:
                return
            except Exception as error:
                session = self.rospy.Publisher.sessions.initialised()
                session.report_failure("execute_cb", error)
                self.set_aborted(None, f"Exception in execute callback: {error}")
            if self.is_active():
                self.rospy.logwarn("execute_cb has returned without an end of its goal, which is aborted")
                self.set_aborted(None, "No terminal state was set.")


def _made(user: _UsesRospy, kind: type) -> Any:
    """Return *kind* with the rospy of *user*."""
    return type(kind.__name__, (kind,), {"rospy": user.rospy})


for _states in (CommState, TerminalState, SimpleGoalState, GoalStatus):
    _states.to_string = classmethod(get_name_of_constant)  # type: ignore[union-attr]  # as actionlib adds it

_PLAIN = (
    ActionException, ClientGoalHandle, CommState, GoalID, GoalStatus, GoalStatusArray, ServerGoalHandle,
    SimpleGoalState, TerminalState,
)  # fmt: skip
_BOUND = (ActionClient, ActionServer, GoalIDGenerator, SimpleActionClient, SimpleActionServer)
_SUBMODULES = {
    "action_client": (
        *("ActionClient", "ClientGoalHandle", "CommState", "TerminalState", "get_name_of_constant"),
        *("GoalID", "GoalStatus", "GoalStatusArray"),
    ),
    "action_server": ("ActionServer",),
    "exceptions": ("ActionException",),
    "goal_id_generator": ("GoalIDGenerator",),
    "server_goal_handle": ("ServerGoalHandle",),
    "simple_action_client": ("SimpleActionClient", "SimpleGoalState", "GoalStatus", "get_name_of_constant"),
    "simple_action_server": ("SimpleActionServer",),
}


def modules(rospy: ModuleType) -> dict[str, ModuleType]:
    """Return the modules of ``actionlib`` of one run by name.

    Args:
        rospy: Module that clients and servers use.
    """
    names: dict[str, Any] = {one.__name__.rpartition(".")[2]: one for one in _PLAIN}
    names["get_name_of_constant"] = get_name_of_constant
    names |= {kind.__name__: type(kind.__name__, (kind,), {"rospy": rospy}) for kind in _BOUND}
    parts = {
        part: library_module(f"actionlib.{part}", {name: names[name] for name in inside})
        for part, inside in _SUBMODULES.items()
    }
    return {
        "actionlib": library_module("actionlib", {**names, **parts}),
        **{f"actionlib.{part}": module for part, module in parts.items()},
    }
