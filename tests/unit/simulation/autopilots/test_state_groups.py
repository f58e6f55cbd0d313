"""State of a simulated vehicle by owner: ground contact, and the home position."""

from volery.base.frames import LocalFrame
from volery.base.time import S
from volery.kernel.virtual import VirtualKernel
from volery.simulation.autopilots.ardupilot import FIRMWARE
from volery.simulation.autopilots.flight_stack.flight import make_world
from volery.simulation.autopilots.state_groups import NEVER, GroundState
from volery.simulation.world.body_specs import Multirotor

ABANDONED = 2 * S


def test_a_vehicle_has_landed_once_the_detector_reports_ground_after_flight() -> None:
    ground = GroundState(landed=True)
    ground.arm(0)
    ground.leave(1 * S)
    assert not ground.landed
    ground.update(2 * S, on_ground=False, takeoff_requested=False, abandoned_after=ABANDONED)
    assert ground.lifted
    ground.update(9 * S, on_ground=True, takeoff_requested=True, abandoned_after=ABANDONED)
    assert ground.landed
    assert ground.landed_at == ground.idle_since == 9 * S


def test_after_a_flight_the_time_of_the_landed_detector_counts_and_no_other() -> None:
    ground = GroundState(landed=True)
    ground.leave(0)
    for second, on_ground in ((1, False), (5, True), (8, True)):
        ground.update(second * S, on_ground, False, abandoned_after=ABANDONED, landed_after=4 * S)
    assert not ground.landed
    ground.update(9 * S, True, False, abandoned_after=ABANDONED, landed_after=4 * S)
    assert ground.landed


def test_a_take_off_that_never_left_the_ground_ends_after_its_time() -> None:
    ground = GroundState(landed=True)
    ground.leave(0)
    ground.update(1 * S, on_ground=True, takeoff_requested=True, abandoned_after=ABANDONED)
    ground.update(2 * S, on_ground=True, takeoff_requested=False, abandoned_after=ABANDONED)
    assert not ground.landed
    ground.update(3 * S, on_ground=True, takeoff_requested=False, abandoned_after=ABANDONED)
    assert ground.landed
    assert ground.takeoff_requested_at == NEVER


def test_a_home_set_by_a_user_stays_marked_until_the_next_boot() -> None:
    kernel = VirtualKernel()
    _, (flight,) = make_world(kernel.now, [Multirotor()], seed=1, frame=LocalFrame(47.4, 8.5, 400.0))
    vehicle = FIRMWARE.create(kernel, flight, warm=True).vehicle
    vehicle.set_home_here()
    assert vehicle.home is not None
    assert not vehicle.home.by_user
    vehicle.set_home(47.41, 8.5, 410.0, by_user=True)
    vehicle.set_home_here()
    assert vehicle.home.by_user
    vehicle.boot(0)
    assert vehicle.home is None
    assert not vehicle.failsafes.active
    assert vehicle.commanded.speed is None
