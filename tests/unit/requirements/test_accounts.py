"""Accounts: what a stream of events comes to."""

import json
from dataclasses import replace
from math import isnan, nan
from pathlib import Path

import pytest

from volery.base.errors import UsageError
from volery.base.time import MS, S
from volery.requirements.accounts import Accounts, Circumstances
from volery.requirements.added_observables import subjects_of
from volery.requirements.ledgers import linear_energy
from volery.requirements.observables import all_observables, make_observer
from volery.requirements.record import RunRecord, read_record, write_record
from volery.testing.sample_run import sample_events, sample_setup
from volery.trace.attachments import ComponentSetup, ProcessorSetup, RequirementSetup, RunSetup, VehicleSetup
from volery.trace.events import (
    NONE,
    Activation,
    Call,
    Charge,
    Event,
    Failure,
    LinkState,
    Message,
    Milestone,
    Operation,
    Preemption,
    Slice,
    Text,
    VehicleState,
    Verdict,
)
from volery.trace.mcap_writer import McapWriter
from volery.trace.reader import read

SETUP = RunSetup(
    components=(ComponentSetup("control", "Control", "rospy", "onboard", active=True),),
    processors=(ProcessorSetup("onboard", "rpi4", 1500.0, "fixed-priority", 2, 2.0, 6.0),),
    vehicles=(VehicleSetup("d", "ardupilot", "multirotor"), VehicleSetup("r", "ardupilot", "rover")),
    requirements=(
        RequirementSetup("soon", "x.y", "max", 1.0, "s"),
        RequirementSetup("later", "x.z", "min", 2.0),
    ),
)


def books(*events: Event, setup: RunSetup = SETUP) -> RunRecord:
    accounts = Accounts(setup)
    for event in events:
        accounts(event)
    return accounts.record("completed")


def state(at: int, **changes: object) -> VehicleState:
    still = VehicleState(
        at, "d", *[0.0] * 3, 1.0, *[0.0] * 6, nan, nan, nan, 0.9, 12.0, 2.0, False, "STABILIZE"
    )
    return still._replace(**changes)


def test_executed_charged_and_stated() -> None:
    control = books(
        Slice(0, 30 * MS, "onboard", 0, "control", "control"),
        Charge(0, "control", "onboard", "code", 20 * MS, 0, 0.0),
        Charge(0, "control", "onboard", "ros:publish", 6 * MS, 4 * MS, 0.0),
        Charge(1 * S, "control", "onboard", "ros:publish", 1 * MS, 0, 0.0),
    ).components["control"]
    assert control.cpu_s == 0.03
    assert control.ros_cpu_s == 0.011
    assert control.ros_calls == {"publish": 2}
    assert control.energy_j == pytest.approx(0.03 * 2.0)  # (6 - 2) W over two cores
    assert (control.processor, control.language) == ("onboard", "rospy")


def test_stated_energy_replaces_the_law_for_the_time_it_covers() -> None:
    found = books(
        Slice(0, 30 * MS, "onboard", 0, "control", "control"),
        Charge(0, "control", "onboard", "operation:order", 10 * MS, 0, 0.5),
        Text(1 * S, "x", 6, "the end"),
    )
    assert found.components["control"].energy_j == pytest.approx(0.5 + 0.02 * 2.0)
    assert found.processors["onboard"].energy_j == pytest.approx(2.0 * 1.0 + 0.5 + 0.02 * 2.0)


def test_utilisation_is_of_all_cores_over_the_whole_run() -> None:
    accounts = Accounts(SETUP)
    accounts(Slice(0, 500 * MS, "onboard", 0, "t", "control"))
    accounts(Slice(0, 500 * MS, "onboard", 1, "t", "control"))
    assert accounts.record("completed", ended=1 * S).processors["onboard"].utilisation == 0.5
    assert accounts.record("completed", ended=2 * S).processors["onboard"].utilisation == 0.25


def test_no_power_figures_no_energy() -> None:
    setup = RunSetup(
        components=(ComponentSetup("c", processor="p"),), processors=(ProcessorSetup("p", "z80"),)
    )
    found = books(Slice(0, S, "p", 0, "t", "c"), setup=setup)
    assert found.components["c"].energy_j is None
    assert found.processors["p"].energy_j is None
    assert any("z80" in line for line in found.not_counted)


def test_the_band_of_power_figures_stands_beside_the_energy() -> None:
    known = ProcessorSetup("p", "board", 1500.0, "fixed-priority", 1, 2.0, 3.0, 0.2)
    setup = RunSetup(processors=(known, ProcessorSetup("q", "z80", power_error=0.2)))
    found = Accounts(setup).record("completed").processors
    assert found["p"].energy_error == 0.2
    assert found["q"].energy_error is None  # no figures, no energy


def test_an_energy_law_can_be_handed_in() -> None:
    accounts = Accounts(SETUP, lambda processor, busy, elapsed: 100.0 * busy + elapsed)
    accounts(Slice(0, S, "onboard", 0, "t", "control"))
    found = accounts.record("completed")
    assert found.components["control"].energy_j == 100.0
    assert found.processors["onboard"].energy_j == 101.0
    assert linear_energy(SETUP.processors[0], 1.0, 10.0) == 22.0


def test_deadlines_and_responses_of_activations() -> None:
    control = books(
        *[Activation(n * S, n * S + (n + 1) * MS, "control", n * S + 10 * MS) for n in range(20)],
        Activation(30 * S, 31 * S, "control", NONE),
        Call(0, 5 * S, "x", "control", "ask", "ok"),
    ).components["control"]
    assert (control.activations, control.calls, control.deadline_misses) == (21, 1, 10)
    assert control.response_s.of == "activations"
    assert control.response_s.mean == pytest.approx((sum(range(1, 21)) * 1e-3 + 1.0) / 21)
    assert control.response_s.p95 == pytest.approx(0.020, rel=2e-3)
    assert control.response_s.max == 1.0


def test_a_passive_component_answers_calls() -> None:
    asked = Call(0, 3 * MS, "a", "planner", "path", "ok")
    setup = RunSetup(components=(ComponentSetup("planner"),))
    response = books(asked, asked._replace(end=5 * MS), setup=setup).components["planner"].response_s
    assert (response.of, response.count, response.mean, response.max) == ("calls", 2, 0.004, 0.005)


def test_what_the_accounts_see_is_missing() -> None:
    found = books(
        Activation(0, 1, "control", NONE),
        Charge(0, "control", "onboard", "ros:publish", 1, 0, 0.0),
        Call(0, 1, "a", "nowhere", "ask", "ok"),
        Activation(0, 1, "safety", NONE),
        setup=replace(
            SETUP, components=(*SETUP.components, ComponentSetup("nowhere"), ComponentSetup("somewhere"))
        ),
    )
    assert "control: their own code, of which nothing but ROS calls was counted" in found.not_counted
    assert "nowhere, somewhere: all computing, since they are allocated to no processor" in found.not_counted
    assert found.components["nowhere"].energy_j is None
    assert "safety" not in found.components


def test_a_vehicle_flies_and_lands() -> None:
    flight = books(
        state(0, z=3.0),
        state(1 * S, z=3.0, armed=True),
        state(2 * S, z=13.0, armed=True),
        state(3 * S, z=13.0, x=4.0, y=3.0, armed=True),
        state(4 * S, z=3.0, x=4.0, y=3.0, armed=True, vz=-0.1, volts=10.0),
        state(5 * S, z=3.0, x=4.0, y=3.0),
    ).vehicles["d"]
    assert flight.distance_m == 25.0
    assert flight.armed_s == 4.0
    assert flight.airborne_s == 2.0
    assert flight.energy_j == pytest.approx(24.0 * 3 + 22.0 * 2)
    assert flight.landed is True
    assert books(state(0, armed=True)).vehicles["d"].landed is False
    assert books(state(0, vz=-8.0)).vehicles["d"].landed is False
    assert books().vehicles["d"].landed is None


def test_without_truth_the_estimate_counts_and_what_is_unknown_does_not() -> None:
    unknown = {"x": nan, "y": nan, "z": nan, "vx": nan, "vy": nan, "vz": nan, "volts": nan}
    flight = books(
        state(0, **unknown),
        state(1 * S, **unknown, estimated_x=0.0, estimated_y=0.0, estimated_z=0.0),
        state(2 * S, **unknown, estimated_x=3.0, estimated_y=4.0, estimated_z=0.0, armed=True),
        state(3 * S, **unknown, estimated_x=3.0, estimated_y=4.0, estimated_z=5.0, armed=True),
        state(4 * S, **unknown, estimated_x=3.0, estimated_y=4.0, estimated_z=5.0),
    ).vehicles["d"]
    assert flight.distance_m == 10.0
    assert flight.airborne_s == 1.0
    assert flight.energy_j is None
    assert flight.landed is True


def test_a_rover_is_never_airborne() -> None:
    on_a_hill = books(
        state(0, vehicle="r"), *[state(n * S, vehicle="r", z=50.0, armed=True) for n in (1, 2, 3)]
    )
    assert on_a_hill.vehicles["r"].airborne_s == 0.0


def test_errors_are_the_largest_of_what_succeeded() -> None:
    found = books(
        Operation(0, 1, "d", "goto", "there", "ok", "", 0.2, -0.4, nan, 0.1),
        Operation(1, 2, "d", "goto", "back", "ok", "", 0.3, 0.1, nan, -0.2),
        Operation(2, 3, "d", "land", "", "Refused", "no", 9.0, 9.0, 9.0, 9.0),
    ).vehicles["d"]
    assert (found.error_by_estimate_m.horizontal, found.error_by_estimate_m.vertical) == (0.3, 0.4)
    assert (found.error_by_truth_m.horizontal, found.error_by_truth_m.vertical) == (None, 0.2)
    assert [one.outcome for one in found.operations] == ["ok", "ok", "Refused"]


def test_a_subject_is_in_the_state_that_was_noted_last() -> None:
    found = books(
        Milestone(0, "central", "parcel", "p1", "ordered", "blood"),
        Milestone(S, "central", "order", "o1", "accepted", ""),
        Milestone(2 * S, "drone", "parcel", "p1", "delivered", ""),
    )
    assert {kind: list(subjects) for kind, subjects in found.notes.items()} == {
        "parcel": ["p1"],
        "order": ["o1"],
    }
    parcel = found.notes["parcel"]["p1"]
    assert parcel.state == "delivered"
    assert [(step.at_s, step.state) for step in parcel.history] == [(0.0, "ordered"), (2.0, "delivered")]
    assert found.parcels == found.notes["parcel"]


def test_verdicts_and_what_has_none() -> None:
    found = books(Verdict(S, "soon", "x.y", "max", 1.0, nan, False))
    assert found.requirements["soon"].observed is None
    assert found.requirements["soon"].met is False
    assert found.requirements["soon"].unit == "s"
    assert found.requirements["later"].met is None
    assert found.outcome.requirements_met is False
    assert books().outcome.requirements_met is None


@pytest.mark.parametrize(
    "event",
    [
        Slice(1 * S, 9 * S, "onboard", 0, "control", "control"),
        Preemption(9 * S, "onboard", 0, "control", "safety"),
        Charge(9 * S, "control", "onboard", "code", 1, 0, 0.0),
        Activation(1 * S, 9 * S, "control", NONE),
        Call(1 * S, 9 * S, "a", "control", "ask", "ok"),
        Message(1 * S, 9 * S, "/a", "/b", "/c", 1),
        Message(9 * S, NONE, "/a", "/b", "/c", 1),
        state(9 * S),
        Operation(1 * S, 9 * S, "d", "land", "", "ok", "", 0.0, 0.0, 0.0, 0.0),
        Milestone(9 * S, "c", "parcel", "p", "ordered", ""),
        Failure(9 * S, "control", "no"),
        Verdict(9 * S, "soon", "x.y", "max", 1.0, 0.5, True),
        Text(9 * S, "x", 6, ""),
        LinkState(9 * S, "udp", "up", ""),
    ],
)
def test_a_run_lasts_until_its_last_event(event: Event) -> None:
    assert books(Text(2 * S, "x", 6, ""), event, Text(3 * S, "x", 6, "")).sim_s == 9.0
    assert books(event._replace(), Text(20 * S, "x", 6, "")).sim_s == 20.0


def test_executed_time_is_from_start_to_end_and_of_its_processor() -> None:
    found = books(
        Slice(1 * S, 3 * S, "onboard", 0, "control", "control"),
        Slice(3 * S, 4 * S, "second", 0, "other", "stranger"),
        Text(10 * S, "x", 6, ""),
    )
    assert found.components["control"].cpu_s == 2.0
    assert found.processors["onboard"].utilisation == 2.0 / 20.0
    assert found.processors["second"].utilisation == 0.1
    assert books().processors["onboard"].utilisation == 0.0


def test_preemptions_are_counted_the_most_frequent_first() -> None:
    rare = Preemption(0, "onboard", 0, "a", "b")
    often = rare._replace(by="c")
    found = books(rare, often, often).preemptions
    assert [(one.preempted, one.by, one.count) for one in found] == [("a", "c", 2), ("a", "b", 1)]


def test_a_response_bound_stands_beside_what_was_observed() -> None:
    control = replace(SETUP.components[0], period=100 * MS, deadline=100 * MS, priority=5)
    setup = replace(SETUP, components=(control,))
    found = books(
        Slice(0, 30 * MS, "onboard", 0, "control", "control"),
        Activation(0, 30 * MS, "control", 100 * MS),
        Slice(100 * MS, 120 * MS, "onboard", 0, "control", "control"),
        Activation(100 * MS, 120 * MS, "control", 200 * MS),
        setup=setup,
    ).components["control"]
    assert found.response_bound_s == pytest.approx(0.03)


def test_failures_are_kept() -> None:
    assert books(Failure(3 * S, "control", "ValueError: no")).failures[0].who == "control"


def test_warnings_of_the_framework_are_kept_once() -> None:
    warning = Text(0, "volery", 4, "a law was used outside its range")
    others = (Text(0, "volery", 6, "hello"), Text(0, "drone_1", 3, "Crash: disarming"))
    assert books(warning, *others, warning).warnings == [warning.text]


def test_the_same_from_the_run_and_from_its_trace(tmp_path: Path) -> None:
    setup = sample_setup(onboard_mhz=600.0)
    accounts = Accounts(setup)
    writer = McapWriter(tmp_path / "trace.mcap", setup)
    for event in sample_events(seconds=60.0, onboard_mhz=600.0):
        accounts(event)
        writer(event)
    writer.close()
    trace = read(tmp_path / "trace.mcap")
    again = Accounts(trace.setup)
    for event in trace.events:
        again(event)
    assert again.record("completed") == accounts.record("completed")
    assert accounts.record("completed").components["drone_control"].deadline_misses > 0


def test_run_json_has_the_wall_time_and_is_read_back(tmp_path: Path) -> None:
    accounts = Accounts(SETUP)
    accounts(Text(10 * S, "x", 6, ""))
    record = accounts.record("interrupted", "Ctrl-C", circumstances=Circumstances(2.0, {"volery": "1"}))
    assert record.real_time_factor == 5.0
    path = write_record(record, tmp_path)
    assert '"schema": "volery-run/2"' in path.read_text()
    assert read_record(tmp_path) == record


def test_version_1_is_read_and_what_scripts_read_is_where_it_was(tmp_path: Path) -> None:
    record = books(
        Milestone(2 * S, "central", "parcel", "p1", "delivered", ""), Call(0, S, "a", "control", "x", "ok")
    )
    new = json.loads(write_record(record, tmp_path).read_text())
    assert (new["outcome"]["status"], new["sim_s"]) == ("completed", 2.0)
    assert new["components"]["control"]["response_s"].keys() == {"of", "count", "mean", "p95", "max"}
    kept = {name: part for name, part in new.items() if name not in ("notes", "added")}
    old = {**kept, "schema": "volery-run/1", "parcels": new["notes"]["parcel"]}
    (tmp_path / "run.json").write_text(json.dumps(old))
    assert read_record(tmp_path) == record
    (tmp_path / "run.json").write_text(json.dumps({**old, "parcels": {}}))
    assert read_record(tmp_path).notes == {}


def test_a_run_json_that_is_none(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot read"):
        read_record(tmp_path)
    (tmp_path / "run.json").write_text("{}")
    with pytest.raises(UsageError, match=r"volery-run/2"):
        read_record(tmp_path)
    with pytest.raises(UsageError, match="cannot write"):
        write_record(books(), tmp_path / "none")


def test_accounts_come_to_what_every_observer_observes():
    """The rows of a campaign hold every observable; observers of all of them would double its time."""
    setup, accounts = sample_setup(), Accounts(sample_setup())
    observers = {
        f"{subject}.{one.quantity}": make_observer(f"{subject}.{one.quantity}", setup)
        for one in all_observables()
        for subject in subjects_of(setup).get(one.subject, ())
    }
    for event in sample_events():
        accounts(event)
        for observer in observers.values():
            observer(event)
    found = accounts.observables(accounts.last)
    notes = {name: found.pop(name) for name in list(found) if name.startswith("note.")}
    values = {name: observer.value(accounts.last) for name, observer in observers.items()}
    assert found == {name: value for name, value in values.items() if not isnan(value)}
    assert len(found) > 100
    assert {name: make_observer(name, setup) for name in notes}
