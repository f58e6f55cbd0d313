from __future__ import annotations

from typing import Any

from volery.base.frames import LocalFrame
from volery.base.time import S
from volery.kernel.virtual import VirtualKernel
from volery.simulation.autopilots.ardupilot import FIRMWARE
from volery.simulation.autopilots.ardupilot.pilot_input import sticks_rest, switches_of
from volery.simulation.autopilots.flight_stack.flight import make_world
from volery.simulation.world.body_specs import Multirotor


def test_sticks_are_read_again_after_a_channel_or_a_parameter_has_changed() -> None:
    kernel = VirtualKernel()
    _, flights = make_world(kernel.now, [Multirotor()], seed=1, frame=LocalFrame(46.0, 7.0, 500.0))
    autopilot = FIRMWARE.of_version("4.5").create(kernel, flights[0], warm=True)
    kernel.run(5 * S)
    vehicle = autopilot.vehicle
    assert sticks_rest(vehicle)
    vehicle.rc.override(6, 1900, kernel.now())
    assert not sticks_rest(vehicle)
    assert sticks_rest(vehicle)
    assert vehicle.set_parameter("RC6_OPTION", 11.0)
    assert not sticks_rest(vehicle)
    switches_of(vehicle).mode = -1  # a switch of modes was released: the mode switch counts again
    assert not sticks_rest(vehicle)
    kernel.run(6 * S)
    assert switches_of(vehicle).mode == switches_of(vehicle).read
    assert sticks_rest(vehicle)


def test_a_track_without_a_position_ends_and_smart_rtl_is_refused_until_the_next_arming(station: Any) -> None:
    rig = station(parameters={"FS_EKF_THRESH": 0, "ARMING_CHECK": 0})
    rig.run(0.5)
    rig.command(176, 1, 4)
    assert rig.command(400, 1) == 0
    rig.command(22, 0, 0, 0, 0, 0, 0, 10.0)
    rig.run(12.0)
    rig.vehicle.set_parameter("SIM_GPS_DISABLE", 1.0)
    rig.run_until(lambda: not rig.vehicle.has_position)
    rig.run(14.0)
    assert rig.vehicle.ground.track
    rig.run(2.0)
    assert rig.texts().count("SmartRTL deactivated: bad position") == 1
    rig.vehicle.set_parameter("SIM_GPS_DISABLE", 0.0)
    rig.run_until(lambda: rig.vehicle.has_position)
    rig.run(5.0)
    assert rig.command(176, 1, 21) == 4
