"""The static analysis of a system: utilisation, response times, delays and latencies, with what they assume.

Publishers and subscribers depend on each other: what a flow publishes jitters by its response time, and a
callback's response time depends on that jitter. So bounds are computed again with grown jitters until none
grows (holistic analysis: Tindell and Clark, *Holistic Schedulability Analysis for Distributed Hard Real-Time
Systems*, Microprocessing and Microprogramming 40, 1994).

The latency of a chain is the age of the data at its end, as in ``volery.requirements.ledgers``. A callback
adds its response time; an activation that reads the latest message adds the time between two messages and
its response time (Davare et al., *Period Optimization for Hard Real-Time Distributed Automotive Systems*,
DAC 2007).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from volery.analysis.busy_windows import (
    DeadlineTask,
    LeftOver,
    callback_bound,
    edf_bounds,
    fifo_bound,
)
from volery.analysis.flows import ActivationFlow, FlowReader, Flows, MessageStream, UnboundedExecution
from volery.base.time import Ns, S
from volery.model.instances import Instance, TargetKind
from volery.model.system import Chain, NetworkSpec, ProcessorSpec, System
from volery.requirements.response_bounds import WINDOW, ManyCores, OneCore, TaskDemand, bound_of

MOST_ROUNDS = 40
"""Jitters that still grow after so many rounds have no bound."""

ALWAYS_BUSY = TaskDemand.periodic("always busy", 0, WINDOW, WINDOW)
"""A thread that keeps one core busy all the time."""

ASSUMPTIONS = (
    "execution times are the worst that are stated; the start-up of nodes is over",
    "releases come no faster than the stated periods and jitters allow",
    "a flow executes until it ends its activation: it waits for no lock, message or clock in between, and "
    "for answers no longer than is assumed; the flight of a vehicle is no response time of a computer",
    "the node that serves a vehicle publishes each of its topics once a cycle at most",
    "no component is faulty, and the processors run at the stated frequency",
)
"""Hold for every bound."""


@dataclass(frozen=True)
class Bound:
    """A bound in ns, or why there is none. ``subject`` is a flow, a chain or a topic on a network."""

    subject: str
    bound: Ns | None
    why: str = ""
    deadline: Ns | None = None

    @property
    def holds(self) -> bool | None:
        """Whether the deadline is guaranteed; None without a deadline or a bound."""
        return None if self.bound is None or self.deadline is None else self.bound <= self.deadline


@dataclass(frozen=True)
class Utilisation:
    """The long-term busy share of a processor or network if every flow takes its worst.

    It is what the model states: with ``not_counted`` it is more.
    """

    resource: str
    share: float
    not_counted: tuple[str, ...] = ()


@dataclass(frozen=True)
class Analysis:
    """The results for one system. ``responses`` are by processor."""

    processors: tuple[Utilisation, ...]
    networks: tuple[Utilisation, ...]
    responses: Mapping[str, tuple[Bound, ...]] = field(default_factory=dict)
    delays: tuple[Bound, ...] = ()
    chains: tuple[Bound, ...] = ()


def analyse(system: System) -> Analysis:
    """Analyse *system* without running it.

    Raises:
        EstimateError: The catalogue lacks a processor of the system.
    """
    return _Holistic(system).analysis()


class _Holistic:
    """The state of one analysis: bounds of flows and of delays, which only grow."""

    def __init__(self, system: System) -> None:
        self._system = system
        self._reader = FlowReader(system)
        self._responses: dict[str, Ns | None] = {}
        self._delays: dict[tuple[str, str], Ns | None] = {}
        self._reasons: dict[tuple[str, str], str] = {}

    def analysis(self) -> Analysis:
        flows = self._settle()
        delays = tuple(
            Bound(f"{topic} to {where}", bound, self._reasons.get((topic, where), ""))
            for (topic, where), bound in self._delays.items()
        )
        return Analysis(
            tuple(self._utilisation(processor, flows) for processor in self._system.processors),
            tuple(self._load(network, flows) for network in self._system.networks),
            {processor.name: self._bounds(processor, flows) for processor in self._system.processors},
            delays,
            tuple(self._latency(chain, flows) for chain in self._system.chains),
        )

    def _settle(self) -> Flows:
        """Repeat until no bound grows; what still grows after many rounds has none."""
        for number in range(MOST_ROUNDS + 1):
            flows = self._reader.flows(self._responses, self._delays)
            responses = {
                bound.subject: bound.bound
                for processor in self._system.processors
                for bound in self._bounds(processor, flows)
            }
            delays = self._network_delays(flows)
            if responses == self._responses and delays == self._delays:
                return flows
            if number >= MOST_ROUNDS:
                grown = [name for name, one in responses.items() if one != self._responses.get(name, 0)]
                responses.update(dict.fromkeys(grown))
            self._responses, self._delays = responses, delays
        return self._reader.flows(self._responses, self._delays)

    # -- processors

    def _utilisation(self, processor: ProcessorSpec, flows: Flows) -> Utilisation:
        known, unknown = flows.on(processor.name)
        share = sum(one.share for one in known) + sum(one.least_share for one in unknown)
        missing = tuple(f"{one.instance}: {one.why}" for one in unknown)
        return Utilisation(processor.name, share / processor.cores, missing)

    def _bounds(self, processor: ProcessorSpec, flows: Flows) -> tuple[Bound, ...]:
        known, unknown = flows.on(processor.name)
        refused = [Bound(one.instance, None, one.why) for one in unknown]
        if not known:
            return tuple(refused)
        if processor.scheduler == "fixed-priority":
            return (*_fixed_priority(processor, known, flows), *refused)
        why = _why_no_bound(processor, known) or (unknown and _blamed(unknown[0].instance)) or ""
        if why:
            return (*(Bound(one.name, None, why) for one in known), *refused)
        if processor.scheduler == "edf":
            found = edf_bounds([DeadlineTask(one.demand(), one.deadline or 0) for one in known])
        else:
            found = dict.fromkeys((one.name for one in known), fifo_bound([one.demand() for one in known]))
        return tuple(_stated(one, found[one.name]) for one in known)

    # -- networks

    def _messages(self, network: NetworkSpec, flows: Flows) -> Iterator[tuple[MessageStream, str]]:
        """Yield each stream that crosses *network*, with the processor it goes to, once a subscriber."""
        for stream in flows.streams:
            for reader in self._reader.subscribers(stream.topic):
                if reader.processor is None or not stream.processor or reader.processor == stream.processor:
                    continue
                if self._system.network_between(stream.processor, reader.processor) == network:
                    yield stream, reader.processor

    def _other_traffic(self, network: NetworkSpec) -> list[str]:
        """Return the calls over *network*, whose rate or size the model does not state."""
        processors = {instance.name: instance.processor for instance in self._system.instances}
        return [
            f"calls by {instance.name}: their rate and size are not in the model"
            for instance in self._system.instances
            for connection in instance.connections.values()
            for target in connection.targets
            if target.kind is TargetKind.INSTANCE
            and _crosses(network, instance.processor, processors[target.name])
        ]

    def _load(self, network: NetworkSpec, flows: Flows) -> Utilisation:
        missing = self._other_traffic(network)
        share = 0.0
        for stream, where in self._messages(network, flows):
            if stream.size_b is None:
                missing.append(f"{stream.topic} to {where}: its size is not stated")
            else:
                share += stream.size_b * 8 / network.bandwidth_bit_s / (stream.period / S)
        return Utilisation(network.name, share, tuple(dict.fromkeys(missing)))

    def _network_delays(self, flows: Flows) -> dict[tuple[str, str], Ns | None]:
        found: dict[tuple[str, str], Ns | None] = {}
        for network in self._system.networks:
            messages = list(self._messages(network, flows))
            why = self._why_no_delay(network, messages)
            bound = None
            if not why:
                demands = [
                    TaskDemand.periodic(
                        one.topic, 0, _serialisation(network, one.size_b or 0), one.period, one.jitter
                    )
                    for one, _ in messages
                ]
                queued = fifo_bound(demands)
                bound = None if queued is None else queued + network.latency_ns
                why = "" if bound is not None else f"{network.name} is full"
            for stream, where in messages:
                found[stream.topic, where] = bound
                self._reasons[stream.topic, where] = why
        return found

    def _why_no_delay(self, network: NetworkSpec, messages: Sequence[tuple[MessageStream, str]]) -> str:
        if network.loss > 0.0:
            return f"{network.name} loses {network.loss:.2%} of all transmissions: no delay is certain"
        sizes = [one.topic for one, _ in messages if one.size_b is None]
        if sizes:
            return f"the size of {sizes[0]} is not stated: add `size` to what publishes it"
        other = self._other_traffic(network)
        return f"{network.name} also carries {other[0]}" if other else ""

    # -- chains

    def _latency(self, chain: Chain, flows: Flows) -> Bound:
        total, last = 0, len(chain.topics) - 1
        for place, topic in enumerate(chain.topics):
            following = chain.topics[place + 1] if place < last else ""
            steps = [
                self._step(topic, subscriber, following, flows)
                for subscriber in self._reader.subscribers(topic)
                if not following
                or following
                in (self._reader.topic(subscriber, name) for name in subscriber.component.publishes)
            ]
            if not steps:
                what = f"publishes {following} and " if following else ""
                return Bound(chain.name, None, f"no component of the model {what}subscribes to {topic}")
            for why in (step for step in steps if isinstance(step, str)):
                return Bound(chain.name, None, why)
            total += max(step for step in steps if isinstance(step, int))
        return Bound(chain.name, total)

    def _step(self, topic: str, node: Instance, following: str, flows: Flows) -> Ns | str:
        """Return the longest time of *topic* to *node* and on to what that publishes, or why not."""
        streams = [stream for stream in flows.streams if stream.topic == topic]
        if not streams:
            return f"no flow with a known period and a bound publishes {topic}"
        way = 0
        for one in streams:
            if one.processor and node.processor and one.processor != node.processor:
                delay = self._delays.get((topic, node.processor), 0)
                if delay is None:
                    return f"{topic}: {self._reasons[topic, node.processor]}"
                way = max(way, delay)
        if not following:
            return way
        named = next(
            publish
            for publish in node.component.publishes.values()
            if self._reader.topic(node, publish.name) == following
        )
        trigger = self._reader.topic(node, named.on) if named.on else ""
        answering = [one for one in flows.known if one.instance == node.name and one.topic == trigger]
        responses = [self._responses.get(one.name) for one in answering]
        if not responses or None in responses:
            return f"no bound for the response time of {node.name}, which publishes {following}"
        slowest = max(response for response in responses if response is not None)
        if trigger == topic:
            return way + slowest
        return way + max(stream.period + stream.jitter for stream in streams) + slowest


def _crosses(network: NetworkSpec, one: str | None, other: str | None) -> bool:
    return one != other and one in network.between and other in network.between


def _serialisation(network: NetworkSpec, size_b: float) -> Ns:
    return -(-round(size_b * 8) * S // round(network.bandwidth_bit_s))


def _stated(flow: ActivationFlow, bound: Ns | None) -> Bound:
    why = "" if bound is not None else "the processor is full at its priority, or nearly"
    if why and flow.waits:
        why += ", with the time that it may wait for answers"
    return Bound(flow.name, bound, why, flow.deadline)


def _blamed(instance: str) -> str:
    return f"{instance} can delay it, and what that executes is not known"


def _why_no_bound(processor: ProcessorSpec, known: Sequence[ActivationFlow]) -> str:
    """Return why the analysis does not hold on a processor without fixed priorities, empty if it does."""
    scheduler = processor.scheduler
    if scheduler not in ("edf", "fifo"):
        return f"there is no analysis of {scheduler}"
    if processor.cores > 1:
        return f"{scheduler} is analysed on one core; state `cores: 1`, or use fixed-priority"
    if len({one.thread for one in known}) < len(known):
        return f"several callbacks share a thread: there is no analysis under {scheduler}"
    without = next((one.name for one in known if one.deadline is None), None)
    if scheduler == "edf" and without is not None:
        return f"{without} has no deadline"
    divided = next((one.name for one in known if one.pieces > 1 or one.background), None)
    if scheduler == "fifo" and divided is not None:
        return f"{divided} makes calls and requests the processor several times in an activation"
    return ""


def _fixed_priority(
    processor: ProcessorSpec, known: Sequence[ActivationFlow], flows: Flows
) -> Iterator[Bound]:
    """Yield the bounds of the flows on *processor*; what may be delayed by something unknown has none."""
    unknown = flows.on(processor.name)[1]
    parallel = processor.cores > 1
    everything = [part for one in known for part in (_divided(one) if parallel else [one])]
    threads: dict[str, list[ActivationFlow]] = {}
    for one in sorted(everything, key=lambda each: -each.priority):
        threads.setdefault(one.thread, []).append(one)
    blamed = {thread: _delayed_by(mine, unknown) for thread, mine in threads.items()}
    found: dict[str, Ns | None] = {}
    # A flow that calls a less urgent component is delayed by flows whose bounds come after its own: on
    # several cores, where these are needed, a second pass has them.
    for _ in range(2 if parallel else 1):
        for thread, mine in threads.items():
            if blamed[thread]:
                found.update(dict.fromkeys(one.name for one in mine))
            else:
                _bound_thread(processor, mine, everything, found)
    for thread, mine in threads.items():
        for flow in (one for one in mine if not one.of):
            if blamed[thread]:
                yield Bound(flow.name, None, _blamed(blamed[thread]), flow.deadline)
            else:
                yield _stated(flow, found[flow.name])


def _delayed_by(thread: Sequence[ActivationFlow], unknown: Sequence[UnboundedExecution]) -> str:
    """Return the instance that can delay *thread* and of which not enough is known, or an empty text."""
    least = min(one.least_priority for one in thread)
    urgent = (one.instance for one in unknown if one.priority >= least)
    return next((one for one in urgent if one != thread[0].instance), "")


def _bound_thread(
    processor: ProcessorSpec,
    thread: Sequence[ActivationFlow],
    everything: Sequence[ActivationFlow],
    found: dict[str, Ns | None],
) -> None:
    """Add the bounds of the flows of one thread to *found*."""
    least = min(one.least_priority for one in thread)
    urgent = [one for one in everything if one.thread != thread[0].thread and one.priority >= least]
    others: OneCore | ManyCores
    if processor.cores > 1:
        others = _on_many_cores(processor, urgent, found)
    else:
        others = OneCore([one.demand() for one in urgent], ())
    for flow in thread:
        own, bound = flow.demand(), None
        if flow.of:  # begins at any time within the activation that causes it
            caused = found[flow.of]
            own = own if caused is None else _with_jitter(flow, caused)
        if not flow.of or found[flow.of] is not None:
            rest = [one.demand() for one in thread if one is not flow]
            bound = callback_bound(own, rest, LeftOver(others)) if rest else bound_of(own, others)
        found[flow.name] = bound


def _divided(flow: ActivationFlow) -> list[ActivationFlow]:
    """Return what a flow is on several cores: its thread, and beside it the threads of its library."""
    if not flow.background:
        return [flow]
    name = f"{flow.name} (background)"
    library = replace(flow, name=name, thread=name, cost=flow.background, background=0, of=flow.name)
    return [replace(flow, background=0), library]


def _with_jitter(flow: ActivationFlow, more: Ns) -> TaskDemand:
    return replace(flow, jitter=flow.jitter + more).demand()


def _on_many_cores(
    processor: ProcessorSpec, urgent: Sequence[ActivationFlow], found: Mapping[str, Ns | None]
) -> ManyCores:
    """Return the interference on several cores. What has no bound (yet) takes a core for itself."""
    known = []
    for one in urgent:
        bound = found.get(one.name)
        if bound is None:
            known.append((ALWAYS_BUSY, WINDOW))
        else:
            known.append((_with_jitter(one, found.get(one.of) or 0), bound))
    return ManyCores(known, (), processor.cores)
