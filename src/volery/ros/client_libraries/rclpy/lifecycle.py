"""``rclpy.lifecycle``: nodes that are configured, activated and so on by others, as ROS 2 has them.

States and transitions are those of https://design.ros2.org/articles/node_lifecycle.html, their numbers and
labels those of ``lifecycle_msgs`` and ``rcl_lifecycle``.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from functools import wraps
from typing import Any, NamedTuple

from volery.ros.client_libraries.rclpy.entities import Publisher
from volery.ros.client_libraries.rclpy.node import Node
from volery.ros.messages import message_class, new
from volery.ros.messages.packages import service_class


class TransitionCallbackReturn(IntEnum):
    """How a transition's callback ended, by the numbers of its transitions."""

    SUCCESS = 97
    FAILURE = 98
    ERROR = 99

    def to_label(self) -> str:
        """The label of the transition that follows."""
        return f"transition_{self.name.lower()}"


class LifecycleState(NamedTuple):
    """A state's number and label."""

    state_id: int
    label: str


UNCONFIGURED = LifecycleState(1, "unconfigured")
INACTIVE = LifecycleState(2, "inactive")
ACTIVE = LifecycleState(3, "active")
FINALIZED = LifecycleState(4, "finalized")
CONFIGURING = LifecycleState(10, "configuring")
CLEANING_UP = LifecycleState(11, "cleaningup")
SHUTTING_DOWN = LifecycleState(12, "shuttingdown")
ACTIVATING = LifecycleState(13, "activating")
DEACTIVATING = LifecycleState(14, "deactivating")
PROCESSING_ERROR = LifecycleState(15, "errorprocessing")
_STATES = (
    LifecycleState(0, "unknown"), UNCONFIGURED, INACTIVE, ACTIVE, FINALIZED,
    CONFIGURING, CLEANING_UP, SHUTTING_DOWN, ACTIVATING, DEACTIVATING, PROCESSING_ERROR,
)  # fmt: skip


class _Transition(NamedTuple):
    number: int
    label: str
    start: LifecycleState
    goal: LifecycleState


_ASKED = (
    _Transition(1, "configure", UNCONFIGURED, CONFIGURING),
    _Transition(2, "cleanup", INACTIVE, CLEANING_UP),
    _Transition(3, "activate", INACTIVE, ACTIVATING),
    _Transition(4, "deactivate", ACTIVE, DEACTIVATING),
    _Transition(5, "shutdown", UNCONFIGURED, SHUTTING_DOWN),
    _Transition(6, "shutdown", INACTIVE, SHUTTING_DOWN),
    _Transition(7, "shutdown", ACTIVE, SHUTTING_DOWN),
)
"""What others may ask for."""
_ENDS: dict[LifecycleState, tuple[str, int, LifecycleState, LifecycleState, LifecycleState]] = {
    CONFIGURING: ("on_configure", 10, INACTIVE, UNCONFIGURED, PROCESSING_ERROR),
    CLEANING_UP: ("on_cleanup", 20, UNCONFIGURED, INACTIVE, PROCESSING_ERROR),
    ACTIVATING: ("on_activate", 30, ACTIVE, INACTIVE, PROCESSING_ERROR),
    DEACTIVATING: ("on_deactivate", 40, INACTIVE, ACTIVE, PROCESSING_ERROR),
    SHUTTING_DOWN: ("on_shutdown", 50, FINALIZED, FINALIZED, PROCESSING_ERROR),
    PROCESSING_ERROR: ("on_error", 60, UNCONFIGURED, FINALIZED, FINALIZED),
}
"""What is called in a passing state, its first transition, and where success, failure and error lead."""


def _after(state: LifecycleState) -> list[_Transition]:
    """Where a passing state leads."""
    _, number, *goals = _ENDS[state]
    return [
        _Transition(number + index, outcome.to_label(), state, goal)
        for index, (outcome, goal) in enumerate(zip(TransitionCallbackReturn, goals, strict=True))
    ]


class ManagedEntity:
    """What goes along with its node's transitions. Each callback gets the state that is left."""

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """The node is being configured."""
        return TransitionCallbackReturn.SUCCESS

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """The node is being cleaned up."""
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """The node is being shut down."""
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """The node is being activated."""
        return TransitionCallbackReturn.SUCCESS

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """The node is being deactivated."""
        return TransitionCallbackReturn.SUCCESS

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """A transition ended with an error."""
        return TransitionCallbackReturn.SUCCESS


class SimpleManagedEntity(ManagedEntity):
    """Works while the node is active."""

    def __init__(self) -> None:
        self._enabled = False

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """It works from now on."""
        self._enabled = True
        return TransitionCallbackReturn.SUCCESS

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """It rests from now on."""
        self._enabled = False
        return TransitionCallbackReturn.SUCCESS

    @property
    def is_activated(self) -> bool:
        """Whether it works."""
        return self._enabled

    @staticmethod
    def when_enabled(wrapped: Any = None, *, when_not_enabled: Callable[[], Any] | None = None) -> Any:
        """A method that does nothing while the node is not active."""

        def decorator(method: Callable[..., Any]) -> Callable[..., None]:
            @wraps(method)
            def only_when_enabled(self: SimpleManagedEntity, *given: Any, **named: Any) -> None:
                if self._enabled:
                    method(self, *given, **named)
                elif when_not_enabled is not None:
                    when_not_enabled()

            return only_when_enabled

        return decorator if wrapped is None else decorator(wrapped)


class LifecyclePublisher(SimpleManagedEntity, Publisher):
    """Publishes while its node is active."""

    def __init__(self, *given: Any) -> None:
        SimpleManagedEntity.__init__(self)
        Publisher.__init__(self, *given)

    def publish(self, msg: Any) -> None:
        """Send a message, if the node is active."""
        if self._enabled:
            super().publish(msg)


class LifecycleNode(Node, ManagedEntity):
    """A node with a lifecycle: ``~/change_state`` and its like, ``~/transition_event``."""

    def __init__(
        self, node_name: str, *, enable_communication_interface: bool = True, **options: Any
    ) -> None:
        super().__init__(node_name, **options)
        self._state = UNCONFIGURED
        self._entities: list[ManagedEntity] = []
        self._events: Publisher | None = None
        if enable_communication_interface:
            kind = message_class("lifecycle_msgs/msg/TransitionEvent")
            self._events = self.create_publisher(kind, "~/transition_event", 10)
            self._serve()

    def _serve(self) -> None:
        for name, kind, answer in (
            ("change_state", "ChangeState", self._answer_change),
            ("get_state", "GetState", self._answer_state),
            ("get_available_states", "GetAvailableStates", self._answer_states),
            ("get_available_transitions", "GetAvailableTransitions", self._answer_transitions),
            ("get_transition_graph", "GetAvailableTransitions", self._answer_graph),
        ):
            self.create_service(service_class(f"lifecycle_msgs/srv/{kind}"), f"~/{name}", answer)

    def create_lifecycle_publisher(self, msg_type: Any, topic: str, qos: Any, **options: Any) -> Any:
        """A publisher that is silent while the node is not active."""
        made = self._keep(LifecyclePublisher(self, msg_type, topic, qos))
        self._entities.append(made)
        return made

    def destroy_lifecycle_publisher(self, publisher: LifecyclePublisher) -> bool:
        """Publish no longer."""
        self._entities.remove(publisher)
        return self.destroy_publisher(publisher)

    def add_managed_entity(self, entity: ManagedEntity) -> None:
        """Have it go along with the node's transitions."""
        self._entities.append(entity)

    # -- callbacks: what the node does by itself is to take its entities along

    def _all(self, callback: str, state: LifecycleState) -> TransitionCallbackReturn:
        for entity in self._entities:
            outcome: TransitionCallbackReturn = getattr(entity, callback)(state)
            if outcome is not TransitionCallbackReturn.SUCCESS:
                return outcome
        return TransitionCallbackReturn.SUCCESS

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Configure; entities come along."""
        return self._all("on_configure", state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Clean up; entities come along."""
        return self._all("on_cleanup", state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Shut down; entities come along."""
        return self._all("on_shutdown", state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Activate; entities come along."""
        return self._all("on_activate", state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Deactivate; entities come along."""
        return self._all("on_deactivate", state)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Get over an error; entities come along."""
        return self._all("on_error", state)

    # -- transitions

    def trigger_configure(self) -> TransitionCallbackReturn:
        """Have it configured."""
        return self._change("configure")

    def trigger_cleanup(self) -> TransitionCallbackReturn:
        """Have it cleaned up."""
        return self._change("cleanup")

    def trigger_activate(self) -> TransitionCallbackReturn:
        """Have it activated."""
        return self._change("activate")

    def trigger_deactivate(self) -> TransitionCallbackReturn:
        """Have it deactivated."""
        return self._change("deactivate")

    def trigger_shutdown(self) -> TransitionCallbackReturn:
        """Have it shut down."""
        return self._change("shutdown")

    def _available(self) -> list[_Transition]:
        return [one for one in _ASKED if one.start == self._state]

    def _change(self, label: str) -> TransitionCallbackReturn:
        wanted = next((one for one in self._available() if one.label == label), None)
        if wanted is None:
            raise RuntimeError(f"No transition matching {label} found for current state {self._state.label}")
        before = self._state
        self._go(wanted)
        outcome = self._pass(before)
        if outcome is TransitionCallbackReturn.ERROR:
            self._pass(before)
        return outcome

    def _pass(self, before: LifecycleState) -> TransitionCallbackReturn:
        """Have the callback of a passing state called, and go where its outcome leads."""
        try:
            outcome: TransitionCallbackReturn = getattr(self, _ENDS[self._state][0])(before)
        except Exception as error:
            self.get_logger().error(f"{_ENDS[self._state][0]}: {error}")
            outcome = TransitionCallbackReturn.ERROR
        self._go(next(one for one in _after(self._state) if one.label == outcome.to_label()))
        return outcome

    def _go(self, by: _Transition) -> None:
        self._state = by.goal
        if self._events is not None:
            event = _described(new("lifecycle_msgs/msg/TransitionEvent"), by)
            event.timestamp = self.get_clock().now().nanoseconds
            self._events.publish(event)

    # -- what others ask

    def _answer_change(self, request: Any, response: Any) -> Any:
        asked = request.transition
        found = next(
            (
                one
                for one in self._available()
                if (one.label == asked.label if asked.label else one.number == asked.id)
            ),
            None,
        )
        response.success = found is not None and self._change(found.label) is TransitionCallbackReturn.SUCCESS
        return response

    def _answer_state(self, request: Any, response: Any) -> Any:
        response.current_state.id, response.current_state.label = self._state
        return response

    def _answer_states(self, request: Any, response: Any) -> Any:
        response.available_states = [
            new("lifecycle_msgs/msg/State", id=number, label=label) for number, label in _STATES
        ]
        return response

    def _answer_transitions(self, request: Any, response: Any) -> Any:
        response.available_transitions = _descriptions(self._available())
        return response

    def _answer_graph(self, request: Any, response: Any) -> Any:
        ends = [one for state in _ENDS for one in _after(state)]
        response.available_transitions = _descriptions([*_ASKED, *ends])
        return response


def _descriptions(transitions: list[_Transition]) -> list[Any]:
    return [_described(new("lifecycle_msgs/msg/TransitionDescription"), one) for one in transitions]


def _described(message: Any, by: _Transition) -> Any:
    message.transition.id, message.transition.label = by.number, by.label
    message.start_state.id, message.start_state.label = by.start
    message.goal_state.id, message.goal_state.label = by.goal
    return message


LIFECYCLE: dict[str, Any] = {
    "LifecyclePublisher": LifecyclePublisher,
    "LifecycleState": LifecycleState,
    "ManagedEntity": ManagedEntity,
    "SimpleManagedEntity": SimpleManagedEntity,
    "TransitionCallbackReturn": TransitionCallbackReturn,
}
"""``rclpy.lifecycle``, but for its node, which knows its run."""
