"""What tasks demand of their processors, folded from a run: the figures of the analysis of response times."""

from __future__ import annotations

from volery.base.time import Ns
from volery.requirements.response_bounds import WINDOW, Demand, Load, response_bounds
from volery.trace.events import NONE, Activation, Slice
from volery.trace.setup import ComponentSetup, ProcessorSetup

FIXED_PRIORITY = "fixed-priority"


class _Task:
    """One flow of control, by the name that its component has as well."""

    def __init__(self) -> None:
        self.since: Ns = 0  # executed since the last activation ended
        self.cost: Ns = 0
        self.released: Ns = NONE
        self.period: Ns = NONE


class Demands:
    """Give it all slices and activations, then ask for ``bounds``."""

    def __init__(self) -> None:
        self._tasks: dict[str, dict[str, _Task]] = {}  # by name and processor
        self._windows: dict[tuple[str, str], tuple[int, Ns]] = {}  # by processor and task: the window, in it
        self._most: dict[tuple[str, str], Ns] = {}
        self._active: set[str] = set()

    def slice(self, event: Slice) -> None:
        """A task executed on a processor."""
        where = self._tasks.setdefault(event.task, {})
        task = where.get(event.processor)
        if task is None:
            task = where[event.processor] = _Task()
        task.since += event.end - event.start
        if event.task not in self._active:
            self._in_windows((event.processor, event.task), event.start, event.end)

    def _in_windows(self, who: tuple[str, str], start: Ns, end: Ns) -> None:
        while start < end:
            window = start // WINDOW
            until = min(end, (window + 1) * WINDOW)
            before = self._windows.get(who, (window, 0))
            executed = until - start + (before[1] if before[0] == window else 0)
            self._windows[who] = window, executed
            self._most[who] = max(self._most.get(who, 0), executed)
            start = until

    def activation(self, event: Activation) -> None:
        """An activation ended: what was executed since the one before belongs to it."""
        self._active.add(event.component)
        for task in self._tasks.get(event.component, {}).values():
            task.cost = max(task.cost, task.since)
            task.since = 0
            if task.released != NONE and event.released > task.released:
                gap = event.released - task.released
                task.period = gap if task.period == NONE else min(task.period, gap)
            task.released = max(task.released, event.released)

    def bounds(
        self, processor: ProcessorSetup, components: dict[str, ComponentSetup]
    ) -> dict[str, Ns | None]:
        """Of the active components on *processor*; none under another scheduler than fixed priorities."""
        if processor.scheduler != FIXED_PRIORITY:
            return {}
        here = {name: where[processor.name] for name, where in self._tasks.items() if processor.name in where}
        known = {
            name: Demand(name, components[name].priority, task.cost, task.period)
            for name, task in here.items()
            if name in components and task.cost > 0 and task.period > 0
        }
        loads = [Load(self._most.get((processor.name, name), 0)) for name in here if name not in known]
        return response_bounds(list(known.values()), loads, processor.cores)
