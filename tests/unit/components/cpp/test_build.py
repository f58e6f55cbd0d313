"""C++ components without a compiler: generated text, sources, crashes, counters."""

from __future__ import annotations

import ctypes
import os
from pathlib import Path

import pytest

from volery.base.errors import ModelError, UsageError
from volery.base.position import AboveHome, Position
from volery.components.cpp import build, compiler
from volery.components.cpp.build import CppPort, cpp_type, glue, interfaces_header, operation, operations
from volery.components.cpp.framework import Crash, StepMeter, read_crash
from volery.components.cpp.sources import executables, find_sources
from volery.components.entry_points import find_executable
from volery.model.components import Argument, Interface, Signature
from volery.ros.client_libraries.abi_codec import Reader, Writer
from volery.ros.messages.workspace import Package, Workspace

ROUTING = Interface(
    "Routing",
    {
        "route": Signature("route", (Argument("goal", "Position"), Argument("by", "str")), "Position[]"),
        "forget": Signature("forget"),
    },
)


def test_an_interface_becomes_an_abstract_class():
    text = interfaces_header([ROUTING])
    assert "class Routing {" in text
    taken = "const volery::Position& goal, const std::string& by"
    assert f"virtual std::vector<volery::Position> route({taken}) = 0;" in text
    assert "virtual void forget() = 0;" in text


def test_the_glue_constructs_from_ports_and_serves_operations():
    requires = [CppPort("routes", "Routing"), CppPort("drones", "Drone", many=True)]
    text = glue("Planner", Path("/there/planner.cpp"), requires, operations(ROUTING), {"Routing": ROUTING})
    assert '#include "/there/planner.cpp"' in text
    assert "class Routing_port final : public Routing, public volery::Port {" in text
    assert 'volery::one<Routing, Routing_port>("routes")' in text
    assert 'volery::many<I_RosDron, I_RosDron>("drones")' in text
    assert "check_constructor<Planner, Routing&, const std::vector<I_RosDron*>&>" in text
    assert "volery::OPERATIONS + 1" in text


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ("bool", True),
        ("int", -(2**40)),
        ("float", 0.1),
        ("str", "schön"),
        ("bytes", b"\0\1"),
        ("Position", Position(1.0, -2.0, AboveHome(3.0))),
        ("str[]", ["a", "", "bc"]),
        ("int[][]", [[1], [], [2, 3]]),
    ],
)
def test_values_are_encoded_and_decoded_unchanged(written, value):
    kind = cpp_type(written, "here")
    out = Writer()
    kind.write(out, value)
    assert kind.read(Reader(out.done())) == value


def test_a_type_without_a_cpp_counterpart_is_named_with_its_place():
    with pytest.raises(ModelError, match=r"interfaces\.Shop\.order\.returns.*no 'Receipt'.*Position"):
        operation("Shop", Signature("order", (), "Receipt"))


def test_sources_of_a_file_and_of_a_folder(tmp_path):
    (tmp_path / "node.cpp").write_text('#include <ros/ros.h>\n#include "robot/arm.h"\nint main() {}\n')
    (tmp_path / "other.cc").write_text("// int main()\nstruct Arm : Base { };\n")
    (tmp_path / "robot").mkdir()
    (tmp_path / "robot" / "arm.h").write_text("class Hand;\nclass Hand final : public Base<int> {\n};\n")
    one = find_sources(tmp_path / "node.cpp")
    assert [file.name for file in one.compiled] == ["node.cpp"]
    assert one.included == ("ros/ros.h", "robot/arm.h")
    assert one.defines_main()
    assert not find_sources(tmp_path / "other.cc").defines_main()
    every = find_sources(tmp_path)
    assert [file.name for file in every.compiled] == ["node.cpp", "other.cc"]
    assert every.file_of_class("Hand") == (tmp_path / "robot" / "arm.h").resolve()
    assert every.file_of_class("Arm") == (tmp_path / "other.cc").resolve()
    assert every.file_of_class("Foot") is None


def test_what_a_package_builds_with_a_file_belongs_to_it(tmp_path, monkeypatch):
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "others"))
    files = {
        "arm/package.xml": "<package><name>arm</name></package>",
        "arm/CMakeLists.txt": """
            project(arm)
            add_library(${PROJECT_NAME}_core src/core.cpp) # src/unused.cpp
            add_executable(node src/node.cpp "${PROJECT_SOURCE_DIR}/src/more.cpp")
            target_link_libraries(node ${PROJECT_NAME}_core ${catkin_LIBRARIES})
            add_executable(other src/other.cpp)
        """,
        "arm/src/node.cpp": '#include "arm/arm.hpp"\n#include <hand/hand.h>\nint main() {}',
        **{f"arm/src/{name}.cpp": "" for name in ("core", "more", "other", "unused")},
        "arm/include/arm/arm.hpp": "#include <std_msgs/String.h>",
        "others/hand/package.xml": "<package><name>hand</name></package>",
        "others/hand/include/hand/hand.h": '#include "finger.h"',
        "others/hand/include/hand/finger.h": "#include <mavros_msgs/CommandTOL.h>",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    found = find_sources(tmp_path / "arm/src/node.cpp")
    assert [file.name for file in found.compiled] == ["node.cpp", "more.cpp", "core.cpp"]
    assert {"std_msgs/String.h", "mavros_msgs/CommandTOL.h"} <= set(found.included)
    assert found.found == {"arm/arm.hpp", "hand/hand.h", "finger.h"}
    assert list(found.folders) == [tmp_path / "arm/include", tmp_path / "others/hand/include"]
    programs = {"node": tmp_path / "arm/src/node.cpp", "test": tmp_path / "arm/src/test.cpp"}
    (tmp_path / "arm/src/test.cpp").write_text("int main() {}")
    assert executables(Package("arm", tmp_path / "arm")) == programs
    near = tmp_path / "model.yaml"
    assert find_executable(Workspace(tmp_path), "arm", "node", near, cpp=True) == (programs["node"], "")
    with pytest.raises(UsageError, match=r"have no C\+\+ executable 'nod' .*'node'.*; there is node or test"):
        find_executable(Workspace(tmp_path), "arm", "nod", near, cpp=True)


def test_a_folder_without_sources(tmp_path):
    with pytest.raises(ModelError, match="no source file"):
        find_sources(tmp_path)


def test_a_class_that_no_file_defines(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "a.cpp").write_text("struct Other {};")
    component = build.CppComponent("Thing", tmp_path / "a.cpp", "Thing")
    with pytest.raises(ModelError, match=r"Thing: no class 'Thing' in a\.cpp"):
        build._translation_units(component, find_sources(component.path))


def _report(line: str) -> Crash | None:
    ours, theirs = os.pipe()
    os.write(theirs, line.encode())
    os.close(theirs)
    try:
        return read_crash(ours, {})
    finally:
        os.close(ours)


def test_description_of_a_crash():
    crash = _report("pilot\t11\t(nil)\t12 34 \tterminating \n")
    assert crash is not None
    assert str(crash.error()) == "pilot: segmentation fault at address 0; it said: terminating"
    full = _report("pilot\tstack\t0x7f00\t\t\n")
    assert full is not None
    assert "its stack is full" in full.what
    assert _report("") is None


def test_a_meter_returns_the_steps_since_the_last_reading():
    counters = (ctypes.c_uint64 * 2)(5, 0)
    meter = StepMeter()
    assert meter() == 0
    meter.read_from(counters, lambda counts: 3 * counts[0] + counts[1])
    assert meter() == 0
    counters[0], counters[1] = 7, 1
    assert meter() == 7
    assert meter() == 0


def test_a_cache_that_cannot_be_made(monkeypatch, tmp_path):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    with pytest.raises(Exception, match="set XDG_CACHE_HOME to a folder of yours"):
        compiler.cache_folder()
