import os
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.base.errors import ModelError, UsageError
from volery.base.time import S
from volery.calibration.meters.rospy import imported
from volery.calibration.node_comparison import (
    NodeComparison,
    NodeEstimate,
    compare,
    compare_nodes,
    node_estimates,
)
from volery.calibration.node_processes import node_programs, process_cpu
from volery.cli.commands.cost import _verdict
from volery.model.system_loader import load
from volery.requirements.record import RunRecord
from volery.run.assembly.model_checks import vocabulary

MODEL = """
volery: 1
name: nodes
components:
  Node: {language: rospy, path: node.py, active: true}
  Other: {language: LANGUAGE, path: other.py, active: true}
application:
  node: {is: Node, namespace: /drone, remap: {a: /b}, parameters: {rate: 10.0, name: x}}
environment:
  components:
    other: {is: Other}
platform:
  processors: {host: {is: intel-i5-3470, frequency: 3000 MHz}}
allocations:
  only: {node: host}
"""


def nodes(folder: Path, other: str = "print()\n", language: str = "rospy") -> Path:
    (folder / "node.py").write_text("import rospy\nrospy.init_node('n')\n")
    (folder / "other.py").write_text(other)
    (folder / "model.yaml").write_text(MODEL.replace("LANGUAGE", language))
    return folder


def test_a_script_is_started_as_roslaunch_would(tmp_path: Path) -> None:
    other, node = node_programs(load(nodes(tmp_path), vocabulary()))
    assert (other.instance, other.measured, node.measured) == ("other", False, True)
    assert node.node == "/drone/node"
    assert node.command[2:] == (
        str(tmp_path / "node.py"),
        "__name:=node",
        "__ns:=/drone",
        "a:=/b",
        "_rate:=10.0",
        '_name:="x"',
    )


def test_a_component_that_is_not_a_node_cannot_be_measured(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"model\.yaml:6.*other is python.*rospy and roscpp"):
        node_programs(load(nodes(tmp_path, language="python"), vocabulary()))
    with pytest.raises(ModelError, match="other is a class"):
        node_programs(load(nodes(tmp_path, "class Other:\n    def run(self): ...\n"), vocabulary()))


ESTIMATE = NodeEstimate(ros_s=0.110, code_s=0.010, calls={"publish": 100})
NODE = NodeComparison("n", "rospy", ESTIMATE, (0.100, 0.102, 0.098, 0.100))


def test_a_node_in_the_tables() -> None:
    assert NODE.measured_s == pytest.approx(0.1)
    assert NODE.difference == pytest.approx(0.2)
    assert NODE.spread_s == pytest.approx(0.001)
    assert (NODE.allowed, NODE.holds) == (0.15, False)
    assert NODE.measured_ros_s == pytest.approx(0.09)
    assert NODE.ros_share == pytest.approx(0.9)
    assert NODE.ros_error == pytest.approx(0.02 / 0.09)
    assert NODE.impact == pytest.approx(0.9 * 0.02 / 0.09)


@given(
    charged_s=st.floats(0.0, 1e3),
    ros_s=st.floats(0.0, 1e3),
    measured_s=st.floats(1e-6, 1e3),
    wide=st.booleans(),
)
def test_ros_is_never_more_than_the_whole(
    charged_s: float, ros_s: float, measured_s: float, wide: bool
) -> None:
    record = SimpleNamespace(
        components={"n": SimpleNamespace(cpu_s=charged_s, ros_cpu_s=ros_s, ros_calls={"publish": 1})}
    )
    estimate = node_estimates(cast("RunRecord", record), ["n"])["n"]
    assert 0.0 <= estimate.ros_s <= estimate.whole_s
    runs_s = (measured_s / 3.0, measured_s, 3.0 * measured_s) if wide else (measured_s,)
    compared = NodeComparison("n", "rospy", estimate, runs_s)
    assert 0.0 <= compared.ros_share <= 1.0
    assert 0.0 <= compared.measured_ros_s <= compared.measured_s


@pytest.mark.parametrize("runs_s", [(0.02, 0.03, 0.12, 0.3, 0.6), (0.0001, 0.12, 0.5)])
def test_no_estimate_holds_against_runs_that_differ_by_more_than_thirty_per_cent(
    runs_s: tuple[float, ...],
) -> None:
    noisy = replace(NODE, runs_s=runs_s)
    assert abs(noisy.difference) < 0.01
    assert noisy.half_spread > 0.3
    assert (noisy.is_conclusive, noisy.holds) == (False, False)
    assert _verdict(noisy).plain == "too noisy"
    assert noisy.as_data()["conclusive"] is False


def test_an_estimate_holds_or_is_too_far_against_runs_that_agree() -> None:
    assert _verdict(NODE).plain == "too far"
    assert _verdict(replace(NODE, runs_s=(0.115, 0.12, 0.125))).plain == "holds"


def test_runs_that_differ_allow_more() -> None:
    wide = replace(NODE, runs_s=(0.05, 0.08, 0.1, 0.13, 0.15))
    assert wide.spread_s == pytest.approx(0.05)
    assert wide.allowed == pytest.approx(0.25)
    assert wide.holds


def test_one_run_has_no_spread() -> None:
    assert replace(NODE, runs_s=(0.1,)).spread_s == 0.0


def test_runs_are_compared_with_estimates() -> None:
    [one] = compare_nodes({"n": "rospy"}, {"n": ESTIMATE}, [{"n": S // 10}, {"n": S // 5}])
    assert one.runs_s == (0.1, 0.2)
    assert one.as_data()["measured_s"] == pytest.approx(0.15)


def test_without_a_run_there_is_nothing_to_compare(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no run was measured"):
        compare(load(nodes(tmp_path), vocabulary()), {}, [])


def test_a_process_is_read_from_outside() -> None:
    before = time.process_time_ns()
    taken = process_cpu(os.getpid())
    assert before <= taken <= time.process_time_ns()


def test_the_meter_imports_the_modules_of_the_script() -> None:
    source = """
import math, numpy
import rospy
from std_msgs.msg import String
from tutorials.srv import AddTwoInts
from mine import thing
from . import beside
"""
    found = ["math", "rospy", "std_msgs.msg", "tutorials.srv"]
    assert list(imported(source)) == found
