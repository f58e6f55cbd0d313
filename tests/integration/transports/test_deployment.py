"""What ``volery ros deploy`` writes is built and started by the tools of ROS, and delivers the parcel."""

from __future__ import annotations

import ast
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from rigs.requirements import lacking
from volery.deploy.generation import Deployment, deploy
from volery.model.system_loader import load
from volery.ros.messages import define_all, ros1_service
from volery.ros.transports.ros1 import Roscore, available
from volery.run.assembly.model_checks import vocabulary
from volery.run.distributed.call_types import call_types

from .conftest import python_of, surroundings

pytestmark = [pytest.mark.integration, pytest.mark.timeout(1000)]

DELIVERY = Path(__file__).parents[3] / "examples" / "delivery"
LIMIT_S = 400
LEAVE_S = 150
"""Longest time until the components have ended after their run."""
SETTINGS = ("--seed", "7", "--speed", "1.5", "--set", "run.duration=300s")


def deployed(folder: Path, ros: int) -> Deployment:
    return deploy(load(DELIVERY, vocabulary(), scenario="pocket"), folder, ros)


def assert_delivered(folder: Path, said: str) -> None:
    assert (folder / "run.json").exists(), said
    record: dict[str, Any] = json.loads((folder / "run.json").read_text())
    assert record["outcome"]["status"] == "completed", said
    assert record["notes"]["parcel"]["parcel-1"]["state"] == "delivered", said
    assert record["outcome"]["requirements_met"], record["requirements"]
    assert all(vehicle["landed"] for vehicle in record["vehicles"].values())
    assert not record["failures"]
    assert any("landing_offset_1' is not judged" in one for one in record["warnings"])


def run(command: list[str], env: Mapping[str, str], cwd: Path) -> str:
    """Run *command* in a session of its own, which ends with it."""
    process = subprocess.Popen(
        command, env=env, cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        start_new_session=True,
    )  # fmt: skip
    try:
        said, _ = process.communicate(timeout=LIMIT_S)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == 0, said
    return said


def built_by_catkin(tmp_path: Path) -> tuple[Deployment, Path, dict[str, str], int]:
    """The packages in a workspace that catkin has built, the environment of programs, the master's port."""
    if not available() or not all(map(shutil.which, ("roslaunch", "catkin_make"))):
        lacking("no rospy, roslaunch or catkin_make here (scripts/debian-packages ros1)")
    made = deployed(tmp_path / "ws" / "src", 1)
    with socket.socket() as asked:
        asked.bind(("127.0.0.1", 0))
        port = asked.getsockname()[1]
    leaked = ("ROS_PACKAGE_PATH", "CMAKE_PREFIX_PATH", "VIRTUAL_ENV")
    env = {key: value for key, value in os.environ.items() if key not in leaked}
    env |= {"ROS_MASTER_URI": f"http://127.0.0.1:{port}", "ROS_IP": "127.0.0.1", "ROS_HOME": str(tmp_path)}
    env["ROS_LANG_DISABLE"] = "gencpp:geneus:genlisp:gennodejs"  # only Python; the others need empy
    workspace = tmp_path / "ws"
    built = ["catkin_make", "-C", str(workspace), f"-DPYTHON_EXECUTABLE={sys.executable}"]
    run(built, env, workspace)
    return made, workspace, env, port


def started_by_roslaunch(built: tuple[Deployment, Path, dict[str, str], int], *options: str) -> str:
    """What roslaunch says of the whole system, which runs to its end."""
    made, workspace, env, port = built
    start = f"roslaunch -p {port} {made.verification} {made.verification}.launch"
    debian = "export ROS_PACKAGE_PATH=$ROS_PACKAGE_PATH:/usr/share"
    return run(
        ["bash", "-c", f". devel/setup.bash && {debian} && exec {start} options:='{' '.join(options)}'"],
        env,
        workspace,
    )


def test_catkin_builds_it_and_roslaunch_starts_it(tmp_path: Path) -> None:
    built = built_by_catkin(tmp_path)
    assert_types_are_those_of_the_build(built[1], built[0].interfaces)
    settings = ("--seed", "7", "--speed", "1.5", "--set", "run.duration=4s", "--out", str(tmp_path / "out"))
    said = started_by_roslaunch(built, *settings)
    record = json.loads((tmp_path / "out" / "run.json").read_text())
    assert record["notes"]["parcel"]["parcel-1"]["history"][0]["state"] == "ordered", said
    assert not record["failures"]
    assert "process has finished cleanly" in said


@pytest.mark.long  # minutes of ten processes: as a deployment it delivers on ROS 2
def test_roslaunch_delivers_the_parcel(tmp_path: Path) -> None:
    settings = (*SETTINGS, "--out", str(tmp_path / "out"))
    assert_delivered(tmp_path / "out", started_by_roslaunch(built_by_catkin(tmp_path), *settings))


def assert_types_are_those_of_the_build(workspace: Path, package: str) -> None:
    """What genpy has generated has the checksums of the services that the hosts serve."""
    define_all(call_types(load(DELIVERY, vocabulary())).definitions)
    [generated] = workspace.glob(f"devel/lib/python3*/dist-packages/{package}/srv")
    found = {}
    for file in generated.glob("_[A-Z]*.py"):
        checksum = re.findall(r"_md5sum *= *'([0-9a-f]{32})'", file.read_text())
        found[file.stem[1:]] = checksum[-1]
    assert len(found) == 10
    assert found == {name: ros1_service(f"{package}/srv/{name}").md5 for name in found}


CPP_MODEL = """
volery: 1
name: pair
interfaces: {Echo: {say: {args: {words: str, times: int}, returns: str}}}
components:
  Asker: {language: c++, path: asker.cpp, requires: {other: Echo}, active: true}
  Echoer: {language: c++, path: echoer.cpp, provides: {voice: Echo}}
application: {asker: {is: Asker, other: echoer.voice}, echoer: {is: Echoer}}
platform: {processors: {pc: {is: intel-i5-3470, frequency: 3000 MHz}}}
allocations: {all: {asker: pc, echoer: pc}}
"""
CPP_ASKER = """
#include <iostream>
#include "volery/interfaces.h"

class Asker {
public:
    explicit Asker(Echo& other) : other_(other) {}
    void run() { std::cout << "the answer is " << other_.say("ab", 3) << std::endl; }

private:
    Echo& other_;
};
"""
CPP_ECHOER = """
#include "volery/interfaces.h"

class Echoer : public Echo {
public:
    std::string say(const std::string& words, std::int64_t times) override {
        std::string all;
        for (std::int64_t one = 0; one < times; ++one) all += words;
        return all;
    }
};
"""


def test_hosts_compile_components_in_cpp_and_they_call_each_other(tmp_path: Path, roscore: Roscore) -> None:
    (tmp_path / "model").mkdir()
    for name, text in (("model.yaml", CPP_MODEL), ("asker.cpp", CPP_ASKER), ("echoer.cpp", CPP_ECHOER)):
        (tmp_path / "model" / name).write_text(text)
    made = deploy(load(tmp_path / "model", vocabulary()), tmp_path / "out", 1)
    scripts = made.folder / made.packages["pc"] / "scripts"
    env = {**os.environ, "ROS_MASTER_URI": roscore.uri, "ROS_IP": "127.0.0.1"}
    reading, writing = os.pipe()
    started = [
        subprocess.Popen([sys.executable, scripts / name], env=env, stdout=writing, stderr=writing)
        for name in ("echoer", "asker")
    ]
    os.close(writing)
    try:
        with os.fdopen(reading, encoding="utf-8") as said:
            for line in said:
                assert "volery:" not in line, line
                if "the answer is ababab" in line:
                    break
            for process in started:
                process.terminate()
            assert [process.wait(LEAVE_S) for process in started] == [0, 0]
    finally:
        for process in started:
            process.kill()
            process.wait()


def test_pip_installs_it_and_the_entry_points_deliver_the_parcel_on_ros_2(tmp_path: Path) -> None:
    """`ros2 launch` cannot be had from PyPI: what the launch files name is started here one by one."""
    made = deployed(tmp_path / "src", 2)
    with started_on_ros_2(made, tmp_path) as (installed, env, started):
        assert len(started) == 9
        said = run([str(installed / "bin" / "world"), *SETTINGS, "--out", "out"], env, tmp_path)
        assert_all_end(started)
        assert_delivered(tmp_path / "out", said + "".join(map(complaints_of, started)))


@contextmanager
def started_on_ros_2(
    made: Deployment, folder: Path
) -> Iterator[tuple[Path, dict[str, str], list[subprocess.Popen[str]]]]:
    """The packages installed, with the environment for their programs, and the components of a simulation."""
    python, installed = python_of("jazzy"), folder / "installed"
    packages = [str(made.folder / one) for one in (*made.packages.values(), made.verification)]
    pip = [python, "-m", "pip", "install", "-q", "--disable-pip-version-check", "--no-deps"]
    tools = {**os.environ, "PYTHONPATH": str(folder / "tools")}  # once, not for each package
    run([*pip, "--target", tools["PYTHONPATH"], "setuptools>=70.1"], os.environ, folder)
    run([*pip, "--no-build-isolation", "--prefix", str(installed), *packages], tools, folder)
    [site] = installed.glob("lib/python*/site-packages")
    env = {**surroundings(), "PYTHONPATH": str(site), "PYTHONFAULTHANDLER": "1"}
    started: list[subprocess.Popen[str]] = []
    try:
        for package in made.packages.values():
            for executable, parameters in launched(installed / "share" / package, package):
                command = [installed / "bin" / executable, "--parameters", parameters, "--simulated", "true"]
                started.append(subprocess.Popen(command, env=env, stderr=subprocess.PIPE, text=True))
        yield installed, env, started
    finally:
        for process in started:
            process.kill()
            process.wait()
            assert process.stderr is not None
            process.stderr.close()  # it may have been read to its end


def complaints_of(process: subprocess.Popen[str]) -> str:
    """What a process that has ended wrote to standard error."""
    assert process.stderr is not None
    return f"\n{process.args}: {process.stderr.read()}"


def assert_all_end(started: list[subprocess.Popen[str]]) -> None:
    """All processes end with status 0; the stacks of one that does not are in the message."""
    end = time.monotonic() + LEAVE_S
    for process in started:
        try:
            assert process.wait(max(0.0, end - time.monotonic())) == 0, process.communicate()[1]
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGABRT)  # the fault handler prints where each thread is
            pytest.fail(f"{process.args}: {process.communicate()[1]}")


def launched(share: Path, package: str) -> list[tuple[str, Path]]:
    """The executables and parameter files of the hosts in an installed launch file."""
    [tree] = [ast.parse(file.read_text()) for file in share.glob("launch/*.launch.py")]
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Node":
            keywords = {one.arg: one.value for one in node.keywords}
            if "condition" not in keywords:  # only in reality
                assert ast.literal_eval(keywords["package"]) == package
                executable = ast.literal_eval(keywords["executable"])
                found.append((executable, share / "config" / f"{executable}.yaml"))
                assert found[-1][1].is_file()
    return found


PAIR = """
volery: 1
name: pair
interfaces: {Echo: {say: {args: {words: Words}, returns: Words}}}
components:
  Speaker: {language: python, path: speaker.py, requires: {other: Echo}, parameters: {text: a}, active: true}
  Echoer: {language: python, path: echoer.py, provides: {voice: Echo}}
application: {speaker: {is: Speaker, other: echoer.voice}, echoer: {is: Echoer}}
platform: {processors: {pc: {is: intel-i5-3470, frequency: 3000 MHz}}}
allocations: {all: {speaker: pc, echoer: pc}}
"""
WORDS = """
from dataclasses import dataclass

@dataclass(frozen=True)
class Words:
    text: str
"""
SPEAKER = """
import sys
import volery
from words import Words

class Speaker:
    def __init__(self, other, text):
        self._other, self._text = other, text

    def run(self):
        print(self._other.say(Words(self._text)).text, flush=True)
        volery.sleep(3600)
"""
ECHOER = """
from words import Words

class Echoer:
    def say(self, words):
        return Words(words.text.upper())
"""


def pair(folder: Path) -> Path:
    folder.mkdir()
    for name, text in (
        ("model.yaml", PAIR),
        ("words.py", WORDS),
        ("speaker.py", SPEAKER),
        ("echoer.py", ECHOER),
    ):
        (folder / name).write_text(text)
    return folder


@contextmanager
def killed_after(seconds: float, process: subprocess.Popen[str]) -> Iterator[None]:
    timer = threading.Timer(seconds, process.kill)
    timer.start()
    yield
    timer.cancel()


def test_components_end_when_their_run_was_killed(tmp_path: Path) -> None:
    made = deploy(load(pair(tmp_path / "model"), vocabulary()), tmp_path / "src", 2)
    with started_on_ros_2(made, tmp_path) as (installed, env, started):
        command = [installed / "bin" / "world", "--out", "out"]
        world = subprocess.Popen(command, env=env, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
        try:
            [speaker] = [one for one in started if "speaker" in str(one.args)]
            assert speaker.stderr is not None
            with killed_after(LEAVE_S, speaker):
                said = speaker.stderr.readline()
        finally:
            world.kill()
            complained = world.communicate()[1]
        assert said == "A\n", complained
        assert_all_end(started)


def test_in_reality_a_component_waits_for_its_services_and_ends_with_sigterm(roscore, tmp_path):
    model = pair(tmp_path / "model")
    made = deploy(load(model, vocabulary()), tmp_path / "out", 1)
    package = made.folder / made.packages["pc"]
    (package / "config" / "speaker.yaml").write_text("text: good morning\n")
    env = {**os.environ, "ROS_MASTER_URI": roscore.uri}

    def host(name):
        command = [
            sys.executable,
            package / "scripts" / name,
            "--parameters",
            package / "config" / f"{name}.yaml",
        ]
        return subprocess.Popen(command, env=env, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)

    speaker = host("speaker")
    echoer = host("echoer")
    try:
        said = next(line for line in speaker.stdout if "waits for" not in line)
        assert said == "GOOD MORNING\n"
        for process in (speaker, echoer):
            process.send_signal(signal.SIGTERM)
        assert [process.wait(LEAVE_S) for process in (speaker, echoer)] == [0, 0]
    finally:
        for process in (speaker, echoer):
            process.kill()
            process.communicate()
