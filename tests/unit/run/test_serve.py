"""The addresses at which a simulated vehicle is served."""

from __future__ import annotations

from volery.run.assembly.simulated_vehicles import parse_simulated
from volery.run.serve import VehicleServer
from volery.vehicles.address import parse


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
