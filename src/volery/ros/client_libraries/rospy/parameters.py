"""rospy's functions of parameters. They work before ``init_node``, as there."""

from __future__ import annotations

from typing import Any

from volery.base.errors import UsageError
from volery.ros.client_libraries.rospy.session import Sessions
from volery.ros.graph import Graph

_NO_DEFAULT = object()


def get_param(sessions: Sessions, param_name: str, default: Any = _NO_DEFAULT) -> Any:
    """A parameter; ``KeyError`` if there is none and no default."""
    node = sessions.early().node
    if default is not _NO_DEFAULT:
        return node.get_parameter(param_name, default)
    try:
        return node.get_parameter(param_name)
    except UsageError as error:
        raise KeyError(str(error)) from error


def get_param_cached(sessions: Sessions, param_name: str, default: Any = _NO_DEFAULT) -> Any:
    """``get_param``: what was asked for before is not older here."""
    return get_param(sessions, param_name, default)


def set_param(sessions: Sessions, param_name: str, param_value: Any) -> None:
    """Set a parameter."""
    sessions.early().node.set_parameter(param_name, param_value)


def has_param(sessions: Sessions, param_name: str) -> bool:
    """Whether there is such a parameter."""
    return sessions.early().node.has_parameter(param_name)


def delete_param(sessions: Sessions, param_name: str) -> None:
    """Remove a parameter; ``KeyError`` if there is none."""
    try:
        sessions.early().node.delete_parameter(param_name)
    except UsageError as error:
        raise KeyError(str(error)) from error


def get_param_names(sessions: Sessions) -> list[str]:
    """All parameters, where the graph is embedded: what others keep is not listed."""
    graph = sessions.graph
    if not isinstance(graph, Graph):
        raise UsageError("rospy.get_param_names() works on the embedded graph only")
    with sessions.kernel:
        return graph.parameters.names()


def search_param(sessions: Sessions, param_name: str) -> str | None:
    """The full name of the nearest parameter so called: of this node, of its namespace, of those above.

    Of a name with several parts, only the first is looked for. ``None`` if there is none.
    """
    node = sessions.early().node
    if param_name.startswith(("/", "~")):
        full = node.resolve(param_name)
        return full if node.has_parameter(full) else None
    first = param_name.partition("/")[0]
    above = node.name
    while True:
        if node.has_parameter(f"{above}/{first}"):
            return f"{above}/{param_name}"
        if not above:
            return None
        above = above.rpartition("/")[0]


FUNCTIONS = (
    get_param, get_param_cached, set_param, has_param, delete_param, get_param_names, search_param
)  # fmt: skip
