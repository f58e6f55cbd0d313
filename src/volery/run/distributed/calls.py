"""Ports whose other end is another process: an operation is a service of the graph."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from volery.base.errors import ComponentError, VoleryError
from volery.components.instance import Instance
from volery.components.ports import Port, execute
from volery.kernel.api import Kernel
from volery.kernel.task import Place, Scope, Task
from volery.kernel.waiting import current_task
from volery.model.system import Instance as InstanceModel
from volery.model.system import System
from volery.ros.graph import Client, Node, ServiceError
from volery.ros.graph.group import Work
from volery.ros.messages import Message, request, service
from volery.run.distributed.plan import NODE, operations, service_name
from volery.run.distributed.values import Values

CALL = "volery_msgs/srv/Call"


class FarPort(Port):
    """``port.operation(...)`` calls a component of another process.

    Raises ``ComponentError``, naming the callee, for whatever goes wrong there; a process that is gone, too.
    """

    def __init__(
        self, kernel: Kernel, caller: str, callee: Instance, clients: Mapping[str, Client], values: Values
    ) -> None:
        super().__init__(kernel, caller, callee, None, None)
        self._clients = clients
        self._values = values

    def _there_and_back(
        self, task: Task, operation: str, args: tuple[Any, ...], kwargs: dict[str, Any]
    ) -> Any:
        what = f"the arguments of {self.component}.{operation}"
        asked = request(CALL, arguments=self._values.to_text([list(args), kwargs], what))
        try:
            answer = self._clients[operation].call(asked)
        except ServiceError as error:
            raise ComponentError(self.component, f"{operation} did not come back: {error.what}") from error
        if not answer.done:
            raise ComponentError(self.component, answer.result.removeprefix(f"{self.component}: "))
        return self._values.from_text(answer.result)


class Reach:
    """Makes the ports of the components of one process to those of others.

    Clients are made with the port, long before a call: on ROS 2 an answer gets lost where its server has not
    discovered yet who asked.
    """

    def __init__(self, kernel: Kernel, system: System, node: Node, values: Values) -> None:
        self._kernel, self._system, self._node, self._values = kernel, system, node, values
        self._clients: dict[str, Client] = {}

    def __call__(self, caller: InstanceModel, callee: InstanceModel) -> FarPort:
        """The port of *caller*, which is here, to *callee*, which is elsewhere."""
        provided = operations(self._system, callee)
        far = Instance(self._kernel, callee.name, operations=provided)
        clients = {name: self._client(service_name(callee, name)) for name in provided}
        return FarPort(self._kernel, caller.name, far, clients, self._values)

    def _client(self, name: str) -> Client:
        known = self._clients.get(name)
        if known is None:
            known = self._clients[name] = self._node.client(name, CALL)
        return known


class Desk:
    """Serves the operations of the components of one process to those of others, one task for each call."""

    def __init__(self, kernel: Kernel, node: Node, values: Values, scope: Scope) -> None:
        self._kernel, self._node, self._values, self._scope = kernel, node, values, scope
        self._group = node.group(self._start)

    def serve(self, model: InstanceModel, instance: Instance) -> None:
        """From now on *instance* can be called."""
        for operation in instance.operations:
            handler = partial(self._answer, instance, operation)
            self._node.serve(service_name(model, operation), CALL, handler, self._group)

    def _start(self, work: Work) -> None:
        self._kernel.spawn(work.run, f"{NODE} (call)", Place(NODE), self._scope)

    def _answer(self, instance: Instance, operation: str, asked: Any) -> Message:
        respond = service(CALL).response
        try:
            args, kwargs = self._values.from_text(asked.arguments)
            with instance.visited(current_task(self._kernel), operation) as thing:
                result = execute(instance, thing, operation, tuple(args), kwargs)
            return respond(True, self._values.to_text(result, f"the result of {instance.name}.{operation}"))
        except VoleryError as error:
            return respond(False, str(error))
