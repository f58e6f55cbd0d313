"""Packages for computers: what is in them, what may not be overwritten, what cannot be deployed."""

from __future__ import annotations

import ast
import errno
import json
import os
import re
import subprocess
from pathlib import Path

import pytest
from lxml import etree

from volery.base.errors import UsageError
from volery.base.files import write_text
from volery.deploy import generation
from volery.deploy.generation import MARK, deploy
from volery.model.system_loader import load
from volery.run.assembly.component_builder import with_executables
from volery.run.assembly.model_checks import vocabulary
from volery.run.distributed.call_types import package_name

DELIVERY = Path(__file__).parents[3] / "examples" / "delivery"


@pytest.fixture(scope="module")
def delivery():
    return load(DELIVERY, vocabulary(), allocation="slow", scenario="pocket")


@pytest.mark.parametrize("ros", [1, 2])
def test_each_computer_gets_what_it_executes(delivery, tmp_path, ros):
    made = deploy(delivery, tmp_path / "out", ros)
    assert list(made.packages) == [one.name for one in delivery.processors]
    package = made.folder / made.packages["onboard_1"]
    assert etree.parse(package / "package.xml").findtext("name") == "hospital_delivery_onboard_1"
    code = package / ("scripts" if ros == 1 else package.name)
    for name in ("drone_control_1", "landing_1", "vehicle_drone_1"):
        text = (code / (name if ros == 1 else f"{name}.py")).read_text()
        ast.parse(text)
    assert (
        "allocation='slow', scenario='pocket'"
        in (code / ("landing_1" if ros == 1 else "landing_1.py")).read_text()
    )
    assert "autopilot_drone_1" in (package / "udev" / f"99-{package.name}.rules").read_text()
    unit = (package / "systemd" / f"{package.name}.service").read_text()
    assert f"{package.name}.launch" in unit
    assert '"pad_east_m": -3' in (package / "config" / "drone_control_1.yaml").read_text()
    assert str(DELIVERY) not in "".join(
        file.read_text() for file in made.folder.rglob("*") if file.is_file() and "model" not in file.parts
    )
    for launch in made.folder.rglob("*.launch"):
        etree.parse(launch)
    for launch in made.folder.rglob("*.launch.py"):
        ast.parse(launch.read_text())


def test_components_are_unmodified_and_the_copied_model_is_the_model(delivery, tmp_path):
    made = deploy(delivery, tmp_path / "out", 1)
    model = made.folder / made.packages["onboard_1"] / "model"
    for file in ("components/drone_control.py", "components/delivery_types.py", "model.yaml", "pocket.yaml"):
        assert (model / file).read_bytes() == (DELIVERY / file).read_bytes()
    again = load(model, vocabulary(), allocation="slow", scenario="pocket")
    assert [one.parameters for one in again.instances] == [one.parameters for one in delivery.instances]


def in_a_workspace(folder):
    """A workspace with two packages, of which a model runs one's program and a file that uses the other."""
    texts = {
        "talker/package.xml": "<package><name>talker</name></package>",
        "talker/scripts/talk": "#!/usr/bin/env python3\nimport rospy\n",
        "words/package.xml": "<package><name>words</name></package>",
        "words/src/words/__init__.py": "",
        "model/beside.py": "import rospy\nfrom words import all_of_them\nimport json\n",
        "model/model.yaml": """
volery: 1
name: two
components:
  Talker: {language: rospy, package: talker, executable: talk, active: true}
  Beside: {language: rospy, path: beside.py, active: true}
application: {talker: {is: Talker}, beside: {is: Beside}}
platform: {processors: {pc: {is: intel-i5-3470, frequency: 3000 MHz}}}
allocations: {all: {talker: pc, beside: pc}}
""",
    }
    for name, text in texts.items():
        file = folder / "src" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        write_text(file, text)
    (folder / "src/talker/scripts/talk").chmod(0o755)
    return with_executables(load(folder / "src" / "model", vocabulary()))


@pytest.mark.parametrize("ros", [1, 2])
def test_packages_of_a_workspace_are_depended_on_and_named(tmp_path, monkeypatch, ros):
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "src"))
    made = deploy(in_a_workspace(tmp_path), tmp_path / "out", ros)
    package = made.folder / made.packages["pc"]
    depends = {one.text for one in etree.parse(package / "package.xml").iterfind("exec_depend")}
    assert {"talker", "words"} <= depends
    assert "are in `talker`, `words`" in (made.folder / "README.md").read_text()
    assert [one.name for one in package.rglob("*.py") if "model" in one.parts] == ["beside.py"]
    assert not list(package.rglob("talk"))
    entry = package / ("scripts/talker" if ros == 1 else f"{package.name}/talker.py")
    assert "unmodified talker/talk" in entry.read_text()


def test_a_deployment_replaces_an_earlier_one_and_nothing_else(delivery, tmp_path):
    folder = tmp_path / "out"
    made = deploy(delivery, folder, 1)
    stale = folder / made.packages["ground"] / "stale"
    stale.touch()
    (folder / "notes.txt").write_text("mine")
    deploy(delivery, folder, 2)
    assert not stale.exists()
    assert (folder / "notes.txt").read_text() == "mine"
    (folder / MARK).unlink()
    with pytest.raises(UsageError, match="holds something that no deployment wrote"):
        deploy(delivery, folder, 2)
    file = tmp_path / "file"
    file.touch()
    with pytest.raises(UsageError, match="is not a folder"):
        deploy(delivery, file, 2)


def test_a_mark_cannot_point_outside_the_folder(delivery, tmp_path):
    outside = tmp_path / "outside"
    outside.mkdir()
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / MARK).write_text("../outside\n..\n/etc\n")
    deploy(delivery, folder, 2)
    assert outside.is_dir()


@pytest.mark.parametrize("link", [MARK, "README.md", "hospital_delivery_ground", "."])
def test_nothing_is_written_through_a_symbolic_link(delivery, tmp_path, link):
    victim = tmp_path / "victim"
    folder = tmp_path / "out"
    if link in (MARK, "README.md"):
        victim.write_text("theirs")
    else:
        victim.mkdir()
        (victim / "package.xml").write_text("theirs")
    if link == ".":
        folder.symlink_to(victim)
    else:
        folder.mkdir()
        (folder / MARK).write_text("hospital_delivery_ground\n")
        (folder / link).unlink(missing_ok=True)
        (folder / link).symlink_to(victim)
    if link in (MARK, "."):
        with pytest.raises(UsageError, match=r"symbolic link|no deployment wrote"):
            deploy(delivery, folder, 2)
    else:
        deploy(delivery, folder, 2)
        assert not (folder / link).is_symlink()
    theirs = victim if victim.is_file() else victim / "package.xml"
    assert theirs.read_text() == "theirs"
    assert victim.is_file() or list(victim.iterdir()) == [theirs]


def test_what_a_package_would_overwrite_is_named(delivery, tmp_path):
    made = deploy(delivery, tmp_path / "out", 2)
    (made.folder / MARK).write_text("")
    with pytest.raises(UsageError, match="hospital_delivery_interfaces was not written by a deployment"):
        deploy(delivery, made.folder, 2)


def test_on_a_full_disk_the_earlier_deployment_stays(delivery, tmp_path, monkeypatch):
    made = deploy(delivery, tmp_path / "out", 1)
    before = {file: file.read_bytes() for file in made.folder.rglob("*") if file.is_file()}
    written = []

    def full(path, text):
        written.append(path)
        if len(written) > 20:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        write_text(path, text)

    monkeypatch.setattr(generation, "write_text", full)
    with pytest.raises(UsageError, match="cannot be written: No space left on device"):
        deploy(delivery, made.folder, 2)
    assert {file: file.read_bytes() for file in made.folder.rglob("*") if file.is_file()} == before
    with pytest.raises(UsageError, match="No space left"):
        deploy(delivery, tmp_path / "new", 2)
    assert list((tmp_path / "new").iterdir()) == []


def test_a_package_holds_only_the_code_that_its_computer_executes(delivery, tmp_path):
    made = deploy(delivery, tmp_path / "out", 2)

    def code(package):
        model = made.folder / package / package / "model" / "components"
        return {file.name for file in model.iterdir() if file.stat().st_size}

    assert code(made.packages["ground"]) == {"delivery_central.py", "delivery_types.py", "route_generator.py"}
    assert "rover_control.py" not in code(made.packages["onboard_1"])
    assert "delivery_central.py" not in code(made.verification)


def test_a_component_in_cpp_has_its_sources_and_headers(tmp_path):
    system = pair(tmp_path / "model", "c++", "loop.cpp")
    (tmp_path / "model" / "loop.hpp").write_text("struct Loop { void run() {} };")
    made = deploy(system, tmp_path / "out", 1)
    model = made.folder / made.packages["pc-1"] / "model"
    assert {file.name for file in model.iterdir()} == {"loop.cpp", "loop.hpp", "model.yaml"}
    assert "apt-get install g++" in (made.folder / "README.md").read_text()


@pytest.mark.parametrize("ros", [1, 2])
def test_the_readme_works_as_it_is_typed(delivery, tmp_path, ros):
    made = deploy(delivery, tmp_path / "out", ros)
    typed = (made.folder / "README.md").read_text()
    [block] = [one for one in re.findall(r"```sh\n(.*?)```", typed, re.DOTALL) if "mkdir" in one]
    tools = """
        catkin_make() { mkdir devel; touch devel/setup.bash; }
        colcon() { mkdir install; touch install/setup.bash; }
        roslaunch() { echo $1; }
        ros2() { echo $2; }
        """
    done = subprocess.run(
        ["bash", "-euc", tools + block], cwd=made.folder, env={**os.environ, "HOME": str(tmp_path)},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stdout.split() == [made.verification, next(iter(made.packages.values()))]
    built = {one.name for one in (tmp_path / "ws" / "src").iterdir()}
    assert built == {*made.packages.values(), made.verification, made.interfaces}


HOSTILE = (
    'x"""\nMARK = 1\n' + "'''\n[Service]\nExecStartPre=/bin/mark\n%n <mark a=\"1\"/> & -- \u2028\x85 "
    "`mark` | $(eval mark) \\"
)


@pytest.mark.parametrize("ros", [1, 2])
def test_texts_of_a_model_stay_texts_wherever_they_are_written(tmp_path, ros):
    """Each file says the same as with a harmless name: it has no statement, line or element more."""
    harmless = deploy(pair(tmp_path / "a", name="harmless"), tmp_path / "out_a", ros)
    path = HOSTILE.replace("/", "") + ".py"
    hostile = deploy(pair(tmp_path / "b", name=HOSTILE, path=path), tmp_path / "out_b", ros)
    renamed = dict(zip(names_of(hostile), names_of(harmless), strict=True))
    compared = 0
    for file in sorted(one for one in hostile.folder.rglob("*") if one.is_file()):
        where = file.relative_to(hostile.folder).as_posix()
        for theirs, ours in renamed.items():
            where = where.replace(theirs, ours)
        twin, text = harmless.folder / where, file.read_text()
        if "/model/" in where or not text:
            continue
        compared += 1
        if text.startswith("#!") or file.suffix == ".py":
            assert shape(text) == shape(twin.read_text()), where
        elif file.suffix in (".xml", ".launch"):
            assert elements(file) == elements(twin), where
        else:
            assert len(text.splitlines()) == len(twin.read_text().splitlines()), where
    assert compared > 8
    unit = next(hostile.folder.rglob("*.service")).read_text()
    assert "%n" not in unit.replace("%%", "")
    assert re.search(r"^Description=.*[^\\]$", unit, re.MULTILINE)


def names_of(made):
    return [*made.packages.values(), made.verification, made.interfaces]


def shape(text):
    """The statements of a Python file, without what its texts say."""
    return [type(node).__name__ for node in ast.walk(ast.parse(text))]


def elements(file):
    return [(one.tag, sorted(one.attrib)) for one in etree.parse(file).iter()]


MODEL = """
volery: 1
name: NAME
components: {Loop: {language: LANGUAGE, path: PATH, active: {period: 1 s}}}
application: {a: {is: Loop}, b: {is: Loop}}
platform:
  processors:
    pc-1: {is: rpi4-cortex-a72, frequency: 1500 MHz}
    pc_1: {is: rpi4-cortex-a72, frequency: 1500 MHz}
allocations: {one: {a: pc-1, b: pc-1}, two: {a: pc-1, b: pc_1}}
"""


def pair(folder, language="python", path="loop.py", allocation="one", name="pair"):
    folder.mkdir()
    (folder.parent / "outside.py").write_text("class Loop:\n    def run(self): ...\n")
    for file in ("loop.py", path) if path.endswith(".py") else ("loop.py",):
        (folder / file).write_text("class Loop:\n    def run(self): ...\n")
    (folder / "loop.cpp").write_text("")
    text = MODEL.replace("LANGUAGE", language).replace("PATH", json.dumps(path))
    text = text.replace("NAME", json.dumps(name))
    (folder / "model.yaml").write_text(text)
    return load(folder, vocabulary(), allocation=allocation)


def test_what_cannot_be_deployed(tmp_path):
    with pytest.raises(UsageError, match="pc-1 and pc_1 would both be the package pair_pc_1"):
        deploy(pair(tmp_path / "names", allocation="two"), tmp_path / "out", 1)
    with pytest.raises(UsageError, match="--ros 3: there is 1 or 2"):
        deploy(pair(tmp_path / "ros"), tmp_path / "out", 3)


def test_names_of_packages():
    assert package_name("Hospital-Delivery", "On board 1") == "hospital_delivery_on_board_1"
    assert package_name("3d", "pc") == "pkg_3d_pc"
