"""FMUs that move a body: beside the world's own laws, and how they fail."""

import math
import os
import select
import signal
import sys
from subprocess import PIPE, Popen

import pytest

from rigs.multirotor_fmu import CRASH, ERROR, FALL, HANG, NO_NUMBER, make_fmu
from volery.base.frames import LocalFrame
from volery.base.time import MS, S
from volery.model.fmu_bodies import Fmu, FmuVariables
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint, make_world
from volery.simulation.fmu import running_fmu
from volery.simulation.fmu.fmu_body import FmuBody
from volery.simulation.fmu.fmu_interface import read_interface
from volery.simulation.fmu.running_fmu import RunningFmu
from volery.simulation.real_firmware.firmware_process import FirmwareError
from volery.simulation.world.body_specs import Multirotor
from volery.simulation.world.environment_models import Wind
from volery.simulation.world.scene import Scene, Solid
from volery.simulation.world.world import STEP

HERE = LocalFrame(47.4, 8.5, 400.0)
SPEC = Multirotor(at=(30.0, -20.0, 0.0), heading_deg=120.0)


class FmuFlight:
    """A flight whose body is moved by an FMU, or by the world without one."""

    def __init__(self, folder, fmu=None, wind=None, scene=None):
        self.now = 0
        self.moved = None
        spec = SPEC
        if fmu is not None:
            running = RunningFmu("drone_1", read_interface(fmu, 4), folder / "drone_1")
            try:
                self.moved = FmuBody(running, SPEC, fmu.axes)
            except FirmwareError:
                running.close()
                raise
            spec = self.moved.spec
        self.world, (self.flight,) = make_world(
            lambda: self.now, [spec], seed=3, frame=HERE, wind=wind, scene=scene
        )
        if self.moved is not None:
            self.moved.begin(self.flight.row)
            self.flight.move_by(self.moved)

    def wait(self, seconds):
        """Return the true states of each tenth of a second."""
        truths = []
        for _ in range(round(10 * seconds)):
            self.now += 100 * MS
            truths.append(self.flight.truth())
        return truths

    def trip(self):
        """Return the true states from the ground to a hover, over some metres, and down."""
        truths = self.wait(1)
        self.flight.set_origin()
        self.flight.drive(Setpoint(Control.IDLE))
        truths += self.wait(2)
        self.flight.drive(Setpoint(Control.POSITION, position=(0.0, 0.0, -4.0)))
        truths += self.wait(4)
        self.flight.push(1.0, 0.5, 0.0)
        self.flight.drive(Setpoint(Control.POSITION, position=(6.0, 3.0, -5.0), yaw=1.0))
        truths += self.wait(3)
        self.flight.push(0.0, 0.0, 0.0)
        self.flight.carry(0.5)
        truths += self.wait(2)
        self.flight.drive(Setpoint(Control.VELOCITY, velocity=(0.0, 0.0, 1.5)))
        truths += self.wait(5)
        return truths

    def close(self):
        self.flight.move_by(None)
        self.moved.fmu.close()


@pytest.fixture
def flown(tmp_path):
    """Return a function that makes a flight on an FMU; all are ended."""
    begun = []

    def begin(fmu, **options):
        begun.append(FmuFlight(tmp_path, fmu, **options))
        return begun[-1]

    yield begin
    for one in begun:
        one.close()


NED_NAMES = {"position": "quad.r", "commands": "esc", "wind": "air"}


@pytest.mark.parametrize(
    ("made", "stated"),
    [
        ({}, {}),
        (
            {"version": 3, "frd": True, "names": NED_NAMES},
            {
                "axes": "frd",
                "variables": FmuVariables(position=("quad.r",), commands=("esc",), wind=("air",)),
            },
        ),
    ],
    ids=["FMI 2, forward left up", "FMI 3, forward right down, arrays of other names"],
)
def test_an_fmu_of_the_same_laws_flies_as_the_world_does(flown, tmp_path, made, stated):
    wind = Wind(east=2.0, north=-3.0, gust=1.0)
    expected = FmuFlight(tmp_path, wind=wind).trip()
    on_fmu = flown(Fmu(make_fmu(tmp_path / "quad.fmu", **made), **stated), wind=wind)
    truths = on_fmu.trip()
    assert max(math.dist(a.position, b.position) for a, b in zip(truths, expected, strict=True)) < 1e-6
    for a, b in zip(truths, expected, strict=True):
        assert math.dist(a.attitude, b.attitude) < 1e-6
        assert math.dist(a.rates, b.rates) < 1e-5
        assert a.rotors == pytest.approx(b.rotors, abs=0.01)
        assert a.amps == pytest.approx(b.amps, rel=1e-4)
        assert (a.on_ground, a.contacts) == (b.on_ground, b.contacts)
    assert truths[90].position[2] - truths[90].ground > 3.0
    assert truths[-1].on_ground


def test_readers_do_not_change_the_motion(flown, tmp_path):
    fmu = Fmu(make_fmu(tmp_path / "quad.fmu"))
    often, rarely = flown(fmu), flown(fmu)
    for one in (often, rarely):
        one.flight.set_origin()
        one.flight.drive(Setpoint(Control.POSITION, position=(0.0, 0.0, -4.0)))
    often.wait(1.0)
    rarely.now = often.now
    assert rarely.flight.truth() == often.flight.truth()


def test_without_its_own_rotor_speeds_the_airframe_has_them(flown, tmp_path):
    optional = ("wind", "voltage", "load", "push", "rotor_speeds")
    flight = flown(Fmu(make_fmu(tmp_path / "quad.fmu", without=optional), parameters={"failure": 0}))
    flight.flight.drive_motors([0.3, 0.3, 0.3, 0.3])
    truth = flight.wait(1)[-1]
    assert truth.rotors[:4] == pytest.approx([0.3 * 760.0 * truth.volts / 12.6] * 4, rel=0.01)


def test_a_weak_motor_gets_the_command_of_its_share_of_the_thrust(flown, tmp_path):
    flight = flown(Fmu(make_fmu(tmp_path / "quad.fmu")))
    flight.flight.weaken_motor(2, 0.25)
    flight.flight.drive_motors([0.3, 0.3, 0.3, 0.3])
    rotors = flight.wait(1)[-1].rotors
    assert rotors[2] == pytest.approx(0.5 * rotors[0], rel=1e-6)


def test_one_that_flies_into_a_solid_loses_its_blades_and_is_not_held_off(flown, tmp_path):
    square = ((20.0, -30.0), (40.0, -30.0), (40.0, -10.0), (20.0, -10.0))
    ceiling = Scene([Solid("ceiling", square, 3.0, 4.0)])
    flight = flown(Fmu(make_fmu(tmp_path / "quad.fmu")), scene=ceiling)
    flight.flight.drive_motors([0.8, 0.8, 0.8, 0.8])
    truths = flight.wait(2)
    assert flight.flight.last_collision().solid == "ceiling"
    assert max(truth.position[2] for truth in truths) > 3.0
    assert truths[-1].rotors[0] < 0.01 * max(truth.rotors[0] for truth in truths)


@pytest.mark.parametrize(
    ("failure", "says"),
    [
        (CRASH, "was ended by SIGSEGV; its last words: a wrong address is written"),
        (ERROR, "answers fmi2DoStep with status error"),
        (NO_NUMBER, "gives no finite number for position"),
        (HANG, "does not answer"),
        (FALL, "falls through the ground: .* its input `ground`"),
    ],
)
def test_a_failure_is_named_with_the_last_good_state_which_can_be_read(
    flown, tmp_path, monkeypatch, failure, says
):
    monkeypatch.setattr(running_fmu, "_ANSWER_LIMIT_S", 2)
    fmu = Fmu(make_fmu(tmp_path / "quad.fmu"), parameters={"failure": failure, "fail_at": 0.151})
    flight = flown(fmu)
    with pytest.raises(
        FirmwareError, match=f"^drone_1: quad.fmu {says}.*; its last good state, at "
    ) as raised:
        flight.wait(3)
    text = f"{flight.flight.row[0]:.2f} m east, {flight.flight.row[1]:.2f} m north"
    assert text in str(raised.value)
    assert flight.wait(1)[-1].position == tuple(flight.flight.row[:3])
    flight.close()
    assert not (tmp_path / "drone_1" / "extracted").exists()


def test_a_step_that_it_does_not_take_is_refused(flown, tmp_path, monkeypatch):
    monkeypatch.setattr(running_fmu, "STEP_S", 0.004)
    flight = flown(Fmu(make_fmu(tmp_path / "quad.fmu")))
    with pytest.raises(FirmwareError, match="answers fmi2DoStep with status discard"):
        flight.wait(0.1)


def test_machine_code_that_cannot_be_loaded_is_named(flown, tmp_path, monkeypatch):
    monkeypatch.setattr("rigs.multirotor_fmu._machine_code", lambda *_: b"no code")
    with pytest.raises(FirmwareError, match=r"drone_1: quad.fmu cannot be loaded: .*quad.so"):
        flown(Fmu(make_fmu(tmp_path / "quad.fmu")))
    assert not (tmp_path / "drone_1" / "extracted").exists()


def test_it_is_freed_at_the_end(flown, tmp_path):
    flight = flown(Fmu(make_fmu(tmp_path / "quad.fmu")))
    flight.wait(0.1)
    flight.close()
    assert (tmp_path / "drone_1" / "console.txt").read_text() == "freed\n"
    assert flight.moved.fmu.process.ending()


KILLED = """\
import os, signal, sys
from pathlib import Path
from volery.model.fmu_bodies import Fmu
from volery.simulation.fmu.fmu_interface import read_interface
from volery.simulation.fmu.running_fmu import RunningFmu
running = RunningFmu("drone_1", read_interface(Fmu(Path(sys.argv[1])), 4), Path(sys.argv[2]))
running.exchange([0.0] * running.interface.inputs.size)
print(running.process.pid, flush=True)
sys.stdin.read()
"""


def test_it_dies_with_the_program_that_started_it_and_leaves_no_files(tmp_path):
    file = make_fmu(tmp_path / "quad.fmu")
    command = [sys.executable, "-c", KILLED, str(file), str(tmp_path)]
    with Popen(command, stdin=PIPE, stdout=PIPE, text=True) as program:
        watched = os.pidfd_open(int(program.stdout.readline()))
        program.send_signal(signal.SIGKILL)
    try:
        assert select.select([watched], [], [], 60.0)[0]
    finally:
        os.close(watched)
    for _ in range(6000):
        if not (tmp_path / "extracted").exists():
            return
        select.select([], [], [], 0.01)
    pytest.fail("the extracted files are still there")


def test_the_steps_are_those_of_the_world():
    assert running_fmu.STEP_S * S == STEP
