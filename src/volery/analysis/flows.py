"""The flows of control of a model: what each activation and callback costs, how often it is released.

What the model leaves open is an ``UnboundedExecution`` with the reason and the remedy; it makes every bound
impossible that it could break, and no other. Costs are those of fidelity ``times``: stated figures, scaled
to the frequency of the processor, and the prices of ROS calls.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from volery.analysis.vehicle_cycles import cycle_of
from volery.base.errors import EstimateError
from volery.base.time import US, Ns, S
from volery.cost import Price, ProcessorPrices, StatedCost, StatedPricing, Tariff, load_catalogue
from volery.model.components import ACTIVATION, StatedFigure
from volery.model.environment import VehicleSpec
from volery.model.instances import ConnectionTarget, Instance, TargetKind
from volery.model.system import System
from volery.requirements.response_bounds import TaskDemand
from volery.ros.graph.interface import absolute_name, absolute_remaps
from volery.run.assembly.computers import (
    LOAD_PERIOD,
    LOAD_PRIORITY,
    LOAD_VARIATION,
    VEHICLE_NODE_LANGUAGE,
    commanded_by,
    is_node,
    load_name,
    ros_language,
)

EXECUTOR_LANGUAGES = ("rclpy", "rclcpp")
"""Their nodes run all callbacks in one thread, an executor's; those of others have a thread each."""
VEHICLE_NODE_PRIORITY = 0


@dataclass(frozen=True)
class ActivationFlow:
    """A sequence of activations with one release pattern.

    ``thread`` is the same for callbacks of one executor. ``cost`` includes context switches; ``background``
    is what library threads of its process execute for it. ``pieces`` is the number of times that one
    activation may request the processor. ``topic`` is that of a callback, ``deadline`` relative to a release.
    ``waits`` is how long an activation may wait for answers, as the model assumes.
    """

    name: str
    instance: str
    processor: str
    thread: str
    priority: int
    least_priority: int
    cost: Ns
    period: Ns
    background: Ns = 0
    jitter: Ns = 0
    deadline: Ns | None = None
    pieces: int = 1
    topic: str = ""
    of: str = ""
    waits: Ns = 0

    @property
    def share(self) -> float:
        """The share of one core that it takes in the long term."""
        return (self.cost + self.background) / self.period

    def demand(self) -> TaskDemand:
        """Return its demand; its background counts as its own, and so does waiting.

        What waits is taken as what executes (suspension-oblivious analysis: Liu, *Real-Time Systems*, 2000).
        """
        cost = self.cost + self.background + self.waits
        made = TaskDemand.periodic(self.name, self.priority, cost, self.period, self.jitter)
        return replace(made, least_priority=self.least_priority)


@dataclass(frozen=True)
class UnboundedExecution:
    """Execution on a processor that the model does not state: up to ``priority``, for the reason ``why``.

    ``least_share`` of a core is stated all the same.
    """

    instance: str
    processor: str
    priority: int
    why: str
    least_share: float = 0.0


@dataclass(frozen=True)
class MessageStream:
    """Messages that one flow publishes on a topic. ``jitter`` is against the period of its source."""

    topic: str
    publisher: str
    processor: str
    flow: str
    period: Ns
    jitter: Ns
    size_b: float | None


class _NotStatedError(Exception):
    """The model does not state what a flow needs; its text says what, and the remedy."""


@dataclass(frozen=True)
class _Cost:
    """Execution time of a thread and of its library's threads, requests of the processor, least priority."""

    time: Ns
    background: Ns
    pieces: int
    least_priority: int

    def plus(self, other: _Cost) -> _Cost:
        return _Cost(
            self.time + other.time,
            self.background + other.background,
            self.pieces + other.pieces,
            min(self.least_priority, other.least_priority),
        )

    def times(self, count: int) -> _Cost:
        return replace(
            self, time=self.time * count, background=self.background * count, pieces=self.pieces * count
        )


def _greatest(costs: Sequence[_Cost]) -> _Cost:
    """Return a cost that none of *costs* exceeds in any part."""
    return _Cost(
        max(cost.time for cost in costs),
        max(cost.background for cost in costs),
        max(cost.pieces for cost in costs),
        min(cost.least_priority for cost in costs),
    )


@dataclass(frozen=True)
class Flows:
    """All that executes on the processors of a system, and the streams of messages between."""

    known: tuple[ActivationFlow, ...]
    unknown: tuple[UnboundedExecution, ...]
    streams: tuple[MessageStream, ...]

    def on(self, processor: str) -> tuple[list[ActivationFlow], list[UnboundedExecution]]:
        """Return what executes on *processor*."""
        return (
            [one for one in self.known if one.processor == processor],
            [one for one in self.unknown if one.processor == processor],
        )


class FlowReader:
    """Reads the flows of a system. Costs are looked up once, ``flows`` is called for growing jitters."""

    def __init__(self, system: System) -> None:
        self.system = system
        catalogue = load_catalogue(*system.catalogues)
        self.prices = {
            processor.name: ProcessorPrices(
                processor.name, catalogue.processor(processor.kind), processor.frequency_hz
            )
            for processor in system.processors
        }
        self._processors = {processor.name: processor for processor in system.processors}
        self._instances = {instance.name: instance for instance in system.instances}
        self._names = {
            instance.name: absolute_remaps(instance.remap, instance.namespace, instance.name)
            for instance in system.instances
        }
        self._subscribed: dict[str, list[Instance]] = {}
        self._callers: dict[str, list[Instance]] = {}
        self._stated: dict[str, StatedPricing] = {}
        for one in system.instances:
            for name in one.component.subscribes:
                self._subscribed.setdefault(self.topic(one, name), []).append(one)
            for target in _targets(one):
                if target.kind is TargetKind.INSTANCE:
                    self._callers.setdefault(target.name, []).append(one)

    def topic(self, instance: Instance, name: str) -> str:
        """Return the full name of a topic that *instance* calls *name*."""
        absolute = absolute_name(name, instance.namespace, instance.name)
        return self._names[instance.name].get(absolute, absolute)

    def subscribers(self, topic: str) -> Sequence[Instance]:
        """Return the instances that subscribe to *topic*, by its full name."""
        return self._subscribed.get(topic, ())

    def flows(self, responses: Mapping[str, Ns | None], delays: Mapping[tuple[str, str], Ns | None]) -> Flows:
        """Return the flows, where the activations of publishers are known to end in time.

        Args:
            responses: Response-time bound of each flow so far, ns; the jitter of what it publishes.
            delays: Bound of the delay of a topic to a processor on the network, ns.
        """
        known: list[ActivationFlow] = []
        unknown: list[UnboundedExecution] = []
        streams: list[MessageStream] = []
        for instance in self._in_order():
            if instance.processor is None:
                streams += self._from_environment(instance)
                continue
            mine, problems = self._flows_of(instance, streams, delays)
            known += mine
            unknown += problems
            streams += [made for one in mine for made in self._published(instance, one, responses)]
        for one in self._called_from_elsewhere():
            (known if isinstance(one, ActivationFlow) else unknown).append(one)  # type: ignore[arg-type]
        for vehicle in self.system.vehicles:
            if vehicle.processor is not None:
                made = self._vehicle_node(vehicle, vehicle.processor)
                (known if isinstance(made, ActivationFlow) else unknown).append(made)  # type: ignore[arg-type]
        known += self._background_loads()
        return Flows(tuple(known), tuple(unknown), tuple(streams))

    def _in_order(self) -> Iterator[Instance]:
        """Yield publishers before those who subscribe to them, as far as there are no cycles."""
        waiting = dict(self._instances)
        published: dict[str, set[str]] = {}
        for one in waiting.values():
            for name in one.component.publishes:
                published.setdefault(self.topic(one, name), set()).add(one.name)
        before = {
            one.name: set().union(
                *(published.get(self.topic(one, name), set()) for name in one.component.subscribes)
            )
            for one in waiting.values()
        }
        while waiting:
            ready = [name for name in waiting if not before[name] & waiting.keys()] or [next(iter(waiting))]
            for name in ready:
                yield waiting.pop(name)

    # -- one instance

    def _flows_of(
        self,
        instance: Instance,
        streams: Sequence[MessageStream],
        delays: Mapping[tuple[str, str], Ns | None],
    ) -> tuple[list[ActivationFlow], list[UnboundedExecution]]:
        component, activity, processor = instance.component, instance.activity, instance.processor or ""
        priority = activity.priority if activity else 0
        if activity is None and not component.subscribes:
            return [], []
        found: list[ActivationFlow] = []
        problems: list[UnboundedExecution] = []

        def refuse(why: str) -> None:
            reached = (one.activity for one in self._reached(instance, processor))
            urgent = [priority, *(one.priority for one in reached if one is not None)]
            share = self._stated_share(instance)
            problems.append(UnboundedExecution(instance.name, processor, max(urgent), why, share))

        serial = component.language in EXECUTOR_LANGUAGES
        thread = instance.name if serial else ""
        try:
            period = _least_distance(instance)
            if activity is not None and period is not None:
                cost = self._cost(instance, "")
                found.append(
                    ActivationFlow(
                        instance.name,
                        instance.name,
                        processor,
                        thread or instance.name,
                        priority,
                        cost.least_priority,
                        cost.time,
                        period,
                        cost.background,
                        activity.jitter_ns,
                        activity.deadline_ns,
                        cost.pieces,
                        waits=component.assume.waits_ns or 0,
                    )
                )
            elif activity is not None and not component.subscribes:
                refuse(
                    "it is active without a period: state `active: {period: ...}`, or what is assumed of its "
                    "releases, `assume: {period: ...}`"
                )
            for name in component.subscribes:
                found += self._callbacks(instance, name, streams, delays)
        except _NotStatedError as error:
            refuse(str(error))
        return ([] if problems else found), problems

    def _stated_share(self, instance: Instance) -> float:
        """Return the share of a core that the stated activation takes once a period."""
        activity = instance.activity
        if activity is None or activity.period_ns is None:
            return 0.0
        try:
            return self._pricing(instance).activation(instance.name).time / activity.period_ns
        except EstimateError:
            return 0.0

    def _callbacks(
        self,
        instance: Instance,
        name: str,
        streams: Sequence[MessageStream],
        delays: Mapping[tuple[str, str], Ns | None],
    ) -> Iterator[ActivationFlow]:
        topic, processor = self.topic(instance, name), instance.processor or ""
        activity = instance.activity
        priority = activity.priority if activity else 0
        arriving = [stream for stream in streams if stream.topic == topic]
        if not arriving:
            raise _NotStatedError(
                f"no flow with a known period publishes {topic} in this model: state its publisher and period"
            )
        cost = self._cost(instance, name)
        for number, stream in enumerate(arriving):
            delay = delays.get((topic, processor), 0) if stream.processor != processor else 0
            if delay is None:
                raise _NotStatedError(f"the delay of {topic} on the network has no bound")
            label = f"{instance.name} {topic}" + (f" #{number + 1}" if len(arriving) > 1 else "")
            deadline = activity.deadline_ns if activity else None
            thread = instance.name if instance.component.language in EXECUTOR_LANGUAGES else label
            jitter = stream.jitter + delay
            yield ActivationFlow(
                label,
                instance.name,
                processor,
                thread,
                priority,
                cost.least_priority,
                cost.time,
                stream.period,
                cost.background,
                jitter,
                deadline,
                cost.pieces,
                topic,
                waits=instance.component.assume.waits_ns or 0,
            )

    def _published(
        self, instance: Instance, flow: ActivationFlow, responses: Mapping[str, Ns | None]
    ) -> Iterator[MessageStream]:
        response = responses.get(flow.name, 0)
        if response is None:
            return
        for publish in instance.component.publishes.values():
            trigger = self.topic(instance, publish.on) if publish.on else ""
            if trigger == flow.topic:
                stream = MessageStream(
                    self.topic(instance, publish.name),
                    instance.name,
                    flow.processor,
                    flow.name,
                    flow.period,
                    flow.jitter + response,
                    publish.size_b,
                )
                yield from [stream] * publish.count

    def _from_environment(self, instance: Instance) -> Iterator[MessageStream]:
        """Yield what a component of the environment publishes, whose computing takes no time."""
        activity = instance.activity
        if activity is not None and activity.period_ns is not None:
            for publish in instance.component.publishes.values():
                stream = MessageStream(
                    self.topic(instance, publish.name),
                    instance.name,
                    "",
                    instance.name,
                    activity.period_ns,
                    activity.jitter_ns,
                    publish.size_b,
                )
                yield from [stream] * (0 if publish.on else publish.count)

    # -- costs

    def _pricing(self, instance: Instance) -> StatedPricing:
        known = self._stated.get(instance.name)
        if known is None:
            component = instance.component
            known = self._stated[instance.name] = self.prices[instance.processor or ""].stated(
                instance.name,
                {name: _stated_costs(figures) for name, figures in component.operations.items()},
                _stated_costs(component.activation),
            )
        return known

    def _cost(self, instance: Instance, trigger: str) -> _Cost:
        """Return the cost of an activation for *trigger*, a subscribed topic by its own name or ''.

        Raises:
            _NotStatedError: Something is missing.
        """
        assume = instance.component.assume
        if commanded_by(instance) and (not assume.beside or assume.waits_ns is None):
            raise _NotStatedError(
                "it commands a vehicle: what its driver executes, and how long it waits for answers, is not "
                f"in the model: add `assume: {{beside: ..., waits: ...}}` to {instance.component.name}"
            )
        priority = instance.activity.priority if instance.activity else 0
        try:
            own = self._pricing(instance).activation(instance.name).time + self._beside(instance)
            cost = _Cost(own, 0, 1, priority).plus(self._called(instance, ACTIVATION))
            for price in self._published_prices(instance, trigger):
                cost = cost.plus(_Cost(price.caller, price.background, 0, priority))
        except EstimateError as error:
            raise _NotStatedError(str(error).removeprefix(f"{instance.name}: ")) from error
        switch = self._processors[instance.processor or ""].context_switch_ns
        return replace(cost, time=cost.time + 2 * switch * cost.pieces)

    def _beside(self, instance: Instance) -> Ns:
        """Return what an activation executes beside its stated time, as assumed."""
        figures = instance.component.assume.beside
        if not figures:
            return 0
        prices, stated = self.prices[instance.processor or ""], _stated_costs(figures)
        return prices.stated(instance.name, {}, stated).activation(instance.name).time

    def _called(self, instance: Instance, caller: str) -> _Cost:
        """Return the cost of the calls that an activation or an operation makes."""
        component = instance.component
        ports = [connection for connection in instance.connections.values() if _callable(connection.targets)]
        if caller not in component.calls and (ports or is_node(instance)):
            what = f"calls of {', '.join(one.port for one in ports)}" if ports else "ROS calls"
            raise _NotStatedError(
                f"the number of its {what} is not stated: add `calls: {{{caller}: {{...}}}}` to "
                f"{component.name}, empty if there are none"
            )
        cost = _Cost(0, 0, 0, 1 << 62)
        for call, count in component.calls.get(caller, {}).items():
            port, dot, operation = call.partition(".")
            if not count:
                continue
            if dot:
                found = [
                    self._call(instance, target, operation) for target in instance.connections[port].targets
                ]
            else:
                price = self._tariff(instance)(call, self._amount(instance, call))
                found = [_Cost(price.caller, price.background, 0, 1 << 62)]
            cost = cost.plus(_greatest(found).times(count))
        return cost

    def _call(self, caller: Instance, target: ConnectionTarget, operation: str) -> _Cost:
        callee = self._instances[target.name]
        if callee.processor is None or (
            callee.processor != caller.processor and caller.component.assume.waits_ns is not None
        ):  # computing in the environment takes no time
            return _Cost(0, 0, 1, 1 << 62)
        if callee.processor != caller.processor:
            raise _NotStatedError(
                f"it waits for {callee.name}.{operation} on {callee.processor}: no bound for tasks that "
                "suspend themselves; if the longest wait is known, state `assume: {waits: ...}` of "
                f"{caller.component.name}"
            )
        others = [one.name for one in self._callers[callee.name] if one is not caller]
        if others:
            raise _NotStatedError(
                f"{callee.name} serves one caller at a time, and {', '.join(others)} may call it, too: "
                "no bound for that blocking"
            )
        return self._operation(callee, operation)

    def _operation(self, callee: Instance, operation: str) -> _Cost:
        own = self._pricing(callee).operation(callee.name, operation).time
        priority = callee.activity.priority if callee.activity else 1 << 62  # passive: its caller's
        return self._called(callee, operation).plus(_Cost(own, 0, 2, priority))

    def _tariff(self, instance: Instance) -> Tariff:
        return self.prices[instance.processor or ""].ros_calls(ros_language(instance))

    def _amount(self, instance: Instance, call: str) -> float:
        """Return the greatest x of a ROS call: microseconds asleep, all subscriptions of a publisher."""
        if call == "sleep":
            return (_least_distance(instance) or S) / US
        names = (self.topic(instance, publish) for publish in instance.component.publishes)
        return float(max((len(self.subscribers(name)) for name in names), default=1))

    def _published_prices(self, instance: Instance, trigger: str) -> Iterator[Price]:
        """Yield the prices of what an activation publishes, and of the message that caused it."""
        if not is_node(instance):
            return
        tariff, component = self._tariff(instance), instance.component
        for publish in component.publishes.values():
            if publish.on == trigger:
                readers = float(len(self.subscribers(self.topic(instance, publish.name))))
                yield from [tariff("publish", readers)] * publish.count
        if trigger:
            yield tariff("receive")
            yield max(tariff("spin_once", 1.0), tariff("spin_once", 0.0))

    # -- what else executes

    def _reached(self, instance: Instance, processor: str) -> Iterator[Instance]:
        seen = {instance.name}
        waiting = [instance]
        while waiting:
            for target in _targets(waiting.pop()):
                if target.kind is TargetKind.INSTANCE and target.name not in seen:
                    seen.add(target.name)
                    callee = self._instances[target.name]
                    waiting.append(callee)
                    if callee.processor == processor:
                        yield callee

    def _called_from_elsewhere(self) -> Iterator[ActivationFlow | UnboundedExecution]:
        for name, callers in self._callers.items():
            callee = self._instances[name]
            for caller in callers:
                if callee.processor is None or caller.processor == callee.processor:
                    continue
                calls = caller.component.calls
                if calls and not any(map(any, (call.values() for call in calls.values()))):
                    continue
                by = callee.activity or caller.activity  # a passive one has its caller's priority
                priority = by.priority if by else 0
                try:
                    yield self._served(callee, caller, priority)
                except (_NotStatedError, EstimateError) as error:
                    yield UnboundedExecution(callee.name, callee.processor, priority, str(error))

    def _served(self, callee: Instance, caller: Instance, priority: int) -> ActivationFlow:
        """Return what *callee* executes for the activations of *caller* on another computer.

        A pause lies between the calls of two activations, however long they take.

        Raises:
            _NotStatedError: The model does not limit how often.
        """
        where = caller.processor or "the environment"
        pause, calls = caller.component.assume.pause_ns, caller.component.calls.get(ACTIVATION)
        if pause is None or calls is None:
            missing = "assume: {pause: ...}" if calls is not None else "calls: {activation: {...}}"
            raise _NotStatedError(
                f"{caller.name} calls it from {where} at a rate that is not in the model: state "
                f"`{missing}` of {caller.component.name}"
            )
        cost = _Cost(0, 0, 0, priority)
        for call, count in calls.items():
            port, _, operation = call.partition(".")
            targets = caller.connections[port].targets if port in caller.connections else ()
            if count and any(target.name == callee.name for target in targets):
                cost = cost.plus(self._operation(callee, operation).times(count))
        switch = self._processors[callee.processor or ""].context_switch_ns
        name = f"{callee.name} for {caller.name}"
        return ActivationFlow(
            name,
            callee.name,
            callee.processor or "",
            name,
            priority,
            min(priority, cost.least_priority),
            cost.time + 2 * switch * cost.pieces,
            pause,
            cost.background,
            pieces=cost.pieces,
        )

    def _vehicle_node(self, vehicle: VehicleSpec, processor: str) -> ActivationFlow | UnboundedExecution:
        """Return the loop of the node that serves a vehicle, with all that it executes for commands."""
        cycle = cycle_of(vehicle.autopilot, vehicle.names)
        if cycle is None:
            why = f"{vehicle.autopilot} is a node itself: its message rates are not known"
            return UnboundedExecution(vehicle.name, processor, VEHICLE_NODE_PRIORITY, why)
        commanders = sum(vehicle.name in commanded_by(instance) for instance in self.system.instances)
        above = f"/{vehicle.name}/"
        readers = commanders + sum(
            len(found) for topic, found in self._subscribed.items() if topic.startswith(above)
        )
        tariff = self.prices[processor].ros_calls(VEHICLE_NODE_LANGUAGE)
        sleep, publish = tariff("sleep", cycle.period / US), tariff("publish", float(readers))
        taken = [tariff("receive"), max(tariff("spin_once", 1.0), tariff("spin_once", 0.0)), tariff("serve")]
        requests = cycle.requests * commanders
        cost = cycle.messages * publish.caller + requests * sum(one.caller for one in taken) + sleep.caller
        background = cycle.messages * publish.background + sleep.background
        background += requests * sum(one.background for one in taken)
        switch = 2 * self._processors[processor].context_switch_ns
        pieces = cycle.messages + 3 * requests + 1
        return ActivationFlow(
            vehicle.name,
            vehicle.name,
            processor,
            vehicle.name,
            VEHICLE_NODE_PRIORITY,
            VEHICLE_NODE_PRIORITY,
            cost + switch * pieces,
            cycle.period,
            background,
            pieces=pieces,
        )

    def _background_loads(self) -> Iterator[ActivationFlow]:
        for processor in self.system.processors:
            if processor.load > 0.0:
                greatest = processor.load + LOAD_VARIATION * min(processor.load, 1.0 - processor.load)
                cost = round(greatest * LOAD_PERIOD) + 2 * processor.context_switch_ns
                for core in range(processor.cores):
                    name = load_name(processor.name) + (f" {core}" if processor.cores > 1 else "")
                    yield ActivationFlow(
                        name, name, processor.name, name, LOAD_PRIORITY, LOAD_PRIORITY, cost, LOAD_PERIOD
                    )


def _stated_costs(figures: Sequence[StatedFigure]) -> list[StatedCost]:
    return [StatedCost(figure.processor, figure.frequency_hz, figure.longest_ns) for figure in figures]


def _least_distance(instance: Instance) -> Ns | None:
    """Return the least time between two releases of its own flow of control, None if nothing limits it."""
    assume, stated = instance.component.assume, instance.activity.period_ns if instance.activity else None
    return stated or max(assume.period_ns or 0, assume.pause_ns or 0) or None


def _targets(instance: Instance) -> Iterator[ConnectionTarget]:
    for connection in instance.connections.values():
        yield from connection.targets


def _callable(targets: Sequence[ConnectionTarget]) -> bool:
    return any(target.kind is TargetKind.INSTANCE for target in targets)
