"""Spread of durations, exact or close as promised; what one component, vehicle or chain comes to."""

from math import nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.base.time import MS, S
from volery.requirements.ledgers import (
    ChainLedger,
    ComponentLedger,
    DurationStatistics,
    VehicleLedger,
    known,
    largest,
    linear_energy,
)
from volery.trace.attachments import ChainSetup, ComponentSetup, ProcessorSetup, VehicleSetup
from volery.trace.events import NONE, Activation, Call, Charge, Message, Operation, VehicleState


def spread(durations: list[int]) -> DurationStatistics:
    found = DurationStatistics()
    for duration in durations:
        found.add(duration)
    return found


def test_nothing_observed_is_none_not_zero() -> None:
    assert spread([]).mean() is None
    assert spread([]).quantile(0.95) is None


@given(st.lists(st.integers(0, 10**13), min_size=1), st.sampled_from([0.5, 0.95, 0.99, 1.0]))
def test_quantiles_are_never_too_low_and_at_most_two_permille_too_high(
    values: list[int], share: float
) -> None:
    found = spread(values)
    exact = next(value for rank, value in enumerate(sorted(values), start=1) if rank >= share * len(values))
    measured = found.quantile(share)
    assert measured is not None
    assert exact <= measured <= exact * 1.002
    assert measured <= found.largest == max(values)
    assert found.mean() == sum(values) / len(values)


@given(st.permutations(list(range(0, 5_000_000, 99_991))))
def test_order_does_not_matter(values: list[int]) -> None:
    assert spread(values).quantile(0.95) == spread(sorted(values)).quantile(0.95)


def test_memory_does_not_grow_with_observations() -> None:
    found = spread([(index * 2_654_435_761) % 10**9 for index in range(50_000)])
    assert len(found._buckets) < 12_000


def test_a_negative_duration_is_none_at_all() -> None:
    found = spread([-5, 10])
    assert (found.count, found.total, found.largest) == (2, 10, 10)
    assert found.quantile(0.5) == 0
    assert found.quantile(1.5) == 10


def component(*events: Charge | Activation | Call, executed: int = 0) -> ComponentLedger:
    ledger = ComponentLedger(ComponentSetup("control", language="rospy"), "onboard", executed=executed)
    for event in events:
        if isinstance(event, Charge):
            ledger.charge(event)
        elif isinstance(event, Activation):
            ledger.activation(event)
        else:
            ledger.call(event)
    return ledger


def test_charges_of_ros_calls_of_code_and_of_stated_energy() -> None:
    ledger = component(
        Charge(0, "control", "onboard", "code", 20 * MS, 0, 0.0),
        Charge(0, "control", "onboard", "ros:publish", 6 * MS, 4 * MS, 0.0),
        Charge(0, "control", "onboard", "ros:publish*3", 2 * MS, 0, 0.0),
        Charge(0, "control", "onboard", "ros:param", 1 * MS, 0, 0.0),
        Charge(0, "control", "onboard", "operation:look", 7 * MS, 3 * MS, 0.5),
        executed=100 * MS,
    )
    assert ledger.charges == 2
    assert ledger.unpriced_s() == 0.09
    onboard = ProcessorSetup("onboard")
    record = ledger.record(ledger.energy(onboard, lambda processor, busy_s, elapsed: 2.0 * busy_s), 40 * MS)
    assert record.cpu_s == 0.1
    assert record.ros_cpu_s == 0.013
    assert list(record.ros_calls.items()) == [("param", 1), ("publish", 4)]
    assert record.energy_j == pytest.approx(0.5 + 2.0 * 0.09)
    assert record.response_bound_s == 0.04
    assert ledger.energy(None, linear_energy) is None
    assert ledger.record(None).energy_j is None
    assert ledger.record(None).response_bound_s is None


def test_ros_calls_take_no_more_than_what_was_executed() -> None:
    """Calls that were charged at the end of a run have not been executed."""
    ledger = component(Charge(0, "control", "onboard", "ros:publish", 3 * MS, 0, 0.0), executed=2 * MS)
    assert ledger.record(None).ros_cpu_s == 0.002


def test_more_stated_than_executed_leaves_nothing_for_the_law() -> None:
    ledger = component(Charge(0, "control", "onboard", "operation:x", 3 * MS, 0, 0.1), executed=2 * MS)
    assert ledger.unpriced_s() == 0.0


def test_a_component_without_code_of_its_own_is_uncounted() -> None:
    charge = Charge(0, "control", "onboard", "ros:publish", 1, 0, 0.0)
    assert not component(charge).uncounted()
    assert component(charge, Activation(0, 1, "control", NONE)).uncounted()
    assert component(charge, Call(0, 1, "a", "control", "ask", "ok")).uncounted()
    code = charge._replace(kind="code")
    assert not component(code, Activation(0, 1, "control", NONE)).uncounted()


def test_a_deadline_is_missed_after_it_and_not_at_it() -> None:
    ledger = component(
        Activation(0, 10 * MS, "control", 10 * MS),
        Activation(0, 10 * MS + 1, "control", 10 * MS),
        Activation(0, 12 * MS, "control", 10 * MS),
        Activation(0, 50 * MS, "control", NONE),
        *[Activation(0, end * MS, "control", 10 * MS) for end in (1, 2)],
    )
    assert ledger.misses == 2


def test_a_passive_component_responds_to_calls_and_an_active_one_to_releases() -> None:
    calls = [Call(S, S + n * MS, "a", "control", "ask", "ok") for n in range(1, 101)]
    release = Activation(2 * S, 2 * S + 7 * MS, "control", NONE)
    spread = component(*calls, release).record(None).response_s
    assert (spread.of, spread.count, spread.max) == ("calls", 100, 0.1)
    assert spread.mean == pytest.approx(0.0505)
    assert spread.p95 == pytest.approx(0.095, rel=2e-3)
    spread = component(release).record(None).response_s  # a node that has callbacks only
    assert (spread.of, spread.count, spread.mean) == ("activations", 1, 0.007)
    active = component(*calls, release)
    active.setup = ComponentSetup("control", active=True)
    spread = active.record(None).response_s
    assert (spread.of, spread.count, spread.mean) == ("activations", 1, 0.007)
    assert component().record(None).response_s.count == 0


def test_energy_of_a_processor() -> None:
    onboard = ProcessorSetup("onboard", "rpi4", 1500.0, "fixed-priority", 4, 2.0, 6.0)
    assert linear_energy(onboard, 2.0, 10.0) == 22.0
    assert linear_energy(onboard, 2.0, 0.0) == 2.0
    assert linear_energy(ProcessorSetup("z", busy_w=6.0), 1.0, 1.0) is None
    assert linear_energy(ProcessorSetup("z", idle_w=6.0), 1.0, 1.0) is None


def state(at: int, **changes: object) -> VehicleState:
    still = VehicleState(
        at, "d", *[0.0] * 3, 1.0, *[0.0] * 6, nan, nan, nan, 0.9, 12.0, 2.0, False, "STABILIZE"
    )
    return still._replace(**changes)


def test_a_vehicle_between_two_states() -> None:
    ledger = VehicleLedger(VehicleSetup("d", "px4", "multirotor"))
    ledger.state(state(S, z=5.0))
    ledger.state(state(3 * S, x=1.0, y=2.0, z=7.0, armed=True, volts=10.0, amperes=4.0))
    assert (ledger.armed, ledger.airborne) == (0, 0)
    assert ledger.joules == pytest.approx((24.0 + 40.0) / 2 * 2)
    ledger.state(state(4 * S, x=1.0, y=2.0, z=5.3, armed=True))
    assert (ledger.armed, ledger.airborne) == (S, S)
    ledger.state(state(6 * S, x=1.0, y=2.0, z=5.5, armed=True))
    assert (ledger.armed, ledger.airborne) == (3 * S, S)  # 30 cm above the ground is no flight
    ledger.state(state(7 * S, x=1.0, y=2.0, z=5.0, volts=nan, battery=nan))
    record = ledger.record()
    assert (record.armed_s, record.airborne_s) == (4.0, 2.0)
    assert record.distance_m == pytest.approx(3.0 + 1.7 + 0.2 + 0.5)
    assert record.battery is None
    assert record.energy_j == pytest.approx(64.0 + (40.0 + 24.0) / 2 + 24.0 * 2)
    assert record.landed


@pytest.mark.parametrize(
    ("speed", "armed", "landed"), [(0.99, False, True), (1.0, False, False), (0.0, True, False)]
)
def test_landed_is_disarmed_and_at_rest(speed: float, armed: bool, landed: bool) -> None:
    ledger = VehicleLedger(VehicleSetup("d"))
    ledger.state(state(0, vx=speed, armed=armed))
    assert ledger.record().landed is landed


def test_energy_that_no_reading_gives_is_not_zero() -> None:
    ledger = VehicleLedger(VehicleSetup("d"))
    ledger.state(state(0, volts=nan))
    ledger.state(state(S, volts=nan))
    assert ledger.record().energy_j is None
    ledger.state(state(2 * S, volts=10.0, amperes=0.0))
    ledger.state(state(3 * S, volts=10.0, amperes=0.0))
    assert ledger.record().energy_j == 0.0


def test_operations_of_a_vehicle() -> None:
    done = Operation(S, 3 * S, "d", "goto", "there", "ok", "", 0.2, -0.4, nan, 0.1)
    ledger = VehicleLedger(VehicleSetup("d"), operations=[done])
    (record,) = ledger.record().operations
    assert (record.start_s, record.end_s, record.outcome) == (1.0, 3.0, "ok")
    assert (record.error_by_estimate_m.horizontal, record.error_by_estimate_m.vertical) == (0.2, -0.4)
    assert (record.error_by_truth_m.horizontal, record.error_by_truth_m.vertical) == (None, 0.1)


def test_what_is_known_and_the_largest_of_it() -> None:
    assert (known(nan), known(0.0)) == (None, 0.0)
    assert largest([1.0, -3.0, nan]) == 3.0
    assert largest([nan]) is None


def chain(*events: Message) -> ChainLedger:
    ledger = ChainLedger(ChainSetup("eye-to-hand", ("/image", "/pose", "/command")))
    for event in events:
        ledger.message(event)
    return ledger


def test_a_chain_is_as_old_as_the_message_it_was_made_from() -> None:
    found = chain(
        Message(0, 5 * MS, "/image", "/camera", "/locate", 1),
        Message(10 * MS, 12 * MS, "/image", "/camera", "/locate", 1),
        Message(11 * MS, 15 * MS, "/pose", "/locate", "/steer", 1),  # of the first image
        Message(16 * MS, 20 * MS, "/command", "/steer", "/motor", 1),
        Message(20 * MS, 21 * MS, "/pose", "locate", "steer", 1),  # of the second
        Message(21 * MS, 30 * MS, "/command", "steer", "motor", 1),
    )
    assert found.latencies.count == 2
    record = found.record()
    assert record.topics == ["/image", "/pose", "/command"]
    assert record.latency_s.count == 2
    assert record.latency_s.mean == pytest.approx(0.020)
    assert record.latency_s.max == pytest.approx(0.020)
    assert record.latency_s.p95 == pytest.approx(0.020)


def test_what_was_lost_or_has_no_beginning_is_in_no_chain() -> None:
    found = chain(
        Message(0, NONE, "/image", "/camera", "/locate", 1),
        Message(1 * MS, 2 * MS, "/pose", "/locate", "/steer", 1),
        Message(3 * MS, 4 * MS, "/command", "/steer", "/motor", 1),
        Message(5 * MS, 6 * MS, "/image", "/camera", "/other", 1),
        Message(7 * MS, 8 * MS, "/pose", "/locate", "/steer", 1),
        Message(9 * MS, 9 * MS, "/else", "/locate", "/steer", 1),
    )
    assert found.latencies.count == 0
    assert found.record().latency_s.count == 0
    assert found.record().unobserved == "no node published /pose after it had received /image"
    found.message(Message(10 * MS, 10 * MS, "/pose", "/other", "/third", 1))
    assert found.record().unobserved == "no node published /command after it had received /pose"


def test_a_chain_says_which_topic_did_not_arrive() -> None:
    image = Message(0, 1, "/image", "/camera", "/locate", 1)
    never = "no message of /pose arrived: no node publishes it, or none subscribes to it"
    assert chain(image).record().unobserved == never
    lost = chain(image, *[Message(1, NONE, "/pose", "/locate", "/steer", 1)] * 2)
    assert lost.record().unobserved == "all 2 messages of /pose were lost"


def test_a_chain_of_one_topic_is_the_latency_of_a_message() -> None:
    ledger = ChainLedger(ChainSetup("eye", ("/image",)))
    ledger.message(Message(S, S + 3 * MS, "/image", "/camera", "/locate", 1))
    assert ledger.record().latency_s.max == pytest.approx(0.003)


def test_a_component_that_did_nothing_has_used_nothing() -> None:
    record = ComponentLedger(ComponentSetup("idle"), "onboard").record(0.0)
    assert (record.cpu_s, record.ros_cpu_s, record.energy_j) == (0.0, 0.0, 0.0)
    assert (record.activations, record.deadline_misses, record.calls) == (0, 0, 0)


def test_a_vehicle_that_was_never_disarmed_stands_at_height_0_and_moves_in_all_directions() -> None:
    ledger = VehicleLedger(VehicleSetup("d", "px4", "multirotor"))
    ledger.state(state(0, z=0.9, armed=True))
    ledger.state(state(S, x=3.0, y=-4.0, z=12.9, armed=True))
    assert ledger.record().airborne_s == 1.0
    assert ledger.record().distance_m == pytest.approx(13.0)
    back = VehicleLedger(VehicleSetup("d", "px4", "multirotor"))
    back.state(state(0, x=3.0, y=4.0, z=13.0))
    back.state(state(S, x=0.0, y=0.0, z=1.0))
    assert back.record().distance_m == pytest.approx(13.0)


def test_the_p95_of_a_chain_is_not_its_slowest() -> None:
    sent = [
        Message(at * S, at * S + late * MS, "/image", "/c", "/l", 1)
        for at, late in enumerate([1] * 90 + [5] * 7 + [9] * 3)
    ]
    ledger = ChainLedger(ChainSetup("eye", ("/image",)))
    for message in sent:
        ledger.message(message)
    latency = ledger.record().latency_s
    assert latency.p95 == pytest.approx(0.005, rel=0.002)
    assert latency.max == pytest.approx(0.009)


def test_chains_of_two_nodes_are_not_mixed() -> None:
    found = chain(
        Message(0, 1 * MS, "/image", "/camera", "/locate", 1),
        Message(2 * MS, 3 * MS, "/image", "/camera", "/other", 1),
        Message(4 * MS, 5 * MS, "/pose", "/locate", "/steer", 1),  # of the first image, not of the other's
        Message(6 * MS, 7 * MS, "/command", "/steer", "/motor", 1),
    )
    assert found.record().latency_s.max == pytest.approx(0.007)
