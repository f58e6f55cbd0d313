"""``rclpy.qos``: profiles, policies, presets and compatibility.

What the values mean on the embedded graph is in ``graph_qos`` and in ``events``.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from enum import Enum, EnumMeta, IntEnum, IntFlag
from typing import Any, NamedTuple, Self

from volery.base.time import Ns
from volery.ros.client_libraries.rclpy.ros_time import Duration
from volery.ros.graph import QoS
from volery.ros.graph.interface import BEST_AVAILABLE, BEST_EFFORT, RELIABLE, TRANSIENT_LOCAL, VOLATILE

_ENDLESS_FROM = 1 << 62
"""Durations from here on are infinite."""


class InvalidQoSProfileException(Exception):  # noqa: N818 - rclpy's name
    """A profile that is contradictory or incomplete."""

    def __init__(self, *words: Any) -> None:
        super().__init__("Invalid QoSProfile", *words)


class QoSPolicyKind(IntFlag):
    """The policies by the numbers of rmw."""

    INVALID = 1
    DURABILITY = 2
    DEADLINE = 4
    LIVELINESS = 8
    RELIABILITY = 16
    HISTORY = 32
    LIFESPAN = 64
    DEPTH = 128
    LIVELINESS_LEASE_DURATION = 256
    AVOID_ROS_NAMESPACE_CONVENTIONS = 512


def qos_policy_name_from_kind(policy_kind: int) -> str:
    """Return the name of a policy."""
    return str(QoSPolicyKind(policy_kind).name)


class _OldNames(EnumMeta):
    """Finds the members of a policy by their names in C, too: ``RMW_QOS_POLICY_RELIABILITY_RELIABLE``."""

    def __getattr__(cls, name: str) -> Any:
        words = cls.__name__.removeprefix("QoS").removesuffix("Policy").upper()
        new = name.removeprefix(f"RMW_QOS_POLICY_{words}_")
        members: Any = cls.__members__
        if new == name or new not in members:
            raise AttributeError(f"{cls.__name__}.{name} is not there; there is {', '.join(members)}")
        text = f"{cls.__name__}.{name} is deprecated. Use {cls.__name__}.{new} instead."
        warnings.warn(text, stacklevel=2)
        return members[new]


class QoSPolicyEnum(IntEnum, metaclass=_OldNames):
    """Base of the policies."""

    @classmethod
    def short_keys(cls) -> list[str]:
        """Return the names of the members as in parameters and on command lines."""
        return [name.lower() for name in cls.__members__]

    @classmethod
    def get_from_short_key(cls, name: str) -> int:
        """Return the number of a member by its short name."""
        return int(cls[name.upper()].value)

    @property
    def short_key(self) -> str:
        """Short name of the member."""
        return self.name.lower()


class HistoryPolicy(QoSPolicyEnum):
    """Which messages are kept."""

    SYSTEM_DEFAULT = 0
    KEEP_LAST = 1
    KEEP_ALL = 2
    UNKNOWN = 3


class ReliabilityPolicy(QoSPolicyEnum):
    """Whether lost messages are sent again."""

    SYSTEM_DEFAULT = 0
    RELIABLE = 1
    BEST_EFFORT = 2
    UNKNOWN = 3
    BEST_AVAILABLE = 4


class DurabilityPolicy(QoSPolicyEnum):
    """Whether late subscriptions receive earlier messages."""

    SYSTEM_DEFAULT = 0
    TRANSIENT_LOCAL = 1
    VOLATILE = 2
    UNKNOWN = 3
    BEST_AVAILABLE = 4


class LivelinessPolicy(QoSPolicyEnum):
    """Who asserts that a publisher is alive: its process, or itself."""

    SYSTEM_DEFAULT = 0
    AUTOMATIC = 1
    MANUAL_BY_TOPIC = 3
    UNKNOWN = 4
    BEST_AVAILABLE = 5


_POLICIES: dict[str, tuple[Callable[[Any], Any], type, Any]] = {
    "history": (HistoryPolicy, int, HistoryPolicy.KEEP_LAST),
    "depth": (int, int, 10),
    "reliability": (ReliabilityPolicy, int, ReliabilityPolicy.RELIABLE),
    "durability": (DurabilityPolicy, int, DurabilityPolicy.VOLATILE),
    "lifespan": (lambda given: given, Duration, Duration()),
    "deadline": (lambda given: given, Duration, Duration()),
    "liveliness": (LivelinessPolicy, int, LivelinessPolicy.SYSTEM_DEFAULT),
    "liveliness_lease_duration": (lambda given: given, Duration, Duration()),
    "avoid_ros_namespace_conventions": (bool, bool, False),
}
"""Of each policy: its conversion, the type of given values, and the default."""


class QoSProfile:
    """A profile as in rclpy: ``QoSProfile(depth=10)``. A wrong type is an ``AssertionError``, as there."""

    history: HistoryPolicy
    depth: int
    reliability: ReliabilityPolicy
    durability: DurabilityPolicy
    lifespan: Duration
    deadline: Duration
    liveliness: LivelinessPolicy
    liveliness_lease_duration: Duration
    avoid_ros_namespace_conventions: bool

    __slots__ = tuple(_POLICIES)

    def __init__(self, **policies: Any) -> None:
        unknown = sorted(policies.keys() - _POLICIES.keys())
        assert not unknown, f"Invalid arguments passed to constructor: {', '.join(unknown)}"
        if "history" not in policies:
            if "depth" not in policies:
                raise InvalidQoSProfileException("History and/or depth settings are required.")
        elif policies["history"] == HistoryPolicy.KEEP_LAST and "depth" not in policies:
            raise InvalidQoSProfileException("History set to KEEP_LAST without a depth setting.")
        for name, (_, _, default) in _POLICIES.items():
            setattr(self, name, policies.get(name, default))

    def __setattr__(self, name: str, value: Any) -> None:
        convert, kind, _ = _POLICIES.get(name, (str, object, None))
        assert isinstance(value, kind), f"QoSProfile.{name}: {value!r} is no {kind.__name__}"
        super().__setattr__(name, convert(value))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, QoSProfile):
            return False
        return all(getattr(self, name) == getattr(other, name) for name in _POLICIES)

    __hash__ = None  # type: ignore[assignment]

    def __str__(self) -> str:
        values = (getattr(self, name) for name in _POLICIES)
        texts = (str(value if isinstance(value, (bool, Duration)) else int(value)) for value in values)
        inside = ", ".join(f"{name}={text}" for name, text in zip(_POLICIES, texts, strict=True))
        return f"QoSProfile({inside})"

    def copy(self) -> Self:
        """Return a copy."""
        return type(self)(**{name: getattr(self, name) for name in _POLICIES})


def _preset(depth: int, **policies: Any) -> QoSProfile:
    return QoSProfile(**{"history": HistoryPolicy.KEEP_LAST, "depth": depth, **policies})


_MAX_SPAN = Duration(nanoseconds=(1 << 63) - 2)
qos_profile_unknown = _preset(
    0,
    history=HistoryPolicy.UNKNOWN,
    reliability=ReliabilityPolicy.UNKNOWN,
    durability=DurabilityPolicy.UNKNOWN,
    liveliness=LivelinessPolicy.UNKNOWN,
)
qos_profile_default = _preset(10)
qos_profile_system_default = _preset(
    0,
    history=HistoryPolicy.SYSTEM_DEFAULT,
    reliability=ReliabilityPolicy.SYSTEM_DEFAULT,
    durability=DurabilityPolicy.SYSTEM_DEFAULT,
)
qos_profile_sensor_data = _preset(5, reliability=ReliabilityPolicy.BEST_EFFORT)
qos_profile_services_default = _preset(10)
qos_profile_parameters = _preset(1000)
qos_profile_parameter_events = _preset(1000)
qos_profile_action_status_default = _preset(1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
qos_profile_best_available = _preset(
    10,
    reliability=ReliabilityPolicy.BEST_AVAILABLE,
    durability=DurabilityPolicy.BEST_AVAILABLE,
    deadline=_MAX_SPAN,
    liveliness=LivelinessPolicy.BEST_AVAILABLE,
    liveliness_lease_duration=_MAX_SPAN,
)


class QoSPresetProfiles(Enum):
    """The presets that have a name in rclpy."""

    UNKNOWN = qos_profile_unknown
    DEFAULT = qos_profile_default
    SYSTEM_DEFAULT = qos_profile_system_default
    SENSOR_DATA = qos_profile_sensor_data
    SERVICES_DEFAULT = qos_profile_services_default
    PARAMETERS = qos_profile_parameters
    PARAMETER_EVENTS = qos_profile_parameter_events
    ACTION_STATUS_DEFAULT = qos_profile_action_status_default
    BEST_AVAILABLE = qos_profile_best_available

    @classmethod
    def short_keys(cls) -> list[str]:
        """Return the names of the presets as on command lines."""
        return [name.lower() for name in cls.__members__]

    @classmethod
    def get_from_short_key(cls, name: str) -> QoSProfile:
        """Return a preset by its short name."""
        found: QoSProfile = cls[name.upper()].value
        return found


# -- on the graph

_RELIABILITY = {
    ReliabilityPolicy.BEST_EFFORT: BEST_EFFORT,
    ReliabilityPolicy.BEST_AVAILABLE: BEST_AVAILABLE,
}
_DURABILITY = {
    DurabilityPolicy.TRANSIENT_LOCAL: TRANSIENT_LOCAL,
    DurabilityPolicy.BEST_AVAILABLE: BEST_AVAILABLE,
}


def profile_of(given: Any) -> QoSProfile:
    """Return the profile that a user gives as a profile or a depth."""
    if isinstance(given, bool) or not isinstance(given, (int, QoSProfile)):
        raise TypeError(f"Expected QoSProfile or int, but received {type(given)!r}")
    if isinstance(given, int):
        if given < 0:
            raise ValueError("history depth must be greater than or equal to zero")
        return QoSProfile(depth=given)
    return given


def graph_qos(given: Any, *, reads: bool = False) -> QoS:
    """Return the quality of service of the graph for a profile or a depth.

    What a profile leaves to the middleware is as Fast DDS has it: one that *reads* is best effort and
    volatile, and one that does not is reliable and keeps what it has sent.
    """
    profile = profile_of(given)
    reliability, durability = (BEST_EFFORT, VOLATILE) if reads else (RELIABLE, TRANSIENT_LOCAL)
    if profile.reliability is not ReliabilityPolicy.SYSTEM_DEFAULT:
        reliability = _RELIABILITY.get(profile.reliability, RELIABLE)
    if profile.durability is not DurabilityPolicy.SYSTEM_DEFAULT:
        durability = _DURABILITY.get(profile.durability, VOLATILE)
    depth = None if profile.history is HistoryPolicy.KEEP_ALL else max(1, profile.depth)
    spans = [
        span.nanoseconds if 0 < span.nanoseconds < _ENDLESS_FROM else 0
        for span in (profile.deadline, profile.lifespan, profile.liveliness_lease_duration)
    ]
    return QoS(
        depth,
        reliability,
        durability,
        deadline=spans[0],
        lifespan=spans[1],
        lease=spans[2],
        manual=profile.liveliness is LivelinessPolicy.MANUAL_BY_TOPIC,
    )


def profile_on_graph(used: QoS) -> QoSProfile:
    """Return a quality of service of the graph as others see it, which is without its depth."""
    return QoSProfile(
        history=HistoryPolicy.UNKNOWN,
        depth=0,
        reliability=ReliabilityPolicy[used.reliability.upper()],
        durability=DurabilityPolicy[used.durability.upper()],
        liveliness=LivelinessPolicy.MANUAL_BY_TOPIC if used.manual else LivelinessPolicy.AUTOMATIC,
        lifespan=_span(used.lifespan),
        deadline=_span(used.deadline),
        liveliness_lease_duration=_span(used.lease),
    )


def _span(duration: Ns) -> Duration:
    return Duration(nanoseconds=duration or (1 << 63) - 1)


# -- compatibility


class QoSCompatibility(Enum):
    """Whether two profiles fit."""

    OK = 0
    WARNING = 1
    ERROR = 2


class _Span(NamedTuple):
    """A finite duration of a profile, ns, or none."""

    offered: int
    requested: int

    def violated(self) -> bool:
        return 0 < self.requested < _ENDLESS_FROM and not 0 < self.offered <= self.requested


def _spans(publisher: QoSProfile, subscription: QoSProfile, name: str) -> _Span:
    return _Span(getattr(publisher, name).nanoseconds, getattr(subscription, name).nanoseconds)


def incompatible_policies(publisher: QoSProfile, subscription: QoSProfile) -> dict[QoSPolicyKind, str]:
    """Return the policies by which a publisher does not match a subscription, with rclpy's texts."""
    found = {}
    if (
        publisher.reliability is ReliabilityPolicy.BEST_EFFORT
        and subscription.reliability is ReliabilityPolicy.RELIABLE
    ):
        found[QoSPolicyKind.RELIABILITY] = "Best effort publisher and reliable subscription"
    if (
        publisher.durability is DurabilityPolicy.VOLATILE
        and subscription.durability is DurabilityPolicy.TRANSIENT_LOCAL
    ):
        found[QoSPolicyKind.DURABILITY] = "Volatile publisher and transient local subscription"
    if _spans(publisher, subscription, "deadline").violated():
        found[QoSPolicyKind.DEADLINE] = "Subscription has a deadline that is less than publisher deadline"
    if (
        publisher.liveliness is LivelinessPolicy.AUTOMATIC
        and subscription.liveliness is LivelinessPolicy.MANUAL_BY_TOPIC
    ):
        found[QoSPolicyKind.LIVELINESS] = (
            "Publisher's liveliness is automatic and subscription's is manual by topic"
        )
    elif _spans(publisher, subscription, "liveliness_lease_duration").violated():
        found[QoSPolicyKind.LIVELINESS] = "Subscription has a liveliness lease duration less than publisher"
    return found


def qos_check_compatible(
    publisher_qos: QoSProfile, subscription_qos: QoSProfile
) -> tuple[QoSCompatibility, str]:
    """Return whether a publisher matches a subscription, and why not."""
    found = incompatible_policies(publisher_qos, subscription_qos)
    if found:
        return QoSCompatibility.ERROR, "".join(f"ERROR: {text};" for text in found.values())
    unknown = [
        name
        for name in ("reliability", "durability", "liveliness")
        if any(getattr(one, name).name in _UNDECIDED for one in (publisher_qos, subscription_qos))
    ]
    if not unknown:
        return QoSCompatibility.OK, ""
    texts = (
        f"WARNING: Publisher {name} is {getattr(publisher_qos, name).short_key} and subscription "
        f"{name} is {getattr(subscription_qos, name).short_key};"
        for name in unknown
    )
    return QoSCompatibility.WARNING, "".join(texts)


_UNDECIDED = ("SYSTEM_DEFAULT", "UNKNOWN")


QOS: dict[str, Any] = {
    "DurabilityPolicy": DurabilityPolicy,
    "HistoryPolicy": HistoryPolicy,
    "InvalidQoSProfileException": InvalidQoSProfileException,
    "LivelinessPolicy": LivelinessPolicy,
    "QoSCompatibility": QoSCompatibility,
    "QoSDurabilityPolicy": DurabilityPolicy,
    "QoSHistoryPolicy": HistoryPolicy,
    "QoSLivelinessPolicy": LivelinessPolicy,
    "QoSPolicyEnum": QoSPolicyEnum,
    "QoSPolicyKind": QoSPolicyKind,
    "QoSPresetProfiles": QoSPresetProfiles,
    "QoSProfile": QoSProfile,
    "QoSReliabilityPolicy": ReliabilityPolicy,
    "ReliabilityPolicy": ReliabilityPolicy,
    "qos_check_compatible": qos_check_compatible,
    "qos_policy_name_from_kind": qos_policy_name_from_kind,
    "qos_profile_action_status_default": qos_profile_action_status_default,
    "qos_profile_best_available": qos_profile_best_available,
    "qos_profile_default": qos_profile_default,
    "qos_profile_parameter_events": qos_profile_parameter_events,
    "qos_profile_parameters": qos_profile_parameters,
    "qos_profile_sensor_data": qos_profile_sensor_data,
    "qos_profile_services_default": qos_profile_services_default,
    "qos_profile_system_default": qos_profile_system_default,
    "qos_profile_unknown": qos_profile_unknown,
}
"""Content of ``rclpy.qos``."""
