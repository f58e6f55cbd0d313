"""rclpy's actions, made of services and topics as ROS 2 makes them: ``_action/send_goal`` and so on."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import TYPE_CHECKING, Any

import numpy as np

from volery.kernel.waiting import Signal
from volery.ros.client_libraries.rclpy.executors import CallbackGroup, Future
from volery.ros.client_libraries.rclpy.qos import qos_profile_action_status_default
from volery.ros.messages import message_class, new

if TYPE_CHECKING:
    from volery.ros.client_libraries.rclpy.node import Node

_CANCEL = "action_msgs/srv/CancelGoal"


class GoalResponse(IntEnum):
    """Whether a server takes a goal."""

    REJECT = 1
    ACCEPT = 2


class CancelResponse(IntEnum):
    """Whether a server lets a goal be cancelled."""

    REJECT = 1
    ACCEPT = 2


class Status(IntEnum):
    """As ``action_msgs/msg/GoalStatus``."""

    UNKNOWN = 0
    ACCEPTED = 1
    EXECUTING = 2
    CANCELING = 3
    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6


_ENDED = (Status.SUCCEEDED, Status.CANCELED, Status.ABORTED)


class _CancelType:
    _type = _CANCEL
    Request = message_class(f"{_CANCEL}_Request")
    Response = message_class(f"{_CANCEL}_Response")


def _action_type(what: str, given: Any) -> Any:
    if not hasattr(given, "SendGoal"):
        raise TypeError(f"{what}: {given!r} is no action class; import one, as in example_interfaces.action")
    return given


def _key(goal_id: Any) -> bytes:
    return bytes(np.asarray(goal_id.uuid, np.uint8))


class ServerGoalHandle:
    """A goal, as the server's ``execute_callback`` sees it."""

    def __init__(self, server: ActionServer, goal_id: Any, request: Any) -> None:
        self._server = server
        self.goal_id = goal_id
        self.request = request
        self.status = Status.ACCEPTED
        self.result: Any = None
        self.ended = Signal(server.node.context.kernel, f"{server.name} (result)")

    @property
    def is_active(self) -> bool:
        """Whether it is still being worked at."""
        return self.status not in _ENDED

    @property
    def is_cancel_requested(self) -> bool:
        """Whether a client wants it cancelled."""
        return self.status is Status.CANCELING

    def publish_feedback(self, feedback: Any) -> None:
        """Tell the client how far it is."""
        self._server.feed_back(self, feedback)

    def _become(self, status: Status) -> None:
        self.status = status
        self._server.tell_status()

    def execute(self) -> None:
        """Work at it now."""
        if self.status is Status.ACCEPTED:
            self._become(Status.EXECUTING)
        self._server.work_at(self)

    def succeed(self) -> None:
        """It is reached."""
        self._become(Status.SUCCEEDED)

    def abort(self) -> None:
        """It will not be reached."""
        self._become(Status.ABORTED)

    def canceled(self) -> None:
        """It was given up as a client asked for."""
        self._become(Status.CANCELED)

    def request_cancel(self) -> None:
        """A client wants it cancelled."""
        self._become(Status.CANCELING)

    def end(self, result: Any) -> None:
        """The callback has returned."""
        if self.is_active:
            self._become(Status.ABORTED)
        self.result = result
        self.ended.notify()


class ActionServer:
    """Works at goals, each in a task of its own, as the executor's threads would."""

    def __init__(
        self,
        node: Node,
        action_type: Any,
        action_name: str,
        execute_callback: Callable[[ServerGoalHandle], Any],
        *,
        callback_group: CallbackGroup | None = None,
        goal_callback: Callable[[Any], Any] = lambda _: GoalResponse.ACCEPT,
        handle_accepted_callback: Callable[[ServerGoalHandle], Any] = lambda handle: handle.execute(),
        cancel_callback: Callable[[ServerGoalHandle], Any] = lambda _: CancelResponse.REJECT,
        **options: Any,
    ) -> None:
        self.node, self.name = node, action_name
        self._type = _action_type("ActionServer", action_type)
        self._execute, self._on_goal, self._on_cancel = execute_callback, goal_callback, cancel_callback
        self._on_accepted = handle_accepted_callback
        self._goals: dict[bytes, ServerGoalHandle] = {}
        group = callback_group or node.default_callback_group
        at = f"{action_name}/_action"
        self._services = [
            node.create_service(self._type.SendGoal, f"{at}/send_goal", self._take, callback_group=group),
            node.create_service(_CancelType, f"{at}/cancel_goal", self._cancel, callback_group=group),
            node.create_waiting_service(self._type.GetResult, f"{at}/get_result", self._result),
        ]
        self._feedback = node.create_publisher(self._type.FeedbackMessage, f"{at}/feedback", 10)
        status = message_class("action_msgs/msg/GoalStatusArray")
        self._status = node.create_publisher(status, f"{at}/status", qos_profile_action_status_default)

    def _take(self, request: Any, response: Any) -> Any:
        handle = ServerGoalHandle(self, request.goal_id, request.goal)
        response.accepted = self._on_goal(request.goal) == GoalResponse.ACCEPT
        response.stamp = self.node.get_clock().now().to_msg()
        if response.accepted:
            self._goals[_key(request.goal_id)] = handle
            self.tell_status()
            self._on_accepted(handle)
        return response

    def work_at(self, handle: ServerGoalHandle) -> None:
        """Have the user's callback work at a goal."""

        def body() -> None:
            result = None
            try:
                result = self._execute(handle)
            except Exception as error:
                self.node.get_logger().error(f"Error raised in execute callback: {error}")
            handle.end(result if result is not None else self._type.Result())

        self.node.context.spawn(body, f"goal of {self.name}")

    def _cancel(self, request: Any, response: Any) -> Any:
        wanted = _key(request.goal_info.goal_id)
        for key, handle in self._goals.items():
            chosen = key == wanted or not any(wanted)
            if chosen and handle.is_active and self._on_cancel(handle) == CancelResponse.ACCEPT:
                handle.request_cancel()
                response.goals_canceling.append(new("action_msgs/msg/GoalInfo", goal_id=handle.goal_id))
        response.return_code = 0 if response.goals_canceling else 1
        return response

    def _result(self, request: Any, response: Any) -> Any:
        handle = self._goals.get(_key(request.goal_id))
        if handle is not None:
            handle.ended.wait_for(lambda: handle.result is not None)
            response.status, response.result = int(handle.status), handle.result
        return response

    def feed_back(self, handle: ServerGoalHandle, feedback: Any) -> None:
        """Publish the feedback of a goal."""
        self._feedback.publish(self._type.FeedbackMessage(goal_id=handle.goal_id, feedback=feedback))

    def tell_status(self) -> None:
        """Publish the status of all goals."""
        listed = [
            new(
                "action_msgs/msg/GoalStatus",
                goal_info=new("action_msgs/msg/GoalInfo", goal_id=handle.goal_id),
                status=int(handle.status),
            )
            for handle in self._goals.values()
        ]
        self._status.publish(new("action_msgs/msg/GoalStatusArray", status_list=listed))

    def destroy(self) -> None:
        """Take no more goals."""
        for service in self._services:
            self.node.destroy_service(service)


class ClientGoalHandle:
    """A goal, as the client that sent it sees it."""

    def __init__(self, client: ActionClient, goal_id: Any, answer: Any) -> None:
        self._client = client
        self.goal_id = goal_id
        self.accepted: bool = answer.accepted
        self.stamp = answer.stamp
        self.status = Status.ACCEPTED if answer.accepted else Status.UNKNOWN

    def get_result_async(self) -> Future:
        """The result (``.status``, ``.result``), once there is one."""
        return self._client.results.call_async(self._client.type.GetResult.Request(goal_id=self.goal_id))

    def cancel_goal_async(self) -> Future:
        """Ask the server to give it up."""
        info = new("action_msgs/msg/GoalInfo", goal_id=self.goal_id)
        return self._client.cancels.call_async(_CancelType.Request(goal_info=info))


class ActionClient:
    """Sends goals."""

    def __init__(
        self,
        node: Node,
        action_type: Any,
        action_name: str,
        *,
        callback_group: CallbackGroup | None = None,
        **options: Any,
    ) -> None:
        self.type = _action_type("ActionClient", action_type)
        self._node, self._name = node, action_name
        self._sent = 0
        self._feedbacks: dict[bytes, Callable[[Any], Any]] = {}
        at, group = f"{action_name}/_action", callback_group
        self._goals = node.create_client(self.type.SendGoal, f"{at}/send_goal", callback_group=group)
        self.cancels = node.create_client(_CancelType, f"{at}/cancel_goal", callback_group=group)
        self.results = node.create_client(self.type.GetResult, f"{at}/get_result", callback_group=group)
        self._heard = node.create_subscription(
            self.type.FeedbackMessage, f"{at}/feedback", self._hear, 10, callback_group=group
        )

    def server_is_ready(self) -> bool:
        """Whether somebody takes goals."""
        return self._goals.service_is_ready() and self.results.service_is_ready()

    def wait_for_server(self, timeout_sec: float | None = None) -> bool:
        """Block until somebody takes goals; False if nobody does in time."""
        ready = self._goals.wait_for_service(timeout_sec)
        return ready and self.results.wait_for_service(timeout_sec)

    def send_goal_async(
        self, goal: Any, feedback_callback: Callable[[Any], Any] | None = None, goal_uuid: Any = None
    ) -> Future:
        """Send a goal; the future's result is a handle on it."""
        if not isinstance(goal, self.type.Goal):
            raise TypeError(f"Expected {self.type.Goal}, got {type(goal)}")
        goal_id = goal_uuid or self._next_id()
        if feedback_callback is not None:
            self._feedbacks[_key(goal_id)] = feedback_callback
        answered = self._goals.call_async(self.type.SendGoal.Request(goal_id=goal_id, goal=goal))
        handed = Future(executor=self._node.executor)

        def hand_over(answer: Future) -> None:
            problem = answer.exception()
            if problem is not None:
                handed.set_exception(problem)
            else:
                handed.set_result(ClientGoalHandle(self, goal_id, answer.result()))

        answered.add_done_callback(hand_over)
        return handed

    def _next_id(self) -> Any:
        """Unique within a run, and the same in each: the node's name and a number."""
        self._sent += 1
        words = f"{self._node.get_fully_qualified_name()}{self._name}".encode()[-12:].rjust(12, b"\0")
        data = np.frombuffer(words + self._sent.to_bytes(4, "big"), np.uint8).copy()
        return new("unique_identifier_msgs/msg/UUID", uuid=data)

    def _hear(self, message: Any) -> None:
        callback = self._feedbacks.get(_key(message.goal_id))
        if callback is not None:
            callback(message)

    def send_goal(self, goal: Any, **options: Any) -> Any:
        """Send a goal and block until its result is there: somebody else must spin meanwhile."""
        done = Signal(self._node.context.kernel, f"{self._name} (a result, which an executor takes in)")
        handed = self.send_goal_async(goal, **options)
        handed.add_done_callback(lambda _: done.notify())
        done.wait_for(handed.done)
        result = handed.result().get_result_async()
        result.add_done_callback(lambda _: done.notify())
        done.wait_for(result.done)
        return result.result()

    def destroy(self) -> None:
        """Send no more goals."""
        for client in (self._goals, self.cancels, self.results):
            self._node.destroy_client(client)
        self._node.destroy_subscription(self._heard)


ACTION = {
    "ActionClient": ActionClient,
    "ActionServer": ActionServer,
    "CancelResponse": CancelResponse,
    "GoalResponse": GoalResponse,
}
"""``rclpy.action``."""
