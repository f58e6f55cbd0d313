"""The addresses at which a simulated vehicle is served."""

from __future__ import annotations

import pytest

from volery import Drone
from volery.base.numeric_code import NumericCode
from volery.run.assembly.simulated_vehicles import parse_simulated
from volery.run.serve import VehicleServer
from volery.simulation.autopilots.flight_stack.flight_step import advance_flights
from volery.simulation.autopilots.px4.loop_step import fly_px4_loops
from volery.testing.stage import SimulatedStage
from volery.vehicles.address import parse, parse_listen


def test_a_second_px4_is_served_from_other_ports_and_says_so() -> None:
    servers, said = [], []
    for name in ("first", "second"):
        said.clear()
        wanted = parse_simulated(parse("sim:px4"), name)
        servers.append(VehicleServer(wanted, None, notice=said.append))
    try:
        assert [line.split(" is in use")[0] for line in said] == ["UDP port 14580", "UDP port 18570"]
        ports = [link.port for server in servers for link in server.links]
        assert len(set(ports)) == 4
    finally:
        for server in servers:
            for link in server.links:
                link.close()
            server.kernel.close("the test is over")


def _no_compiler(code: NumericCode, *, cache: bool) -> None:
    raise AssertionError(f"{code.name} is compiled while time passes")


@pytest.fixture
def nothing_is_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    for code in (advance_flights, fly_px4_loops):
        for made in ("_compiled", "_loaded"):
            monkeypatch.delitem(vars(code), made, raising=False)


@pytest.mark.usefixtures("nothing_is_compiled")
def test_a_server_is_ready_when_its_machine_code_is_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    server = VehicleServer(parse_simulated(parse("sim:px4"), "d"), parse_listen("udp://127.0.0.1:0"))
    found = []

    def stop() -> None:
        raise KeyboardInterrupt

    def ready() -> None:
        found.extend(
            vars(code).keys() & {"_compiled", "_loaded"} for code in (advance_flights, fly_px4_loops)
        )
        server.kernel.post(stop)

    with pytest.raises(KeyboardInterrupt):
        server.run(ready)
    assert [len(one) for one in found] == [1, 1]


@pytest.mark.usefixtures("nothing_is_compiled")
@pytest.mark.parametrize("autopilot", ["ardupilot", "px4", "paparazzi", "dji"])
def test_nothing_is_compiled_in_flight(autopilot: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Observed: a pause of 20 s in the first take-off, in which its commander lost the link."""
    stage = SimulatedStage(parse(f"sim:{autopilot}"), Drone, 1)
    monkeypatch.setattr(NumericCode, "by_numba", _no_compiler)
    stage.perform(lambda: stage.drone.takeoff(5))
    assert stage.flight.truth().position[2] > 3.0
    stage.close()
