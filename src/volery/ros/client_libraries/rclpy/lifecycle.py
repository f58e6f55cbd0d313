"""``rclpy.lifecycle``: managed nodes, whose state other nodes can change.

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
from volery.ros.messages.client_classes import service_of


class TransitionCallbackReturn(IntEnum):
    """Outcome of a transition callback, with the numbers of ``lifecycle_msgs``."""

    SUCCESS = 97
    FAILURE = 98
    ERROR = 99

    def to_label(self) -> str:
        """Return the label of the transition that follows."""
        return f"transition_{self.name.lower()}"


class LifecycleState(NamedTuple):
    """Number and label of a state."""

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


_REQUESTABLE = (
    _Transition(1, "configure", UNCONFIGURED, CONFIGURING),
    _Transition(2, "cleanup", INACTIVE, CLEANING_UP),
    _Transition(3, "activate", INACTIVE, ACTIVATING),
    _Transition(4, "deactivate", ACTIVE, DEACTIVATING),
    _Transition(5, "shutdown", UNCONFIGURED, SHUTTING_DOWN),
    _Transition(6, "shutdown", INACTIVE, SHUTTING_DOWN),
    _Transition(7, "shutdown", ACTIVE, SHUTTING_DOWN),
)
"""Transitions that can be requested."""
_ENDS: dict[LifecycleState, tuple[str, int, LifecycleState, LifecycleState, LifecycleState]] = {
    CONFIGURING: ("on_configure", 10, INACTIVE, UNCONFIGURED, PROCESSING_ERROR),
    CLEANING_UP: ("on_cleanup", 20, UNCONFIGURED, INACTIVE, PROCESSING_ERROR),
    ACTIVATING: ("on_activate", 30, ACTIVE, INACTIVE, PROCESSING_ERROR),
    DEACTIVATING: ("on_deactivate", 40, INACTIVE, ACTIVE, PROCESSING_ERROR),
    SHUTTING_DOWN: ("on_shutdown", 50, FINALIZED, FINALIZED, PROCESSING_ERROR),
    PROCESSING_ERROR: ("on_error", 60, UNCONFIGURED, FINALIZED, FINALIZED),
}
"""Of each transition state: callback, number of the first transition, goals of success, failure and error."""


def _after(state: LifecycleState) -> list[_Transition]:
    """Return the transitions out of a transition state."""
    _, number, *goals = _ENDS[state]
    return [
        _Transition(number + index, outcome.to_label(), state, goal)
        for index, (outcome, goal) in enumerate(zip(TransitionCallbackReturn, goals, strict=True))
    ]


class ManagedEntity:
    """An entity that follows the transitions of its node. Each callback gets the state that is left."""

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Handle the configuration of the node."""
        return TransitionCallbackReturn.SUCCESS

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Handle the cleanup of the node."""
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Handle the shutdown of the node."""
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Handle the activation of the node."""
        return TransitionCallbackReturn.SUCCESS

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Handle the deactivation of the node."""
        return TransitionCallbackReturn.SUCCESS

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Handle an error in a transition."""
        return TransitionCallbackReturn.SUCCESS


class SimpleManagedEntity(ManagedEntity):
    """An entity that is enabled while its node is active."""

    def __init__(self) -> None:
        self._enabled = False

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Enable the entity."""
        self._enabled = True
        return TransitionCallbackReturn.SUCCESS

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Disable the entity."""
        self._enabled = False
        return TransitionCallbackReturn.SUCCESS

    @property
    def is_activated(self) -> bool:
        """Whether the entity is enabled."""
        return self._enabled

    @staticmethod
    def when_enabled(wrapped: Any = None, *, when_not_enabled: Callable[[], Any] | None = None) -> Any:
        """Return a method that does nothing while the node is not active."""

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
    """A publisher that publishes only while its node is active."""

    def __init__(self, *given: Any) -> None:
        SimpleManagedEntity.__init__(self)
        Publisher.__init__(self, *given)

    def publish(self, msg: Any) -> None:
        """Publish a message, if the node is active."""
        if self._enabled:
            super().publish(msg)


class LifecycleNode(Node, ManagedEntity):
    """A managed node with the services ``~/change_state`` etc. and the topic ``~/transition_event``."""

    def __init__(
        self, node_name: str, *, enable_communication_interface: bool = True, **options: Any
    ) -> None:
        super().__init__(node_name, **options)
        self._state = UNCONFIGURED
        self._managed: list[ManagedEntity] = []
        self._events: Publisher | None = None
        if enable_communication_interface:
            kind = message_class("lifecycle_msgs/msg/TransitionEvent")
            self._events = self.create_publisher(kind, "~/transition_event", 10)
            self._serve()

    def _serve(self) -> None:
        for name, kind, answer in (
            ("change_state", "ChangeState", self._handle_change),
            ("get_state", "GetState", self._handle_state),
            ("get_available_states", "GetAvailableStates", self._handle_states),
            ("get_available_transitions", "GetAvailableTransitions", self._handle_transitions),
            ("get_transition_graph", "GetAvailableTransitions", self._handle_graph),
        ):
            self.create_service(service_of(f"lifecycle_msgs/srv/{kind}"), f"~/{name}", answer)

    def create_lifecycle_publisher(self, msg_type: Any, topic: str, qos_profile: Any, **options: Any) -> Any:
        """Create a publisher that publishes only while the node is active."""
        publisher = self.create_publisher(
            msg_type, topic, qos_profile, publisher_class=LifecyclePublisher, **options
        )
        self._managed.append(publisher)
        return publisher

    def destroy_lifecycle_publisher(self, publisher: LifecyclePublisher) -> bool:
        """Destroy a lifecycle publisher."""
        self._managed.remove(publisher)
        return self.destroy_publisher(publisher)

    def add_managed_entity(self, entity: ManagedEntity) -> None:
        """Let *entity* follow the transitions of the node."""
        self._managed.append(entity)

    # -- callbacks: by default the transition is passed to all entities

    def _call_entities(self, callback: str, state: LifecycleState) -> TransitionCallbackReturn:
        for entity in self._managed:
            outcome: TransitionCallbackReturn = getattr(entity, callback)(state)
            if outcome is not TransitionCallbackReturn.SUCCESS:
                return outcome
        return TransitionCallbackReturn.SUCCESS

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Configure all entities."""
        return self._call_entities("on_configure", state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Clean up all entities."""
        return self._call_entities("on_cleanup", state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Shut down all entities."""
        return self._call_entities("on_shutdown", state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Activate all entities."""
        return self._call_entities("on_activate", state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Deactivate all entities."""
        return self._call_entities("on_deactivate", state)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Let all entities handle an error."""
        return self._call_entities("on_error", state)

    # -- transitions

    def trigger_configure(self) -> TransitionCallbackReturn:
        """Request the transition configure."""
        return self._change("configure")

    def trigger_cleanup(self) -> TransitionCallbackReturn:
        """Request the transition cleanup."""
        return self._change("cleanup")

    def trigger_activate(self) -> TransitionCallbackReturn:
        """Request the transition activate."""
        return self._change("activate")

    def trigger_deactivate(self) -> TransitionCallbackReturn:
        """Request the transition deactivate."""
        return self._change("deactivate")

    def trigger_shutdown(self) -> TransitionCallbackReturn:
        """Request the transition shutdown."""
        return self._change("shutdown")

    def _available(self) -> list[_Transition]:
        return [one for one in _REQUESTABLE if one.start == self._state]

    def _change(self, label: str) -> TransitionCallbackReturn:
        wanted = next((one for one in self._available() if one.label == label), None)
        if wanted is None:
            raise RuntimeError(f"No transition matching {label} found for current state {self._state.label}")
        before = self._state
        self._enter(wanted)
        outcome = self._run_callback(before)
        if outcome is TransitionCallbackReturn.ERROR:
            self._run_callback(before)
        return outcome

    def _run_callback(self, before: LifecycleState) -> TransitionCallbackReturn:
        """Run the callback of the current transition state and enter the state that its outcome leads to."""
        try:
            outcome: TransitionCallbackReturn = getattr(self, _ENDS[self._state][0])(before)
        except Exception as error:
            self.get_logger().error(f"{_ENDS[self._state][0]}: {error}")
            outcome = TransitionCallbackReturn.ERROR
        self._enter(next(one for one in _after(self._state) if one.label == outcome.to_label()))
        return outcome

    def _enter(self, by: _Transition) -> None:
        self._state = by.goal
        if self._events is not None:
            event = _fill_transition(new("lifecycle_msgs/msg/TransitionEvent"), by)
            event.timestamp = self.get_clock().now().nanoseconds
            self._events.publish(event)

    # -- services

    def _handle_change(self, request: Any, response: Any) -> Any:
        requested = request.transition
        found = next(
            (
                one
                for one in self._available()
                if (one.label == requested.label if requested.label else one.number == requested.id)
            ),
            None,
        )
        response.success = found is not None and self._change(found.label) is TransitionCallbackReturn.SUCCESS
        return response

    def _handle_state(self, request: Any, response: Any) -> Any:
        response.current_state.id, response.current_state.label = self._state
        return response

    def _handle_states(self, request: Any, response: Any) -> Any:
        response.available_states = [
            new("lifecycle_msgs/msg/State", id=number, label=label) for number, label in _STATES
        ]
        return response

    def _handle_transitions(self, request: Any, response: Any) -> Any:
        response.available_transitions = _describe_all(self._available())
        return response

    def _handle_graph(self, request: Any, response: Any) -> Any:
        ends = [one for state in _ENDS for one in _after(state)]
        response.available_transitions = _describe_all([*_REQUESTABLE, *ends])
        return response


def _describe_all(transitions: list[_Transition]) -> list[Any]:
    return [
        _fill_transition(new("lifecycle_msgs/msg/TransitionDescription"), transition)
        for transition in transitions
    ]


def _fill_transition(message: Any, by: _Transition) -> Any:
    message.transition.id, message.transition.label = by.number, by.label
    message.start_state.id, message.start_state.label = by.start
    message.goal_state.id, message.goal_state.label = by.goal
    return message


LIFECYCLE: dict[str, Any] = {
    "LifecyclePublisher": LifecyclePublisher,
    "LifecycleState": LifecycleState,
    "Publisher": LifecyclePublisher,
    "State": LifecycleState,
    "ManagedEntity": ManagedEntity,
    "SimpleManagedEntity": SimpleManagedEntity,
    "TransitionCallbackReturn": TransitionCallbackReturn,
}
"""Content of ``rclpy.lifecycle`` without the node class, which is specific to a run."""
