import pytest

from volery.base.errors import EstimateError, ModelError
from volery.calibration.host_machine import Machine, put_law
from volery.cost import load_catalogue
from volery.cost.catalogue import parse_catalogue
from volery.cost.code_laws import time_band

MINE = """
processors:
  mine:
    description: a computer
    source: none
    cores: 1
    least_mhz: 100
    greatest_mhz: 200
"""


def test_an_unknown_core_lists_the_known_ones():
    with pytest.raises(EstimateError, match=r"did you mean 'rpi4-cortex-a72'.*intel-i5-3470"):
        load_catalogue().processor("rpi4-cortex-a73")


def test_a_core_runs_at_its_frequencies_only():
    with pytest.raises(EstimateError, match="a72: 2000 MHz is outside the range of its laws, 600 to"):
        load_catalogue().processor("rpi4-cortex-a72").core_law().check_frequency(2000.0)


def test_a_processor_may_have_no_figures_of_compiled_code():
    with pytest.raises(EstimateError, match="mine: the catalogue has no figures of compiled code for it"):
        parse_catalogue(MINE).processor("mine").core_law()


def test_a_wrong_figure_is_an_error():
    with pytest.raises(ModelError, match=r"mine\.core_model\.isa: Field required"):
        parse_catalogue(MINE + "    core_model: {cpu: x86-64}\n", "mine.yaml")


def test_a_model_of_a_core_joins_the_entry_that_is_there(tmp_path):
    shipped = load_catalogue().processor("intel-i5-3470")
    law = shipped.core_law().model_copy(update={"name": "", "width": 2.0})
    file = tmp_path / "more.yaml"
    put_law(file, Machine("intel-i5-3470", "mine", 4, 3000.0), ("core_model",), law, (1600.0, 3000.0))
    joined = load_catalogue(file).processor("intel-i5-3470")
    assert joined.core_law().width == 2.0
    assert joined.ros == shipped.ros


@pytest.mark.parametrize(
    ("cycles", "lost", "measured"),
    [
        (5_588, 0.0, 11_000),  # a filter of 15 states, once, on a Zen 5
        (1_115, 0.0, 9_800),  # a projection of sines and roots, once
        (470_000, 0.05, 480_000),
        (132_755 * 1.7, 0.5, 132_755),  # polygons: unpredictable branches
    ],
)
def test_the_band_of_an_estimate_holds_what_was_measured(cycles, lost, measured):
    band = time_band(cycles, lost)
    assert band.low * cycles <= measured <= band.high * cycles
