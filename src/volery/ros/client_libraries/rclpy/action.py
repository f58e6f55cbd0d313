"""rclpy's actions, built of services and topics as in ROS 2: ``_action/send_goal`` and so on."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import Any

import numpy as np

from volery.kernel.waiting import Signal
from volery.ros.client_libraries.rclpy.entities import qos_profile_action_status_default
from volery.ros.client_libraries.rclpy.executors import CallbackGroup, Future
from volery.ros.client_libraries.rclpy.node import Node
from volery.ros.messages import message_class, new

_CANCEL = "action_msgs/srv/CancelGoal"


class GoalResponse(IntEnum):
    """Whether a server accepts a goal."""

    REJECT = 1
    ACCEPT = 2


class CancelResponse(IntEnum):
    """Whether a server accepts the cancellation of a goal."""

    REJECT = 1
    ACCEPT = 2


class Status(IntEnum):
    """Goal states of ``action_msgs/msg/GoalStatus``."""

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


def _action_type(caller: str, given: Any) -> Any:
    if not hasattr(given, "SendGoal"):
        raise TypeError(
            f"{caller}: {given!r} is no action class; import one, as in example_interfaces.action"
        )
    return given


def _key(goal_id: Any) -> bytes:
    return bytes(np.asarray(goal_id.uuid, np.uint8))


class ServerGoalHandle:
    """A goal on the side of the server, the argument of ``execute_callback``."""

    def __init__(self, server: ActionServer, goal_id: Any, request: Any) -> None:
        self._server = server
        self.goal_id = goal_id
        self.request = request
        self.status = Status.ACCEPTED
        self.result: Any = None
        self.ended = Signal(server.node.context.kernel, f"{server.name} (result)")

    @property
    def is_active(self) -> bool:
        """Whether the goal has not ended yet."""
        return self.status not in _ENDED

    @property
    def is_cancel_requested(self) -> bool:
        """Whether a client has requested the cancellation."""
        return self.status is Status.CANCELING

    def publish_feedback(self, feedback: Any) -> None:
        """Publish feedback to the client."""
        self._server.publish_feedback(self, feedback)

    def _set_status(self, status: Status) -> None:
        self.status = status
        self._server.publish_status()

    def execute(self) -> None:
        """Run the execute callback."""
        if self.status is Status.ACCEPTED:
            self._set_status(Status.EXECUTING)
        self._server.execute(self)

    def succeed(self) -> None:
        """Set the status SUCCEEDED."""
        self._set_status(Status.SUCCEEDED)

    def abort(self) -> None:
        """Set the status ABORTED."""
        self._set_status(Status.ABORTED)

    def canceled(self) -> None:
        """Set the status CANCELED."""
        self._set_status(Status.CANCELED)

    def request_cancel(self) -> None:
        """Set the status CANCELING."""
        self._set_status(Status.CANCELING)

    def end(self, result: Any) -> None:
        """Store the result of the execute callback."""
        if self.is_active:
            self._set_status(Status.ABORTED)
        self.result = result
        self.ended.notify()


class ActionServer:
    """Executes goals, each in a task of its own, as the threads of an executor would."""

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
        self._on_execute, self._on_goal, self._on_cancel = execute_callback, goal_callback, cancel_callback
        self._on_accepted = handle_accepted_callback
        self._goals: dict[bytes, ServerGoalHandle] = {}
        group = callback_group or node.default_callback_group
        at = f"{action_name}/_action"
        self._services = [
            node.create_service(self._type.SendGoal, f"{at}/send_goal", self._accept, callback_group=group),
            node.create_service(_CancelType, f"{at}/cancel_goal", self._cancel, callback_group=group),
            node.create_waiting_service(self._type.GetResult, f"{at}/get_result", self._result),
        ]
        self._feedback = node.create_publisher(self._type.FeedbackMessage, f"{at}/feedback", 10)
        status = message_class("action_msgs/msg/GoalStatusArray")
        self._status = node.create_publisher(status, f"{at}/status", qos_profile_action_status_default)

    def _accept(self, request: Any, response: Any) -> Any:
        handle = ServerGoalHandle(self, request.goal_id, request.goal)
        response.accepted = self._on_goal(request.goal) == GoalResponse.ACCEPT
        response.stamp = self.node.get_clock().now().to_msg()
        if response.accepted:
            self._goals[_key(request.goal_id)] = handle
            self.publish_status()
            self._on_accepted(handle)
        return response

    def execute(self, handle: ServerGoalHandle) -> None:
        """Run the execute callback for a goal in a task of its own."""

        def body() -> None:
            result = None
            try:
                result = self._on_execute(handle)
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

    def publish_feedback(self, handle: ServerGoalHandle, feedback: Any) -> None:
        """Publish feedback of a goal."""
        self._feedback.publish(self._type.FeedbackMessage(goal_id=handle.goal_id, feedback=feedback))

    def publish_status(self) -> None:
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
        """Accept no more goals."""
        for service in self._services:
            self.node.destroy_service(service)


class ClientGoalHandle:
    """A goal on the side of the client that sent it."""

    def __init__(self, client: ActionClient, goal_id: Any, answer: Any) -> None:
        self._client = client
        self.goal_id = goal_id
        self.accepted: bool = answer.accepted
        self.stamp = answer.stamp
        self.status = Status.ACCEPTED if answer.accepted else Status.UNKNOWN

    def get_result_async(self) -> Future:
        """Return the future of the result (``.status``, ``.result``)."""
        return self._client.results.call_async(self._client.type.GetResult.Request(goal_id=self.goal_id))

    def cancel_goal_async(self) -> Future:
        """Request the cancellation of the goal."""
        info = new("action_msgs/msg/GoalInfo", goal_id=self.goal_id)
        return self._client.cancels.call_async(_CancelType.Request(goal_info=info))


class ActionClient:
    """Sends goals and receives their feedback and results."""

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
        self._feedback_subscription = node.create_subscription(
            self.type.FeedbackMessage, f"{at}/feedback", self._on_feedback, 10, callback_group=group
        )

    def server_is_ready(self) -> bool:
        """Return whether a server is available."""
        return self._goals.service_is_ready() and self.results.service_is_ready()

    def wait_for_server(self, timeout_sec: float | None = None) -> bool:
        """Block until a server is available; return False after a time-out."""
        ready = self._goals.wait_for_service(timeout_sec)
        return ready and self.results.wait_for_service(timeout_sec)

    def send_goal_async(
        self, goal: Any, feedback_callback: Callable[[Any], Any] | None = None, goal_uuid: Any = None
    ) -> Future:
        """Send a goal; return the future of its handle."""
        if not isinstance(goal, self.type.Goal):
            raise TypeError(f"Expected {self.type.Goal}, got {type(goal)}")
        goal_id = goal_uuid or self._next_id()
        if feedback_callback is not None:
            self._feedbacks[_key(goal_id)] = feedback_callback
        answered = self._goals.call_async(self.type.SendGoal.Request(goal_id=goal_id, goal=goal))
        handle = Future(executor=self._node.executor)

        def set_handle(answer: Future) -> None:
            problem = answer.exception()
            if problem is not None:
                handle.set_exception(problem)
            else:
                handle.set_result(ClientGoalHandle(self, goal_id, answer.result()))

        answered.add_done_callback(set_handle)
        return handle

    def _next_id(self) -> Any:
        """Return an id that is unique within a run and the same in each run: node name and counter."""
        self._sent += 1
        words = f"{self._node.get_fully_qualified_name()}{self._name}".encode()[-12:].rjust(12, b"\0")
        data = np.frombuffer(words + self._sent.to_bytes(4, "big"), np.uint8).copy()
        return new("unique_identifier_msgs/msg/UUID", uuid=data)

    def _on_feedback(self, message: Any) -> None:
        callback = self._feedbacks.get(_key(message.goal_id))
        if callback is not None:
            callback(message)

    def send_goal(self, goal: Any, **options: Any) -> Any:
        """Send a goal and block until an executor in another task has processed its result."""
        done = Signal(self._node.context.kernel, f"{self._name} (a result, which an executor takes in)")
        handle = self.send_goal_async(goal, **options)
        handle.add_done_callback(lambda _: done.notify())
        done.wait_for(handle.done)
        result = handle.result().get_result_async()
        result.add_done_callback(lambda _: done.notify())
        done.wait_for(result.done)
        return result.result()

    def destroy(self) -> None:
        """Destroy the clients and the subscription of the action."""
        for client in (self._goals, self.cancels, self.results):
            self._node.destroy_client(client)
        self._node.destroy_subscription(self._feedback_subscription)


ACTION = {
    "ActionClient": ActionClient,
    "ActionServer": ActionServer,
    "CancelResponse": CancelResponse,
    "GoalResponse": GoalResponse,
}
"""Content of ``rclpy.action``."""
