"""Everything that is found by name can be loaded, and looking at the package loads nothing heavy."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import entry_points

import pytest

import volery
from rigs.sockets import HERE, served
from volery.links.stream_links import TcpServer

GROUPS = ("volery.drivers", "volery.autopilots", "volery.reporters")
HEAVY = ("numba", "numpy", "pymavlink", "rosbags", "networkx", "matplotlib", "greenlet", "mcap")


def loaded_by(statement: str) -> set[str]:
    """Modules that a fresh interpreter has loaded after *statement*, of those that take long."""
    script = f"import sys\ntry:\n    {statement}\nexcept SystemExit:\n    pass\n"
    script += f"print('LOADED', *[name for name in {HEAVY} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return set(done.stdout.rsplit("LOADED", 1)[1].split())


@pytest.mark.parametrize("group", GROUPS)
def test_every_entry_point_leads_somewhere(group):
    found = [entry for entry in entry_points(group=group) if entry.value.startswith("volery.")]
    assert found
    for entry in found:
        assert entry.load() is not None, entry


def test_every_public_name_is_there():
    assert set(volery.__all__) <= set(dir(volery))
    for name in volery.__all__:
        assert getattr(volery, name) is not None
    with pytest.raises(AttributeError, match="nonsense"):
        _ = volery.nonsense


def test_the_package_is_light_until_it_is_used():
    assert loaded_by("import volery") == set()


@pytest.mark.parametrize("word", ["--help", "simulate --help", "--version"])
def test_help_is_light(word):
    arguments = ["volery", *word.split()]
    statement = f"sys.argv = {arguments}; from volery.cli.main import main; main()"
    assert not loaded_by(statement) & {"numba", "pymavlink", "rosbags", "matplotlib", "networkx"}


@pytest.mark.parametrize(
    "module",
    [
        "run.connect",
        "run.fly",
        "cli.commands.fly",
        "cli.commands.ros",
        "run.distributed.worker",
        "run.assembly.computers",
    ],
)
def test_where_no_world_is_needed_nothing_of_the_simulation_is_loaded(module):
    """On board of a real vehicle, and in the processes of components that are on a real graph."""
    assert "numba" not in loaded_by(f"import volery.{module}")


FLIGHT = """
import sys, volery
with volery.connect(sys.argv[1]) as drone:
    drone.takeoff(3)
    drone.goto(drone.position)
    drone.land()
loaded = [name for name in sys.modules if name.startswith("volery.")]
print(len(loaded), *(name for name in loaded if name.split(".")[1] in {"ros", "simulation", "model"}))
"""


def test_a_flight_over_mavlink_loads_nothing_of_ros():
    with served(lambda kernel: TcpServer(kernel, HERE, 0), "ardupilot") as server:
        url = f"ardupilot+tcp://{HERE}:{server.port}"
        done = subprocess.run([sys.executable, "-c", FLIGHT, url], capture_output=True, text=True, check=True)
    loaded, *not_needed = done.stdout.split()
    assert not_needed == []
    assert int(loaded) <= 89
