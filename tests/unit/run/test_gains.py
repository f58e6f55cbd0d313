"""Gains from files and from parameters of a node, before and during a flight."""

from __future__ import annotations

from pathlib import Path

import pytest

from volery.base.errors import UsageError
from volery.base.time import S
from volery.control.laws import PidGains
from volery.control.manoeuvres import Rotation, Waypoints
from volery.kernel.virtual import VirtualKernel
from volery.kernel.waiting import sleep
from volery.ros.graph.embedded_graph import EmbeddedGraph
from volery.run.connect import connect
from volery.run.gains import GainParameters, loops_of, read_gains
from volery.run.go import GoSettings, go
from volery.run.result import Options
from volery.trace.events import Text
from volery.trace.reader import read

LOOPS = {"yaw": PidGains(kp=1.0, ki=0.5)}


def test_gains_are_read_and_others_kept(tmp_path: Path) -> None:
    file = tmp_path / "gains.toml"
    file.write_text("[yaw]\nkp = 2.5\n")
    assert read_gains(file, LOOPS) == {"yaw": PidGains(kp=2.5, ki=0.5)}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[yaw]\nkp = nan\n", "kp is not a number"),
        ("[yaw]\nkp = -1\n", "kp=-1"),
        ("[yaw]\nkq = 1\n", "kq = 1 is no gain"),
        ("[jaw]\nkp = 1\n", "no loop 'jaw'"),
        ("yaw = 3\n", r"write a table"),
        ("[yaw\n", "no TOML"),
    ],
)
def test_wrong_gains_are_named(tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "gains.toml"
    file.write_text(text)
    with pytest.raises(UsageError, match=said) as error:
        read_gains(file, LOOPS)
    assert "gains.toml" in str(error.value)


def test_a_missing_file_of_gains_is_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"nowhere\.toml"):
        read_gains(tmp_path / "nowhere.toml", LOOPS)


def test_gains_that_change_in_flight_are_used_and_wrong_ones_are_not(tmp_path: Path) -> None:
    file = tmp_path / "gains.toml"
    file.write_text("[yaw]\nkp = 3.0\n")
    turns = Rotation([0.0], 6.0)
    seen = []

    def edit(seconds: float) -> None:
        law = turns.laws["yaw"]
        seen.append(law.gains.kp)  # type: ignore[attr-defined]  # it is a PID law
        if len(seen) == 40:
            file.write_text("[yaw]\nkp = 2.0\n")
        if len(seen) == 80:
            file.write_text("[yaw]\nkp = -2.0\n")

    step = turns.step

    def watched(measured, sample_s):
        edit(sample_s)
        return step(measured, sample_s)

    turns.step = watched  # type: ignore[method-assign]
    run = go(lambda: turns, "sim:ardupilot?start=warm", GoSettings(gains=file), Options(out=tmp_path / "run"))
    assert run.error is None
    assert set(seen) == {3.0, 2.0}
    assert seen[-1] == 2.0
    texts = [event.text for event in read(tmp_path / "run" / "trace.mcap").events if isinstance(event, Text)]
    assert any("are in use" in text for text in texts)
    assert any("remain as they were" in text and "kp=-2" in text for text in texts)


# -- parameters of a node


def test_each_gain_of_each_loop_is_a_parameter() -> None:
    kernel = VirtualKernel()
    node = EmbeddedGraph(kernel).node("volery_go")
    turns = Waypoints([(0.0, 0.0, 5.0)])
    GainParameters(node, turns)
    for loop, gains in loops_of(turns).items():
        assert node.get_parameter(f"~{loop}/kp") == gains.kp
        assert node.get_parameter(f"~{loop}/ki") == gains.ki
    assert not node.has_parameter("~north/slew")  # it is infinite
    kernel.close()


def test_parameters_that_are_set_before_are_used_and_wrong_ones_are_refused() -> None:
    kernel = VirtualKernel()
    graph = EmbeddedGraph(kernel)
    turns = Rotation([0.0])
    node = graph.node("volery_go")
    node.set_parameter("~yaw/kp", 1.25)
    GainParameters(node, turns)
    assert loops_of(turns)["yaw"].kp == 1.25
    node.set_parameter("~yaw/kp", "much")
    with pytest.raises(UsageError, match=r"parameters of .*volery_go.*kp = 'much' is no gain"):
        GainParameters(node, Rotation([0.0]))
    kernel.close()


def test_parameters_that_change_in_flight_are_used_and_wrong_ones_are_not() -> None:
    turns, texts = Rotation([0.0]), []
    with connect("sim:ardupilot?start=warm") as drone:
        drone.kernel.record = lambda event: texts.append(event.text) if isinstance(event, Text) else None
        node = EmbeddedGraph(drone.kernel).node("volery_go")
        gains = GainParameters(node, turns)
        gains.watch(drone)
        for value, used in ((3.0, 3.0), (-1.0, 3.0), (float("nan"), 3.0), (2.0, 2.0)):
            node.set_parameter("~yaw/kp", value)
            sleep(drone.kernel, 2 * S)
            assert loops_of(turns)["yaw"].kp == used
        node.delete_parameter("~yaw/kp")
        sleep(drone.kernel, 2 * S)
        assert loops_of(turns)["yaw"].kp == Rotation([0.0]).laws["yaw"].gains.kp  # type: ignore[attr-defined]
        gains.close()
        sleep(drone.kernel, 2 * S)
    assert any("volery_go are in use" in one for one in texts)
    assert any("remain as they were" in one and "kp=-1" in one for one in texts)
