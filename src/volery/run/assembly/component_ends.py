"""What follows when a component ends: by itself, by an exit status, or by an error.

A component that ends by itself leaves the run; the others go on. One that fails is handled as the model's
``on_failure`` says: it is stopped, it is started again, or the run ends. In each case but that of a start
again, the outcome of the run is failed. What it commanded alone is brought to rest.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial

from volery.components.instance import RunningInstance
from volery.components.loader import ScriptHost
from volery.components.programs import InstanceProgram, start
from volery.kernel.api import Kernel
from volery.kernel.task import ExecutionContext
from volery.model.components import END_RUN, RESTART, OnFailure
from volery.ros.graph import EmbeddedGraph, RosGraph
from volery.run.ending import Ending, Landable

Starter = Callable[[], object]
CommandedAlone = Callable[[str], Iterable[Landable]]
"""Returns the vehicles that a component, and no other that still runs, commands."""


class ComponentEnds(ScriptHost):
    """Starts the components of one run and acts when they end.

    Args:
        kernel: The run's kernel.
        graph: Its graph.
        ending: The end of the run.
        commanded_alone: Finds the vehicles that are left without a commander.
    """

    def __init__(
        self, kernel: Kernel, graph: RosGraph, ending: Ending, commanded_alone: CommandedAlone
    ) -> None:
        self._kernel = kernel
        self._graph = graph
        self._ending = ending
        self._commanded_alone = commanded_alone
        self._instances: dict[str, RunningInstance] = {}
        self._restarts: dict[str, int] = {}
        self._flown: dict[str, list[Landable]] = {}  # by a script that has ended, whose nodes are gone

    def starter(
        self, instance: RunningInstance, policy: OnFailure, program: InstanceProgram, given: dict[str, object]
    ) -> Starter:
        """Return a function that starts the component."""
        self._instances[instance.name] = instance

        def begin() -> None:
            scope = self._ending.users.child(instance.name)
            start(instance, program, given, scope, partial(self._failed, policy, begin))
            if policy.action != END_RUN:  # the others of its flows go on, as in Python
                instance.on_thread_failure = self._ending.component_failed

        return begin

    def runs(self, component: str) -> bool:
        """Return whether a component has a flow of control that has not ended."""
        scope = self._instances[component].scope
        return scope is not None and any(not task.scope.cancelled for task in scope.all_tasks())

    # -- see ``Host``

    def at_end(self, context: ExecutionContext, last: Callable[[], object]) -> None:
        """See ``ScriptHost``."""
        self._ending.farewell(context, last)

    def leave(self, component: str) -> None:
        """See ``ScriptHost``."""
        self._ending.say_farewell(component)
        kernel = self._kernel
        with kernel.interact():  # spends the execution time of the last activation
            self._flown[component] = list(self._commanded_alone(component))
            self._close_nodes(component)
            kernel.call_at(kernel.now(), partial(self._remove, component, "it has ended"))

    def kill(self, component: str) -> None:
        """See ``ScriptHost``."""
        self._ending.forget_farewells(component)
        self._close_nodes(component)
        self._kernel.call_at(self._kernel.now(), partial(self._remove, component, "it has ended"))

    # -- failures

    def _failed(self, policy: OnFailure, begin: Starter, component: str, error: Exception) -> None:
        done = self._restarts.get(component, 0)
        if policy.action == END_RUN:
            self._ending.failed(component, error)
        elif policy.action == RESTART and (policy.most is None or done < policy.most):
            self._restarts[component] = done + 1
            self._stop(component)
            self._kernel.call_at(self._kernel.now() + max(policy.delay_ns, 1), partial(self._again, begin))
        else:
            self._ending.component_failed(component, error)
            self._stop(component)

    def _again(self, begin: Starter) -> None:
        if not self._ending.begun:
            begin()

    def _stop(self, component: str) -> None:
        vehicles = self._flown.pop(component, None) or list(self._commanded_alone(component))
        self._kernel.call_at(self._kernel.now(), partial(self._remove, component, "it has failed"))
        for vehicle in vehicles:
            self._ending.land(vehicle)

    def _remove(self, component: str, why: str) -> None:
        instance = self._instances[component]
        instance.set_unavailable(why)
        if instance.scope is not None:
            self._kernel.cancel(instance.scope, why)
        self._ending.check_over()

    def _close_nodes(self, component: str) -> None:
        if isinstance(self._graph, EmbeddedGraph):
            for node in self._graph.nodes_of(component):
                node.close()
