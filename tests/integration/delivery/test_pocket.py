"""The delivery service as a whole, over the few metres of its pocket scenario."""

from __future__ import annotations

from pathlib import Path

import pytest

from volery import Options, simulate
from volery.base.errors import ModelError
from volery.trace.events import Call, Message
from volery.trace.reader import OpenTrace

pytestmark = pytest.mark.integration

DELIVERY = Path(__file__).parents[3] / "examples" / "delivery"
THE_WAY = ["ordered", "to_port", "at_port", "in_flight", "arrived", "last_mile", "delivered"]


def pocket(out=None, fidelity="code", allocation=None, overrides=()):
    options = Options(fidelity=fidelity, seed=7, out=out)
    return simulate(DELIVERY, options, scenario="pocket", allocation=allocation, overrides=overrides)


def states(run):
    return {name: [step.state for step in parcel.history] for name, parcel in run.record.parcels.items()}


@pytest.fixture(scope="module")
def fast(tmp_path_factory):
    return pocket(tmp_path_factory.mktemp("fast"))


def test_a_parcel_is_delivered_within_a_minute(fast):
    assert fast.record.outcome.status == "completed"
    assert states(fast) == {"parcel-1": THE_WAY}
    assert fast.record.sim_s < 60.0
    assert [name for name, one in fast.record.requirements.items() if not one.met] == []
    assert all(vehicle.landed for vehicle in fast.record.vehicles.values())


def test_every_component_has_its_cost(fast):
    components = fast.record.components
    assert components["landing_1"].cpu_s > 1.0  # pictures
    assert components["landing_2"].cpu_s < 0.1  # its drone stays on the ground: only its node is started
    for name in ("rover_control_depot", "drone_control_1"):
        assert components[name].cpu_s > components[name].ros_cpu_s > 0.0
        assert components[name].deadline_misses == 0
    assert components["central"].ros_cpu_s == 0.0
    assert components["requesters"].cpu_s == components["provider"].cpu_s == 0.0


def test_vehicles_are_commanded_over_mavros_names_alone(fast):
    published, services, ports = set(), set(), set()
    with OpenTrace(fast.folder / "trace.mcap") as reading:
        for event in reading.events({Message, Call}):
            if isinstance(event, Message):
                published.add((event.publisher, event.topic))
            elif event.operation.startswith("/"):
                services.add(event.operation)
            else:
                ports.add(event.callee)
    assert ("/landing_1", "/drone_1/setpoint_raw/local") in published
    assert ("/drone_control_1", "/drone_1/setpoint_raw/global") in published
    assert ("/rover_control_depot", "/rover_depot/setpoint_raw/global") in published
    assert {
        "/drone_1/set_mode",
        "/drone_1/cmd/arming",
        "/drone_1/cmd/takeoff",
        "/rover_depot/set_mode",
    } <= services
    assert ports == {
        *("central", "planner", "provider", "beacon_1", "landing_1", "drone_control_1", "drone_control_2"),
        *("rover_control_depot", "rover_control_north", "rover_control_east"),
    }


def test_without_those_names_nothing_moves():
    elsewhere = "{/rover_depot/setpoint_raw/global: /nowhere, /rover_depot/set_mode: /nowhere/set_mode}"
    run = pocket(overrides=[f"application.rover_control_depot.remap={elsewhere}"])
    assert run.record.vehicles["rover_depot"].distance_m < 0.5
    assert states(run)["parcel-1"][-1] != "delivered"


def test_a_drone_that_is_not_charged_is_replaced():
    low = "environment.vehicles.drone_1.battery={capacity: 5 Ah, charge: 0.2}"
    run = pocket(fidelity="times", overrides=[low, "run.duration=90 s", "scenarios.pocket.duration=90 s"])
    assert states(run)["parcel-1"] == THE_WAY
    assert run.record.vehicles["drone_1"].distance_m < 0.5
    assert run.record.vehicles["drone_2"].distance_m > 80.0  # to the parcel, and with it


def test_a_slow_computer_on_board_is_late_for_its_pictures():
    run = pocket(allocation="slow")
    assert states(run) == {"parcel-1": THE_WAY}
    assert [name for name, one in run.record.requirements.items() if not one.met] == ["landing_in_time_1"]
    landing = run.record.components["landing_1"]
    assert (
        landing.deadline_misses > 20
    )  # each of its pictures; the rest of its activations wait for the ground


# -- the same components, whatever flies

AUTOPILOT = "environment.vehicles.{}.autopilot={}"


@pytest.mark.parametrize("autopilot", ["px4", "paparazzi", "dji"])
def test_the_same_parcel_with_another_autopilot(autopilot):
    overrides = [AUTOPILOT.format("drone_1", autopilot)]
    if autopilot == "paparazzi":  # overshoots its velocity, as recorded
        overrides.append("components.PrecisionLanding.parameters.gain=0.2")
    run = pocket(overrides=overrides)
    assert run.error is None
    assert states(run) == {"parcel-1": THE_WAY}
    # PX4 takes 0.2 s to switch to OFFBOARD; the first pictures of the landing wait for it.
    late = ["landing_in_time_1"] if autopilot == "px4" else []
    assert [name for name, one in run.record.requirements.items() if not one.met] == late
    assert all(vehicle.landed for vehicle in run.record.vehicles.values())


def test_all_four_autopilots_in_one_service():
    mixed = {"drone_1": "dji", "drone_2": "paparazzi", "rover_north": "px4"}
    assigned = [AUTOPILOT.format(name, autopilot) for name, autopilot in mixed.items()]
    run = pocket(overrides=assigned)
    assert run.error is None
    assert states(run) == {"parcel-1": THE_WAY}
    assert all(vehicle.landed for vehicle in run.record.vehicles.values())


def test_an_autopilot_that_there_is_not():
    with pytest.raises(ModelError, match=r"'px5'.*ardupilot.*dji.*paparazzi.*px4"):
        pocket(overrides=[AUTOPILOT.format("drone_1", "px5")])
