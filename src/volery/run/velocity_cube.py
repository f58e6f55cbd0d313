"""The cube of goals on a vehicle at the level of velocities: in virtual time, or as nodes of real ROS."""

from __future__ import annotations

from pathlib import Path

from volery.base.errors import NotArrived
from volery.base.time import Ns, S
from volery.control.velocity_simulation import CubeController, VelocityVehicle
from volery.kernel.virtual import VirtualKernel
from volery.kernel.waiting import sleep
from volery.kernel.wall import WallKernel
from volery.ros.graph.embedded_graph import EmbeddedGraph
from volery.run.assembly.ros_graphs import open_graph
from volery.run.recording import Recording
from volery.trace.attachments import RunSetup

LIMIT: Ns = 600 * S
SCRIPT = "velocity cube"


def fly_cube(out: Path, rounds: int = 1) -> list[tuple[float, float]]:
    """Fly the thesis's goals in virtual time; return time in s and distance in m at which each was reached.

    Args:
        out: run folder; the loops are recorded.
        rounds: how often the goals are flown.

    Raises:
        NotArrived: the goals were not reached within ten minutes of virtual time.
    """
    kernel = VirtualKernel()
    recording = Recording(RunSetup(SCRIPT, "code"), out)
    kernel.record = recording.stream
    graph = EmbeddedGraph(kernel)
    vehicle = VelocityVehicle(kernel, graph.node("velocity_vehicle"))
    controller = CubeController(kernel, graph.node("test_via_point"), rounds=rounds)
    until = S
    while not controller.done and until <= LIMIT:
        kernel.run(until)
        until += S
    vehicle.close()
    controller.close()
    graph.close()
    kernel.close()
    recording.finish(
        "completed" if controller.done else "failed", f"{len(controller.reached)} goals", kernel.now(), ()
    )
    if not controller.done:
        raise NotArrived("velocity", "fly the cube", f"{len(controller.reached)} goals were reached in 600 s")
    return controller.reached


def serve_cube(graph_name: str, *, controlled: bool, rounds: int = 0) -> None:
    """Serve the vehicle on real ROS until Ctrl-C, or until the goals have been flown.

    Args:
        graph_name: ``ros1`` or ``ros2``.
        controlled: whether the thesis's controller flies it; else any node may.
        rounds: how often the goals are flown; 0 without end.

    Raises:
        UsageError, LinkError: see ``open_graph``.
    """
    kernel = WallKernel()
    kernel.start()
    try:
        with kernel.adopt(SCRIPT):
            graph = open_graph(kernel, graph_name)
            with kernel.guard:
                vehicle = VelocityVehicle(kernel, graph.node("velocity_vehicle"))
                node = graph.node("test_via_point") if controlled else None
                controller = CubeController(kernel, node, rounds=rounds) if node is not None else None
            try:
                while controller is None or not controller.done:
                    sleep(kernel, S // 5)
            finally:
                vehicle.close()
                graph.close()
    finally:
        kernel.close()
