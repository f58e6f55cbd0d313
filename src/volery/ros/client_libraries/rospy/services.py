"""rospy's ``Service``, ``ServiceProxy`` and ``wait_for_service``."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

from volery.base.errors import UsageError
from volery.base.time import Ns
from volery.ros.client_libraries.rospy.session import ROSException, ServiceException, Session, Sessions
from volery.ros.graph import ServiceError
from volery.ros.messages import Message


def _service_type(what: str, service_class: Any) -> str:
    name = getattr(service_class, "_type", "")
    if not name or not hasattr(service_class, "_request_class"):
        raise UsageError(
            f"rospy.{what}: {service_class!r} is no service class; import one, as in std_srvs.srv"
        )
    return str(name)


class Service:
    """Answers requests, each in a thread of its own."""

    sessions: ClassVar[Sessions]

    def __init__(
        self,
        name: str,
        service_class: Any,
        handler: Callable[[Any], Any],
        buff_size: int = 65536,
        error_handler: Any = None,
    ) -> None:
        self._session = self.sessions.early()
        self.service_class = service_class
        self.type = _service_type("Service", service_class)
        self._handler = handler
        self._error_handler = error_handler
        node = self._session.node
        resolved = node.resolve(name)
        group = self._session.spawn_each(resolved, f"handler of {resolved}")
        self._service = node.serve(name, self.type, self._answer, group)
        self.resolved_name = resolved

    def _answer(self, request: Any) -> Any:
        return _as_response(self.service_class, self._handler(request))

    def spin(self) -> None:
        """Block until the node shuts down."""
        spin(self._session)

    def shutdown(self, reason: str = "") -> None:
        """Answer no longer."""
        self._service.close()


def _as_response(service_class: Any, given: Any) -> Any:
    """What a handler may return: a response, its only field, its fields in order, or a dict of them."""
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
    """Calls a service like a function."""

    sessions: ClassVar[Sessions]

    def __init__(self, name: str, service_class: Any, persistent: bool = False, headers: Any = None) -> None:
        self._session = self.sessions.early()
        self.service_class = service_class
        self.request_class = getattr(service_class, "_request_class", None)
        self.response_class = getattr(service_class, "_response_class", None)
        self.type = _service_type("ServiceProxy", service_class)
        self._client = self._session.node.client(name, self.type)
        self.resolved_name = self._client.name

    def __call__(self, *args: Any, **fields: Any) -> Any:
        """Call with a request, or with the fields of one."""
        return self.call(*args, **fields)

    def call(self, *args: Any, **fields: Any) -> Any:
        """Call with a request, or with the fields of one; ``ServiceException`` if it does not succeed."""
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
        """Block until somebody serves it."""
        wait_for_service(self._session, self.resolved_name, timeout)

    def close(self) -> None:
        """Nothing to let go of."""


def wait_for_service(session: Session, name: str, timeout: Ns | None) -> None:
    """Block until somebody serves *name*; ``ROSException`` if nobody does in time."""
    graph_has = session.node.wait_for_service(name, timeout)
    session.check()
    if not graph_has:
        raise ROSException(f"timeout exceeded while waiting for service {session.node.resolve(name)}")


def spin(session: Session) -> None:
    """Block until the node shuts down."""
    session.ended.wait_for(lambda: session.shutdown, ends_activation=True)
