from pathlib import Path

import pytest

from volery.base.errors import UsageError
from volery.calibration.host_machine import Machine, at_frequency, put_law, this_machine
from volery.cost import CodeLaw, Figure

INTEL = "model name\t: Intel(R) Core(TM) i5-3470 CPU @ 3.20GHz\ncpu MHz\t\t: 1599.998\n" * 2


def cpuinfo(folder: Path, text: str = INTEL) -> Path:
    file = folder / "cpuinfo"
    file.write_text(text)
    return file


def test_a_machine_is_named_after_its_processor(tmp_path: Path) -> None:
    machine = this_machine(cpuinfo=cpuinfo(tmp_path))
    assert (machine.name, machine.frequency_mhz) == ("intel-core-i5-3470", 1600.0)
    assert machine.description == "Intel(R) Core(TM) i5-3470 CPU @ 3.20GHz"
    assert this_machine("desk", cpuinfo(tmp_path)).name == "desk"


def test_without_linux_there_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="calibrating needs Linux"):
        this_machine(cpuinfo=tmp_path / "nowhere")


MACHINE = Machine("m", "a machine", 2, 2600.0)


def test_a_frequency_that_cannot_be_set_is_kept(tmp_path: Path) -> None:
    with at_frequency(MACHINE, None, tmp_path) as mhz:
        assert mhz == 2600.0
    with at_frequency(MACHINE, 2601.0, tmp_path) as mhz:
        assert mhz == 2601.0
    refused = pytest.raises(UsageError, match="runs at 2600 MHz, and its frequency cannot be set here")
    with refused, at_frequency(MACHINE, 1300.0, tmp_path):
        pass


def test_the_frequency_is_set_on_all_cores_and_restored(tmp_path: Path) -> None:
    limits = {}
    for number in range(2):
        folder = tmp_path / f"cpu{number}" / "cpufreq"
        folder.mkdir(parents=True)
        for name, khz in (("scaling_min_freq", "800000"), ("scaling_max_freq", "2600000")):
            limits[folder / name] = khz
            (folder / name).write_text(khz)
    with at_frequency(MACHINE, 1300.0, tmp_path) as mhz:
        assert mhz == 1300.0
        assert {file.read_text() for file in limits} == {"1300000"}
    assert {file: file.read_text() for file in limits} == limits


def test_a_host_keeps_the_frequency_of_its_entry(tmp_path: Path) -> None:
    """The reported one varies from moment to moment; laws of one host must hold together."""
    catalogue = tmp_path / "catalogue.yaml"
    law = CodeLaw(
        language="python",
        provenance="measured",
        source="a test",
        slowdown=Figure(value=1.0, provenance="measured", source="a test"),
        at_mhz=1600.0,
    )
    put_law(catalogue, this_machine(cpuinfo=cpuinfo(tmp_path)), ("code", "python"), law, (1600.0, 1600.0))
    now = cpuinfo(tmp_path, INTEL.replace("1599.998", "3040.0"))
    assert this_machine(cpuinfo=now, catalogue=catalogue).frequency_mhz == 1600.0
    assert this_machine(cpuinfo=now).frequency_mhz == 3040.0
    assert this_machine("desk", cpuinfo=now, catalogue=catalogue).frequency_mhz == 3040.0
