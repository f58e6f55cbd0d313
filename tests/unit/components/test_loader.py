"""A script is a process of its own: what it imports, which function is called, and how it ends."""

from __future__ import annotations

import os
import re
import signal
import sys
import textwrap

import pytest

from volery.base.errors import ComponentError, ModelError, UsageError
from volery.base.time import S
from volery.components.entry_points import EntryPoint, entry_points, find_executable
from volery.components.instance import Allocation, RunningInstance
from volery.components.loader import Loader, ScriptHost, parse
from volery.components.programs import load_program, script_or_class, start
from volery.components.virtual_stdlib import virtual_modules
from volery.cost.instrumentation import StepCounter
from volery.kernel.virtual import VirtualKernel
from volery.ros.client_libraries.library_base import library_module
from volery.ros.messages import Workspace, modules
from volery.trace.events import Failure, Text


class RecordingHost(ScriptHost):
    """Calls what is left when a component ends, as a run does, and keeps it."""

    def __init__(self, kernel):
        self.kernel = kernel
        self.last = []

    def at_end(self, context, last):
        self.last.append(last)

    def leave(self, component):
        for last in reversed(self.last):
            last()

    def kill(self, component):
        self.kernel.cancel(self.kernel.root, "killed")


class Workbench:
    """A folder of files, a kernel to run scripts on, and ``log.tell``, which scripts report to."""

    def __init__(self, folder, steps=None):
        self.folder = folder
        self.events = []
        self.kernel = VirtualKernel(self.events.append)
        self.log = []
        self.host = RecordingHost(self.kernel)
        self.failures = []
        log = library_module("log", {"tell": self.log.append, "__file__": "replaced"})
        rospy = library_module("rospy", {"tell": self.log.append})
        self.loader = Loader(
            {**virtual_modules(self.kernel, 1), **modules(), "log": log, "rospy": rospy, "rospy.msg": log},
            steps,
            host=self.host,
        )

    def write(self, name, text=""):
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(textwrap.dedent(text))
        return path

    def package(self, folder):
        self.write(f"{folder}/package.xml", f"<package><name>{folder.rpartition('/')[2]}</name></package>")

    def start(self, path, name="node", function="", arguments=()):
        program = load_program(self.loader, name, path, "", arguments=arguments, function=function)
        instance = RunningInstance(self.kernel, name, Allocation(priority=0))
        start(instance, program, {}, self.kernel.root, lambda *failure: self.failures.append(failure))
        return instance

    def run(self, path, **how):
        self.start(path, **how)
        self.kernel.run(5 * S)
        if self.failures:
            raise self.failures[0][1]
        return self.log


@pytest.fixture
def bench(tmp_path, monkeypatch):
    for name in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH", "PYTHONPATH"):
        monkeypatch.delenv(name, raising=False)
    return Workbench(tmp_path)


HELPER = "import log, time\ndef hello():\n    log.tell((log.__file__, time.time()))\n"
SEEN = ("replaced", 1_700_000_000.0)
"""What a helper reports that got the replaced modules: the clock of the run among them."""
CALLS = "from tools.helper import hello\nhello()\n"


@pytest.mark.parametrize(
    ("script", "helper"),
    [
        ("ws/src/mine/tools/node.py", "ws/src/mine/tools/helper.py"),
        ("ws/src/mine/scripts/node.py", "ws/src/mine/src/tools/helper.py"),
        ("ws/src/mine/scripts/node.py", "ws/src/tools/tools/helper.py"),
        ("ws/src/mine/scripts/node.py", "ws/src/tools/src/tools/helper.py"),
        ("ws/src/one/mine/scripts/node.py", "ws/src/other/deep/tools/tools/helper.py"),
        ("ws/src/mine/scripts/node.py", "ws/src/mine/scripts/tools/helper.py"),
    ],
    ids=["ament_python", "catkin", "other package", "other catkin package", "whole workspace", "beside"],
)
def test_packages_of_the_workspace_are_imported_with_the_replaced_modules(bench, script, helper):
    path = bench.write(script, CALLS)
    bench.write(helper, HELPER)
    bench.write(f"{helper.rpartition('/')[0]}/__init__.py")
    for file in (script, helper):
        bench.package(file[: file.index("/", file.index("mine" if "mine" in file else "tools"))])
    assert bench.run(path) == [SEEN]


@pytest.mark.parametrize("variable", ["PYTHONPATH", "ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"])
def test_sourced_workspaces_are_imported_with_the_replaced_modules(bench, monkeypatch, variable):
    path = bench.write("node.py", CALLS)
    root = {
        "PYTHONPATH": "ws/lib",
        "ROS_PACKAGE_PATH": "ws/src/deep/tools/src",
        "AMENT_PREFIX_PATH": "ws/lib/python3.12/site-packages",
    }[variable]
    bench.write(f"{root}/tools/__init__.py")
    bench.write(f"{root}/tools/helper.py", HELPER)
    bench.package("ws/src/deep/tools")
    bench.package("ws/share/tools")
    entry = {"PYTHONPATH": "ws/lib", "ROS_PACKAGE_PATH": "ws/src", "AMENT_PREFIX_PATH": "ws"}[variable]
    monkeypatch.setenv(variable, str(bench.folder / entry))
    assert bench.run(path) == [SEEN]


def test_a_folder_that_is_ignored_is_not_searched(bench, monkeypatch):
    bench.package("ws/tools")
    bench.write("ws/tools/tools/__init__.py")
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(bench.folder / "ws"))
    script = bench.folder / "node.py"
    assert Workspace().python_folder("tools", script) == bench.folder / "ws/tools"
    bench.write("ws/tools/CATKIN_IGNORE")
    assert Workspace().python_folder("tools", script) is None


def test_interfaces_that_a_helper_imports_are_defined_and_share_the_name_of_a_package(bench):
    bench.package("ws/src/gauge")
    bench.write("ws/src/gauge/msg/Reading.msg", "float64 value\n")
    bench.write("ws/src/gauge/src/gauge/__init__.py", "UNIT = 'bar'\n")
    bench.write("ws/src/gauge/src/gauge/read.py", "from gauge.msg import Reading\n")
    script = bench.write(
        "ws/src/gauge/scripts/node.py",
        "import gauge.msg, gauge.read, log\n"
        "from gauge.msg import Reading\n"
        "log.tell((gauge.UNIT, gauge.msg.Reading(value=2.0).value, gauge.read.Reading is Reading))\n",
    )
    assert bench.run(script) == [("bar", 2.0, True)]


def test_each_script_has_its_own_copies_of_modules(bench):
    bench.write("state.py", "seen = []\n")
    script = bench.write(
        "node.py", "import log, state\nfrom state import seen\nseen.append(1)\nlog.tell(len(state.seen))\n"
    )
    bench.start(script, "one")
    assert bench.run(script, name="two") == [1, 1]


def test_an_import_may_be_tried(bench):
    bench.write("broken.py", "import nowhere\n")
    text = "import log\ntry:\n    import broken\nexcept ImportError as error:\n    log.tell(error.name)\n"
    assert bench.run(bench.write("node.py", text)) == ["nowhere"]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (
            "import rospy.mesg",
            r"rospy\.mesg is not there on the embedded graph \(did you mean 'rospy\.msg'\?\)",
        ),
        ("from rospy import mesg", r"rospy\.mesg is not there on the embedded graph"),
        ("from px5_msgs.msg import Odometry", "No module named 'px5_msgs': no package of that name defines"),
        ("import tools_of_mine", r"No module named 'tools_of_mine': .*ROS_PACKAGE_PATH"),
        ("import std_msgs.nowhere", r"No module named 'std_msgs\.nowhere'"),
    ],
)
def test_what_cannot_be_imported_is_named_at_the_line_of_the_file_that_imports_it(bench, line, words):
    bench.write("helper.py", f"\n{line}\n")
    script = bench.write("node.py", "import helper\n")
    with pytest.raises(Exception, match=rf"{words}.*\(helper\.py:2\)") as raised:
        bench.run(script)
    assert len(str(raised.value)) < 300


def test_a_library_on_the_python_path_that_knows_no_ros_stays_pythons_own(bench, monkeypatch):
    bench.write("lib/plain_library_of_this_test.py", "import time\nBEGUN = time.time()\n")
    monkeypatch.setenv("PYTHONPATH", str(bench.folder / "lib"))
    monkeypatch.syspath_prepend(bench.folder / "lib")
    text = "import log, plain_library_of_this_test as lib\nlog.tell(lib.BEGUN != 1.7e9)\n"
    assert bench.run(bench.write("node.py", text)) == [True]
    assert bench.loader.libraries == {"plain_library_of_this_test"}


# -- the function that is called

MAIN = "import log\ndef main():\n    log.tell(__name__)\n    return 0\ndef other():\n    log.tell('other')\n"

SETUP = (
    "from setuptools import setup\nname = 'mine'\nsetup(name=name, entry_points={'console_scripts': [%s]})\n"
)


@pytest.mark.parametrize(
    ("file", "text"),
    [
        ("setup.py", SETUP % "'talk = mine.node:main'"),
        ("setup.py", SETUP % "f'talk = {name}.node:main'"),
        ("setup.py", SETUP % "'talk = ' + computed() + '.node:main'"),
        ("setup.py", SETUP % "'talk = {}.node:main'.format(name)"),
        ("setup.py", SETUP % "'%s = mine.node:main' % name"),
        ("setup.cfg", "[options.entry_points]\nconsole_scripts =\n  talk = mine.node:main\n"),
        ("pyproject.toml", "[project.scripts]\ntalk = 'mine.node:main'\n"),
    ],
)
def test_the_function_of_the_entry_point_is_called(bench, file, text):
    bench.write(f"ws/mine/{file}", text)
    bench.write("ws/mine/mine/__init__.py")
    assert bench.run(bench.write("ws/mine/mine/node.py", MAIN)) == ["__main__"]


def test_a_file_that_calls_main_itself_is_not_called_again(bench):
    bench.write("setup.py", SETUP % "'talk = mine.node:main'")
    assert bench.run(bench.write("node.py", f"{MAIN}if __name__ == '__main__':\n    main()\n")) == [
        "__main__"
    ]


def test_the_model_may_name_the_function(bench):
    script = bench.write("node.py", MAIN)
    assert bench.run(script, function="other") == ["other"]
    with pytest.raises(ModelError, match="no function 'mian', which 'main' names"):
        bench.run(script, function="mian")


def test_a_file_that_defines_main_and_calls_nothing_is_an_error(bench):
    with pytest.raises(
        ModelError, match=r"defines main\(\) and calls nothing; state 'main: main'.*setup\.py"
    ):
        bench.run(bench.write("node.py", MAIN))


def test_an_entry_point_of_another_module_of_the_same_name_does_not_count(bench):
    bench.write("setup.py", SETUP % "'talk = mine.one.node:main', 'hear = mine.two.node:other [extra]'")
    for name in ("mine", "mine/one", "mine/two"):
        bench.write(f"{name}/__init__.py")
    assert entry_points(bench.folder)[-1] == EntryPoint("hear", "mine.two.node", "other")
    assert bench.run(bench.write("mine/two/node.py", MAIN)) == ["other"]


def test_a_file_with_a_class_and_an_entry_point_is_a_script(bench):
    script = bench.write("node.py", "class Node: pass\n")
    assert script_or_class(script, "Node") == "Node"
    bench.write("node.py", "class Node: pass\ndef main(): pass\n")
    assert script_or_class(script, "Node") == ""


@pytest.mark.parametrize(
    "text",
    [
        "from rclpy.node import Node\nimport rclpy\nrclpy.init()\n",  # named as an import
        "import rclpy\nclass Node: pass\nrclpy.init(); node = Node(); rclpy.spin(node)\n",
        "import rospy as r\nclass Node: pass\nfor _ in range(1):\n    r.init_node('x')\n",
    ],
)
def test_a_file_whose_top_level_starts_a_node_is_a_script(bench, text):
    assert script_or_class(bench.write("node.py", text), "Node") == ""


def test_a_function_that_the_model_names_is_called_once_and_not_as_main(bench):
    script = bench.write("node.py", f"{MAIN}if __name__ == '__main__':\n    main()\n")
    assert bench.run(script, function="main") == ["node"]


@pytest.mark.parametrize(
    ("files", "name", "expected"),
    [
        ({"setup.py": SETUP % "'talk = mine.node:go'", "mine/node.py": ""}, "talk", ("mine/node.py", "go")),
        ({"scripts/talk": "#!/usr/bin/env python3\n"}, "talk", ("scripts/talk", "")),
        ({"nodes/talk.py": ""}, "talk.py", ("nodes/talk.py", "")),
        ({"nodes/talk.py": ""}, "talk", ("nodes/talk.py", "")),
    ],
    ids=["entry point", "script", "by file name", "without suffix"],
)
def test_a_program_is_found_by_package_and_name(bench, files, name, expected):
    bench.package("src/mine")
    for file, text in files.items():
        bench.write(f"src/mine/{file}", text).chmod(0o755)
    found = find_executable(Workspace(bench.folder), "mine", name, bench.folder / "model.yaml")
    assert (str(found.file.relative_to(bench.folder / "src/mine")), found.function) == expected


def test_a_program_is_found_where_it_is_installed(bench, monkeypatch):
    bench.package("install/share/mine")
    lib = "install/lib/python3.12/site-packages"
    bench.write(f"{lib}/mine-0.1.egg-info/entry_points.txt", "[console_scripts]\nTalk = mine.node:go\n")
    bench.write(f"{lib}/mine/node.py")
    bench.write("install/lib/mine/hear", "#!/usr/bin/python3\n").chmod(0o755)
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(bench.folder / "install"))
    near = bench.folder / "elsewhere/model.yaml"
    assert find_executable(Workspace(), "mine", "Talk", near) == (bench.folder / lib / "mine/node.py", "go")
    assert find_executable(Workspace(), "mine", "hear", near).file == bench.folder / "install/lib/mine/hear"
    with pytest.raises(UsageError, match="package mine has no executable 'talk'; there is Talk or hear"):
        find_executable(Workspace(), "mine", "talk", near)
    with pytest.raises(UsageError, match=r"no package 'mien' \(did you mean 'mine'\?\) beside the model"):
        find_executable(Workspace(), "mien", "talk", near)


def test_functions_of_counted_scripts_are_counted(bench):
    counted = Workbench(bench.folder, StepCounter())
    bench.write("setup.py", SETUP % "'talk = mine.node:main'")
    text = "import log\nfrom helper import total\ndef main():\n    log.tell(total(range(3)))\n"
    bench.write(
        "helper.py",
        "def total(them):\n    found = 0\n    for one in them:\n        found += one\n    return found\n",
    )
    assert counted.run(bench.write("node.py", text)) == [3]


# -- a process of its own


def test_arguments_are_those_of_the_component(bench):
    text = """
        import argparse, log, sys
        from os import path
        parser = argparse.ArgumentParser()
        parser.add_argument("--rate", type=float)
        parser.add_argument("places", nargs="*")
        given = parser.parse_args()
        log.tell((path.basename(sys.argv[0]), sys.argv[1:], given.rate, given.places, parser.prog))
        """
    found = bench.run(bench.write("node.py", text), arguments=("--rate", "2", "a", "b"))
    assert found == [("node.py", ["--rate", "2", "a", "b"], 2.0, ["a", "b"], "node.py")]


def test_wrong_arguments_end_the_component_with_the_status_of_argparse(bench):
    script = bench.write("node.py", "import argparse\nargparse.ArgumentParser(prog='n').parse_args()\n")
    with pytest.raises(ComponentError, match=r"node: ended with exit status 2 \(node\.py:2\)"):
        bench.run(script, arguments=("--what",))
    printed = [event.text for event in bench.events if isinstance(event, Text)]
    assert printed == ["usage: n [-h]", "n: error: unrecognized arguments: --what"]


@pytest.mark.parametrize(
    ("end", "reported"),
    [
        ("sys.exit()", None),
        ("sys.exit(0)", None),
        ("exit(0)", None),
        ("os._exit(0)", None),
        ("sys.exit(3)", r"node: ended with exit status 3 \(node\.py:6\)"),
        ("sys.exit('no link')", r"node: ended with exit status 1: no link \(node\.py:6\)"),
        ("os._exit(4)", "node: ended with exit status 4"),
        ("os.kill(os.getpid(), 15)", "node: ended with exit status 143"),
        ("return 5", r"node: ended with exit status 5"),
    ],
)
def test_the_exit_status_decides_whether_it_has_failed(bench, end, reported):
    text = f"""
        import log, os, sys, time
        def main():
            time.sleep(1)
            log.tell("once")
            {end}
        """
    script = bench.write("node.py", textwrap.dedent(text).lstrip("\n").replace("import", "\nimport", 1))
    bench.start(script, function="main")
    bench.kernel.run(5 * S)
    assert bench.log == ["once"]
    assert bool(bench.failures) == bool(reported)
    if reported:
        assert re.fullmatch(reported, str(bench.failures[0][1]))


@pytest.mark.parametrize(
    ("words", "shown"),
    [
        ("'no link'", "no link"),
        ("'\\udc80'", r"\\udc80"),
        ("1 / 0", r"\(its __str__ raised ZeroDivisionError\)"),
    ],
)
@pytest.mark.parametrize("base", ["Exception", "BaseException"])
def test_an_error_that_makes_its_own_text_is_reported(bench, base, words, shown):
    counted = Workbench(bench.folder, StepCounter())
    text = f"class Lost({base}):\n    def __str__(self):\n        return {words}\nraise Lost\n"
    counted.start(counted.write("node.py", text))
    counted.kernel.run(S)
    assert re.fullmatch(rf"node: run raised Lost: {shown} \(node\.py:4\)", str(counted.failures[0][1]))
    assert [event.who for event in counted.events if isinstance(event, Failure)] == ["node"]


def test_the_end_waits_for_threads_and_then_calls_what_is_left(bench):
    text = """
        import atexit, log, sys, threading, time
        atexit.register(log.tell, "last")
        atexit.register(lambda: log.tell(time.time() - 1.7e9))
        def work(seconds):
            time.sleep(seconds)
            log.tell(seconds)
            sys.exit(9)
        threading.Thread(target=work, args=(2,)).start()
        threading.Thread(target=work, args=(3,), daemon=True).start()
        sys.stdout.write("begun")
        """
    bench.start(bench.write("node.py", text))
    bench.kernel.run(2 * S + 1)
    assert (bench.log, bench.failures) == ([2, 2.0, "last"], [])
    assert [event.text for event in bench.events if isinstance(event, Text)] == ["begun"]


def test_signals_reach_their_handlers(bench):
    text = """
        import log, os, signal
        log.tell(signal.signal(signal.SIGINT, lambda number, frame: log.tell(signal.Signals(number).name)))
        os.kill(os.getpid(), signal.SIGINT)
        try:
            signal.alarm(3)
        except Exception as error:
            log.tell(str(error)[:29])
        """
    bench.run(bench.write("node.py", text))
    assert bench.log == [signal.SIG_DFL, "SIGINT", "signal.alarm is not available"]
    for last in reversed(bench.host.last):
        last()
    assert len(bench.log) == 3  # its process is over: no signal reaches it


def test_another_process_is_refused_when_it_is_made(bench):
    text = """
        import multiprocessing
        class Worker(multiprocessing.Process):
            pass
        Worker()
        """
    with pytest.raises(UsageError, match=r"Worker of multiprocessing is not available .*use threading"):
        bench.run(bench.write("node.py", text))


def test_a_process_changes_nothing_of_the_run(bench):
    before = (list(sys.argv), list(sys.path), dict(os.environ))
    text = """
        import importlib, os, sys, log
        sys.argv.append("x"); sys.path.insert(0, "here"); os.environ["X_OF_NODE"] = "1"
        sys.modules["made_up"] = log
        log.tell(importlib.import_module("helper").NAME)
        log.tell(sys.modules[importlib.import_module("helper").__name__].NAME)
        """
    bench.write("helper.py", "NAME = 'found'\n")
    assert bench.run(bench.write("node.py", text)) == ["found", "found"]
    assert (list(sys.argv), list(sys.path), dict(os.environ)) == before
    assert "made_up" not in sys.modules


# -- Python 2


@pytest.mark.parametrize(
    ("line", "name"),
    [
        ("print 'x'", "a print statement"),
        ("print x", "a print statement"),
        ("exec 'x'", "an exec statement"),
        ("try:\n    pass\nexcept ValueError, e:\n    pass", "'except A, e'"),
        ("x = 1 <> 2", "the operator <>"),
        ("x = `1`", "a backtick"),
        ("raise ValueError, 'x'", "'raise A, text'"),
        ("x = 0777", "a number as Python 2 writes it"),
        ("x = 10L", "a number as Python 2 writes it"),
    ],
)
def test_python_2_is_refused_by_name(bench, line, name):
    script = bench.write("node.py", f"x = 0\n{line}\n")
    at = 4 if line.startswith("try") else 2
    with pytest.raises(ModelError) as raised:
        parse(script)
    assert str(raised.value).endswith(f"node.py:{at}: Python 2: line {at} is {name}; convert it with 2to3")


@pytest.mark.parametrize(
    "source", [b"\xef\xbb\xbfx = 'caf\xc3\xa9'\r\n", b"# -*- coding: latin-1 -*-\nx = 'caf\xe9'\n"]
)
def test_a_file_has_the_encoding_that_python_reads(bench, source):
    script = bench.write("node.py", "")
    script.write_bytes(source)
    assert parse(script).tree.body[0].value.value == "caf\xe9"


def test_a_file_without_its_encoding_names_the_line(bench):
    script = bench.write("node.py", "")
    script.write_bytes(b"x = 'caf\xe9'\n")
    with pytest.raises(ModelError, match=r"node\.py:1: not Python: .*'utf-8' codec"):
        parse(script)


def test_another_mistake_is_no_python_2(bench):
    with pytest.raises(ModelError, match=r"node\.py:1: not Python: invalid syntax"):
        parse(bench.write("node.py", "x = = 1\n"))
