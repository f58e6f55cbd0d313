"""Observables: what each comes to, and the verdicts on bounds."""

from dataclasses import replace
from math import isnan, nan

import pytest

from volery.base.errors import UsageError
from volery.base.time import MS, S
from volery.base.units import unit
from volery.model.system import RequiredBound
from volery.requirements.observables import OBSERVABLES, make_observer
from volery.requirements.verdicts import Observers, bounds_of, judge
from volery.run.result import Options
from volery.run.simulate import simulate
from volery.trace.attachments import (
    ChainSetup,
    ComponentSetup,
    NetworkSetup,
    ProcessorSetup,
    RequirementSetup,
    RunSetup,
    VehicleSetup,
)
from volery.trace.events import (
    NONE,
    Activation,
    Call,
    Charge,
    Failure,
    Message,
    Milestone,
    Operation,
    Slice,
    Transmission,
    VehicleState,
)

SETUP = RunSetup(
    components=(ComponentSetup("loop", active=True, period=100 * MS), ComponentSetup("server")),
    processors=(ProcessorSetup("onboard", cores=4),),
    networks=(NetworkSetup("radio"),),
    vehicles=(VehicleSetup("drone_1", kind="multirotor"),),
    chains=(ChainSetup("chain", ("/a", "/b")),),
    requirements=(RequirementSetup("r", "loop.deadline_misses", "max", 0.0),),
)


def observed(expression, events, at=10 * S):
    watching = make_observer(expression, SETUP)
    for event in events:
        watching(event)
    return watching.value(at)


def activations(*spans, deadline=NONE):
    return [
        Activation(start * MS, end * MS, "loop", NONE if deadline == NONE else (start + deadline) * MS)
        for start, end in spans
    ]


def operation(name, outcome="ok", horizontal=0.1, vertical=-0.2, vehicle="drone_1"):
    return Operation(0, 1, vehicle, name, "", outcome, "", horizontal / 2, nan, horizontal, vertical)


def state(at, z=0.0, x=0.0, armed=True, battery=1.0):
    return VehicleState(
        at * S,
        "drone_1",
        x,
        0.0,
        z,
        1.0,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
        nan,
        nan,
        nan,
        battery,
        10.0,
        2.0,
        armed,
        "",
    )


def test_response_times_are_of_activations():
    events = [*activations((0, 10), (100, 130)), Call(0, 5 * S, "x", "loop", "op", "ok")]
    assert observed("loop.response_time", events) == pytest.approx(0.030)
    assert observed("loop.response_time_mean", events) == pytest.approx(0.020)
    assert observed("loop.response_time_p95", events) == pytest.approx(0.030, rel=2e-3)


def test_response_times_of_a_passive_component_are_those_of_its_calls():
    events = [
        Activation(0, 1, "server", NONE),
        Call(1 * S, 3 * S, "x", "server", "op", "ok"),
        Call(0, 9 * S, "server", "x", "op", "ok"),
    ]
    assert observed("server.response_time", events) == 2.0
    assert observed("server.response_time", events[:1]) == 1e-9
    assert isnan(observed("server.response_time", []))


def test_calls_and_single_operations():
    events = [
        Call(0, 1 * S, "x", "loop", "look", "ok"),
        Call(0, 3 * S, "x", "loop", "/loop/look", "ServiceError"),
        Call(0, 7 * S, "x", "loop", "outlook", "ok"),
        Call(0, 9 * S, "x", "server", "look", "ok"),
    ]
    assert observed("loop.look.response_time", events) == 3.0
    assert observed("loop.look.response_time_mean", events) == 2.0
    assert observed("loop.look.response_time_p95", events) == pytest.approx(3.0, rel=2e-3)
    assert observed("loop.look.calls", events) == 2.0
    assert observed("loop.look.failures", events) == 1.0
    assert observed("loop.call_time", events) == 7.0
    assert observed("loop.calls", events) == 3.0
    assert isnan(observed("loop.point.response_time", events))


def test_energy_of_components_processors_and_all_computers():
    onboard = ProcessorSetup("onboard", cores=4, idle_w=2.0, busy_w=6.0)
    ground = ProcessorSetup("ground", idle_w=10.0, busy_w=30.0)
    setup = RunSetup(
        components=(ComponentSetup("loop", processor="onboard"), ComponentSetup("server")),
        processors=(onboard, ground),
    )
    events = [
        Slice(0, 4 * S, "onboard", 0, "t", "loop"),
        Charge(0, "loop", "onboard", "operation:look", 2 * S, 0, 5.0),
        Slice(0, 1 * S, "ground", 0, "load", "ground (load)"),
    ]

    def energy(expression, setup=setup):
        watching = make_observer(expression, setup)
        for event in events:
            watching(event)
        return watching.value(10 * S)

    assert energy("loop.energy") == pytest.approx(5.0 + 2 * 1.0)  # stated, and 2 s above idle
    assert energy("onboard.energy") == pytest.approx(10 * 2.0 + 7.0)
    assert energy("ground.energy") == pytest.approx(10 * 10.0 + 20.0)
    assert energy("application.computing_energy") == pytest.approx(27.0 + 120.0)
    assert isnan(energy("server.energy"))
    dark = replace(setup, processors=(onboard, ProcessorSetup("ground")))
    assert isnan(energy("application.computing_energy", dark))


def test_utilisation_delay_and_loss_of_a_network():
    events = [
        Transmission(0, 30 * MS, 10 * MS, "radio", 100),
        Transmission(50 * MS, 60 * MS, 10 * MS, "radio", 100),
        Transmission(80 * MS, NONE, 30 * MS, "radio", 300),
        Transmission(0, 1 * S, 1 * S, "wire", 100),
    ]
    assert observed("radio.utilisation", events, at=100 * MS) == pytest.approx(0.5)
    assert observed("radio.delay", events) == pytest.approx(0.030)
    assert observed("radio.delay_mean", events) == pytest.approx(0.020)
    assert observed("radio.lost", events) == 1.0
    assert isnan(observed("radio.delay", []))


DESK = """\
volery: 1
name: desk
interfaces: {Decode: {decode: {args: {code: str}, returns: str}, reset: {}}}
components:
  Decoder:
    language: python
    path: code.py
    provides: {codes: Decode}
    at: {processor: rpi4-cortex-a72, frequency: 1500 MHz}
    operations: {decode: {time: 17 ms}, reset: {time: 1 ms}}
  Asker:
    language: python
    path: code.py
    requires: {codes: Decode}
    active: {period: 100 ms}
    at: {processor: rpi4-cortex-a72, frequency: 1500 MHz}
    activation: {time: 1 ms}
application:
  decoder: {is: Decoder}
  asker: {is: Asker, codes: decoder.codes}
platform:
  processors:
    onboard: {is: rpi4-cortex-a72, frequency: 1500 MHz}
    ground: {is: rpi4-cortex-a72, frequency: 1500 MHz}
  networks: {radio: {between: [onboard, ground], bandwidth: 1 Mbit/s, latency: 2 ms}}
allocations: {all: {decoder: onboard, asker: ground}}
environment: {origin: {latitude: 43.47, longitude: -3.8}}
requirements:
  whole: {observe: decoder.response_time, max: 1 s}
  one: {observe: decoder.reset.response_time, max: 1 s}
  calls: {observe: decoder.decode.calls, min: 3}
  served: {observe: decoder.activations, max: 0}
  joules: {observe: application.computing_energy, max: 100 J}
  mine: {observe: decoder.energy, max: 100 J}
  air: {observe: radio.utilisation, max: 1}
  delay: {observe: radio.delay, max: 1 s}
run: {duration: 1 s}
"""
CODE = """\
import volery


class Decoder:
    def decode(self, code):
        return code

    def reset(self):
        pass


class Asker:
    def __init__(self, codes):
        self.codes = codes

    def run(self):
        self.codes.reset()
        for _ in range(3):
            self.codes.decode("code")
            volery.sleep(0.1)
"""


def test_a_real_run_observes_what_it_names(tmp_path):
    """Components are constructed in a run: that has been taken for the response of a passive one."""
    (tmp_path / "model.yaml").write_text(DESK)
    (tmp_path / "code.py").write_text(CODE)
    run = simulate(tmp_path, Options(fidelity="times"))
    found = {name: one.observed for name, one in run.record.requirements.items()}
    carried = 2 * 2e-3 + 2 * 64 * 8e-6  # latency and headers there and back
    assert 17e-3 + carried < found["whole"] < 19e-3 + carried
    assert 1e-3 + carried < found["one"] < 2e-3 + carried
    assert (found["calls"], found["served"]) == (3.0, 0.0)
    assert 2e-3 < found["delay"] < 4e-3
    assert 0.0 < found["air"] < 0.02
    processors = run.record.processors.values()
    assert found["joules"] == pytest.approx(sum(one.energy_j for one in processors), rel=1e-3)
    assert found["mine"] == pytest.approx(run.record.components["decoder"].energy_j)
    assert run.record.components["decoder"].response_s.of == "calls"


def test_deadline_misses_count_activations_that_end_late():
    late, in_time = activations((0, 60), (100, 150), deadline=50)
    assert observed("loop.deadline_misses", [late, in_time]) == 1.0
    assert isnan(observed("loop.deadline_misses", activations((0, 60))))


def test_a_late_release_violates_the_period_and_one_in_between_does_not():
    regular = [(at, at + 1) for at in (0, 100, 150, 200, 310)]
    assert observed("loop.period_violations", activations(*regular)) == 0.0
    assert observed("loop.period_violations", activations(*regular, (421, 422))) == 1.0
    assert isnan(observed("server.period_violations", activations((0, 1))))
    assert observed("loop.period_violations", activations((500, 501), (600, 601))) == 0.0  # began late
    others = [one._replace(component="server") for one in activations((0, 1), (500, 501), (900, 901))]
    assert observed("loop.period_violations", activations(*regular) + others) == 0.0


def test_utilisation_is_a_share_of_cores_and_of_time():
    events = [Slice(0, 4 * S, "onboard", 0, "t", "loop"), Slice(0, 1 * S, "other", 0, "t", "loop")]
    assert observed("onboard.utilisation", events) == pytest.approx(0.1)
    assert observed("loop.utilisation", events) == pytest.approx(0.5)
    assert observed("loop.cpu_time", events) == 5.0


def test_landing_offset_is_the_worst_by_truth_of_landings_that_succeeded():
    events = [
        operation("land", horizontal=0.2),
        operation("return_home", horizontal=-0.4),
        operation("land", horizontal=nan),
        operation("land", outcome="NotArrived", horizontal=9.0),
        operation("goto", horizontal=5.0),
        operation("land", horizontal=7.0, vehicle="drone_2"),
    ]
    assert observed("drone_1.landing_offset", events) == 0.4
    assert observed("drone_1.goto_error", events) == 5.0
    assert observed("drone_1.goto_error_by_estimate", events) == 2.5
    assert observed("drone_1.goto_error_vertical", events) == 0.2
    assert observed("drone_1.failures", events) == 1.0
    assert isnan(observed("drone_1.landing_offset", [operation("goto")]))


def test_vehicles_move_fly_and_drain():
    events = [
        state(0, armed=False),
        state(1, z=3.0),
        state(3, z=3.0, x=4.0, battery=0.2),
        state(4, armed=False),
    ]
    assert observed("drone_1.distance", events) == pytest.approx(3 + 4 + 5)
    assert observed("drone_1.airborne_time", events) == 3.0
    assert observed("drone_1.battery_min", events) == 0.2
    assert observed("drone_1.energy", events) == pytest.approx(80.0)
    assert isnan(observed("drone_1.battery_min", [state(0, battery=nan)]))


def parcel(at, subject, name):
    return Milestone(at * S, "central", "parcel", subject, name, "")


def test_parcels_are_counted_once_and_timed_from_their_first_state():
    events = [
        parcel(1, "a", "ordered"),
        parcel(2, "b", "ordered"),
        parcel(9, "a", "delivered"),
        parcel(10, "a", "delivered"),
        parcel(11, "b", "failed"),
        Milestone(3 * S, "central", "truck", "t", "delivered", ""),
    ]
    assert observed("application.ordered", events) == 2.0
    assert observed("application.delivered", events) == 1.0
    assert observed("application.undelivered", events) == 1.0
    assert observed("application.delivery_time_max", events) == 8.0
    assert isnan(observed("application.delivery_time_mean", events[:2]))
    assert observed("note.parcel.delivered", events) == 1.0
    assert observed("note.parcel.delivered.time_max", events) == 8.0
    assert observed("note.parcel.failed.time_mean", events) == 9.0
    assert observed("note.parcel.ordered.time_max", events) == 0.0
    assert observed("note.truck.delivered.time_max", events) == 0.0
    assert isnan(observed("note.parcel.time_max.time_mean", events))
    assert observed("note.parcel.time_max", events) == 0.0  # a state of that name


def test_failures_and_lost_messages():
    events = [Failure(0, "loop", "x"), Failure(0, "run", "y"), Message(0, NONE, "/t", "a", "b", 1)]
    assert observed("application.failures", events) == 2.0
    assert observed("loop.failures", events) == 1.0
    assert observed("application.messages_lost", events) == 1.0


@pytest.mark.parametrize("published", OBSERVABLES, ids=lambda one: f"{one.subject}.{one.quantity}")
def test_everything_published_can_be_observed(published):
    subject = {
        "component": "loop",
        "operation": "loop.look",
        "processor": "onboard",
        "network": "radio",
        "vehicle": "drone_1",
        "chain": "chain",
    }.get(published.subject, published.subject)
    watching = make_observer(f"{subject}.{published.quantity}", SETUP)
    assert isinstance(watching.value(1 * S), float)
    assert published.description
    unit(published.unit)


def test_latency_counts_from_what_a_node_had_received_when_it_published():
    def received(topic, sent, received, publisher="camera", subscriber="/finder"):
        return Message(sent * MS, received * MS, topic, publisher, subscriber, 1)

    events = [
        received("/a", 0, 5),
        received("/a", 10, 15),
        Message(20 * MS, NONE, "/a", "camera", "/finder", 1),
        received("/a", 30, 42),
        received("/b", 40, 50, "finder", "/pilot"),  # the third picture came after it was said
        received("/b", 44, 46, "finder", "/pilot"),
        received("/b", 60, 61, "stranger", "/pilot"),  # made from nothing
    ]
    assert observed("chain.latency", events) == pytest.approx(0.040)
    assert observed("chain.latency_mean", events) == pytest.approx(0.028)


def test_an_unknown_quantity_is_refused_with_the_choices():
    with pytest.raises(UsageError, match=r"a vehicle has no quantity 'speed'.*airborne_time, battery_min"):
        make_observer("drone_1.speed", SETUP)


def test_verdicts():
    bounds = (
        *bounds_of(SETUP),
        RequiredBound("fast", "loop.response_time", "max", 0.02),
        RequiredBound("many", "loop.activations", "min", 2),
    )
    watching = Observers(bounds, SETUP)
    for event in activations((0, 10), (100, 130), deadline=50):
        watching(event)
    verdicts = watching.verdicts(5 * S)
    assert [(one.requirement, one.met) for one in verdicts] == [("r", True), ("fast", False), ("many", True)]
    assert verdicts[1].observed == 0.03
    assert not watching.all_hold(5 * S)
    assert watching.listener(Activation) is not None
    assert watching.listener(Failure) is None


def test_what_could_not_be_observed_is_not_met():
    assert not judge(RequiredBound("r", "x.y", "max", 1.0), nan, 0).met
    assert not judge(RequiredBound("r", "x.y", "min", 1.0), nan, 0).met


def test_the_landing_at_the_end_of_a_run_is_no_landing_and_no_failure_of_the_vehicle():
    events = [operation("come_to_rest", horizontal=8.0), operation("come_to_rest", outcome="Refused")]
    assert isnan(observed("drone_1.landing_offset", events))
    assert observed("drone_1.failures", events) == 0


def noted(subject, state, kind="point"):
    return Milestone(1 * S, "inspector", kind, subject, state, "")


def test_what_the_application_notes_is_counted_once_for_each_subject():
    events = [
        noted("north", "seen"),
        noted("north", "inspected"),
        noted("north", "inspected"),
        noted("south", "inspected"),
        noted("south", "inspected", kind="pole"),
    ]
    assert observed("note.point.inspected", events) == 2
    assert observed("note.point.seen", events) == 1
    assert observed("note.pole.inspected", events) == 1
    assert observed("note.point.in the air", events) == 0
    assert observed("note.point.lost. twice", [noted("x", "lost. twice")]) == 1


@pytest.mark.parametrize("expression", ["note.point", "note.", "note.point."])
def test_a_note_needs_a_kind_and_a_state(expression):
    with pytest.raises(UsageError):
        make_observer(expression)


def test_the_quantity_of_an_unknown_subject_says_what_it_is() -> None:
    of_a_vehicle = next(one.quantity for one in OBSERVABLES if one.subject == "vehicle")
    make_observer(f"somebody.{of_a_vehicle}")
    with pytest.raises(UsageError, match="a component has no quantity 'nonsense'"):
        make_observer("somebody.nonsense")


def test_without_an_activation_or_a_period_there_are_no_violations_to_count():
    assert isnan(observed("loop.period_violations", []))
    late = [Activation(start * MS, start * MS, "server", NONE) for start in (0, 500)]
    assert isnan(observed("server.period_violations", late))
    assert observed("loop.period_violations", activations((0, 1))) == 0.0
    assert observed("loop.period_violations", activations((0, 1), (500, 501))) == 1.0
    punctual = activations(*((100 * i, 100 * i + 1) for i in range(5)))
    assert observed("loop.period_violations", punctual) == 0.0
    assert observed("loop.period_violations", [*punctual[:2], punctual[0], *punctual[2:]]) == 0.0


def test_missed_deadlines_are_none_only_where_there_are_deadlines():
    assert isnan(observed("loop.deadline_misses", activations((0, 9))))
    for count in (1, 2, 3):
        met = activations(*((100 * i, 100 * i + 5) for i in range(count)), deadline=5)
        assert observed("loop.deadline_misses", met) == 0.0


def test_time_starts_at_exactly_nothing():
    assert observed("loop.cpu_time", []) == 0.0
    assert observed("onboard.utilisation", []) == 0.0
    assert observed("loop.activations", []) == 0.0


def test_time_on_a_processor_counts_from_the_start_of_each_slice():
    slices = [Slice(at * S, at * S + 500 * MS, "onboard", 0, "loop", "loop") for at in (2, 4)]
    assert observed("loop.cpu_time", slices) == 1.0
