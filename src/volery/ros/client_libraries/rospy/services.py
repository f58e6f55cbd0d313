"""rospy's ``Service``, ``ServiceProxy`` and ``wait_for_service``."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

from volery.base.errors import UsageError
from volery.base.time import Ns
from volery.ros.client_libraries.rospy.session import ROSException, ServiceException, Session, Sessions
from volery.ros.graph import ServiceError
from volery.ros.messages import Message


def _service_type(caller: str, service_class: Any) -> str:
    name = getattr(service_class, "_type", "")
    if not name or not hasattr(service_class, "_request_class"):
        raise UsageError(
            f"rospy.{caller}: {service_class!r} is no service class; import one, as in std_srvs.srv"
        )
    return str(name)


class Service:
    """Handles requests, each in a thread of its own."""

    sessions: ClassVar[Sessions]

    def __init__(
        self,
        name: str,
        service_class: Any,
        handler: Callable[[Any], Any],
        buff_size: int = 65536,
        error_handler: Any = None,
    ) -> None:
        self._session = self.sessions.joined()
        self.service_class = service_class
        self.type = _service_type("Service", service_class)
        self._handler = handler
        self._error_handler = error_handler
        node = self._session.node
        resolved = node.resolve(name)
        group = self._session.spawning_group(resolved, f"handler of {resolved}")
        self._service = node.serve(name, self.type, self._handle, group)
        self.resolved_name = resolved

    def _handle(self, request: Any) -> Any:
        return _to_response(self.service_class, self._handler(request))

    def spin(self) -> None:
        """Block until the node shuts down."""
        self._session.wait_for_end()

    def shutdown(self, reason: str = "") -> None:
        """Remove the service from the graph."""
        self._service.close()


def _to_response(service_class: Any, given: Any) -> Any:
    """Return the response for what a handler returned.

    A handler may return a response, its only field, its fields in order, or a dict of them.
    """
    kind = service_class._response_class
    if isinstance(given, Message):
        return given
    if isinstance(given, dict):
        return kind(**given)
    if isinstance(given, (list, tuple)):
        return kind(*given)
    if given is None:
        if kind.__match_args__:
            raise ServiceException("service handler returned None")
        return kind()
    return kind(given)


class ServiceProxy:
    """A client that calls a service like a function."""

    sessions: ClassVar[Sessions]

    def __init__(self, name: str, service_class: Any, persistent: bool = False, headers: Any = None) -> None:
        self._session = self.sessions.joined()
        self.service_class = service_class
        self.request_class = getattr(service_class, "_request_class", None)
        self.response_class = getattr(service_class, "_response_class", None)
        self.type = _service_type("ServiceProxy", service_class)
        self._client = self._session.node.client(name, self.type)
        self.resolved_name = self._client.name

    def __call__(self, *args: Any, **fields: Any) -> Any:
        """Call the service; see ``call``."""
        return self.call(*args, **fields)

    def call(self, *args: Any, **fields: Any) -> Any:
        """Call the service with a request or the fields of one; raise ``ServiceException`` on failure."""
        self._session.check()
        kind = self.service_class._request_class
        given = len(args) == 1 and not fields and isinstance(args[0], kind)
        try:
            request = args[0] if given else kind(*args, **fields)
            return self._client.call(request)
        except ServiceError as error:
            raise ServiceException(f"service [{self.resolved_name}]: {error.what}") from error
        except TypeError as error:
            raise ServiceException(f"service [{self.resolved_name}]: bad request: {error}") from error

    def wait_for_service(self, timeout: Any = None) -> None:
        """Block until the service is available."""
        wait_for_service(self._session, self.resolved_name, timeout)

    def close(self) -> None:
        """Do nothing: a proxy holds no resources."""


def wait_for_service(session: Session, name: str, timeout: Ns | None) -> None:
    """Block until the service *name* is available; raise ``ROSException`` after a time-out."""
    available = session.node.wait_for_service(name, timeout)
    session.check()
    if not available:
        raise ROSException(f"timeout exceeded while waiting for service {session.node.resolve(name)}")
