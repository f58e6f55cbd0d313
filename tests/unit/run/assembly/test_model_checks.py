"""`volery model check` loads components: what does not fit is found before a run, with file and line."""

import shutil

import pytest
from typer.testing import CliRunner

from volery.cli.commands.first_steps import example
from volery.cli.main import application


@pytest.fixture
def starter(tmp_path):
    """Copy the starter model; return a function that changes one file of it and checks the model."""
    folder = tmp_path / "patrol"
    shutil.copytree(example("starter"), folder)

    def check(file="", old="", new=""):
        if file:
            path = folder / file
            text = path.read_text()
            assert old in text
            path.write_text(text.replace(old, new))
        result = CliRunner().invoke(application(), ["model", "check", str(folder)])
        return result.exit_code, " ".join(result.output.split())

    return check


PATROL, PLANNER = "components/patrol.py", "components/route_planner.py"


def test_the_starter_itself_is_right(starter):
    status, said = starter()
    assert status == 0, said
    assert "ready for fidelity code" in said


@pytest.mark.parametrize(
    ("file", "old", "new", "expected"),
    [
        (
            "model.yaml",
            "autopilot: ardupilot,",
            "autopilot: ardupilot, features: winsh,",
            "drone_1: a simulated ardupilot has no feature 'winsh'; off by default: airspeed, all, buttons",
        ),
        (
            "model.yaml",
            "autopilot: ardupilot,",
            'autopilot: ardupilot, version: "9",',
            "environment.vehicles.drone_1: a simulated ardupilot has no version '9'; there is 4.5 or 4.8",
        ),
        (PATROL, "class Patrol:", "class Patrl:", "patrol.py:1: no class 'Patrol' (did you mean 'Patrl'?)"),
        (PATROL, "def run(self):", "def run(self)", "patrol.py:16: not Python: expected ':'"),
        (
            PATROL,
            "def __init__(self, drone, route, field, height):",
            "def __init__(self, drone, route, field):",
            "patrol.py:10: Patrol: the model gives 'height', but its constructor takes",
        ),
        (
            PATROL,
            "field, height):",
            "field, height, speed):",
            "patrol.py:10: Patrol: its constructor requires 'speed', but the model gives",
        ),
        (
            PATROL,
            "def run(self):",
            "def go(self):",
            "patrol.py:7: Patrol: has no method 'run'",
        ),
        (
            PLANNER,
            "def order_of(self, posts):",
            "def orders_of(self, posts):",
            "route_planner.py:6: RoutePlanner: has no method 'order_of', an operation that it provides "
            "(did you mean 'orders_of'?)",
        ),
        (
            PLANNER,
            "def order_of(self, posts):",
            "def order_of(self):",
            "route_planner.py:12: RoutePlanner: order_of() does not fit the interface's order_of(posts)",
        ),
        (PATROL, "import volery\n", "import volery\nimport no_such_library\n", "No module named 'no_such_"),
        (
            PATROL,
            "import volery\n",
            "import volery\n1 / 0\n",
            "ZeroDivisionError: division by zero (patrol.py:4)",
        ),
    ],
)
def test_a_component_that_cannot_run_is_bad_input(starter, file, old, new, expected):
    status, said = starter(file, old, new)
    assert status == 2, said
    assert expected in said


@pytest.mark.parametrize("language", ["rospy", "rclpy"])
def test_a_fault_in_the_python_of_a_ros_file_has_its_line(starter, language):
    starter(
        "model.yaml", f"language: python\n    path: {PATROL}", f"language: {language}\n    path: {PATROL}"
    )
    status, said = starter(PATROL, "def run(self):", "def run(self)")
    assert status == 2, said
    assert "patrol.py:16: not Python: expected ':'" in said
    assert "internal error" not in said


def test_everything_is_found_at_once(starter):
    starter(PATROL, "class Patrol:", "class Patrl:")
    status, said = starter(PLANNER, "class RoutePlanner:", "class Planner:")
    assert status == 2
    assert said.count("V704 code-mismatch") == 2
    assert "patrol.py" in said
    assert "route_planner.py" in said
