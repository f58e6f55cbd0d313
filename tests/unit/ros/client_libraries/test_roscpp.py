"""roscpp's face without a compiler: generated headers, and answers on the embedded graph."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from volery.base.errors import ModelError, UsageError
from volery.base.time import S
from volery.kernel.task import ExecutionContext
from volery.ros.client_libraries import roscpp
from volery.ros.client_libraries.abi_codec import CppFiber, Reader, Writer
from volery.ros.client_libraries.library_base import Launch
from volery.ros.client_libraries.roscpp import requests
from volery.ros.messages import new, to_cdr
from volery.trace.events import Text

HERE = Path(__file__)


def test_a_header_and_those_that_it_needs():
    texts = roscpp.generate_headers(["geometry_msgs/PoseStamped.h", "vector", "mavros_msgs/VFR_HUD.h"], HERE)
    assert {"geometry_msgs/PoseStamped.h", "geometry_msgs/Point.h", "std_msgs/Header.h"} <= set(texts)
    pose = texts["geometry_msgs/PoseStamped.h"]
    assert '#include "std_msgs/Header.h"' in pose
    assert "std_msgs::Header header{};" in pose
    assert "using PoseStampedConstPtr = PoseStamped::ConstPtr;" in pose
    header = texts["std_msgs/Header.h"]
    assert "std::uint32_t seq{};" in header
    assert 'visit("seq"' not in header, "the encoding has no seq"
    assert 'return "mavros_msgs/msg/VfrHud"' in texts["mavros_msgs/VFR_HUD.h"]
    assert "vector" not in texts


def test_services_constants_and_arrays():
    texts = roscpp.generate_headers(
        ["std_srvs/SetBool.h", "sensor_msgs/CameraInfo.h", "sensor_msgs/NavSatStatus.h"], HERE
    )
    assert "using Request = SetBoolRequest;" in texts["std_srvs/SetBool.h"]
    assert "std::uint8_t data{};" in texts["std_srvs/SetBoolRequest.h"]
    assert "boost::array<double, 9> K{};" in texts["sensor_msgs/CameraInfo.h"], "in ROS 1's names"
    assert (
        "static constexpr std::int8_t STATUS_NO_FIX = static_cast<std::int8_t>(-1);"
        in texts["sensor_msgs/NavSatStatus.h"]
    )


def test_what_ros_has_and_is_not_offered_says_so():
    texts = roscpp.generate_headers(
        [
            "ros/poll_set.h",
            "std_msgs/Nothing.h",
            "ros/ros.h",
            "foo/bar.h",
            "cv_bridge/cv_bridge.h",
            "tf/mine.h",
        ],
        HERE,
        {"tf/mine.h"},
    )
    assert set(texts) == {"ros/poll_set.h", "std_msgs/Nothing.h", "cv_bridge/cv_bridge.h"}
    assert all("is not offered" in text for text in texts.values())
    assert "read sensor_msgs::Image::data" in texts["cv_bridge/cv_bridge.h"]


CFG = """
from dynamic_reconfigure.parameter_generator_catkin import *
gen = ParameterGenerator()
gen.add("gain", double_t, 1, 'A "gain"', 2, 0, max=5)
motion = gen.add_group("motion")
motion.add("steps", int_t, 0x2, "Steps", 3)
gen.add("name", str_t, 0, "Name", "x")
gen.add("on", bool_t, 0, "On", True)
exit(gen.generate("pkg", "node", "Tuning"))
"""


def test_the_class_of_a_cfg_file(tmp_path):
    (tmp_path / "package.xml").write_text("<package><name>pkg</name></package>")
    (tmp_path / "cfg").mkdir()
    (tmp_path / "cfg" / "Tuning.cfg").write_text(CFG)
    file = tmp_path / "node.cpp"
    text = roscpp.generate_headers(["pkg/TuningConfig.h"], file)["pkg/TuningConfig.h"]
    for line in ("double gain = 2.0;", "int steps = 3;", 'std::string name = "x";', "bool on = true;"):
        assert f"    {line}\n" in text
    described = r'Parameter{"gain", "double", 1, "A \"gain\""}, &TuningConfig::gain, double(0.0), double(5.0)'
    assert described in text
    assert "&TuningConfig::steps, int(std::numeric_limits<int>::min())" in text
    assert "pkg/OtherConfig.h" not in roscpp.generate_headers(["pkg/OtherConfig.h"], file)

    (tmp_path / "cfg" / "Tuning.cfg").write_text(CFG.replace('"Steps", 3', '"Steps", len("x")'))
    with pytest.raises(ModelError, match=r"Tuning\.cfg:6: default of the parameter is computed"):
        roscpp.generate_headers(["pkg/TuningConfig.h"], file)


@pytest.mark.parametrize("value", [True, -3, 2.5, "text", [1, 2.5, ["x"]], {"a": {"b": 1}, "c": []}])
def test_parameters_cross_the_border_unchanged(value):
    out = Writer()
    requests.write_parameter(out, value)
    assert requests.read_parameter(Reader(out.done())) == value
    assert type(requests.read_parameter(Reader(out.done()))) is type(value)


class Code:
    """Stands for C++ code: asks questions as a task, and keeps what it is called back with."""

    def __init__(self, stage: Any, name: str, launch: Launch | None = None) -> None:
        self.session = roscpp.Session(stage.graph, name, launch or Launch())
        self.answers = roscpp.request_handlers(self.session)
        self.called: list[tuple[int, bytes]] = []
        self.returns = b""

    def call(self, callable_number: int, argument: bytes = b"") -> bytes:
        self.called.append((callable_number, argument))
        return self.returns

    def ask(self, question: str, with_: Writer | None = None) -> Reader:
        flow: CppFiber = self
        return Reader(self.answers[f"ros.{question}"](flow, Reader((with_ or Writer()).done())))


def _run(stage: Any, body: Any, name: str = "node") -> None:
    failed: list[BaseException] = []

    def guarded() -> None:
        try:
            body()
        except Exception as error:
            failed.append(error)

    stage.kernel.spawn(guarded, name, ExecutionContext(name))
    stage.run(10 * S)
    if failed:
        raise failed[0]


def test_callbacks_run_on_the_stack_of_the_spinning_fiber(stage):
    code = Code(stage, "node")
    word = to_cdr(new("std_msgs/String", data="hello"))

    def body() -> None:
        code.ask("init", Writer().text("other").flag(False))
        topic = Writer().text("/words").text("std_msgs/msg/String")
        code.ask(
            "subscribe",
            Writer().text("/words").text("std_msgs/msg/String").integer(5).integer(7).integer(-1),
        )
        publisher = code.ask("advertise", topic.integer(5).flag(False)).integer()
        for _ in range(3):
            code.ask("publish", Writer().integer(publisher).raw(word))
        code.ask("sleep", Writer().integer(S))
        assert not code.called, "not spun yet"
        code.ask("spin_once")

    _run(stage, body)
    assert code.called == [(7, word)] * 3
    assert stage.priced.count(("/other", "spin_once")) == 1


def test_nothing_before_init(stage):
    code = Code(stage, "node")
    with pytest.raises(UsageError, match="call ros::init"):
        _run(stage, lambda: code.ask("node_handle", Writer().text("").text("")))


def test_names_and_parameters(stage):
    code = Code(stage, "node", Launch("/robot", {"scan": "/laser"}, {"rate": 5}))

    def body() -> None:
        code.ask("init", Writer().text("other").flag(False))
        assert code.ask("name").text() == "/robot/other"
        private = code.ask("node_handle", Writer().text("").text("~")).text()
        assert private == "/robot/other"
        assert code.ask("node_handle", Writer().text("").text("arm")).text() == "/robot/arm"
        assert code.ask("resolve", Writer().text("/robot").text("scan")).text() == "/laser"
        found = code.ask("param_get", Writer().text("/robot/other/rate"))
        assert found.flag()
        assert requests.read_parameter(found) == 5
        assert not code.ask("param_get", Writer().text("/nothing")).flag()
        code.ask("log", Writer().integer(2).text("careful"))

    _run(stage, body)
    assert [(one.severity, one.text) for one in stage.of(Text)] == [(4, "careful")]


def test_a_handler_that_returns_false_is_a_refusal_and_no_failure(stage):
    server, client = Code(stage, "server"), Code(stage, "client")
    empty = to_cdr(new("std_srvs/srv/SetBool_Response"))
    server.returns = Writer().flag(False).raw(empty).done()
    results: list[bool] = []

    def serve() -> None:
        server.ask("init", Writer().text("server").flag(False))
        server.ask("serve", Writer().text("/set").text("std_srvs/srv/SetBool_Request").integer(3).integer(-1))
        server.ask("spin")

    def call() -> None:
        client.ask("init", Writer().text("client").flag(False))
        assert client.ask("wait_for_service", Writer().text("/set").integer(-1)).flag()
        number = client.ask("client", Writer().text("/set").text("std_srvs/srv/SetBool")).integer()
        request = to_cdr(new("std_srvs/srv/SetBool_Request"))
        results.extend(client.ask("call", Writer().integer(number).raw(request)).flag() for _ in range(2))

    stage.kernel.spawn(serve, "server", ExecutionContext("server"))
    _run(stage, call, "client")
    assert results == [False, False]
    assert len(server.called) == 2
