"""What ROS 1's master answers, asked of the graph: ``rospy.get_master``, ``rosgraph`` and rules of names.

There is no server: calls that register nodes, or need the address of one, are refused by name.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from itertools import count
from types import ModuleType
from typing import Any, ClassVar, NoReturn

from volery.base.errors import UsageError
from volery.ros.client_libraries.library_base import library_module
from volery.ros.client_libraries.rospy.session import Sessions
from volery.ros.graph import EmbeddedGraph


class MasterException(Exception):  # noqa: N818 - rosgraph's name
    """A call of the master has failed."""


class MasterFailure(MasterException):
    """The master cannot be reached."""


class MasterError(MasterException):
    """The master has refused a call."""


class Master:
    """``rosgraph.Master``: the state of the graph."""

    sessions: ClassVar[Sessions]

    def __init__(self, caller_id: str = "", master_uri: str | None = None) -> None:
        self.caller_id = caller_id

    def is_online(self) -> bool:
        """Return True: the graph is there while the run lasts."""
        return True

    def getSystemState(self) -> list[list[list[Any]]]:  # noqa: N802 - rosgraph's name
        """Return publishers, subscribers and services, each as ``[name, [nodes]]``."""
        with self.sessions.kernel.interact():
            graph = self.sessions.graph
            topics, services = graph.topics(), graph.services()
        return [
            [[topic.name, list(topic.publishers)] for topic in topics if topic.publishers],
            [[topic.name, list(topic.subscribers)] for topic in topics if topic.subscribers],
            [[service.name, [service.server]] for service in services],
        ]

    def getTopicTypes(self) -> list[list[str]]:  # noqa: N802 - rosgraph's name
        """Return the topics with their types."""
        with self.sessions.kernel.interact():
            topics = self.sessions.graph.topics()
        return [[topic.name, topic.type.replace("/msg/", "/")] for topic in topics]

    def getPublishedTopics(self, subgraph: str = "") -> list[list[str]]:  # noqa: N802 - rosgraph's name
        """Return the published topics below a namespace with their types."""
        with self.sessions.kernel.interact():
            topics = [topic for topic in self.sessions.graph.topics() if topic.publishers]
        below = subgraph.rstrip("/") + "/"
        return [
            [topic.name, topic.type.replace("/msg/", "/")] for topic in topics if topic.name.startswith(below)
        ]

    def hasParam(self, key: str) -> bool:  # noqa: N802 - rosgraph's name
        """Return whether a parameter exists."""
        return self.sessions.joined().node.has_parameter(key)

    def getParam(self, key: str) -> Any:  # noqa: N802 - rosgraph's name
        """Return a parameter; raise ``MasterError`` if there is none."""
        return self._of_server(self.sessions.joined().node.get_parameter, key)

    def setParam(self, key: str, value: Any) -> None:  # noqa: N802 - rosgraph's name
        """Set a parameter."""
        self.sessions.joined().node.set_parameter(key, value)

    def deleteParam(self, key: str) -> None:  # noqa: N802 - rosgraph's name
        """Remove a parameter; raise ``MasterError`` if there is none."""
        self._of_server(self.sessions.joined().node.delete_parameter, key)

    def getParamNames(self) -> list[str]:  # noqa: N802 - rosgraph's name
        """Return the names of all parameters. Works on the embedded graph only."""
        graph = self.sessions.graph
        if not isinstance(graph, EmbeddedGraph):
            raise UsageError("rosgraph.Master.getParamNames() works on the embedded graph only")
        with self.sessions.kernel.interact():
            return graph.parameters.names()

    def __getattr__(self, name: str) -> NoReturn:
        why = (
            "there are no servers of nodes with addresses" if name in _NO_SERVERS else "rosgraph has no such"
        )
        raise AttributeError(f"rosgraph.Master.{name} is not there on the embedded graph: {why}")

    @staticmethod
    def _of_server(call: Callable[[str], Any], key: str) -> Any:
        try:
            return call(key)
        except UsageError as error:
            raise MasterError(str(error)) from error


_NO_SERVERS = (
    *(
        "getPid",
        "getUri",
        "lookupNode",
        "lookupService",
        "registerPublisher",
        "registerService",
        "searchParam",
    ),
    *("registerSubscriber", "subscribeParam", "unregisterPublisher", "unregisterService"),
    *("unregisterSubscriber", "unsubscribeParam"),
)


class MasterProxy:
    """``rospy.get_master()``: calls answer ``(1, text, value)``; parameters are its items."""

    sessions: ClassVar[Sessions]
    master: ClassVar[type[Master]]

    def __getattr__(self, name: str) -> Callable[..., tuple[int, str, Any]]:
        found = getattr(self.master(), name)
        return lambda *args: (1, name, found(*args))

    def __getitem__(self, key: str) -> Any:
        if key not in self:
            raise KeyError(key)
        return self.sessions.joined().node.get_parameter(key)

    def __setitem__(self, key: str, value: Any) -> None:
        self.sessions.joined().node.set_parameter(key, value)

    def __delitem__(self, key: str) -> None:
        if key not in self:
            raise KeyError(key)
        self.sessions.joined().node.delete_parameter(key)

    def __contains__(self, key: str) -> bool:
        return self.sessions.joined().node.has_parameter(key)


# -- names, as of http://wiki.ros.org/Names


def is_global(name: str) -> bool:
    """Return whether a name begins with a slash."""
    return name.startswith("/")


def is_private(name: str) -> bool:
    """Return whether a name begins with a tilde."""
    return name.startswith("~")


def is_legal_name(name: str) -> bool:
    """Return whether a name is a legal name of the graph."""
    return name == "" or (re.fullmatch(r"[~/A-Za-z][\w/]*", name) is not None and "//" not in name)


def is_legal_base_name(name: str) -> bool:
    """Return whether a name is legal and has no namespace."""
    return re.fullmatch(r"[A-Za-z]\w*", name) is not None


def namespace(name: str) -> str:
    """Return the namespace of a name, with a slash at both ends."""
    above = name.rstrip("/").rpartition("/")[0]
    return f"{above}/"


def ns_join(ns: str, name: str) -> str:
    """Return a name below a namespace; private and global names stay."""
    if is_private(name) or is_global(name) or not ns:
        return name
    return f"{ns}{name}" if ns.endswith(("~", "/")) else f"{ns}/{name}"


def canonicalize_name(name: str) -> str:
    """Return a name without double slashes and without one at the end."""
    if not name or name == "/":
        return name
    parts = [part for part in name.split("/") if part]
    return ("/" if name.startswith("/") else "") + "/".join(parts)


def make_global_ns(name: str) -> str:
    """Return a name with a slash at both ends; raise ``ValueError`` for a private one."""
    if is_private(name):
        raise ValueError(f"cannot turn [{name}] into a global name")
    return f"/{name.strip('/')}/" if name.strip("/") else "/"


def scoped_name(caller_id: str, name: str) -> str:
    """Return a global name relative to the namespace of a node."""
    if not is_global(caller_id):
        raise ValueError("caller_id must be global")
    caller_id, name = canonicalize_name(caller_id), canonicalize_name(name)
    return "" if name == "/" else name.removeprefix(namespace(caller_id))


def global_name(name: str) -> str:
    """Return a name with a slash at its beginning."""
    return f"/{name}" if not is_global(name) else name


def anonymous_name(id: str) -> str:  # noqa: A002 - rosgraph's name
    """Return a name for a node that no other node has."""
    return f"{id}_{next(_anonymous)}"


_anonymous = count(1)


def resolved(name: str, namespace_: str, remappings: Mapping[str, str] | None = None) -> str:
    """Return the absolute form of a name that a node or namespace uses, with remappings applied."""
    if not name:
        return namespace(namespace_)
    full = canonicalize_name(name)
    if is_private(full):
        full = ns_join(namespace_, full[1:])
    elif not is_global(full):
        full = namespace(namespace_) + full
    return (remappings or {}).get(full, full)


NAMES: dict[str, Any] = {
    one.__name__: one
    for one in (
        *(is_global, is_private, is_legal_name, is_legal_base_name, namespace, ns_join, canonicalize_name),
        *(make_global_ns, scoped_name, global_name, anonymous_name),
    )
} | {"ANYTYPE": "*", "GLOBALNS": "/", "PRIV_NAME": "~", "REMAP": ":=", "SEP": "/"}
"""Content of ``rosgraph.names``."""
_EXCEPTIONS = {one.__name__: one for one in (MasterException, MasterFailure, MasterError)}


def master_names(sessions: Sessions) -> dict[str, Any]:
    """Return ``MasterProxy`` and ``get_master`` of rospy, and ``Master`` of rosgraph, of one run."""
    master = type("Master", (Master,), {"sessions": sessions})
    proxy = type("MasterProxy", (MasterProxy,), {"sessions": sessions, "master": master})
    return {"Master": master, "MasterProxy": proxy, "get_master": lambda env=None: proxy()}


def rosgraph_modules(master: Any, rospy: Mapping[str, Any]) -> dict[str, ModuleType]:
    """Return ``rosgraph`` and the modules in it by name."""
    api = {**_EXCEPTIONS, "Master": master, "is_online": lambda master_uri=None: True}
    names = library_module("rosgraph.names", {**NAMES, "resolve_name": resolved})
    whole = {
        **_EXCEPTIONS,
        "Master": master,
        "is_master_online": lambda master_uri=None: True,
        "masterapi": library_module("rosgraph.masterapi", api),
        "myargv": rospy["myargv"],
        "names": names,
    }
    return {
        "rosgraph": library_module("rosgraph", whole),
        "rosgraph.names": names,
        "rosgraph.masterapi": whole["masterapi"],
    }
