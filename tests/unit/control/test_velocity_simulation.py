"""The velocity-level vehicle and the thesis's cube of goals on an embedded graph."""

from __future__ import annotations

from math import inf, nan, pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.base.errors import UsageError
from volery.base.time import S
from volery.control.velocity_simulation import (
    THESIS_CUBE,
    TWIST,
    CubeController,
    VelocityBody,
    VelocityVehicle,
)
from volery.kernel.virtual import VirtualKernel
from volery.ros.graph.embedded_graph import EmbeddedGraph
from volery.ros.messages import new

anything = st.one_of(st.floats(-100, 100), st.sampled_from([nan, inf, -inf]))


@given(st.lists(st.tuples(anything, anything, anything, anything), min_size=1, max_size=30))
def test_no_command_breaks_its_limits(commands) -> None:
    body = VelocityBody()
    for x, y, z, turn in commands:
        body.step((x, y, z), turn, 0.05)
        assert sum(one * one for one in body.velocity) ** 0.5 <= body.fastest + 1e-9
        assert abs(body.yaw_rate) <= body.turns + 1e-9
        assert body.position[2] >= 0.0


def test_a_velocity_is_in_the_vehicles_own_frame() -> None:
    body = VelocityBody(lag_s=0.0, yaw=pi / 2.0)
    body.step((1.0, 0.0, 0.5), 0.0, 1.0)
    assert body.position == pytest.approx((0.0, 1.0, 0.5))


def flown(rounds: int = 1, seconds: int = 200, **parameters: float) -> CubeController:
    kernel = VirtualKernel()
    graph = EmbeddedGraph(kernel)
    VelocityVehicle(kernel, graph.node("vehicle"))
    node = graph.node("controller")
    for name, value in parameters.items():
        node.set_parameter(f"~{name}", value)
    controller = CubeController(kernel, node, rounds=rounds)
    for second in range(1, seconds):
        kernel.run(second * S)
        if controller.done:
            break
    graph.close()
    kernel.close()
    return controller


def test_the_cube_is_flown_with_the_gains_of_the_thesis() -> None:
    controller = flown()
    assert controller.done
    assert len(controller.reached) == len(THESIS_CUBE)
    assert max(distance for _, distance in controller.reached) <= 0.05 * 3**0.5


def test_the_goals_can_be_flown_in_a_loop() -> None:
    controller = flown(rounds=0, seconds=150)
    assert not controller.done
    assert len(controller.reached) > len(THESIS_CUBE)


def test_parameters_of_the_node_are_the_gains() -> None:
    slow, fast = flown(), flown(kp=1.0)
    assert fast.reached[-1][0] < 0.8 * slow.reached[-1][0]


def test_a_vehicle_whose_commander_is_silent_stops_and_another_node_can_fly_it() -> None:
    kernel = VirtualKernel()
    graph = EmbeddedGraph(kernel)
    vehicle = VelocityVehicle(kernel, graph.node("vehicle"))
    publisher = graph.node("other").advertise("cmd_vel", TWIST)
    twist = new(TWIST)
    twist.linear.x = 1.0
    kernel.call_at(S, lambda: publisher.publish(twist))
    kernel.run(10 * S)
    assert 0.3 < vehicle.body.position[0] < 1.0
    assert abs(vehicle.body.velocity[0]) < 0.01
    graph.close()
    kernel.close()


def test_no_goals_are_refused() -> None:
    kernel = VirtualKernel()
    with pytest.raises(UsageError, match="at least one goal"):
        CubeController(kernel, EmbeddedGraph(kernel).node("controller"), goals=())
    kernel.close()
