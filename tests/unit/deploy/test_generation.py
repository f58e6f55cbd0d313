"""Packages for computers: what is in them, what may not be overwritten, what cannot be deployed."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
from lxml import etree

from volery.base.errors import CapabilityError, UsageError
from volery.deploy.generation import MARK, deploy
from volery.model.system_loader import load
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


MODEL = """
volery: 1
name: pair
components: {Loop: {language: LANGUAGE, path: PATH, active: {period: 1 s}}}
application: {a: {is: Loop}, b: {is: Loop}}
platform:
  processors:
    pc-1: {is: rpi4-cortex-a72, frequency: 1500 MHz}
    pc_1: {is: rpi4-cortex-a72, frequency: 1500 MHz}
allocations: {one: {a: pc-1, b: pc-1}, two: {a: pc-1, b: pc_1}}
"""


def pair(folder, language="python", path="loop.py", allocation="one"):
    folder.mkdir()
    (folder.parent / "outside.py").write_text("class Loop:\n    def run(self): ...\n")
    (folder / "loop.py").write_text("class Loop:\n    def run(self): ...\n")
    (folder / "loop.cpp").write_text("")
    (folder / "model.yaml").write_text(MODEL.replace("LANGUAGE", language).replace("PATH", path))
    return load(folder, vocabulary(), allocation=allocation)


def test_what_cannot_be_deployed(tmp_path):
    with pytest.raises(UsageError, match="pc-1 and pc_1 would both be the package pair_pc_1"):
        deploy(pair(tmp_path / "names", allocation="two"), tmp_path / "out", 1)
    with pytest.raises(CapabilityError, match="a component in c\\+\\+ cannot be a process"):
        deploy(pair(tmp_path / "cpp", "c++", "loop.cpp"), tmp_path / "out", 1)
    with pytest.raises(UsageError, match="--ros 3: there is 1 or 2"):
        deploy(pair(tmp_path / "ros"), tmp_path / "out", 3)


def test_names_of_packages():
    assert package_name("Hospital-Delivery", "On board 1") == "hospital_delivery_on_board_1"
    assert package_name("3d", "pc") == "pkg_3d_pc"
