"""The effect of every kind of fault, in short runs of the simulated parts that it acts on."""

from dataclasses import replace
from math import atan2, degrees, hypot, radians
from random import Random

import numpy as np
import pytest

from volery.base.errors import CapabilityError, ModelError
from volery.base.frames import LocalFrame
from volery.base.time import MS, S
from volery.kernel.network import Network
from volery.kernel.processor import Processor
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.model.environment import Environment, PlaceSpec, VehicleSpec, WindSpec
from volery.model.faults import (
    FAULTS,
    BarometerStuck,
    BatteryCellDead,
    BatteryLow,
    CompassStuck,
    CompassTurned,
    ComputerSlowed,
    ComputerStopped,
    GpsDrift,
    GpsLost,
    ImuBiased,
    ImuNoisy,
    LinkCut,
    LinkDegraded,
    MotorDead,
    NetworkCut,
    NetworkDegraded,
    RcLost,
    WindChange,
)
from volery.run.assembly.fault_effects import EFFECTS, Affected, FleetLinks, inject, with_faulty_links
from volery.run.assembly.simulated_fleet import FleetWorld, SimulatedFleet
from volery.simulation.world.state_layout import (
    M_ACCEL,
    M_BARO,
    M_GPS,
    M_GPS_FIX,
    M_GYRO,
    M_MAG,
    U_MOTOR_HEALTH,
    U_WIND,
)
from volery.trace.events import Slice, Text

PAD = PlaceSpec("pad", 47.0, 8.0, 0.0, 0.0, 0.0)
DRONE = VehicleSpec("drone", "multirotor", "ardupilot", PAD)
BEGIN, END = 2 * S, 4 * S
FAULT = {"name": "trouble", "at_ns": BEGIN, "duration_ns": END - BEGIN}


class Run:
    """A drone on its pad, a computer and a network, with one fault from 2 s to 4 s."""

    def __init__(self, fault, autopilot):
        self.events = []
        self.kernel = VirtualKernel(record=self.events.append)
        drone = replace(DRONE, autopilot=autopilot)
        environment = Environment(vehicles=(drone,), faults=(fault,))
        self.fleet = SimulatedFleet(
            self.kernel,
            [drone],
            FleetWorld(LocalFrame(47.0, 8.0), WindSpec()),
            1,
            through_bytes=with_faulty_links(environment),
        )
        self.processor = Processor(self.kernel, "onboard")
        self.network = Network(
            self.kernel, "radio", bandwidth_bit_s=1_000_000, latency=10 * MS, loss=0.0, stream=Random(1)
        )
        self.affected = Affected(
            self.kernel,
            self.fleet,
            FleetLinks(self.fleet),
            WindSpec(),
            {"onboard": self.processor},
            {"radio": self.network},
        )
        inject([fault], self.affected)

    def row(self, at):
        """Return the state of the drone at a time."""
        self.kernel.run(at)
        self.fleet.world.advance_to_now(0)
        return self.fleet.world.arrays.rows[0].copy()

    def close(self):
        self.kernel.close()


@pytest.fixture
def run():
    made = []

    def make(kind, autopilot="ardupilot", **arguments):
        made.append(Run(kind(**FAULT, **arguments), autopilot))
        return made[-1]

    yield make
    for one in made:
        one.close()


def test_every_kind_that_a_model_can_state_has_an_effect():
    assert set(FAULTS.values()) == set(EFFECTS)


def test_begin_and_end_are_recorded(run):
    trouble = run(GpsLost, vehicle="drone")
    trouble.kernel.run(5 * S)
    texts = [one for one in trouble.events if isinstance(one, Text) and one.text.startswith("fault")]
    assert [(one.at, one.source, one.text) for one in texts] == [
        (BEGIN, "drone", "fault trouble: gps-lost"),
        (END, "drone", "fault trouble is over"),
    ]


def test_a_dead_motor_keeps_a_share_of_its_thrust(run):
    trouble = run(MotorDead, vehicle="drone", motor=3, thrust=0.4)
    assert trouble.row(3 * S)[U_MOTOR_HEALTH : U_MOTOR_HEALTH + 4].tolist() == [1.0, 1.0, 0.4, 1.0]
    assert trouble.row(5 * S)[U_MOTOR_HEALTH : U_MOTOR_HEALTH + 4].tolist() == [1.0] * 4


def test_a_drained_battery_stays_drained(run):
    trouble = run(BatteryLow, vehicle="drone", charge=0.25)
    assert trouble.fleet.autopilots["drone"].state().battery == pytest.approx(1.0, abs=0.01)
    trouble.kernel.run(5 * S)
    assert trouble.fleet.autopilots["drone"].state().battery == pytest.approx(0.25, abs=0.01)


def test_a_dead_cell_takes_its_voltage_away(run):
    trouble = run(BatteryCellDead, vehicle="drone")
    volts = []
    for at in (1 * S, 3 * S, 5 * S):
        trouble.kernel.run(at)
        volts.append(trouble.fleet.autopilots["drone"].state().volts)
    assert volts[1] == pytest.approx(volts[0] * 2 / 3, rel=0.01)
    assert volts[2] == pytest.approx(volts[0], rel=0.01)


def test_without_satellites_there_is_no_fix(run):
    trouble = run(GpsLost, vehicle="drone")
    assert [trouble.row(at)[M_GPS_FIX] for at in (1 * S, 3 * S, 5 * S)] == [3.0, 0.0, 3.0]


def test_a_drift_grows_with_its_speed_and_ends_with_the_fault(run):
    trouble = run(GpsDrift, vehicle="drone", speed_m_s=100.0, direction_deg=90.0)
    before, during, after = (trouble.row(at)[M_GPS : M_GPS + 3] for at in (1 * S, 3 * S, 5 * S))
    assert during[1] - before[1] == pytest.approx(100.0, abs=25.0)  # east, a second after the beginning
    assert during[0] - before[0] == pytest.approx(0.0, abs=5.0)
    assert hypot(*(after - before)[:2]) < 5.0


@pytest.mark.parametrize(("kind", "column", "width"), [(BarometerStuck, M_BARO, 1), (CompassStuck, M_MAG, 3)])
def test_a_stuck_sensor_repeats_its_last_value(run, kind, column, width):
    trouble = run(kind, vehicle="drone")
    samples = [trouble.row(at)[column : column + width].tolist() for at in (3 * S, 3500 * MS, 5 * S)]
    assert samples[0] == samples[1]
    assert samples[1] != samples[2]


def test_a_turned_compass_sees_the_heading_off_by_its_angle(run):
    trouble = run(CompassTurned, vehicle="drone", turn_deg=135.0)
    headings = []
    for at in (1 * S, 3 * S, 5 * S):
        forward, right, _ = trouble.row(at)[M_MAG : M_MAG + 3]
        headings.append(degrees(atan2(-right, forward)))
    assert (headings[1] - headings[0]) % 360.0 == pytest.approx(135.0, abs=6.0)
    assert (headings[2] - headings[0] + 180.0) % 360.0 == pytest.approx(180.0, abs=6.0)


def inertial_samples(trouble, at):
    """Return 100 samples of gyroscope and accelerometer from a time on."""
    return np.array([trouble.row(at + 2 * MS * number)[[*GYRO, *ACCEL]] for number in range(100)])


GYRO, ACCEL = range(M_GYRO, M_GYRO + 3), range(M_ACCEL, M_ACCEL + 3)


def test_inertial_sensors_are_off_on_each_axis_while_they_are_biased(run):
    trouble = run(ImuBiased, vehicle="drone", gyro_deg_s=10.0, accel_m_s2=2.0)
    before, during, after = (inertial_samples(trouble, at).mean(axis=0) for at in (1 * S, 3 * S, 5 * S))
    assert during - before == pytest.approx([radians(10.0)] * 3 + [2.0] * 3, rel=0.05)
    assert after == pytest.approx(before, abs=0.05)


def test_inertial_sensors_are_noisy_while_they_shake(run):
    trouble = run(ImuNoisy, vehicle="drone", gyro_deg_s=30.0, accel_m_s2=3.0)
    before, during, after = (inertial_samples(trouble, at).std(axis=0) for at in (1 * S, 3 * S, 5 * S))
    assert during == pytest.approx([radians(30.0)] * 3 + [3.0] * 3, rel=0.3)
    assert after == pytest.approx(before, rel=0.5)


def test_an_autopilot_without_its_transmitter_has_its_throttle_down_and_gets_it_back(run):
    trouble = run(RcLost, vehicle="drone")
    pulses = []
    for at in (1 * S, 3 * S, 5 * S):
        trouble.kernel.run(at)
        pulses.append(trouble.fleet.autopilots["drone"].transmitter[2])
    assert pulses == [1000, 950, 1000]


def test_an_autopilot_that_needs_no_transmitter_cannot_lose_one(run):
    with pytest.raises(CapabilityError, match=r"fault trouble: the simulated px4.* of drone does without"):
        run(RcLost, vehicle="drone", autopilot="px4")


def frames_in(trouble, start, end):
    """Count the frames that the commander of the drone receives in an interval."""
    return sum(start <= at < end for at in trouble.arrivals)


def listen(trouble):
    """Connect to the drone and note when frames arrive."""
    trouble.arrivals = []
    link = trouble.fleet.link("drone")
    link.receive(lambda frame: trouble.arrivals.append(trouble.kernel.now()))
    trouble.kernel.run(7 * S)
    return trouble


def test_nothing_passes_on_a_cut_link(run):
    trouble = listen(run(LinkCut, vehicle="drone"))
    assert frames_in(trouble, 0, BEGIN)
    assert not frames_in(trouble, BEGIN + 100 * MS, END)
    assert frames_in(trouble, END, 7 * S)


@pytest.mark.parametrize(("argument", "factor"), [({"loss": 1.0}, 0.0), ({"duplicate": 1.0}, 2.0)])
def test_a_degraded_link_loses_or_doubles_frames(run, argument, factor):
    usual = listen(run(LinkDegraded, vehicle="drone"))
    trouble = listen(run(LinkDegraded, vehicle="drone", **argument))
    middle = BEGIN + 100 * MS, END - 100 * MS
    assert frames_in(trouble, *middle) == pytest.approx(factor * frames_in(usual, *middle), abs=3)
    assert frames_in(trouble, 5 * S, 7 * S) == frames_in(usual, 5 * S, 7 * S)


def test_a_vehicle_without_a_link_is_refused():
    bird = VehicleSpec("bird", "multirotor", "dji", PAD)
    cut = LinkCut(vehicle="bird", **FAULT)
    with pytest.raises(ModelError, match=r"trouble\.vehicle: a simulated dji has no link"):
        with_faulty_links(Environment(vehicles=(bird,), faults=(cut,)))


def arrivals_of_packets(trouble):
    """Send a packet every 100 ms, best effort; return the times of sending and arrival."""
    found = []
    for number in range(60):
        at = number * 100 * MS

        def send(at=at):
            trouble.network.send(100, lambda: found.append((at, trouble.kernel.now())))

        trouble.kernel.call_at(at, send)
    trouble.kernel.run(7 * S)
    return found


def test_a_cut_network_loses_everything(run):
    sent = [at for at, _ in arrivals_of_packets(run(NetworkCut, network="radio"))]
    assert sent == [at * 100 * MS for at in range(60) if not BEGIN <= at * 100 * MS < END]


def test_a_degraded_network_delays(run):
    delays = {
        at: arrival - at
        for at, arrival in arrivals_of_packets(run(NetworkDegraded, network="radio", delay_ns=50 * MS))
    }
    assert delays[3 * S] - delays[1 * S] == 50 * MS
    assert delays[5 * S] == delays[1 * S]


def test_faults_of_one_link_may_overlap(run):
    trouble = run(LinkDegraded, vehicle="drone", duplicate=1.0)
    inject([LinkCut(name="cut", vehicle="drone", at_ns=3 * S, duration_ns=3 * S)], trouble.affected)
    listen(trouble)
    assert frames_in(trouble, BEGIN, 3 * S)
    assert not frames_in(trouble, 3100 * MS, 6 * S)  # the end of the other fault does not restore the link
    assert frames_in(trouble, 6 * S, 7 * S)


def test_faults_of_one_network_may_overlap(run):
    trouble = run(NetworkDegraded, network="radio", delay_ns=50 * MS)
    inject([NetworkCut(name="cut", network="radio", at_ns=3 * S, duration_ns=2 * S)], trouble.affected)
    delays = {at: arrival - at for at, arrival in arrivals_of_packets(trouble)}
    assert delays[2500 * MS] - delays[1 * S] == 50 * MS
    assert not [at for at in delays if 3 * S <= at < 5 * S]
    assert delays[5500 * MS] == delays[1 * S]


def test_a_computer_that_is_not_modelled_is_refused(run):
    with pytest.raises(CapabilityError, match="fault trouble: elsewhere is not modelled in this run"):
        run(ComputerStopped, processor="elsewhere")


def finished_at(trouble, start, amount):
    """Return when a component that starts at *start* has executed *amount*."""
    context = ExecutionContext("worker", trouble.processor, 5)
    trouble.kernel.call_at(start, lambda: trouble.processor.load(context, amount))
    trouble.kernel.run(9 * S)
    return max(one.end for one in trouble.events if isinstance(one, Slice) and one.component == "worker")


def test_a_stopped_computer_goes_on_where_it_stopped(run):
    trouble = run(ComputerStopped, processor="onboard")
    assert finished_at(trouble, 1500 * MS, 1 * S) == END + 500 * MS
    assert not [
        one for one in trouble.events if isinstance(one, Slice) and one.end > BEGIN and one.start < END
    ]


def test_a_slowed_computer_takes_longer(run):
    trouble = run(ComputerSlowed, processor="onboard", load=0.5)
    assert finished_at(trouble, 2500 * MS, 500 * MS) == pytest.approx(3500 * MS, abs=20 * MS)


def test_the_wind_changes_and_returns(run):
    trouble = run(WindChange, speed_m_s=10.0, direction_deg=270.0, gusts_m_s=0.0)
    winds = [trouble.row(at)[U_WIND : U_WIND + 2].tolist() for at in (1 * S, 3 * S, 5 * S)]
    assert winds[1] == pytest.approx([10.0, 0.0])
    assert winds[0] == winds[2] == pytest.approx([0.0, 0.0])
