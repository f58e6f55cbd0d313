"""Ledgers: what one component, one vehicle or one chain of topics did in a run, each closing to a record.

Durations are kept as distributions in bounded memory, exactly the same on every machine: integer nanoseconds
fall into buckets that keep the ten leading bits, the idea of HdrHistogram (https://hdrhistogram.org). Mean,
count and maximum are exact, a quantile is at most 0.2 % too high and never too low.

The latency of a chain of topics is the age of its data: the time of a message on the last topic since the
message on the first topic was sent that it may have been made from; at each node in between, the latest one
that had arrived there when it published. (Feiertag et al., *A Compositional Framework for End-to-End Path
Delay Calculation*, CRTS 2008.)
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from math import fsum, hypot, isnan, nan, sqrt

from volery.base.time import Ns, S, to_seconds
from volery.requirements.record import (
    ChainRecord,
    ComponentRecord,
    LatencyRecord,
    OffsetRecord,
    OperationRecord,
    ResponseRecord,
    VehicleRecord,
)
from volery.trace.attachments import ChainSetup, ComponentSetup, ProcessorSetup, VehicleSetup
from volery.trace.events import (
    NONE,
    Activation,
    BatteryService,
    Call,
    Charge,
    Message,
    Operation,
    Transmission,
    VehicleState,
)

_BITS = 10


PERIOD_TOLERANCE = 0.1
"""A release is in time if it is at most this share of the period late."""

LANDINGS = ("land", "return_home")
"""Operations that end on the ground. The landing at the end of a run, ``come_to_rest``, is not judged."""

AT_THE_END = "come_to_rest"
"""Operation by which the run itself brings a vehicle down when its components have ended."""

TRAVELS = ("goto", "drive")
"""Operations that go to a point."""

OK = "ok"

Quantities = dict[str, float | None]
"""What was observed of one subject, by the names of the observables; None where nothing was."""


class DurationStatistics:
    """Count, mean, maximum and quantiles of non-negative durations."""

    def __init__(self) -> None:
        self.count = 0
        self.total: Ns = 0
        self.largest: Ns = 0
        self._buckets: dict[int, int] = {}

    def add(self, duration: Ns) -> None:
        """Add a duration; a negative one counts as 0."""
        value = max(0, duration)
        self.count += 1
        self.total += value
        self.largest = max(self.largest, value)
        shift = max(0, value.bit_length() - _BITS)
        bucket = (shift << _BITS) + (value >> shift)
        self._buckets[bucket] = self._buckets.get(bucket, 0) + 1

    def mean(self) -> float | None:
        """Return the mean in nanoseconds, None if nothing was added."""
        return self.total / self.count if self.count else None

    def quantile(self, share: float) -> Ns | None:
        """Return the smallest duration that *share* (0..1) of all do not exceed; None if there are none."""
        if not self.count:
            return None
        wanted = share * self.count
        seen = 0
        for bucket in sorted(self._buckets):
            seen += self._buckets[bucket]
            if seen >= wanted:
                return min(_upper_edge(bucket), self.largest)
        return self.largest

    def seconds(self, name: str) -> Quantities:
        """Return *name*, its mean and its 95 % quantile in seconds."""
        if not self.count:
            return {name: None, f"{name}_mean": None, f"{name}_p95": None}
        mean, p95 = self.total / self.count, self.quantile(0.95) or 0
        return {name: self.largest / S, f"{name}_mean": mean / S, f"{name}_p95": p95 / S}


def _upper_edge(bucket: int) -> Ns:
    shift, leading = bucket >> _BITS, bucket & ((1 << _BITS) - 1)
    return ((leading + 1) << shift) - 1


ROS_PREFIX = "ros:"
STILL_M_S = 1.0
"""Speed below which a disarmed vehicle is at rest [m/s]. Estimates drift: a PX4 1.14 on the ground reported
0.56 m/s. What falls is faster after 0.1 s."""
AIRBORNE_M = 0.3

EnergyLaw = Callable[[ProcessorSetup, float, float], float | None]
"""Energy of a processor in joules from its busy core-seconds and the elapsed seconds, None without figures.

With zero elapsed seconds it must return the energy above idle.
"""


def linear_energy(processor: ProcessorSetup, busy_core_s: float, elapsed_s: float) -> float | None:
    """Return the idle energy plus the step from idle to busy power in proportion to the busy cores.

    E = idle_w * elapsed + (busy_w - idle_w) * busy / cores: the linear model of Fan, Weber and Barroso,
    *Power Provisioning for a Warehouse-sized Computer*, ISCA 2007, section 3.
    """
    if processor.idle_w is None or processor.busy_w is None:
        return None
    step = processor.busy_w - processor.idle_w
    return processor.idle_w * elapsed_s + step * busy_core_s / processor.cores


@dataclass
class ComponentLedger:
    """Execution times, calls and activations of one component."""

    setup: ComponentSetup
    processor: str
    executed: Ns = 0
    ros: Ns = 0
    priced: Ns = 0  # charged time whose energy the model states
    stated_j: float = 0.0
    charges: int = 0  # other than ROS calls
    ros_calls: dict[str, int] = field(default_factory=dict)
    misses: int = 0
    deadlines: int = 0  # activations with one
    late: int = 0  # releases later than the promised period
    released: Ns = NONE  # the latest release of a component with a period
    activations: DurationStatistics = field(default_factory=DurationStatistics)
    calls: DurationStatistics = field(default_factory=DurationStatistics)

    def charge(self, event: Charge) -> None:
        """Add execution time that was charged."""
        owed = event.caller + event.background
        if event.kind.startswith(ROS_PREFIX):
            self.ros += owed
            call, _, count = event.kind[len(ROS_PREFIX) :].partition("*")
            self.ros_calls[call] = self.ros_calls.get(call, 0) + (int(count) if count else 1)
        else:
            self.charges += 1
        if event.energy:
            self.stated_j += event.energy
            self.priced += owed

    def activation(self, event: Activation) -> None:
        """Add an activation that ended."""
        self.activations.add(event.finished - event.released)
        if event.deadline != NONE:
            self.deadlines += 1
            self.misses += event.finished > event.deadline
        period = self.setup.period
        if period != NONE:
            if self.released != NONE:
                self.late += event.released - self.released > round(period * (1.0 + PERIOD_TOLERANCE))
            self.released = max(self.released, event.released)

    def call(self, event: Call) -> None:
        """Add a call that the component served."""
        self.calls.add(event.end - event.start)

    def unpriced_s(self) -> float:
        """Return the executed seconds whose energy the model does not state."""
        return to_seconds(max(0, self.executed - self.priced))

    def uncounted(self) -> bool:
        """Return whether the component was active without any execution time of its own."""
        return not self.charges and bool(self.activations.count or self.calls.count)

    def energy(self, processor: ProcessorSetup | None, law: EnergyLaw) -> float | None:
        """Return joules: what the model states of its operations, else what *law* gives above idle."""
        by_law = None if processor is None else law(processor, self.unpriced_s(), 0.0)
        return None if by_law is None else self.stated_j + by_law

    def record(self, energy_j: float | None, response_bound: Ns | None = None) -> ComponentRecord:
        """Return the record."""
        return ComponentRecord(
            processor=self.processor,
            language=self.setup.language,
            cpu_s=to_seconds(self.executed),
            ros_cpu_s=to_seconds(min(self.ros, self.executed)),  # calls charged last may not have executed
            ros_calls=dict(sorted(self.ros_calls.items())),
            energy_j=energy_j,
            activations=self.activations.count,
            deadline_misses=self.misses,
            calls=self.calls.count,
            response_s=self._response(),
            response_bound_s=None if response_bound is None else to_seconds(response_bound),
        )

    def quantities(self, elapsed_s: float, energy_j: float | None) -> Quantities:
        """Return all that can be observed of it but its failures."""
        executed = to_seconds(self.executed)
        return {
            **self.responses().seconds("response_time"),
            "deadline_misses": float(self.misses) if self.deadlines else None,
            "period_violations": None if self.released == NONE else float(self.late),
            "activations": float(self.activations.count),
            "cpu_time": executed if elapsed_s else None,
            "utilisation": executed / elapsed_s if elapsed_s else None,
            **self.calls.seconds("call_time"),
            "calls": float(self.calls.count),
            "energy": energy_j,
        }

    def responses(self) -> DurationStatistics:
        """Return its response times: a passive component responds to calls, an active one to releases."""
        first, other = (self.activations, self.calls) if self.setup.active else (self.calls, self.activations)
        return first if first.count else other

    def _response(self) -> ResponseRecord:
        spread = self.responses()
        mean, p95 = spread.mean(), spread.quantile(0.95)
        if mean is None or p95 is None:
            return ResponseRecord()
        return ResponseRecord(
            of="activations" if spread is self.activations else "calls",
            count=spread.count,
            mean=mean * 1e-9,
            p95=to_seconds(p95),
            max=to_seconds(spread.largest),
        )


def processor_energy(
    processor: ProcessorSetup, ledgers: Iterable[ComponentLedger], elapsed_s: float, law: EnergyLaw
) -> float | None:
    """Return joules of a processor over *elapsed_s*, with what is stated of the *ledgers* allocated to it."""
    here = [ledger for ledger in ledgers if ledger.processor == processor.name]
    by_law = law(processor, fsum(one.unpriced_s() for one in here), elapsed_s)
    return None if by_law is None else by_law + fsum(one.stated_j for one in here)


@dataclass
class VehicleLedger:
    """Path, times, energy and operations of one vehicle."""

    setup: VehicleSetup
    last: VehicleState | None = None
    ground: float = 0.0
    distance: float = 0.0
    armed: Ns = 0
    airborne: Ns = 0
    joules: float = 0.0
    metered: bool = False
    least_battery: float = nan
    swaps: int = 0
    charging: Ns = 0
    operations: list[Operation] = field(default_factory=list)

    def served(self, event: BatteryService) -> None:
        """Add a service of a place."""
        self.swaps += event.kind == "swap"
        self.charging += event.duration

    def state(self, event: VehicleState) -> None:
        """Add a state; states must be in the order of time."""
        if self.last is not None:
            self._between(self.last, event)
        z = event.where()[2]
        if not event.armed and not isnan(z):
            self.ground = z
        if not event.battery >= self.least_battery and not isnan(event.battery):
            self.least_battery = event.battery
        self.last = event

    def _between(self, before: VehicleState, after: VehicleState) -> None:
        elapsed = after.at - before.at
        (x0, y0, z0), (x1, y1, z1) = before.where(), after.where()
        x, y, z = x1 - x0, y1 - y0, z1 - z0
        moved = sqrt(x * x + y * y + z * z)
        if not isnan(moved):
            self.distance += moved
        if before.armed:
            self.armed += elapsed
            if self.setup.kind != "rover" and z0 - self.ground > AIRBORNE_M:
                self.airborne += elapsed
        watts = (before.volts * before.amperes + after.volts * after.amperes) / 2.0
        if not isnan(watts):
            self.metered = True
            self.joules += watts * to_seconds(elapsed)

    def quantities(self) -> Quantities:
        """Return all that can be observed of it but its collisions."""
        landings = [
            operation
            for operation in self.operations
            if operation.operation in LANDINGS and operation.outcome == OK
        ]
        travels = [
            operation
            for operation in self.operations
            if operation.operation in TRAVELS and operation.outcome == OK
        ]
        failed = [
            operation
            for operation in self.operations
            if operation.outcome != OK and operation.operation != AT_THE_END
        ]
        observed = self.last is not None
        return {
            "landing_offset": largest([landing.true_horizontal for landing in landings]),
            "goto_error": largest([travel.true_horizontal for travel in travels]),
            "goto_error_vertical": largest([travel.true_vertical for travel in travels]),
            "goto_error_by_estimate": largest([travel.estimate_horizontal for travel in travels]),
            "battery_min": known(self.least_battery),
            "distance": self.distance if observed else None,
            "airborne_time": to_seconds(self.airborne) if observed else None,
            "energy": self.joules if observed and self.metered else None,
            "battery_swaps": float(self.swaps),
            "charging_time": to_seconds(self.charging),
            "failures": float(len(failed)),
        }

    def record(self) -> VehicleRecord:
        """Return the record."""
        done = [operation for operation in self.operations if operation.outcome == OK]
        last = self.last
        return VehicleRecord(
            autopilot=self.setup.autopilot,
            firmware=self.setup.firmware,
            kind=self.setup.kind,
            distance_m=self.distance,
            armed_s=to_seconds(self.armed),
            airborne_s=to_seconds(self.airborne),
            energy_j=self.joules if self.metered else None,
            battery=None if last is None else known(last.battery),
            landed=None if last is None else _stands(last),
            battery_swaps=self.swaps,
            charging_s=to_seconds(self.charging),
            error_by_estimate_m=OffsetRecord(
                horizontal=largest([one.estimate_horizontal for one in done]),
                vertical=largest([one.estimate_vertical for one in done]),
            ),
            error_by_truth_m=OffsetRecord(
                horizontal=largest([one.true_horizontal for one in done]),
                vertical=largest([one.true_vertical for one in done]),
            ),
            operations=[_operation(operation) for operation in self.operations],
        )


def _stands(state: VehicleState) -> bool:
    speed = hypot(state.vx, state.vy, state.vz)
    return not state.armed and (isnan(speed) or speed < STILL_M_S)


def _operation(event: Operation) -> OperationRecord:
    return OperationRecord(
        operation=event.operation,
        asked=event.asked,
        start_s=to_seconds(event.start),
        end_s=to_seconds(event.end),
        outcome=event.outcome,
        said=event.said,
        error_by_estimate_m=OffsetRecord(
            horizontal=known(event.estimate_horizontal), vertical=known(event.estimate_vertical)
        ),
        error_by_truth_m=OffsetRecord(
            horizontal=known(event.true_horizontal), vertical=known(event.true_vertical)
        ),
    )


def known(value: float) -> float | None:
    """Return *value*, or None if it is NaN."""
    return None if isnan(value) else value


def largest(values: list[float]) -> float | None:
    """Return the greatest absolute value; None if all are NaN or there are none."""
    sizes = [abs(value) for value in values if not isnan(value)]
    return max(sizes, default=None)


@dataclass
class NetworkLedger:
    """Transmissions over one network."""

    occupied: Ns = 0
    lost: int = 0
    delays: DurationStatistics = field(default_factory=DurationStatistics)

    def transmission(self, event: Transmission) -> None:
        """Add a transmission that arrived or was lost."""
        self.occupied += event.occupied
        if event.received == NONE:
            self.lost += 1
        else:
            self.delays.add(event.received - event.sent)

    def quantities(self, elapsed: Ns) -> Quantities:
        """Return all that can be observed of it."""
        return {
            "utilisation": min(1.0, self.occupied / elapsed) if elapsed else None,
            **self.delays.seconds("delay"),
            "lost": float(self.lost),
        }


_REMEMBERED = 256
"""Messages that a node may have received since it sent the one that arrives now."""

Received = deque[tuple[Ns, Ns]]


class ChainLedger:
    """Latencies of one chain of topics, from all messages of a run."""

    def __init__(self, setup: ChainSetup) -> None:
        self.setup = setup
        self.latencies = DurationStatistics()
        self._received: list[dict[str, Received]] = [
            {} for _ in setup.topics
        ]  # by topic and node: when, since when
        self._arrivals, self._losses = [0] * len(setup.topics), [0] * len(setup.topics)

    def message(self, event: Message) -> None:
        """Add a message that arrived or was lost."""
        for place, topic in enumerate(self.setup.topics):
            if topic == event.topic:
                if event.received == NONE:
                    self._losses[place] += 1
                    continue
                self._arrivals[place] += 1
                since = self._since(place, event)
                if since is not None:
                    self._arrived(place, event, since)

    def _since(self, place: int, event: Message) -> Ns | None:
        """Return when the chain began that led to *event*, None if no message preceded it."""
        if place == 0:
            return event.sent
        received = self._received[place - 1].get(_bare(event.publisher), ())
        return next((since for at, since in reversed(received) if at <= event.sent), None)

    def _arrived(self, place: int, event: Message, since: Ns) -> None:
        if place == len(self.setup.topics) - 1:
            self.latencies.add(event.received - since)
        else:
            received = self._received[place].setdefault(_bare(event.subscriber), deque(maxlen=_REMEMBERED))
            received.append((event.received, since))

    def record(self) -> ChainRecord:
        """Return the record."""
        spread = self.latencies
        mean, p95 = spread.mean(), spread.quantile(0.95)
        if mean is None or p95 is None:
            why = self._unobserved()
            return ChainRecord(topics=list(self.setup.topics), latency_s=LatencyRecord(), unobserved=why)
        latency = LatencyRecord(
            count=spread.count, mean=mean * 1e-9, p95=p95 * 1e-9, max=spread.largest * 1e-9
        )
        return ChainRecord(topics=list(self.setup.topics), latency_s=latency)

    def _unobserved(self) -> str:
        """Return why no message on the last topic goes back to one on the first."""
        topics = self.setup.topics
        for place, topic in enumerate(topics):
            if not self._arrivals[place]:
                if self._losses[place]:
                    return f"all {self._losses[place]} messages of {topic} were lost"
                return f"no message of {topic} arrived: no node publishes it, or none subscribes to it"
        received = next(place for place, nodes in enumerate(self._received) if not nodes)
        before, after = topics[received - 1], topics[received]
        return f"no node published {after} after it had received {before}"


def _bare(node: str) -> str:
    return node.strip("/")
