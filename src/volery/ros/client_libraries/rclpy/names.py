"""Names in rclpy: what a valid one is, with rclpy's texts, and how a name is expanded.

The rules are those of rmw and rcl, https://design.ros2.org/articles/topic_and_service_names.html. The tests
come in rcl's order, since the first that fails gives the text.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, NamedTuple

from volery.ros.client_libraries.rclpy.context import InvalidParameterException, NameValidationException


class InvalidNamespaceException(NameValidationException):
    """A namespace is invalid."""


class InvalidNodeNameException(NameValidationException):
    """A name of a node is invalid."""


class InvalidTopicNameException(NameValidationException):
    """A name of a topic is invalid."""


class InvalidServiceNameException(NameValidationException):
    """A name of a service is invalid."""


NAME_EXCEPTIONS = {
    kind.__name__: kind
    for kind in (
        InvalidNamespaceException,
        InvalidNodeNameException,
        InvalidServiceNameException,
        InvalidTopicNameException,
    )
}
"""Part of ``rclpy.exceptions``."""


class _Rule(NamedTuple):
    """What no name may match, the group or place of the fault, and the words."""

    forbidden: re.Pattern[str]
    words: str


def _rules(*given: tuple[str, str]) -> tuple[_Rule, ...]:
    return tuple(_Rule(re.compile(pattern), words) for pattern, words in given)


_TOPIC = _rules(
    (r"^(?=$)", "must not be empty string"),
    (r"^\d", "token must not start with a number"),
    (r"/$", "must not end with a forward slash"),
    (r"[^\w~{}/]", "must not contain characters other than alphanumerics, '_', '~', '{', or '}'"),
    (r"\{[^{}]*$|(?<!\w)\}", "must not have unmatched (unbalanced) curly braces '{}'"),
    (r"(?<=.)~", "must not have tilde '~' unless it is the first character"),
    (r"(?<=^~)[^/]", "must not have a tilde that is not followed by a forward slash '/'"),
    (r"(?<=/)\d", "token must not start with a number"),
)
_FULL = (
    (r"^(?=$)", "must not be empty"),
    (r"^[^/]", "must be absolute, it must lead with a '/'"),
    (r"(?<=.)/$", "must not end with a '/'"),
    (r"[^\w/]", "must not contain characters other than alphanumerics, '_', or '/'"),
    (r"/(?=/)", "must not contain repeated '/'"),
    (r"(?<=/)\d", "must not have a token that starts with a number"),
)
_FULL_TOPIC = _rules(*_FULL)
_NODE = _rules(
    (r"^(?=$)", "must not be empty"),
    (r"[^\w]", "must not contain characters other than alphanumerics or '_'"),
    (r"^\d", "must not start with a number"),
)


def _check(
    name: str, rules: tuple[_Rule, ...], kind: type[NameValidationException], called: str, words: str
) -> bool:
    for rule in rules:
        match = rule.forbidden.search(name) if name.isascii() else re.search(r"[^\x00-\x7f]", name)
        if match:
            text = f"{words} {rule.words if name.isascii() else rules[-1].words}"
            raise kind(f"Invalid {called}: {text}:\n  {name!r}\n   {' ' * match.start()}^")
    return True


def validate_topic_name(name: str, *, is_service: bool = False) -> bool:
    """Return True for a valid name of a topic or a service, else raise."""
    kind = InvalidServiceNameException if is_service else InvalidTopicNameException
    return _check(name, _TOPIC, kind, "service name" if is_service else "topic name", "topic name")


def validate_full_topic_name(name: str, *, is_service: bool = False) -> bool:
    """Return True for a valid absolute name of a topic or a service, else raise."""
    kind = InvalidServiceNameException if is_service else InvalidTopicNameException
    return _check(name, _FULL_TOPIC, kind, "service name" if is_service else "topic name", "topic name")


def validate_namespace(namespace: str) -> bool:
    """Return True for a valid namespace, else raise."""
    return _check(namespace, _FULL_TOPIC, InvalidNamespaceException, "namespace", "namespace")


def validate_node_name(node_name: str) -> bool:
    """Return True for a valid name of a node, else raise."""
    return _check(node_name, _NODE, InvalidNodeNameException, "node name", "node name")


def validate_parameter_name(name: str) -> bool:
    """Return True for a valid name of a parameter, else raise."""
    if not name:
        raise InvalidParameterException(name)
    return True


def expand_topic_name(topic_name: str, node_name: str, node_namespace: str) -> str:
    """Return the absolute name of a topic of a node; ``ValueError`` if the node's own names are invalid."""
    for check, given, called in (
        (validate_node_name, node_name, "node name"),
        (validate_namespace, node_namespace, "node namespace"),
    ):
        try:
            check(given)
        except NameValidationException as error:
            raise ValueError(f"{called} {given!r} is invalid: {error}") from None
    validate_topic_name(topic_name)
    above = node_namespace.rstrip("/")
    return _absolute(substituted(topic_name, node_name, node_namespace), f"{above}/{node_name}", above)


def _absolute(name: str, node: str, above: str) -> str:
    if name.startswith("~"):
        return node + name[1:]
    return name if name.startswith("/") else f"{above}/{name}"


def substituted(name: str, node_name: str, node_namespace: str) -> str:
    """Return a name with ``{node}`` and ``{ns}`` replaced; ``ValueError`` for another word in braces."""
    known = {"node": node_name, "ns": node_namespace.strip("/"), "namespace": node_namespace.strip("/")}

    def value(found: re.Match[str]) -> str:
        word = found.group(1)
        if word not in known:
            raise ValueError(f"{name!r}: unknown substitution {{{word}}}; there is {{node}} and {{ns}}")
        return known[word]

    made = re.sub(r"\{(\w*)\}", value, name)
    in_namespace = re.match(r"\{(ns|namespace)\}", name) is not None
    return re.sub("/+", "/", f"/{made}") if in_namespace else made


def topic_or_service_is_hidden(name: str) -> bool:
    """Return whether a part of a name begins with an underscore."""
    return any(part.startswith("_") for part in name.split("/"))


def _module(*functions: Callable[..., Any]) -> dict[str, dict[str, Any]]:
    return {function.__name__: {function.__name__: function} for function in functions}


NAMES: dict[str, dict[str, Any]] = _module(
    expand_topic_name,
    topic_or_service_is_hidden,
    validate_full_topic_name,
    validate_namespace,
    validate_node_name,
    validate_parameter_name,
    validate_topic_name,
)
"""Content of the modules that are named after their function: ``rclpy.validate_topic_name`` and so on."""
NAMES["topic_or_service_is_hidden"]["HIDDEN_TOPIC_PREFIX"] = "_"
NAMES["validate_topic_name"]["TOPIC_SEPARATOR_STRING"] = "/"
