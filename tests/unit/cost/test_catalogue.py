import math
from pathlib import Path

import pytest

from volery.base.errors import EstimateError, ModelError
from volery.cost import load_catalogue, scale_energy, scale_time
from volery.cost.catalogue import parse_catalogue
from volery.cost.figures import WithProvenance
from volery.cost.python_operations import STEPS_PER_NS, operation_table

INTEL, ARM, HOST = "intel-i5-3470", "rpi4-cortex-a72", "generic-host"


def stated_in(value: object) -> list[WithProvenance]:
    """Everything below *value* that says where it comes from."""
    found = [value] if isinstance(value, WithProvenance) else []
    if isinstance(value, dict):
        children = list(value.values())
    else:
        children = list(vars(value).values()) if hasattr(value, "__dict__") else []
    for child in children:
        found += stated_in(child)
    return found


def test_every_figure_says_where_it_comes_from() -> None:
    figures = stated_in(dict(load_catalogue().processors))
    assert len(figures) > 30
    assert all(figure.source for figure in figures)


def test_processors_and_their_ranges() -> None:
    intel, arm = load_catalogue().processor(INTEL), load_catalogue().processor(ARM)
    assert (intel.cores, intel.least_mhz, intel.greatest_mhz) == (4, 1600, 3000)
    assert (arm.cores, arm.least_mhz, arm.greatest_mhz) == (4, 600, 1500)
    arm.check_frequency(600)
    arm.check_frequency(1500)
    for outside in (599, 1501):
        with pytest.raises(EstimateError, match=rf"{ARM}: {outside} MHz is outside.*600 to 1500 MHz"):
            arm.check_frequency(outside)


def test_the_settings_of_processors() -> None:
    intel, arm = load_catalogue().processor(INTEL), load_catalogue().processor(ARM)
    assert arm.set_to() == (600, 700, 800, 900, 1000, 1100, 1200, 1300, 1400, 1500)
    assert intel.settings is not None
    assert intel.settings.mhz() == tuple(range(1600, 3201, 100))
    assert intel.set_to()[-1] == 3000  # the laws end there
    assert load_catalogue().processor(HOST).set_to() == ()


def test_an_unknown_processor_names_the_known_ones() -> None:
    with pytest.raises(
        EstimateError, match=r"'rpi4-cortex-a27'.*did you mean 'rpi4-cortex-a72'.*generic-host"
    ):
        load_catalogue().processor("rpi4-cortex-a27")


def test_a_missing_figure_is_an_error() -> None:
    host = load_catalogue().processor(HOST)
    with pytest.raises(EstimateError, match="generic-host: the catalogue has no figures of ROS calls"):
        host.ros_law("roscpp")
    with pytest.raises(EstimateError, match="generic-host: the catalogue has no power figures"):
        host.power_law()
    with pytest.raises(EstimateError, match="no figure for counted cobol code"):
        host.code_law("cobol")


def test_the_power_of_a_raspberry_pi_is_inside_the_published_readings() -> None:
    law = load_catalogue().processor(ARM).power_law()
    assert 2.2 <= law.watts(0, 1500) <= 2.8
    assert 5.1 <= law.watts(4, 1500) <= 6.5
    assert law.watts(4, 600) < law.watts(4, 1500)
    assert law.watts(2, 1500) == (law.watts(0, 1500) + law.watts(4, 1500)) / 2
    assert law.band() == 0.2


def test_energy_is_power_over_time() -> None:
    law = load_catalogue().processor(ARM).power_law()
    assert math.isclose(law.joules(30.0, 10.0, 1500), law.watts(3.0, 1500) * 10.0)


def test_the_power_of_a_core_goes_with_frequency_and_voltage_squared() -> None:
    law = load_catalogue().processor(INTEL).power_law()
    assert law.core_w(3400) == 13.2
    assert math.isclose(law.core_w(1600), 13.2 * 1600 / 3400 * (0.85 / 1.05) ** 2)


def test_times_scale_with_the_clock_on_the_same_kind_only() -> None:
    assert scale_time(2_000_000, (ARM, 1500), (ARM, 600)) == 5_000_000
    assert scale_time(2_000_000, (ARM, 1500), (ARM, 1500)) == 2_000_000
    with pytest.raises(EstimateError, match=f"stated for {ARM} says nothing about {INTEL}"):
        scale_time(1, (ARM, 1500), (INTEL, 1600))
    with pytest.raises(EstimateError, match="0 MHz"):
        scale_time(1, (ARM, 1500), (ARM, 0))


def test_energies_scale_with_the_voltage_squared() -> None:
    law = load_catalogue().processor(ARM).power_law()
    assert math.isclose(scale_energy(3e-3, (ARM, 1500), (ARM, 600), law), 3e-3 * (0.80 / 0.88) ** 2)


def test_counted_code_states_its_error() -> None:
    law = load_catalogue().processor(ARM).code_law()
    assert math.isclose(law.ns_per_step(1500), 6.1 / STEPS_PER_NS)
    assert math.isclose(law.ns_per_step(600), 2.5 * law.ns_per_step(1500))
    table = operation_table()
    assert law.error == table.mean_error + 0.35
    [warning] = law.warnings()
    assert "rpi4-cortex-a72" in warning
    assert f"{table.mean_error:.0%} on average, {table.worst_error:.0%} at worst" in warning
    assert "estimated within 35%" in warning


def test_a_measured_slowdown_has_no_warning() -> None:
    law = load_catalogue().processor(ARM).code_law()
    measured = law.slowdown.model_copy(update={"provenance": "measured", "error": None})
    law = law.model_copy(update={"slowdown": measured})
    assert law.warnings() == ()
    assert "expected error unknown" in law.how_good()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("processors: {x: {cors: 4}}", r"processors\.x\.cors"),
        ("processors: [", "not YAML"),
        ("- 1", "dict|object|mapping"),
    ],
)
def test_a_broken_catalogue_is_a_model_error(text: str, words: str) -> None:
    with pytest.raises(ModelError, match=rf"(?i){words}"):
        parse_catalogue(text)


MORE = f"""
processors:
  my-computer:
    description: measured
    source: a campaign
    cores: 2
    least_mhz: 2600
    greatest_mhz: 2600
  {ARM}:
    description: measured
    source: a campaign
    cores: 4
    least_mhz: 1800
    greatest_mhz: 1800
    ros:
      rospy: {{client: rospy, provenance: measured, source: a campaign, error: 0.1,
              least_mhz: 1800, greatest_mhz: 1800, calls: {{}}}}
"""


def test_a_catalogue_of_ones_own_adds_processors_and_laws(tmp_path: Path) -> None:
    file = tmp_path / "more.yaml"
    file.write_text(MORE, encoding="utf-8")
    more = load_catalogue(file)
    assert more.processor("my-computer").greatest_mhz == 2600
    arm = more.processor(ARM)
    assert (arm.least_mhz, arm.greatest_mhz, sorted(arm.ros)) == (600, 1800, ["roscpp", "rospy"])
    assert arm.power == load_catalogue().processor(ARM).power
    assert arm.settings == load_catalogue().processor(ARM).settings
    assert "my-computer" not in load_catalogue().processors


def test_a_missing_catalogue_is_named(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"nowhere\.yaml: this catalogue cannot be read"):
        load_catalogue(tmp_path / "nowhere.yaml")


@pytest.mark.parametrize(
    ("kind", "cores", "mhz"),
    [
        ("rpi5-cortex-a76", 4, (1500, 2400)),
        ("rpi-zero-2w-cortex-a53", 4, (600, 1000)),
        ("jetson-orin-nano-cortex-a78ae", 6, (1500, 1500)),
        ("stm32h743-cortex-m7", 1, (480, 480)),
    ],
)
def test_computers_of_which_little_is_published(kind: str, cores: int, mhz: tuple[int, int]) -> None:
    entry = load_catalogue().processor(kind)
    assert (entry.cores, entry.least_mhz, entry.greatest_mhz) == (cores, *mhz)
    with pytest.raises(EstimateError, match="no figures of ROS calls"):
        entry.ros_law("roscpp")
    with pytest.raises(EstimateError, match="no power figures"):
        entry.power_law()
    with pytest.raises(EstimateError, match="no figures of compiled code"):
        entry.core_law()


@pytest.mark.parametrize("kind", ["rpi5-cortex-a76", "rpi-zero-2w-cortex-a53"])
def test_an_estimated_factor_states_its_error(kind: str) -> None:
    factor = load_catalogue().processor(kind).code_law().slowdown
    assert factor.provenance == "estimated"
    assert factor.error is not None
    assert factor.error >= 0.5
    assert "Raspberry Pi 4" in factor.source


@pytest.mark.parametrize("kind", ["jetson-orin-nano-cortex-a78ae", "stm32h743-cortex-m7"])
def test_a_missing_factor_is_an_error_and_not_zero(kind: str) -> None:
    with pytest.raises(EstimateError, match="no figure for counted python code"):
        load_catalogue().processor(kind).code_law()
