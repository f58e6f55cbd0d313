"""rclpy's actions, built of services and topics as in ROS 2: ``_action/send_goal`` and so on."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import Any
from weakref import WeakValueDictionary

import numpy as np

from volery.kernel.waiting import Signal
from volery.ros.client_libraries.rclpy.context import RCLError
from volery.ros.client_libraries.rclpy.executors import CallbackGroup, Future, await_or_execute
from volery.ros.client_libraries.rclpy.node import Node
from volery.ros.client_libraries.rclpy.qos import qos_profile_action_status_default
from volery.ros.messages import message_class, new
from volery.ros.messages.message import nanoseconds

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


Callback = Callable[[Any], Any]


class ServerGoalHandle:
    """A goal on the side of the server, the argument of ``execute_callback``."""

    def __init__(self, server: ActionServer, goal_id: Any, request: Any) -> None:
        self._server = server
        self.goal_id = goal_id
        self.request = request
        self.status = Status.ACCEPTED
        self.stamp = server.node.get_clock().now().to_msg()
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
        if not isinstance(feedback, self._server.action_type.Feedback):
            raise TypeError(f"Expected {self._server.action_type.Feedback}, got {type(feedback)}")
        self._server.publish_feedback(self, feedback)

    def _set_status(self, status: Status, *before: Status) -> None:
        if self.status not in before:
            raise RCLError(
                f"Failed to update goal state: goal_handle attempted invalid transition from state "
                f"{self.status.name} to {status.name}"
            )
        self.status = status
        self._server.publish_status()

    def execute(self, execute_callback: Callable[[ServerGoalHandle], Any] | None = None) -> None:
        """Let the executor run the execute callback."""
        if self.status is not Status.CANCELING:
            self._set_status(Status.EXECUTING, Status.ACCEPTED)
        self._server.execute(self, execute_callback)

    def succeed(self) -> None:
        """Set the status SUCCEEDED."""
        self._set_status(Status.SUCCEEDED, Status.EXECUTING, Status.CANCELING)

    def abort(self) -> None:
        """Set the status ABORTED."""
        self._set_status(Status.ABORTED, Status.EXECUTING, Status.CANCELING)

    def canceled(self) -> None:
        """Set the status CANCELED."""
        self._set_status(Status.CANCELED, Status.CANCELING)

    def request_cancel(self) -> None:
        """Set the status CANCELING."""
        self._set_status(Status.CANCELING, Status.ACCEPTED, Status.EXECUTING)

    def end(self, result: Any) -> None:
        """Store the result of the execute callback."""
        if self.is_active:
            self.status = Status.ABORTED
            self._server.publish_status()
        self.result = result
        self.ended.notify()

    def destroy(self) -> None:
        """Do nothing: a handle holds no resources."""


def default_goal_callback(goal_request: Any) -> GoalResponse:
    """Accept each goal."""
    return GoalResponse.ACCEPT


def default_handle_accepted_callback(goal_handle: ServerGoalHandle) -> None:
    """Execute a goal at once."""
    goal_handle.execute()


def default_cancel_callback(cancel_request: Any) -> CancelResponse:
    """Reject each cancellation."""
    return CancelResponse.REJECT


class _CancelCode(IntEnum):
    """Answers of ``action_msgs/srv/CancelGoal``."""

    NONE = 0
    REJECTED = 1
    UNKNOWN_GOAL_ID = 2
    GOAL_TERMINATED = 3


class ActionServer:
    """Executes goals. The executor of the node runs all callbacks; the execute callback is a task of it."""

    def __init__(  # noqa: PLR0913 - rclpy's signature
        self,
        node: Node,
        action_type: Any,
        action_name: str,
        execute_callback: Callable[[ServerGoalHandle], Any],
        *,
        callback_group: CallbackGroup | None = None,
        goal_callback: Callback | None = None,
        handle_accepted_callback: Callback | None = None,
        cancel_callback: Callback | None = None,
        feedback_pub_qos_profile: Any = 10,
        status_pub_qos_profile: Any = qos_profile_action_status_default,
        **options: Any,
    ) -> None:
        self.node, self.name = node, action_name
        self.action_type = _action_type("ActionServer", action_type)
        self._on_goal: Callback
        self._on_cancel: Callback
        self._on_accepted: Callback
        self._on_execute: Callback
        self.register_goal_callback(goal_callback)
        self.register_cancel_callback(cancel_callback)
        self.register_handle_accepted_callback(handle_accepted_callback)
        self.register_execute_callback(execute_callback)
        self._goals: dict[bytes, ServerGoalHandle] = {}
        group = callback_group or node.default_callback_group
        at, kind = f"{action_name}/_action", self.action_type
        self._services = [
            node.create_service(kind.SendGoal, f"{at}/send_goal", self._accept, callback_group=group),
            node.create_service(_CancelType, f"{at}/cancel_goal", self._cancel, callback_group=group),
            node.create_waiting_service(kind.GetResult, f"{at}/get_result", self._result),
        ]
        self._feedback = node.create_publisher(
            kind.FeedbackMessage, f"{at}/feedback", feedback_pub_qos_profile
        )
        status = message_class("action_msgs/msg/GoalStatusArray")
        self._status = node.create_publisher(status, f"{at}/status", status_pub_qos_profile)

    def register_goal_callback(self, goal_callback: Callable[[Any], Any] | None) -> None:
        """Ask *goal_callback* whether a goal is accepted; None accepts each."""
        self._on_goal = goal_callback or default_goal_callback

    def register_cancel_callback(self, cancel_callback: Callable[[Any], Any] | None) -> None:
        """Ask *cancel_callback* whether a goal may be cancelled; None rejects each request."""
        self._on_cancel = cancel_callback or default_cancel_callback

    def register_handle_accepted_callback(
        self, handle_accepted_callback: Callable[[ServerGoalHandle], Any] | None
    ) -> None:
        """Call *handle_accepted_callback* with each accepted goal; None executes it."""
        self._on_accepted = handle_accepted_callback or default_handle_accepted_callback

    def register_execute_callback(self, execute_callback: Callable[[ServerGoalHandle], Any]) -> None:
        """Execute goals by *execute_callback*."""
        if not callable(execute_callback):
            raise TypeError("Failed to register goal execution callback: not callable")
        self._on_execute = execute_callback

    async def _accept(self, request: Any, response: Any) -> Any:
        handle = ServerGoalHandle(self, request.goal_id, request.goal)
        answer = await await_or_execute(self._on_goal, request.goal)
        if not isinstance(answer, GoalResponse):
            self.node.get_logger().warning(
                "Goal request callback did not return a GoalResponse type. Rejecting goal."
            )
        response.accepted = answer == GoalResponse.ACCEPT
        response.stamp = handle.stamp
        if response.accepted:
            self._goals[_key(request.goal_id)] = handle
            self.publish_status()
            self._after_answer(handle)
        return response

    def _after_answer(self, handle: ServerGoalHandle) -> None:
        """Call the callback of accepted goals once the client has been answered."""
        executor = self.node.executor
        if executor is None:
            self._on_accepted(handle)
        else:
            executor.create_task(self._on_accepted, handle)

    def execute(self, handle: ServerGoalHandle, callback: Callable[[Any], Any] | None) -> None:
        """Let the executor run the execute callback for a goal."""

        async def run() -> None:
            result = None
            try:
                result = await await_or_execute(callback or self._on_execute, handle)
            except Exception as error:
                self.node.get_logger().error(f"Error raised in execute callback: {error}")
            if handle.is_active:
                self.node.get_logger().warning(
                    f"Goal state not set, assuming aborted. Goal ID: {list(_key(handle.goal_id))}"
                )
            handle.end(result if result is not None else self.action_type.Result())

        executor = self.node.executor
        if executor is None:
            raise RuntimeError(f"{self.name}: no executor spins the node of the action server")
        executor.create_task(run)

    async def _cancel(self, request: Any, response: Any) -> Any:
        wanted, stamp = _key(request.goal_info.goal_id), nanoseconds(request.goal_info.stamp)
        known = self._goals.get(wanted)
        if any(wanted) and known is None and not stamp:
            response.return_code = _CancelCode.UNKNOWN_GOAL_ID
            return response
        if any(wanted) and known is not None and not known.is_active and not stamp:
            response.return_code = _CancelCode.GOAL_TERMINATED
            return response
        for key, handle in list(self._goals.items()):
            chosen = key == wanted or (not any(wanted) and not stamp)
            chosen = chosen or bool(stamp and nanoseconds(handle.stamp) <= stamp)
            if not (chosen and handle.is_active) or handle.status is Status.CANCELING:
                continue
            answer = await await_or_execute(self._on_cancel, handle)
            if answer == CancelResponse.ACCEPT and handle.is_active:
                handle.request_cancel()
                info = new("action_msgs/msg/GoalInfo", goal_id=handle.goal_id, stamp=handle.stamp)
                response.goals_canceling.append(info)
        return response

    def _result(self, request: Any, response: Any) -> Any:
        handle = self._goals.get(_key(request.goal_id))
        if handle is not None:
            handle.ended.wait_for(lambda: handle.result is not None)
            response.status, response.result = int(handle.status), handle.result
        return response

    def publish_feedback(self, handle: ServerGoalHandle, feedback: Any) -> None:
        """Publish feedback of a goal."""
        self._feedback.publish(self.action_type.FeedbackMessage(goal_id=handle.goal_id, feedback=feedback))

    def publish_status(self) -> None:
        """Publish the status of all goals."""
        listed = [
            new(
                "action_msgs/msg/GoalStatus",
                goal_info=new("action_msgs/msg/GoalInfo", goal_id=handle.goal_id, stamp=handle.stamp),
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
        self.status = int(Status.UNKNOWN)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ClientGoalHandle) and _key(self.goal_id) == _key(other.goal_id)

    def __hash__(self) -> int:
        return hash(_key(self.goal_id))

    def get_result_async(self) -> Future:
        """Return the future of the result (``.status``, ``.result``)."""
        return self._client.results.call_async(self._client.type.GetResult.Request(goal_id=self.goal_id))

    def get_result(self) -> Any:
        """Block until an executor in another task has processed the result."""
        return self._client.wait_for(self.get_result_async())

    def cancel_goal_async(self) -> Future:
        """Request the cancellation of the goal."""
        info = new("action_msgs/msg/GoalInfo", goal_id=self.goal_id)
        return self._client.cancels.call_async(_CancelType.Request(goal_info=info))

    def cancel_goal(self) -> Any:
        """Request the cancellation and block until an executor in another task has processed the answer."""
        return self._client.wait_for(self.cancel_goal_async())


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
        self._handles: WeakValueDictionary[bytes, ClientGoalHandle] = WeakValueDictionary()
        at, group = f"{action_name}/_action", callback_group
        self._goals = node.create_client(self.type.SendGoal, f"{at}/send_goal", callback_group=group)
        self.cancels = node.create_client(_CancelType, f"{at}/cancel_goal", callback_group=group)
        self.results = node.create_client(self.type.GetResult, f"{at}/get_result", callback_group=group)
        self._feedback_subscription = node.create_subscription(
            self.type.FeedbackMessage, f"{at}/feedback", self._on_feedback, 10, callback_group=group
        )
        self._status_subscription = node.create_subscription(
            message_class("action_msgs/msg/GoalStatusArray"),
            f"{at}/status",
            self._on_status,
            qos_profile_action_status_default,
            callback_group=group,
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
                made = ClientGoalHandle(self, goal_id, answer.result())
                if made.accepted:
                    self._handles[_key(goal_id)] = made
                handle.set_result(made)

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

    def _on_status(self, message: Any) -> None:
        for one in message.status_list:
            handle = self._handles.get(_key(one.goal_info.goal_id))
            if handle is not None and handle.status not in _ENDED:
                handle.status = one.status

    def wait_for(self, future: Future) -> Any:
        """Block until an executor in another task has completed *future*; return its result."""
        done = Signal(self._node.context.kernel, f"{self._name} (an answer, which an executor takes in)")
        future.on_done(done.notify)
        done.wait_for(future.done)
        return future.result()

    def send_goal(self, goal: Any, **options: Any) -> Any:
        """Send a goal and block until an executor in another task has processed its result."""
        handle = self.wait_for(self.send_goal_async(goal, **options))
        return handle.get_result() if handle.accepted else None

    def destroy(self) -> None:
        """Destroy the clients and the subscription of the action."""
        for client in (self._goals, self.cancels, self.results):
            self._node.destroy_client(client)
        self._node.destroy_subscription(self._feedback_subscription)
        self._node.destroy_subscription(self._status_subscription)


def get_action_names_and_types(node: Node) -> list[tuple[str, list[str]]]:
    """Return all actions that have a server or a client."""
    return _actions(node.get_topic_names_and_types())


def get_action_server_names_and_types_by_node(
    node: Node, remote_node_name: str, remote_node_namespace: str
) -> list[tuple[str, list[str]]]:
    """Return the actions that a node serves."""
    return _actions(node.get_publisher_names_and_types_by_node(remote_node_name, remote_node_namespace))


def get_action_client_names_and_types_by_node(
    node: Node, remote_node_name: str, remote_node_namespace: str
) -> list[tuple[str, list[str]]]:
    """Return the actions that a node calls."""
    return _actions(node.get_subscriber_names_and_types_by_node(remote_node_name, remote_node_namespace))


_FEEDBACK = "/_action/feedback"


def _actions(topics: list[tuple[str, list[str]]]) -> list[tuple[str, list[str]]]:
    return [
        (name.removesuffix(_FEEDBACK), [kind.removesuffix("_FeedbackMessage") for kind in kinds])
        for name, kinds in topics
        if name.endswith(_FEEDBACK)
    ]


GRAPH: dict[str, Any] = {
    one.__name__: one
    for one in (
        get_action_client_names_and_types_by_node,
        get_action_names_and_types,
        get_action_server_names_and_types_by_node,
    )
}
"""Content of ``rclpy.action.graph``."""
CLIENT: dict[str, Any] = {"ActionClient": ActionClient, "ClientGoalHandle": ClientGoalHandle}
"""Content of ``rclpy.action.client``."""
SERVER: dict[str, Any] = {
    "ActionServer": ActionServer,
    "CancelResponse": CancelResponse,
    "GoalResponse": GoalResponse,
    "ServerGoalHandle": ServerGoalHandle,
    **{
        one.__name__: one
        for one in (default_cancel_callback, default_goal_callback, default_handle_accepted_callback)
    },
}
"""Content of ``rclpy.action.server``."""
ACTION: dict[str, Any] = {
    **GRAPH,
    "ActionClient": ActionClient,
    "ActionServer": ActionServer,
    "CancelResponse": CancelResponse,
    "GoalResponse": GoalResponse,
}
"""Content of ``rclpy.action``."""
