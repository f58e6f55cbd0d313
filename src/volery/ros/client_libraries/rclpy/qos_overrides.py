"""``rclpy.qos_overriding_options``: policies of a publisher or subscription that parameters override.

The parameters are those of https://ros2.github.io/articles/qos_configurability.html:
``qos_overrides./topic.publisher.depth`` and so on, for an entity with an id ``publisher_id``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

from volery.ros.client_libraries.rclpy.context import ParameterAlreadyDeclaredException
from volery.ros.client_libraries.rclpy.node_parameters import NodeParameters
from volery.ros.client_libraries.rclpy.qos import QoSPolicyEnum, QoSPolicyKind, QoSProfile
from volery.ros.client_libraries.rclpy.ros_time import Duration
from volery.ros.messages import message_class, new


class InvalidQosOverridesError(Exception):
    """The overridden profile is refused."""


@dataclass
class QoSOverridingOptions:
    """Which policies of an entity parameters override."""

    policy_kinds: Iterable[QoSPolicyKind]
    callback: Callable[[QoSProfile], Any] | None = field(default=None, kw_only=True)
    entity_id: str | None = field(default=None, kw_only=True)

    @classmethod
    def with_default_policies(
        cls, *, callback: Callable[[QoSProfile], Any] | None = None, entity_id: str | None = None
    ) -> QoSOverridingOptions:
        """Return options for history, depth and reliability."""
        kinds = (QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH, QoSPolicyKind.RELIABILITY)
        return cls(kinds, callback=callback, entity_id=entity_id)


def overridden(
    profile: QoSProfile, options: QoSOverridingOptions, prefix: str, node: NodeParameters
) -> QoSProfile:
    """Return a profile with what the parameters of a node say, which are declared for it.

    Raises:
        InvalidQosOverridesError: A parameter names no policy, or the callback refuses the profile.
    """
    made = profile.copy()
    above = f"{prefix}_{options.entity_id}" if options.entity_id else prefix
    for kind in options.policy_kinds:
        name = str(QoSPolicyKind(kind).name).lower()
        full, value = f"{above}.{name}", getattr(made, name)
        descriptor = new("rcl_interfaces/msg/ParameterDescriptor", read_only=True)
        try:
            given = node.declare_parameter(full, _as_parameter(value), descriptor).value
        except ParameterAlreadyDeclaredException:
            given = node.get_parameter(full).value
        try:
            setattr(made, name, _from_parameter(value, given))
        except KeyError:
            choices = ", ".join(type(value).short_keys())
            raise InvalidQosOverridesError(f"{full}: {given!r} is not one of {choices}") from None
    if options.callback is not None:
        answer = options.callback(made)
        if not answer.successful:
            raise InvalidQosOverridesError(answer.reason)
    return made


def _as_parameter(value: Any) -> Any:
    if isinstance(value, QoSPolicyEnum):
        return value.short_key
    return value.nanoseconds if isinstance(value, Duration) else value


def _from_parameter(before: Any, given: Any) -> Any:
    if isinstance(before, QoSPolicyEnum):
        return type(before).get_from_short_key(given)
    return Duration(nanoseconds=given) if isinstance(before, Duration) else given


OVERRIDES: dict[str, Any] = {
    "InvalidQosOverridesError": InvalidQosOverridesError,
    "QoSOverridingOptions": QoSOverridingOptions,
    "QosCallbackResult": message_class("rcl_interfaces/msg/SetParametersResult"),
}
"""Content of ``rclpy.qos_overriding_options``."""
